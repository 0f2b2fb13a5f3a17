"""Appearance histograms: mean histograms of a track over runs of frames without occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, iou
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import AppearanceHistogram, WindowTrack

_MAX_OVERLAP = 0.2
"""Overlap (IoU) above which another object, itself occluded or not, occludes the box."""


def add_appearance_histograms(
    tracks: Sequence[WindowTrack],
    states: Sequence[NDArray[np.int64]],
    first: int,
    final: Sequence[Detections],
) -> tuple[WindowTrack, ...]:
    """Return the tracks with the appearance histograms of the window's final frames, which begin at `first`.

    `states`: for each track the index of its detection in each frame, -1 where occluded.
    """
    if not tracks:
        return ()
    boxes = np.stack([track.interpolated for track in tracks])[:, : len(final)]
    overlaps = np.nan_to_num(iou(boxes[:, None], boxes[None]))
    overlaps[np.arange(len(tracks)), np.arange(len(tracks))] = 0.0
    unoccluded = overlaps.max(axis=1) <= _MAX_OVERLAP
    return tuple(
        replace(track, appearance_histograms=_mean_histograms_of_runs(visible, row, first, final))
        for track, visible, row in zip(tracks, unoccluded, states, strict=True)
    )


def _mean_histograms_of_runs(
    unoccluded: NDArray[np.bool_], states: NDArray[np.int64], first: int, final: Sequence[Detections]
) -> tuple[AppearanceHistogram, ...]:
    """Return the mean histogram of each run of consecutive unoccluded frames."""
    runs: list[tuple[int, list[Floats]]] = []
    for offset, detections in enumerate(final):
        if not unoccluded[offset] or states[offset] == OCCLUDED or not detections.histograms.shape[1]:
            continue
        histogram = detections.histograms[states[offset]]
        if runs and runs[-1][0] + len(runs[-1][1]) == first + offset:
            runs[-1][1].append(histogram)
        else:
            runs.append((first + offset, [histogram]))
    return tuple(
        AppearanceHistogram(start, start + len(run) - 1, np.mean(run, axis=0)) for start, run in runs
    )
