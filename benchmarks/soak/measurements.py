"""The measurements of a soak test: samples of every process, delays of viewers, disk use."""

from __future__ import annotations

from dataclasses import dataclass, field

from benchmarks.live_cameras.frame_counters import FrameCounts
from benchmarks.soak.accelerated_site import CAMERAS, TimeScale
from benchmarks.soak.samples import ProcessSample
from benchmarks.soak.visitors import Visitors

PROCESSES = ("bestview", "sync", "up", *(f"camera {camera}" for camera in CAMERAS))


@dataclass(frozen=True, slots=True)
class LatencyMedians:
    """Median delays of recent pictures to viewers of a camera and of a person, milliseconds."""

    hours: float
    camera: float
    person: float


@dataclass(slots=True)
class SoakMeasurements:
    """What a soak test sampled: processes, delays, disk use, and the counters at its end."""

    time_scale: TimeScale
    visitors: Visitors
    samples: dict[str, list[ProcessSample]] = field(
        default_factory=lambda: {process: [] for process in PROCESSES}
    )
    delays: list[LatencyMedians] = field(default_factory=list)
    recorded: list[float] = field(default_factory=list)
    """Megabytes on the disk."""
    counts: FrameCounts = field(default_factory=lambda: FrameCounts({}, 0))
    seconds: float = 0.0
    failure: str = ""
