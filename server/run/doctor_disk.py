"""Whether the disk takes what is to be recorded."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from server.run.doctor_findings import Finding, bad, ok, warning
from server.run.doctor_probe import Probe
from server.wire.config import Config

_INDEX_BYTES = 100
"""A frame of a camera, beside its picture: docs/operating.md, "Recording"."""


def disk_findings(config: Config, probes: Mapping[str, Probe]) -> list[Finding]:
    """Compare what `record` will take with what is free."""
    record = config.record
    if record.folder is None:
        return [ok("record", "nothing is recorded")]
    there = next(it for it in (record.folder, *record.folder.absolute().parents) if it.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            pass  # it has no name, so that nothing is left whatever happens
    except OSError as error:
        return [
            bad("record.folder", f"{there}: cannot write there: {error.strerror}", "another folder, or chown")
        ]
    found = [ok("record.folder", f"{record.folder} can be written")]
    wanted = needed_mb(config, probes)
    held = _held_bytes(record.folder) / 1e6
    free = shutil.disk_usage(there).free / 1e6
    kept = f"{_hours(record.keep_s)} of these cameras take about {wanted:.0f} MB"
    if wanted > record.most_mb:
        fits = _hours(record.keep_s * record.most_mb / wanted)
        text = f"{kept}, but record.most_mb is {record.most_mb:.0f}: about {fits} are kept"
        found.append(warning("record.most_mb", text, "raise it, or lower record.keep_s"))
    takes = min(wanted, record.most_mb)
    text = f"{kept}; {free:.0f} MB are free, and {held:.0f} MB are recorded already"
    found.append(
        ok("disk", text)
        if takes <= free + held
        else bad("disk", text, "lower record.keep_s or record.most_mb, or take a larger disk")
    )
    return found


def needed_mb(config: Config, probes: Mapping[str, Probe]) -> float:
    """Give the megabytes that `record.keep_s` of all cameras and the sound take.

    A camera takes what `encode.max_kbps` lets it take at most, or else what it took when it was tried.
    """
    cap = config.encode.max_kbps
    kbps = sum(it.kbps if cap is None else cap for it in probes.values())
    kbps += config.sound.kbps if config.sound.source is not None else 0
    index = 8 * _INDEX_BYTES * config.site.fps * len(probes) / 1000
    return (kbps + index) * config.record.keep_s / 8000


def _hours(seconds: float) -> str:
    return f"{seconds / 3600:.1f} hours" if seconds >= 3600 else f"{seconds / 60:.0f} minutes"  # noqa: PLR2004


def _held_bytes(folder: Path) -> int:
    """Add up all files in a folder, but those that a running site removes meanwhile."""
    held = 0
    for inside, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                held += Path(inside, name).stat().st_size
    return held
