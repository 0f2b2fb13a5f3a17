"""Stream properties by ffprobe."""

from __future__ import annotations

import subprocess
from pathlib import Path

from fakes.timeouts import PATIENCE


def probed(path: Path | str, entries: str) -> list[list[str]]:
    """Return ffprobe entries of each stream, after decoding all frames; a warning fails the test."""
    done = subprocess.run(
        ["ffprobe", "-v", "warning", "-count_frames", "-show_entries", f"stream={entries}",
         "-of", "csv=p=0", str(path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )  # fmt: skip
    assert done.stderr == ""
    return [line.split(",") for line in dict.fromkeys(done.stdout.split())]
