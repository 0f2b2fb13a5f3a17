"""``/api/operator/zones``: zones in the configuration file with their rules; changes apply while it runs."""

from __future__ import annotations

import asyncio
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
from server.http.json_responses import error_response, json_response, read_json
from server.http.operator.config_file import change_config, config_path
from server.http.operator.schema import SiteZone, SiteZones, ZoneRule
from server.setup.site_zones import ZoneChange, remove_zone, save_zone
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/zones"
_SEVERAL = "the site has several services (view.share): change zones in the file, and reload all of them"


class ZoneToSave(SiteZone, frozen=True, forbid_unknown_fields=True):
    """A zone with all rules on it."""

    replaces: str | None = None
    """The id of the zone that it replaces; null: it is a new one."""


class ZoneToRemove(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A zone's id."""

    zone: str


@routes.get(_PATH)
async def get_zones(request: web.Request) -> web.Response:
    """Return the zones in the configuration file with their rules."""
    return json_response(await _zones(request))


@routes.put(_PATH)
async def put_zone(request: web.Request) -> web.Response:
    """Save a zone with its rules in the configuration file, and apply it."""
    wanted = await read_json(request, ZoneToSave)
    zone = {"id": wanted.zone, "camera": wanted.camera, "area": wanted.area, "line": wanted.line}
    rules = [{**msgspec.structs.asdict(rule), "id": rule.rule} for rule in wanted.rules]
    change = ZoneChange({**zone, "inner": wanted.inner}, rules, wanted.replaces)
    return await _change(request, partial(save_zone, change=change))


@routes.delete(_PATH)
async def delete_zone(request: web.Request) -> web.Response:
    """Remove a zone and its rules from the configuration file, and apply that."""
    wanted = await read_json(request, ZoneToRemove)
    return await _change(request, partial(remove_zone, zone_id=wanted.zone))


async def _change(request: web.Request, change: Callable[[Path], None]) -> web.Response:
    """Change the file, let it be read again, and return its zones."""
    try:
        path = _editable_path(request)
        await change_config(path, change)
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
    if request.app[SERVICE].config.view.share.services > 1:
        raise UserError(_SEVERAL)
    return config_path(request)


async def _zones(request: web.Request) -> SiteZones:
    """Return the zones in the file; if it cannot be used, those in force, and why."""
    running = request.app[SERVICE].config
    try:
        file = await asyncio.to_thread(load_config, _editable_path(request))
    except UserError as error:
        return SiteZones(str(error), in_force=True, unit=_floor_unit(running), zones=_zones_of(running))
    in_force = (file.zones, file.rules) == (running.zones, running.rules)
    return SiteZones("", in_force, _floor_unit(running), _zones_of(file))


def _zones_of(config: Config) -> list[SiteZone]:
    return [
        SiteZone(
            zone.id,
            zone.camera,
            zone.area,
            zone.line,
            zone.inner,
            [
                ZoneRule(
                    rule.id,
                    rule.kind.value,
                    None if rule.direction is None else rule.direction.value,
                    rule.longer_than_s,
                    rule.more_than,
                    rule.closer_than_m,
                )
                for rule in config.rules
                if rule.zone == zone.id
            ],
        )
        for zone in config.zones
    ]


def _floor_unit(config: Config) -> str:
    """Return the unit of coordinates on the floor; empty: it is unknown."""
    units = {camera.ground_unit or "" for camera in config.cameras if camera.ground is not None}
    unit = units.pop() if len(units) == 1 else ""
    return "m" if unit in UNITS_PER_METER else unit
