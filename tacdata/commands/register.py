"""Estimate the pose of the sensor in the guide's frame."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tacdata.commands.command import RECORD, Result, agreed, before_it_moves
from tacdata.errors import Exit, UsageError
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from tacdata.recording.live.guarded_motion import GuardedMotion
    from tacdata.recording.live.interruption import Interruption
    from tacdata.recording.live.lost_position import PositionGuard
    from tacdata.recording.live.rig_devices import RigDevices
    from tacdata.registration import RegistrationSettings
    from tacdata.rig import Rig
    from tacdata.sensor import Sensor

ORDER = 10
PANEL = RECORD
EXAMPLES = (
    "tacdata register --rig rig.yaml",
    "tacdata register --rig rig.yaml --indenter sphere_2 --depth 0.3",
    "tacdata register --rig rig.yaml --taxel 0 --taxel 23 --yes",
)


def run(
    rig: Annotated[Path, typer.Option(help="Rig file; its registration is where the search begins.")],
    out: Annotated[
        Path | None, typer.Option(help="Registration file to write; default: registration.yaml next to the rig file.")
    ] = None,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
    indenter: Annotated[str, typer.Option(help="Spherical specimen that touches.")] = "sphere_2",
    above: Annotated[
        float, typer.Option(min=0.2, max=10.0, help="Height above the expected skin to begin at [mm].")
    ] = 1.0,
    limit: Annotated[
        float, typer.Option(min=0.1, max=5.0, help="How far below the expected skin to search [mm].")
    ] = 1.0,
    depth: Annotated[float, typer.Option(min=0.1, max=1.5, help="Depth of the cross scan's presses [mm].")] = 0.4,
    repeats: Annotated[int, typer.Option(min=1, max=10, help="Slow approaches at each place.")] = 2,
    taxel: Annotated[list[int] | None, typer.Option(help="Taxel of the cross scan; repeat for two or more.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the first move.")] = False,
    confirm_position: Annotated[
        str, typer.Option(metavar="CODE", help="Answer yes to one question about a lost position, by its code.")
    ] = "",
) -> Result:
    """Touch the sensor and find its origin, yaw and tilt in the guide's frame, with uncertainties, into a file."""
    with before_it_moves():
        from tacdata.registration import RegistrationSettings
        from tacdata.rig import read_rig
        from tacdata.sensor import default_sensor, read_sensor

        bench, skin = read_rig(rig), read_sensor(sensor) if sensor else default_sensor()
        target = out or rig.with_name("registration.yaml")
        settings = RegistrationSettings(above, limit, depth, repeats, tuple(taxel or ()))
        specimen = _specimen(indenter)
        _check(settings, skin, target)
    try:
        document, text = _measure(bench, skin, settings, specimen, yes, confirm_position)
    except KeyboardInterrupt as error:
        print("\n".join(["interrupted", *getattr(error, "__notes__", ())]), file=sys.stderr)
        raise typer.Exit(Exit.INTERRUPTED) from None
    from tacdata import documents

    documents.write(target, document, "registration")
    print(f"{text}\nwritten to {target}")
    suggest("record --rig", rig, "--registration", target, "--plan PLAN --out SESSION")
    return Result(document)


def _specimen(name: str) -> dict[str, Any]:
    from tacdata.plans.specimens import specimens

    document = specimens((name,))[name]
    if document["shape"] != "sphere":
        raise UsageError(
            f"indenter {name} ({document['shape']})",
            "a sphere: it touches a tilted skin with one point",
            "choose sphere_2 or sphere_4",
        )
    return document


def _check(settings: RegistrationSettings, sensor: Sensor, target: Path) -> None:
    if target.exists():
        raise UsageError(
            f"{target} exists", "a new file; nothing is overwritten", "move it away, or choose another --out"
        )
    # Beyond half of the skin's thickness a wrong height would press the sphere onto the board below.
    half = sensor.skin.thickness / 2
    if max(settings.limit, settings.depth) > half:
        raise UsageError(
            f"--limit {settings.limit:g} mm, --depth {settings.depth:g} mm on a skin of {sensor.skin.thickness:g} mm",
            f"at most {half:g} mm",
            "search less deep",
        )
    wrong = [k for k in settings.taxels if not 0 <= k < sensor.taxels.count]
    if wrong or len(settings.taxels) == 1:
        raise UsageError(
            f"--taxel {', '.join(map(str, settings.taxels))}",
            f"two or more of 0 to {sensor.taxels.count - 1}",
            "choose taxels at a distance from each other",
        )


def _measure(
    rig: Rig, sensor: Sensor, settings: RegistrationSettings, specimen: dict[str, Any], yes: bool, confirmed: str
) -> tuple[dict[str, Any], str]:
    """Open the devices, ask, and carry the procedure out; return the file's document and the result in words."""
    from tacdata.recording.live.ending import ending
    from tacdata.recording.live.guarded_motion import GuardedMotion
    from tacdata.recording.live.interruption import Interruption
    from tacdata.recording.live.lost_position import PositionGuard
    from tacdata.recording.live.machine_state import MachineState
    from tacdata.recording.live.rig_devices import RigDevices

    with Interruption() as interruption:
        devices = RigDevices.of(rig)
        state = MachineState(rig, devices.cnc)
        guard = PositionGuard(state, devices.cnc, agreed, confirmed)
        motion = GuardedMotion(devices.cnc, rig.clock, interruption, state)
        try:
            return _touch(rig, sensor, settings, specimen, yes, devices, guard, motion, interruption)
        except BaseException as error:
            interruption.last_words()
            data = ("nothing was written",)
            # However it ends, the person is told where the machine is and that nothing was written.
            error.add_note(ending(motion, guard.loss(), data, "the same command", error))
            raise


def _touch(
    rig: Rig,
    sensor: Sensor,
    settings: RegistrationSettings,
    specimen: dict[str, Any],
    yes: bool,
    devices: RigDevices,
    guard: PositionGuard,
    motion: GuardedMotion,
    interruption: Interruption,
) -> tuple[dict[str, Any], str]:
    from tacdata.registration.contact_search import LIFT_SPEED
    from tacdata.registration.guarded_probe import guarded_probe
    from tacdata.registration.procedure import described, register
    from tacdata.registration.result import document_of

    # Travel height: the sphere must clear a skin that is tilted or higher than expected.
    safe = rig.registration.origin[2] + max(3.0, settings.above + 1.0)
    # A lost position is asked about before homing, since homing itself may move into something.
    guard.before_homing(resumed=False)
    with guard.opened(devices):
        controller = devices.cnc.settings()
        print(described(sensor, rig.registration, settings))
        for caution in devices.cnc.cautions:
            print(f"caution: {caution}")
        if controller.get("$22") == "0":
            print(
                "caution: homing is switched off ($22=0): the registration holds until the controller is switched off"
            )
        if not yes and not agreed("Move now? [y/N] "):
            raise UsageError("the summary was not confirmed", "yes", "nothing was moved; start again when ready")
        guard.require_known(safe)
        _mount(rig, specimen)
        show = lambda text: say(f"  {text}")  # noqa: E731
        with guarded_probe(rig, devices, safe, LIFT_SPEED, interruption, motion, show) as probe:
            result = register(probe, sensor, rig.registration, settings, say=show)
    return document_of(result, rig, sensor, specimen, controller), result.text


def _mount(rig: Rig, specimen: dict[str, Any]) -> None:
    if "mounting" in rig.document:
        from tacdata.virtual_rig.world.mounting import mount

        mount(rig.document, specimen)
        return
    if not agreed(f"Mounted: a sphere of radius {specimen['radius']:g} mm? [y/N] "):
        raise UsageError("the indenter was not mounted", "yes", "nothing was moved; start again when it sits")
