"""Zones and rules of a configuration, in frames and in the unit of the ground."""

from __future__ import annotations

from collections.abc import Sequence
from zoneinfo import ZoneInfo

from server.config.ground_unit import UNITS_PER_METER
from server.config.sections import RuleSettings, ZoneSettings
from server.config.site_config import Config
from server.rules import Area, Line, Rule, RuleEvaluator, Schedule, Zone
from server.rules.zones import Point

_ABSENT_S = 3.0
"""Seconds unseen after which someone is nowhere on the site; a zone has its own."""


def create_evaluator(config: Config) -> RuleEvaluator:
    """Return an evaluator of the configuration's rules."""
    fps, scale = config.site.fps, units_per_meter(config)
    rules = [_rule(rule, config, scale) for rule in config.rules]
    return RuleEvaluator(_zones(config), rules, _frames(_ABSENT_S, fps))


def create_areas(config: Config) -> list[Area]:
    """Return the configuration's areas: its zones without the lines."""
    return [zone for zone in _zones(config) if isinstance(zone, Area)]


def _zones(config: Config) -> list[Zone]:
    fps, scale = config.site.fps, units_per_meter(config)
    return [_zone(zone, 1.0 if zone.camera else scale, fps) for zone in config.zones]


def units_per_meter(config: Config) -> float:
    """Return the ground's units per meter; 1 where the unit is unknown, and zones are given in it."""
    units = {UNITS_PER_METER.get(camera.ground_unit or "", 1.0) for camera in config.cameras if camera.ground}
    return units.pop() if len(units) == 1 else 1.0


def _zone(zone: ZoneSettings, scale: float, fps: float) -> Zone:
    margin, hold, absent = zone.border_margin * scale, _frames(zone.hold_s, fps), _frames(zone.absent_s, fps)
    if zone.area is not None:
        return Area(zone.id, _scaled(zone.area, scale), zone.camera, margin, hold, absent)
    assert zone.line is not None  # noqa: S101 — the configuration has been checked
    assert zone.inner is not None  # noqa: S101 — likewise
    one, other, inner = _scaled([*zone.line, zone.inner], scale)
    return Line(zone.id, (one, other), inner, zone.camera, margin, hold, absent)


def _scaled(points: Sequence[Point], scale: float) -> tuple[Point, ...]:
    return tuple((x * scale, y * scale) for x, y in points)


def _rule(rule: RuleSettings, config: Config, scale: float) -> Rule:
    fps = config.site.fps
    zone = None if config.site.time_zone is None else ZoneInfo(config.site.time_zone)
    begins, ends = rule.hours or (None, None)
    days = frozenset(rule.days)
    schedule = None
    if rule.has_schedule:
        hours = {} if begins is None or ends is None else {"begins": begins, "ends": ends}
        schedule = Schedule(days=frozenset(days), zone=zone, **hours)
    margins = [each.border_margin for each in config.zones if each.id == rule.zone]
    return Rule(
        name=rule.id,
        kind=rule.kind,
        zone=rule.zone,
        people=frozenset(rule.people),
        schedule=schedule,
        cameras=frozenset(rule.cameras),
        direction=rule.direction,
        longer_than=_frames(rule.longer_than_s or 0.0, fps),
        more_than=rule.more_than or 0,
        closer_than=(rule.closer_than_m or 0.0) * scale,
        margin=(margins[0] if margins else _CLOSE_MARGIN_M) * scale,
        hold=round(rule.hold_s * fps),
    )


_CLOSE_MARGIN_M = 0.2
"""Meters beyond which two people are apart again, where their rule has no zone whose margin counts."""


def _frames(seconds: float, fps: float) -> int:
    return max(1, round(seconds * fps))
