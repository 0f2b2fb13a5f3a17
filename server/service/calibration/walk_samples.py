"""What one camera saw of a walk so far: everybody's boxes that will not change any more, by pulse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import foot_points
from bestview.calibration import Floats, boxes_at_edge
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from server.service.calibration.worker import CameraBoxes
from server.service.ingest.box_arrays import boxes_array

Ints = NDArray[np.int64]

_THIRDS = 3


@dataclass(frozen=True, slots=True)
class WalkSamples:
    """S whole boxes.

    Attributes:
        moment: (S,) when, counted in moments.
        third: (S,) in which third of the picture they stand, 0 to 2 from the left.
        tall: (S,) pixels.
    """

    moment: Ints
    third: Ints
    tall: Floats


class CameraWalk:
    """Collects one camera's words; ``site`` is the size of the site's picture, which boxes come in."""

    def __init__(self, camera: str, site: tuple[int, int], step: int) -> None:
        self.camera = camera
        self._site, self._step = site, step
        self._size: tuple[int, int] | None = None
        self._next = 0
        self._names: dict[tuple[int, int], int] = {}
        """What tracks are called here, by the camera's run and the tracker's number."""
        self._frames: list[Ints] = []
        self._who: list[Ints] = []
        self._boxes: list[Floats] = []
        self._moments: list[Ints] = [np.zeros(0, dtype=np.int64)]
        self._third: list[Ints] = [np.zeros(0, dtype=np.int64)]
        self._tall: list[Floats] = [np.zeros(0)]

    def add(self, message: CameraTracks, start: int) -> None:
        """Take in what is final of a word and was not before; ``start`` is the pulse that is frame 0."""
        first, last = max(message.first, start + self._next), min(message.final_to, message.last)
        if last < first:
            return
        self._next = last + 1 - start
        self._size = message.size
        frames = message.last - message.first + 1
        boxes = boxes_array(track.boxes for track in message.tracks).reshape(len(message.tracks), frames, 4)
        boxes = boxes[:, first - message.first : last + 1 - message.first]
        track, frame = np.nonzero(~np.isnan(boxes[:, :, 0]))
        names = [self._names.setdefault((message.boot, it.id), len(self._names)) for it in message.tracks]
        own = Letterbox(message.size, self._site).boxes_to_own(boxes[track, frame])
        self._frames.append(frame + first - start)
        self._who.append(np.array(names, dtype=np.int64)[track])
        self._boxes.append(own)
        self._sample(self._frames[-1], own, message.size)

    def pause(self, until: int) -> None:
        """Leave out what is seen before a frame."""
        self._next = max(self._next, until)

    @property
    def seen(self) -> CameraBoxes | None:
        """All of it, to be calibrated from; None: the camera has said nothing."""
        if self._size is None:
            return None
        return CameraBoxes(
            self.camera,
            self._size,
            np.concatenate(self._frames).astype(np.int64).tobytes(),
            np.concatenate(self._who).tobytes(),
            np.concatenate(self._boxes).astype(np.float64).tobytes(),
        )

    @property
    def samples(self) -> WalkSamples:
        """The whole boxes at the moments at which cameras are compared."""
        # Asked for every second: what was put together once is not put together again.
        self._moments, self._third = [np.concatenate(self._moments)], [np.concatenate(self._third)]
        self._tall = [np.concatenate(self._tall)]
        return WalkSamples(self._moments[0], self._third[0], self._tall[0])

    def _sample(self, frames: Ints, boxes: Floats, size: tuple[int, int]) -> None:
        taken = (frames % self._step == 0) & ~boxes_at_edge(boxes, size)
        whole = boxes[taken]
        self._moments.append(frames[taken] // self._step)
        across = _THIRDS * foot_points(whole)[:, 0] / size[0]
        self._third.append(np.clip(across.astype(np.int64), 0, _THIRDS - 1))
        self._tall.append(whole[:, 3] - whole[:, 1])
