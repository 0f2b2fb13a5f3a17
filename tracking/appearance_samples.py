"""Appearance samples: mean histograms of a track over runs of frames without occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, iou
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import AppearanceSample, WindowTrack

_MAX_OVERLAP = 0.2
"""Overlap (IoU) above which another object occludes the box, hidden ones included."""


def add_appearance_samples(
    tracks: Sequence[WindowTrack],
    states: Sequence[NDArray[np.int64]],
    first: int,
    final: Sequence[Detections],
) -> tuple[WindowTrack, ...]:
    """Return the tracks with how they look in the final frames of the window, of which `first` is the first.

    `states` are the observations that each of the tracks is in, frame by frame, -1 where hidden.
    """
    if not tracks:
        return ()
    boxes = np.stack([track.interpolated for track in tracks])[:, : len(final)]
    overlaps = np.nan_to_num(iou(boxes[:, None], boxes[None]))
    overlaps[np.arange(len(tracks)), np.arange(len(tracks))] = 0.0
    unoccluded = overlaps.max(axis=1) <= _MAX_OVERLAP
    return tuple(
        replace(track, appearance_samples=_samples_of_runs(visible, row, first, final))
        for track, visible, row in zip(tracks, unoccluded, states, strict=True)
    )


def _samples_of_runs(
    unoccluded: NDArray[np.bool_], states: NDArray[np.int64], first: int, final: Sequence[Detections]
) -> tuple[AppearanceSample, ...]:
    """Return one sample per run of consecutive unoccluded frames."""
    runs: list[tuple[int, list[Floats]]] = []
    for place, detections in enumerate(final):
        if not unoccluded[place] or states[place] == OCCLUDED or not detections.histograms.shape[1]:
            continue
        histogram = detections.histograms[states[place]]
        if runs and runs[-1][0] + len(runs[-1][1]) == first + place:
            runs[-1][1].append(histogram)
        else:
            runs.append((first + place, [histogram]))
    return tuple(AppearanceSample(at, at + len(run) - 1, np.mean(run, axis=0)) for at, run in runs)
