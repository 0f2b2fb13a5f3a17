"""Process priorities (nice(1)): who yields where processors are scarce. A lower priority takes no privilege.

The disk is yielded likewise: without a priority of its own a process has one by its niceness (ioprio_set(2)).
"""

from __future__ import annotations

import os

_NICEST = 19


def lower_own_priority(by: int) -> None:
    """Lower the priority of this process below that of its parent by this niceness.

    Called before it has threads: each has a niceness of its own, and begins with that of who begins it.
    """
    _nicer(0, _niceness(os.getppid()) + by)


def lower_priority(pid: int, by: int) -> None:
    """Lower the priority of a child process below that of this one by this niceness.

    What it starts with, libraries that load above all, is then as nice; it may be gone already.
    """
    _nicer(pid, _niceness(0) + by)


def _nicer(pid: int, to: int) -> None:
    """Make a process as nice as that, if it is not nicer: less nice again it cannot become."""
    try:
        if to > _niceness(pid):
            os.setpriority(os.PRIO_PROCESS, pid, min(to, _NICEST))
    except ProcessLookupError:
        return


def _niceness(pid: int) -> int:
    return os.getpriority(os.PRIO_PROCESS, pid)
