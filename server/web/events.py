"""Server-sent events (WHATWG HTML, 9.2): what changes, as it changes."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import msgspec

from server.view.channel import Channel, Chunk, Viewer
from server.view.service import BestViewService
from server.web.views import cameras_info, objects_info, site_info
from server.wire.messages import GopChoices

log = logging.getLogger(__name__)

_LIST_EVERY_S = 1.0
_GOPS_KEPT = 4
"""GOP events that whoever comes is given: they cover what the streams start with."""
_QUEUE = 64
"""Events a reader may fall behind."""


def event(name: str, content: Any, event_id: int | None = None) -> bytes:
    """Write one event."""
    head = f"event: {name}\n" + (f"id: {event_id}\n" if event_id is not None else "")
    return head.encode() + b"data: " + msgspec.json.encode(content) + b"\n\n"


class Events:
    """Tells all readers about GOPs at once, and about people and cameras when something has changed."""

    def __init__(self, service: BestViewService) -> None:
        self._service = service
        self._channel = Channel(starts_kept=_GOPS_KEPT, queue_starts=_QUEUE)
        self._told: dict[str, bytes] = {}
        service.on_decision.append(self._on_decision)

    def join(self) -> Viewer:
        """Let a reader in; what it should know first comes first."""
        viewer = self._channel.join()
        for name, content in self._lists().items():
            viewer.put_first(Chunk(event(name, content), start=True))
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Let a reader go."""
        self._channel.leave(viewer)

    async def run(self) -> None:
        """Tell about people and cameras, and keep silent connections alive."""
        while True:
            await asyncio.sleep(_LIST_EVERY_S)
            for name, content in self._lists().items():
                if name == "site":
                    continue  # it carries the time of day and so always differs; it is for newcomers
                data = event(name, content)
                if self._told.get(name) != data:
                    self._told[name] = data
                    self._channel.tell(Chunk(data, start=True))
            self._channel.tell(Chunk(b": here\n\n", start=False))

    def close(self) -> None:
        """End all readers' streams."""
        self._channel.close()

    def _lists(self) -> dict[str, Any]:
        service = self._service
        return {
            "cameras": cameras_info(service),
            "objects": objects_info(service),
            "site": site_info(service),
        }

    def _on_decision(self, choices: GopChoices) -> None:
        self._channel.publish(Chunk(event("gop", choices, choices.first), start=True))
