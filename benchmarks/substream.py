"""What a substream saves: processor time of a camera with and without one.

    python -m benchmarks.substream --out out/bench

A camera's large stream, and one of 640x360 of the same drawn room, are two H.264 recordings. The camera's
pipeline takes each frame, passes it through or encodes it, and detects and tracks people.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.forked import in_copy
from benchmarks.common.report import Report
from server.camera.encoder import Encoder
from server.camera.pipeline import CameraPipeline
from server.config.loader import build_config
from server.config.sections import EncodeSettings, SiteSettings
from server.config.site_config import Config
from synthetic import Scene

Size = tuple[int, int]
_SMALL = (640, 360)
_MAIN: Sequence[Size] = ((1920, 1080), (3840, 2160))
_ENCODED = (1280, 720)
"""The site's size where the camera's video is encoded again."""
_FPS, _RATES = 25, (15, 25)
"""Rate of the recordings, and rates at which the load is shown."""
_START, _WARM_FRAMES = 200, 50
"""The scene's frame at which the recordings begin, and frames before the measurement."""
_NOISE, _GRAINS = 3.0, 8
"""Standard deviation of the camera's noise, gray levels; its different pictures."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor milliseconds a frame: to take and send it, and to detect and track people."""

    video_ms: float
    people_ms: float

    @property
    def total_ms(self) -> float:
        """All of them."""
        return self.video_ms + self.people_ms


def write_film(path: Path, size: Size, frames: int) -> None:
    """Write the room as H.264 in GOPs of a second, with the noise of a camera."""
    scene = Scene("room", 3, 4, 1, *_SMALL, _FPS)
    encoder = Encoder(SiteSettings(width=size[0], height=size[1], fps=_FPS), EncodeSettings(gop_s=1.0))
    grains = np.random.default_rng(1).normal(0, _NOISE, (_GRAINS, *size[::-1], 1)).astype(np.int16)
    with path.open("wb") as file:
        for frame in range(frames):
            image = cv2.resize(scene.image(0, _START + frame), size, interpolation=cv2.INTER_CUBIC)
            grainy = image + grains[frame % _GRAINS]
            file.write(encoder.encode(frame, np.clip(grainy, 0, 255).astype(np.uint8)).data)


def site_of(size: Size, folder: Path, *, passes: bool, has_substream: bool) -> Config:
    """Return a site with a camera whose main stream has a size."""
    width, height = size if passes else _ENCODED
    camera = {
        "id": "c0",
        "source": "main.h264",
        "substream": "small.h264" if has_substream else None,
        "passthrough": "pass" if passes else "off",
    }
    content = {
        "site": {"fps": _FPS, "width": width, "height": height},
        "encode": {"gop_s": 1.0, "parameters": "own"},
        "cameras": [camera],
    }
    return build_config(content, where="substream", folder=folder)


def run(config: Config, frames: int) -> Cost:
    """Run a camera's pipeline over its recordings."""
    pipeline = CameraPipeline(config, "c0")
    spent = np.zeros(2)
    for pulse in range(_WARM_FRAMES + frames):
        times = [time.process_time()]
        frame = pipeline.take(pulse)
        assert frame is not None  # noqa: S101 — the recordings are long enough
        pipeline.encode(pulse, frame)
        times.append(time.process_time())
        pipeline.track(pulse, frame)
        times.append(time.process_time())
        if pulse >= _WARM_FRAMES:
            spent += np.diff(times)
    pipeline.close()
    video_ms, people_ms = (1000 * spent / frames).tolist()
    return Cost(video_ms, people_ms)


def measure(options: argparse.Namespace) -> None:
    """Measure all cameras, and print the table."""
    report, rows = Report(), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        written = _WARM_FRAMES + options.frames
        in_copy(partial(write_film, folder / "small.h264", _SMALL, written))
        for size in _MAIN:
            in_copy(partial(write_film, folder / "main.h264", size, written))
            for passes in (True, False):
                alone, both = (
                    in_copy(
                        partial(
                            run,
                            site_of(size, folder, passes=passes, has_substream=has_substream),
                            options.frames,
                        )
                    )
                    for has_substream in (False, True)
                )
                rows.append(_row(size, alone, both, passes=passes))
    columns = (
        "main stream",
        "its video",
        "video, ms a frame",
        "people",
        "both",
        *(f"of a core at {rate} fps" for rate in _RATES),
    )
    report.table("Processor time of a camera without → with a substream of 640x360", columns, rows)
    report.save(options.out / "substream.txt")


def _row(size: Size, alone: Cost, both: Cost, *, passes: bool) -> Sequence[str]:
    video = "passes through" if passes else f"encoded at {_ENCODED[0]}x{_ENCODED[1]}"
    pairs = [
        (alone.video_ms, both.video_ms),
        (alone.people_ms, both.people_ms),
        (alone.total_ms, both.total_ms),
    ]
    costs = [f"{before:.1f} → {after:.1f}" for before, after in pairs]
    loads = [f"{alone.total_ms * rate / 1000:.2f} → {both.total_ms * rate / 1000:.2f}" for rate in _RATES]
    return f"{size[0]}x{size[1]}", video, *costs, *loads


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__ or "", "substream")
    options.add_argument("--frames", type=int, default=150, help="to measure, for each camera")
    measure(options.parse_args())


if __name__ == "__main__":
    try:
        main()
    except CannotRunError as problem:
        finish(problem, "substream")
