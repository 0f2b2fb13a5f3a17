"""The site of a soak: two small cameras, faster than they were filmed; their people change all the time."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from synthetic import Scene, write_recording

WIDTH, HEIGHT = 128, 72
NOMINAL = 3.0
"""Frames a second of the site's time."""
CAMERAS = ("c0", "c1")
_PEOPLE = 2
_PARTS, _PART_S = 8, 40.0
"""Groups of people who come one after the other, each for so many seconds."""
_FORGET = 800
"""Frames after which people are forgotten: before their group comes again, so that it is new every time."""
_GOP, _LOOKAHEAD = 6, 20
_VIEWER_S = 4.0
"""Seconds of the world that a viewer may be behind before losing pictures."""
_TIME_BASE = Fraction(1, 90_000)


@dataclass(frozen=True, slots=True)
class TimeScale:
    """How much faster than its own time the site runs."""

    speed: float

    @property
    def fps(self) -> float:
        """Pulses for each second of the world."""
        return NOMINAL * self.speed

    def seconds(self, of_the_site: float) -> float:
        """Return seconds of the world for seconds of the site."""
        return of_the_site / self.speed

    def hours(self, pulse: int) -> float:
        """Return the site's time at a pulse."""
        return pulse / NOMINAL / 3600.0

    def pulse(self, hours: float) -> int:
        """Return the pulse at a time of the site."""
        return round(hours * 3600.0 * NOMINAL)


@dataclass(frozen=True, slots=True)
class LoopedRecordings:
    """Recordings that are played in a loop (see :class:`benchmarks.latency.running_site.PlayedViews`)."""

    folder: Path
    tempo: TimeScale

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The configuration's cameras."""
        return [{"id": it, "source": str(self.folder / f"{it}.mp4"), "at_end": "loop"} for it in CAMERAS]

    @property
    def site(self) -> dict[str, Any]:
        """The configuration's site."""
        return {"name": "soak", "fps": self.tempo.fps, "width": WIDTH, "height": HEIGHT}

    @property
    def ground(self) -> Path | None:
        """Homographies to the ground plane."""
        return self.folder / "ground.json"

    def settings(self, recorded: Path, keep_hours: float) -> dict[str, dict[str, Any]]:
        """Return what else is set: what is kept is counted in the site's time, patience in the world's.

        ``keep_hours`` is how long the recording is kept.
        """
        seconds = self.tempo.seconds
        return {
            "encode": {"gop": _GOP},
            "http": {"viewer_queue_gops": round(_VIEWER_S * self.tempo.fps / _GOP)},
            "detect": {"work_width": WIDTH, "prescan_every": 10},
            "view": {
                "lookahead": _LOOKAHEAD,
                "buffer_s": seconds(60.0),
                "identity": {
                    "forget_after": _FORGET,
                    "comparable_frames": _FORGET - 50,
                    "travel_frames": _FORGET,
                },
            },
            "record": {
                "folder": str(recorded),
                "keep_s": seconds(3600.0 * keep_hours),
                "segment_s": seconds(60.0),
                "max_mb": 200.0,
            },
        }


def film(folder: Path, tempo: TimeScale) -> LoopedRecordings:
    """Film the groups, one after the other, into one file for each camera."""
    folder.mkdir(parents=True)
    parts = []
    for seed in range(1, _PARTS + 1):
        parts.append(folder / f"part{seed}")
        scene = Scene("room", len(CAMERAS), _PEOPLE, seed, WIDTH, HEIGHT, NOMINAL)
        write_recording(scene, parts[-1], _PART_S)
    for camera in CAMERAS:
        _join([it / f"{camera}.mp4" for it in parts], folder / f"{camera}.mp4", tempo.fps)
    (folder / "ground.json").write_bytes((parts[0] / "ground.json").read_bytes())
    return LoopedRecordings(folder, tempo)


def _join(parts: list[Path], path: Path, fps: float) -> None:
    """Write the pictures of some films into one, one for each pulse of a site in a hurry."""
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
