"""Server-sent events: bytes in, events out (WHATWG HTML, "Parsing an event stream")."""

from __future__ import annotations

from dataclasses import dataclass

MAX_EVENT = 4_000_000  # bytes: a gop event with the boxes of a crowd has some hundred thousand


class OverlongEventError(ValueError):
    """An event or a line is too large."""


@dataclass(frozen=True, slots=True)
class SentEvent:
    """One event: its name ("message" by default), its data, the last id."""

    name: str
    data: str
    last_id: str


class SseParser:
    """Parses a stream that arrives in pieces."""

    def __init__(self) -> None:
        self._rest = b""
        self._first = True
        self._name = ""
        self._data: list[str] = []
        self._size = 0
        self._last_id = ""

    def feed(self, data: bytes) -> list[SentEvent]:
        """Return the events that ``data`` completes.

        Raises:
            OverlongEventError: an event is larger than MAX_EVENT.
        """
        buffer = self._rest + data
        # A CR at the end may be half of a CR LF: it waits for the next byte.
        last_cr = b"\r" if buffer.endswith(b"\r") else b""
        whole = buffer.removesuffix(b"\r") if last_cr else buffer
        *lines, rest = whole.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        self._rest = rest + last_cr
        if len(self._rest) > MAX_EVENT:
            raise OverlongEventError(f"a line is larger than {MAX_EVENT} bytes")
        events = (self._line(line.decode("utf-8", "replace")) for line in lines)
        return [event for event in events if event is not None]

    def _line(self, line: str) -> SentEvent | None:
        if self._first:
            line = line.removeprefix("\ufeff")
            self._first = False
        if not line:
            return self._dispatch()
        field, _, value = line.partition(":")  # a comment begins with the colon: its field is empty
        value = value.removeprefix(" ")
        if field == "event":
            self._name = value
        elif field == "id" and "\0" not in value:
            self._last_id = value
        elif field == "data":
            self._size += len(value) + 1  # with the line end: empty lines take memory too
            if self._size > MAX_EVENT:
                raise OverlongEventError(f"an event is larger than {MAX_EVENT} bytes")
            self._data.append(value)
        return None

    def _dispatch(self) -> SentEvent | None:
        event = (
            SentEvent(self._name or "message", "\n".join(self._data), self._last_id) if self._data else None
        )
        self._name, self._data, self._size = "", [], 0
        return event
