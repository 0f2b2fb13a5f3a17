"""Watching the best view of one object: counted, or recorded to a file."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from client.api import site
from client.http import ClientError, HttpSettings, server_url
from client.model import PersonElsewhere
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
    more_files: tuple[Path, ...] = ()
    """Those of further sites into which the object has gone, in order."""


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
    again; if none comes back, what was recorded is kept and ``complete`` is False. An object that goes to
    another site is followed there live, into another file (``out-2.mp4``): pictures and clock are the site's.

    Raises:
        ValueError: ``url`` is no address.
        NotFoundError: the object is unknown.
        RefusedError: ``start`` or ``end`` is not a time, that time is not recorded, or no such delay.
        AwayError: the server could not be reached at all, or never sent any media.
        ContractError: the response is not such a stream.
        OSError: the file cannot be written.
    """
    watched: list[WatchResult] = []
    left, file = seconds, out
    while True:
        result, place = await _watch_site(url, number, file, left, progress, start, end, delay, settings)
        watched.append(result)
        if left is not None:
            left -= result.seconds
        onward = None if place is None or (left is not None and left <= 0) else _at(place, url, settings)
        if place is None or onward is None:
            return _sum(watched)
        url, settings = onward
        number = place.object
        file = None if out is None else out.with_stem(f"{out.stem}-{len(watched) + 1}")


async def _watch_site(
    url: str,
    number: int,
    out: Path | None,
    seconds: float | None,
    progress: Report | None,
    start: str | None,
    end: str | None,
    delay: str | None,
    settings: HttpSettings,
) -> tuple[WatchResult, PersonElsewhere | None]:
    """Follow the object at one site; return where it has gone, too."""
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
    file = out if record.fragments else None
    result = WatchResult(
        file, record.seconds, record.bytes, record.fragments, session.cuts, session.reconnections, complete
    )
    return result, history.elsewhere if session.has_moved and not complete else None


def _at(place: PersonElsewhere, url: str, settings: HttpSettings) -> tuple[str, HttpSettings] | None:
    """Return another site's or area's address and settings; None: none, or not encrypted as this one is."""
    try:
        there, here = server_url(place.server or ""), server_url(url)
    except ValueError:
        return None
    if here.scheme == "https" and there.scheme != "https":
        return None
    token = settings.token if place.token or place.site is None else None
    return str(there), replace(settings, others=(), token=token)


def _sum(watched: Sequence[WatchResult]) -> WatchResult:
    """Sum up what was watched at one site after another."""
    files = [result.out for result in watched if result.out is not None]
    return WatchResult(
        out=files[0] if files else None,
        seconds=sum(result.seconds for result in watched),
        bytes=sum(result.bytes for result in watched),
        fragments=sum(result.fragments for result in watched),
        cuts=sum(result.cuts for result in watched),
        reconnections=sum(result.reconnections for result in watched),
        complete=watched[-1].complete,
        more_files=tuple(files[1:]),
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
