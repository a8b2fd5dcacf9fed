"""How much memory this process may still take."""

from __future__ import annotations

import sys
from pathlib import Path

if sys.platform != "win32":
    import resource

KIBI = 1024
UNLIMITED = 1 << 60  # what systems write for no limit is beyond
MEMORY = Path("/proc/meminfo")
STATUS = Path("/proc/self/status")
GROUP = Path("/sys/fs/cgroup")


def free_memory_bytes() -> int | None:
    """Tell how much memory is left: of the machine, of a container, and of a limit such as ``ulimit -v``.

    Returns
    -------
    int or None
        The least of them; None where the system does not say.
    """
    found = [_of_machine(), _of_container(), _of_limit()]
    return min((size for size in found if size is not None), default=None)


def _of_machine() -> int | None:
    available = _field(MEMORY, "MemAvailable")
    return None if available is None else KIBI * available


def _of_container() -> int | None:
    most, used = (_number(GROUP / name) for name in ("memory.max", "memory.current"))
    return None if most is None or used is None else max(most - used, 0)


def _of_limit() -> int | None:
    used = _field(STATUS, "VmSize")
    if sys.platform == "win32" or used is None:
        return None
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    return max(most - KIBI * used, 0) if 0 <= most < UNLIMITED else None


def _field(path: Path, name: str) -> int | None:
    """Read the number behind a name and a colon."""
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return None
    words = next((line.split() for line in lines if line.startswith(f"{name}:")), [])
    return int(words[1]) if len(words) > 1 and words[1].isdecimal() else None


def _number(path: Path) -> int | None:
    try:
        text = path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return None
    return int(text) if text.isdecimal() else None
