"""The virtual environment of the other trackers, installed by pip."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tracking.motchallenge import MotRow, format_rows, read_rows

PACKAGES = ("trackers==2.6.1", "supervision==0.31.2", "motile==1.0.1", "ilpy==0.6.0")
"""Pinned versions, since their scores are quoted."""

_RUNNER = Path(__file__).with_name("runner.py")
_INSTALL_S = 900.0
_RUN_S = 600.0


@dataclass(frozen=True, slots=True)
class OtherTracker:
    """A tracker to compare with."""

    name: str
    runs: str
    """Its name in the runner."""


PEERS = (
    OtherTracker("C-BIoU", "CBIoUTracker"),
    OtherTracker("OC-SORT", "OCSORTTracker"),
    OtherTracker("ByteTrack", "ByteTrackTracker"),
    OtherTracker("SORT", "SORTTracker"),
    OtherTracker("motile", "motile"),
)


class OtherTrackersUnavailableError(Exception):
    """The other trackers cannot be installed or run; the text says why in one line."""


@dataclass(frozen=True, slots=True)
class OtherTrackerEnvironment:
    """An environment in which the other trackers are installed."""

    python: Path

    def track(self, peer: OtherTracker, detections: Path) -> list[MotRow]:
        """Return another tracker's tracks.

        Raises:
            OtherTrackersUnavailableError: the tracker failed.
        """
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "tracks.txt"
            self._run("track", peer.runs, str(detections), str(out))
            return read_rows(out)

    def score(self, truth: list[MotRow], tracks: list[MotRow]) -> dict[str, float]:
        """Return HOTA, MOTA, IDF1 and switches by the TrackEval port.

        Raises:
            OtherTrackersUnavailableError: the evaluation failed.
        """
        with tempfile.TemporaryDirectory() as folder:
            there, found = Path(folder) / "truth.txt", Path(folder) / "tracks.txt"
            # It counts only class 1, pedestrians, which not every file sets.
            there.write_text(format_rows(truth).replace("-1,-1,-1\n", "1,1\n"), encoding="ascii")
            found.write_text(format_rows(tracks), encoding="ascii")
            scores: dict[str, float] = json.loads(self._run("score", str(there), str(found)))
            return scores

    def _run(self, *words: str) -> str:
        try:
            done = subprocess.run(
                # -P: files beside the runner must not shadow packages.
                [str(self.python), "-P", str(_RUNNER), *words],
                capture_output=True,
                text=True,
                timeout=_RUN_S,
                check=True,
            )
        except subprocess.SubprocessError as error:
            raise OtherTrackersUnavailableError(f"{words[1]}: {_last_line(error)}") from error
        return done.stdout


def default_folder() -> Path:
    """Return the folder of the environment in the user's cache, named by its packages."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    wanted = hashlib.sha256(" ".join([sys.version, *PACKAGES]).encode()).hexdigest()[:12]
    return cache / "myview" / f"peers-{wanted}"


def peer_environment(folder: Path) -> OtherTrackerEnvironment:
    """Return the environment in the folder; install it first, with network access, where it is missing.

    Raises:
        OtherTrackersUnavailableError: the installation failed.
    """
    python = folder / "bin" / "python"
    done = folder / ".done"  # written last: without it the environment is incomplete
    if not done.exists():
        shutil.rmtree(folder, ignore_errors=True)
        pip = [
            str(python),
            "-m",
            "pip",
            "--disable-pip-version-check",
            "install",
            "--quiet",
            "--retries",
            "1",
        ]
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            for command in ([sys.executable, "-m", "venv", str(folder)], [*pip, *PACKAGES]):
                subprocess.run(command, capture_output=True, text=True, timeout=_INSTALL_S, check=True)
            done.touch()
        except (OSError, subprocess.SubprocessError) as error:
            raise OtherTrackersUnavailableError(_last_line(error)) from error
    return OtherTrackerEnvironment(python)


def _last_line(error: Exception) -> str:
    """Return the last line of a command's output, or its exit code."""
    said = error.stderr if isinstance(error, subprocess.CalledProcessError) else ""
    lines = [text for text in (said or str(error)).splitlines() if text.strip()]
    return lines[-1].strip() if lines else type(error).__name__
