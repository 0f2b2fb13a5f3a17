"""What each stage of a live camera process costs, measured inside the real process.

`hook/sitecustomize.py` calls :func:`time_camera` as the process starts. It wraps public methods of the
real classes and writes what they took into a file from time to time; nothing else is changed.
"""

from __future__ import annotations

import functools
import json
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import ROOT

FOLDER_VARIABLE = "BENCH_STAGES_FOLDER"
_HOOK = Path(__file__).parent / "hook"
_WRITE_EVERY = 25
"""Frames."""

STAGES = {
    "take": "the recording's H.264 to a picture of the site's size",
    "encode": "the picture to H.264, once",
    "detect": "background, silhouettes, looks",
    "witness": "scores again, by what the other cameras found",
    "track": "networks, births, templates",
    "solve": "the network programs",
    "report": "tracks to messages",
    "publish": "messages and pictures onto the bus",
}
REST = "rest"
"""Of the process: pulses, event loop, the bus's own threads, thumbnails."""


@dataclass(frozen=True, slots=True)
class CameraStageTimes:
    """What a camera process has used since it started.

    Attributes:
        frames: frames taken.
        seconds: processor time of each stage, without the stages inside it.
        process: processor time of the whole process.
    """

    frames: int
    seconds: Mapping[str, float]
    process: float

    def milliseconds_since(self, earlier: CameraStageTimes) -> dict[str, float]:
        """Return processor milliseconds per frame of each stage and of the rest since an earlier moment."""
        frames = max(self.frames - earlier.frames, 1)
        found = {name: 1e3 * (self.seconds[name] - earlier.seconds[name]) / frames for name in STAGES}
        whole = 1e3 * (self.process - earlier.process) / frames
        return {**found, REST: whole - sum(found.values())}


def hooked_environment(folder: Path) -> dict[str, str]:
    """Return what the environment of `myview up` needs so that its cameras time themselves into a folder."""
    path = [str(_HOOK), str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {"PYTHONPATH": os.pathsep.join(filter(None, path)), FOLDER_VARIABLE: str(folder)}


def read_stages(folder: Path) -> dict[str, CameraStageTimes]:
    """Read what the cameras have written last."""
    return {
        file.stem: CameraStageTimes(**json.loads(file.read_text(encoding="utf-8")))
        for file in sorted(folder.glob("*.json"))
    }


class ThreadStopwatch:
    """Adds up each stage's own processor time, thread by thread: stages of two threads run side by side."""

    def __init__(self, stages: Iterable[str] = STAGES) -> None:
        self.seconds = dict.fromkeys(stages, 0.0)
        self._local = threading.local()

    def wrap(self, owner: type, method: str, stage: str, after: Callable[[], None] | None = None) -> None:
        """Time a method from now on; `after` is called when it has returned."""
        original = getattr(owner, method)

        @functools.wraps(original)
        def run(*args: Any, **kwargs: Any) -> Any:
            inner: list[float] = self._local.__dict__.setdefault("inner", [])
            inner.append(0.0)
            start = time.thread_time()
            try:
                return original(*args, **kwargs)
            finally:
                spent = time.thread_time() - start
                # A stage runs in one thread only, so that nobody else adds to it.
                self.seconds[stage] += spent - inner.pop()
                if inner:
                    inner[-1] += spent
                if after is not None:
                    after()

        setattr(owner, method, run)


def time_camera(folder: str, camera: str) -> None:
    """Time the stages of this process, which is about to be a camera's."""
    # What is timed is imported here: the benchmark itself need not load it.
    from server.camera.peers.cross_view_scorer import CrossViewScorer  # noqa: PLC0415
    from server.camera.pipeline import CameraPipeline  # noqa: PLC0415
    from server.messaging.bus import Bus  # noqa: PLC0415
    from tracking import DEFAULT_SOLVER, OnlineTracker, create_solver  # noqa: PLC0415
    from tracking.detectors import BackgroundDetector  # noqa: PLC0415

    watch, frames = ThreadStopwatch(), 0
    path = Path(folder) / f"{camera}.json"

    def taken() -> None:
        nonlocal frames
        frames += 1
        if frames % _WRITE_EVERY == 0:
            now = {"frames": frames, "seconds": watch.seconds, "process": time.process_time()}
            part = path.with_suffix(".part")
            part.write_text(json.dumps(now), encoding="utf-8")
            part.replace(path)

    watch.wrap(CameraPipeline, "take", "take", taken)
    watch.wrap(CameraPipeline, "encode", "encode")
    watch.wrap(CameraPipeline, "detect", "report")
    watch.wrap(CameraPipeline, "track_detections", "report")
    watch.wrap(CrossViewScorer, "build_message", "witness")
    watch.wrap(CrossViewScorer, "rescore", "witness")
    watch.wrap(BackgroundDetector, "detect", "detect")
    watch.wrap(OnlineTracker, "push", "track")
    watch.wrap(type(create_solver(DEFAULT_SOLVER)), "solve", "solve")
    watch.wrap(Bus, "publish", "publish")
