"""Views of the synthetic room whose pictures and boxes carry their camera and frame number.

A strip at the bottom of each picture encodes its camera and frame number in black and white blocks, which
survive encoding. Detections are the ground truth; the thousandths of a box's left, top and width encode the
frame of the detection. So pictures of the wrong camera or moment and boxes of another picture are recognized.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from client import Box
from synthetic import Scene

FPS = 25
WIDTH, HEIGHT = 256, 144
CAMERAS = ("c0", "c1", "c2")
FRAMES = 1000
"""Frames of a film, which is looped; frame numbers have three digits."""
_PEOPLE, _SEED = 3, 1
_START, _DRAWN = 300, 50
"""All people are in view. The frames are played forwards and backwards, so that motion is continuous."""
BLOCK, EDGE = 8, 2
"""Pixels of one bit, and pixels at its edges that are not read."""
BITS, NUMBER_BITS = 16, 12
"""Bits of a strip, which repeats them inverted, and of the frame number in it; the rest is the camera."""
_TOPS, _WIDTHS = np.random.default_rng(1).permuted(np.tile(np.arange(FRAMES), (2, 1)), axis=1).tolist()
"""The thousandths of a box's top and width, by frame; interpolated boxes match no frame."""
_DARK, _BRIGHT, _MIDDLE = 40, 215, 128
_MIN_VISIBLE = 0.3
"""Visible share of a person from which they are detected."""
_MIN_OVERLAP = 0.5
"""Intersection over union of a tracked box and a person's from which it shows them."""
_TIME_BASE = Fraction(1, 90_000)


@dataclass(frozen=True, slots=True)
class FrameStamp:
    """The camera and frame number in a picture."""

    camera: str
    frame: int
    """Below :data:`FRAMES`."""


@dataclass(frozen=True, slots=True)
class StampedViews:
    """The views of a site (see `benchmarks.latency.running_site.PlayedViews`)."""

    cameras: list[dict[str, Any]]
    site: dict[str, Any]
    ground: Path | None
    found: Mapping[tuple[str, int, int, int, int], int]
    """The frame in which a box was detected, by camera and left, top, right, bottom in thousandths."""
    people: Mapping[tuple[str, int], Mapping[int, tuple[float, ...]]] = field(default_factory=dict)
    """The boxes (left, top, right, bottom) of the scene's people, by camera and frame, then by person."""

    def frame_of(self, camera: str, box: Box) -> int | None:
        """Return the frame in which a box was detected; None: it is interpolated."""
        sides = (round(1000 * side) for side in (box.left, box.top, box.right, box.bottom))
        return self.found.get((camera, *sides))  # type: ignore[arg-type]

    def person_of(self, camera: str, pulse: int, box: Box) -> int | None:
        """Return the person of the scene whom a box shows at a pulse; None: nobody."""
        sides = (box.left, box.top, box.right, box.bottom)
        people = self.people.get((camera, pulse % FRAMES), {})
        overlaps = {person: _overlap(sides, truth) for person, truth in people.items()}
        best = max(overlaps, key=overlaps.__getitem__, default=None)
        return best if best is not None and overlaps[best] >= _MIN_OVERLAP else None


def _overlap(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the intersection over union of two boxes: left, top, right, bottom."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    shared = max(0.0, width) * max(0.0, height)
    areas = ((box[2] - box[0]) * (box[3] - box[1]) for box in (one, other))
    return shared / (sum(areas) - shared)


def stamp_picture(image: NDArray[np.uint8], camera: int, frame: int) -> NDArray[np.uint8]:
    """Return a copy of a picture ``(H, W, 3)`` with its strip."""
    value = camera << NUMBER_BITS | frame
    bits = [value >> place & 1 for place in range(BITS)]
    bits += [1 - bit for bit in bits]
    strip = np.repeat(np.where(np.array(bits) > 0, _BRIGHT, _DARK).astype(np.uint8), BLOCK)
    marked = image.copy()
    marked[-BLOCK:, : len(strip)] = strip[None, :, None]
    return marked


def read_stamp(gray: NDArray[np.uint8]) -> FrameStamp | None:
    """Read the strip of a picture ``(H, W)``; None: it is illegible."""
    rows = gray[-BLOCK + EDGE : gray.shape[0] - EDGE, : 2 * BITS * BLOCK].astype(np.float64)
    blocks = rows.reshape(len(rows), 2 * BITS, BLOCK)[:, :, EDGE:-EDGE].mean(axis=(0, 2)) > _MIDDLE
    bits, inverse = blocks[:BITS], blocks[BITS:]
    if (bits == inverse).any():
        return None
    value = sum(1 << place for place in np.flatnonzero(bits).tolist())
    camera, frame = divmod(value, 1 << NUMBER_BITS)
    return FrameStamp(f"c{camera}", frame)


def make(folder: Path, pulses: int) -> StampedViews:
    """Write films, detections for a number of pulses, and homographies into a folder."""
    scene = Scene("room", len(CAMERAS), _PEOPLE, _SEED, WIDTH, HEIGHT, FPS)
    places = _places()
    truths = {place: scene.truth(place) for place in sorted(set(places))}
    cameras, found = [], {}
    people: dict[tuple[str, int], dict[int, tuple[float, ...]]] = {}
    for number, name in enumerate(CAMERAS):
        drawn = {place: scene.image(number, place) for place in truths}
        pictures = [stamp_picture(drawn[place], number, frame) for frame, place in enumerate(places)]
        write_film(pictures, folder / f"{name}.mp4")
        detected = [_detect(truths[place][number]) for place in places]
        boxes = [np.array(list(some.values())).reshape(-1, 4) for some in detected]
        _write_detections(boxes, pulses, folder / f"{name}.txt")
        for frame, some in enumerate(boxes):
            found.update(dict.fromkeys(((name, *sides) for sides in _sides(some, frame)), frame))
        for frame, sizes in enumerate(detected):
            people[name, frame] = {
                person: (left, top, left + width, top + height)
                for person, (left, top, width, height) in sizes.items()
            }
        source, file = str(folder / f"{name}.mp4"), str(folder / f"{name}.txt")
        cameras.append({"id": name, "source": source, "at_end": "loop", "detections": file})
    floors = {name: scene.homography(number) for number, name in enumerate(CAMERAS)}
    ground = {name: floor.tolist() for name, floor in floors.items() if floor is not None}
    (folder / "ground.json").write_text(json.dumps({"unit": "m", "homography": ground}), encoding="ascii")
    site = {"name": "faults", "fps": FPS, "width": WIDTH, "height": HEIGHT}
    return StampedViews(cameras, site, folder / "ground.json", found, people)


def shrink_other_detections(views: StampedViews, folder: Path, best: str, pulses: int) -> StampedViews:
    """Return views with smaller detections in all cameras but `best`, so that it is selected."""
    cameras, found = [], dict(views.found)
    for camera in views.cameras:
        name = camera["id"]
        if name == best:
            cameras.append(camera)
            continue
        boxes: list[list[tuple[int, int, int, int]]] = [[] for _ in range(FRAMES)]
        for (of, left, top, right, bottom), frame in views.found.items():
            if of == name:
                width, height = (right - left) // 2000, (bottom - top) // 2000
                x, y = (left + right) // 2000 - width // 2, bottom // 1000 - height
                boxes[frame].append((x, y, width, height))
        smaller = [np.array(some).reshape(-1, 4) for some in boxes]
        for frame, some in enumerate(smaller):
            found.update(dict.fromkeys(((name, *sides) for sides in _sides(some, frame)), frame))
        path = folder / f"{name}-small.txt"
        _write_detections(smaller, pulses, path)
        cameras.append({**camera, "detections": str(path)})
    return replace(views, cameras=cameras, found=found)


def write_smaller_film(path: Path, out: Path) -> Path:
    """Write a film again, at three quarters of its size."""
    with av.open(str(path)) as container:
        pictures = [
            np.asarray(
                frame.reformat(WIDTH * 3 // 4, HEIGHT * 3 // 4).to_ndarray(format="bgr24"), dtype=np.uint8
            )
            for frame in container.decode(video=0)
        ]
    write_film(pictures, out)
    return out


def write_film(pictures: Sequence[NDArray[np.uint8]], path: Path, fps: int = FPS) -> None:
    """Encode pictures at a frame rate, with GOPs of ten frames."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps, options={"crf": "18", "preset": "ultrafast"})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt, stream.gop_size, stream.codec_context.max_b_frames = "yuv420p", 10, 0
        stream.codec_context.thread_count = 1
        for number, picture in enumerate(pictures):
            frame = VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = round(number / fps / _TIME_BASE), _TIME_BASE
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def _places() -> list[int]:
    """Return the scene's frame that each frame of a film shows."""
    forwards = list(range(_START, _START + _DRAWN))
    both = [*forwards, *reversed(forwards)]
    return [both[frame % len(both)] for frame in range(FRAMES)]


def _detect(truth: Any) -> dict[int, tuple[float, ...]]:
    """Return by person the whole and visible boxes: left, top, width, height in whole pixels."""
    boxes = np.floor(truth.boxes).reshape(-1, 4)
    inside = (boxes[:, :2] >= 1).all(axis=1) & (boxes[:, 2] < WIDTH - 1) & (boxes[:, 3] < HEIGHT - 1)
    detected = inside & (truth.visibility >= _MIN_VISIBLE)
    kept = boxes[detected]
    sizes = np.hstack([kept[:, :2], kept[:, 2:] - kept[:, :2]])
    return dict(zip(truth.ids[detected].tolist(), map(tuple, sizes.tolist()), strict=True))


def _write_detections(boxes: Sequence[NDArray[np.float64]], pulses: int, path: Path) -> None:
    with path.open("w", encoding="ascii") as file:
        for pulse in range(pulses):
            frame = pulse % FRAMES
            x, y, wide = (f".{code:03d}" for code in (frame, _TOPS[frame], _WIDTHS[frame]))
            for left, top, width, height in boxes[frame].astype(int).tolist():
                file.write(f"{pulse + 1},-1,{left}{x},{top}{y},{width}{wide},{height},1,-1,-1,-1\n")


def _sides(boxes: NDArray[Any], frame: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield left, top, right and bottom in thousandths of the boxes ``(N, 4)`` of a frame."""
    for left, top, width, height in (1000 * boxes.astype(int)).tolist():
        x, y = left + frame, top + _TOPS[frame]
        yield x, y, x + width + _WIDTHS[frame], y + height
