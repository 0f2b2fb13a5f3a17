"""Merges: who was in one blob with whom, and whether everybody is themselves again when they part.

People are merged while the difference blobs of two or more of them are one (Khalaf and Intille, section 4.1).
A merge of n people is n chances to take somebody for somebody else afterwards.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

NOBODY = -1
"""The blob of somebody who is in none."""


@dataclass(frozen=True, slots=True)
class PersonMerge:
    """One person's time in a merge, between two times alone: stages, the last ones excluded."""

    person: int
    before: tuple[int, int]
    inside: tuple[int, int]
    after: tuple[int, int]


def merged(blobs: NDArray[np.int64]) -> list[PersonMerge]:
    """Find the merges that begin and end in a recording, one for each person in each, by `(T, P)` blobs."""
    return [it for person in range(blobs.shape[1]) for it in _of(person, _alone(blobs, person))]


def events(found: Sequence[PersonMerge], blobs: NDArray[np.int64]) -> int:
    """Count the merges: people who are in one blob at one time are in the same one."""
    group = list(range(len(found)))
    at: dict[tuple[int, int], int] = {}
    for place, it in enumerate(found):
        for stage in range(*it.inside):
            first = at.setdefault((stage, int(blobs[stage, it.person])), place)
            old, new = group[place], group[first]
            group = [new if name == old else name for name in group]
    return len(set(group))


def mistaken(
    found: Sequence[PersonMerge], blobs: NDArray[np.int64], told: Sequence[Mapping[int, int]]
) -> list[bool]:
    """Return who of those merged is somebody else afterwards; `told` are the blobs by number of each stage.

    Somebody's number is the one that is in their blob in most of the stages in which they are alone, before
    and after. Who had none before cannot lose it.
    """
    wrong = []
    for it in found:
        before = _number(it.person, it.before, blobs, told)
        wrong.append(before is not None and before != _number(it.person, it.after, blobs, told))
    return wrong


def _number(
    person: int, stages: tuple[int, int], blobs: NDArray[np.int64], told: Sequence[Mapping[int, int]]
) -> int | None:
    counts = Counter(
        number for t in range(*stages) for number, blob in told[t].items() if blob == blobs[t, person]
    )
    # Of equally frequent ones the lowest, whatever came first.
    return min(counts, key=lambda number: (-counts[number], number)) if counts else None


def _alone(blobs: NDArray[np.int64], person: int) -> list[bool | None]:
    """Return for each stage whether a person has a blob of their own; None: no blob."""
    mine = blobs[:, person]
    sharing = (blobs == mine[:, None]).sum(axis=1)
    return [
        None if blob == NOBODY else bool(count == 1)
        for blob, count in zip(mine.tolist(), sharing.tolist(), strict=True)
    ]


def _of(person: int, alone: Sequence[bool | None]) -> Iterator[PersonMerge]:
    """Cut a person's time into runs, and give those in merges that lie between two alone."""
    known = [(stage, state) for stage, state in enumerate(alone) if state is not None]
    runs = [(state, list(run)) for state, run in groupby(known, key=lambda it: it[1])]
    spans = [(state, (run[0][0], run[-1][0] + 1)) for state, run in runs]
    for (_, before), ((state, inside), (_, after)) in zip(spans, pairwise(spans[1:]), strict=False):
        if state is False:
            yield PersonMerge(person, before, inside, after)
