"""Oracle association: the upper bound of tracking on given detections."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tracking.assignment import assign_pairs
from tracking.boxes import BOX_SIDES, iou
from tracking.evaluation.track_scores import DEFAULT_MIN_IOU
from tracking.motchallenge import MotRow


def oracle_association(
    detections: Iterable[MotRow], truth: Iterable[MotRow], min_iou: float = DEFAULT_MIN_IOU
) -> list[MotRow]:
    """Return the detections with the id of the person they match; drop the unmatched ones.

    In each frame people and detections are assigned for the largest total overlap, none below `min_iou`. A
    tracker on these detections cannot score higher unless it adds boxes.
    """
    people = _by_frame(row for row in truth if row.confidence != 0.0)
    tracks: list[MotRow] = []
    for number, found in _by_frame(detections).items():
        present = people.get(number, [])
        similarity = iou(_boxes(present)[:, None], _boxes(found)[None])
        rows, columns = assign_pairs(similarity, min_iou)
        tracks += [replace(found[c], id=present[r].id) for r, c in zip(rows, columns, strict=True)]
    return tracks


def _by_frame(rows: Iterable[MotRow]) -> dict[int, list[MotRow]]:
    frames: dict[int, list[MotRow]] = {}
    for row in rows:
        frames.setdefault(row.frame, []).append(row)
    return frames


def _boxes(rows: list[MotRow]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([row.box for row in rows], dtype=np.float64).reshape(-1, BOX_SIDES)
