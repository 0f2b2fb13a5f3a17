"""The site's name, frame rate and picture size in a configuration file; a restart brings them into force."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType

from server.config.loader import check_section, load_config, read_content
from server.config.sections import SiteSettings
from server.setup.own_video import unknown_own_video, with_passthrough_lines
from server.setup.proposal import SiteProposal
from server.setup.site_file import check_text, replace_file
from server.setup.site_pixels import Size, moved_settings
from server.setup.yaml_edit import changed_values_text
from server.system.errors import UserError

_CHANGED = "the site's settings were changed in the configuration meanwhile: look, and change them again"


@dataclass(frozen=True, slots=True)
class StreamFormatChoice:
    """What set-up asks for besides the cameras: the site's name, and the rate and size of its streams."""

    name: str
    fps: float
    width: int
    height: int

    @property
    def digest(self) -> str:
        """Tells whether they have changed."""
        return hashlib.sha256(json.dumps(asdict(self)).encode()).hexdigest()


def read_choice(path: Path) -> StreamFormatChoice:
    """Return the settings in a configuration file.

    Raises:
        UserError: it is invalid.
    """
    site = load_config(path).site
    return StreamFormatChoice(site.name, site.fps, site.width, site.height)


def save_choice(
    path: Path,
    choice: StreamFormatChoice,
    digest: str | None = None,
    pictures: Mapping[str, Size] = MappingProxyType({}),
) -> None:
    """Change the settings in a configuration file, and those that follow the size; the earlier file is kept.

    Args:
        path: the file.
        choice: the new settings.
        digest: of the settings that the change is based on; None: it is made whatever they are.
        pictures: sizes of the cameras' own pictures by camera, as far as they are known.

    Raises:
        UserError: the settings have changed meanwhile, the file or what it would become is invalid, a
            camera's own video would no longer fit, what is in pixels cannot follow, or it cannot be written.
    """
    present = read_choice(path)
    if digest is not None and present.digest != digest:
        raise UserError(_CHANGED)
    before = asdict(present)
    changed = {key: value for key, value in asdict(choice).items() if value != before[key]}
    if not changed:
        return
    config, content = load_config(path), read_content(path)
    passed = [camera.id for camera in config.cameras if camera.passthrough == "pass"]
    if passed and changed.keys() != {"name"}:
        raise UserError(
            f"camera {passed[0]}: passthrough: pass: its own video has the site's present rate and size; "
            "set passthrough: auto first"
        )
    if "fps" in changed and choice.fps.is_integer():
        changed["fps"] = int(choice.fps)
    check_section(SiteSettings, {**(content.get("site") or {}), **changed}, "site")
    size = choice.width, choice.height
    moved = moved_settings(config, content, size, pictures) if size != config.site.size else {}
    text = changed_values_text(path, {"site": changed, **moved})
    if changed.keys() != {"name"}:
        streams = SiteProposal(choice.fps, choice.width, choice.height)
        own_video = unknown_own_video(streams, config.encode)
        text = with_passthrough_lines(text, own_video, has_own_parameters=config.encode.parameters == "own")
    check_text(text, path)
    replace_file(text, path)
