"""One camera's final boxes of a calibration walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import foot_points
from bestview.calibration import Floats, boxes_at_edge
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_boxes
from server.service.calibration.worker import CameraBoxes

Ints = NDArray[np.int64]

_THIRDS = 3


@dataclass(frozen=True, slots=True)
class WalkSamples:
    """S boxes that are not cut off by the image's edge.

    Attributes:
        moment: (S,) index of the compared moment.
        third: (S,) the third of the image that the person stands in, 0 to 2 from the left.
        height: (S,) pixels.
    """

    moment: Ints
    third: Ints
    height: Floats


class CalibrationWalk:
    """Collects one camera's final boxes.

    ``site`` is the size of the site's image, whose pixels boxes are in; every ``step``-th frame is sampled.
    """

    def __init__(self, camera: str, site: tuple[int, int], step: int) -> None:
        self.camera = camera
        self._site, self._step = site, step
        self._size: tuple[int, int] | None = None
        self._next = 0
        self._track_indices: dict[tuple[int, int], int] = {}
        """Index of each track, by the camera's boot and the tracker's number."""
        self._frames: list[Ints] = []
        self._track: list[Ints] = []
        self._boxes: list[Floats] = []
        self._moments: list[Ints] = [np.zeros(0, dtype=np.int64)]
        self._third: list[Ints] = [np.zeros(0, dtype=np.int64)]
        self._height: list[Floats] = [np.zeros(0)]

    def add(self, message: CameraTracks, start: int) -> None:
        """Add the newly final boxes of a window; ``start`` is the pulse of frame 0."""
        first, last = max(message.first, start + self._next), min(message.final_to, message.last)
        if last < first:
            return
        self._next = last + 1 - start
        self._size = message.size
        frames = message.last - message.first + 1
        boxes = unpack_boxes(track.boxes for track in message.tracks).reshape(len(message.tracks), frames, 4)
        boxes = boxes[:, first - message.first : last + 1 - message.first]
        track, frame = np.nonzero(~np.isnan(boxes[:, :, 0]))
        indices = [
            self._track_indices.setdefault((message.boot, track.id), len(self._track_indices))
            for track in message.tracks
        ]
        camera_boxes = Letterbox(message.size, self._site).boxes_site_to_camera(boxes[track, frame])
        self._frames.append(frame + first - start)
        self._track.append(np.array(indices, dtype=np.int64)[track])
        self._boxes.append(camera_boxes)
        self._sample(self._frames[-1], camera_boxes, message.size)

    def ignore_before(self, frame: int) -> None:
        """Ignore boxes before a frame, counted from the walk's start."""
        self._next = max(self._next, frame)

    @property
    def boxes(self) -> CameraBoxes | None:
        """All boxes, to calibrate from; None: the camera has reported no window."""
        if self._size is None:
            return None
        return CameraBoxes(
            self.camera,
            self._size,
            np.concatenate(self._frames).astype(np.int64).tobytes(),
            np.concatenate(self._track).tobytes(),
            np.concatenate(self._boxes).astype(np.float64).tobytes(),
        )

    @property
    def samples(self) -> WalkSamples:
        """The sampled boxes at the moments at which cameras are compared."""
        # Called every second: keep the concatenated arrays.
        self._moments, self._third = [np.concatenate(self._moments)], [np.concatenate(self._third)]
        self._height = [np.concatenate(self._height)]
        return WalkSamples(self._moments[0], self._third[0], self._height[0])

    def _sample(self, frames: Ints, boxes: Floats, size: tuple[int, int]) -> None:
        is_sampled = (frames % self._step == 0) & ~boxes_at_edge(boxes, size)
        sampled = boxes[is_sampled]
        self._moments.append(frames[is_sampled] // self._step)
        across = _THIRDS * foot_points(sampled)[:, 0] / size[0]
        self._third.append(np.clip(across.astype(np.int64), 0, _THIRDS - 1))
        self._height.append(sampled[:, 3] - sampled[:, 1])
