"""Hosts of one machine: network namespaces on a bridge, each with a name of its own. Needs root and iproute2."""

import os
import shutil
import signal
import subprocess
from contextlib import suppress

BRIDGE, NET = "tacbr0", "10.77.31"


def possible():
    """Return whether this machine lets us make network namespaces."""
    if os.name != "posix" or os.geteuid() != 0 or not shutil.which("ip") or not shutil.which("unshare"):
        return False
    made = subprocess.run(["ip", "netns", "add", "tacdata-probe"], capture_output=True)
    subprocess.run(["ip", "netns", "delete", "tacdata-probe"], capture_output=True)
    return made.returncode == 0


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Hosts:
    """Named hosts, each with an address; everything goes when the block ends."""

    def __init__(self, *names):
        self.names = names
        self.address = {name: f"{NET}.{k + 1}" for k, name in enumerate(names)}
        self._processes = []

    def __enter__(self):
        self._remove()
        ip("link", "add", BRIDGE, "type", "bridge")
        ip("link", "set", BRIDGE, "up")
        for name in self.names:
            space = f"tac-{name}"
            ip("netns", "add", space)
            ip("link", "add", f"v{name}", "type", "veth", "peer", "name", "eth0", "netns", space)
            ip("link", "set", f"v{name}", "master", BRIDGE)
            ip("link", "set", f"v{name}", "up")
            ip("-n", space, "addr", "add", f"{self.address[name]}/24", "dev", "eth0")
            ip("-n", space, "link", "set", "eth0", "up")
            ip("-n", space, "link", "set", "lo", "up")
        return self

    def __exit__(self, *_):
        for process in self._processes:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        self._remove()

    def _remove(self):
        for name in self.names:
            subprocess.run(["ip", "netns", "delete", f"tac-{name}"], capture_output=True)
        subprocess.run(["ip", "link", "delete", BRIDGE], capture_output=True)

    def start(self, name, command, **options):
        """Start a command on a host, in a process group of its own."""
        inner = f'hostname {name}; exec "$@"'
        line = ["ip", "netns", "exec", f"tac-{name}", "unshare", "--uts", "sh", "-c", inner, "sh", *command]
        process = subprocess.Popen(line, start_new_session=True, **options)
        self._processes.append(process)
        return process

    def kill(self, process):
        """Kill a host's processes as a loss of power would."""
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def cut(self, name):
        """Cut a host's network."""
        ip("link", "set", f"v{name}", "down")

    def mend(self, name):
        """Put the network back."""
        ip("link", "set", f"v{name}", "up")
