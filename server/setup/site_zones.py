"""The zones in a configuration file with their rules: saved and removed, one zone at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.config.loader import check_section, load_config, read_content
from server.config.sections import RuleSettings, ZoneSettings
from server.setup.site_file import check_text, replace_file
from server.setup.yaml_edit import changed_lists_text, plain_numbers
from server.system.errors import UserError

_Entry = dict[str, Any]

_ZONE_KEYS = ("id", "camera", "area", "line", "inner")
"""Settings that are given with a change; others of an earlier entry stay."""
_ALWAYS: dict[str, tuple[Any, ...]] = {
    "people": ([],),
    "days": (RuleSettings.model_fields["days"].default,),
    "cameras": ([],),
    "hold_s": (RuleSettings.model_fields["hold_s"].default,),
}
"""Values of a rule's settings that are as good as none."""


@dataclass(frozen=True, slots=True)
class ZoneChange:
    """A zone as it will be.

    Attributes:
        zone: its settings but for those of tolerance, as in the file; None: not set.
        rules: all rules on it, likewise, without the zone.
        replaces: the id of the zone that it replaces; None: it is a new one.
    """

    zone: Mapping[str, Any]
    rules: Sequence[Mapping[str, Any]]
    replaces: str | None = None


def save_zone(path: Path, change: ZoneChange) -> None:
    """Add a zone with its rules to a configuration file, or replace one; the earlier file is kept.

    Raises:
        UserError: the file or what it would become is invalid, there is no zone to replace, or it cannot be
            written.
    """
    zones, rules = _entries(path)
    old = _find(zones, change.replaces) if change.replaces is not None else {}
    zone = _merged(old, change.zone)
    check_section(ZoneSettings, zone, "the zone")
    _write(
        path,
        [zone if each is old else each for each in zones] + ([] if change.replaces is not None else [zone]),
        _with_rules(rules, change.rules, zone["id"], lambda rule: _is_on(rule, change.replaces)),
    )


def save_site_rules(path: Path, wanted: Sequence[Mapping[str, Any]]) -> None:
    """Replace the rules that are on no zone in a configuration file; the earlier file is kept.

    Raises:
        UserError: the file or what it would become is invalid, or it cannot be written.
    """
    zones, rules = _entries(path)
    _write(path, zones, _with_rules(rules, wanted, None, lambda rule: rule.get("zone") is None))


def remove_zone(path: Path, zone_id: str) -> None:
    """Remove a zone and the rules on it from a configuration file; the earlier file is kept.

    Raises:
        UserError: the file or what it would become is invalid, there is no such zone, or it cannot be
            written.
    """
    zones, rules = _entries(path)
    zone = _find(zones, zone_id)
    _write(
        path,
        [each for each in zones if each is not zone],
        [each for each in rules if not _is_on(each, zone_id)],
    )


def _entries(path: Path) -> tuple[list[_Entry], list[_Entry]]:
    """Return zones and rules as in the file, which is valid."""
    load_config(path)
    content = read_content(path)
    return content.get("zones") or [], content.get("rules") or []


def _find(zones: Sequence[_Entry], zone_id: str) -> _Entry:
    for zone in zones:
        if str(zone["id"]) == zone_id:
            return zone
    raise UserError(f"there is no zone {zone_id!a}")


def _is_on(rule: Mapping[str, Any], zone_id: str | None) -> bool:
    return zone_id is not None and rule.get("zone") is not None and str(rule["zone"]) == zone_id


def _with_rules(
    rules: Sequence[_Entry],
    wanted: Sequence[Mapping[str, Any]],
    zone: str | None,
    is_replaced: Callable[[_Entry], bool],
) -> list[_Entry]:
    """Return the rules of an earlier file with other ones on a zone; None: on none.

    Raises:
        UserError: a rule is invalid, or two have the same id.
    """
    earlier = {str(rule["id"]): rule for rule in rules if is_replaced(rule)}
    changed: dict[str, _Entry] = {}
    for number, each in enumerate(wanted, start=1):
        given = {**each, "zone": zone}
        entry = {
            key: plain_numbers(given[key])
            for key in RuleSettings.model_fields
            if given.get(key) not in (None, *_ALWAYS.get(key, ()))
        }
        checked = check_section(RuleSettings, entry, f"rule {number}")
        if checked.id in changed:
            raise UserError(f"rule {number}: another one is called {checked.id!r}; ids must be unique")
        old = earlier.get(checked.id)
        is_same = old is not None and _meaning(RuleSettings(**old)) == _meaning(checked)
        changed[checked.id] = old if old is not None and is_same else entry
    kept = [changed.get(str(rule["id"])) if is_replaced(rule) else rule for rule in rules]
    added = [rule for name, rule in changed.items() if name not in earlier]
    return [rule for rule in (*kept, *added) if rule is not None]


def _meaning(rule: RuleSettings) -> dict[str, Any]:
    return {**rule.model_dump(), "days": sorted(rule.days)}


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> _Entry:
    """Return a zone with new values, and with the tolerances of an earlier one."""
    given = {key: plain_numbers(new[key]) for key in _ZONE_KEYS if new.get(key) is not None}
    return {**given, **{key: value for key, value in old.items() if key not in _ZONE_KEYS}}


def _write(path: Path, zones: Sequence[_Entry], rules: Sequence[_Entry]) -> None:
    text = changed_lists_text(path, {"zones": zones, "rules": rules})
    check_text(text, path)
    replace_file(text, path)
