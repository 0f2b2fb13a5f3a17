"""One fault: a while before it, what it does, a while after it, and the sum of what viewers received."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from benchmarks.faults.site.fault_site import Fault, FaultSite, ProcessExit
from benchmarks.faults.video.stamped_views import StampedViews
from benchmarks.faults.viewing.picture_check import RHYTHM_S, PictureVerdict, judge
from benchmarks.faults.viewing.viewers import Viewer

_VIEWERS = 2
_BEFORE_S = 4.0
_JOIN_S = 20.0
_BACK_S = 40.0
_LONGEST_S = 150.0
"""A fault may take so much longer than it should: a browser starts, a process is slow to load."""
_POLL_S = 0.05


@dataclass(slots=True)
class FaultOutcome:
    """What came of a fault.

    ``ordinary`` and ``without`` are the longest seconds without a fresh picture, less the rhythm of GOPs,
    before and after the fault began; the worst viewer's. The look-ahead is the same before and after, so it
    is in neither. ``back`` is from when the server said that it was ready to the last viewer's next picture.
    """

    fault: Fault
    began: float = 0.0
    until: float = 0.0
    ordinary: float = 0.0
    without: float = 0.0
    back: float | None = None
    page: float | None = None
    """The same of the page, where there is one."""
    reconnections: int = 0
    received: list[PictureVerdict] = field(default_factory=list)
    gops: tuple[int, int] = (0, 0)
    """The GOPs decided meanwhile, by their place in what was told."""
    lost: int | None = None
    """GOPs that were shown but are not recorded; None: not known."""
    broken_files: int | None = None
    unlike: list[str] = field(default_factory=list)
    """What was recorded of a network camera as another picture than viewers were shown, in words."""
    ended: list[ProcessExit] = field(default_factory=list)
    failed: str = ""
    """What kept it from being measured."""


async def run(fault: Fault, stand: FaultSite, views: StampedViews) -> FaultOutcome:
    """Let viewers watch, inject the fault, and judge what they received."""
    outcome = FaultOutcome(fault)
    ended_before = len(stand.ended)
    try:
        await stand.settle()
    except RuntimeError as error:
        outcome.failed = str(error)
        return outcome
    stand.viewers = [Viewer(stand.url, number) for number in stand.people(_VIEWERS)]
    tasks = [asyncio.create_task(viewer.run()) for viewer in stand.viewers]
    first = len(stand.told.gops)
    try:
        await _all_watch(stand)
        await asyncio.sleep(_BEFORE_S)
        before = [viewer.reconnections for viewer in stand.viewers]
        stand.returned.clear()
        stand.page_at = None
        outcome.began = time.monotonic()
        await asyncio.gather(_injected(fault, stand, outcome), asyncio.sleep(fault.seconds))
        if fault.breaks:
            await _all_back(stand)
        outcome.until = time.monotonic()
        outcome.reconnections = sum(viewer.reconnections for viewer in stand.viewers) - sum(before)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(RHYTHM_S)  # events of the last pictures
    outcome.gops = (first, len(stand.told.gops))
    outcome.ended = stand.ended[ended_before:]
    received = await asyncio.to_thread(_received, stand, views)
    _sum_up(outcome, received, stand)
    return outcome


async def _injected(fault: Fault, stand: FaultSite, outcome: FaultOutcome) -> None:
    try:
        async with asyncio.timeout(fault.seconds + _LONGEST_S):
            await fault.inject(stand)
    except Exception as error:  # noqa: BLE001 — a browser, a stream, Docker: the faults after this one go on
        outcome.failed = f"{type(error).__name__}: {error}"


async def _all_watch(stand: FaultSite) -> None:
    """Wait, not for ever, until something has come for all viewers, and one is shown what may break."""
    give_up = time.monotonic() + _JOIN_S
    while time.monotonic() < give_up:
        shown = {stand.told.shown(it.number) for it in stand.viewers}
        if all(it.last_came for it in stand.viewers) and shown.issuperset(stand.live[:1]):
            return
        await asyncio.sleep(_POLL_S)


async def _all_back(stand: FaultSite) -> None:
    """Wait, not for ever, until the server is back and all viewers have some of it: machines may be busy."""
    give_up = time.monotonic() + _BACK_S
    while time.monotonic() < give_up:
        if stand.returned and all(it.last_came > stand.returned[0] + RHYTHM_S for it in stand.viewers):
            return
        await asyncio.sleep(_POLL_S)


def _received(stand: FaultSite, views: StampedViews) -> list[PictureVerdict]:
    told, live = stand.told, stand.live
    return [
        judge(viewer.pictures(), told, viewer.number, stand.views or views, live) for viewer in stand.viewers
    ]


def _sum_up(outcome: FaultOutcome, received: Sequence[PictureVerdict], stand: FaultSite) -> None:
    outcome.received = list(received)
    begun, until = outcome.began, outcome.until
    spans = [it.without(begun - _BEFORE_S, begun) for it in received]
    outcome.ordinary = max(0.0, max(spans, default=0.0) - RHYTHM_S)
    outcome.without = max(0.0, max((it.without(begun, until) for it in received), default=0.0) - RHYTHM_S)
    if outcome.fault.breaks and stand.returned:
        ready = stand.returned[0]
        first = [min((at for at, _ in it.fresh if at > ready - RHYTHM_S), default=None) for it in received]
        if all(at is not None for at in first):
            outcome.page = None if stand.page_at is None else max(0.0, stand.page_at - ready)
            outcome.back = max(0.0, *(at - ready for at in first if at is not None))
