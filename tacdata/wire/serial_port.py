"""Opens a serial port: errors in words, and no needless reset of the board."""

from __future__ import annotations

import errno
import os
import select

import serial
from serial.tools import list_ports

from tacdata.errors import DeviceError
from tacdata.wire.patience import Patience

try:
    import termios
except ImportError:  # Windows has no hang-up flag to clear.
    termios = None

WRITE = 2.0
"""Longest wait for room on a line [s, real time]."""


def ports() -> str:
    """Return the serial ports of this machine, as text."""
    names = [f"{p.device} ({p.description})" if p.description != "n/a" else p.device for p in list_ports.comports()]
    return ", ".join(names) or "this machine shows none"


def usb_identity(port: str) -> str:
    """Return vendor, product and serial number of the USB device behind a port; empty without a serial number."""
    device = next((p for p in list_ports.comports() if os.path.realpath(p.device) == port), None)
    if device is None or not device.serial_number:
        return ""
    return f"{device.vid:04x}:{device.pid:04x} {device.serial_number}"


def open_port(port: str, baud: int, device: str, timeout: float, dtr: bool | None = None) -> serial.SerialBase:
    """Open a port exclusively.

    Linux raises DTR whenever a port is opened (`tty_port_open` of the kernel), and an Arduino resets if DTR was low
    until then: after plugging in, or after a program that lowered it at closing. No program can prevent that first
    reset. The welcome shows it, and the driver reports it.

    Clearing HUPCL keeps DTR up at closing, so that later openings do not reset a board in motion. A pseudo-terminal has
    no DTR. To protect a board at the first opening too, use a capacitor at its reset pin, or ``stty -F PORT -hupcl``
    once while nothing moves.

    Args:
        port: Path, ``COM`` name or pyserial URL.
        baud: Bits per second.
        device: Expected device, for errors.
        timeout: Timeout of one read [s, real time].
        dtr: State of the DTR line after opening; None leaves it raised, as the system sets it.

    Raises:
        DeviceError: If the port is missing, busy, forbidden or no serial port.
    """
    try:
        line = serial.serial_for_url(port, baud, timeout=timeout, write_timeout=WRITE, do_not_open=True)
        # Ports on a network know no lock.
        if "://" not in port:
            line.exclusive = True
        # Set before the port is opened: afterwards the reset has happened.
        if dtr is not None:
            line.dtr = dtr
        line.open()
    except (serial.SerialException, OSError, ValueError) as error:
        raise _refusal(port, device, error) from None
    _keep_dtr(line)
    return line


def read_available(line: serial.SerialBase) -> bytes:
    """Return the received bytes; wait for the first byte at most as long as the port's timeout.

    Raises:
        serial.SerialException: If the line broke (OSError or TypeError on some systems).
    """
    return line.read(max(1, getattr(line, "in_waiting", 0)))


def bytes_waiting(line: serial.SerialBase) -> int:
    """Return the number of bytes that were received and not read yet; 0 for a line that broke."""
    try:
        return getattr(line, "in_waiting", 0)
    except (serial.SerialException, OSError, TypeError):
        return 0


def why_broken(error: Exception) -> str:
    """Return why a line broke, for a person; pyserial's words for a device that is gone are a programmer's."""
    return "the device is gone (unplugged, or switched off)" if "returned no data" in str(error) else str(error)


def write_all(line: serial.SerialBase, data: bytes) -> None:
    """Write all bytes, waiting at most `WRITE` for room.

    pyserial's own limit counts the time in which this computer stood still, after bytes that did go out; then nobody
    knows whether they did.

    Raises:
        serial.SerialException: If there is no room for so long, or the line broke (OSError on some systems).
    """
    handle = getattr(line, "fd", None)
    if not isinstance(handle, int) or termios is None:
        line.write(data)
        return
    # pyserial's own timeout starts again after each part; a controller that takes one byte at a time would hold the
    # caller.
    patience = Patience(WRITE, floor=WRITE)
    while data:
        try:
            data = data[os.write(handle, data) :]
        except BlockingIOError:
            if patience.over():
                raise serial.SerialTimeoutException("it takes no more bytes") from None
            select.select([], [handle], [], 0.05)


def _keep_dtr(line: serial.SerialBase) -> None:
    handle = getattr(line, "fd", None)
    if termios is None or not isinstance(handle, int):
        return
    try:
        attributes = termios.tcgetattr(handle)
        # With HUPCL the system drops DTR when the port is closed, which resets many boards and loses the position.
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(handle, termios.TCSANOW, attributes)
    except (termios.error, OSError):
        return  # a port without modem lines has no DTR to keep


def _refusal(port: str, device: str, error: Exception) -> DeviceError:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT or "FileNotFound" in str(error):
        return DeviceError(
            f"no port {port} for the {device}",
            f"a port that exists: {ports()}",
            "plug it in, or correct port in the rig file",
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return DeviceError(
            f"port {port} of the {device} is in use by another program",
            "a port that nothing else has open",
            "close the other program (G-code sender, serial monitor, another recording)",
        )
    if number in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f"port {port} of the {device} may not be opened by this user",
            "read and write permission",
            "add the user to the group that owns it (often dialout or uucp) and log in again",
        )
    return DeviceError(
        f"port {port} of the {device} cannot be opened: {error}",
        f"a serial port: {ports()}",
        "correct port in the rig file",
    )
