"""Runs one failure: viewers at both services, what they received, and who had which number."""

from __future__ import annotations

import asyncio
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from playwright.async_api import Browser

from benchmarks.faults.failover.failures import FOLLOWER, MOVED_S, Failure, process_of
from benchmarks.faults.failover.two_services import SiteOfServices
from benchmarks.faults.failover.viewers import ClientViewer, HlsPlayer, PageViewer, PlainPlayer, SiteViewer
from benchmarks.faults.outcomes import recording_check
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from benchmarks.faults.viewing.picture_check import GOP_S
from client import Gop

_BEFORE_S = 5.0
"""Seconds for which viewers watch before the failure."""
_AFTER_S = 15.0
"""Seconds for which they watch from its beginning."""
_JOIN_S = 60.0
_AGREE_S = 30.0
"""Seconds within which the services must have the same numbers again."""
_MIN_GOPS = 5
"""GOPs in which a person must have a number: two who meet may be confused for a moment."""
_POLL_S = 0.05


@dataclass(slots=True)
class FailoverOutcome:
    """What viewers noticed of a failure.

    Attributes:
        process: that failed.
        before: seconds without new video before the failure, of the worst viewer.
        others: by kind of viewer at the service that did not fail, seconds without new video.
        own: likewise at the one that did, or whose process did.
        broken: streams of `others` that broke.
        wrong: pictures of another moment than their pulse's.
        changed: people whose number changed, or differs between the services in the end.
        lost: GOPs that a service has shown and not recorded.
        gops: by service, the range of its event log.
    """

    failure: Failure
    process: str = ""
    before: float = 0.0
    others: dict[str, float] = field(default_factory=dict)
    own: dict[str, float] = field(default_factory=dict)
    reconnections: dict[str, int] = field(default_factory=dict)
    broken: int = 0
    wrong: int = 0
    changed: int = 0
    lost: int | None = None
    broken_files: int = 0
    gops: list[tuple[int, int]] = field(default_factory=list)
    failed: str = ""

    @property
    def keeps_promises(self) -> bool:
        """Whether every promise was kept."""
        limit = MOVED_S if self.failure.fails_service else self.failure.noticed_s
        return not (
            self.failed
            or self.broken
            or self.wrong
            or self.changed
            or self.broken_files
            or (self.lost or 0) > 1
            or any(gap > self.failure.noticed_s for gap in self.others.values())
            or any(gap > limit for gap in self.own.values())
        )


async def run(
    failure: Failure, site: SiteOfServices, views: StampedViews, browser: Browser | None
) -> FailoverOutcome:
    """Let viewers watch, make the process fail, and check what they received."""
    outcome = FailoverOutcome(failure)
    try:
        await site.settle()
        leader = await site.leader()
        number = site.services[leader].people(1)[0]
        shown = site.services[leader].events.shown(number) or CAMERAS[0]
        outcome.process, pid = await process_of(failure, site, leader, shown)
    except (RuntimeError, OSError) as error:
        outcome.failed = str(error)
        return outcome
    failing = 1 - leader if failure.target == FOLLOWER else leader
    own, others = _viewers(site, failing, number, views, browser)
    firsts = [len(service.events.gops) for service in site.services]
    tasks = [asyncio.create_task(viewer.run()) for viewer in (*own, *others)]
    try:
        await _wait_until_watching((*own, *others))
        await asyncio.sleep(_BEFORE_S)
        before = {viewer: viewer.reconnections for viewer in (*own, *others)}
        began = time.monotonic()
        await asyncio.gather(failure.inject(site, outcome.process, pid), asyncio.sleep(_AFTER_S))
        until = time.monotonic()
        await site.settle()
        reconnections = {viewer: viewer.reconnections - before[viewer] for viewer in before}
        await _until_services_agree(site, views)
    except (RuntimeError, OSError) as error:
        outcome.failed = str(error)
        return outcome
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    outcome.before = max(viewer.gap(began - _BEFORE_S, began) for viewer in (*own, *others))
    outcome.others = {viewer.kind: viewer.gap(began, until) for viewer in others}
    outcome.own = {viewer.kind: viewer.gap(began, until) for viewer in own}
    outcome.broken = sum(reconnections[viewer] for viewer in others)
    outcome.reconnections = {viewer.kind: reconnections[viewer] for viewer in own}
    clients = [viewer for viewer in (*own, *others) if isinstance(viewer, ClientViewer)]
    outcome.wrong = sum(viewer.check().wrong for viewer in clients)
    outcome.gops = [
        (first, len(service.events.gops)) for first, service in zip(firsts, site.services, strict=True)
    ]
    seen = [
        [gop for _, gop in service.events.gops[first:end]]
        for (first, end), service in zip(outcome.gops, site.services, strict=True)
    ]
    outcome.changed = changed_numbers(seen, views)
    return outcome


def _viewers(
    site: SiteOfServices, failing: int, number: int, views: StampedViews, browser: Browser | None
) -> tuple[list[SiteViewer], list[SiteViewer]]:
    """Return the viewers of the failing service, and those of the other."""
    url, other = site.services[failing].url, site.services[1 - failing].url
    own: list[SiteViewer] = [ClientViewer(url, number, views, other)]
    others: list[SiteViewer] = [ClientViewer(other, number, views)]
    if site.front:
        own += [HlsPlayer(site.front, number, failing), PlainPlayer(site.front, number, failing)]
        others.append(PlainPlayer(site.front, number, 1 - failing))
    if browser is not None:
        own.append(PageViewer(browser, url, number))
    return own, others


async def _wait_until_watching(viewers: Iterable[SiteViewer]) -> None:
    """Wait until all viewers receive video.

    Raises:
        RuntimeError: one does not.
    """
    deadline = time.monotonic() + _JOIN_S
    while waiting := [viewer.kind for viewer in viewers if not viewer.has_begun()]:
        if time.monotonic() > deadline:
            raise RuntimeError(f"no video before the failure: {', '.join(waiting)}")
        await asyncio.sleep(_POLL_S)


def numbers_of(gop: Gop, views: StampedViews) -> dict[int, int]:
    """Return by person of the scene the number that most of their boxes have in a GOP."""
    votes: dict[int, Counter[int]] = defaultdict(Counter)
    for camera, frames in gop.boxes.items():
        for pulse, boxes in enumerate(frames, gop.first):
            for box in boxes:
                person = views.person_of(camera, pulse, box)
                if person is not None:
                    votes[person][box.object] += 1
    return {person: max(numbers, key=numbers.__getitem__) for person, numbers in votes.items()}


def changed_numbers(seen: Sequence[Iterable[Gop]], views: StampedViews) -> int:
    """Return how many people have had several numbers, in one service or in different ones."""
    gops: dict[int, Counter[int]] = defaultdict(Counter)
    for service in seen:
        for gop in service:
            for person, number in numbers_of(gop, views).items():
                gops[person][number] += 1
    return sum(sum(count >= _MIN_GOPS for count in numbers.values()) > 1 for numbers in gops.values())


async def _until_services_agree(site: SiteOfServices, views: StampedViews) -> None:
    """Wait until both services have decided a GOP with the same numbers.

    Raises:
        RuntimeError: they do not.
    """
    deadline = time.monotonic() + _AGREE_S
    while time.monotonic() < deadline:
        newest = [
            {gop.first: gop for _, gop in service.events.gops[-round(_AGREE_S / GOP_S) :]}
            for service in site.services
        ]
        common = max(newest[0].keys() & newest[1].keys(), default=None)
        if common is not None:
            one, other = (numbers_of(gops[common], views) for gops in newest)
            if one and one == other:
                return
        await asyncio.sleep(_POLL_S)
    raise RuntimeError(f"the services have different numbers for {_AGREE_S:g} s")


def check_recordings(outcomes: Sequence[FailoverOutcome], site: SiteOfServices) -> None:
    """Add to each outcome the GOPs that a service has lost, and the files that do not play."""
    for index, service in enumerate(site.services):
        files = recording_check.read(service.recorded)
        recorded = recording_check.recorded_frames(files)
        for outcome in (outcome for outcome in outcomes if outcome.gops):
            begin, end = outcome.gops[index]
            shown = [gop for _, gop in service.events.gops[begin:end]]
            lost = len(set(recording_check.unrecorded(shown, recorded)))
            outcome.lost = max(lost, outcome.lost or 0)
            if shown:
                span = range(shown[0].first, shown[-1].first + shown[-1].frames)
                outcome.broken_files += sum(not file.plays for file in files if file.first in span)
