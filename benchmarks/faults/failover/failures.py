"""What fails, and how: processes are killed, frozen and cut off."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from benchmarks.faults.failover.two_services import JOINT, SERVICES, SiteOfServices, TwoServices
from benchmarks.faults.site.fault_site import LEASE_S

_RESTART_S = 1.0
"""Seconds after which a killed process is started again, as its supervisor would."""
_FROZEN_S, _CUT_OFF_S = 4.0, 6.0
LEADER, FOLLOWER, CAMERA = "leading service", "other service", "camera"
"""The camera is the one that most viewers are shown."""
NOTICED_S = 1.0
"""Promised time without new video for those whose service does not fail."""
MOVED_S = 2.0
"""Promised time without new video for those whose service fails."""
SILENT_S = LEASE_S + 1.0
"""Promised time where a camera falls silent, which counts as gone after the lease."""

How = Callable[[Any, str, int], Awaitable[None]]
"""Makes a process fail, by name and id, and returns when it is over."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A process of the site that fails.

    Attributes:
        how: in the table.
        target: SERVICES by their role, `sync`, CAMERA or JOINT.
        inject: makes it fail.
        cuts_off: it needs a host for each process.
        noticed_s: promised time without new video for viewers whose service does not fail.
    """

    how: str
    target: str
    inject: How
    cuts_off: bool = False
    noticed_s: float = NOTICED_S

    @property
    def name(self) -> str:
        """On the command line and in the table."""
        return f"{self.how} {self.target}"

    @property
    def is_joint(self) -> bool:
        """Whether the site tracks jointly."""
        return self.target == JOINT

    @property
    def fails_service(self) -> bool:
        """Whether a best-view service fails."""
        return self.target in {LEADER, FOLLOWER}


async def _kill(site: TwoServices, name: str, pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    if name not in site.processes.processes:
        return  # its service starts it again
    await site.processes.processes[name].wait()
    await asyncio.sleep(_RESTART_S)
    await site.processes.start(name)


async def _freeze(site: TwoServices, name: str, pid: int) -> None:
    del site, name
    os.kill(pid, signal.SIGSTOP)
    try:
        await asyncio.sleep(_FROZEN_S)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)


async def _cut_off(site: TwoServices, name: str, pid: int) -> None:
    del pid
    assert site.hosts is not None  # noqa: S101 — of sites for such failures
    site.hosts.cut(name)
    try:
        await asyncio.sleep(_CUT_OFF_S)
    finally:
        site.hosts.cut(name, is_cut=False)


async def process_of(failure: Failure, site: SiteOfServices, leader: int, shown: str) -> tuple[str, int]:
    """Return the name and the id of the process that is to fail.

    Raises:
        RuntimeError: it does not run.
    """
    if failure.target == JOINT:
        return JOINT, site.joint_tracker(SERVICES[leader])
    services = {LEADER: SERVICES[leader], FOLLOWER: SERVICES[1 - leader], CAMERA: shown}
    name = services.get(failure.target, failure.target)
    return name, site.pid(name)


FAILURES = (
    *(Failure("kill", target, _kill) for target in (LEADER, FOLLOWER, "sync", CAMERA)),
    *(Failure("freeze", target, _freeze) for target in (LEADER, FOLLOWER, "sync")),
    Failure("freeze", CAMERA, _freeze, noticed_s=SILENT_S),
    *(Failure("cut off", target, _cut_off, cuts_off=True) for target in (LEADER, FOLLOWER, "sync")),
    Failure("cut off", CAMERA, _cut_off, cuts_off=True, noticed_s=SILENT_S),
    Failure("kill", JOINT, _kill),
    Failure("freeze", JOINT, _freeze, noticed_s=SILENT_S),
)
"""Those of one kind of site follow each other."""
