"""Process priorities (nice(1)); lowering a priority needs no privilege.

The I/O priority follows: without an explicit one it is derived from the niceness (ioprio_set(2)).
"""

from __future__ import annotations

import os

_MAX_NICENESS = 19


def lower_own_priority(below_parent: int) -> None:
    """Set the niceness of this process to that of its parent plus ``below_parent``, if it is lower.

    Called before threads start: each thread inherits the niceness of the thread that starts it.
    """
    _raise_niceness(0, _niceness(os.getppid()) + below_parent)


def lower_priority(pid: int, below_own: int) -> None:
    """Set the niceness of a child process to that of this process plus ``below_own``, if it is lower.

    This also covers its loading of libraries. A child that has exited already is ignored.
    """
    _raise_niceness(pid, _niceness(0) + below_own)


def _raise_niceness(pid: int, to: int) -> None:
    """Raise the niceness of a process; it cannot be lowered again."""
    try:
        if to > _niceness(pid):
            os.setpriority(os.PRIO_PROCESS, pid, min(to, _MAX_NICENESS))
    except ProcessLookupError:
        return


def _niceness(pid: int) -> int:
    return os.getpriority(os.PRIO_PROCESS, pid)
