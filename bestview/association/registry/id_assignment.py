"""Assign person ids to clusters of tracklets: one id for each, by one linear assignment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy


def assign_ids(published: Sequence[Mapping[int, int]]) -> list[int]:
    """Assign an id to each of G clusters, 0 where none is left.

    The assignment maximizes the total number of frames that keep their published id.

    Args:
        published: for each cluster, frames by published id.
    """
    person_ids = sorted({person_id for frames in published for person_id in frames})
    assigned = [0] * len(published)
    if not person_ids:
        return assigned
    column = {person_id: i for i, person_id in enumerate(person_ids)}
    frames_kept = np.zeros((len(published), len(person_ids)))
    for group, frames in enumerate(published):
        for person_id, count in frames.items():
            frames_kept[group, column[person_id]] = count
    rows, columns = scipy.optimize.linear_sum_assignment(frames_kept, maximize=True)
    for group, at in zip(rows.tolist(), columns.tolist(), strict=True):
        if frames_kept[group, at] > 0:
            assigned[group] = person_ids[at]
    return assigned
