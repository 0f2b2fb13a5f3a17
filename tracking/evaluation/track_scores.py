"""Scores of tracks against ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import motrics

from tracking.evaluation.frame_matching import FrameSimilarity, align_frames, match_frames
from tracking.motchallenge import MotRow

DEFAULT_MIN_IOU = 0.5
"""Overlap (IoU) from which a box matches a person, as in MOTChallenge."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Evaluation scores of tracks. Shares are in [0, 1], 1 is perfect; MOTA may be negative.

    Attributes:
        hota: higher order tracking accuracy: the mean over overlaps of .05 to .95 of the geometric mean
            of `deta` and `assa` (Luiten et al., IJCV 2021).
        deta: detection accuracy, the same mean.
        assa: association accuracy, the same mean.
        mota: 1 minus misses, false positives and switches, per person and frame (CLEAR MOT, Bernardin and
            Stiefelhagen, 2008).
        idf1: F1 score of the boxes under the best one-to-one assignment of tracks and people over the whole
            recording (Ristani et al., 2016).
        recall: share of people's boxes that are matched.
        precision: share of tracks' boxes that are matched.
        switches: how often a person is matched with another track than before.
        fragments: how often a person is matched again after a gap.
        misses: people's boxes that are not matched.
        false_positives: tracks' boxes that are not matched.
        objects: number of people in the ground truth.
        tracks: number of tracks.
    """

    hota: float
    deta: float
    assa: float
    mota: float
    idf1: float
    recall: float
    precision: float
    switches: int
    fragments: int
    misses: int
    false_positives: int
    objects: int
    tracks: int


def evaluate(truth: Iterable[MotRow], tracks: Iterable[MotRow], min_iou: float = DEFAULT_MIN_IOU) -> Scores:
    """Score the tracks of one camera.

    Args:
        truth: rows whose confidence is 0 do not count; see `align_frames`.
        tracks: rows to score.
        min_iou: overlap from which a box matches a person, for all scores but HOTA.

    Raises:
        ValueError: an id occurs twice in one frame.
    """
    return score_frames(align_frames(truth, tracks, min_iou), min_iou)


def score_frames(frames: Sequence[FrameSimilarity], min_iou: float) -> Scores:
    """Score aligned frames."""
    people = [frame.truth.tolist() for frame in frames]
    found = [frame.tracks.tolist() for frame in frames]
    overlaps = [frame.similarity.tolist() for frame in frames]
    pairs = [matrix.astype(float).tolist() for matrix in match_frames(frames, min_iou)]
    hota = motrics.compute_hota_from_similarity(people, found, overlaps)
    identity = motrics.compute_identity_from_similarity(people, found, overlaps, min_iou)
    clear = motrics.compute_clear_from_similarity(people, found, pairs)
    return Scores(
        hota=hota.hota,
        deta=hota.deta,
        assa=hota.assa,
        mota=clear.mota,
        idf1=identity.idf1,
        recall=clear.clr_re,
        precision=clear.clr_pr,
        switches=clear.num_switches,
        fragments=clear.frag,
        misses=clear.num_misses,
        false_positives=clear.num_false_positives,
        objects=len({number for frame in people for number in frame}),
        tracks=len({number for frame in found for number in frame}),
    )


HEADINGS = {
    "hota": "HOTA",
    "deta": "DetA",
    "assa": "AssA",
    "mota": "MOTA",
    "idf1": "IDF1",
    "recall": "Rcll",
    "precision": "Prcn",
    "switches": "IDSW",
    "fragments": "Frag",
    "objects": "GT",
    "tracks": "IDs",
}
"""MOTChallenge's column headings by score name, in table order."""


def format_scores(scores: Scores, names: Iterable[str]) -> list[str]:
    """Return some of the scores as text: counts as they are, shares in percent."""
    values = (getattr(scores, name) for name in names)
    return [f"{value}" if isinstance(value, int) else f"{100.0 * value:.1f}" for value in values]
