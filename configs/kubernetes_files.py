"""A site's configuration and secret files, as `configs/kubernetes.py` puts them into containers.

The configuration gets the addresses and paths of containers. Each process gets only the secret files that it
needs, from a Secret of its own.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from server.config.loader import build_config, read_content
from server.config.password_file import read_users
from server.config.pulse_access import bestview_client_name
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, is_device_path, source_kind
from server.models.catalog import find_model
from server.system.errors import UserError

Content = dict[str, Any]
Place = tuple[str, ...]

CONFIG_FOLDER, SECRETS_FOLDER, FILES_FOLDER = "/site/configs", "/site/secrets", "/site/files"
RECORDINGS_FOLDER = "/site/recordings"
HTTP_PORT, SYNC_PORT, BUS_PORT, RTSP_PORT = 8080, 7400, 7447, 8554
HEALTH_TOKEN = "health.token"  # noqa: S105 — a file's name
_EVERY_ADDRESS = "0.0.0.0"  # noqa: S104 — of a container; the NetworkPolicy says who reaches it
_START_TIMEOUT_S = 40.0
"""Containers start one after the other."""
_URL = re.compile(r"https?://([a-z0-9]([a-z0-9-]*[a-z0-9])?\.?)+(:[0-9]{1,5})?/?")

_USED_BY: dict[Place, tuple[str, ...]] = {
    ("access", "tokens"): ("bestview",),
    ("http", "tls", "certificate"): ("bestview", "camera", "rtsp"),
    ("http", "tls", "key"): ("bestview",),
    ("sync", "users"): ("sync", "bestview", "camera"),
    ("sync", "tls", "authority"): ("sync", "bestview", "camera"),
    ("sync", "tls", "certificate"): ("sync",),
    ("sync", "tls", "key"): ("sync",),
    ("zenoh", "users"): ("bestview", "camera"),
    ("zenoh", "tls", "authority"): ("bestview", "camera"),
    ("zenoh", "tls", "certificate"): ("bestview",),
    ("zenoh", "tls", "key"): ("bestview",),
    ("mqtt", "password"): ("bestview",),
    ("mqtt", "authority"): ("bestview",),
    ("rtsp", "tls", "certificate"): ("rtsp",),
    ("rtsp", "tls", "key"): ("rtsp",),
    ("rtsp", "certificate"): ("rtsp",),
}
"""Secret files: the settings that name them, and the processes that read them."""


@dataclass(frozen=True)
class ContainerSite:
    """A site as its containers see it."""

    config: Config
    """As the file says, with the paths of this machine."""
    content: Content
    """The configuration of the containers."""
    texts: dict[str, str]
    """Other files beside it, by name."""
    services: int
    """Best-view services."""
    is_private: bool
    """Whether the configuration may contain secrets: addresses of cameras and webhooks, FFmpeg's options."""
    needs_files: bool
    """Whether cameras read recordings or networks from `FILES_FOLDER`."""
    secret_files: dict[Place, Path] = field(default_factory=dict)
    """By setting."""

    @property
    def scheme(self) -> str:
        """The scheme of the best view's addresses."""
        return _http_scheme(self.config)

    @property
    def addresses(self) -> list[str]:
        """Addresses of the best-view services in the cluster."""
        return [f"{self.scheme}://{host}:{HTTP_PORT}" for host in service_hosts(self.services)]

    @property
    def is_open(self) -> bool:
        """Whether viewers from outside the namespace are let in, by tokens or deliberately."""
        return self.config.access.tokens is not None or self.config.access.open_to_all

    def secret_names(self, process: str, camera_id: str = "") -> list[str]:
        """Return the names of the secret files of a process: `sync`, `bestview`, `camera` or `rtsp`."""
        names = [*self._files_of(process)]
        if process == "camera":
            names += ["camera.password"] if self.config.camera(camera_id).password else []
            names += [HEALTH_TOKEN] if self.config.access.tokens else []
        return names

    def secret_values(self, process: str, camera_id: str = "") -> dict[str, bytes]:
        """Read the secret files of a process; of users it gets the lines that it needs.

        Raises:
            UserError: a file cannot be read, or there is no token for the cameras' probes.
        """
        paths = self._files_of(process)
        values = {
            name: _read(path) for name, path in paths.items() if name not in {"sync.users", "zenoh.users"}
        }
        all_lines = {"sync.users": "sync", "zenoh.users": "bestview"}
        own = [camera_id] if process == "camera" else [*map(bestview_client_name, range(self.services))]
        for name, server in all_lines.items():
            if name in paths:
                users = read_users(paths[name], name)
                kept = users if process == server else [user for user in own if user in users]
                values[name] = "".join(f"{user}:{users[user]}\n" for user in kept).encode()
        if process == "camera" and (password := self.config.camera(camera_id).password):
            values["camera.password"] = _read(password)
        if process == "camera" and self.config.access.tokens:
            if not (token := os.environ.get("MYVIEW_TOKEN")):
                raise UserError(
                    "access.tokens: set MYVIEW_TOKEN to a token to watch, for the cameras' probes"
                )
            values[HEALTH_TOKEN] = token.encode()
        return values

    def _files_of(self, process: str) -> dict[str, Path]:
        """Return the secret files of a process that its settings name, by their names in containers."""
        return {
            _file_name(place): path
            for place, path in self.secret_files.items()
            if process in _processes_of(place)
        }


def service_hosts(services: int) -> list[str]:
    """Return the host names of the best-view services, by index."""
    return [f"bestview-{index}.bestview" for index in range(services)]


def read_site(path: Path, urls: list[str], services: int | None) -> ContainerSite:
    """Read a site's configuration, and change it for containers.

    Raises:
        UserError: it is wrong, or cannot run in a cluster.
    """
    for url in urls:
        if not _URL.fullmatch(url):
            raise UserError(f"--url {url}: is not an address such as https://cameras.example, without a path")
    content = _copied(read_content(path))
    config = build_config(content, where=str(path), folder=path.parent)
    count = config.view.sharding.services if services is None else services
    secret_files: dict[Place, Path] = {}
    for place in _USED_BY:
        _move_secret(content, place, path.parent, secret_files)
    for number, webhook in enumerate(content.get("webhooks", [])):
        _move_secret(webhook, ("secret",), path.parent, secret_files, ("webhooks", str(number)))
    for name, link in config.sites.link.items():
        for key in link.model_fields_set & {"users", "authority"}:
            section = content["sites"]["link"][name]
            _move_secret(section, (key,), path.parent, secret_files, ("sites", "link", name))
    texts = _move_ground(content, path.parent)
    moved = _move_files(content, config, path.parent)
    is_private = bool(config.webhooks) or any(camera.options for camera in config.cameras)
    is_private |= any(_is_address(source) for source in _sources(config))
    _set_addresses(content, config, count, urls)
    site = ContainerSite(config, content, texts, count, is_private, moved, secret_files)
    sharding = build_config({**content, "ground": None}, where=str(path), folder=path.parent).view.sharding
    if sharding.services != count or len(urls) not in {0, 1, count} or (sharding.of > 1 and len(urls) == 1):
        raise UserError(
            f"{count} best-view services, view.sharding.of {sharding.of}, {len(urls)} --url: there must be a "
            "multiple of the shards, and an address for each service, or, without shards, one for all"
        )
    if config.sites.link and not site.is_open:
        raise UserError(
            "sites.link: in a cluster a site without tokens is open to all, and would tell viewers of other "
            "sites who is there: set access.tokens to a file of tokens, or access.open_to_all: true"
        )
    if urls and not site.is_open:
        raise UserError(
            "--url lets others watch: set access.tokens to a file of tokens, or access.open_to_all: true"
        )
    return site


def _http_scheme(config: Config) -> str:
    return "https" if config.http.tls.key else "http"


def _set_addresses(content: Content, config: Config, services: int, urls: list[str]) -> None:
    """Set where processes listen and find each other."""
    sync = content.setdefault("sync", {})
    sync |= {"host": "sync", "bind": _EVERY_ADDRESS, "port": SYNC_PORT}
    sync.setdefault("start_timeout_s", _START_TIMEOUT_S)
    protocol = "tls" if config.zenoh.listen.startswith("tls/") else "tcp"
    routers = [f"{protocol}/{host}:{BUS_PORT}" for host in service_hosts(services)]
    listen = f"{protocol}/{_EVERY_ADDRESS}:{BUS_PORT}"
    content.setdefault("zenoh", {}).update({"connect": routers, "listen": listen})
    content.setdefault("http", {}).update({"host": _EVERY_ADDRESS, "port": HTTP_PORT})
    scheme = _http_scheme(config)
    sharding = content.setdefault("view", {}).setdefault("sharding", {})
    sharding["index"] = 0  # each service has its own, from the environment
    inside = [f"{scheme}://{host}:{HTTP_PORT}/" for host in service_hosts(services)]
    if len(urls) == 1:
        content["http"].setdefault("public_url", urls[0])
    sharding["servers"] = [] if services == 1 else urls * services if len(urls) == 1 else urls or inside
    access = content.setdefault("access", {})
    if config.access.tokens is None:
        access["open_to_all"] = True
    if not (config.sync.users and config.sync.tls.key and config.zenoh.users and protocol == "tls"):
        access["trusted_network"] = True
    if config.rtsp.enabled:
        listener = {"host": _EVERY_ADDRESS, "port": RTSP_PORT, "udp": False}
        content["rtsp"] |= {**listener, "service": f"{scheme}://myview:{HTTP_PORT}"}
    if config.record.folder is not None:
        content["record"]["folder"] = RECORDINGS_FOLDER


def _move_secret(
    content: Content, place: Place, folder: Path, moved: dict[Place, Path], outer: Place = ()
) -> None:
    """Replace a secret file's path by that in containers, if the setting is there."""
    for key in place[:-1]:
        content = content.get(key) or {}
    if content.get(place[-1]) is not None:
        moved[*outer, *place] = folder / str(content[place[-1]])
        content[place[-1]] = f"{SECRETS_FOLDER}/{_file_name((*outer, *place))}"


def _move_ground(content: Content, folder: Path) -> dict[str, str]:
    if content.get("ground") is None:
        return {}
    text = (folder / str(content["ground"])).read_text(encoding="utf-8")
    content["ground"] = "ground.json"
    return {"ground.json": text}


def _is_moved(camera: CameraSettings, key: str) -> bool:
    """Return whether a camera's source or substream is a recording.

    Raises:
        UserError: it is a device.
    """
    source = getattr(camera, key)
    if source is not None and is_device_path(source):
        raise UserError(
            f"cameras.{camera.id}: {source} is a device of one machine, which a cluster does not "
            "give to containers: connect it by RTSP"
        )
    return source is not None and _is_file(source)


def _move_files(content: Content, config: Config, folder: Path) -> bool:
    """Replace the paths of recordings, detections and networks; return whether there are any."""
    found: list[tuple[Content, str]] = []
    for raw, camera in zip(content["cameras"], config.cameras, strict=True):
        found += [(raw, key) for key in ("source", "substream") if _is_moved(camera, key)]
        if camera.detections:
            found.append((raw, "detections"))
        if camera.password:
            raw["password"] = f"{SECRETS_FOLDER}/camera.password"
    sound = config.sound.source
    if sound is not None and sound not in config.camera_ids and _is_file(sound):
        found.append((content["sound"], "source"))
    onnx = content.get("detect", {}).get("onnx") or {}
    if onnx.get("model") is not None and find_model(str(onnx["model"])) is None:
        found.append((onnx, "model"))
    if found:
        paths = [folder.absolute() / str(section[key]) for section, key in found]
        root = os.path.commonpath([os.path.normpath(path.parent) for path in paths])
        for (section, key), path in zip(found, paths, strict=True):
            section[key] = f"{FILES_FOLDER}/{os.path.relpath(path, root)}"
    return bool(found)


def _sources(config: Config) -> list[str]:
    sound = config.sound.source
    own = [source for camera in config.cameras for source in (camera.source, camera.substream) if source]
    return own if sound in {None, *config.camera_ids} else [*own, str(sound)]


def _is_file(source: str) -> bool:
    """Return whether a resolved source is a path, whatever is there."""
    return Path(source).is_absolute() and source_kind(source) in {SourceKind.FILE, SourceKind.FOLDER}


def _is_address(source: str) -> bool:
    return source_kind(source) is not SourceKind.SCENE and not _is_file(source)


def _processes_of(place: Place) -> tuple[str, ...]:
    return _USED_BY.get(place, ("bestview",))  # the secrets of webhooks


def _file_name(place: Place) -> str:
    return ".".join(place)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}") from error


def _copied(value: Any) -> Any:
    """Copy nested values, so that those that YAML's aliases share can be changed alone."""
    if isinstance(value, dict):
        return {key: _copied(inner) for key, inner in value.items()}
    return [_copied(inner) for inner in value] if isinstance(value, list) else value
