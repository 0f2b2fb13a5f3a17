"""The zones in a configuration file with their rules: saved and removed, one zone at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.config.loader import load_config, read_content
from server.setup.site_file import check_text, replace_file
from server.setup.yaml_edit import changed_lists_text
from server.system.errors import UserError

_Entry = dict[str, Any]

_ZONE_KEYS = ("id", "camera", "area", "line", "inner")
_RULE_KEYS = ("id", "kind", "zone", "direction", "longer_than_s", "more_than", "closer_than_m")
"""Settings that are given with a change; others of an earlier entry stay."""


@dataclass(frozen=True, slots=True)
class ZoneChange:
    """A zone as it will be.

    Attributes:
        zone: its settings but for those of tolerance, as in the file; None: not set.
        rules: all rules on it, likewise, without the zone and what restricts a rule to times and people.
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
    zone = _merged(old, change.zone, _ZONE_KEYS)
    on_it = {str(rule["id"]): {**rule, "zone": zone["id"]} for rule in change.rules}
    if len(on_it) < len(change.rules):
        raise UserError(f"{path}: rules: two have the same id; ids must be unique")
    earlier = {str(rule.get("id")): rule for rule in rules if _is_on(rule, change.replaces)}
    merged = {name: _merged(earlier.get(name, {}), rule, _RULE_KEYS) for name, rule in on_it.items()}
    _write(
        path,
        [zone if each is old else each for each in zones] + ([] if change.replaces is not None else [zone]),
        [
            *_with_changed(rules, change.replaces, merged),
            *(rule for name, rule in merged.items() if name not in earlier),
        ],
    )


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


def _with_changed(
    rules: Sequence[_Entry], zone_id: str | None, changed: Mapping[str, _Entry]
) -> Iterator[_Entry]:
    """Yield the rules of an earlier file, those on a zone as they will be, without the removed ones."""
    for rule in rules:
        if not _is_on(rule, zone_id):
            yield rule
        elif str(rule["id"]) in changed:
            yield changed[str(rule["id"])]


def _merged(old: Mapping[str, Any], new: Mapping[str, Any], keys: Sequence[str]) -> _Entry:
    """Return an entry with the new values of some keys, and the other values of an earlier one."""
    given = {key: _plain(new[key]) for key in keys if new.get(key) is not None}
    return {**given, **{key: value for key, value in old.items() if key not in keys}}


def _plain(value: Any) -> Any:
    """Return a value as people write it: whole numbers without a fraction, lists of lists."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _write(path: Path, zones: Sequence[_Entry], rules: Sequence[_Entry]) -> None:
    text = changed_lists_text(path, {"zones": zones, "rules": rules})
    check_text(text, path)
    replace_file(text, path)
