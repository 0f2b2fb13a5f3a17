"""Cost and size of a camera's stream: encoded as H.264 or VP8, or passed through.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.codecs --out out/bench

Runs a camera's pipeline, without network, on an H.264 recording of the synthetic room. Times are processor
time; the variants alternate, and the median over rounds is printed. Quality is that against the recording's
pictures, which passthrough does not change.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from server.camera.encoder import Encoder
from server.camera.pipeline import CameraPipeline
from server.config.loader import build_config
from server.config.sections import EncodeSettings, SiteSettings
from server.config.site_config import Config
from synthetic import Scene

_MS = 1e3
_START = 200
"""The scene's first frame: people are in sight."""
_PEAK = 255.0


@dataclass(frozen=True, slots=True)
class StreamVariant:
    """A way to produce a camera's stream."""

    name: str
    encode: dict[str, Any]
    passthrough: str = "off"


@dataclass(frozen=True, slots=True)
class StreamCost:
    """Cost and quality of a stream; milliseconds of processor time per frame."""

    capture_ms: float
    """Reading and decoding the picture."""
    encode_ms: float
    track_ms: float
    """Detecting and tracking people."""
    kbps: float
    quality: float
    """Decibels (PSNR) against the recording; infinite if identical."""

    @property
    def total_ms(self) -> float:
        """The time of all stages."""
        return self.capture_ms + self.encode_ms + self.track_ms


VARIANTS = (
    StreamVariant("H.264 (the default)", {}),
    StreamVariant("H.264, preset veryfast", {"preset": "veryfast"}),
    StreamVariant("H.264, max_kbps 500", {"max_kbps": 500}),
    StreamVariant("H.265", {"codec": "h265"}),
    StreamVariant("VP8 (quantizer 16, speed 10)", {"codec": "vp8"}),
    StreamVariant("VP8, quantizer 24", {"codec": "vp8", "quantizer": 24}),
    StreamVariant("H.264, passed through", {}, "pass"),
)


def record(path: Path, site: SiteSettings, frames: int) -> Path:
    """Write the synthetic room as encoded by the site's encoder."""
    scene, encoder = (
        Scene("room", 3, 4, 1, site.width, site.height, site.fps),
        Encoder(site, EncodeSettings()),
    )
    units = (encoder.encode(pulse, scene.image(0, _START + pulse)) for pulse in range(frames))
    path.write_bytes(b"".join(unit.data for unit in units))
    return path


def measure(variant: StreamVariant, recording: Path, site: SiteSettings, frames: int) -> StreamCost:
    """Run a camera pipeline over a recording, and measure it."""
    pipeline = CameraPipeline(_config(variant, recording, site), "c0")
    spent, size, error = np.zeros(3), 0, 0.0
    codec = variant.encode.get("codec", "h264")
    decoder = av.CodecContext.create("hevc" if codec == "h265" else codec, "r")
    assert isinstance(decoder, av.VideoCodecContext)  # noqa: S101 — narrows the type for mypy
    decoder.thread_count = 1
    for pulse in range(frames):
        times = [time.process_time()]
        frame = pipeline.take(pulse)
        assert frame is not None  # noqa: S101 — the recording is long enough
        assert frame.image is not None  # noqa: S101 — it is encoded
        times.append(time.process_time())
        unit = pipeline.encode(pulse, frame)
        times.append(time.process_time())
        pipeline.track(pulse, frame)
        times.append(time.process_time())
        spent += np.diff(times)
        size += len(unit.data)
        (picture,) = decoder.decode(av.Packet(unit.data))
        error += _mean_squared_error(picture.to_ndarray(format="bgr24"), frame.image)
    pipeline.close()
    capture_ms, encode_ms, track_ms = _MS * spent / frames
    quality = 10 * np.log10(_PEAK**2 * frames / error) if error else float("inf")
    return StreamCost(capture_ms, encode_ms, track_ms, size * 8 * site.fps / frames / 1e3, float(quality))


def _mean_squared_error(first: NDArray[Any], second: NDArray[Any]) -> float:
    return float(np.mean((first.astype(np.float32) - second.astype(np.float32)) ** 2))


def _config(variant: StreamVariant, recording: Path, site: SiteSettings) -> Config:
    content = {
        "site": site.model_dump(),
        "encode": variant.encode,
        "cameras": [{"id": "c0", "source": str(recording), "passthrough": variant.passthrough}],
    }
    return build_config(content, where="codecs", folder=recording.parent)


def median_cost(costs: Sequence[StreamCost]) -> StreamCost:
    """Return the median of each time; size and quality are the same in all rounds."""
    return StreamCost(
        statistics.median(cost.capture_ms for cost in costs),
        statistics.median(cost.encode_ms for cost in costs),
        statistics.median(cost.track_ms for cost in costs),
        costs[0].kbps,
        costs[0].quality,
    )


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__ or "", "codecs")
    options.add_argument("--size", default="640x360", help="of the picture, WIDTHxHEIGHT")
    options.add_argument("--frames", type=int, default=150, help="per round")
    options.add_argument("--rounds", type=int, default=3)
    chosen = options.parse_args()
    width, height = map(int, chosen.size.split("x"))
    site, report = SiteSettings(width=width, height=height), Report()
    with tempfile.TemporaryDirectory() as folder:
        recording = record(Path(folder) / "room.h264", site, chosen.frames)
        rounds = [
            [measure(variant, recording, site, chosen.frames) for variant in VARIANTS]
            for _ in range(chosen.rounds)
        ]
    rows = []
    for variant, *costs in zip(VARIANTS, *rounds, strict=True):
        cost = median_cost(costs)
        quality = "identical" if np.isinf(cost.quality) else f"{cost.quality:.1f}"
        times = [
            f"{cost.capture_ms:.2f}",
            f"{cost.encode_ms:.2f}",
            f"{cost.track_ms:.2f}",
            f"{cost.total_ms:.2f}",
        ]
        rows.append([variant.name, *times, f"{cost.kbps:.0f}", quality])
    report.table(
        f"One camera, {chosen.size} at {site.fps:g} fps; milliseconds of processor time per frame",
        ["stream", "capture", "encode", "track", "total", "kbit/s", "PSNR, dB"],
        rows,
    )
    report.save(chosen.out / "codecs.txt")


if __name__ == "__main__":
    main()
