"""One search: reads decisions file by file, collects stays, and selects what is answered."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from server.media.letterbox import Letterbox
from server.rules import Area
from server.service.past_search.places import CameraPlacement, SightedPlaces
from server.service.past_search.sightings import Sightings, read_sightings
from server.service.past_search.stays import Place, RecordedPerson, Stay, StayCollector
from server.service.past_search.worker import FoundPerson, FoundStay, SearchTask, StaySearchResult


def search(task: SearchTask) -> StaySearchResult:
    """Search; files that are missing, as retention may have deleted them, are skipped."""
    cameras = [
        CameraPlacement(
            camera.camera,
            None if camera.size is None else Letterbox(camera.size, task.site_size),
            None if camera.ground is None else np.array(camera.ground, dtype=np.float64),
            camera.is_overhead,
        )
        for camera in task.cameras
    ]
    collector = _Collector(task, cameras)
    began, end = time.process_time(), task.start
    for run, lines in _chunks(task):
        if end > task.start and time.process_time() - began > task.work_s:
            break
        read = read_sightings(lines, collector.indexes, end, task.end, task.step)
        collector.add(run, read)
        end = max(end, read.end)
    else:
        end = task.end
    return _result(task, collector.stays.stays(task.shortest), end)


def _chunks(task: SearchTask) -> Iterator[tuple[str, list[bytes]]]:
    """Yield the run and the lines of each file, in order of time, then the newest lines."""
    for run in task.runs:
        for name in run.files:
            try:
                data = Path(name).read_bytes()
            except OSError:
                continue
            yield run.run, data.splitlines()
    if task.recent:
        yield "", task.recent.splitlines()


class _Collector:
    """Adds the sightings of a file to the stays at each place that the task asks for."""

    def __init__(self, task: SearchTask, cameras: list[CameraPlacement]) -> None:
        self._cameras = cameras
        self.indexes = {camera.name: index for index, camera in enumerate(cameras)}
        self._areas = [Area(zone.zone, tuple(zone.corners), zone.camera) for zone in task.zones]
        self._by_camera, self._anywhere = task.by_camera, task.anywhere
        self._numbers: list[int] | None = None
        if task.number is not None:
            lost = [number for number, kept in task.merged.items() if kept == task.number]
            self._numbers = [task.number, *lost]
        self.stays = StayCollector(task.step, task.gap, task.merged)

    def add(self, run: str, read: Sightings) -> None:
        """Add what was read of one run."""
        for kept, lost in read.merges if run else ():
            self.stays.merge(run, kept, lost)
        if self._numbers is not None:
            if run:
                return  # there the number is another person's
            read = read.of(np.isin(read.numbers, self._numbers))
        if self._anywhere:
            self._put(run, Place(), read)
        for camera in self._by_camera:
            seen = read.cameras == self.indexes.get(camera, -1)
            self._put(run, Place(camera=camera), read.of(seen))
        if self._areas and len(read):
            places = SightedPlaces(read, self._cameras)
            for area in self._areas:
                self._put(run, Place(zone=area.name), places.inside(area))

    def _put(self, run: str, place: Place, sightings: Sightings) -> None:
        self.stays.add(run, place, sightings.pulses, sightings.numbers, sightings.cameras)


def _result(task: SearchTask, stays: list[Stay], end: int) -> StaySearchResult:
    stays.sort(key=lambda stay: (stay.first, stay.person.run, stay.person.number))
    if task.order == "newest":
        stays.reverse()
    elif task.order == "longest":
        stays.sort(key=lambda stay: -stay.frames)
    people: dict[RecordedPerson, list[Stay]] = {}
    for stay in stays:
        people.setdefault(stay.person, []).append(stay)
    summaries = sorted(
        (_person(person, theirs, end) for person, theirs in people.items()),
        key=lambda person: (person.first, person.run, person.number),
    )
    listed = [
        FoundStay(
            stay.person.run,
            stay.person.number,
            stay.place.zone,
            stay.place.camera,
            stay.first,
            min(stay.end, end),
            [
                task.cameras[index].camera
                for index, _ in sorted(stay.seen.items(), key=lambda item: (-item[1], item[0]))
            ],
        )
        for stay in stays[: task.limit]
    ]
    return StaySearchResult(end, listed, summaries[: task.limit], len(stays))


def _person(person: RecordedPerson, stays: list[Stay], until: int) -> FoundPerson:
    frames = end = 0
    for stay in sorted(stays, key=lambda stay: stay.first):
        last = min(stay.end, until)
        frames += max(0, last - max(stay.first, end))
        end = max(end, last)
    first = min(stay.first for stay in stays)
    return FoundPerson(person.run, person.number, first, end, frames, len(stays))
