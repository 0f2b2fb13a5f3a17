"""Watching the best view of one object: counted, or recorded to a file."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from client.api import site
from client.http import ClientError, HttpSettings
from client.recording import Recording, recording
from client.session import Report, Session
from client.sidecar import write_sidecars
from client.spool import Spool
from client.stream_events import ViewHistory, following

_DEFAULT = HttpSettings()


@dataclass(frozen=True, slots=True)
class WatchResult:
    """What was watched or recorded."""

    out: Path | None
    """The file; None if nothing was recorded."""
    seconds: float
    """Media seconds."""
    bytes: int
    fragments: int
    cuts: int
    reconnections: int
    complete: bool
    """Whether all of the requested seconds were received; False if the server stayed away before."""


async def watch(
    url: str,
    number: int,
    out: Path | None = None,
    seconds: float | None = None,
    progress: Report | None = None,
    *,
    start: str | None = None,
    end: str | None = None,
    delay: str | None = None,
    settings: HttpSettings = _DEFAULT,
) -> WatchResult:
    """Follow the best view of object ``number`` for ``seconds`` of media time (None: until cancelled).

    ``start`` and ``end`` are moments: seconds back (``-60``), pulses (``p1250``) or times (ISO 8601); without
    them the stream begins now, and does not end. ``delay`` is one of ``delays``: live, balanced or smooth;
    there is none in the past.

    The pictures are the server's own, unchanged; whole fragments only. With ``out`` they are recorded in
    ``out.part``, which is remuxed into a progressive MP4 at the end, with the boxes beside it: WebVTT and
    ASS. A name that ends in ``.webm`` makes a WebM; the site's codec must then be VP8. Cancelling keeps what
    was recorded. A server that goes away is replaced by another one of ``settings`` or of the site, or tried
    again; if none comes back, what was recorded is kept and ``complete`` is False.

    Raises:
        ValueError: ``url`` is no address.
        NotFoundError: the object is unknown.
        RefusedError: ``start`` or ``end`` is not a time, that time is not recorded, or no such delay.
        AwayError: the server could not be reached at all, or never sent any media.
        ContractError: the response is not such a stream.
        OSError: the file cannot be written.
    """
    container, settings = await _prepare(url, out, settings)
    record: Recording | None = None
    with closing(Spool(Path() if out is None else out.parent)) as spool:
        history = ViewHistory(number, spool=None if out is None else spool)
        try:
            with recording(out, seconds, container) as record:
                async with following(url, history, settings, start, end, delay):
                    session = Session(record, history, progress, start, end, delay)
                    streams = [
                        server / f"objects/{number}/best.{container}" for server in settings.servers(url)
                    ]
                    complete = await session.run(streams, settings)
                    if out is not None and record.media_time is not None:
                        await history.reach(record.media_time)
        finally:  # after the film itself
            if record is not None:
                _write_sidecars(out, record, history)
    return WatchResult(
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
) -> WatchResult:
    """Record the best view of object ``number`` to ``out``: ``watch`` without a report."""
    return await watch(url, number, out, seconds, settings=settings)


async def _prepare(url: str, out: Path | None, settings: HttpSettings) -> tuple[str, HttpSettings]:
    """Return the container to request, that of the file's name or else the site's, and all servers' settings.

    Raises:
        ValueError: ``url`` is no address.
    """
    wanted = None if out is None else "webm" if out.suffix.lower() == ".webm" else "mp4"
    for server in settings.servers(url):
        with suppress(ClientError):  # if all fail, the request for the stream will report the error
            found = await site(str(server), settings)
            return wanted or found.container, settings.failing_over(url, found.others, found.gop / found.fps)
    return wanted or "mp4", settings


def _write_sidecars(out: Path | None, record: Recording, history: ViewHistory) -> None:
    site = history.site
    if out is None or site is None or record.begin is None or record.media_time is None:
        return
    first, last = round(record.begin * site.fps), round(record.media_time * site.fps)
    write_sidecars(out, history.stored_frames(first, last), first, history.number, site)
