"""Server-sent events (WHATWG HTML, 9.2): what changes, as it changes."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec

from server.http.access.grants import Scope
from server.http.access.scope_filter import cameras_for, choices_for, flag_for, objects_for, site_for
from server.http.api.responses import cameras_info, objects_info, site_info
from server.http.periodic import again_and_again
from server.messaging.messages import GopChoices
from server.service.operator_assist.flags import Flag
from server.service.service import BestViewService
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import BytesChunk, Subscriber

log = logging.getLogger(__name__)

_LIST_EVERY_S = 1.0
_GOPS_KEPT = 4
"""GOP events that whoever comes is given: they cover what the streams start with."""
_QUEUE = 64
"""Events a reader may fall behind."""
_FLAGS_AGAIN = 16
"""Flags that are over, and that whoever fell behind is told of: they may have seen them open."""


def event(name: str, content: Any, event_id: int | None = None) -> bytes:
    """Write one event."""
    head = f"event: {name}\n" + (f"id: {event_id}\n" if event_id is not None else "")
    return head.encode() + b"data: " + msgspec.json.encode(content) + b"\n\n"


@dataclass(slots=True)
class _Line:
    """What readers are told who may see the same."""

    channel: Broadcaster
    told: dict[str, bytes] = field(default_factory=dict)


class Events:
    """Tells all readers about GOPs at once, and about people and cameras when something has changed.

    Each is told what they may see: whoever may see the same hears the same bytes, written once.
    """

    def __init__(self, service: BestViewService) -> None:
        self._service = service
        self._lines: dict[Scope, _Line] = {}
        self._recent: deque[GopChoices] = deque(maxlen=_GOPS_KEPT)
        self._closed = False
        service.on_decision.append(self._on_decision)
        service.assist.flags.on_flag.append(self._on_flag)

    @property
    def viewers(self) -> int:
        """How many are told."""
        return sum(line.channel.viewers for line in self._lines.values())

    def join(self, sees: Scope) -> Subscriber:
        """Let a reader in; what it should know first comes first."""
        line = self._lines.get(sees) or self._new_line(sees)
        viewer = line.channel.subscribe()
        for flag in self._service.assist.flags.open:
            chunk = self._flag(sees, flag)
            if chunk is not None:
                viewer.put_first(chunk)
        for name, content in self._lists(sees).items():
            viewer.put_first(BytesChunk(event(name, content), random_access=True))
        return viewer

    def leave(self, sees: Scope, viewer: Subscriber) -> None:
        """Let a reader go."""
        line = self._lines[sees]
        line.channel.unsubscribe(viewer)
        if not line.channel.viewers:
            del self._lines[sees]

    async def run(self) -> None:
        """Tell about people and cameras, and keep silent connections alive."""
        await again_and_again(_LIST_EVERY_S, self._tell_all, "telling about people and cameras")

    def close(self) -> None:
        """End all readers' streams."""
        self._closed = True
        for line in self._lines.values():
            line.channel.close()

    def _new_line(self, sees: Scope) -> _Line:
        line = self._lines[sees] = _Line(Broadcaster(backlog_gops=_GOPS_KEPT, queue_gops=_QUEUE))
        for choices in self._recent:
            line.channel.publish(self._gop(sees, choices))
        if self._closed:
            line.channel.close()
        return line

    async def _tell_all(self) -> None:
        for sees, line in self._lines.items():
            self._tell(sees, line)

    def _tell(self, sees: Scope, line: _Line) -> None:
        lists = self._lists(sees)
        for name, content in lists.items():
            if name == "site":
                continue  # it carries the time of day and so always differs; it is for newcomers
            data = event(name, content)
            if line.told.get(name) != data:
                line.told[name] = data
                line.channel.publish_once(BytesChunk(data, random_access=True))
        for viewer in line.channel.subscribers_with_new_loss():
            for chunk in self._again(sees, lists):
                viewer.put(chunk)
        line.channel.publish_once(BytesChunk(b": here\n\n", random_access=False))

    def _again(self, sees: Scope, lists: dict[str, Any]) -> Iterator[BytesChunk]:
        """Give all that holds, to who fell behind: what is told only once may be among what they lost."""
        for name, content in lists.items():
            yield BytesChunk(event(name, content), random_access=True)
        flags = self._service.assist.flags
        for flag in [*reversed(flags.ended[:_FLAGS_AGAIN]), *flags.open]:
            chunk = self._flag(sees, flag)
            if chunk is not None:
                yield chunk

    def _lists(self, sees: Scope) -> dict[str, Any]:
        service = self._service
        return {
            "cameras": cameras_for(cameras_info(service), sees),
            "objects": objects_for(objects_info(service), sees, service.board.resolve),
            "site": site_for(site_info(service), sees),
        }

    def _gop(self, sees: Scope, choices: GopChoices) -> BytesChunk:
        content = choices_for(choices, sees, self._service.board.resolve)
        return BytesChunk(event("gop", content, choices.first), random_access=True)

    def _flag(self, sees: Scope, flag: Flag) -> BytesChunk | None:
        narrowed = flag_for(flag, sees, self._service.board.resolve)
        return None if narrowed is None else BytesChunk(event("flag", narrowed), random_access=True)

    def _on_flag(self, flag: Flag) -> None:
        for sees, line in self._lines.items():
            chunk = self._flag(sees, flag)
            if chunk is not None:
                line.channel.publish_once(chunk)

    def _on_decision(self, choices: GopChoices) -> None:
        self._recent.append(choices)
        for sees, line in self._lines.items():
            line.channel.publish(self._gop(sees, choices))
