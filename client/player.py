"""Watching the best view of one object: counted, or recorded to a file."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from yarl import URL

from client.commentary import Commentary, following
from client.fmp4 import BoxReader, Mp4Error
from client.http import (
    AwayError,
    ContractError,
    HttpSettings,
    NotFoundError,
    RefusedError,
    get,
    server_url,
)
from client.recording import Recording, StreamChangedError, recording
from client.sidecar import write_sidecars

_DEFAULT = HttpSettings()


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a recording is."""

    seconds: float
    """Media seconds so far."""
    bytes: int
    camera: str | None
    """Which camera is shown; None as long as it is not known."""
    cuts: int
    """Changes of the camera so far, as far as they are known."""
    reconnections: int
    """How many times the stream had to be opened again."""


@dataclass(frozen=True, slots=True)
class Watched:
    """What came of it."""

    out: Path | None
    """The file; None if nothing was to be recorded."""
    seconds: float
    """Media seconds."""
    bytes: int
    fragments: int
    cuts: int
    reconnections: int
    complete: bool
    """All the seconds asked for are there; False if the server went away for good before."""


Report = Callable[[Progress], None]


async def watch(
    url: str,
    number: int,
    out: Path | None = None,
    seconds: float | None = None,
    progress: Report | None = None,
    *,
    start: str | None = None,
    end: str | None = None,
    settings: HttpSettings = _DEFAULT,
) -> Watched:
    """Follow the best view of object ``number`` for ``seconds`` of media time (None: until cancelled).

    ``start`` and ``end`` are moments: seconds back (``-60``), pulses (``p1250``) or times (ISO 8601); without
    them the stream begins now, and does not end.

    The pictures are the server's own, unchanged; whole fragments only. With ``out`` they are recorded in
    ``out.part``, of which a plain MP4 file is made at the end, and the boxes beside it: WebVTT and ASS.
    Cancelling keeps what is there. When the server goes away it is sought again; if it does not come back,
    what was recorded is kept and ``complete`` is False.

    Raises:
        ValueError: ``url`` is no address.
        NotFoundError: there is no such object.
        RefusedError: ``start`` or ``end`` is no moment, or nothing is kept of that time.
        AwayError: the server could not be reached at all, or never sent any media.
        ContractError: what comes is not such a stream.
        OSError: the file cannot be written.
    """
    server = server_url(url)
    commentary = Commentary(number, keep=out is not None)
    with recording(out, seconds) as record:
        try:
            async with following(url, commentary, settings, start, end):
                session = _Session(record, commentary, progress, start, end)
                complete = await session.run(server / f"objects/{number}/best.mp4", settings)
                if out is not None and record.media_time is not None:
                    await commentary.reach(record.media_time)
        finally:
            _write_beside(out, record, commentary)
    return Watched(
        out,
        record.seconds,
        record.bytes,
        record.fragments,
        session.cuts,
        session.reconnections,
        complete,
    )


async def record(
    url: str, number: int, out: Path, seconds: float | None = None, settings: HttpSettings = _DEFAULT
) -> Watched:
    """Record the best view of object ``number`` to ``out``: ``watch`` without a report."""
    return await watch(url, number, out, seconds, settings=settings)


def _write_beside(out: Path | None, record: Recording, commentary: Commentary) -> None:
    site = commentary.site
    if out is None or site is None or record.begin is None or record.media_time is None:
        return
    first, last = round(record.begin * site.fps), round(record.media_time * site.fps)
    write_sidecars(out, list(commentary.frames(first, last)), first, commentary.number, site)


class _Session:
    """One recording over as many connections as it takes."""

    def __init__(
        self,
        record: Recording,
        commentary: Commentary,
        report: Report | None,
        start: str | None,
        end: str | None,
    ) -> None:
        self._start, self._end = start, end
        self._record = record
        self._commentary = commentary
        self._report = report
        self._camera: str | None = None
        self.cuts = 0
        self.reconnections = 0

    async def run(self, address: URL, settings: HttpSettings) -> bool:
        """Stream until full (True) or the server is gone for good (False)."""
        failures = 0
        while True:
            before = self._record.fragments
            try:
                if await self._connection(self._asking(address), settings):
                    return True
                if self._end is not None and self._record.fragments:
                    return True
                problem = AwayError(f"{address.origin()}: the stream has ended")
            except StreamChangedError:
                return False
            except (AwayError, NotFoundError, RefusedError) as error:
                # A server that has just been restarted does not know its objects yet, nor their past.
                if not isinstance(error, AwayError) and not self._record.fragments:
                    raise
                problem = AwayError(str(error))
            failures = 1 if self._record.fragments > before else failures + 1
            if failures > settings.retries:
                if self._record.fragments:
                    return False
                raise problem
            await asyncio.sleep(settings.backoff(failures))
            self.reconnections += 1

    def _asking(self, address: URL) -> URL:
        """Say where to begin and to end: after an interruption, with the frame after the last one."""
        query = {} if self._end is None else {"to": self._end}
        at, site = self._record.media_time, self._commentary.site
        if at is not None and site is not None and self._start is not None:
            return address.with_query({"from": f"p{round(at * site.fps) + 1}", **query})
        if self._start is not None:
            return address.with_query({"from": self._start, **query})
        return address.with_query(query)

    async def _connection(self, address: URL, settings: HttpSettings) -> bool:
        """Stream over one connection; True when full, False when it has ended."""
        boxes = BoxReader()
        self._record.reconnected()
        async with get(address, settings, "video/mp4") as answer:
            async for data in answer.content.iter_any():
                try:
                    if not self._take(boxes, data):
                        return True
                except StreamChangedError:
                    raise
                except Mp4Error as error:
                    raise ContractError(f"{address} is not a fragmented MP4: {error}") from error
        return False

    def _take(self, boxes: BoxReader, data: bytes) -> bool:
        before, more = self._record.fragments, True
        for box in boxes.feed(data):
            more = self._record.take(box)
            if not more:
                break
            if box.kind == b"mdat":
                self._note_camera()
        if self._record.fragments > before:
            self._tell()
        return more

    def _note_camera(self) -> None:
        camera = self._commentary.camera_at(self._record.media_time)
        if camera is not None and camera != self._camera:
            self.cuts += self._camera is not None
            self._camera = camera

    def _tell(self) -> None:
        if self._report is not None:
            self._report(
                Progress(
                    self._record.seconds, self._record.bytes, self._camera, self.cuts, self.reconnections
                )
            )
