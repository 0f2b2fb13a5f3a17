"""Merges of people into one blob, and identity errors after they part.

People are merged while two or more share one difference blob (Khalaf and Intille, section 4.1). A merge of n
people has n chances of a wrong id afterwards.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

NO_BLOB = -1
"""The blob number of a person without a blob."""


@dataclass(frozen=True, slots=True)
class PersonMerge:
    """A person's stages in a merge, and alone before and after it: half-open ranges."""

    person: int
    before: tuple[int, int]
    inside: tuple[int, int]
    after: tuple[int, int]


def find_merges(blobs: NDArray[np.int64]) -> list[PersonMerge]:
    """Return the merges that begin and end in a recording, one for each person, by `(T, P)` blobs."""
    return [merge for person in range(blobs.shape[1]) for merge in _merges_of(person, _alone(blobs, person))]


def count_merges(found: Sequence[PersonMerge], blobs: NDArray[np.int64]) -> int:
    """Count the distinct merges: people in one blob at one time are in the same merge."""
    groups = list(range(len(found)))
    first_in_blob: dict[tuple[int, int], int] = {}
    for index, merge in enumerate(found):
        for stage in range(*merge.inside):
            first = first_in_blob.setdefault((stage, int(blobs[stage, merge.person])), index)
            old, new = groups[index], groups[first]
            groups = [new if group == old else group for group in groups]
    return len(set(groups))


def count_wrong_ids(
    found: Sequence[PersonMerge], blobs: NDArray[np.int64], tracked: Sequence[Mapping[int, int]]
) -> list[bool]:
    """Return the merges after which a person has another id; `tracked` are the blobs by id of each stage.

    A person's id is the most frequent one in their blob while they are alone, before and after. A person
    without an id before is not counted.
    """
    wrong = []
    for merge in found:
        before = _most_frequent_id(merge.person, merge.before, blobs, tracked)
        wrong.append(
            before is not None and before != _most_frequent_id(merge.person, merge.after, blobs, tracked)
        )
    return wrong


def _most_frequent_id(
    person: int, stages: tuple[int, int], blobs: NDArray[np.int64], tracked: Sequence[Mapping[int, int]]
) -> int | None:
    counts = Counter(
        number for t in range(*stages) for number, blob in tracked[t].items() if blob == blobs[t, person]
    )
    # Ties go to the lowest id.
    return min(counts, key=lambda number: (-counts[number], number)) if counts else None


def _alone(blobs: NDArray[np.int64], person: int) -> list[bool | None]:
    """Return for each stage whether a person is alone in their blob; None if they have no blob."""
    own_blobs = blobs[:, person]
    people = (blobs == own_blobs[:, None]).sum(axis=1)
    return [
        None if blob == NO_BLOB else bool(count == 1)
        for blob, count in zip(own_blobs.tolist(), people.tolist(), strict=True)
    ]


def _merges_of(person: int, alone: Sequence[bool | None]) -> Iterator[PersonMerge]:
    """Return a person's runs of stages in merges that lie between two runs alone."""
    known = [(stage, state) for stage, state in enumerate(alone) if state is not None]
    runs = [(state, list(run)) for state, run in groupby(known, key=lambda pair: pair[1])]
    spans = [(state, (run[0][0], run[-1][0] + 1)) for state, run in runs]
    for (_, before), ((state, inside), (_, after)) in zip(spans, pairwise(spans[1:]), strict=False):
        if state is False:
            yield PersonMerge(person, before, inside, after)
