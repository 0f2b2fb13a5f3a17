"""The accelerated site of the soak test: two small cameras with ever new people."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from synthetic import Scene, write_recording

WIDTH, HEIGHT = 128, 72
NOMINAL = 3.0
"""Frames per second of the site's time."""
CAMERAS = ("c0", "c1")
_PEOPLE = 2
_PARTS, _PART_S = 8, 40.0
"""Groups of people, one after the other, and seconds of each."""
_FORGET = 800
"""Frames after which people are forgotten: before their group returns, so that it is new each time."""
_GOP, _LOOKAHEAD = 6, 20
_VIEWER_S = 4.0
"""Real seconds that a viewer may lag before losing pictures."""
_TIME_BASE = Fraction(1, 90_000)


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Conversion between the site's time and real time."""

    speed: float

    @property
    def fps(self) -> float:
        """Pulses per real second."""
        return NOMINAL * self.speed

    def seconds(self, site_seconds: float) -> float:
        """Return the real seconds of seconds of the site's time."""
        return site_seconds / self.speed

    def hours(self, pulse: int) -> float:
        """Return the hour of the site's time at a pulse."""
        return pulse / NOMINAL / 3600.0

    def pulse(self, hours: float) -> int:
        """Return the pulse at an hour of the site's time."""
        return round(hours * 3600.0 * NOMINAL)


@dataclass(frozen=True, slots=True)
class LoopedRecordings:
    """Recordings that are played in a loop (see :class:`benchmarks.latency.running_site.PlayedViews`)."""

    folder: Path
    time_scale: TimeScale

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The section `cameras` of the configuration."""
        return [
            {"id": camera, "source": str(self.folder / f"{camera}.mp4"), "at_end": "loop"}
            for camera in CAMERAS
        ]

    @property
    def site(self) -> dict[str, Any]:
        """The section `site` of the configuration."""
        return {"name": "soak", "fps": self.time_scale.fps, "width": WIDTH, "height": HEIGHT}

    @property
    def ground(self) -> Path | None:
        """The file of homographies to the ground plane."""
        return self.folder / "ground.json"

    def settings(self, recorded: Path, keep_hours: float) -> dict[str, dict[str, Any]]:
        """Return further settings: retention in the site's time, timeouts in real time.

        ``keep_hours`` is the retention of the recording.
        """
        seconds = self.time_scale.seconds
        window = {"length_s": 15 / self.time_scale.fps, "stride_s": 5 / self.time_scale.fps}
        return {
            "track": {"window": {**window, "birth_s": window["length_s"]}},
            "encode": {"gop_s": _GOP / self.time_scale.fps},
            "http": {"viewer_queue_gops": round(_VIEWER_S * self.time_scale.fps / _GOP)},
            "detect": {"work_width": WIDTH, "prescan_every_s": 0.4},
            "view": {
                "lookahead_s": _LOOKAHEAD / self.time_scale.fps,
                "buffer_s": seconds(60.0),
                "identity": {
                    "forget_after_s": _FORGET / self.time_scale.fps,
                    "comparable_s": (_FORGET - 50) / self.time_scale.fps,
                    "maximum_travel_s": _FORGET / self.time_scale.fps,
                },
            },
            "record": {
                "folder": str(recorded),
                "keep_s": seconds(3600.0 * keep_hours),
                "segment_s": seconds(60.0),
                "max_mb": 200.0,
            },
        }


def film(folder: Path, time_scale: TimeScale) -> LoopedRecordings:
    """Render the groups, one after the other, into one file for each camera."""
    folder.mkdir(parents=True)
    parts = []
    for seed in range(1, _PARTS + 1):
        parts.append(folder / f"part{seed}")
        scene = Scene("room", len(CAMERAS), _PEOPLE, seed, WIDTH, HEIGHT, NOMINAL)
        write_recording(scene, parts[-1], _PART_S)
    for camera in CAMERAS:
        _join([part / f"{camera}.mp4" for part in parts], folder / f"{camera}.mp4", time_scale.fps)
    (folder / "ground.json").write_bytes((parts[0] / "ground.json").read_bytes())
    return LoopedRecordings(folder, time_scale)


def _join(parts: list[Path], path: Path, fps: float) -> None:
    """Concatenate films into one at the site's accelerated frame rate."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream(
            "libx264", rate=Fraction(fps).limit_denominator(1001), options={"crf": "18", "preset": "veryfast"}
        )
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        number = 0
        for part in parts:
            with av.open(str(part)) as film:
                for frame in film.decode(video=0):
                    frame.pts, frame.time_base = round(number / fps / _TIME_BASE), _TIME_BASE
                    out.mux(stream.encode(frame))
                    number += 1
        out.mux(stream.encode(None))
