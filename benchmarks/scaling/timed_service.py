"""The real best-view process, timed by stage from inside.

    python -m benchmarks.scaling.timed_service TIMES.json bestview SITE.yaml

is `myview bestview SITE.yaml` with its classes' public methods wrapped; nothing else is changed.
"""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.live_cameras.stage_times import ThreadStopwatch
from bestview import IdentityRegistry
from server.cli.main import main as command_line
from server.http.api.events import Events
from server.messaging.bus import Bus
from server.service.decision_state import DecisionState
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.pipeline import BestViewPipeline
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import ViewDecider
from server.service.view_selection.lookahead_window import LookaheadWindow
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer

LISTS = "lists"
STAGES = {
    "ingest tracks": "decoding, validation and alignment of the cameras' windows",
    "ingest frames": "access units to fragments in the frame buffers; thumbnails",
    "align": "completed epochs",
    "identities": "identities across cameras",
    "people": "messages to tracks, boxes by person",
    "quality": "quality of every view",
    "costs": "selection costs by frame, camera and person",
    "select": "the selection program, and the decision",
    "state": "content for the page, the API and the bus",
    "publish": "encoding as JSON, and publishing",
    "splice": "the selected GOP of each person",
    LISTS: "lists of people and cameras for the page, every second",
}
REST = "rest"
"""Time outside the stages: zenoh's threads and router, copies off the bus, the event loop, pulses."""


@dataclass(frozen=True, slots=True)
class ServiceTimes:
    """Counts and processor time of the service since its start.

    Attributes:
        epochs: decided.
        seconds: processor time of each stage, without the stages inside it.
        process: processor time of the whole process.
        messages: received messages of all kinds.
        size: their bytes.
        at: time of the reading, seconds of the monotonic clock.
    """

    epochs: int
    seconds: Mapping[str, float]
    process: float
    messages: int
    size: int
    at: float

    @classmethod
    def read(cls, path: Path) -> ServiceTimes | None:
        """Read the last times; None: there are none yet."""
        return cls(**json.loads(path.read_text(encoding="utf-8"))) if path.exists() else None


def watch(path: Path) -> None:
    """Time this process from now on, and write the times into the file after every epoch."""
    watched = ThreadStopwatch(STAGES)
    count = {"epochs": 0, "messages": 0, "size": 0}

    def write_times() -> None:
        count["epochs"] += 1
        part = path.with_suffix(".part")
        used = {"seconds": watched.seconds, "process": time.process_time()}
        now = {**count, **used, "at": time.monotonic()}
        part.write_text(json.dumps(now), encoding="utf-8")
        part.replace(path)

    for name in ("receive_tracks", "receive_video", "receive_thumbnail"):
        _count(name, count)
    for owner, method, stage in (
        (Ingest, "receive_tracks", "ingest tracks"),
        (Ingest, "receive_video", "ingest frames"),
        (Ingest, "receive_thumbnail", "ingest frames"),
        (EpochAligner, "take_next_ready", "align"),
        (IdentityRegistry, "update", "identities"),
        (PersonTracker, "_begin", "people"),
        (PersonTracker, "update", "people"),
        (ViewQualityBuffer, "put", "quality"),
        (LookaheadWindow, "__init__", "costs"),
        (DecisionState, "put", "state"),
        (BestViewPipeline, "_publish", "publish"),
        (Bus, "publish", "publish"),
        (Splicer, "publish_decision", "splice"),
        (Events, "_lists", LISTS),
    ):
        watched.wrap(owner, method, stage)
    watched.wrap(ViewDecider, "step", "select", write_times)


def _count(name: str, count: dict[str, int]) -> None:
    original = getattr(Ingest, name)

    @functools.wraps(original)
    def run(self: Ingest, message: Any) -> None:
        count["messages"] += 1
        count["size"] += len(message.payload) + len(message.attachment)
        original(self, message)

    setattr(Ingest, name, run)


if __name__ == "__main__":
    watch(Path(sys.argv.pop(1)))
    command_line()
