"""The cameras in a configuration file: listed, added, changed and removed; a restart brings it into force."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from server.config.loader import load_config, read_content
from server.setup.camera_address import check_name, free_name
from server.setup.camera_pixels import CameraPixels, follow_size
from server.setup.ground import read_ground
from server.setup.own_video import compare_own_video
from server.setup.proposal import SiteProposal
from server.setup.session import TriedCamera
from server.setup.site_file import (
    camera_entry,
    check_text,
    password_file,
    replace_file,
    with_stream_comments,
    write_passwords,
)
from server.setup.site_pixels import Size
from server.setup.yaml_edit import changed_lists_text
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

_Entry = dict[str, Any]
_DIGEST_KEY = secrets.token_bytes(32)
"""An entry may contain a password, which a digest without a key would allow to guess."""


@dataclass(frozen=True, slots=True)
class ConfiguredCamera:
    """A camera in the file: its id, its source and substream, if any, without anything that may be secret."""

    id: str
    address: str
    substream: str
    digest: str
    """Tells whether it has changed; of this process."""


def list_cameras(path: Path) -> Sequence[ConfiguredCamera]:
    """Return the cameras in a configuration file.

    Raises:
        UserError: it cannot be read, or has no list of cameras.
    """
    return [
        ConfiguredCamera(
            str(camera.get("id")),
            redact_to_host(str(camera.get("source"))),
            redact_to_host(str(camera.get("substream") or "")),
            _digest(camera),
        )
        for camera in _cameras(path)
    ]


def _digest(camera: _Entry) -> str:
    text = json.dumps(camera, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(), key=_DIGEST_KEY, digest_size=16).hexdigest()


def demands_own_video(path: Path, camera_id: str, digest: str | None = None) -> bool:
    """Return whether a camera of a configuration is only passed through; a new one, without an id, is not.

    Raises:
        UserError: the configuration is invalid, or the camera is not what the digest is of.
    """
    if camera_id:
        _camera_to_change(_cameras(path), camera_id, digest)
    return any(camera.passthrough == "pass" for camera in load_config(path).cameras if camera.id == camera_id)


def add_camera(path: Path, tried: TriedCamera) -> None:
    """Add a camera that was tried, under a free name made from its own.

    No file of a password and no homography of an earlier camera has that name.

    Raises:
        UserError: the camera is there already, or the files would be invalid or cannot be written.
    """
    cameras = _cameras(path)
    if any(camera.get("source") == tried.address.source for camera in cameras):
        raise UserError(f"{tried.address.shown}: this camera is in the configuration already")
    taken = {str(camera.get("id")) for camera in cameras} | _password_files(path)
    ground = read_ground(path)
    if ground is not None:
        taken |= ground.content["homography"].keys()
    camera = tried.as_new(free_name(tried.name, taken))
    text = _checked_text(path, {"cameras": [*cameras, camera_entry(camera, path)]})
    write_passwords([camera], path)
    replace_file(text, path)


def readdress_camera(
    path: Path,
    camera_id: str,
    tried: TriedCamera,
    sizes: Mapping[str, Size] = MappingProxyType({}),
    digest: str | None = None,
) -> str:
    """Change a camera's address and login to those of one that was tried; its other settings stay.

    What is in pixels follows the size of its picture. The password has a new file: the running camera and the
    earlier configuration use the earlier one.

    Args:
        path: the configuration file.
        camera_id: the camera.
        tried: what it becomes.
        sizes: sizes of pictures by source, as far as they are known.
        digest: of the camera that the change is based on; None: it is made whatever it is.

    Returns:
        what has become of settings in pixels, or what must be redone, in a line; empty: nothing.

    Raises:
        UserError: there is no such camera, it is not what the digest is of, another one has this address, or
            the files would be invalid or cannot be written.
    """
    cameras = _cameras(path)
    earlier = _camera_to_change(cameras, camera_id, digest)
    if any(camera.get("source") == tried.address.source for camera in cameras if camera is not earlier):
        raise UserError(f"{tried.address.shown}: another camera of the configuration has this address")
    config = load_config(path)
    streams = SiteProposal(config.site.fps, config.site.width, config.site.height)
    own_video = compare_own_video(tried.trial, streams, config.encode)
    new = tried.as_new(free_name(camera_id, _password_files(path)), own_video)
    entry = camera_entry(new, path)
    # A substream of another channel, or with the earlier login, would be searched for the wrong people.
    is_same_view = str(earlier.get("source")) == tried.address.source
    replaced = {"source", "password", "options"} | (set() if is_same_view else {"substream"})
    other = {key: value for key, value in earlier.items() if key not in replaced}
    ground, zones = read_ground(path), read_content(path).get("zones") or []
    present = CameraPixels(
        {**other, **entry, "id": camera_id}, zones, {} if ground is None else ground.content
    )
    before = sizes.get(config.camera(camera_id).source)
    changed = follow_size(present, before, (tried.trial.width, tried.trial.height))
    lists: dict[str, Sequence[Mapping[str, Any]]] = {
        "cameras": [changed.entry if camera is earlier else camera for camera in cameras]
    }
    lists |= {"zones": changed.zones} if changed.zones != zones else {}
    has_own_parameters = config.encode.parameters == "own"
    text = with_stream_comments(
        _checked_text(path, lists), camera_id, new, has_own_parameters=has_own_parameters
    )
    write_passwords([new], path)
    if ground is None or changed.ground == ground.content:
        replace_file(text, path)
        return changed.note
    kept = replace_file(json.dumps(changed.ground), ground.file)
    try:
        replace_file(text, path)
    except UserError:
        if kept is not None:
            kept.replace(ground.file)
        raise
    return changed.note


def rename_camera(path: Path, camera_id: str, name: str, digest: str | None = None) -> None:
    """Rename a camera; its homography in the ground file is copied to the new name.

    Raises:
        UserError: there is no such camera, it is not what the digest is of, another setting names it, the
            name is invalid or taken, or the files cannot be written.
    """
    check_name(name)
    cameras = _cameras_to_change(path, camera_id, digest)
    if any(str(camera.get("id")) == name for camera in cameras):
        raise UserError(f"another camera is called {name}")
    renamed = [{**camera, "id": name} if str(camera.get("id")) == camera_id else camera for camera in cameras]
    text = _checked_text(path, {"cameras": renamed})
    _copy_homography(path, camera_id, name)  # first: with both names, either configuration is calibrated
    replace_file(text, path)


def remove_camera(path: Path, camera_id: str, digest: str | None = None) -> None:
    """Remove a camera; the file of its password stays, since the earlier configuration names it.

    Raises:
        UserError: there is no such camera, it is not what the digest is of, another setting names it, it is
            the last one, or the file cannot be written.
    """
    cameras = _cameras_to_change(path, camera_id, digest)
    remaining = [camera for camera in cameras if str(camera.get("id")) != camera_id]
    if not remaining:
        raise UserError("a site has at least one camera: add another one first")
    replace_file(_checked_text(path, {"cameras": remaining}), path)


def _cameras(path: Path) -> list[_Entry]:
    cameras = read_content(path).get("cameras")
    if not isinstance(cameras, list) or not all(isinstance(camera, dict) for camera in cameras):
        raise UserError(f"{path}: cameras: is a list of cameras, each with id and source")
    return cameras


def _password_files(path: Path) -> set[str]:
    """Return the names of the cameras' password files, also of earlier cameras."""
    folder = (path.parent / password_file(path, "any")).parent
    return {file.name for file in folder.glob("*")}


def _camera_to_change(cameras: Sequence[_Entry], camera_id: str, digest: str | None) -> _Entry:
    """Return a camera that is to be changed, if it is what the digest is of."""
    camera = next((camera for camera in cameras if str(camera.get("id")) == camera_id), None)
    if camera is None:
        meanwhile = "" if digest is None else ": it was renamed or removed meanwhile"
        raise UserError(f"there is no camera {camera_id!a}{meanwhile}")
    if digest is not None and _digest(camera) != digest:
        raise UserError(f"camera {camera_id} was changed in the configuration meanwhile: look, and try again")
    return camera


def _cameras_to_change(path: Path, camera_id: str, digest: str | None) -> list[_Entry]:
    """Return all cameras; one of them will get another name or none.

    The check of the configuration finds zones and rules that name it, but takes a sound for a file.
    """
    cameras = _cameras(path)
    _camera_to_change(cameras, camera_id, digest)
    sound = read_content(path).get("sound")
    if isinstance(sound, dict) and sound.get("source") == camera_id:
        raise UserError(f"{path}: sound.source is camera {camera_id}: change it first")
    return cameras


def _checked_text(path: Path, lists: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    text = changed_lists_text(path, lists)
    check_text(text, path)
    return text


def _copy_homography(path: Path, camera_id: str, name: str) -> None:
    """Make a new name's homography and marked points in the ground file, if there are, those of a camera."""
    ground = read_ground(path)
    if ground is None:
        return
    changed = {
        key: _copied(ground.content[key], camera_id, name)
        for key in ("homography", "points")
        if isinstance(ground.content.get(key), dict)
    }
    if any(entries != ground.content[key] for key, entries in changed.items()):
        replace_file(json.dumps({**ground.content, **changed}), ground.file)


def _copied(entries: dict[str, Any], camera_id: str, name: str) -> dict[str, Any]:
    copied = {known: entry for known, entry in entries.items() if known != name}
    return {**copied, name: entries[camera_id]} if camera_id in entries else copied
