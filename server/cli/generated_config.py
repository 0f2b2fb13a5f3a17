"""Generated configurations: for recordings given on the command line, and for the demo."""

from __future__ import annotations

import contextlib
import re
import secrets
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from server.cli.render.video_info import read_video_info
from server.config.loader import build_config
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

_NAME_CHARACTERS = 32
_LOWEST_PORT, _PORT_TRIES = 15_000, 50
_OUTGOING_PORTS = Path("/proc/sys/net/ipv4/ip_local_port_range")

DEMO: dict[str, Any] = {
    "site": {"name": "demo", "fps": 25, "width": 640, "height": 360},
    "cameras": [
        {"id": f"c{number}", "source": f"scene:room?camera={number}&cameras=3&objects=4&seed=1"}
        for number in range(3)
    ],
}
"""The embedded synthetic scene, as in `configs/demo.yaml`."""


def config_for_videos(
    videos: Sequence[Path],
    *,
    base: Mapping[str, Any] | None = None,
    where: str = "myview render",
    folder: Path = Path(),
    ground: Path | None = None,
    detections: Sequence[Path] = (),
) -> Config:
    """Return a configuration for recorded views, each named after its file and played once.

    ``base`` is the content of a configuration file in ``folder``: its settings apply, including those of
    cameras with the same names. Without a section `site`, the size is that of the first view, and the rate
    that of the first view that has one; a folder of images has none.

    Raises:
        UserError: a view cannot be opened or never ends, two have the same name, or the configuration is
            invalid.
    """
    if detections and len(detections) != len(videos):
        raise UserError(
            f"--det: {len(detections)} detection files for {len(videos)} views; give one for each, in order"
        )
    content = dict(base or {})
    known = {str(camera.get("id")): camera for camera in _cameras_of(content, where)}
    for video in videos:
        _check_recorded(video)
    if "site" not in content:
        content["site"] = _site_like(videos)
    cameras = []
    for number, video in enumerate(videos):
        name = camera_name(video)
        source = str(video.absolute())
        camera = {**_recorded_settings(known.get(name, {})), "id": name, "source": source, "at_end": "stop"}
        if detections:
            camera["detections"] = str(detections[number].absolute())
        cameras.append(camera)
    content["cameras"] = cameras
    if ground is not None:
        content["ground"] = str(ground.absolute())
    return build_config(content, where=where, folder=folder)


def _recorded_settings(camera: Mapping[str, Any]) -> dict[str, Any]:
    """Return a camera's settings without those of its network: a login, and a live substream."""
    dropped = {"password"}
    substream = camera.get("substream")
    if isinstance(substream, str) and source_kind(substream) is SourceKind.STREAM:
        dropped.add("substream")
    return {key: value for key, value in camera.items() if key not in dropped}


def camera_name(video: Path) -> str:
    """Return the name of a view: that of its file, with dashes for invalid characters."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", video.stem).lstrip("-_")[:_NAME_CHARACTERS] or "view"


def _check_recorded(video: Path) -> None:
    if source_kind(str(video)) not in {SourceKind.FILE, SourceKind.FOLDER}:
        raise UserError(f"{redact_to_host(str(video))}: is not a recorded video or a folder of images")
    if not video.exists():
        raise UserError(f"{redact_to_host(str(video))}: no such file or folder")


def _cameras_of(content: Mapping[str, Any], where: str) -> list[dict[str, Any]]:
    cameras = content.get("cameras") or []
    if not isinstance(cameras, list) or not all(isinstance(camera, dict) for camera in cameras):
        raise UserError(f"{where}: cameras: is a list of cameras, each with id and source")
    return cameras


def _site_like(videos: Sequence[Path]) -> dict[str, Any]:
    """Return the section `site` with rate and size of the views; odd sizes are rounded down for H.264."""
    first = read_video_info(videos[0])
    width, height = first.size
    rates = (
        (first.fps, *(read_video_info(video).fps for video in videos[1:]))
        if first.fps is None
        else (first.fps,)
    )
    rate = next((fps for fps in rates if fps is not None), None)
    site = {} if rate is None else {"fps": rate}
    return {**site, "width": width - width % 2, "height": height - height % 2}


def demo_config(folder: Path, port: int, fps: float) -> tuple[Path, Config]:
    """Write the demo's configuration into a folder, with free ports; the environment takes precedence."""
    sync, bus = free_port(), free_port()
    content = {
        **DEMO,
        "site": {**DEMO["site"], "fps": fps},
        "sync": {"port": sync},
        "zenoh": {"connect": f"tcp/127.0.0.1:{bus}", "listen": f"tcp/127.0.0.1:{bus}"},
        "http": {"port": port},
    }
    path = folder / "demo.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path, build_config(content, where="demo", folder=folder)


def free_port(preferred: int = 0) -> int:
    """Return the preferred port if it is free, otherwise any free port.

    The process that listens there starts later. So the port is none that the system could give to another
    process's connection meanwhile, if there is such a port.
    """
    usual = _listening_ports()
    others = [secrets.choice(usual) for _ in range(_PORT_TRIES)] if usual else []
    for port in [*([preferred] if preferred else []), *others]:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return port
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _listening_ports() -> range:
    """Return the ports below those of outgoing connections (ip(7)); Linux's usual ones on other systems."""
    try:
        lowest = int(_OUTGOING_PORTS.read_text(encoding="ascii").split()[0])
    except (OSError, ValueError, IndexError):
        lowest = 32768
    return range(_LOWEST_PORT, lowest)
