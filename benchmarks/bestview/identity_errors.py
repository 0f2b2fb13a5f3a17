"""Where who is who goes wrong: between cameras at one moment, or in a camera from one moment to the next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.camera_tracks import Rows
from tracking.assignment import assign_pairs
from tracking.evaluation.frame_matching import align_frames

Ints = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


@dataclass(frozen=True, slots=True)
class PairScores:
    """What numbers are worth where there are two boxes to compare.

    Attributes:
        whole: of the pairs of boxes at one person, the share that have one number; NaN where none are.
        pure: of the pairs of boxes that have one number, the share that are at one person; likewise.
    """

    whole: float
    pure: float


@dataclass(frozen=True, slots=True, eq=False)
class MatchedBoxes:
    """The boxes that are at somebody.

    Attributes:
        camera: (N,) in which camera's picture.
        frame: (N,) when.
        person: (N,) at whom.
        number: (N,) whom the box is said to show.
    """

    camera: Ints
    frame: Ints
    person: Ints
    number: Ints

    @classmethod
    def of(cls, tracks: Rows, gt: Rows, least_iou: float) -> MatchedBoxes:
        """Find them: in each frame one box for a person at most, for the largest total overlap.

        Raises:
            ValueError: an id is twice in one frame of a camera.
        """
        found: list[tuple[int, int, int, int]] = []
        for camera, (name, truth) in enumerate(sorted(gt.items())):
            numbers = sorted({row.frame for rows in (truth, tracks[name]) for row in rows})
            for number, it in zip(numbers, align_frames(truth, tracks[name], least_iou), strict=True):
                rows, columns = assign_pairs(it.similarity, least_iou)
                pairs = zip(it.truth[rows].tolist(), it.tracks[columns].tolist(), strict=True)
                found += [(camera, number, person, track) for person, track in pairs]
        return cls(*np.array(found, dtype=np.int64).reshape(-1, 4).T)

    def at_once(self) -> PairScores:
        """Compare the cameras with each other, frame by frame."""
        people = _pairs(self.frame, self.person)
        numbers = _pairs(self.frame, self.number)
        return _pair_scores(people, numbers, _pairs(self.frame, self.person, self.number))

    def later(self, frames: int) -> PairScores:
        """Compare each camera with itself so many frames later."""
        people = self._still(frames, self.person)
        numbers = self._still(frames, self.number)
        return _pair_scores(people, numbers, self._still(frames, self.person, self.number))

    def _still(self, frames: int, *names: Ints) -> int:
        """Count what has these names and is there in the same camera so many frames later."""
        now = set(_rows(self.camera, self.frame, *names))
        return len(now.intersection(_rows(self.camera, self.frame + frames, *names)))


def _pair_scores(people: int, numbers: int, both: int) -> PairScores:
    return PairScores(both / people if people else np.nan, both / numbers if numbers else np.nan)


def _pairs(*names: Ints) -> int:
    """Count the pairs that have all of these in common."""
    return sum(count * (count - 1) // 2 for count in Counter(_rows(*names)).values())


def _rows(*names: Ints) -> Iterator[tuple[int, ...]]:
    return zip(*(name.tolist() for name in names), strict=True)
