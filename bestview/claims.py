"""What persons are worth to tracks, where that can be more than nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.grouping_problem import GroupingProblem, Links
from bestview.ragged import Groups, ranges

FORBIDDEN = -1e6
VACANT = 0.01
"""What an otherwise empty person is worth to a track: more than a new one, so that numbers are kept."""
_OWN = 0.02
"""What staying is worth to a track that nothing else holds."""


@dataclass(frozen=True, slots=True)
class Claims:
    """C claims of tracks on persons, sorted by track and person: on their own, and on those they look like.

    Attributes:
        track: (C,).
        person: (C,).
        mine: (C,) bool, the track's person so far.
        seen: (C,) bool, another camera sees the person just now.
        worth: (C,) what the person is worth to the track.
    """

    track: NDArray[np.int64]
    person: NDArray[np.int64]
    mine: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    worth: NDArray[np.float64]

    def of(self, rows: NDArray[np.int64]) -> Claims:
        """Give the claims of the tracks from the first to the last of `rows`."""
        mine = slice(*np.searchsorted(self.track, [rows[0], rows[-1] + 1]).tolist())
        return Claims(self.track[mine], self.person[mine], self.mine[mine], self.seen[mine], self.worth[mine])


def claims(
    problem: GroupingProblem, links: Links, person: NDArray[np.int64], rows: NDArray[np.int64]
) -> Claims:
    """Give the claims of some present tracks, (R,) rising, on the persons, (T,) as grouped so far, 0 .. K-1.

    What a person is worth is the evidence of the tracks that speak: those other cameras see just now, and
    those lost in the same camera, which speak for their heirs.
    """
    which, at = ranges(links.start[rows], links.start[rows + 1] - links.start[rows])
    track, other = rows[which], links.other[at]
    speaks = _speaks(problem, track, other)
    count = int(person.max()) + 1
    code = np.concatenate([track[speaks] * count + person[other[speaks]], rows * count + person[rows]])
    track, whom = np.divmod(np.unique(code), count)

    asked = np.zeros(count, dtype=np.bool_)
    asked[whom] = True
    members = np.flatnonzero(asked[person])
    which, at = Groups.of(person[members], count).members(whom)
    other = members[at]
    speaks = _speaks(problem, track[which], other)
    which, other = which[speaks], other[speaks]
    own_camera = problem.camera[track[which]] == problem.camera[other]
    evidence = problem.pairs.between(track[which], other)
    rival = own_camera & problem.pairs.rivals.between(track[which], other)

    def total(weights: NDArray[np.float64] | NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.bincount(which, weights, minlength=track.size).astype(np.float64)

    support, mine = total(evidence), person[track] == whom
    seen = total(~own_camera) > 0
    inhabited = seen | (total(evidence * own_camera) > 0)
    worth = np.where(inhabited & (total(rival) == 0), support - problem.join, FORBIDDEN)
    worth = np.where(mine, support + problem.hold[track] + _OWN, worth)
    return Claims(track, whom, mine, seen, worth)


def _speaks(
    problem: GroupingProblem, track: NDArray[np.int64], other: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Say of (P,) pairs whether the `other` has a say in whose the present `track` is."""
    own_camera = problem.camera[track] == problem.camera[other]
    return np.asarray(problem.present[other] != own_camera)


def unsettled_cameras(problem: GroupingProblem, some: Claims) -> NDArray[np.bool_]:
    """Say of each camera whether an assignment of its tracks might be better than each staying whose it is.

    It cannot where their own persons are worth more to all of them than any other. `some` has all claims of
    a camera's present tracks, or none.
    """
    tracks = problem.camera.size
    own, best = np.full(tracks, np.inf), np.full(tracks, VACANT)
    own[some.track[some.mine]] = some.worth[some.mine]
    np.maximum.at(best, some.track[~some.mine], some.worth[~some.mine])
    unsettled = np.zeros(int(problem.camera.max(initial=-1)) + 1, dtype=np.bool_)
    unsettled[problem.camera[own <= best]] = True
    # Two tracks of one camera cannot both stay with one person.
    track, whom = some.track[some.mine], some.person[some.mine]
    order = np.lexsort((whom, problem.camera[track]))
    camera, whom = problem.camera[track][order], whom[order]
    unsettled[camera[1:][(camera[1:] == camera[:-1]) & (whom[1:] == whom[:-1])]] = True
    return unsettled
