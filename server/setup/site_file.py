"""The configuration file of a site that was set up: commented YAML; passwords in files of their own."""

from __future__ import annotations

import datetime as dt
import os
import re
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from server.config.loader import build_config
from server.config.site_config import Config
from server.config.yaml_file import dump_yaml_inline
from server.setup.camera_address import CameraAddress
from server.setup.own_video import NOT_COMPARED, OwnVideo, passthrough_lines, with_passthrough_lines
from server.setup.proposal import SiteProposal
from server.setup.yaml_edit import changed_entry_text
from server.system.atomic_write import atomic_file
from server.system.errors import UserError, reason_of
from server.system.private_files import FILE, make_private_folder, write_private

_HEAD = """\
# {name}: written by MyView's set-up on {day}. Start it with
#
#   myview up {file}
#
# Every setting, with its default, is explained in configs/demo.yaml.

site:
  name: {name}
  fps: {fps:g}  # a slower camera repeats pictures, a faster one skips some
  width: {width}  # every camera's picture is fitted into this size
  height: {height}

cameras:
"""
_OWN_PARAMETERS = """
{off}encode:
  {off}parameters: own  # cameras of any make pass through; where Apple's players fail, encode all: equal
"""
_TRACKED = "people are tracked in it"
_SENDS = r"\S+ \d+x\d+(?:, \S+ fps)?"
"""What a stream sends, in the words of set-up."""
_FILE_LINE = "    password: {file}  # replaces {{password}}; only you can read this file\n"


@dataclass(frozen=True, slots=True)
class NewCamera:
    """A camera to write: its id, its address, and what it sends, for comments; the same of its substream."""

    id: str
    address: CameraAddress
    sends: str = ""
    substream: str | None = None
    substream_sends: str = ""
    own_video: OwnVideo = NOT_COMPARED


@dataclass(frozen=True, slots=True)
class NewSite:
    """A site to write."""

    name: str
    proposal: SiteProposal
    cameras: Sequence[NewCamera]


def site_text(site: NewSite, path: Path) -> str:
    """Return the text of a configuration file that will be at a path."""
    head = _HEAD.format(
        name=site.name,
        day=dt.date.today().isoformat(),  # noqa: DTZ011 — the user's day
        file=path.name,
        fps=site.proposal.fps,
        width=site.proposal.width,
        height=site.proposal.height,
    )
    text = head + "".join(_camera_text(camera, path) for camera in site.cameras)
    own_videos = [camera.own_video for camera in site.cameras]
    if any(own_video.fits for own_video in own_videos):
        return text + _OWN_PARAMETERS.format(off="")
    return text + (_OWN_PARAMETERS.format(off="#") if any(each.wanted for each in own_videos) else "")


def write_site(site: NewSite, path: Path) -> Path | None:
    """Write a site's configuration and passwords; an earlier file is kept.

    Returns:
        where the earlier file is now; None: there was none.

    Raises:
        UserError: something is invalid, or the files cannot be written.
    """
    text = site_text(site, path)
    check_text(text, path)
    write_passwords(site.cameras, path)
    return replace_file(text, path)


def check_text(text: str, path: Path) -> Config:
    """Check a configuration before it is written.

    Raises:
        UserError: it is invalid.
    """
    return build_config(yaml.safe_load(text), where=str(path), folder=path.parent)


def replace_file(text: str, path: Path) -> Path | None:
    """Write a file; return where the earlier one, whose mode it gets, is kept. A new one is private.

    Raises:
        UserError: it cannot be written.
    """
    kept, mode = None, FILE
    with atomic_file(path) as draft:
        draft.write_text(text, encoding="utf-8")
        if path.exists():
            kept, mode = _free_path(path), stat.S_IMODE(path.stat().st_mode)
            os.link(path, kept)  # so that at no moment there is no file
    path.chmod(mode)
    return kept


def password_file(path: Path, camera: str) -> Path:
    """Return the file of a camera's password, relative to the folder of the configuration at ``path``."""
    return Path(f"{path.stem}.passwords") / camera


def _camera_text(camera: NewCamera, path: Path) -> str:
    address = camera.address
    lines = f"  - id: {camera.id}\n    source: {_scalar(address.source)}"
    lines += f"  # {camera.sends}\n" if camera.sends else "\n"
    if camera.substream is not None:
        tracked = f", {camera.substream_sends}" if camera.substream_sends else ""
        lines += f"    substream: {_scalar(camera.substream)}  # {_TRACKED}{tracked}\n"
    if address.password is not None:
        lines += _FILE_LINE.format(file=_scalar(str(password_file(path, camera.id))))
    if address.options:
        lines += f"    options: {dump_yaml_inline(address.options)}\n"
    return lines + passthrough_lines(camera.own_video, is_set=camera.own_video.fits)


def with_stream_comments(text: str, camera_id: str, new: NewCamera, *, has_own_parameters: bool) -> str:
    """Return a text in which what set-up has written about the streams of a camera is true of new ones.

    Other comments stay. ``has_own_parameters``: whether each camera may have parameter sets of its own.
    """

    def change(lines: str) -> str:
        lines = re.sub(rf"(?m)^(.*\bsource: .* # ){_SENDS}$", lambda match: f"{match[1]}{new.sends}", lines)
        if new.substream is not None and new.substream_sends:
            lines = re.sub(
                rf"(?m)^( *substream: .* # {_TRACKED}, ){_SENDS}$",
                lambda match: f"{match[1]}{new.substream_sends}",
                lines,
            )
        return with_passthrough_lines(lines, new.own_video, has_own_parameters=has_own_parameters)

    return changed_entry_text(text, "cameras", camera_id, change)


def _scalar(text: str) -> str:
    """Return a text as YAML; quoted only where it must be."""
    return dump_yaml_inline(text)


def camera_entry(camera: NewCamera, path: Path) -> dict[str, Any]:
    """Return a camera as an entry of a configuration at a path."""
    entry: dict[str, Any] = {"id": camera.id, "source": camera.address.source}
    if camera.substream is not None:
        entry["substream"] = camera.substream
    if camera.address.password is not None:
        entry["password"] = str(password_file(path, camera.id))
    return {**entry, "options": dict(camera.address.options)} if camera.address.options else entry


def write_passwords(cameras: Sequence[NewCamera], path: Path) -> None:
    """Write the cameras' passwords into files beside a configuration at a path.

    Raises:
        UserError: they cannot be written.
    """
    secret = {camera.id: camera.address.password for camera in cameras if camera.address.password is not None}
    if not secret:
        return
    try:
        for camera, password in secret.items():
            file = path.parent / password_file(path, camera)
            make_private_folder(file.parent)
            write_private(file, f"{password}\n".encode())
            file.chmod(FILE)
    except OSError as error:
        raise UserError(f"{path}: cannot write the passwords beside it: {reason_of(error)}") from error


def _free_path(path: Path) -> Path:
    """Return a free path for the earlier file, with the time in its name."""
    now = dt.datetime.now().strftime("%Y%m%d-%H%M%S")  # noqa: DTZ005 — the user's clock
    names = (f"{path.stem}.{now}{more}{path.suffix}" for more in ("", *(f"-{n}" for n in range(2, 1000))))
    return next(free for name in names if not (free := path.with_name(name)).exists())
