"""Test pictures that identify their camera and frame, as MP4 fragments."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import cast

import av
import numpy as np
import numpy.typing as npt

WIDTH, HEIGHT = 320, 240  # pixels
FPS = 25
GOP = 10  # frames
PERIOD = 100  # frames after which the pattern repeats; a multiple of GOP
TIMESCALE = 90_000  # ticks per second
SQUARE = 28  # pixels, side of the bright square
COLUMNS = 20
CAMERAS = ("c0", "c1", "c2")
GROUNDS = ((40, 46, 62), (62, 46, 40), (52, 44, 58))  # red, green, blue: dark, a tint per camera
SECOND = (150, 96, 60)  # red, green, blue of the second person's square


@dataclass(frozen=True, slots=True)
class Pattern:
    """One camera's recording, cut into fragments.

    Args:
        init: The init segment (ftyp, moov).
        fragments: PERIOD fragments (moof, mdat) of one frame each, all with decode time 0.
    """

    init: bytes
    fragments: tuple[bytes, ...]

    def fragment(self, pulse: int) -> bytes:
        """Return the frame of a pulse with its place on the time axis: tfdt = pulse * 90000 / fps."""
        data = self.fragments[pulse % PERIOD]
        at = data.index(b"tfdt") + 4
        time = struct.pack(">Q", pulse * TIMESCALE // FPS)
        if data[at] != 1:
            raise ValueError("expected a tfdt of 64 bits")
        return data[: at + 4] + time + data[at + 12 :]


def square(camera: int, pulse: int) -> tuple[int, int]:
    """Return the corner (left, top) of person 1's bright square, which depends on frame and camera."""
    step = (pulse + 37 * camera) % PERIOD
    return 4 + 14 * (step % COLUMNS), 20 + 40 * (step // COLUMNS)


def second(camera: int, pulse: int) -> tuple[int, int]:
    """Return the corner (left, top) of person 2's square, which moves the other way."""
    left, top = square(camera, pulse)
    return WIDTH - SQUARE - left, HEIGHT - SQUARE - top


def picture(camera: int, pulse: int) -> npt.NDArray[np.uint8]:
    """Paint a frame, shape (HEIGHT, WIDTH, 3), red, green, blue."""
    frame = np.full((HEIGHT, WIDTH, 3), GROUNDS[camera], np.uint8)
    for (left, top), color in ((second(camera, pulse), SECOND), (square(camera, pulse), (255, 255, 255))):
        frame[top : top + SQUARE, left : left + SQUARE] = color
    return frame


@cache
def pattern(camera: int) -> Pattern:
    """Encode a camera's recording: closed GOPs, the same parameters for every camera."""
    file = io.BytesIO()
    options = {
        "movflags": "frag_every_frame+empty_moov+default_base_moof",
        "video_track_timescale": str(TIMESCALE),
    }
    with av.open(file, "w", format="mp4", options=options) as container:
        stream = container.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "profile": "baseline",
            "level": "3.1",
            "crf": "18",
            "x264-params": f"keyint={GOP}:min-keyint={GOP}:scenecut=0",
        }
        for pulse in range(PERIOD):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(camera, pulse), format="rgb24")))
        container.mux(stream.encode(None))
    return _cut(file.getvalue())


def _cut(data: bytes) -> Pattern:
    init, fragments, head = b"", [], b""
    for kind, box in _boxes(data):
        if kind in {b"ftyp", b"moov"}:
            init += box
        elif kind == b"moof":
            head = box
        elif kind == b"mdat":
            fragments.append(head + box)
    if len(fragments) != PERIOD:
        raise ValueError(f"expected {PERIOD} fragments, got {len(fragments)}")
    return Pattern(init, tuple(fragments))


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at < len(data):
        size = cast("int", struct.unpack_from(">I", data, at)[0])
        yield data[at + 4 : at + 8], data[at : at + size]
        at += size
