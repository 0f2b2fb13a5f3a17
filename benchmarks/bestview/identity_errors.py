"""Identity errors between cameras at the same time, and in one camera over time."""

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
    """Pairwise scores of identities.

    Attributes:
        recall: of the pairs of boxes on one person, the share with one id; NaN without any.
        precision: of the pairs of boxes with one id, the share on one person; NaN without any.
    """

    recall: float
    precision: float


@dataclass(frozen=True, slots=True, eq=False)
class MatchedBoxes:
    """The boxes that are matched to a person.

    Attributes:
        camera: (N,) index of the camera.
        frame: (N,) frame number.
        person: (N,) true identity.
        number: (N,) id of the box.
    """

    camera: Ints
    frame: Ints
    person: Ints
    number: Ints

    @classmethod
    def of(cls, tracks: Rows, gt: Rows, least_iou: float) -> MatchedBoxes:
        """Match boxes to people: at most one box for each person and frame, for the largest total overlap.

        Raises:
            ValueError: an id occurs twice in one frame of a camera.
        """
        found: list[tuple[int, int, int, int]] = []
        for camera, (name, truth) in enumerate(sorted(gt.items())):
            numbers = sorted({row.frame for rows in (truth, tracks[name]) for row in rows})
            for number, match in zip(numbers, align_frames(truth, tracks[name], least_iou), strict=True):
                rows, columns = assign_pairs(match.similarity, least_iou)
                pairs = zip(match.truth[rows].tolist(), match.tracks[columns].tolist(), strict=True)
                found += [(camera, number, person, track) for person, track in pairs]
        return cls(*np.array(found, dtype=np.int64).reshape(-1, 4).T)

    def across_cameras(self) -> PairScores:
        """Compare boxes of different cameras, frame by frame."""
        people = _pairs(self.frame, self.person)
        numbers = _pairs(self.frame, self.number)
        return _pair_scores(people, numbers, _pairs(self.frame, self.person, self.number))

    def over_time(self, frames: int) -> PairScores:
        """Compare boxes of the same camera at a distance in frames."""
        people = self._count_over_time(frames, self.person)
        numbers = self._count_over_time(frames, self.number)
        return _pair_scores(people, numbers, self._count_over_time(frames, self.person, self.number))

    def _count_over_time(self, frames: int, *labels: Ints) -> int:
        """Count the boxes whose labels occur in the same camera again `frames` later."""
        now = set(_rows(self.camera, self.frame, *labels))
        return len(now.intersection(_rows(self.camera, self.frame + frames, *labels)))


def _pair_scores(people: int, numbers: int, both: int) -> PairScores:
    return PairScores(both / people if people else np.nan, both / numbers if numbers else np.nan)


def _pairs(*labels: Ints) -> int:
    """Count the pairs of boxes with all these labels in common."""
    return sum(count * (count - 1) // 2 for count in Counter(_rows(*labels)).values())


def _rows(*labels: Ints) -> Iterator[tuple[int, ...]]:
    return zip(*(name.tolist() for name in labels), strict=True)
