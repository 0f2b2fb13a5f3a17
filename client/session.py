"""A recording session: streams over one connection after another until the recording is complete."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from yarl import URL

from client.http import AwayError, ContractError, HttpSettings, NotFoundError, RefusedError, get
from client.media_stream import FormatChangedError, MediaStreamError
from client.recording import Recording
from client.stream_events import ViewHistory


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a recording."""

    seconds: float
    """Media seconds so far."""
    bytes: int
    camera: str | None
    """The camera shown; None while it is unknown."""
    cuts: int
    """Known changes of the camera so far."""
    reconnections: int
    """Times that the stream was opened again."""


Report = Callable[[Progress], None]


class Session:
    """A recording session: streams over one connection after another until the recording is complete."""

    def __init__(
        self,
        record: Recording,
        history: ViewHistory,
        report: Report | None,
        start: str | None,
        end: str | None,
        delay: str | None = None,
    ) -> None:
        self._start, self._end, self._delay = start, end, delay
        self._record = record
        self._history = history
        self._report = report
        self._camera: str | None = None
        self.cuts = 0
        self.reconnections = 0

    async def run(self, addresses: Sequence[URL], settings: HttpSettings) -> bool:
        """Stream until the recording is complete (return True) or the servers stay away (return False).

        ``addresses`` are those of the stream at the site's servers, which replace each other. It also returns
        False once the object `has_moved`.
        """
        backoff, attempts = settings.backoff(), 0
        while not self.has_moved:
            address = addresses[attempts % len(addresses)]
            before = self._record.fragments
            try:
                if await self._connection(self._resume_address(address), settings):
                    return True
                if self._end is not None and self._record.fragments:
                    return True
                failure = AwayError(f"{address.origin()}: the stream has ended")
            except FormatChangedError:
                return False
            except (AwayError, NotFoundError, RefusedError) as error:
                # A server that has just been restarted does not know its objects yet, nor their past.
                if not isinstance(error, AwayError) and not self._record.fragments:
                    raise
                failure = AwayError(str(error))
            if self._record.fragments > before:
                backoff.reset()
            if backoff.failures >= settings.stream_retries:
                if self._record.fragments:
                    return False
                raise failure
            attempts += 1
            delay = backoff.next()
            await asyncio.sleep(0.0 if attempts % len(addresses) else delay)  # once every server was tried
            self.reconnections += 1
        return False

    @property
    def has_moved(self) -> bool:
        """Whether the object is at another site, where the live stream continues."""
        return self._start is None and self._history.elsewhere is not None

    def _resume_address(self, address: URL) -> URL:
        """Return the address of the remaining stream, which begins after the last received frame."""
        query = {} if self._end is None else {"to": self._end}
        if self._delay is not None:
            query["delay"] = self._delay
        at, site = self._record.media_time, self._history.site
        if at is not None and site is not None and self._start is not None:
            return address.with_query({"from": f"p{round(at * site.fps) + 1}", **query})
        if self._start is not None:
            return address.with_query({"from": self._start, **query})
        return address.with_query(query)

    async def _connection(self, address: URL, settings: HttpSettings) -> bool:
        """Stream over one connection; return True when complete, False when the connection has ended."""
        write = self._record.new_connection_writer()
        async with get(address, settings, f"video/{self._record.container}") as answer:
            async for data in answer.content.iter_any():
                try:
                    if not self._accept_parts(write(data)):
                        return True
                    if self.has_moved:
                        return False
                except FormatChangedError:
                    raise
                except MediaStreamError as error:
                    container = "WebM" if self._record.container == "webm" else "fragmented MP4"
                    where = f"{address.origin()}: its {address.name}"
                    raise ContractError(f"{where} is not a {container}: {error}") from error
        return False

    def _accept_parts(self, accepted: Iterator[bool]) -> bool:
        before = noted = self._record.fragments
        more = True
        for more in accepted:
            if not more:
                break
            if self._record.fragments > noted:
                noted = self._record.fragments
                self._note_camera()
        if self._record.fragments > before:
            self._report_progress()
        return more

    def _note_camera(self) -> None:
        camera = self._history.camera_at(self._record.media_time)
        if camera is not None and camera != self._camera:
            self.cuts += self._camera is not None
            self._camera = camera

    def _report_progress(self) -> None:
        if self._report is not None:
            self._report(
                Progress(
                    self._record.seconds, self._record.bytes, self._camera, self.cuts, self.reconnections
                )
            )
