"""Evaluates rules frame by frame: positions of people in, events out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from server.rules.presence import AreaPresence, Change, LineCrossings, Sighting
from server.rules.rules import Direction, Phase, Rule, RuleEvent, RuleKind
from server.rules.zones import Line, Point, Zone

_ANYWHERE = None
"""The name of the zone that is the whole site."""


@dataclass(frozen=True, slots=True)
class PeopleOfFrame:
    """Where people are in one frame.

    Attributes:
        pulse: the frame.
        floor: positions on the floor, by number.
        pictures: by camera and number, the feet in pixels of the camera's own picture.
        cameras: by number, the cameras that see them.
    """

    pulse: int
    floor: Mapping[int, Point]
    pictures: Mapping[str, Mapping[int, Point]]
    cameras: Mapping[int, frozenset[str]]


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What else decides whether a rule applies, the same for some frames.

    Attributes:
        moment: unix seconds; None: unknown, so that rules with a schedule do not apply.
        names: of people, by number.
        clear: cameras that send clear pictures.
        usable: cameras whose pictures show where people are: clear, or only blurred or noisy.
    """

    moment: float | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    clear: frozenset[str] = frozenset()
    usable: frozenset[str] = frozenset()


@dataclass(slots=True)
class _LastingEvent:
    """An event that lasts, as a crowd does, from its first sign on.

    Attributes:
        began: whether its beginning has been reported.
        changing_since: the first frame of the other state, which must last; None: it has not changed.
        people: of the beginning.
    """

    began: bool = False
    changing_since: int | None = None
    people: tuple[int, ...] = ()


class RuleEvaluator:
    """Evaluates rules over frames in order. The same frames give the same events.

    Args:
        zones: all zones, of different names.
        rules: their zones are among them.
        absent: frames unseen after which someone is nowhere on the site.
    """

    def __init__(self, zones: Sequence[Zone], rules: Sequence[Rule], absent: int) -> None:
        self._zones = {zone.name: zone for zone in zones}
        self._rules = tuple(rules)
        self._areas: dict[str | None, AreaPresence] = {_ANYWHERE: AreaPresence(None, absent)}
        self._lines: dict[str, LineCrossings] = {}
        for zone in zones:
            if isinstance(zone, Line):
                self._lines[zone.name] = LineCrossings(zone)
            else:
                self._areas[zone.name] = AreaPresence(zone, zone.absent)
        self._zone_states: dict[str | None, AreaPresence | LineCrossings] = {}
        self._zone_states.update(self._areas)
        self._zone_states.update(self._lines)
        self._lasting_events: dict[tuple[str, tuple[int, ...]], _LastingEvent] = {}
        """By rule and the people that it is about: one who stays, two who are close, none for a crowd."""

    @property
    def people_in(self) -> dict[str, list[int]]:
        """The people in each area, by its name, in order of their numbers."""
        return {
            name: sorted(presence.inside) for name, presence in self._areas.items() if name is not _ANYWHERE
        }

    @property
    def lasting(self) -> frozenset[str]:
        """The names of rules of which something has begun and not ended."""
        return frozenset(rule for (rule, _), event in self._lasting_events.items() if event.began)

    def merge(self, kept: int, lost: int) -> None:
        """Two numbers are one person."""
        for each in self._zone_states.values():
            each.merge(kept, lost)
        earlier, self._lasting_events = self._lasting_events, {}
        for (rule, people), event in earlier.items():
            now = tuple(sorted({kept if person == lost else person for person in people}))
            if len(now) == len(people) and not self._lasting_events.get((rule, now), _LastingEvent()).began:
                self._lasting_events[rule, now] = event

    def split(self, kept: int, new: int) -> None:
        """A number stood for two people."""
        for each in self._zone_states.values():
            each.split(kept, new)

    def forget(self, person: int) -> None:
        """Forget someone, without an event; a crowd lasts without them."""
        for each in self._zone_states.values():
            each.forget(person)
        self._lasting_events = {
            key: event for key, event in self._lasting_events.items() if person not in key[1]
        }
        for event in self._lasting_events.values():
            event.people = tuple(each for each in event.people if each != person)

    def step(self, frame: PeopleOfFrame, circumstances: Circumstances) -> list[RuleEvent]:
        """Process the next frame; return events in the order of the rules."""
        changes: dict[str | None, list[Change]] = {}
        for name, presence in self._zone_states.items():
            changes[name] = presence.update(frame.pulse, self._sightings(name, frame), circumstances.usable)
        return [
            event
            for rule in self._rules
            for event in self._evaluate(
                rule, frame, circumstances, changes, rule.applies(circumstances.moment, circumstances.clear)
            )
        ]

    def _sightings(self, name: str | None, frame: PeopleOfFrame) -> list[Sighting]:
        if name is None:
            return [Sighting(person, (0.0, 0.0), cameras) for person, cameras in frame.cameras.items()]
        camera = self._zones[name].camera
        if camera is None:
            return [Sighting(person, point, frame.cameras[person]) for person, point in frame.floor.items()]
        alone = frozenset({camera})
        return [Sighting(person, point, alone) for person, point in frame.pictures.get(camera, {}).items()]

    def _evaluate(
        self,
        rule: Rule,
        frame: PeopleOfFrame,
        circumstances: Circumstances,
        changes: Mapping[str | None, Sequence[Change]],
        applies: bool,
    ) -> Iterable[RuleEvent]:
        match rule.kind:
            case RuleKind.ENTERED | RuleKind.LEFT | RuleKind.CROSSED:
                return self._steps(rule, frame, circumstances, changes[rule.zone] if applies else ())
            case RuleKind.STAYED:
                return self._stays(rule, frame, circumstances, applies)
            case RuleKind.CROWDED:
                return self._crowds(rule, frame, circumstances, applies)
            case RuleKind.CLOSE:
                return self._pairs(rule, frame, circumstances, applies)

    def _steps(
        self, rule: Rule, frame: PeopleOfFrame, circumstances: Circumstances, changes: Iterable[Change]
    ) -> Iterator[RuleEvent]:
        crosses = rule.kind is RuleKind.CROSSED
        wanted = {
            RuleKind.ENTERED: Direction.INWARD,
            RuleKind.LEFT: Direction.OUTWARD,
            RuleKind.CROSSED: rule.direction,
        }[rule.kind]
        for change in changes:
            if wanted in {None, change.direction} and rule.is_about(change.person, circumstances.names):
                direction = change.direction if crosses else None
                yield _event(rule, Phase.ONCE, change.pulse, frame.pulse, (change.person,), direction)

    def _stays(
        self, rule: Rule, frame: PeopleOfFrame, circumstances: Circumstances, applies: bool
    ) -> Iterator[RuleEvent]:
        inside = self._areas[rule.zone].inside if applies else {}
        staying: dict[tuple[int, ...], int] = {
            (person,): since + rule.longer_than
            for person, since in inside.items()
            if frame.pulse - since >= rule.longer_than and rule.is_about(person, circumstances.names)
        }
        yield from self._report_lasting(rule, frame.pulse, staying, hold=0)

    def _crowds(
        self, rule: Rule, frame: PeopleOfFrame, circumstances: Circumstances, applies: bool
    ) -> Iterator[RuleEvent]:
        inside = self._areas[rule.zone].inside if applies else {}
        people = tuple(sorted(person for person in inside if rule.is_about(person, circumstances.names)))
        event = self._lasting_events.setdefault((rule.name, ()), _LastingEvent())
        if len(people) > rule.more_than and not event.began:
            event.people = people
        crowd: dict[tuple[int, ...], int] = {(): frame.pulse} if len(people) > rule.more_than else {}
        yield from self._report_lasting(rule, frame.pulse, crowd, hold=rule.hold)

    def _pairs(
        self, rule: Rule, frame: PeopleOfFrame, circumstances: Circumstances, applies: bool
    ) -> Iterator[RuleEvent]:
        close: dict[tuple[int, ...], int] = {}
        if applies:
            inside = frame.floor if rule.zone is None else self._areas[rule.zone].inside
            people = sorted(person for person in frame.floor if person in inside)
            points = np.array([frame.floor[person] for person in people]).reshape(-1, 2)
            distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
            reach = rule.closer_than + rule.margin
            for one, other in np.argwhere(np.triu(distances < reach, 1)).tolist():
                pair = (people[one], people[other])
                event = self._lasting_events.get((rule.name, pair))
                is_near = distances[one, other] < rule.closer_than or (event is not None and event.began)
                if is_near and any(rule.is_about(person, circumstances.names) for person in pair):
                    close[pair] = frame.pulse
        yield from self._report_lasting(rule, frame.pulse, close, hold=rule.hold)

    def _report_lasting(
        self, rule: Rule, pulse: int, true_of: Mapping[tuple[int, ...], int], *, hold: int
    ) -> Iterator[RuleEvent]:
        """Report beginnings and ends of what is true of some people since a frame, if it lasts for a hold."""
        known = [people for name, people in self._lasting_events if name == rule.name]
        for people in sorted({*known, *true_of}):
            event = self._lasting_events.setdefault((rule.name, people), _LastingEvent())
            if (people in true_of) == event.began:
                event.changing_since = None
            else:
                if event.changing_since is None:
                    event.changing_since = true_of.get(people, pulse)
                if pulse - event.changing_since >= hold:
                    event.began, since, event.changing_since = not event.began, event.changing_since, None
                    phase = Phase.BEGAN if event.began else Phase.ENDED
                    yield _event(rule, phase, since, pulse, people or event.people)
            if not event.began and event.changing_since is None:
                del self._lasting_events[rule.name, people]


def _event(
    rule: Rule,
    phase: Phase,
    pulse: int,
    confirmed: int,
    people: tuple[int, ...],
    direction: Direction | None = None,
) -> RuleEvent:
    return RuleEvent(rule.name, rule.kind, phase, pulse, confirmed, rule.zone, people, direction)
