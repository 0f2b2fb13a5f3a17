"""The room from above, and what is in each half second of it: blobs, and who is really in which."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.temporal_consistency.blob_merges import NOBODY
from bestview import to_ground
from synthetic import CameraTruth, Scene
from tracking.baselines.temporal_consistency import BlobSettings
from tracking.baselines.temporal_consistency.blobs import Blob, BlobDetector
from tracking.baselines.temporal_consistency.window import Stage
from tracking.boxes import Floats
from tracking.detectors import Image

SIZE = (320, 240)
_EMPTY = 25
"""Pictures of the empty room, with their noise, that the background is learned from."""


@dataclass(frozen=True, slots=True)
class OverheadClip:
    """One sequence: so many people for so long."""

    people: int
    minutes: float
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class BlobSequence:
    """A sequence as it was seen.

    Attributes:
        stages: from the first in which everybody is alone.
        blobs: `(T, P)`, in which blob of its stage everybody really is.
        metre: pixels.
        seconds: what finding the blobs of all stages took.
    """

    clip: OverheadClip
    stages: tuple[Stage, ...]
    blobs: NDArray[np.int64]
    metre: float
    seconds: float


def played(clip: OverheadClip, stage_s: float, colours: Sequence[float] = (1.0,)) -> list[BlobSequence]:
    """Play a sequence, one picture a stage: what lies between is not looked at.

    Each picture is also seen with only a share of its colour, for each of `colours`.
    """
    scene = _scene(clip, clip.people, stage_s)
    empty = _scene(clip, 0, stage_s)
    eyes = [
        _BlobReader(scene.homography(0), [empty.image(0, it) for it in range(_EMPTY)], it) for it in colours
    ]
    for frame in range(round(clip.minutes * 60.0 / stage_s)):
        image, truth = scene.image(0, frame), scene.truth(frame)[0]
        for eye in eyes:
            eye.look(frame, image, truth, clip.people)
    return [
        BlobSequence(clip, tuple(eye.stages), np.stack(eye.rows), eye.finder.pixels_per_meter, eye.seconds)
        for eye in eyes
    ]


class _BlobReader:
    """Finds the blobs of pictures with a share of their colour, and says who is in which."""

    def __init__(self, homography: Floats | None, empty: Sequence[Image], colour: float) -> None:
        if homography is None:
            raise ValueError("people from above need a floor")
        across = np.array([[0.0, SIZE[1] / 2.0], [SIZE[0], SIZE[1] / 2.0]])
        left, right = to_ground(homography, across)
        self.finder = BlobDetector(SIZE, float(np.hypot(*(right - left))), BlobSettings())
        self._colour = colour
        self.finder.prepare([faded(image, colour) for image in empty])
        self.stages: list[Stage] = []
        self.rows: list[NDArray[np.int64]] = []
        self.seconds = 0.0

    def look(self, frame: int, image: Image, truth: CameraTruth, people: int) -> None:
        """Take a picture in; before everybody was alone once, nothing is kept of it."""
        began = time.perf_counter()
        found = self.finder.detect(faded(image, self._colour), learn=True)
        self.seconds += time.perf_counter() - began
        row = np.full(people, NOBODY, dtype=np.int64)
        for number, box in zip(truth.ids.tolist(), truth.boxes, strict=True):
            row[number - 1] = _blob_of(box, found)
        apart = len(set(row.tolist()) - {NOBODY}) == people
        if found and (self.rows or apart):
            self.stages.append(Stage(frame, found))
            self.rows.append(row)


def faded(image: Image, colour: float) -> Image:
    """Return a picture with a share of its colour, as bright as it was."""
    if colour == 1.0:
        return image
    grey = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    return np.asarray(cv2.addWeighted(image, colour, grey, 1.0 - colour, 0.0), dtype=np.uint8)


def _scene(clip: OverheadClip, people: int, stage_s: float) -> Scene:
    width, height = SIZE
    return Scene("overhead", 1, people, clip.seed, width, height, 1.0 / stage_s)


def _blob_of(box: Floats, found: tuple[Blob, ...]) -> int:
    """Return the blob that fills most of the middle of somebody's box."""
    middle, half = (box[:2] + box[2:]) / 2.0, (box[2:] - box[:2]) / 4.0
    core = np.rint(np.concatenate([middle - half, middle + half])).astype(int)
    filled = [_filled(blob, core) for blob in found]
    return int(np.argmax(filled)) if filled and max(filled) > 0 else NOBODY


def _filled(blob: Blob, core: NDArray[np.int64]) -> int:
    left, top = blob.box[:2].astype(int).tolist()
    part = blob.mask[
        max(core[1] - top, 0) : max(core[3] - top, 0), max(core[0] - left, 0) : max(core[2] - left, 0)
    ]
    return int(np.count_nonzero(part))
