"""The state of a site as MQTT tells it, and its topics.

Where services divide a site by area, each tells its own: with its own status, so that each has a last will,
and its own cameras, which are in one area each. A named person has the same topics in all areas.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from server.rules import RuleKind

_LASTING = frozenset({RuleKind.STAYED, RuleKind.CROWDED, RuleKind.CLOSE})


@dataclass(frozen=True, slots=True)
class PublishedPerson:
    """A named person.

    Attributes:
        name: given by an operator.
        number: the newest of that name; None: none is known.
        is_present: whether a camera sees them.
        camera: that shows them best, or None.
        zones: ids of the areas in which they are.
    """

    name: str
    number: int | None = None
    is_present: bool = False
    camera: str | None = None
    zones: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """A name for topics and ids: letters and digits of the name, and its checksum."""
        return person_key(self.name)


@dataclass(frozen=True, slots=True)
class PublishedCamera:
    """A camera: ``state``, ``condition`` and ``covered_share`` as in `/api/cameras`."""

    camera: str
    state: str
    condition: str
    covered_share: float = 0.0

    @property
    def has_problem(self) -> bool:
        """Whether it does not show all that it should."""
        return self.state != "live" or self.condition != "clear" or self.covered_share > 0.0


@dataclass(frozen=True, slots=True)
class PublishedRule:
    """A rule, and whether what it is about lasts now."""

    rule: str
    kind: str
    is_lasting: bool

    @property
    def is_momentary(self) -> bool:
        """Whether it has events alone, which do not last."""
        return RuleKind(self.kind) not in _LASTING


@dataclass(frozen=True, slots=True)
class SiteState:
    """All that is published of a site, or of one of its areas.

    Attributes:
        people: how many are there.
        zones: numbers of people.
        recording: None: there is none.
        elsewhere: keys of named people about whom another area tells.
    """

    site: str
    people: int
    persons: Sequence[PublishedPerson]
    cameras: Sequence[PublishedCamera]
    zones: Mapping[str, int]
    rules: Sequence[PublishedRule]
    recording: bool | None
    elsewhere: Collection[str] = ()


def person_key(name: str) -> str:
    """Return a name as a level of a topic."""
    plain = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    return f"{plain[:32] or 'person'}-{zlib.crc32(name.encode()):08x}"


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of a site, or of one of its areas, below ``prefix``."""

    prefix: str
    site: str
    area: int | None = None

    @property
    def base(self) -> str:
        """The beginning of all topics."""
        return f"{self.prefix}/{self.site}"

    @property
    def own(self) -> str:
        """The beginning of those that each area has for itself."""
        return self.base if self.area is None else f"{self.base}/areas/{self.area}"

    @property
    def status(self) -> str:
        """``online``, or by the last will ``offline``; retained."""
        return f"{self.own}/status"

    @property
    def state(self) -> str:
        """The state of the site or area, JSON, retained."""
        return f"{self.own}/state"

    @property
    def events(self) -> str:
        """Every event of a rule, JSON."""
        return f"{self.base}/events"

    @property
    def recording_command(self) -> str:
        """The command ``ON`` or ``OFF``."""
        return f"{self.own}/recording/set"

    def camera(self, camera: str) -> str:
        """A camera's state, JSON, retained."""
        return f"{self.base}/cameras/{camera}/state"

    def person(self, key: str) -> str:
        """A named person's state, JSON, retained; ``+`` for all."""
        return f"{self.base}/people/{key}/state"

    def person_picture(self, key: str) -> str:
        """A named person's best view, JPEG."""
        return f"{self.base}/people/{key}/picture"

    def rule(self, rule: str) -> str:
        """``ON`` or ``OFF`` of what lasts, retained."""
        return f"{self.own}/rules/{rule}/state"

    def rule_event(self, rule: str) -> str:
        """A rule's events as Home Assistant's event entities read them, JSON."""
        return f"{self.own}/rules/{rule}/event"

    def rule_picture(self, rule: str) -> str:
        """The small picture of a rule's newest event, JPEG."""
        return f"{self.own}/rules/{rule}/picture"


def state_messages(state: SiteState, topics: Topics) -> dict[str, bytes]:
    """Return the retained messages of a state, by topic."""
    content: dict[str, object] = {"people": state.people, "zones": dict(state.zones)}
    if state.recording is not None:
        content["recording"] = on_or_off(is_on=state.recording)
    messages: dict[str, object] = {topics.state: content}
    for camera in state.cameras:
        messages[topics.camera(camera.camera)] = {
            "state": camera.state,
            "condition": camera.condition,
            "problem": on_or_off(is_on=camera.has_problem),
        }
    for person in state.persons:
        messages[topics.person(person.key)] = person_content(person, topics)
    encoded = {topic: msgspec.json.encode(message) for topic, message in messages.items()}
    for rule in state.rules:
        if not rule.is_momentary:
            encoded[topics.rule(rule.rule)] = on_or_off(is_on=rule.is_lasting).encode()
    return encoded


def person_content(person: PublishedPerson, topics: Topics) -> dict[str, object]:
    """Return what is told about a named person."""
    content: dict[str, object] = {
        "presence": on_or_off(is_on=person.is_present),
        "zone": ", ".join(person.zones) or None,
        "camera": person.camera,
        "object": person.number,
    }
    return content if topics.area is None else {**content, "area": topics.area}


def on_or_off(*, is_on: bool) -> str:
    """Return ``ON`` or ``OFF``."""
    return "ON" if is_on else "OFF"
