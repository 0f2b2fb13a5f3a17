"""Publishes a site to an MQTT broker: what has changed, events and pictures; answers commands."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
from collections import deque
from collections.abc import AsyncIterator, Collection, Iterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import aiomqtt
import msgspec

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.config.sections import MqttSettings
from server.integrations.mqtt.discovery import discovery_messages, person_discovery, without_removed
from server.integrations.mqtt.site_reader import SiteReader
from server.integrations.mqtt.site_state import PublishedPerson, Topics, person_content, state_messages
from server.integrations.secret_files import read_secret
from server.service.facade.rules import PicturedEvent, event_without
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)

_EVERY_S = 1.0
"""Seconds between two looks at the site's state."""
_FIRST_S, _MAX_S = 1.0, 60.0
"""Seconds until the connection is tried again: first, and at most."""
_TIMEOUT_S = 10.0
_EVENTS_MAX = 256
"""Events that wait for the broker; the oldest are lost."""
_INCOMING_MAX = 256
_QOS = 1


class MqttPublisher:
    """One connection to a broker, again and again. ``run`` ends by cancellation, after :meth:`end`."""

    def __init__(self, settings: MqttSettings, reader: SiteReader, url: str | None) -> None:
        self._settings, self._reader, self._url = settings, reader, url
        self._topics = Topics(settings.topic, reader.site, reader.area)
        self._events: deque[PicturedEvent] = deque(maxlen=_EVENTS_MAX)
        self._has_events = asyncio.Event()
        self._published: dict[str, bytes] = {}
        """Retained messages as the broker has them, by topic."""
        self._devices: dict[str, dict[str, Any]] = {}
        """Discovery messages likewise."""
        self._absent = msgspec.json.encode(person_content(PublishedPerson(""), self._topics))
        self._stale: set[str] = set()
        """States of people of an earlier run who are not known now, by topic."""
        self._failures = LogThrottle()
        self._is_ending = False

    def forget(self, numbers: Collection[int]) -> None:
        """Remove people from events that wait, and events about nobody else."""
        kept = (event_without(event, numbers) for event in self._events)
        self._events = deque((event for event in kept if event is not None), maxlen=_EVENTS_MAX)

    def put_event(self, event: PicturedEvent) -> None:
        """Publish an event as soon as there is a connection."""
        self._events.append(event)
        self._has_events.set()

    def end(self) -> None:
        """Publish nothing more. A cancellation alone may be lost in `asyncio.wait_for` (CPython 86296)."""
        self._is_ending = True

    async def run(self) -> None:
        """Connect, publish, and connect again after failures."""
        backoff = Backoff(_FIRST_S, _MAX_S)
        where = f"mqtt: {self._settings.host}:{self._settings.port}"
        while not self._is_ending:
            try:
                async with self._connected() as client:
                    log.info("%s: connected", where)
                    backoff.reset()
                    await self._serve(client)
            except (aiomqtt.MqttError, OSError, UserError) as error:
                pause = backoff.next()
                if (more := self._failures.record(str(error))) is not None:
                    log.warning("%s: %s%s; trying again", where, str(error), more)
                await asyncio.sleep(pause)

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator[aiomqtt.Client]:
        settings, topics = self._settings, self._topics
        password = None if settings.password is None else read_secret(settings.password, "mqtt.password")
        async with aiomqtt.Client(
            settings.host or "",
            settings.port,
            username=settings.username,
            password=password,
            identifier=f"myview-{topics.site}" + ("" if topics.area is None else f"-area-{topics.area}"),
            will=aiomqtt.Will(topics.status, b"offline", _QOS, retain=True),
            tls_context=_tls_context(settings) if settings.tls else None,
            timeout=_TIMEOUT_S,
            max_queued_incoming_messages=_INCOMING_MAX,
        ) as client:
            try:
                yield client
            finally:  # the will is for what is not an orderly end
                with contextlib.suppress(aiomqtt.MqttError):
                    await client.publish(topics.status, b"offline", _QOS, retain=True)

    async def _serve(self, client: aiomqtt.Client) -> None:
        self._published.clear()
        self._devices.clear()
        self._stale.clear()
        await client.publish(self._topics.status, b"online", _QOS, retain=True)
        await client.subscribe(self._topics.person("+"), _QOS)
        if self._settings.operate:
            await client.subscribe(self._topics.recording_command, _QOS)
        if self._settings.discovery is not None:
            await client.subscribe(f"{self._settings.discovery}/status", _QOS)
        if self._is_ending:  # the cancellation was lost in one of these
            return
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._receive(client))
                tasks.create_task(self._publish_states(client))
                tasks.create_task(self._publish_events(client))
                if self._settings.pictures_every_s:
                    tasks.create_task(self._publish_pictures(client))
        except* (aiomqtt.MqttError, OSError) as errors:
            raise _first_of(errors) from None

    async def _receive(self, client: aiomqtt.Client) -> None:
        async for message in client.messages:
            topic, payload = message.topic.value, message.payload
            if topic == self._topics.recording_command:
                if not message.retain and payload in {b"ON", b"OFF"}:
                    self._reader.switch_recording(is_on=payload == b"ON")
            elif topic == f"{self._settings.discovery}/status":
                if payload == b"online":  # Home Assistant has started: tell it all again
                    self._published.clear()
                    self._devices.clear()
            elif isinstance(payload, bytes) and payload:
                self._receive_person(topic, payload, is_retained=message.retain)

    def _receive_person(self, topic: str, payload: bytes, *, is_retained: bool) -> None:
        """Keep what an earlier run has told; tell again what another area has told about who is here."""
        is_own = _area_of(payload) in {None, self._topics.area}
        if is_retained and is_own:
            self._stale.add(topic)
        elif not is_own and self._published.get(topic, self._absent) != self._absent:
            del self._published[topic]

    async def _publish_states(self, client: aiomqtt.Client) -> None:
        while not self._is_ending:
            state = self._reader.read()
            for key in state.elsewhere:  # their area tells now
                self._published.pop(self._topics.person(key), None)
                self._stale.discard(self._topics.person(key))
                if self._settings.discovery is not None:
                    self._devices.pop(person_discovery(self._topics, key, self._settings.discovery), None)
            if self._settings.discovery is not None:
                messages = discovery_messages(
                    state,
                    self._topics,
                    self._settings.discovery,
                    url=self._url,
                    may_operate=self._settings.operate,
                )
                await self._publish_devices(client, messages)
            wanted = state_messages(state, self._topics)
            for topic in self._stale - wanted.keys():
                wanted[topic] = self._absent
            await self._publish_changed(client, wanted)
            await asyncio.sleep(_EVERY_S)

    async def _publish_devices(self, client: aiomqtt.Client, messages: Mapping[str, dict[str, Any]]) -> None:
        for topic, message in messages.items():
            before = self._devices.get(topic)
            if before == message:
                continue
            for each in (without_removed(before, message), message):
                if each is not None:
                    await client.publish(topic, msgspec.json.encode(each), _QOS, retain=True)
            self._devices[topic] = message
        for topic in self._devices.keys() - messages.keys():
            await client.publish(topic, b"", _QOS, retain=True)
            del self._devices[topic]

    async def _publish_changed(self, client: aiomqtt.Client, messages: Mapping[str, bytes]) -> None:
        for topic, message in messages.items():
            if self._published.get(topic) != message:
                await client.publish(topic, message, _QOS, retain=True)
                self._published[topic] = message
        for topic in self._published.keys() - messages.keys():
            await client.publish(topic, b"", _QOS, retain=True)
            del self._published[topic]

    async def _publish_events(self, client: aiomqtt.Client) -> None:
        while not self._is_ending:
            await self._has_events.wait()
            while self._events:
                event = self._events[0]
                for topic, payload in self._event_messages(event):
                    await client.publish(topic, payload, _QOS)
                    if not self._events or self._events[0] is not event:
                        break  # somebody of it was deleted, or too many wait
                if self._events and self._events[0] is event:
                    self._events.popleft()
            self._has_events.clear()

    def _event_messages(self, event: PicturedEvent) -> Iterator[tuple[str, bytes]]:
        record = event.record
        content = self._with_addresses(msgspec.to_builtins(record))
        yield self._topics.events, msgspec.json.encode(content)
        if event.jpeg is not None:
            yield self._topics.rule_picture(record.rule), event.jpeg
        if record.phase == "once":
            content = {"event_type": record.direction or record.kind, **content}
            yield self._topics.rule_event(record.rule), msgspec.json.encode(content)

    async def _publish_pictures(self, client: aiomqtt.Client) -> None:
        while not self._is_ending:
            for person in self._reader.read().persons:
                await self._publish_picture(client, person)
            await asyncio.sleep(self._settings.pictures_every_s)

    async def _publish_picture(self, client: aiomqtt.Client, person: PublishedPerson) -> None:
        picture = await self._reader.picture_of(person)
        if picture is not None:
            await client.publish(self._topics.person_picture(person.key), picture, qos=0)

    def _with_addresses(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return an event with whole addresses, where the page's is known."""
        if self._url is None:
            return content
        base = self._url.rstrip("/")
        return {
            name: f"{base}/{value}" if name in {"picture", "clip"} and value else value
            for name, value in content.items()
        }


class _AboutPerson(msgspec.Struct):
    """As far as it is read of a message about a named person."""

    area: int | None = None


def _area_of(payload: bytes) -> int | None:
    """Return the area that has sent a message about a named person; None: none says so."""
    try:
        return msgspec.json.decode(payload, type=_AboutPerson).area
    except msgspec.MsgspecError:
        return None


def _tls_context(settings: MqttSettings) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=settings.authority)
    except (OSError, ssl.SSLError) as error:
        raise UserError(f"mqtt.authority: cannot be read: {reason_of(error)}") from None


def _first_of(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    """Return the first error of a group."""
    first: BaseException = errors
    while isinstance(first, BaseExceptionGroup):
        first = first.exceptions[0]
    return first
