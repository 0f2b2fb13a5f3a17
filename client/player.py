"""Watching the best view of one object: counted, or recorded to a file."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from client.api import site
from client.http import ClientError, HttpSettings, server_url
from client.recording import Recording, recording
from client.session import Report, Session
from client.sidecar import write_sidecars
from client.spool import Spool
from client.stream_events import Commentary, following

_DEFAULT = HttpSettings()


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
    ``out.part``, which is remuxed into a progressive MP4 at the end, with the boxes beside it: WebVTT and
    ASS. A name that ends in ``.webm`` makes a WebM; the site's codec must then be VP8. Cancelling keeps what
    was recorded. A server that goes away is tried again; if it does not come back, what was recorded is kept
    and ``complete`` is False.

    Raises:
        ValueError: ``url`` is no address.
        NotFoundError: there is no such object.
        RefusedError: ``start`` or ``end`` is not a time, or nothing is kept of that time.
        AwayError: the server could not be reached at all, or never sent any media.
        ContractError: what comes is not such a stream.
        OSError: the file cannot be written.
    """
    server = server_url(url)
    container = await _container(url, out, settings)
    record: Recording | None = None
    with closing(Spool(Path() if out is None else out.parent)) as spool:
        commentary = Commentary(number, keep=None if out is None else spool)
        try:
            with recording(out, seconds, container) as record:
                async with following(url, commentary, settings, start, end):
                    session = Session(record, commentary, progress, start, end)
                    complete = await session.run(server / f"objects/{number}/best.{container}", settings)
                    if out is not None and record.media_time is not None:
                        await commentary.reach(record.media_time)
        finally:  # the film is there first
            if record is not None:
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


async def _container(url: str, out: Path | None, settings: HttpSettings) -> str:
    """Return which stream to ask for: the file's name says it, or else the server."""
    if out is not None:
        return "webm" if out.suffix.lower() == ".webm" else "mp4"
    try:
        return (await site(url, settings)).container
    except ClientError:
        return "mp4"  # whatever is wrong will be said of the stream


def _write_beside(out: Path | None, record: Recording, commentary: Commentary) -> None:
    site = commentary.site
    if out is None or site is None or record.begin is None or record.media_time is None:
        return
    first, last = round(record.begin * site.fps), round(record.media_time * site.fps)
    write_sidecars(out, commentary.frames(first, last), first, commentary.number, site)
