"""A scene written to disk: one video per camera, ground truth, and the cameras' homographies.

The formats are those of common tracking data sets: `c0.mp4` …, `gt/c0.txt` with MOTChallenge rows
`frame,id,left,top,width,height,1,class,visible` (frames count from 1), and, where the scene has a floor,
`ground.json`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import Self

import av
import numpy as np
from numpy.typing import NDArray

from synthetic.ground_truth import CameraTruth
from synthetic.scene import Scene

_PEDESTRIAN = 1  # MOTChallenge's class
# Macroblock trees are off: with them the output of x264 differs from run to run.
_OPTIONS = {"crf": "21", "preset": "veryfast", "mbtree": "0"}
_TIME_BASE = Fraction(1, 90_000)  # seconds

Progress = Callable[[int, int], None]


def write_recording(scene: Scene, out: Path, seconds: float, progress: Progress | None = None) -> None:
    """Write the first `seconds` of a scene into the folder `out`, which must be new or empty.

    `progress` is called after each frame with the numbers of frames written and of all frames. After an error
    the folder contains a partial recording.

    Raises:
        ValueError: `seconds` is shorter than a frame, or width or height is odd. Nothing is written.
        FileExistsError: `out` is a file, or a folder that is not empty.
        OSError: the folder or a file cannot be written.
    """
    frames = round(seconds * scene.fps)
    if frames < 1:
        raise ValueError(f"a recording needs at least one frame; {seconds} s at {scene.fps:g} fps has none")
    if scene.width % 2 or scene.height % 2:
        raise ValueError(f"a video's width and height must be even, not {scene.width} x {scene.height}")
    out.mkdir(parents=True, exist_ok=True)
    if any(out.iterdir()):
        raise FileExistsError(f"{out}: not an empty folder")
    _write(scene, out, frames, progress)


def _write(scene: Scene, folder: Path, frames: int, progress: Progress | None) -> None:
    (folder / "gt").mkdir()
    matrices = _homographies(scene)
    if matrices:
        ground = json.dumps({"unit": "m", "homography": matrices}, indent=1)
        (folder / "ground.json").write_text(ground + "\n", encoding="ascii")
    with ExitStack() as stack:
        videos = [
            stack.enter_context(_Video(folder / f"c{camera}.mp4", scene)) for camera in range(scene.cameras)
        ]
        tables = [
            stack.enter_context((folder / "gt" / f"c{camera}.txt").open("w", encoding="ascii"))
            for camera in range(scene.cameras)
        ]
        for frame in range(frames):
            for camera, truth in enumerate(scene.truth(frame)):
                videos[camera].add(scene.image(camera, frame), frame)
                tables[camera].writelines(_rows(truth, frame))
            if progress is not None:
                progress(frame + 1, frames)


def has_ground(scene: Scene) -> bool:
    """Return whether a scene has a ground plane, and so a `ground.json`."""
    return bool(_homographies(scene))


def _homographies(scene: Scene) -> dict[str, list[list[float]]]:
    matrices = {f"c{camera}": scene.homography(camera) for camera in range(scene.cameras)}
    return {camera: matrix.tolist() for camera, matrix in matrices.items() if matrix is not None}


def _rows(truth: CameraTruth, frame: int) -> list[str]:
    rows = []
    for number, box, visible in zip(
        truth.ids.tolist(), truth.boxes.tolist(), truth.visibility.tolist(), strict=True
    ):
        left, top, right, bottom = box
        box_fields = f"{left:g},{top:g},{right - left:g},{bottom - top:g}"
        rows.append(f"{frame + 1},{number},{box_fields},1,{_PEDESTRIAN},{visible:.3f}\n")
    return rows


class _Video:
    """One camera's video file, closed properly even after an error."""

    def __init__(self, path: Path, scene: Scene) -> None:
        self._container = av.open(str(path), "w")
        # Without the rate, x264 assumes a wrong one and reduces the bitrate.
        stream = self._container.add_stream("libx264", rate=Fraction(scene.fps).limit_denominator(1001))
        stream.width, stream.height = scene.width, scene.height
        stream.pix_fmt = "yuv420p"
        stream.options = dict(_OPTIONS)
        stream.time_base = stream.codec_context.time_base = _TIME_BASE
        stream.codec_context.thread_count = 1  # for the same bytes on every machine
        self._stream, self._fps = stream, Fraction(scene.fps).limit_denominator(1001)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self._container.mux(self._stream.encode(None))
        self._container.close()

    def add(self, image: NDArray[np.uint8], frame: int) -> None:
        """Encode a BGR image ``(H, W, 3)``."""
        picture = av.VideoFrame.from_ndarray(image, format="bgr24")
        picture.pts, picture.time_base = round(frame / self._fps / _TIME_BASE), _TIME_BASE
        self._container.mux(self._stream.encode(picture))
