"""Checks of the disk: whether the recording folder can be written and the recording fits."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.findings import Finding, bad, ok, warning
from server.config.site_config import Config
from server.system.errors import reason_of
from server.system.private_files import mode_if_shared

_INDEX_BYTES = 100
"""Bytes per frame of a camera besides its picture: docs/how-to/record.md."""
_TRY_AGAIN = "try again when it answers; encode.max_kbps, where set, counts as its rate"


def disk_findings(config: Config, probes: Mapping[str, CameraProbe]) -> list[Finding]:
    """Compare the size of the recording with the free space."""
    folder = config.record.folder
    if folder is None:
        return [ok("record", "nothing is recorded")]
    try:
        existing = _nearest_existing(folder)
        with tempfile.TemporaryFile(dir=existing):
            pass  # an unnamed file leaves nothing behind
    except OSError as error:
        text = f"{_place(folder, error)}: cannot write there: {reason_of(error)}"
        return [bad("record.folder", text, "use another folder, or let this user write there")]
    findings = [_writable_finding(folder)]
    return findings + _size_findings(
        config, probes, shutil.disk_usage(existing).free / 1e6, _folder_bytes(folder) / 1e6
    )


def _writable_finding(folder: Path) -> Finding:
    """Report that a folder can be written, and whether other users can list it."""
    text = f"{folder} can be written"
    with suppress(OSError):  # a new folder will be private
        if mode := mode_if_shared(folder):
            text += f", but has mode {mode}: others on this machine may see when it was recorded, not what"
            return warning("record.folder", text, f"chmod 700 {folder}")
    return ok("record.folder", text)


def _size_findings(
    config: Config, probes: Mapping[str, CameraProbe], free: float, recorded: float
) -> list[Finding]:
    record, findings = config.record, []
    unknown = [camera for camera, probe in probes.items() if _kbps(config, camera, probe) is None]
    guessed = [camera for camera, probe in probes.items() if probe.problem and camera not in unknown]
    needed = needed_mb(config, probes)
    hours = _hours(record.keep_s)
    needs = f"{hours} of these cameras take about {needed:.0f} MB"
    if unknown:
        names = ", ".join(unknown)
        needs = f"without {names}, whose rate is not known, {hours} of the cameras take about {needed:.0f} MB"
        if len(unknown) == len(probes):
            needs = f"the size of {hours} of {names} is not known"
    if guessed:
        needs += f", with {', '.join(guessed)} as encode.max_kbps allows"
    if needed > record.max_mb:
        fits = f"{'at most' if unknown else 'about'} {_hours(record.keep_s * record.max_mb / needed)}"
        text = f"{needs}, but record.max_mb is {record.max_mb:.0f}: {fits} are kept"
        findings.append(warning("record.max_mb", text, "raise it, or lower record.keep_s"))
    text = f"{needs}; {free:.0f} MB are free, and {recorded:.0f} MB are recorded already"
    if min(needed, record.max_mb) > free + recorded:
        remedy = "lower record.keep_s or record.max_mb, or use a larger disk"
        findings.append(bad("disk", text, remedy))
    else:
        findings.append(warning("disk", text, _TRY_AGAIN) if unknown else ok("disk", text))
    return findings


def needed_mb(config: Config, probes: Mapping[str, CameraProbe]) -> float:
    """Return the megabytes of `record.keep_s` of the sound and of all cameras with a known bit rate."""
    known = [kbps for camera, probe in probes.items() if (kbps := _kbps(config, camera, probe)) is not None]
    total_kbps = sum(known) + (config.sound.kbps if config.sound.source is not None else 0)
    index = 8 * _INDEX_BYTES * config.site.fps * len(known) / 1000
    return (total_kbps + index) * config.record.keep_s / 8000


def _kbps(config: Config, camera: str, probe: CameraProbe) -> float | None:
    """Return a camera's bit rate: `encode.max_kbps`, or as probed.

    Returns:
        None: the probe failed, and the rate has no limit or the camera may be passed through.
    """
    cap = config.encode.max_kbps
    if probe.problem:
        return cap if config.camera(camera).passthrough == "off" else None
    return probe.kbps if cap is None or probe.passes else cap


def _hours(seconds: float) -> str:
    return f"{seconds / 3600:.1f} hours" if seconds >= 3600 else f"{seconds / 60:.0f} minutes"  # noqa: PLR2004


def _nearest_existing(folder: Path) -> Path:
    """Return a folder, or its nearest existing parent.

    Raises:
        OSError: a parent cannot be accessed.
    """
    for path in (folder.absolute(), *folder.absolute().parents):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()
            return path
    return Path(folder.absolute().anchor)


def _place(folder: Path, error: OSError) -> Path:
    """Return where writing fails: the first inaccessible parent, or the nearest existing folder."""
    if isinstance(error, PermissionError):
        for parent in reversed(folder.absolute().parents):
            if not os.access(parent, os.X_OK):
                return parent
    with suppress(OSError):
        return _nearest_existing(folder)
    return folder


def _folder_bytes(folder: Path) -> int:
    """Return the size of all files in a folder; files removed meanwhile are ignored."""
    total = 0
    for parent, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += Path(parent, name).stat().st_size
    return total
