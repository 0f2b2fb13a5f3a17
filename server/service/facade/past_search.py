"""Search of the past: who stayed where, and when, as far as decisions are recorded."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass

import msgspec

from server.messaging.epochs import utc_time_of_pulse
from server.service.facade.errors import BusyError, ConflictError, InvalidCommandError, UnknownCameraError
from server.service.past_search.worker import (
    CameraMessage,
    FoundPerson,
    FoundStay,
    RunFiles,
    SearchError,
    SearchTask,
    ZoneMessage,
    run_search,
)
from server.service.pipeline import BestViewPipeline
from server.service.recording.media_files import run_in_reader_thread
from server.service.rules.setup import create_areas

log = logging.getLogger(__name__)

SAMPLE_S = 0.4
"""Seconds between the frames that are looked at."""
ALL = "*"
"""Every zone, or every camera."""
_FILES_MAX = 2000
"""Files of one search: about a day."""
_WORK_S = 5.0
"""Processor seconds of one search; what is left is searched by another."""


@dataclass(frozen=True, slots=True)
class PastQuery:
    """What to search in the pulses ``start … end - 1``.

    Attributes:
        zone: stays in this area; `*`: in each.
        camera: stays in this camera's picture; `*`: in each. With neither, stays anywhere on the site.
        person: number of the only person to search; None: everybody.
        gap_s: seconds of absence within one stay, at most.
        min_s: seconds of a stay, at least.
        order: `time`, `newest` or `longest`.
        limit: stays, and people, in the answer, at most.
        only_camera: the only camera whose boxes count; None: all.
        is_scoped: whether earlier runs, whose numbers are other persons', are left out.
    """

    start: int
    end: int
    zone: str | None = None
    camera: str | None = None
    person: int | None = None
    gap_s: float = 3.0
    min_s: float = 1.0
    order: str = "time"
    limit: int = 100
    only_camera: str | None = None
    is_scoped: bool = False


class PastStay(msgspec.Struct, frozen=True):
    """A stay of a person somewhere, without longer absence."""

    object: int
    """The person's number."""
    run: str | None
    """The folder of an earlier run of the service, whose numbers are other people; null: they are today's."""
    name: str | None
    zone: str | None
    """The area that they stayed in; null: see camera."""
    camera: str | None
    """The camera whose picture they were in; null, without a zone: anywhere on the site."""
    first: int
    """Pulse."""
    frames: int
    begins: str | None
    """UTC, ISO 8601; null before the first pulse."""
    ends: str | None
    seconds: float
    cameras: list[str]
    """Those that saw them there, the most frequent first."""
    clip: str | None
    """URL of the recorded view of the stay, relative to the site's address; null: there is none."""


class PastPerson(msgspec.Struct, frozen=True):
    """A person with a stay."""

    object: int
    run: str | None
    name: str | None
    first: int
    """Pulse of the first sighting in these stays."""
    frames: int
    """From that to the last."""
    begins: str | None
    ends: str | None
    seconds: float
    """The length of their stays; what overlaps counts once."""
    stays: int


class PastSearchResult(msgspec.Struct, frozen=True):
    """Stays of people, as far as they were searched."""

    first: int
    """Pulse."""
    frames: int
    """From that on has been searched."""
    begins: str | None
    ends: str | None
    next: int | None
    """The pulse from which to search on: there was too much for one search; null: all has been searched."""
    zones: list[str]
    """The areas searched, where they are today."""
    placed_by: list[str]
    """The cameras by whose calibration of today places on the floor are determined."""
    found: int
    """The number of stays; the list may be shorter."""
    stays: list[PastStay]
    people: list[PastPerson]
    """By their first sighting."""


class PastSearchService:
    """Searches recorded decisions, one search at a time, in another process."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline
        self._turn = asyncio.Semaphore(1)

    async def search(self, query: PastQuery) -> PastSearchResult:
        """Search.

        Raises:
            InvalidCommandError: there is no such area.
            UnknownCameraError: there is no such camera.
            ConflictError: the area is on the floor, and no camera is calibrated.
            BusyError: the search failed.
        """
        task = self._task(query)
        runs, end = await run_in_reader_thread(self._files, query)  # of a month that are very many
        task = msgspec.structs.replace(task, runs=runs, end=end)
        try:
            async with self._turn:
                result = await run_search(task)
        except SearchError as error:
            log.warning("searching the past: %s", error)
            raise BusyError(f"searching the past: {error}") from error
        names = {} if query.only_camera is not None else self._pipeline.decider.people.registry.names
        on_floor = any(zone.camera is None for zone in task.zones)
        return PastSearchResult(
            first=query.start,
            frames=max(0, result.end - query.start),
            begins=self._time(query.start),
            ends=self._time(result.end),
            next=result.end if result.end < query.end else None,
            zones=[zone.zone for zone in task.zones],
            placed_by=[camera.camera for camera in task.cameras if camera.ground is not None and on_floor],
            found=result.found,
            stays=[self._stay(stay, query, names) for stay in result.stays],
            people=[self._person(person, names) for person in result.people],
        )

    def _task(self, query: PastQuery) -> SearchTask:
        pipeline, recorder = self._pipeline, self._pipeline.recorder
        config, fps = pipeline.config, pipeline.config.site.fps
        zones, by_camera = self._zones(query), self._by_camera(query.camera)
        only = query.only_camera
        cameras = [self._camera(camera) for camera in config.camera_ids if only in {None, camera}]
        if any(zone.camera is None for zone in zones) and not any(camera.ground for camera in cameras):
            if query.zone != ALL:
                raise ConflictError(
                    f"zone: {query.zone} is on the floor, and no calibrated camera has sent pictures yet"
                )
            zones = [zone for zone in zones if zone.camera is not None]
        recent = [choices for choices in recorder.recent.choices(query.start) if choices.first < query.end]
        state = pipeline.decision_state
        return SearchTask(
            start=query.start,
            end=query.end,
            step=max(1, round(SAMPLE_S * fps)),
            gap=math.floor(query.gap_s * fps),
            shortest=math.ceil(query.min_s * fps),
            runs=[],
            recent=b"\n".join(msgspec.json.encode(choices) for choices in recent),
            site_size=config.site.size,
            cameras=cameras,
            zones=zones,
            by_camera=by_camera,
            anywhere=query.zone is None and query.camera is None,
            number=None if query.person is None else state.resolve(query.person),
            merged=state.merged,
            order=query.order,
            limit=query.limit,
            work_s=_WORK_S,
        )

    def _files(self, query: PastQuery) -> tuple[list[RunFiles], int]:
        """Return the files to search, and the pulse before which they are all that there are."""
        runs: list[RunFiles] = []
        recorder, left = self._pipeline.recorder, _FILES_MAX
        same_persons = recorder.sessions_with_same_persons
        for session in recorder.compatible_sessions:
            if session not in same_persons and query.is_scoped:
                continue
            files = session.decision_files(query.start, query.end)
            name = "" if session in same_persons else session.folder.name
            runs.append(RunFiles(name, [str(path) for path in files[:left]]))
            if len(files) > left:
                return runs, max(int(files[left].stem), query.start + 1)
            left -= len(files)
        return runs, query.end

    def _camera(self, camera: str) -> CameraMessage:
        pipeline = self._pipeline
        letterbox, ground = pipeline.decider.people.letterboxes.get(camera), pipeline.decider.ground(camera)
        return CameraMessage(
            camera,
            None if letterbox is None else letterbox.camera_size,
            None if ground is None else ground.tolist(),
            camera in pipeline.config.overhead,
        )

    def _zones(self, query: PastQuery) -> list[ZoneMessage]:
        if query.zone is None:
            return []
        config = self._pipeline.config
        areas = create_areas(config)
        chosen = [area for area in areas if query.zone in {ALL, area.name}]
        if not chosen and query.zone != ALL:
            is_line = query.zone in {zone.id for zone in config.zones}
            known = ", ".join(area.name for area in areas) or "none"
            listed = "" if query.is_scoped else f"; there are {known}" if areas else "; there are none"
            kind = "is a line, in which no one stays" if is_line else "there is no such area"
            raise InvalidCommandError(f"zone: {query.zone[:60]!r}: {kind}{listed}")
        return [ZoneMessage(area.name, area.camera, list(area.corners)) for area in chosen]

    def _by_camera(self, camera: str | None) -> list[str]:
        cameras = list(self._pipeline.config.camera_ids)
        if camera is None:
            return []
        if camera != ALL and camera not in cameras:
            raise UnknownCameraError(camera[:60], cameras)
        return cameras if camera == ALL else [camera]

    def _person(self, person: FoundPerson, names: Mapping[int, str]) -> PastPerson:
        return PastPerson(
            object=person.number,
            run=person.run or None,
            name=None if person.run else names.get(person.number),
            first=person.first,
            frames=person.end - person.first,
            begins=self._time(person.first),
            ends=self._time(person.end),
            seconds=self._seconds(person.frames),
            stays=person.stays,
        )

    def _stay(self, stay: FoundStay, query: PastQuery, names: Mapping[int, str]) -> PastStay:
        return PastStay(
            object=stay.number,
            run=stay.run or None,
            name=None if stay.run else names.get(stay.number),
            zone=stay.zone,
            camera=stay.camera,
            first=stay.first,
            frames=stay.end - stay.first,
            begins=self._time(stay.first),
            ends=self._time(stay.end),
            seconds=self._seconds(stay.end - stay.first),
            cameras=stay.cameras,
            clip=self._clip(stay, query),
        )

    def _clip(self, stay: FoundStay, query: PastQuery) -> str | None:
        """Return the best view of today's person, or of an earlier run's the camera that saw them most."""
        if self._pipeline.config.encode.codec == "vp8":
            return None
        span = f"?from=p{stay.first}&to=p{stay.end}"
        if stay.run or query.only_camera is not None:
            return f"cameras/{stay.cameras[0]}/live.mp4{span}"
        return f"objects/{stay.number}/best.mp4{span}"

    def _time(self, pulse: int) -> str | None:
        return utc_time_of_pulse(pulse, self._pipeline.config.site.fps, self._pipeline.pulses.pulse0)

    def _seconds(self, frames: int) -> float:
        return round(frames / self._pipeline.config.site.fps, 3)
