"""A calibration is taken over into a site's configuration: its ground file, and the line that names it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.config.loader import read_content
from server.setup.site_file import check_text, replace_file
from server.setup.yaml_edit import changed_text
from server.system.errors import UserError


@dataclass(frozen=True, slots=True)
class GroundFile:
    """The file that a configuration names as its ground, and its checked content."""

    file: Path
    content: dict[str, Any]


def read_ground(path: Path) -> GroundFile | None:
    """Return the ground file of a configuration; None: it names none.

    Raises:
        UserError: the configuration or the ground file is invalid.
    """
    named = read_content(path).get("ground")
    if not isinstance(named, str):
        return None
    check_text(path.read_text(encoding="utf-8"), path)
    file = path.parent / named
    return GroundFile(file, json.loads(file.read_text(encoding="utf-8")))


@dataclass(frozen=True, slots=True)
class AppliedGround:
    """The written files.

    Attributes:
        ground: the ground file.
        kept: where the earlier configuration is; None: it named the file already, and is unchanged.
    """

    ground: Path
    kept: Path | None


def apply_ground(path: Path, ground: str) -> AppliedGround:
    """Write the text of a ground file beside a configuration, which then names it; earlier files are kept.

    Raises:
        UserError: the configuration is invalid, a camera has a homography of its own, which would take
            precedence, or the files cannot be written.
    """
    content = read_content(path)
    own = [
        str(camera.get("id"))
        for camera in content.get("cameras") or []
        if isinstance(camera, dict) and camera.get("ground") is not None
    ]
    if own:
        raise UserError(f"{path}: cameras.{own[0]}.ground would take precedence: remove it first")
    named = content.get("ground")
    file = path.with_suffix(".ground.json") if not isinstance(named, str) else path.parent / named
    replace_file(ground, file)
    if isinstance(named, str):
        check_text(path.read_text(encoding="utf-8"), path)
        return AppliedGround(file, None)
    text = changed_text(path, "ground", file.name)
    check_text(text, path)
    return AppliedGround(file, replace_file(text, path))
