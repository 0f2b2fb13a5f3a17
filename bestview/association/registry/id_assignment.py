"""Groups get the numbers they were told to be: one number for each, by one assignment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy


def named(told: Sequence[Mapping[int, int]]) -> list[int]:
    """Give each of G groups a number, 0 where none is left for it.

    In total as many frames as can be keep the number that they were told to have.

    Args:
        told: for each group, frames by the number told.
    """
    numbers = sorted({number for frames in told for number in frames})
    answer = [0] * len(told)
    if not numbers:
        return answer
    column = {number: i for i, number in enumerate(numbers)}
    kept = np.zeros((len(told), len(numbers)))
    for group, frames in enumerate(told):
        for number, count in frames.items():
            kept[group, column[number]] = count
    rows, columns = scipy.optimize.linear_sum_assignment(kept, maximize=True)
    for group, at in zip(rows.tolist(), columns.tolist(), strict=True):
        if kept[group, at] > 0:
            answer[group] = numbers[at]
    return answer
