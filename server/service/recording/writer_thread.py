"""The thread that writes the recording: a slow or full disk loses GOPs, but never blocks the streams."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from logthrottle import LogThrottle
from server.service.recording.recording_folder import GopRecord
from server.system.errors import reason_of

log = logging.getLogger(__name__)

_RETRY_S = 10.0
_SILENT_S = 10.0
"""A disk that takes longer for one GOP counts as not responding."""
_CLOSE_WAIT_S = 1.0
"""Seconds that the shutdown of the service waits for the disk."""


Result = TypeVar("Result")


class WriterThread:
    """Passes GOPs to ``write`` in a separate thread; at most ``max_queued`` wait, more are lost.

    When ``write`` fails, ``abandon`` is called once, and writing is tried again after ``retry_s``. ``where``
    is named in the log.
    """

    def __init__(
        self,
        write: Callable[[GopRecord], None],
        abandon: Callable[[], None],
        close: Callable[[], None],
        max_queued: int,
        retry_s: float = _RETRY_S,
        where: str = "",
    ) -> None:
        self._write, self._abandon, self._close = write, abandon, close
        self._max_queued, self._retry_s = max_queued, retry_s
        self._where = where and f" ({where})"
        self._writing_since: float | None = None
        """When the present write began; None: nothing is being written."""
        self._queue: deque[GopRecord | Callable[[], None]] = deque()
        self._condition = threading.Condition()
        self._closing = False
        self._failing = LogThrottle(quiet_s=0.0)
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self.written = 0
        """GOPs that were recorded."""
        self.lost = 0
        """GOPs that were not recorded."""
        self.error_text = ""
        """The last error; empty after a GOP was written."""

    @property
    def problem(self) -> str:
        """Why nothing is being recorded now, including an unresponsive disk; empty: recording works."""
        since = self._writing_since  # set by the writer thread
        if not self.error_text and since is not None and (silent := time.monotonic() - since) > _SILENT_S:
            return f"the disk has not responded for {silent:.0f} s"
        return self.error_text

    @property
    def queued(self) -> int:
        """The number of GOPs that wait for the disk."""
        return len(self._queue)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def put(self, record: GopRecord) -> None:
        """Queue a GOP without blocking."""
        with self._condition:
            if len(self._queue) >= self._max_queued:
                self.lost += 1
                return
            self._queue.append(record)
            self._condition.notify()

    def run(self, work: Callable[[], Result]) -> Future[Result]:
        """Run work in the thread, after all that was put before; the result has its errors, too."""
        future: Future[Result] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(work())
            except Exception as error:  # noqa: BLE001 — whoever waits handles it
                future.set_exception(error)

        with self._condition:
            self._queue.append(run)
            self._condition.notify()
        return future

    def close(self) -> None:
        """Write what is queued and end; a disk that takes longer than a second is not waited for."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._thread.ident is not None:
            self._thread.join(_CLOSE_WAIT_S)

    def _run(self) -> None:
        retry_at = 0.0
        while (record := self._next()) is not None:
            if not isinstance(record, GopRecord):
                record()
            elif self.error_text and time.monotonic() < retry_at:
                self._count_lost()
            elif not self._try(record):
                retry_at = time.monotonic() + self._retry_s
        try:
            self._close()
        except OSError as error:
            log.warning("recording: cannot close the session: %s", reason_of(error))

    def _next(self) -> GopRecord | Callable[[], None] | None:
        with self._condition:
            while not self._queue and not self._closing:
                self._condition.wait()
            return self._queue.popleft() if self._queue else None

    def _try(self, record: GopRecord) -> bool:
        self._writing_since = time.monotonic()
        try:
            self._write(record)
        except OSError as error:
            self.error_text = reason_of(error)
            if (more := self._failing.record(self.error_text)) is not None:
                log.error(  # noqa: TRY400 — a traceback adds nothing
                    "recording: cannot write: %s%s%s; nothing is recorded until writing succeeds, "
                    "which is tried every %.0f s; the live streams continue",
                    self.error_text,
                    self._where,
                    more,
                    self._retry_s,
                )
            self._abandon_segment()
            return False
        except Exception as error:
            if (more := self._failing.record(repr(error))) is not None:
                log.exception("recording: internal error%s; trying again", more)
            self.error_text = "internal error"
            self._abandon_segment()
            return False
        finally:
            self._writing_since = None
        self.error_text = ""
        if ended := self._failing.end():
            log.info("recording: continues after %.0f s", ended.seconds)
        self.written += 1
        return True

    def _abandon_segment(self) -> None:
        self._count_lost()
        try:
            self._abandon()
        except Exception as error:  # noqa: BLE001 — writing is tried again after any error
            log.debug("recording: cannot abandon the segment: %r", error)

    def _count_lost(self) -> None:
        with self._condition:
            self.lost += 1
