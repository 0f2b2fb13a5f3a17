"""Processor time of the stages of a camera process, measured inside the real process.

`hook/sitecustomize.py` calls :func:`time_camera` as the process starts. It wraps public methods of the
real classes and writes their times into a file periodically; nothing else is changed.
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
    "detect": "background, silhouettes, appearance",
    "rescore": "rescoring by the detections of other cameras",
    "track": "networks, initiation, templates",
    "solve": "the network programs",
    "report": "tracks to messages",
    "publish": "messages and pictures onto the bus",
}
REST = "rest"
"""Time of the process outside the stages: pulses, event loop, threads of the bus, thumbnails."""


@dataclass(frozen=True, slots=True)
class CameraStageTimes:
    """Processor time of a camera process since its start.

    Attributes:
        frames: captured frames.
        seconds: processor time of each stage, without the stages inside it.
        process: processor time of the whole process.
    """

    frames: int
    seconds: Mapping[str, float]
    process: float

    def milliseconds_since(self, earlier: CameraStageTimes) -> dict[str, float]:
        """Return processor milliseconds per frame of each stage and of the rest since earlier times."""
        frames = max(self.frames - earlier.frames, 1)
        found = {name: 1e3 * (self.seconds[name] - earlier.seconds[name]) / frames for name in STAGES}
        whole = 1e3 * (self.process - earlier.process) / frames
        return {**found, REST: whole - sum(found.values())}


def hooked_environment(folder: Path) -> dict[str, str]:
    """Return the environment variables that make cameras of `myview up` write times into a folder."""
    path = [str(_HOOK), str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {"PYTHONPATH": os.pathsep.join(filter(None, path)), FOLDER_VARIABLE: str(folder)}


def read_stages(folder: Path) -> dict[str, CameraStageTimes]:
    """Read the last times of each camera."""
    return {
        file.stem: CameraStageTimes(**json.loads(file.read_text(encoding="utf-8")))
        for file in sorted(folder.glob("*.json"))
    }


class ThreadStopwatch:
    """Adds up the processor time of each stage by thread, since stages run in parallel threads."""

    def __init__(self, stages: Iterable[str] = STAGES) -> None:
        self.seconds = dict.fromkeys(stages, 0.0)
        self._local = threading.local()

    def wrap(self, owner: type, method: str, stage: str, after: Callable[[], None] | None = None) -> None:
        """Time a method from now on; `after` is called after each call."""
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
                # A stage runs in one thread only, so this needs no lock.
                self.seconds[stage] += spent - inner.pop()
                if inner:
                    inner[-1] += spent
                if after is not None:
                    after()

        setattr(owner, method, run)


def time_camera(folder: str, camera: str) -> None:
    """Time the stages of this process, which becomes a camera process."""
    # Imported here: the benchmark itself does not need these classes.
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
    watch.wrap(CrossViewScorer, "build_message", "rescore")
    watch.wrap(CrossViewScorer, "rescore", "rescore")
    watch.wrap(BackgroundDetector, "detect", "detect")
    watch.wrap(OnlineTracker, "push", "track")
    watch.wrap(type(create_solver(DEFAULT_SOLVER)), "solve", "solve")
    watch.wrap(Bus, "publish", "publish")
