"""The overhead room: its blobs each half second, and the true blob of each person."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.temporal_consistency.blob_merges import NO_BLOB
from bestview import to_ground
from synthetic import CameraTruth, Scene
from tracking.baselines.temporal_consistency import BlobSettings
from tracking.baselines.temporal_consistency.blobs import Blob, BlobDetector
from tracking.baselines.temporal_consistency.window import Stage
from tracking.boxes import Floats
from tracking.detectors import Image

SIZE = (320, 240)
_EMPTY = 25
"""Noisy pictures of the empty room for the background model."""


@dataclass(frozen=True, slots=True)
class OverheadClip:
    """A sequence: number of people, length and seed."""

    people: int
    minutes: float
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class BlobSequence:
    """The blobs of a sequence.

    Attributes:
        stages: from the first stage in which all people are alone.
        blobs: `(T, P)`, the true blob of each person in each stage.
        pixels_per_meter: pixels per meter.
        seconds: processing time of detection, all stages.
    """

    clip: OverheadClip
    stages: tuple[Stage, ...]
    blobs: NDArray[np.int64]
    pixels_per_meter: float
    seconds: float


def render_sequence(
    clip: OverheadClip, stage_s: float, saturations: Sequence[float] = (1.0,)
) -> list[BlobSequence]:
    """Render a sequence, one picture per stage, and detect its blobs at each color saturation."""
    scene = _scene(clip, clip.people, stage_s)
    empty = _scene(clip, 0, stage_s)
    readers = [
        _BlobReader(scene.homography(0), [empty.image(0, frame) for frame in range(_EMPTY)], saturation)
        for saturation in saturations
    ]
    for frame in range(round(clip.minutes * 60.0 / stage_s)):
        image, truth = scene.image(0, frame), scene.truth(frame)[0]
        for reader in readers:
            reader.add(frame, image, truth, clip.people)
    return [
        BlobSequence(
            clip,
            tuple(reader.stages),
            np.stack(reader.rows),
            reader.detector.pixels_per_meter,
            reader.seconds,
        )
        for reader in readers
    ]


class _BlobReader:
    """Detects the blobs of pictures at a color saturation, and assigns the true people to them."""

    def __init__(self, homography: Floats | None, empty: Sequence[Image], saturation: float) -> None:
        if homography is None:
            raise ValueError("the overhead scene needs a homography")
        middle_line = np.array([[0.0, SIZE[1] / 2.0], [SIZE[0], SIZE[1] / 2.0]])
        left, right = to_ground(homography, middle_line)
        self.detector = BlobDetector(SIZE, float(np.hypot(*(right - left))), BlobSettings())
        self._saturation = saturation
        self.detector.prepare([desaturated(image, saturation) for image in empty])
        self.stages: list[Stage] = []
        self.rows: list[NDArray[np.int64]] = []
        self.seconds = 0.0

    def add(self, frame: int, image: Image, truth: CameraTruth, people: int) -> None:
        """Add a picture; stages before all people are alone for the first time are dropped."""
        began = time.perf_counter()
        found = self.detector.detect(desaturated(image, self._saturation), learn=True)
        self.seconds += time.perf_counter() - began
        row = np.full(people, NO_BLOB, dtype=np.int64)
        for number, box in zip(truth.ids.tolist(), truth.boxes, strict=True):
            row[number - 1] = _blob_index(box, found)
        all_alone = len(set(row.tolist()) - {NO_BLOB}) == people
        if found and (self.rows or all_alone):
            self.stages.append(Stage(frame, found))
            self.rows.append(row)


def desaturated(image: Image, saturation: float) -> Image:
    """Return a picture at a color saturation, with the same brightness."""
    if saturation == 1.0:
        return image
    gray = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    return np.asarray(cv2.addWeighted(image, saturation, gray, 1.0 - saturation, 0.0), dtype=np.uint8)


def _scene(clip: OverheadClip, people: int, stage_s: float) -> Scene:
    width, height = SIZE
    return Scene("overhead", 1, people, clip.seed, width, height, 1.0 / stage_s)


def _blob_index(box: Floats, found: tuple[Blob, ...]) -> int:
    """Return the blob that fills most of the center of a person's box."""
    middle, half = (box[:2] + box[2:]) / 2.0, (box[2:] - box[:2]) / 4.0
    core = np.rint(np.concatenate([middle - half, middle + half])).astype(int)
    filled = [_filled(blob, core) for blob in found]
    return int(np.argmax(filled)) if filled and max(filled) > 0 else NO_BLOB


def _filled(blob: Blob, core: NDArray[np.int64]) -> int:
    left, top = blob.box[:2].astype(int).tolist()
    part = blob.mask[
        max(core[1] - top, 0) : max(core[3] - top, 0), max(core[0] - left, 0) : max(core[2] - left, 0)
    ]
    return int(np.count_nonzero(part))
