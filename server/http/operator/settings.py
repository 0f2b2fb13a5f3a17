"""``/api/operator/config`` and ``view_selection``: the configuration in force, and settings to try out."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping
from typing import Any

from aiohttp import web
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from server.config.loader import change_view_settings
from server.config.sections import LIVE_VIEW_SETTINGS, ViewSettings
from server.config.site_config import Config
from server.config.yaml_file import dump_yaml, dump_yaml_inline
from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import ON_DISK, SERVICE
from server.http.json_responses import error_response, json_response, read_json
from server.http.operator.schema import SelectionSettings, Setting, Settings
from server.service.service import BestViewService
from server.system.address_redaction import HIDDEN, redact_address, redact_endpoint
from server.system.errors import UserError

routes = web.RouteTableDef()

_ENDPOINTS = frozenset({"zenoh.connect", "zenoh.listen"})
_PASSWORD = re.compile(r"cameras[.][^.]+[.]password")
"""The name of a file, hidden since some write the password itself there."""


@routes.get(f"{OPERATOR_PATH}/config")
async def get_config(request: web.Request) -> web.Response:
    """Return the configuration in force and how it differs from the defaults; passwords are hidden."""
    on_disk = request.app[ON_DISK]()
    settings = list(settings_of(request.app[SERVICE].config))
    return json_response(Settings(settings, on_disk.error, list(on_disk.pending_restart)))


@routes.get(f"{OPERATOR_PATH}/view_selection")
async def get_view_selection(request: web.Request) -> web.Response:
    """Return the view selection's settings in force, and the configured ones."""
    return json_response(_selection_settings(request.app[SERVICE]))


@routes.put(f"{OPERATOR_PATH}/view_selection")
async def put_view_selection(request: web.Request) -> web.Response:
    """Try out view-selection settings, until they are changed again or the service ends."""
    service = request.app[SERVICE]
    operations = service.operations
    changes = await read_json(request, dict[str, float | bool])
    current = _flat(operations.view_settings)
    for key in changes:
        if key not in current:
            return error_response(400, f"view.{key}: cannot be changed here; these can: {', '.join(current)}")
    try:
        operations.change_view_settings(
            change_view_settings(operations.view_settings, _nested(changes), "to try out")
        )
    except UserError as error:
        return error_response(400, str(error))
    return json_response(_selection_settings(service))


@routes.delete(f"{OPERATOR_PATH}/view_selection")
async def delete_view_selection(request: web.Request) -> web.Response:
    """Restore the configured view-selection settings."""
    service = request.app[SERVICE]
    service.operations.reset_view_settings()
    return json_response(_selection_settings(service))


def settings_of(config: Config) -> Iterator[Setting]:
    """Yield every setting in force, in the reference's order."""
    for name, field in Config.model_fields.items():
        if name == "cameras":
            for camera in config.cameras:
                yield from _settings(f"cameras.{camera.id}", camera, type(camera))
        else:
            yield from _setting(name, getattr(config, name), field.get_default(call_default_factory=True))


def _settings(place: str, section: Any, default: Any) -> Iterator[Setting]:
    """Yield a section's settings; ``default`` is an instance with the defaults, or the class."""
    for name in _names(section):
        if isinstance(default, type) and issubclass(default, BaseModel):
            usual = default.model_fields[name].get_default(call_default_factory=True)
        else:
            usual = getattr(default, name)
        yield from _setting(f"{place}.{name}", getattr(section, name), usual)


def _setting(key: str, value: Any, usual: Any) -> Iterator[Setting]:
    if isinstance(value, BaseModel) or dataclasses.is_dataclass(value):
        yield from _settings(key, value, usual)
    else:
        default = None if usual is PydanticUndefined else _written(key, usual)
        yield Setting(key, _written(key, value), default, usual is not PydanticUndefined and value != usual)


def _names(section: Any) -> list[str]:
    if isinstance(section, BaseModel):
        return list(type(section).model_fields)
    return [field.name for field in dataclasses.fields(section)]


def _written(key: str, value: Any) -> str:
    """Return a value as YAML, with secrets hidden."""
    if key in _ENDPOINTS:
        return dump_yaml_inline(redact_endpoint(value))
    if value is not None and _PASSWORD.fullmatch(key):
        return dump_yaml_inline(HIDDEN)
    return dump_yaml_inline(_shown(value))


def _shown(value: Any) -> Any:
    """Return a value with secrets hidden: of URLs only the host, of FFmpeg options only the names."""
    match value:
        case Mapping():
            return {redact_address(it): HIDDEN for it in value}
        case list() | tuple():
            return [_shown(it) for it in value]
        case bool() | int() | float() | None:
            return value
        case _:
            return redact_address(str(value))


def _selection_settings(service: BestViewService) -> SelectionSettings:
    current, file, defaults = (
        _flat(service.operations.view_settings),
        _flat(service.config.view),
        _flat(ViewSettings()),
    )
    lines = {key: value for key, value in current.items() if value != defaults[key] or value != file[key]}
    written = "" if not lines else dump_yaml({"view": _nested(lines)})
    least, most = service.config.least_lookahead, service.operations.max_lookahead
    return SelectionSettings(
        values=current, file=file, lines=written, min_lookahead=least, max_lookahead=most
    )


def _flat(view: ViewSettings) -> dict[str, float | bool]:
    flat: dict[str, float | bool] = {}
    for name in LIVE_VIEW_SETTINGS:
        value = getattr(view, name)
        if dataclasses.is_dataclass(value):
            flat |= {f"{name}.{it.name}": getattr(value, it.name) for it in dataclasses.fields(value)}
        else:
            flat[name] = value
    return flat


def _nested(flat: Mapping[str, float | bool]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for key, value in flat.items():
        section, _, name = key.rpartition(".")
        (nested.setdefault(section, {}) if section else nested)[name] = value
    return nested
