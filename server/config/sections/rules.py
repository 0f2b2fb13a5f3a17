"""The sections `zones` and `rules`: areas and lines, and what is reported about people there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import time
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, NonNegativeInt, PositiveFloat, model_validator

from server.config.sections.base import Identifier, Section
from server.rules import Direction, RuleKind

Point = tuple[float, float]
Day = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]

_CORNERS_MAX = 100
_MINUTES_OF_DAY = 24 * 60
_FLOOR_MARGIN, PICTURE_MARGIN = 0.2, 8.0


def _clock(value: Any) -> Any:
    """Read HH:MM; YAML 1.1 reads some as a number of minutes."""
    if isinstance(value, str) and re.fullmatch(r"[0-2]?\d:[0-5]\d", value):
        hours, minutes = value.split(":")
        value = int(hours) * 60 + int(minutes)
    if isinstance(value, int) and 0 <= value <= _MINUTES_OF_DAY:
        return time(*divmod(value % _MINUTES_OF_DAY, 60))
    if isinstance(value, time):
        return value
    raise ValueError("is not a time of day such as 08:30")


Clock = Annotated[time, BeforeValidator(_clock)]


class ZoneSettings(Section):
    """An area or a line, on the floor or in one camera's picture."""

    id: Identifier
    camera: Identifier | None = None
    """Coordinates are pixels of this camera's own picture; None: of the floor, in meters, or in the ground's
    unit where that is not m, cm or mm."""
    area: Annotated[list[Point], Field(min_length=3, max_length=_CORNERS_MAX)] | None = None
    """Corners in order."""
    line: Annotated[list[Point], Field(min_length=2, max_length=2)] | None = None
    """Two ends."""
    inner: Point | None = None
    """A point on a line's inner side: crossing to it is inward."""
    margin: Annotated[float, Field(ge=0)] | None = None
    """Distance beyond the border at which someone has left or crossed; None: 0.2 m, or 8 pixels."""
    hold_s: Annotated[float, Field(ge=0, le=60)] = 0.4
    """Seconds for which someone must have stepped over the border."""
    absent_s: Annotated[float, Field(gt=0, le=3600)] = 3.0
    """Seconds unseen, by cameras that send usable pictures, after which someone has left."""

    @model_validator(mode="after")
    def _is_an_area_or_a_line(self) -> Self:
        if (self.area is None) == (self.line is None):
            raise ValueError(f"{self.id}: needs either area, its corners, or line, its two ends")
        if self.area is not None and self.inner is not None:
            raise ValueError(f"{self.id}: inner: is for lines; leave it out")
        if self.area is not None and _is_flat(self.area):
            raise ValueError(f"{self.id}: area: the corners are all on one line")
        if self.line is not None and self.inner is None:
            raise ValueError(f"{self.id}: line: needs inner, a point on the side that is inside")
        if self.line is not None and self.inner is not None and _is_flat([*self.line, self.inner]):
            raise ValueError(f"{self.id}: inner: is on the line itself; name a point on one side of it")
        return self

    @property
    def border_margin(self) -> float:
        """The margin in force."""
        if self.margin is not None:
            return self.margin
        return _FLOOR_MARGIN if self.camera is None else PICTURE_MARGIN


def _is_flat(points: Sequence[Point]) -> bool:
    """Return whether all points are on one line."""
    first, *others = points
    vectors = [(x - first[0], y - first[1]) for x, y in others]
    longest = max(vectors, key=lambda vector: vector[0] ** 2 + vector[1] ** 2)
    scale = longest[0] ** 2 + longest[1] ** 2
    return all(abs(longest[0] * y - longest[1] * x) <= _FLAT * scale for x, y in vectors)


_FLAT = 1e-9
_NEEDS: dict[RuleKind, str] = {
    RuleKind.CROSSED: "zone",
    RuleKind.STAYED: "longer_than_s",
    RuleKind.CROWDED: "more_than",
    RuleKind.CLOSE: "closer_than_m",
}
"""The setting that a kind of rule cannot do without."""
_ONLY: dict[str, RuleKind] = {
    "direction": RuleKind.CROSSED,
    "longer_than_s": RuleKind.STAYED,
    "more_than": RuleKind.CROWDED,
    "closer_than_m": RuleKind.CLOSE,
}
"""Settings that one kind alone has."""


class RuleSettings(Section):
    """A rule: what is reported as an event."""

    id: Identifier
    kind: RuleKind
    """Someone entered, left, crossed, or stayed; the zone is crowded; two people are close."""
    zone: Identifier | None = None
    """The id of its zone; None: anywhere on the site."""
    people: Annotated[list[NonNegativeInt | Annotated[str, Field(min_length=1)]], Field(max_length=100)] = []
    """Numbers or names; empty: everybody."""
    days: Annotated[list[Day], Field(min_length=1)] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
    """In the time zone of `site.time_zone`; hours that pass midnight belong to the day before."""
    hours: tuple[Clock, Clock] | None = None
    """From, to; None: all day."""
    cameras: list[Identifier] = []
    """It applies while each of these cameras sends a clear picture."""
    direction: Direction | None = None
    """For `crossed`; None: both."""
    longer_than_s: Annotated[float, Field(gt=0, le=86_400)] | None = None
    """For `stayed`."""
    more_than: Annotated[int, Field(ge=0, le=10_000)] | None = None
    """For `crowded`: the number of people."""
    closer_than_m: PositiveFloat | None = None
    """For `close`: on the floor, from one person's feet to the other's."""
    hold_s: Annotated[float, Field(ge=0, le=3600)] = 1.0
    """For `crowded` and `close`: seconds for which that must last to begin, and to end."""

    @model_validator(mode="after")
    def _has_what_its_kind_needs(self) -> Self:
        needed = _NEEDS.get(self.kind)
        if needed is not None and getattr(self, needed) is None:
            raise ValueError(f"{self.id}: {self.kind} needs {needed}")
        for name, kind in _ONLY.items():
            if kind is not self.kind and getattr(self, name) is not None:
                raise ValueError(f"{self.id}: {name}: is for {kind}, not for {self.kind}; leave it out")
        return self

    @property
    def has_schedule(self) -> bool:
        """Whether it applies at some times only."""
        return self.hours is not None or len(set(self.days)) < len(RuleSettings.model_fields["days"].default)


def check_zones_and_rules(
    zones: Sequence[ZoneSettings], rules: Sequence[RuleSettings], cameras: Sequence[str]
) -> None:
    """Check that ids are unique, and that zones and cameras that are named exist and fit.

    Raises:
        ValueError: something does not.
    """
    for section, ids in (("zones", [zone.id for zone in zones]), ("rules", [rule.id for rule in rules])):
        for one, other in pairwise(sorted(ids)):
            if one == other:
                raise ValueError(f"{section}: two are called {one!r}; ids must be unique")
    for zone in zones:
        if zone.camera is not None and zone.camera not in cameras:
            raise ValueError(
                f"zones: {zone.id}: there is no camera {zone.camera!r}; there are {_list(cameras)}"
            )
    by_id = {zone.id: zone for zone in zones}
    for rule in rules:
        for camera in rule.cameras:
            if camera not in cameras:
                raise ValueError(
                    f"rules: {rule.id}: there is no camera {camera!r}; there are {_list(cameras)}"
                )
        if rule.zone is not None:
            _check_zone(rule, by_id)


def _check_zone(rule: RuleSettings, zones: dict[str, ZoneSettings]) -> None:
    zone = zones.get(rule.zone or "")
    if zone is None:
        known = f"there are {_list(list(zones))}" if zones else "there are none"
        raise ValueError(f"rules: {rule.id}: there is no zone {rule.zone!r}; {known}")
    if rule.kind is RuleKind.CROSSED and zone.line is None:
        raise ValueError(f"rules: {rule.id}: crossed is about lines, and {zone.id} is an area")
    if rule.kind is not RuleKind.CROSSED and zone.area is None:
        raise ValueError(f"rules: {rule.id}: {rule.kind} is about areas, and {zone.id} is a line")
    if rule.kind is RuleKind.CLOSE and zone.camera is not None:
        raise ValueError(f"rules: {rule.id}: close is about the floor, and {zone.id} is in a picture")


def _list(names: Sequence[str]) -> str:
    return ", ".join(names)
