"""Cost of rendering: boxes burnt in, for one viewer and for ten, and JPEG of every frame.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.overlay --out out/bench

Runs a real render worker on a stream of the synthetic room, as the best-view service does, but without HTTP:
sending costs the same for any stream. Costs are processor time of the two processes.
"""

from __future__ import annotations

import asyncio
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from server.camera.encoder import Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.h264.annexb import join_sample
from server.media.nal_units import nal_units
from server.media.rendering_messages import RenderSettings
from server.service.rendering.decided_boxes import GopOverlay, first_pulse
from server.service.rendering.mjpeg_streams import MjpegVariant
from server.service.rendering.rendered_stream import RenderedStream
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import BytesChunk, Subscriber
from synthetic import Scene

_MS = 1e3
_FRAMES = 100
"""Different frames of the scene; the stream repeats them."""
_START = 200
"""The scene's first frame: people are in sight."""
_MANY = 10
_POLL_S = 0.003
"""Seconds between two checks for a rendered GOP: too seldom to matter."""
_PATIENCE_S = 120.0
"""Timeout of a rendered GOP, and of the worker's start, on a busy machine."""


@dataclass(frozen=True, slots=True)
class ViewerLoad:
    """The viewers of one measurement."""

    name: str
    video_viewers: int = 0
    mjpeg_variants: Sequence[MjpegVariant] = ()


@dataclass(frozen=True, slots=True)
class RenderingCost:
    """Cost of serving these viewers; milliseconds of processor time per frame, except `start_s`."""

    start_s: float
    """Seconds until the first GOP is rendered."""
    worker_ms: float
    service_ms: float
    megabytes: float
    """Resident memory of the render worker."""


class RoomStream:
    """An encoded stream of the synthetic room with the boxes of its ground truth."""

    def __init__(self, site: SiteSettings, encode: EncodeSettings) -> None:
        scene = Scene("room", 3, 4, 1, site.width, site.height, site.fps)
        self.site, self.gop = site, encode.frames_per_gop(site.fps)
        self._images = [scene.image(0, _START + frame) for frame in range(_FRAMES)]
        truth = [scene.truth(_START + frame)[0] for frame in range(_FRAMES)]
        self._boxes = [
            [
                (int(number), float(x0), float(y0), float(x1), float(y1))
                for number, (x0, y0, x1, y1) in zip(camera_truth.ids, camera_truth.boxes, strict=True)
            ]
            for camera_truth in truth
        ]
        self._encoder = Encoder(site, encode)
        self._pulse = 0
        self.settings = RenderSettings(
            width=site.width,
            height=site.height,
            fps=site.fps,
            gop=encode.frames_per_gop(site.fps),
            preset=encode.preset,
            crf=encode.crf,
            max_kbps=encode.max_kbps,
            jpeg_quality=80,
        )

    def next_gop(self) -> BytesChunk:
        """Encode the next GOP."""
        data = b""
        for pulse in range(self._pulse, self._pulse + self.gop):
            unit = self._encoder.encode(pulse, self._images[pulse % _FRAMES])
            data += fragment(
                [FragmentSample(join_sample(nal_units(unit.data)), unit.key)], pulse, self.site.fps
            )
        self._pulse += self.gop
        return BytesChunk(data, random_access=True)

    def overlay(self, fragments: bytes) -> GopOverlay:
        """Return the boxes of a GOP."""
        first = first_pulse(fragments, self.site.fps)
        return GopOverlay(
            first, [self._boxes[pulse % _FRAMES] for pulse in range(first, first + self.gop)], 1
        )


async def measure(room: RoomStream, load: ViewerLoad, gops: int) -> RenderingCost:
    """Let a worker render GOPs, each published when the previous one is rendered."""
    stream = Broadcaster()
    source = RenderedStream("the room", lambda: stream, room.overlay, room.settings, live=True, queue_gops=8)
    source.acquire()
    source.video.users = load.video_viewers
    viewers = [source.video.broadcaster.subscribe() for _ in range(load.video_viewers)]
    viewers += [source.mjpeg.subscribe(mjpeg_variants) for mjpeg_variants in load.mjpeg_variants]
    readers = [asyncio.create_task(_read(viewer)) for viewer in viewers]
    chunks = [room.next_gop() for _ in range(gops + 1)]
    run, began = asyncio.create_task(source.run()), time.perf_counter()
    stream.publish(chunks[0])
    await _wait_until_rendered(source, _last_pulse(room, chunks[0]))
    start, pid = time.perf_counter() - began, source.pid
    assert pid is not None  # noqa: S101 — the worker is running
    worker_before, service_before = _processor_seconds(pid), time.process_time()
    for chunk in chunks[1:]:
        stream.publish(chunk)
        await _wait_until_rendered(source, _last_pulse(room, chunk))
    frames = gops * room.gop
    cost = RenderingCost(
        start,
        _MS * (_processor_seconds(pid) - worker_before) / frames,
        _MS * (time.process_time() - service_before) / frames,
        _resident_megabytes(pid),
    )
    stream.close()
    await run
    await asyncio.gather(*readers)
    return cost


async def _read(viewer: Subscriber) -> None:
    async for data in viewer:
        del data


async def _wait_until_rendered(source: RenderedStream, pulse: int) -> None:
    async with asyncio.timeout(_PATIENCE_S):
        while source.newest < pulse:  # noqa: ASYNC110 — only the benchmark polls
            await asyncio.sleep(_POLL_S)


def _last_pulse(room: RoomStream, chunk: BytesChunk) -> int:
    return first_pulse(chunk.data, room.site.fps) + room.gop - 1


def _processor_seconds(pid: int) -> float:
    """Return a process's processor time, seconds, at nanosecond resolution (Linux)."""
    return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0]) / 1e9


def _resident_megabytes(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    (line,) = [line for line in lines if line.startswith("VmRSS:")]
    return int(line.split()[1]) / 1024


def viewer_loads(fps: float) -> list[ViewerLoad]:
    """Return the viewers of each measurement."""
    plain, boxed = MjpegVariant(fps, boxed=False), MjpegVariant(fps, boxed=True)
    return [
        ViewerLoad("decoded only, for stills"),
        ViewerLoad("boxes burnt in, one viewer", 1),
        ViewerLoad(f"boxes burnt in, {_MANY} viewers", _MANY),
        ViewerLoad("JPEG, one viewer", 0, [plain]),
        ViewerLoad(f"JPEG, {_MANY} viewers", 0, [plain] * _MANY),
        ViewerLoad("JPEG with boxes, one viewer", 0, [boxed]),
        ViewerLoad("JPEG, 5 fps", 0, [MjpegVariant(5.0, boxed=False)]),
        ViewerLoad("all of these together", _MANY, [plain] * _MANY + [boxed] * _MANY),
    ]


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__ or "", "overlay")
    options.add_argument("--size", default="640x360", help="of the picture, WIDTHxHEIGHT")
    options.add_argument("--gops", type=int, default=30, help="per run")
    options.add_argument("--runs", type=int, default=3, help="number of runs; their median is printed")
    chosen = options.parse_args()
    width, height = map(int, chosen.size.split("x"))
    report = Report()
    room = RoomStream(SiteSettings(width=width, height=height), EncodeSettings())
    rows = []
    for load in viewer_loads(room.site.fps):
        costs = [asyncio.run(measure(room, load, chosen.gops)) for _ in range(chosen.runs)]
        worker_ms = statistics.median(cost.worker_ms for cost in costs)
        rows.append(
            [
                load.name,
                f"{worker_ms:.2f}",
                f"{statistics.median(cost.service_ms for cost in costs):.3f}",
                f"{100 * worker_ms * room.site.fps / _MS:.1f}",
                f"{statistics.median(cost.start_s for cost in costs):.2f}",
                f"{max(cost.megabytes for cost in costs):.0f}",
            ]
        )
    report.table(
        f"Pictures of one stream of {chosen.size} at {room.site.fps:g} fps",
        ["viewers", "worker, ms/frame", "service, ms/frame", "% of a core", "start, s", "MB"],
        rows,
    )
    report.save(chosen.out / "overlay.txt")


if __name__ == "__main__":
    main()
