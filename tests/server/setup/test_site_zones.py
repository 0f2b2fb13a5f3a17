"""Zones and their rules are saved in a configuration and removed; what people wrote beside them stays."""

from __future__ import annotations

import contextlib
import string
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.loader import load_config
from server.config.site_config import Config
from server.setup.site_zones import ZoneChange, remove_zone, save_site_rules, save_zone
from server.system.errors import UserError

TEXT = """\
# mine
cameras: [{id: c0, source: 'scene:room'}]
zones:  # of the shop
  # where people pay
  - {id: till, area: [[0, 0], [2, 0], [2, 3]], hold_s: 1.0}  # one
  # the way in
  - id: door  # two
    camera: c0
    line:
      - [10, 20]
      - [18, 20]
    inner: [14, 30]

# what is reported
rules:
- {id: queue, kind: crowded, zone: till, more_than: 4, days: [mon]}
# anybody
- {id: close, kind: close, closer_than_m: 1.5}
- {id: came-in, kind: crossed, zone: door, direction: inward}
# after
view: {switch_cost_s: 2.0}
"""
AREA = [(0.0, 0.0), (2.5, 0.0), (2.0, 3.0)]
QUEUE = {"id": "queue", "kind": "crowded", "more_than": 4, "days": ["mon"]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


def change(
    zone: str = "till", *rules: dict[str, Any], replaces: str | None = None, **settings: Any
) -> ZoneChange:
    return ZoneChange({"id": zone, "area": AREA, **settings}, rules, replaces)


def kept(path: Path) -> list[Path]:
    return list(path.parent.glob("site.2*.yaml"))


def rules_of(config: Config, zone: str) -> list[tuple[str, str]]:
    return [(rule.id, rule.kind.value) for rule in config.rules if rule.zone == zone]


def test_a_new_zone_is_one_line_and_the_rest_of_the_text_stays(path: Path) -> None:
    save_zone(path, change("shelf", {"id": "in", "kind": "entered"}))
    zone, rule = (
        "  - {id: shelf, area: [[0, 0], [2.5, 0], [2, 3]]}\n",
        "- {id: in, kind: entered, zone: shelf}\n",
    )
    assert zone in path.read_text()
    assert path.read_text().replace(zone, "").replace(rule, "") == TEXT
    assert rules_of(load_config(path), "shelf") == [("in", "entered")]
    assert [file.read_text() for file in kept(path)] == [TEXT]


def test_a_site_without_zones_gets_the_sections(path: Path) -> None:
    before = "# mine\ncameras: [{id: c0, source: 'scene:room'}]\n#zones: []\n"
    path.write_text(before)
    save_zone(path, change("till", QUEUE))
    assert path.read_text().startswith(before)
    assert rules_of(load_config(path), "till") == [("queue", "crowded")]
    remove_zone(path, "till")
    assert path.read_text() == f"{before}\nzones: []\n\nrules: []\n"


def test_a_changed_zone_keeps_its_place_comments_and_other_settings(path: Path) -> None:
    save_zone(path, change("till", QUEUE, replaces="till"))
    assert (
        "  # where people pay\n  - {id: till, area: [[0, 0], [2.5, 0], [2, 3]], hold_s: 1.0}  # one\n"
        in path.read_text()
    )
    config = load_config(path)
    assert [zone.id for zone in config.zones] == ["till", "door"]
    assert TEXT[TEXT.index("  # the way in") :] in path.read_text()


def test_a_renamed_zone_takes_its_rules_along(path: Path) -> None:
    save_zone(path, change("pay", QUEUE, {"id": "in", "kind": "entered"}, replaces="till"))
    config = load_config(path)
    assert [zone.id for zone in config.zones] == ["pay", "door"]
    assert rules_of(config, "pay") == [("queue", "crowded"), ("in", "entered")]
    assert [rule.id for rule in config.rules] == ["queue", "close", "came-in", "in"]
    assert "# where people pay\n  - {id: pay" in path.read_text()


def test_a_rule_changes_its_kind_and_another_is_removed(path: Path) -> None:
    line = {"line": [(1.0, 2.0), (8.0, 2.0)], "inner": (4.0, 9.0), "camera": "c0", "area": None}
    save_zone(path, change("door", {"id": "came-in", "kind": "crossed"}, replaces="door", **line))
    assert load_config(path).rules[2].direction is None
    save_zone(path, change("till", {"id": "queue", "kind": "stayed", "longer_than_s": 5.0}, replaces="till"))
    config = load_config(path)
    assert rules_of(config, "till") == [("queue", "stayed")]
    assert config.rules[0].more_than is None
    save_zone(path, change("till", replaces="till"))
    assert [rule.id for rule in load_config(path).rules] == ["close", "came-in"]
    assert "# anybody\n- {id: close" in path.read_text()


def test_what_restricts_a_rule_is_saved_and_what_stays_the_same_keeps_its_text(path: Path) -> None:
    written = (
        "- id: queue  # at noon\n  kind: crowded\n  zone: till\n  more_than: 4.0\n  days: [wed, mon]\n"
        "  hours: [08:30, 1320]\n  people: [Ann, 3]\n  cameras: [c0]\n  hold_s: 1\n"
    )
    text = TEXT.replace("- {id: queue, kind: crowded, zone: till, more_than: 4, days: [mon]}\n", written)
    path.write_text(text)
    same: dict[str, Any] = {
        **QUEUE,
        "days": ["mon", "wed"],
        "hours": ("08:30", "22:00"),
        "people": ["Ann", 3],
    }
    same |= {"cameras": ["c0"], "hold_s": 1.0}
    save_zone(path, change("till", same, replaces="till", area=[(0.0, 0.0), (2.0, 0.0), (2.0, 4.0)]))
    assert written in path.read_text()
    week = list(load_config(path).rules[1].days)
    save_zone(path, change("till", {**same, "days": week, "hours": ("22:00", "06:00")}, replaces="till"))
    block = (
        "- id: queue  # at noon\n  kind: crowded\n  zone: till\n  more_than: 4.0\n"
        "  hours: ['22:00', '06:00']\n  people: [Ann, 3]\n  cameras: [c0]\n"
    )
    assert block in path.read_text()
    cleared = {"people": [], "days": None, "hours": None, "cameras": [], "hold_s": 2.5}
    save_zone(path, change("till", {**same, **cleared}, replaces="till"))
    block = "- id: queue  # at noon\n  kind: crowded\n  zone: till\n  more_than: 4.0\n  hold_s: 2.5\n"
    assert block in path.read_text()


def test_rules_on_no_zone_are_replaced_and_the_others_stay(path: Path) -> None:
    save_site_rules(
        path, [{"id": "close", "kind": "close", "closer_than_m": 2.0}, {"id": "all", "kind": "entered"}]
    )
    assert "# anybody\n- {id: close, kind: close, closer_than_m: 2}\n" in path.read_text()
    assert [(rule.id, rule.zone) for rule in load_config(path).rules] == [
        ("queue", "till"),
        ("close", None),
        ("came-in", "door"),
        ("all", None),
    ]
    save_site_rules(path, [])
    assert [rule.id for rule in load_config(path).rules] == ["queue", "came-in"]
    with pytest.raises(UserError, match=r"rule 1: a: crossed needs zone"):
        save_site_rules(path, [{"id": "a", "kind": "crossed"}])


@pytest.mark.parametrize(
    ("rule", "error"),
    [
        ({"hours": ("8", "25:00")}, "rule 1: hours.0: is not a time of day such as 08:30 (and 1 more)"),
        ({"days": ["moon"]}, "rule 1: days.0: Input should be 'mon'"),
        ({"days": ()}, "rule 1: days: "),
        ({"people": [-3]}, "rule 1: people.0"),
        ({"cameras": ["c7"]}, "rules: queue: there is no camera 'c7'; there are c0"),
        ({"hold_s": -1}, "rule 1: hold_s: Input should be greater than or equal to 0"),
        ({"more_than": 10_001}, "rule 1: more_than: Input should be less than or equal to 10000"),
        ({"direction": "inward"}, "rule 1: queue: direction: is for crossed, not for crowded; leave it out"),
    ],
)
def test_an_invalid_rule_is_one_line_that_names_it(path: Path, rule: dict[str, Any], error: str) -> None:
    with pytest.raises(UserError) as refused:
        save_zone(path, change("till", {**QUEUE, **rule}, replaces="till"))
    assert error in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == TEXT


def test_a_removed_zone_takes_its_rules_along(path: Path) -> None:
    remove_zone(path, "till")
    config = load_config(path)
    assert [zone.id for zone in config.zones] == ["door"]
    assert [rule.id for rule in config.rules] == ["close", "came-in"]
    assert "# the way in\n  - id: door  # two\n" in path.read_text()


@pytest.mark.parametrize(
    ("wanted", "error"),
    [
        (change("till"), "zones: two are called 'till'"),
        (change("", replaces="till"), "the zone: id: a name has letters"),
        (change("a/b"), "the zone: id"),
        (change("x", area=AREA[:2]), "the zone: area: List should have at least 3 items"),
        (change("x", area=[(0.0, 0.0)] * 3), "x: area: the corners are all on one line"),
        (change("x", area=AREA * 40), "the zone: area: List should have at most 100 items"),
        (change("x", area=[(float("inf"), 0.0), *AREA]), "zones"),
        (change("x", camera="c7"), "zones: x: there is no camera 'c7'; there are c0"),
        (
            change("x", line=[(0.0, 0.0), (1.0, 0.0)]),
            "x: needs either area, its corners, or line, its two ends",
        ),
        (change("x", {"id": "a", "kind": "crossed"}), "rules: a: crossed is about lines, and x is an area"),
        (change("x", {"id": "a", "kind": "stayed"}), "rule 1: a: stayed needs longer_than_s"),
        (change("x", {"id": "a", "kind": "wave"}), "rule 1: kind: Input should be 'entered'"),
        (change("x", {"id": "close", "kind": "left"}), "rules: two are called 'close'"),
        (change("x", QUEUE, QUEUE), "rule 2: another one is called 'queue'"),
        (change("x", replaces="gone"), "there is no zone 'gone'"),
    ],
)
def test_what_the_loader_refuses_is_one_line_and_changes_nothing(
    path: Path, wanted: ZoneChange, error: str
) -> None:
    with pytest.raises(UserError) as refused:
        save_zone(path, wanted)
    assert error in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == TEXT
    assert not kept(path)


def test_a_rule_that_a_webhook_names_stays(path: Path) -> None:
    text = TEXT + "webhooks: [{url: 'https://example.org/', rules: [queue]}]\n"
    path.write_text(text)
    with pytest.raises(UserError, match="queue"):
        remove_zone(path, "till")
    assert path.read_text() == text


@pytest.mark.parametrize("text", ["", "[]", "cameras: [", "\0", "cameras: [{id: c0, source: x}]\nzones: 3\n"])
def test_a_file_that_cannot_be_used_is_one_line(path: Path, text: str) -> None:
    path.write_text(text)
    for attempt in (lambda: save_zone(path, change()), lambda: remove_zone(path, "till")):
        with pytest.raises(UserError) as refused:
            attempt()
        assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == text


NAMES = st.text(string.ascii_letters + string.digits, min_size=1, max_size=3)
POINTS = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
FORMS = st.sampled_from([TEXT, TEXT.replace("- {", "-   {"), "{cameras: [{id: c0, source: 'scene:room'}]}\n"])


@given(FORMS, st.lists(st.tuples(NAMES, st.lists(POINTS, min_size=3, max_size=6)), max_size=6))
def test_any_zones_saved_one_after_the_other_are_those_of_the_file(
    tmp_path_factory: pytest.TempPathFactory, text: str, wanted: list[tuple[str, list[tuple[float, float]]]]
) -> None:
    path = tmp_path_factory.mktemp("zones") / "site.yaml"
    path.write_text(text)
    saved = {zone.id: zone.area for zone in load_config(path).zones}
    for name, area in wanted:
        # It may be refused because the corners are on one line.
        with contextlib.suppress(UserError):
            save_zone(path, change(name, area=area, replaces=name if name in saved else None))
            saved[name] = area
        assert {zone.id: zone.area for zone in load_config(path).zones} == saved
