"""`site.json`, beside `choices.csv`: properties of a rendering that its evaluation needs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from server.cli.render.video_info import Size
from server.config.duplicate_keys import parse_json
from server.config.site_config import Config
from server.system.errors import UserError, reason_of

SITE_FILE = "site.json"


@dataclass(frozen=True, slots=True)
class RenderedSite:
    """Frame rate, switch cost and picture sizes of a rendering.

    Attributes:
        fps: frames per second.
        switch_cost_s: lambda, in seconds of not seeing the person.
        sizes: each camera's own picture.
    """

    fps: float
    switch_cost_s: float
    sizes: Mapping[str, Size]

    @property
    def switch_cost(self) -> float:
        """Lambda in frames of not seeing the person."""
        return self.switch_cost_s * self.fps


def write_site(folder: Path, config: Config, sizes: Mapping[str, Size]) -> None:
    """Write `site.json`."""
    content = {
        "fps": config.site.fps,
        "gop_s": config.gop / config.site.fps,
        "lookahead_s": config.lookahead / config.site.fps,
        "switch_cost_s": config.view.switch_cost_s,
        "sizes": {camera: list(sizes[camera]) for camera in config.camera_ids},
    }
    (folder / SITE_FILE).write_text(json.dumps(content, indent=1) + "\n", encoding="ascii")


def read_site(path: Path) -> RenderedSite:
    """Read `site.json`.

    Raises:
        UserError: it cannot be read or is invalid.
    """
    try:
        content = parse_json(path.read_text(encoding="ascii"))
        sizes = {str(name): (int(width), int(height)) for name, (width, height) in content["sizes"].items()}
        info = RenderedSite(float(content["fps"]), float(content["switch_cost_s"]), sizes)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason_of(error)}") from error
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise UserError(f"{path}: was not written by `myview render`: {error}") from error
    is_valid = 0 < info.fps < math.inf and 0 <= info.switch_cost_s < math.inf
    if not is_valid or any(side <= 0 for size in sizes.values() for side in size):
        raise UserError(f"{path}: it has an invalid rate, size or cost")
    return info
