"""Configuration loader: from a YAML file to a :class:`Config`, or to a one-line error."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from pydantic_settings import SettingsError

from bestview import ground_handedness, validate_homography
from server.config.duplicate_keys import DuplicateKeyError, parse_json
from server.config.environment import check_environment, environment_hint
from server.config.ground_unit import check_unit_spelling
from server.config.sections import (
    CameraSettings,
    ProcessTlsSettings,
    SitesSettings,
    SyncSettings,
    TlsSettings,
    ViewSettings,
    ZenohSettings,
)
from server.config.site_config import Config
from server.config.source_address import SourceKind, resolve_source, source_kind
from server.config.unknown_keys import did_you_mean
from server.config.values import (
    check_depth_and_texts,
    check_numbers,
    check_printable_name,
    redact_and_abbreviate,
)
from server.config.yaml_file import read_yaml
from server.system.errors import UserError, reason_of

SectionT = TypeVar("SectionT", bound=BaseModel)
ProcessSection = TypeVar("ProcessSection", SyncSettings, ZenohSettings)


def load_config(path: Path) -> Config:
    """Read a site's configuration; paths in it are relative to the file.

    Raises:
        UserError: the file cannot be read, or something in it is wrong.
    """
    return build_config(read_content(path), where=str(path), folder=path.parent)


def read_content(path: Path) -> dict[str, Any]:
    """Read a configuration file's sections, unchecked.

    Raises:
        UserError: it cannot be read, or is not a mapping of sections.
    """
    content = read_yaml(path, "the configuration")
    if not isinstance(content, dict) or not all(isinstance(section, str) for section in content):
        raise UserError(f"{path}: a configuration is a mapping of sections, such as 'cameras:'")
    return content


def build_config(content: Mapping[str, Any], *, where: str, folder: Path) -> Config:
    """Check a configuration's content, the environment's overrides, and the files that it names.

    Raises:
        UserError: something is wrong; the text begins with ``where``.
    """
    check_environment(where)
    check_depth_and_texts(content, where)
    try:
        config = Config(**content)
    except ValidationError as error:
        # its text repeats keys unredacted
        raise UserError(_one_line(where, error) + environment_hint(error.errors()[0]["loc"])) from None
    except SettingsError as error:
        raise UserError(f"{where}: environment: {error}; a list, or a whole section, must be JSON") from error
    check_numbers(config.model_dump(), where)
    return resolve_ground_and_paths(config, where=where, folder=folder)


def resolve_ground_and_paths(config: Config, *, where: str, folder: Path) -> Config:
    """Read the ground that a configuration names, and resolve all its paths.

    Raises:
        UserError: the ground cannot be read, or is wrong; the text begins with ``where``.
    """
    homographies, unit = _homographies(folder / config.ground, where) if config.ground else ({}, None)
    try:
        cameras = [_resolved(camera, homographies, unit, folder) for camera in config.cameras]
        _check_handedness(cameras)
    except ValueError as error:
        raise UserError(f"{where}: {error}") from error
    onnx = config.detect.onnx_in(folder)
    detect = replace(config.detect, onnx=onnx)
    sound = config.sound
    if sound.source is not None and sound.source not in config.camera_ids:
        sound = sound.model_copy(update={"source": resolve_source(sound.source, folder)})
    record = config.record
    if record.folder is not None:
        record = record.model_copy(update={"folder": folder / record.folder})
    update = {"cameras": cameras, "detect": detect, "sound": sound, "record": record}
    update |= _resolved_integrations(config, folder)
    return config.model_copy(update={**update, **_resolved_access(config, folder)})


def _resolved_access(config: Config, folder: Path) -> dict[str, Any]:
    """Return the sections with files of tokens, passwords and certificates, with absolute paths."""
    access, tls, rtsp = config.access, config.http.tls, config.rtsp
    if access.tokens is not None:
        access = access.model_copy(update={"tokens": folder / access.tokens})
    certificate = None if rtsp.certificate is None else (folder / rtsp.certificate).absolute()
    rtsp = rtsp.model_copy(update={"tls": _resolved_tls(rtsp.tls, folder), "certificate": certificate})
    return {
        "access": access,
        "http": config.http.model_copy(update={"tls": _resolved_tls(tls, folder)}),
        "rtsp": rtsp,
        "sync": _process_files(config.sync, folder),
        "zenoh": _process_files(config.zenoh, folder),
        "sites": _resolved_sites(config.sites, folder),
    }


def _resolved_sites(sites: SitesSettings, folder: Path) -> SitesSettings:
    links = {}
    for name, link in sites.link.items():
        files = {"users": link.users, "authority": link.authority}
        update = {key: (folder / path).absolute() for key, path in files.items() if path is not None}
        links[name] = link.model_copy(update=update)
    return sites.model_copy(update={"link": links})


def _resolved_tls(tls: TlsSettings, folder: Path) -> TlsSettings:
    if tls.certificate is None or tls.key is None:
        return tls
    return tls.model_copy(update={"certificate": folder / tls.certificate, "key": folder / tls.key})


def _resolved_integrations(config: Config, folder: Path) -> dict[str, Any]:
    """Return the sections of other systems, with absolute paths of their secrets."""
    files = {name: getattr(config.mqtt, name) for name in ("password", "authority")}
    mqtt = config.mqtt.model_copy(update={name: folder / path for name, path in files.items() if path})
    webhooks = [
        webhook.model_copy(update={"secret": folder / webhook.secret}) if webhook.secret else webhook
        for webhook in config.webhooks
    ]
    return {"mqtt": mqtt, "webhooks": webhooks}


def _process_files(section: ProcessSection, folder: Path) -> ProcessSection:
    """Resolve the paths of ``users`` and ``tls`` in a section."""

    def resolved(path: Path | None) -> Path | None:
        return None if path is None else (folder / path).absolute()

    tls = ProcessTlsSettings(
        **{name: resolved(getattr(section.tls, name)) for name in ProcessTlsSettings.model_fields}
    )
    return section.model_copy(update={"tls": tls, "users": resolved(section.users)})


def change_view_settings(view: ViewSettings, changes: Mapping[str, Any], where: str) -> ViewSettings:
    """Return view-selection settings with some changed, checked like those of a file.

    Raises:
        UserError: something is wrong; the text begins with ``where``.
    """
    check_depth_and_texts(changes, where)
    try:
        return ViewSettings.model_validate(_merged(view.model_dump(), changes))
    except ValidationError as error:
        raise UserError(_one_line(where, error, ("view",))) from None


def _merged(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge changes into nested content."""
    merged = dict(content)
    for key, value in changes.items():
        inner = merged.get(key)
        merged[key] = _merged(inner, value) if isinstance(inner, dict) and isinstance(value, dict) else value
    return merged


def _resolved(
    camera: CameraSettings, homographies: Mapping[str, Any], unit: str | None, folder: Path
) -> CameraSettings:
    """Make a camera's paths absolute and fill in its homography and unit from the file for all cameras.

    Raises:
        ValueError: its substream cannot be one of its source.
    """
    ground, ground_unit = camera.ground, camera.ground_unit
    if ground is None:
        ground, ground_unit = homographies.get(camera.id), ground_unit or unit
    detections = folder / camera.detections if camera.detections else None
    source = resolve_source(camera.source, folder)
    substream = None if camera.substream is None else resolve_source(camera.substream, folder)
    _check_substream(camera.id, source, substream)
    update = {
        "ground": ground,
        "ground_unit": ground_unit,
        "source": source,
        "substream": substream,
        "password": folder / camera.password if camera.password else None,
        "detections": detections,
    }
    return camera.model_copy(update=update)


def _check_substream(camera_id: str, source: str, substream: str | None) -> None:
    """Check that a substream can show the same as the source.

    Raises:
        ValueError: it cannot.
    """
    if substream is None:
        return
    if substream == source:
        raise ValueError(f"camera {camera_id}: substream: it is the source: leave it out")
    kinds = source_kind(source), source_kind(substream)
    if (kinds[0] is SourceKind.STREAM) != (kinds[1] is SourceKind.STREAM):
        raise ValueError(
            f"camera {camera_id}: substream: a network camera's is an address, a recording's a file"
        )


def _check_handedness(cameras: Sequence[CameraSettings]) -> None:
    """Check that no homography mirrors the ground plane against the others.

    Raises:
        ValueError: one does.
    """
    handedness = {
        camera.id: ground_handedness(np.array(camera.ground, dtype=np.float64))
        for camera in cameras
        if camera.ground is not None
    }
    groups = [[camera for camera, side in handedness.items() if side == sign] for sign in (1, -1)]
    minority, majority = sorted(groups, key=len)
    if minority:
        raise ValueError(
            f"ground: camera {minority[0]} has the floor mirrored against camera {majority[0]}: one of them "
            "has its horizon below the floor, as if tilted past straight down, or its axes exchanged"
        )


def _homographies(path: Path, where: str) -> tuple[dict[str, list[list[float]]], str | None]:
    """Read homographies by camera, and the unit, which is optional.

    The file is ``{"unit": "m", "homography": {"c0": [[…], […], […]]}}``.

    Raises:
        UserError: it cannot be read, a matrix is not an invertible 3x3, or the unit is invalid.
    """
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
        matrices = dict(content["homography"].items())
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{where}: ground: cannot read {path}: {reason_of(error)}") from error
    except json.JSONDecodeError as error:
        reason = f"{error.msg}, line {error.lineno}, column {error.colno}"
        raise UserError(f"{where}: ground: {path} is not JSON: {reason}") from error
    except DuplicateKeyError as error:
        raise UserError(f"{where}: ground: {path}: {error}") from error
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        raise UserError(f'{where}: ground: {path} has no {{"homography": {{camera: 3x3}}}}') from error
    for camera_id, matrix in matrices.items():
        check_printable_name(camera_id, f"{where}: ground: {path}")
        try:
            validate_homography(matrix, f"camera {camera_id}")
        except ValueError as error:
            raise UserError(f"{where}: ground: {path}: {error}") from error
    try:
        return matrices, None if content.get("unit") is None else check_unit_spelling(content["unit"])
    except ValueError as error:
        raise UserError(f"{where}: ground: {path}: unit: {error}") from error


def check_section(section: type[SectionT], content: Mapping[str, Any], where: str) -> SectionT:
    """Check the content of one section.

    Raises:
        UserError: something is wrong; the text begins with ``where``.
    """
    try:
        return section(**content)
    except ValidationError as error:
        raise UserError(_one_line(where, error)) from None  # its text repeats keys unredacted


def _one_line(where: str, error: ValidationError, within: tuple[str, ...] = ()) -> str:
    errors = error.errors()
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return " ".join(f"{where}: {_plain(errors[0], within)}{more}".split())


def _plain(detail: ErrorDetails, within: tuple[str, ...]) -> str:
    loc = (*within, *detail["loc"])
    place = ".".join(redact_and_abbreviate(str(part)) for part in loc)
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        message = "; ".join(filter(None, ("unknown key", did_you_mean(str(loc[-1]), _known_keys(loc[:-1])))))
    return f"{place}: {message}" if place else message


def _known_keys(section: tuple[int | str, ...]) -> list[str]:
    """Return the keys of a section, given its path."""
    model: Any = Config
    for part in section:
        if isinstance(part, int):
            (model,) = get_args(model) or (None,)  # the items of a list
        elif isinstance(model, type) and issubclass(model, BaseModel) and part in model.model_fields:
            model = model.model_fields[part].annotation
    return list(model.model_fields) if isinstance(model, type) and issubclass(model, BaseModel) else []
