"""Zones and rules of a configuration are valid, or refused with one clear line."""

from __future__ import annotations

from datetime import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from server.config.loader import build_config
from server.config.site_config import Config
from server.system.errors import UserError

TILL = {"id": "till", "area": [[0, 0], [2, 0], [2, 3]]}
SHELF = {"id": "shelf", "camera": "c1", "area": [[0, 0], [200, 0], [200, 300]]}
DOOR = {"id": "door", "line": [[0, 0], [2, 0]], "inner": [1, 1]}


def site(zones: list[dict[str, Any]], rules: list[dict[str, Any]], **sections: Any) -> Config:
    cameras = [{"id": "c0", "source": "c0.mp4"}, {"id": "c1", "source": "c1.mp4"}]
    content = {"cameras": cameras, "zones": zones, "rules": rules, **sections}
    return build_config(content, where="site.yaml", folder=Path())


def error_of(zones: list[dict[str, Any]], rules: list[dict[str, Any]], **sections: Any) -> str:
    with pytest.raises(UserError) as caught:
        site(zones, rules, **sections)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith("site.yaml: ")
    return text


@pytest.mark.parametrize(
    ("zone", "expected"),
    [
        ({"id": "till"}, "zones.0: till: needs either area, its corners, or line, its two ends"),
        ({**TILL, "line": [[0, 0], [1, 1]]}, "till: needs either area, its corners, or line, its two ends"),
        ({"id": "till", "area": [[0, 0], [1, 1]]}, "zones.0.area: List should have at least 3 items"),
        ({"id": "till", "area": [[0, 0], [1, 1], [2, 2]]}, "till: area: the corners are all on one line"),
        (
            {"id": "door", "line": [[0, 0], [2, 0]]},
            "door: line: needs inner, a point on the side that is inside",
        ),
        ({**DOOR, "inner": [9, 0]}, "door: inner: is on the line itself"),
        ({**TILL, "inner": [9, 0]}, "till: inner: is for lines; leave it out"),
        ({**TILL, "camera": "c7"}, "zones: till: there is no camera 'c7'; there are c0, c1"),
        ({**TILL, "margin": -1}, "zones.0.margin: Input should be greater than or equal to 0"),
        ({**TILL, "areas": 1}, "zones.0.areas: unknown key; did you mean 'area'?"),
    ],
)
def test_wrong_zones_are_refused(zone: dict[str, Any], expected: str) -> None:
    assert expected in error_of([zone], [])


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (
            {"kind": "entered", "zone": "tlil"},
            "rules: r: there is no zone 'tlil'; there are till, shelf, door",
        ),
        (
            {"kind": "enters"},
            "rules.0.kind: Input should be 'entered', 'left', 'crossed', 'stayed', 'crowded' or",
        ),
        ({"kind": "crossed"}, "rules.0: r: crossed needs zone"),
        ({"kind": "crossed", "zone": "till"}, "rules: r: crossed is about lines, and till is an area"),
        ({"kind": "entered", "zone": "door"}, "rules: r: entered is about areas, and door is a line"),
        ({"kind": "stayed", "zone": "till"}, "rules.0: r: stayed needs longer_than_s"),
        ({"kind": "crowded"}, "rules.0: r: crowded needs more_than"),
        ({"kind": "close"}, "rules.0: r: close needs closer_than_m"),
        (
            {"kind": "close", "closer_than_m": 1, "zone": "shelf"},
            "close is about the floor, and shelf is in a picture",
        ),
        ({"kind": "entered", "more_than": 3}, "r: more_than: is for crowded, not for entered; leave it out"),
        ({"kind": "entered", "cameras": ["c9"]}, "rules: r: there is no camera 'c9'; there are c0, c1"),
        ({"kind": "entered", "hours": ["25:00", "26:00"]}, "is not a time of day such as 08:30"),
        ({"kind": "entered", "days": ["monday"]}, "rules.0.days.0: Input should be 'mon', 'tue'"),
        ({"kind": "entered", "peple": [3]}, "rules.0.peple: unknown key; did you mean 'people'?"),
    ],
)
def test_wrong_rules_are_refused(rule: dict[str, Any], expected: str) -> None:
    assert expected in error_of([TILL, SHELF, DOOR], [{"id": "r", **rule}])


def test_ids_are_unique() -> None:
    assert "zones: two are called 'till'" in error_of([TILL, TILL], [])
    assert "rules: two are called 'r'" in error_of([], [{"id": "r", "kind": "entered"}] * 2)


def test_an_unknown_time_zone_is_refused() -> None:
    assert "site.time_zone: is not a time zone that this machine knows" in error_of(
        [], [], site={"time_zone": "Mars"}
    )


def test_times_of_day_are_read_as_yaml_writes_them() -> None:
    """YAML 1.1 reads 22:00 as 1320, and 08:00 as text."""
    hours = yaml.safe_load("[22:00, 08:30]")
    config = site([], [{"id": "r", "kind": "entered", "hours": hours}])
    assert config.rules[0].hours == (time(22), time(8, 30))
    assert yaml.safe_load("[09:00, 24:00]") == ["09:00", 1440]
    assert site([], [{"id": "r", "kind": "entered", "hours": ["09:00", 1440]}]).rules[0].hours == (
        time(9),
        time(),
    )


def test_margins_fit_their_unit() -> None:
    config = site([TILL, SHELF, {**SHELF, "id": "bin", "margin": 2}], [])
    assert [zone.border_margin for zone in config.zones] == [0.2, 8.0, 2.0]
