"""``/api/operator/config`` and ``view_selection``: the configuration in force, and trial settings."""

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
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.schema import SelectionSettings, Setting, Settings
from server.service.service import BestViewService
from server.system.address_redaction import HIDDEN, redact_to_host, redact_zenoh_endpoint
from server.system.errors import UserError
from tracking.frame_rate import seconds_up

routes = web.RouteTableDef()

_SECRETS = frozenset({"secret", "password"})
"""Keys of the items of lists likewise."""

_ENDPOINTS = frozenset({"zenoh.connect", "zenoh.listen"})
_PASSWORD = re.compile(r"(cameras[.][^.]+|mqtt)[.]password")
"""Keys of password files; the file name is hidden, since some enter the password itself there."""


@routes.get(f"{OPERATOR_PATH}/config")
async def get_config(request: web.Request) -> web.Response:
    """Return the configuration in force and how it differs from the defaults; passwords are hidden."""
    on_disk = request.app[ON_DISK]()
    settings = list(settings_of(request.app[SERVICE].config))
    return json_response(Settings(settings, on_disk.error, list(on_disk.changed_keys)))


@routes.get(f"{OPERATOR_PATH}/view_selection")
async def get_view_selection_settings(request: web.Request) -> web.Response:
    """Return the view-selection settings in force, and the configured ones."""
    return json_response(_selection_settings(request.app[SERVICE]))


@routes.put(f"{OPERATOR_PATH}/view_selection")
@json_body(dict[str, float | bool])
async def put_view_selection_settings(request: web.Request, changes: dict[str, float | bool]) -> web.Response:
    """Change view-selection settings until they are changed again or the service ends."""
    service = request.app[SERVICE]
    operations = service.operations
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
async def delete_view_selection_settings(request: web.Request) -> web.Response:
    """Restore the configured view-selection settings."""
    service = request.app[SERVICE]
    service.operations.reset_view_settings()
    return json_response(_selection_settings(service))


def settings_of(config: Config) -> Iterator[Setting]:
    """Yield every setting in force, in the order of the reference."""
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
            default_value = default.model_fields[name].get_default(call_default_factory=True)
        else:
            default_value = getattr(default, name)
        yield from _setting(f"{place}.{name}", getattr(section, name), default_value)


def _setting(key: str, value: Any, default_value: Any) -> Iterator[Setting]:
    if isinstance(value, BaseModel) or dataclasses.is_dataclass(value):
        yield from _settings(key, value, default_value)
    else:
        default = None if default_value is PydanticUndefined else _as_yaml(key, default_value)
        yield Setting(
            key,
            _as_yaml(key, value),
            default,
            default_value is not PydanticUndefined and value != default_value,
        )


def _names(section: Any) -> list[str]:
    if isinstance(section, BaseModel):
        return list(type(section).model_fields)
    return [field.name for field in dataclasses.fields(section)]


def _as_yaml(key: str, value: Any) -> str:
    """Return a value as YAML, without secrets."""
    if key in _ENDPOINTS:
        return dump_yaml_inline(",".join(map(redact_zenoh_endpoint, value.split(","))))
    if value is not None and _PASSWORD.fullmatch(key):
        return dump_yaml_inline(HIDDEN)
    return dump_yaml_inline(_redacted(value))


def _redacted(value: Any) -> Any:
    """Return a value without secrets: only the host of URLs, only the names of FFmpeg options."""
    match value:
        case BaseModel():
            named = {name: getattr(value, name) for name in sorted(value.model_fields_set)}
            return {name: HIDDEN if name in _SECRETS else _redacted(inner) for name, inner in named.items()}
        case Mapping():
            return {redact_to_host(key): HIDDEN for key in value}
        case list() | tuple():
            return [_redacted(item) for item in value]
        case bool() | int() | float() | None:
            return value
        case _:
            return redact_to_host(str(value))


def _selection_settings(service: BestViewService) -> SelectionSettings:
    current = _flat(service.operations.view_settings)
    file, defaults = _flat(service.config.view), _flat(ViewSettings())
    lines = {key: value for key, value in current.items() if value != defaults[key] or value != file[key]}
    text = "" if not lines else dump_yaml({"view": _nested(lines)})
    fps = service.config.site.fps
    return SelectionSettings(
        values=current,
        file=file,
        lines=text,
        min_lookahead_s=seconds_up(service.config.least_lookahead, fps),
        max_lookahead_s=service.operations.max_lookahead / fps,
    )


def _flat(view: ViewSettings) -> dict[str, float | bool]:
    flat: dict[str, float | bool] = {}
    for name in LIVE_VIEW_SETTINGS:
        value = getattr(view, name)
        if dataclasses.is_dataclass(value):
            flat |= {
                f"{name}.{field.name}": getattr(value, field.name) for field in dataclasses.fields(value)
            }
        else:
            flat[name] = value
    return flat


def _nested(flat: Mapping[str, float | bool]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for key, value in flat.items():
        section, _, name = key.rpartition(".")
        (nested.setdefault(section, {}) if section else nested)[name] = value
    return nested
