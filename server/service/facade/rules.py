"""Rules: zones and who is in them, events, and a picture of each."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

import msgspec

from server.config.sections import RuleSettings, ZoneSettings
from server.service.facade.people import PeopleService
from server.service.pipeline import BestViewPipeline
from server.service.rules.engine import SiteEvent
from server.service.rules.setup import units_per_meter

__all__ = ["EventRecord", "PicturedEvent", "Rules", "RulesService", "SiteEvent"]

_KEPT = 256
"""The newest events, with their pictures."""
_CLIP_BEFORE_S, _CLIP_AFTER_S = 3, 7
"""Seconds before and after an event that its clip shows."""


class EventRecord(SiteEvent, frozen=True):
    """An event with its id, and links relative to the site's address."""

    id: str
    """Unique in the site, also after a restart."""
    picture: str | None
    """URL of a small picture of the first of the people; null: there is none."""
    clip: str | None
    """URL of the best view of the first of the people then, as long as it is recorded; null: of no one."""


class ZoneState(msgspec.Struct, frozen=True):
    """One zone, as configured, and who is in it."""

    zone: str
    camera: str | None
    """Null: coordinates are meters, or the ground's unit, on the floor."""
    area: list[tuple[float, float]] | None
    line: list[tuple[float, float]] | None
    inner: tuple[float, float] | None
    objects: list[int]
    """The people in an area now."""


class RuleState(msgspec.Struct, frozen=True):
    """One rule, and whether what it is about lasts now."""

    rule: str
    kind: str
    zone: str | None
    lasting: bool


class Rules(msgspec.Struct, frozen=True):
    """Zones, rules and recent events."""

    units_per_meter: float
    """The unit of the floor plan: so many are a meter."""
    zones: list[ZoneState]
    rules: list[RuleState]
    events: list[EventRecord]
    """The newest first."""


@dataclass(frozen=True, slots=True)
class PicturedEvent:
    """An event and its picture, JPEG; None: there is none."""

    record: EventRecord
    jpeg: bytes | None


def event_without(event: PicturedEvent, numbers: Collection[int]) -> PicturedEvent | None:
    """Return an event without some people; None: it is about nobody else.

    Picture and clip are of the first of an event's people, and go with them.
    """
    record = event.record
    people = [
        (number, name)
        for number, name in zip(record.objects, record.names, strict=True)
        if number not in numbers
    ]
    if len(people) == len(record.objects):
        return event
    if not people:
        return None
    is_first = record.objects[0] in numbers
    changed = msgspec.structs.replace(
        record,
        objects=[number for number, _ in people],
        names=[name for _, name in people],
        camera=None if is_first else record.camera,
        picture=None if is_first else record.picture,
        clip=None if is_first else record.clip,
    )
    return PicturedEvent(changed, None if is_first else event.jpeg)


class RulesService:
    """Queries about zones, rules and events."""

    def __init__(self, pipeline: BestViewPipeline, people: PeopleService) -> None:
        self._pipeline, self._people = pipeline, people
        self._events: deque[PicturedEvent] = deque(maxlen=_KEPT)
        self._count = 0
        self._callbacks: list[Callable[[PicturedEvent], None]] = []
        self._on_forget: list[Callable[[Collection[int]], None]] = []
        pipeline.on_event.append(self._add)

    def subscribe_events(self, callback: Callable[[PicturedEvent], None]) -> None:
        """Call back with every event."""
        self._callbacks.append(callback)

    def rules(self) -> Rules:
        """Return zones, rules and the newest events."""
        config, engine = self._pipeline.config, self._pipeline.rules
        inside, lasting = engine.people_in, engine.lasting
        return Rules(
            units_per_meter(config),
            [_zone_state(zone, inside.get(zone.id, [])) for zone in config.zones],
            [_rule_state(rule, is_lasting=rule.id in lasting) for rule in config.rules],
            [event.record for event in reversed(self._events)],
        )

    def zones_of(self, number: int) -> list[str]:
        """Return the ids of the areas that a person is in."""
        return [zone for zone, people in self._pipeline.rules.people_in.items() if number in people]

    def picture_of(self, event: str) -> bytes | None:
        """Return an event's picture, JPEG; None: there is no such event, or no picture of it."""
        return next((each.jpeg for each in self._events if each.record.id == event), None)

    def count_about(self, numbers: Collection[int]) -> int:
        """Return how many of the newest events are about one of these people."""
        return sum(not set(numbers).isdisjoint(event.record.objects) for event in self._events)

    def forget(self, numbers: Collection[int]) -> None:
        """Remove people from the events, and events about nobody else; subscribers must do so, too."""
        kept = (event_without(event, numbers) for event in self._events)
        self._events = deque((event for event in kept if event is not None), maxlen=_KEPT)
        for callback in self._on_forget:
            callback(numbers)

    def subscribe_forget(self, callback: Callable[[Collection[int]], None]) -> None:
        """Call back with the numbers of people who must be removed from events that are kept."""
        self._on_forget.append(callback)

    def _add(self, event: SiteEvent) -> None:
        self._count += 1
        pulse0 = self._pipeline.pulses.pulse0
        event_id = f"{int((pulse0 or 0.0) * 1000):x}-{event.confirmed}-{self._count}"
        thumbnail = self._people.thumbnail_of(event.objects[0]) if event.objects else None
        record = EventRecord(
            **msgspec.structs.asdict(event),
            id=event_id,
            picture=None if thumbnail is None else f"api/events/{event_id}/picture.jpg",
            clip=self._clip(event),
        )
        pictured = PicturedEvent(record, None if thumbnail is None else thumbnail.jpeg)
        self._events.append(pictured)
        for callback in self._callbacks:
            callback(pictured)

    def _clip(self, event: SiteEvent) -> str | None:
        if not event.objects:
            return None
        fps = self._pipeline.config.site.fps
        start, end = event.pulse - round(_CLIP_BEFORE_S * fps), event.pulse + round(_CLIP_AFTER_S * fps)
        return f"objects/{event.objects[0]}/best.mp4?from=p{max(0, start)}&to=p{end}"


def _zone_state(zone: ZoneSettings, people: list[int]) -> ZoneState:
    return ZoneState(zone.id, zone.camera, zone.area, zone.line, zone.inner, people)


def _rule_state(rule: RuleSettings, *, is_lasting: bool) -> RuleState:
    return RuleState(rule.id, rule.kind.value, rule.zone, is_lasting)
