"""Server-sent events (WHATWG HTML, 9.2): decided GOPs, flags, rules, changes of people and cameras."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import msgspec
from aiohttp import web

from server.http.access.permissions import Scope
from server.http.api.responses import cameras_info, delays_info, objects_info, site_info
from server.http.api.scope_filter import (
    filter_cameras,
    filter_choices,
    filter_event,
    filter_flag,
    filter_objects,
    filter_site,
)
from server.http.periodic import run_periodically
from server.messaging.messages import GopChoices
from server.service.facade.assist import Flag
from server.service.facade.rules import PicturedEvent
from server.service.facade.streams import Broadcaster, BytesChunk, DelayMode, Subscriber
from server.service.service import BestViewService

_LISTS_EVERY_S = 1.0
_GOPS_KEPT = 4
"""Recent GOP events sent to a new subscriber: they cover the GOPs that streams start with."""
_QUEUE = 64
"""Events by which a subscriber may fall behind."""
_ENDED_FLAGS_RESENT = 16
"""Ended flags sent again to subscribers that fell behind and may have received them only as open."""


def event(name: str, content: Any, event_id: int | None = None) -> bytes:
    """Encode one server-sent event."""
    head = f"event: {name}\n" + (f"id: {event_id}\n" if event_id is not None else "")
    return head.encode() + b"data: " + msgspec.json.encode(content) + b"\n\n"


@dataclass(frozen=True, slots=True)
class Audience:
    """Subscribers who receive the same events."""

    scope: Scope
    delay: DelayMode = DelayMode.BALANCED
    token: str | None = None
    """SHA-256 of their token, where it matters for what they may know of other sites."""


@dataclass(slots=True)
class _ScopedEvents:
    """The event stream shared by all subscribers of one scope and delay."""

    channel: Broadcaster
    last_sent: dict[str, bytes] = field(default_factory=dict)
    """By event name, the list event that was sent last."""


class Events:
    """Publishes GOPs and flags at once, and the lists of people and cameras when they change.

    Events are filtered and encoded once for all subscribers of one scope and delay.
    """

    def __init__(self, service: BestViewService) -> None:
        self._service = service
        self._by_scope: dict[Audience, _ScopedEvents] = {}
        self._recent: dict[DelayMode, deque[GopChoices]] = {
            delay: deque(maxlen=_GOPS_KEPT) for delay in DelayMode
        }
        self._closed = False
        service.people.subscribe_decisions(partial(self._on_decision, DelayMode.BALANCED))
        service.people.subscribe_other_decisions(self._on_decision)
        service.assist.subscribe_flags(self._on_flag)
        service.rules.subscribe_events(self._on_rule)

    @property
    def viewers(self) -> int:
        """The number of subscribers."""
        return sum(scoped.channel.viewers for scoped in self._by_scope.values())

    def join(self, audience: Audience) -> Subscriber:
        """Add a subscriber to a delay's decisions; it receives the current lists and open flags first."""
        scoped = self._by_scope.get(audience) or self._add_audience(audience)
        subscriber = scoped.channel.subscribe()
        for flag in self._service.assist.open_flags:
            chunk = self._flag_event(audience.scope, flag)
            if chunk is not None:
                subscriber.put_first(chunk)
        for name, content in self._lists(audience).items():
            subscriber.put_first(BytesChunk(event(name, content), random_access=True))
        return subscriber

    def leave(self, audience: Audience, subscriber: Subscriber) -> None:
        """Remove a subscriber."""
        scoped = self._by_scope[audience]
        scoped.channel.unsubscribe(subscriber)
        if not scoped.channel.viewers:
            del self._by_scope[audience]

    async def run(self) -> None:
        """Publish changed lists, and comments that keep silent connections open."""
        await run_periodically(_LISTS_EVERY_S, self._publish_lists, "publishing people and cameras")

    def close(self) -> None:
        """End all subscribers' streams."""
        self._closed = True
        for scoped in self._by_scope.values():
            scoped.channel.close()

    def _add_audience(self, audience: Audience) -> _ScopedEvents:
        scoped = self._by_scope[audience] = _ScopedEvents(
            Broadcaster(backlog_gops=_GOPS_KEPT, queue_gops=_QUEUE)
        )
        for choices in self._recent[audience.delay]:
            scoped.channel.publish(self._gop_event(audience.scope, choices))
        if self._closed:
            scoped.channel.close()
        return scoped

    async def _publish_lists(self) -> None:
        for audience, scoped in self._by_scope.items():
            self._publish_changed(audience, scoped)

    def _publish_changed(self, audience: Audience, scoped: _ScopedEvents) -> None:
        lists = self._lists(audience)
        for name, content in lists.items():
            if name == "site":
                continue  # it has the time of day, so it always differs; only new subscribers need it
            data = event(name, content)
            if scoped.last_sent.get(name) != data:
                scoped.last_sent[name] = data
                scoped.channel.publish_once(BytesChunk(data, random_access=True))
        for subscriber in scoped.channel.subscribers_with_new_loss():
            for chunk in self._snapshot(audience.scope, lists):
                subscriber.put(chunk)
        scoped.channel.publish_once(BytesChunk(b": here\n\n", random_access=False))

    def _snapshot(self, scope: Scope, lists: dict[str, Any]) -> Iterator[BytesChunk]:
        """Yield the whole state, for subscribers that fell behind and lost events that are sent once."""
        for name, content in lists.items():
            yield BytesChunk(event(name, content), random_access=True)
        assist = self._service.assist
        for flag in [*reversed(assist.ended_flags[:_ENDED_FLAGS_RESENT]), *assist.open_flags]:
            chunk = self._flag_event(scope, flag)
            if chunk is not None:
                yield chunk

    def _lists(self, audience: Audience) -> dict[str, Any]:
        service, scope = self._service, audience.scope
        objects = objects_info(service, audience.token)
        return {
            "delays": delays_info(service, scope),
            "cameras": filter_cameras(cameras_info(service), scope),
            "objects": filter_objects(objects, scope, service.people.current_number),
            "site": filter_site(site_info(service), scope),
        }

    def _gop_event(self, scope: Scope, choices: GopChoices) -> BytesChunk:
        content = filter_choices(choices, scope, self._service.people.current_number)
        return BytesChunk(event("gop", content, choices.first), random_access=True)

    def _flag_event(self, scope: Scope, flag: Flag) -> BytesChunk | None:
        visible = filter_flag(flag, scope, self._service.people.current_number)
        return None if visible is None else BytesChunk(event("flag", visible), random_access=True)

    def _on_flag(self, flag: Flag) -> None:
        for audience, scoped in self._by_scope.items():
            chunk = self._flag_event(audience.scope, flag)
            if chunk is not None:
                scoped.channel.publish_once(chunk)

    def _on_rule(self, found: PicturedEvent) -> None:
        for audience, scoped in self._by_scope.items():
            visible = filter_event(found.record, audience.scope, self._service.people.current_number)
            if visible is not None:
                scoped.channel.publish_once(BytesChunk(event("rule", visible), random_access=True))

    def _on_decision(self, delay: DelayMode, choices: GopChoices) -> None:
        self._recent[delay].append(choices)
        for audience, scoped in self._by_scope.items():
            if audience.delay is delay:
                scoped.channel.publish(self._gop_event(audience.scope, choices))


EVENTS = web.AppKey("events", Events)
