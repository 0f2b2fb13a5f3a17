"""Runs one fault: the time before, the fault, the time after, and the outcome for viewers."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from benchmarks.faults.site.fault_site import Fault, FaultSite, ProcessExit
from benchmarks.faults.video.stamped_views import StampedViews
from benchmarks.faults.viewing.picture_check import GOP_S, PictureVerdict, check_pictures
from benchmarks.faults.viewing.viewers import Viewer

_VIEWERS = 2
_BEFORE_S = 4.0
_JOIN_S = 20.0
_BACK_S = 40.0
_MAX_EXTRA_S = 150.0
"""Seconds that a fault may take beyond its time, e.g. to start a browser or a slow process."""
_POLL_S = 0.05


@dataclass(slots=True)
class FaultOutcome:
    """The outcome of a fault.

    ``gap_before`` and ``gap_after`` are the longest times without a fresh picture, minus the length of a GOP,
    before and after the fault began; of the worst viewer. ``recovery_s`` is the time from the server's
    readiness to the last viewer's next picture.
    """

    fault: Fault
    began: float = 0.0
    until: float = 0.0
    gap_before: float = 0.0
    gap_after: float = 0.0
    recovery_s: float | None = None
    page_recovery_s: float | None = None
    """Likewise for the page, if it is open."""
    reconnections: int = 0
    received: list[PictureVerdict] = field(default_factory=list)
    gops: tuple[int, int] = (0, 0)
    """Range of the event log with the GOPs decided during the fault."""
    lost: int | None = None
    """GOPs that were shown but not recorded; None: unknown."""
    broken_files: int | None = None
    mismatches: list[str] = field(default_factory=list)
    """Pictures of a network camera whose recorded frame is not the shown one, as text."""
    exits: list[ProcessExit] = field(default_factory=list)
    failed: str = ""
    """Why the measurement failed; empty if it succeeded."""


async def run(fault: Fault, fault_site: FaultSite, views: StampedViews) -> FaultOutcome:
    """Let viewers watch, inject the fault, and check what they received."""
    outcome = FaultOutcome(fault)
    exits_before = len(fault_site.exits)
    try:
        await fault_site.settle()
    except RuntimeError as error:
        outcome.failed = str(error)
        return outcome
    fault_site.viewers = [Viewer(fault_site.url, number) for number in fault_site.people(_VIEWERS)]
    tasks = [asyncio.create_task(viewer.run()) for viewer in fault_site.viewers]
    first = len(fault_site.events.gops)
    try:
        await _wait_for_viewers(fault_site)
        await asyncio.sleep(_BEFORE_S)
        before = [viewer.reconnections for viewer in fault_site.viewers]
        fault_site.ready_times.clear()
        fault_site.page_resumed_at = None
        outcome.began = time.monotonic()
        await asyncio.gather(_inject(fault, fault_site, outcome), asyncio.sleep(fault.seconds))
        if fault.kills_server:
            await _wait_for_recovery(fault_site)
        outcome.until = time.monotonic()
        outcome.reconnections = sum(viewer.reconnections for viewer in fault_site.viewers) - sum(before)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(GOP_S)  # events of the last pictures
    outcome.gops = (first, len(fault_site.events.gops))
    outcome.exits = fault_site.exits[exits_before:]
    received = await asyncio.to_thread(_received, fault_site, views)
    _summarize(outcome, received, fault_site)
    return outcome


async def _inject(fault: Fault, fault_site: FaultSite, outcome: FaultOutcome) -> None:
    try:
        async with asyncio.timeout(fault.seconds + _MAX_EXTRA_S):
            await fault.inject(fault_site)
    except Exception as error:  # noqa: BLE001 — whatever fails, the next faults must run
        outcome.failed = f"{type(error).__name__}: {error}"


async def _wait_for_viewers(fault_site: FaultSite) -> None:
    """Wait, up to a limit, until all viewers receive video and one is shown the network camera, if any."""
    deadline = time.monotonic() + _JOIN_S
    while time.monotonic() < deadline:
        shown = {fault_site.events.shown(viewer.number) for viewer in fault_site.viewers}
        if all(viewer.last_arrival for viewer in fault_site.viewers) and shown.issuperset(
            fault_site.live[:1]
        ):
            return
        await asyncio.sleep(_POLL_S)


async def _wait_for_recovery(fault_site: FaultSite) -> None:
    """Wait, up to a limit, until the server is ready again and all viewers receive video."""
    deadline = time.monotonic() + _BACK_S
    while time.monotonic() < deadline:
        if fault_site.ready_times and all(
            viewer.last_arrival > fault_site.ready_times[0] + GOP_S for viewer in fault_site.viewers
        ):
            return
        await asyncio.sleep(_POLL_S)


def _received(fault_site: FaultSite, views: StampedViews) -> list[PictureVerdict]:
    events, live = fault_site.events, fault_site.live
    return [
        check_pictures(viewer.pictures(), events, viewer.number, fault_site.views or views, live)
        for viewer in fault_site.viewers
    ]


def _summarize(outcome: FaultOutcome, received: Sequence[PictureVerdict], fault_site: FaultSite) -> None:
    outcome.received = list(received)
    began, until = outcome.began, outcome.until
    spans = [viewer.longest_gap(began - _BEFORE_S, began) for viewer in received]
    outcome.gap_before = max(0.0, max(spans, default=0.0) - GOP_S)
    outcome.gap_after = max(
        0.0, max((viewer.longest_gap(began, until) for viewer in received), default=0.0) - GOP_S
    )
    if outcome.fault.kills_server and fault_site.ready_times:
        ready = fault_site.ready_times[0]
        first = [
            min((at for at, _ in viewer.fresh if at > ready - GOP_S), default=None) for viewer in received
        ]
        if all(at is not None for at in first):
            outcome.page_recovery_s = (
                None if fault_site.page_resumed_at is None else max(0.0, fault_site.page_resumed_at - ready)
            )
            outcome.recovery_s = max(0.0, *(at - ready for at in first if at is not None))
