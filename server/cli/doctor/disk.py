"""Checks of the disk: can the recording folder be written, and does the recording fit."""

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
from server.system.private_files import rights_of_others

_INDEX_BYTES = 100
"""A frame of a camera, beside its picture: docs/how-to/record.md."""
_TRY_AGAIN = "try again when it answers; encode.max_kbps, where set, counts as its rate"


def disk_findings(config: Config, probes: Mapping[str, CameraProbe]) -> list[Finding]:
    """Compare what `record` will take with what is free."""
    folder = config.record.folder
    if folder is None:
        return [ok("record", "nothing is recorded")]
    try:
        there = _nearest_existing(folder)
        with tempfile.TemporaryFile(dir=there):
            pass  # it has no name, so nothing can be left behind
    except OSError as error:
        text = f"{_place(folder, error)}: cannot write there: {error.strerror}"
        return [bad("record.folder", text, "use another folder, or let this user write there")]
    findings = [_writable_finding(folder)]
    return findings + _size_findings(
        config, probes, shutil.disk_usage(there).free / 1e6, _folder_bytes(folder) / 1e6
    )


def _writable_finding(folder: Path) -> Finding:
    """Report that a folder can be written, and whether other users can list it."""
    text = f"{folder} can be written"
    with suppress(OSError):  # it does not exist yet, and will be private
        if mode := rights_of_others(folder):
            text += f", but has mode {mode}: others on this machine may see when it was recorded, not what"
            return warning("record.folder", text, f"chmod 700 {folder}")
    return ok("record.folder", text)


def _size_findings(
    config: Config, probes: Mapping[str, CameraProbe], free: float, recorded: float
) -> list[Finding]:
    record, findings = config.record, []
    unknown = [camera for camera, it in probes.items() if _kbps(config, camera, it) is None]
    guessed = [camera for camera, it in probes.items() if it.problem and camera not in unknown]
    needed = needed_mb(config, probes)
    hours = _hours(record.keep_s)
    needs = f"{hours} of these cameras take about {needed:.0f} MB"
    if unknown:
        who = ", ".join(unknown)
        needs = f"without {who}, whose rate is not known, {hours} of the cameras take about {needed:.0f} MB"
        if len(unknown) == len(probes):
            needs = f"what {hours} of {who} take is not known"
    if guessed:
        needs += f", with {', '.join(guessed)} as encode.max_kbps allows"
    if needed > record.max_mb:
        fits = f"{'at most' if unknown else 'about'} {_hours(record.keep_s * record.max_mb / needed)}"
        text = f"{needs}, but record.max_mb is {record.max_mb:.0f}: {fits} are kept"
        findings.append(warning("record.max_mb", text, "raise it, or lower record.keep_s"))
    text = f"{needs}; {free:.0f} MB are free, and {recorded:.0f} MB are recorded already"
    if min(needed, record.max_mb) > free + recorded:
        do = "lower record.keep_s or record.max_mb, or use a larger disk"
        findings.append(bad("disk", text, do))
    else:
        findings.append(warning("disk", text, _TRY_AGAIN) if unknown else ok("disk", text))
    return findings


def needed_mb(config: Config, probes: Mapping[str, CameraProbe]) -> float:
    """Return the megabytes that `record.keep_s` of the sound and of all cameras take whose rate is known."""
    known = [it for camera, probe in probes.items() if (it := _kbps(config, camera, probe)) is not None]
    kbps = sum(known) + (config.sound.kbps if config.sound.source is not None else 0)
    index = 8 * _INDEX_BYTES * config.site.fps * len(known) / 1000
    return (kbps + index) * config.record.keep_s / 8000


def _kbps(config: Config, camera: str, probe: CameraProbe) -> float | None:
    """Return a camera's bit rate: `encode.max_kbps`, or else as probed.

    None: it was not probed, and passes its own H.264 through.
    """
    cap = config.encode.max_kbps
    if probe.problem:
        return cap if config.camera(camera).h264 == "encode" else None
    return probe.kbps if cap is None or probe.passes else cap


def _hours(seconds: float) -> str:
    return f"{seconds / 3600:.1f} hours" if seconds >= 3600 else f"{seconds / 60:.0f} minutes"  # noqa: PLR2004


def _nearest_existing(folder: Path) -> Path:
    """Return a folder, or its nearest existing parent.

    Raises:
        OSError: a folder on the way cannot be read.
    """
    for it in (folder.absolute(), *folder.absolute().parents):
        with suppress(FileNotFoundError, NotADirectoryError):
            it.lstat()  # `exists()` ends with an error, too, where one on the way cannot be entered
            return it
    return Path(folder.absolute().anchor)


def _place(folder: Path, error: OSError) -> Path:
    """Return where writing fails: the first parent without access, else the nearest existing folder."""
    if isinstance(error, PermissionError):
        for it in reversed(folder.absolute().parents):
            if not os.access(it, os.X_OK):
                return it
    with suppress(OSError):
        return _nearest_existing(folder)
    return folder


def _folder_bytes(folder: Path) -> int:
    """Return the size of all files in a folder; ignore those that a running site removes meanwhile."""
    total = 0
    for inside, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += Path(inside, name).stat().st_size
    return total
