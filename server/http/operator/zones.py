"""``/api/operator/zones``: zones in the configuration file with their rules; changes apply while it runs."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec
from aiohttp import web

from server.config.ground_unit import UNITS_PER_METER
from server.config.loader import load_config
from server.config.site_config import Config
from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import CONTROL, SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.config_file import change_config, config_path
from server.http.operator.schema import SiteZone, SiteZones, ZoneRule
from server.rules import RuleKind
from server.rules.schedule import DAYS
from server.setup.site_zones import ZoneChange, remove_zone, save_site_rules, save_zone
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/zones"
_CHANGED = "zones or rules were changed in the configuration meanwhile: cancel, and open this again"
_SEVERAL = "the site has several services (view.sharding): change zones in the file, and reload all of them"


class ZoneToSave(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A zone with all rules on it, or all rules that are on none."""

    zone: str | None
    """Its id; null: the rules apply anywhere on the site, and nothing else is given."""
    camera: str | None = None
    area: list[tuple[float, float]] | None = None
    line: list[tuple[float, float]] | None = None
    inner: tuple[float, float] | None = None
    rules: list[ZoneRule] = []
    replaces: str | None = None
    """The id of the zone that it replaces; null: it is a new one."""
    digest: str | None = None
    """Of the zones and rules that this change is based on; null: it is made whatever they are."""


class ZoneToRemove(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A zone's id."""

    zone: str
    digest: str | None = None
    """As in ZoneToSave."""


@routes.get(_PATH)
async def get_zones(request: web.Request) -> web.Response:
    """Return the zones in the configuration file with their rules."""
    return json_response(await _zones(request))


@routes.put(_PATH)
@json_body(ZoneToSave)
async def put_zone(request: web.Request, wanted: ZoneToSave) -> web.Response:
    """Save a zone with its rules in the configuration file, or the rules on no zone, and apply that."""
    rules = [{**msgspec.structs.asdict(rule), "id": rule.rule} for rule in wanted.rules]
    if wanted.zone is None:
        return await _change(request, partial(save_site_rules, wanted=rules), wanted.digest)
    zone = {"id": wanted.zone, "camera": wanted.camera, "area": wanted.area, "line": wanted.line}
    change = ZoneChange({**zone, "inner": wanted.inner}, rules, wanted.replaces)
    return await _change(request, partial(save_zone, change=change), wanted.digest)


@routes.delete(_PATH)
@json_body(ZoneToRemove)
async def delete_zone(request: web.Request, wanted: ZoneToRemove) -> web.Response:
    """Remove a zone and its rules from the configuration file, and apply that."""
    return await _change(request, partial(remove_zone, zone_id=wanted.zone), wanted.digest)


async def _change(request: web.Request, change: Callable[[Path], None], digest: str | None) -> web.Response:
    """Change the file unless it has changed meanwhile, let it be read again, and return its zones."""

    def change_unchanged(path: Path) -> None:
        if digest is not None and _digest(load_config(path)) != digest:
            raise UserError(_CHANGED)
        change(path)

    try:
        path = _editable_path(request)
        await change_config(path, change_unchanged)
    except UserError as error:
        return error_response(409, str(error))
    reload = request.app[CONTROL].reload
    if reload is not None:
        reload()
    return json_response(await _zones(request))


def _editable_path(request: web.Request) -> Path:
    """Return the configuration file of the site.

    Raises:
        UserError: there is none, or other services have files of their own.
    """
    if request.app[SERVICE].config.view.sharding.services > 1:
        raise UserError(_SEVERAL)
    return config_path(request)


async def _zones(request: web.Request) -> SiteZones:
    """Return the zones in the file; if it cannot be used, those in force, and why."""
    running = request.app[SERVICE].config
    try:
        file = await asyncio.to_thread(load_config, _editable_path(request))
    except UserError as error:
        return _answer(running, str(error), in_force=True, unit=_floor_unit(running))
    in_force = (file.zones, file.rules) == (running.zones, running.rules)
    return _answer(file, "", in_force=in_force, unit=_floor_unit(running))


def _answer(config: Config, unavailable: str, *, in_force: bool, unit: str) -> SiteZones:
    return SiteZones(unavailable, in_force, unit, _zones_of(config), _rules_on(None, config), _digest(config))


def _digest(config: Config) -> str:
    sections = config.model_dump_json(include={"zones", "rules"})
    return hashlib.sha256(sections.encode()).hexdigest()


def _zones_of(config: Config) -> list[SiteZone]:
    return [
        SiteZone(zone.id, zone.camera, zone.area, zone.line, zone.inner, _rules_on(zone.id, config))
        for zone in config.zones
    ]


def _rules_on(zone: str | None, config: Config) -> list[ZoneRule]:
    return [
        ZoneRule(
            rule=rule.id,
            kind=rule.kind.value,
            direction=None if rule.direction is None else rule.direction.value,
            longer_than_s=rule.longer_than_s,
            more_than=rule.more_than,
            closer_than_m=rule.closer_than_m,
            hold_s=rule.hold_s if rule.kind in (RuleKind.CROWDED, RuleKind.CLOSE) else None,
            people=list(rule.people),
            days=None if set(rule.days) == set(DAYS) else list(rule.days),
            hours=None if rule.hours is None else (f"{rule.hours[0]:%H:%M}", f"{rule.hours[1]:%H:%M}"),
            cameras=list(rule.cameras),
        )
        for rule in config.rules
        if rule.zone == zone
    ]


def _floor_unit(config: Config) -> str:
    """Return the unit of coordinates on the floor; empty: it is unknown."""
    units = {camera.ground_unit or "" for camera in config.cameras if camera.ground is not None}
    unit = units.pop() if len(units) == 1 else ""
    return "m" if unit in UNITS_PER_METER else unit
