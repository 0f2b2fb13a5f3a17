"""Alignment of two cameras, and how far it can be trusted: by chance, and in parts of the walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.homography import Floats
from bestview.calibration.pair_search import (
    CameraHypotheses,
    PairAlignment,
    comparison_pulses,
    find_best_alignment,
    measure_alignment,
)
from bestview.calibration.samples import sample_walk
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk, halves_swapped, time_reversed

_PARTS = 4
"""Parts of the walk; each is compared with the alignment from the others."""
_UNDECIDED_PLACES = 1.0
"""Added to what is compared, so that a part where hardly anybody walks decides nothing."""


def align_pair(
    one: CameraHypotheses, other: CameraHypotheses, settings: WalkSettings
) -> PairAlignment | None:
    """Align two cameras; None: they have no samples of the same pulse."""
    pulses = comparison_pulses((one.walk, other.walk), settings)
    best = find_best_alignment(one, other, pulses, settings)
    # The costly comparisons are of no use to a pair that is rejected anyway.
    if best is None or best.rejection(settings) is not None:
        return best
    by_chance = [
        find_best_alignment(one, replace(other, walk=walk), pulses, settings)
        for walk in (time_reversed(other.walk), halves_swapped(other.walk))
    ]
    return replace(
        best,
        chance=max((alignment.merit for alignment in by_chance if alignment is not None), default=0.0),
        held_out=_held_out_agreement(one, other, best, pulses, settings),
    )


def _held_out_agreement(
    one: CameraHypotheses,
    other: CameraHypotheses,
    alignment: PairAlignment,
    pulses: Floats,
    settings: WalkSettings,
) -> float:
    """Return what is left of an alignment's merit in the part of the walk that the rest predicts worst.

    The best of many alignments agrees with the walk in which it was found, right or wrong. In a part of the
    walk that had no say, a wrong one meets other people, elsewhere.
    """
    walks = one.walk, other.walk
    part = _parts_of_walk(*walks, float(alignment.rig.offsets[1]), pulses, settings)
    kept = []
    for number in range(_PARTS):
        within, rest = pulses[part == number], pulses[part != number]
        found = find_best_alignment(one, other, rest, settings)
        expected, predicted = (
            0.0 if known is None else measure_alignment(*walks, known.rig, within, settings).merit
            for known in (alignment, found)
        )
        kept.append((predicted + _UNDECIDED_PLACES) / (expected + _UNDECIDED_PLACES))
    return min(kept)


def _parts_of_walk(
    one: Walk, other: Walk, offset: float, pulses: Floats, settings: WalkSettings
) -> NDArray[np.intp]:
    """Return the part of each pulse; people walk as far in each, where both cameras have some at a time."""
    here = sample_walk(one, pulses, 0.0, settings.step, settings.stride)
    there = sample_walk(other, pulses, offset, settings.step, settings.stride)
    common = np.isin(here.times, there.times)
    times, weight = here.times[common], here.weight[common]
    order = np.argsort(times, kind="stable")
    walked = weight[order].cumsum()
    ends = np.searchsorted(walked, walked[-1] * np.arange(1, _PARTS) / _PARTS)
    return np.searchsorted(times[order][ends], pulses, "right")
