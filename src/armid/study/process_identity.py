"""Which process this is, told apart from every other without a clock."""

import os
import platform
from contextlib import suppress
from typing import NamedTuple


class ProcessIdentity(NamedTuple):
    """Name a process.

    place: machine, its boot, and the space in which its numbers count (a container has its own). pid: its number.
    start: when it started, in ticks since that boot, "" where the system does not tell: numbers are used again.
    """

    place: str
    pid: int
    start: str


def this_process() -> ProcessIdentity:
    """Return the identity of the running process."""
    return ProcessIdentity(this_place(), os.getpid(), start_of(os.getpid()))


def this_place() -> str:
    """Return what the numbers of processes count in."""
    boot, space = "", ""
    with suppress(OSError), open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
        boot = file.read().strip()
    with suppress(OSError):
        space = os.readlink("/proc/self/ns/pid")
    return "/".join((platform.node(), boot, space))


def start_of(pid: int) -> str:
    """Return when a process started, "" where it does not live or the system does not tell."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
            # the name of the program stands in brackets and may hold anything; the start is 20 fields behind it
            fields = file.read().rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if fields[0] in "ZX" else fields[19]


def is_gone(process: ProcessIdentity) -> bool:
    """Tell whether a process of this place has surely ended; one of another place never surely has."""
    if process.place != this_place():
        return False
    if process.start:
        return start_of(process.pid) != process.start
    try:
        os.kill(process.pid, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False
