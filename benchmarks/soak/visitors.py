"""The viewers of a soak test: two permanent ones whose delay is measured, and visitors who come and go."""

from __future__ import annotations

import asyncio
import contextlib
import random
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any

import aiohttp

from benchmarks.soak.accelerated_site import CAMERAS

_TIMESCALE = 90_000
_PATIENCE_S = 20.0
_PAUSE_S = 0.5
_VISITORS = 6
"""Visitors at once."""
_STAY_S = (1.0, 8.0)
_BEHIND_S = 3.0
"""Real seconds by which a time-shifted stream is behind."""
_TFDT, _TIME_AT = b"tfdt", 8
_TRUN, _COUNT_AT, _ENTRY = b"trun", 8, 12
"""In a `trun` box as MyView writes it: the offset of the sample count, and the bytes of an entry."""
_RECEIVED = 65_536
_FAULTS = (aiohttp.ClientError, OSError, TimeoutError, EOFError, ValueError)
_EXPECTED_STATUSES = (200, 204, 404, 416, 503)
"""Expected HTTP statuses: people may be gone, and viewers are limited."""


@dataclass(frozen=True, slots=True)
class FragmentSpan:
    """The pulses that a fragment covers: from `pulse` up to, not including, `until`."""

    pulse: int
    until: int


def fragment_span(moof: bytes, fps: float) -> FragmentSpan | None:
    """Parse the pulses of a fragment from its `moof` box; None: it is audio, or another box."""
    time, run = moof.find(_TFDT), moof.find(_TRUN)
    if not moof.startswith(b"moof") or min(time, run) < 0:
        return None
    start = int.from_bytes(moof[time + _TIME_AT : time + _TIME_AT + 8], "big")
    count = int.from_bytes(moof[run + _COUNT_AT : run + _COUNT_AT + 4], "big")
    first = run + _COUNT_AT + 8
    duration = sum(
        int.from_bytes(moof[at : at + 4], "big") for at in range(first, first + _ENTRY * count, _ENTRY)
    )
    return FragmentSpan(round(start * fps / _TIMESCALE), round((start + duration) * fps / _TIMESCALE))


@dataclass(slots=True)
class StreamDelays:
    """Delays and missing frames of a stream."""

    delays: list[float] = field(default_factory=list)
    """Milliseconds from when a pulse was due until its picture arrived."""
    missing_frames: int = 0
    """Missing frames; a frame that is shown for longer covers those after it."""
    pulse: int = 0
    """The newest pulse received."""
    until: int = 0
    """The end of the newest fragment, a pulse."""

    def add(self, span: FragmentSpan, delay: float) -> None:
        """Add a fragment that arrived so many milliseconds after its pulse was due."""
        if self.until:
            self.missing_frames += max(0, span.pulse - self.until)
        self.pulse, self.until = span.pulse, span.until
        self.delays.append(delay)


class Visitors:
    """All viewers; ``count`` of them come and go. Errors are counted in ``faults``."""

    def __init__(self, url: str, fps: float, seed: int, count: int = _VISITORS) -> None:
        self._url, self._fps, self._count = url, fps, count
        self._random = random.Random(seed)
        self.camera, self.person = StreamDelays(), StreamDelays()
        self.visits: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.events = 0
        self._people: list[int] = []

    async def watch(self) -> None:
        """Watch until cancelled."""
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=_PATIENCE_S, sock_read=_PATIENCE_S)
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(self._url, timeout=timeout, connector=connector) as session:
            self._session = session
            async with session.get("/api/site") as answer:
                self._pulse0 = float((await answer.json())["pulse0"])
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._repeat(self._watch_camera))
                tasks.create_task(self._repeat(self._watch_people))
                tasks.create_task(self._repeat(self._read_events))
                for _ in range(self._count):
                    tasks.create_task(self._visit())

    async def _repeat(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        while True:
            try:
                await work()
            except _FAULTS as error:
                self.faults[f"{work.__name__}: {type(error).__name__}"] += 1
            await asyncio.sleep(_PAUSE_S)

    async def _watch_camera(self) -> None:
        self.camera.until = 0
        async for span, delay in self._stream(f"/cameras/{CAMERAS[0]}/live.mp4"):
            self.camera.add(span, delay)
        self.faults["the stream of a camera ended"] += 1

    async def _watch_people(self) -> None:
        """Watch one visible person after the other."""
        number = await self._visible_person()
        if number is None:
            return
        until = time.monotonic() + self._random.uniform(*_STAY_S)
        self.person.until = 0
        with contextlib.suppress(aiohttp.ClientResponseError):  # the person has just been forgotten
            async for span, delay in self._stream(f"/objects/{number}/best.mp4"):
                if self.person.until:  # the first fragment of a new viewer is older than live
                    self.person.add(span, delay)
                self.person.until = span.until
                if time.monotonic() > until:
                    return

    async def _stream(self, path: str) -> AsyncIterator[tuple[FragmentSpan, float]]:
        """Yield the fragments of a stream with their delay, milliseconds."""
        async with self._session.get(path) as answer:
            answer.raise_for_status()
            while True:
                try:
                    size = int.from_bytes(await answer.content.readexactly(4), "big")
                    box = await answer.content.readexactly(size - 4)
                except asyncio.IncompleteReadError:
                    return  # the stream of a forgotten person ends
                span = fragment_span(box, self._fps)
                if span is not None:
                    yield span, 1e3 * (time.time() - self._pulse0 - span.pulse / self._fps)

    async def _read_events(self) -> None:
        async with self._session.get("/api/events") as answer:
            async for line in answer.content:
                self.events += line.startswith(b"event:")

    async def _visible_person(self) -> int | None:
        async with self._session.get("/api/objects") as answer:
            people = [person["object"] for person in (await answer.json())["objects"] if person["visible"]]
        return self._random.choice(people) if people else None

    async def _visit(self) -> None:
        kinds: dict[str, Callable[[int], Awaitable[object]]] = {
            "film": lambda number: self._read(f"/objects/{number}/best.mp4"),
            "transport stream": lambda number: self._read(f"/objects/{number}/best.ts"),
            "camera": lambda _: self._read(f"/cameras/{self._random.choice(CAMERAS)}/live.mp4"),
            "past": lambda number: self._read(f"/objects/{number}/best.mp4?from=-{_BEHIND_S:g}"),
            "stalled": lambda number: self._stall(f"/objects/{number}/best.mp4"),
            "HLS": self._hls,
            "page": lambda _: self._read("/"),
            "picture": lambda number: self._read(f"/objects/{number}/best.jpg"),
            "events": lambda _: self._read("/api/events"),
        }
        weights = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 1.0]
        while True:
            (kind,) = self._random.choices(list(kinds), weights)
            await asyncio.sleep(self._random.uniform(0.0, 2.0 * _PAUSE_S))
            try:
                number = await self._visible_person()
                if number is not None:
                    self.visits[kind] += 1
                    await kinds[kind](number)
            except _FAULTS as error:
                self.faults[f"{kind}: {type(error).__name__}"] += 1

    async def _read(self, path: str) -> None:
        """Read a response for a while."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._random.uniform(*_STAY_S)), self._session.get(path) as answer:
                self._judge(path, answer.status)
                async for _ in answer.content.iter_chunked(_RECEIVED):
                    pass

    async def _stall(self, path: str) -> None:
        """Request a stream, and never read it."""
        url = self._session._build_url(path)  # noqa: SLF001 — aiohttp has no public way to its base
        reader, writer = await asyncio.open_connection(url.host, url.port, limit=1024)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: here\r\n\r\n".encode())
        await asyncio.sleep(self._random.uniform(*_STAY_S))
        writer.transport.abort()
        reader.feed_eof()

    async def _hls(self, number: int) -> None:
        """Play HLS: the playlist, its init segment, and every segment once."""
        until, fetched = time.monotonic() + self._random.uniform(*_STAY_S), set[str]()
        while time.monotonic() < until:
            async with self._session.get(f"/objects/{number}/hls/index.m3u8") as answer:
                self._judge("playlist", answer.status)
                lines = (await answer.text()).splitlines() if answer.ok else []
            new = [line for line in lines if line and not line.startswith("#") and line not in fetched]
            for name in new:
                async with self._session.get(f"/objects/{number}/hls/{name}") as answer:
                    self._judge("segment", answer.status)
                    await answer.read()
            fetched.update(new)
            await asyncio.sleep(_PAUSE_S)

    def _judge(self, what: str, status: int) -> None:
        if status not in _EXPECTED_STATUSES:
            self.faults[f"{what}: {status}"] += 1
