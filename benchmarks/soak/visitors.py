"""Who watches a site: some all the time, whose delay is measured, and some who come and go."""

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
"""Who come and go at a soak: so many at once."""
_STAY_S = (1.0, 8.0)
_AHEAD_S = 3.0
"""How far back somebody asks for the past, seconds of the world."""
_TFDT, _TIME_AT = b"tfdt", 8
_TRUN, _COUNT_AT, _ENTRY = b"trun", 8, 12
"""Of a run of samples, as MyView writes it: where their number stands, and the bytes of each."""
_RECEIVED = 65_536
_FAULTS = (aiohttp.ClientError, OSError, TimeoutError, EOFError, ValueError)
_FAMILIAR = (200, 204, 404, 416, 503)
"""Answers that a visitor may get: somebody may be gone, and places are limited."""


@dataclass(frozen=True, slots=True)
class FragmentSpan:
    """A picture of a stream, shown from one pulse to another."""

    pulse: int
    until: int


def shown_by(moof: bytes, fps: float) -> FragmentSpan | None:
    """Return what a fragment shows, by the box before its pictures; None: it is sound, or another box."""
    time, run = moof.find(_TFDT), moof.find(_TRUN)
    if not moof.startswith(b"moof") or min(time, run) < 0:
        return None
    start = int.from_bytes(moof[time + _TIME_AT : time + _TIME_AT + 8], "big")
    count = int.from_bytes(moof[run + _COUNT_AT : run + _COUNT_AT + 4], "big")
    first = run + _COUNT_AT + 8
    lasts = sum(
        int.from_bytes(moof[at : at + 4], "big") for at in range(first, first + _ENTRY * count, _ENTRY)
    )
    return FragmentSpan(round(start * fps / _TIMESCALE), round((start + lasts) * fps / _TIMESCALE))


@dataclass(slots=True)
class StreamDelays:
    """What was seen of a stream since it was last asked."""

    delays: list[float] = field(default_factory=list)
    """Milliseconds from when a pulse was due until its picture was there."""
    holes: int = 0
    """Frames for which there was nothing to show: also a frame that lasts is something."""
    pulse: int = 0
    """The newest."""
    until: int = 0
    """The pulse up to which there is something to show."""

    def take(self, shown: FragmentSpan, delay: float) -> None:
        """Take in a picture that came so many milliseconds after its pulse was due."""
        if self.until:
            self.holes += max(0, shown.pulse - self.until)
        self.pulse, self.until = shown.pulse, shown.until
        self.delays.append(delay)


class Visitors:
    """All who watch. ``coming`` of them come and go. What no viewer may see is counted in ``faults``."""

    def __init__(self, url: str, fps: float, seed: int, coming: int = _VISITORS) -> None:
        self._url, self._fps, self._coming = url, fps, coming
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
                tasks.create_task(self._again(self._watch_camera))
                tasks.create_task(self._again(self._watch_people))
                tasks.create_task(self._again(self._hear_events))
                for _ in range(self._coming):
                    tasks.create_task(self._visit())

    async def _again(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        while True:
            try:
                await work()
            except _FAULTS as error:
                self.faults[f"{work.__name__}: {type(error).__name__}"] += 1
            await asyncio.sleep(_PAUSE_S)

    async def _watch_camera(self) -> None:
        self.camera.until = 0
        async for shown, delay in self._stream(f"/cameras/{CAMERAS[0]}/live.mp4"):
            self.camera.take(shown, delay)
        self.faults["the stream of a camera ended"] += 1

    async def _watch_people(self) -> None:
        """Watch one after the other, whoever is there."""
        number = await self._somebody()
        if number is None:
            return
        until = time.monotonic() + self._random.uniform(*_STAY_S)
        self.person.until = 0
        with contextlib.suppress(aiohttp.ClientResponseError):  # who has just been forgotten
            async for shown, delay in self._stream(f"/objects/{number}/best.mp4"):
                if self.person.until:  # what is there when somebody comes is older than what follows
                    self.person.take(shown, delay)
                self.person.until = shown.until
                if time.monotonic() > until:
                    return

    async def _stream(self, path: str) -> AsyncIterator[tuple[FragmentSpan, float]]:
        """Yield what is shown, and how many milliseconds after its pulse was due it came."""
        async with self._session.get(path) as answer:
            answer.raise_for_status()
            while True:
                try:
                    size = int.from_bytes(await answer.content.readexactly(4), "big")
                    box = await answer.content.readexactly(size - 4)
                except asyncio.IncompleteReadError:
                    return  # as a stream ends whose person is forgotten
                shown = shown_by(box, self._fps)
                if shown is not None:
                    yield shown, 1e3 * (time.time() - self._pulse0 - shown.pulse / self._fps)

    async def _hear_events(self) -> None:
        async with self._session.get("/api/events") as answer:
            async for line in answer.content:
                self.events += line.startswith(b"event:")

    async def _somebody(self) -> int | None:
        async with self._session.get("/api/objects") as answer:
            people = [it["object"] for it in (await answer.json())["objects"] if it["visible"]]
        return self._random.choice(people) if people else None

    async def _visit(self) -> None:
        kinds: dict[str, Callable[[int], Awaitable[object]]] = {
            "film": lambda number: self._read(f"/objects/{number}/best.mp4"),
            "transport stream": lambda number: self._read(f"/objects/{number}/best.ts"),
            "camera": lambda _: self._read(f"/cameras/{self._random.choice(CAMERAS)}/live.mp4"),
            "past": lambda number: self._read(f"/objects/{number}/best.mp4?from=-{_AHEAD_S:g}"),
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
                number = await self._somebody()
                if number is not None:
                    self.visits[kind] += 1
                    await kinds[kind](number)
            except _FAULTS as error:
                self.faults[f"{kind}: {type(error).__name__}"] += 1

    async def _read(self, path: str) -> None:
        """Read whatever comes, for a while."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._random.uniform(*_STAY_S)), self._session.get(path) as answer:
                self._judge(path, answer.status)
                async for _ in answer.content.iter_chunked(_RECEIVED):
                    pass

    async def _stall(self, path: str) -> None:
        """Ask, and never read."""
        url = self._session._build_url(path)  # noqa: SLF001 — aiohttp has no public way to its base
        reader, writer = await asyncio.open_connection(url.host, url.port, limit=1024)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: here\r\n\r\n".encode())
        await asyncio.sleep(self._random.uniform(*_STAY_S))
        writer.transport.abort()
        reader.feed_eof()

    async def _hls(self, number: int) -> None:
        """Play as a player does: the playlist, its head, and every segment once."""
        until, had = time.monotonic() + self._random.uniform(*_STAY_S), set[str]()
        while time.monotonic() < until:
            async with self._session.get(f"/objects/{number}/hls/index.m3u8") as answer:
                self._judge("playlist", answer.status)
                lines = (await answer.text()).splitlines() if answer.ok else []
            new = [it for it in lines if it and not it.startswith("#") and it not in had]
            for name in new:
                async with self._session.get(f"/objects/{number}/hls/{name}") as answer:
                    self._judge("segment", answer.status)
                    await answer.read()
            had.update(new)
            await asyncio.sleep(_PAUSE_S)

    def _judge(self, what: str, status: int) -> None:
        if status not in _FAMILIAR:
            self.faults[f"{what}: {status}"] += 1
