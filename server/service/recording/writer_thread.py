"""The thread that writes the recording: a slow or full disk costs it GOPs, and nobody else anything."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from logthrottle import LogThrottle
from server.service.recording.recording_folder import GopRecord

log = logging.getLogger(__name__)

_RETRY_S = 10.0
_SILENT_S = 10.0
"""A disk that takes longer for one GOP does not answer."""
_PATIENCE_S = 1.0
"""How long the end of the service waits for the disk."""


class WriterThread:
    """Hands pieces to ``write`` in a thread of its own; at most ``most`` wait, further ones are left out.

    When ``write`` fails, ``abandon`` is called once, nothing is written for a while, then it is tried again.
    ``where`` is named in the log.
    """

    def __init__(
        self,
        write: Callable[[GopRecord], None],
        abandon: Callable[[], None],
        close: Callable[[], None],
        most: int,
        retry_s: float = _RETRY_S,
        where: str = "",
    ) -> None:
        self._write, self._abandon, self._close = write, abandon, close
        self._most, self._retry_s = most, retry_s
        self._where = where and f" ({where})"
        self._since: float | None = None
        """When what is being written now was begun."""
        self._waiting: deque[GopRecord] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._failing = LogThrottle(quiet_s=0.0)
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self.written = 0
        """GOPs."""
        self.lost = 0
        """GOPs that were not recorded."""
        self.trouble = ""
        """Why nothing is being recorded; empty when all is well."""

    @property
    def stands(self) -> str:
        """Why nothing is being recorded now, also where the disk does not say; empty when all is well."""
        since = self._since  # another thread sets it
        if not self.trouble and since is not None and (silent := time.monotonic() - since) > _SILENT_S:
            return f"the disk has not answered for {silent:.0f} s"
        return self.trouble

    @property
    def waiting(self) -> int:
        """How many pieces wait for the disk."""
        return len(self._waiting)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def put(self, piece: GopRecord) -> None:
        """Have a piece written; never waits."""
        with self._changed:
            if len(self._waiting) >= self._most:
                self.lost += 1
                return
            self._waiting.append(piece)
            self._changed.notify()

    def close(self) -> None:
        """Write what waits and end; a disk that takes longer than a moment is not waited for."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        if self._thread.ident is not None:
            self._thread.join(_PATIENCE_S)

    def _run(self) -> None:
        again_at = 0.0
        while (piece := self._next()) is not None:
            if self.trouble and time.monotonic() < again_at:
                self._lose()
            elif not self._try(piece):
                again_at = time.monotonic() + self._retry_s
        try:
            self._close()
        except OSError as error:
            log.warning("recording: the end could not be written: %s", error.strerror)

    def _next(self) -> GopRecord | None:
        with self._changed:
            while not self._waiting and not self._closing:
                self._changed.wait()
            return self._waiting.popleft() if self._waiting else None

    def _try(self, piece: GopRecord) -> bool:
        self._since = time.monotonic()
        try:
            self._write(piece)
        except OSError as error:
            self.trouble = error.strerror or str(error)
            if (more := self._failing.record(self.trouble)) is not None:
                log.error(  # noqa: TRY400 — says all there is
                    "recording: cannot write: %s%s%s; nothing is recorded until it can be written again, "
                    "which is tried every %.0f s; the streams go on",
                    self.trouble,
                    self._where,
                    more,
                    self._retry_s,
                )
            self._give_up()
            return False
        except Exception as error:
            if (more := self._failing.record(repr(error))) is not None:
                log.exception("recording: a mistake in MyView%s; it is tried again", more)
            self.trouble = "a mistake in MyView"
            self._give_up()
            return False
        finally:
            self._since = None
        self.trouble = ""
        if ended := self._failing.end():
            log.info("recording: goes on, after %.0f s", ended.seconds)
        self.written += 1
        return True

    def _give_up(self) -> None:
        self._lose()
        try:
            self._abandon()
        except Exception as error:  # noqa: BLE001 — whatever it is, it is tried again
            log.debug("recording: cannot tidy up: %r", error)

    def _lose(self) -> None:
        with self._changed:
            self.lost += 1
