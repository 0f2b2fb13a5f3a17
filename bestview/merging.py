"""Persons whose tracks belong together as a whole become one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.grouping_problem import GroupingProblem, Links
from bestview.ragged import Groups, ranges

Persons = NDArray[np.int64]


def merge_wholes(problem: GroupingProblem, links: Links, person: Persons) -> None:
    """Merge persons, strongest first, while anything is won; changes `person`, (T,) 0 .. K-1, in place.

    Two persons win the evidence between their present tracks, less what it takes to join and what holds
    the less held of the two. Persons that were seen side by side are not merged.
    """
    speaks = problem.present[links.track] & problem.present[links.other]
    linked = _linked(person, links.track[speaks], links.other[speaks])
    gain = _gains(problem, person, linked)
    while gain.size and gain.max() > 0:
        # Ties: the lowest persons.
        keep, lose = linked[:, int(np.argmax(gain))]
        person[person == lose] = keep
        rest = (linked != keep).all(axis=0) & (linked != lose).all(axis=0)
        near = linked[:, ~rest]
        anew = np.unique(near[(near != keep) & (near != lose)])
        pairs = np.stack([np.minimum(anew, keep), np.maximum(anew, keep)])
        linked = np.concatenate([linked[:, rest], pairs], axis=1)
        gain = np.concatenate([gain[rest], _gains(problem, person, pairs)])
        order = np.lexsort((linked[1], linked[0]))
        linked, gain = linked[:, order], gain[order]


def _linked(person: Persons, track: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of different persons that (N,) pairs of tracks link: (2, L), the first lower, sorted."""
    one, two = person[track], person[other]
    count = int(person.max(initial=0)) + 1
    code = np.unique((one * count + two)[one < two])
    return np.stack(np.divmod(code, count))


def _gains(problem: GroupingProblem, person: Persons, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """What merging (2, L) pairs of persons wins: (L,), -inf where they are two people for sure."""
    groups = Groups.of(person, int(person.max(initial=0)) + 1)
    which, one, two = _cross(groups, pairs)
    spoken = problem.present[one] & problem.present[two]
    evidence = problem.pairs.between(one[spoken], two[spoken])
    won = np.bincount(which[spoken], evidence, minlength=pairs.shape[1])
    held = _held(problem, groups, pairs[0]), _held(problem, groups, pairs[1])
    gain = np.asarray(won - (problem.join + np.minimum(*held)), dtype=np.float64)
    # Who is seen at once with whom, now or ever.
    at_once = spoken & (problem.camera[one] == problem.camera[two])
    gain[which[at_once | problem.pairs.rivals.between(one, two)]] = -np.inf
    return gain


def _cross(
    groups: Groups, pairs: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """All pairs of tracks between (2, L) pairs of persons: which of the L, one's track, the other's."""
    which, one = groups.members(pairs[0])
    other = pairs[1][which]
    repeat, at = ranges(groups.start[other], groups.count(other))
    return which[repeat], one[repeat], groups.items[at]


def _held(problem: GroupingProblem, groups: Groups, persons: NDArray[np.int64]) -> NDArray[np.float64]:
    """What holds (L,) persons: the hold of their best held present track, or 0."""
    which, track = groups.members(persons)
    held = np.zeros(persons.size)
    np.maximum.at(held, which, np.where(problem.present[track], problem.hold[track], 0.0))
    return held
