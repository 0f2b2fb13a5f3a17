"""Configurations for `myview doctor` to check."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from fakes.service.scripted_cameras import HEIGHT, WIDTH
from fakes.system.ports import free_port
from server.config.loader import load_config
from server.config.site_config import Config

SIZE = {"width": WIDTH, "height": HEIGHT}


def write_site(folder: Path, **changes: Any) -> Path:
    content = {
        "site": {"name": "hall", **SIZE},
        "cameras": [{"id": "c0", "source": "c0.mp4"}],
        **{section: {"port": free_port()} for section in ("sync", "http")},
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{free_port()}"),
        **changes,
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def load_site(folder: Path, **changes: Any) -> Config:
    return load_config(write_site(folder, **changes))
