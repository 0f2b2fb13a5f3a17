"""Identity links across a split by maximum a posteriori (Todor 2009, sections 7.2, 7.3).

The graph is that of Nillius, Sullivan and Carlsson (CVPR 2006): its nodes are tracks of one or several
people, its links the merges and splits between them. A split of N people into m tracks of n_i people has `Π
C(N - n_1 - … - n_{i-1}, n_i)` states. Here one person leaves at a time: two tracks, N states. The
probability of a state is the product of `exp(-λ I)` over the single-person tracks that it links, where I is
their appearance distance, combined with a motion distance if they are close in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.appearance import appearance_distance
from tracking.boxes import Floats

_MOTION = 0.3
"""Of the distance of two tracks that are close in time: what of it is motion."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackEnd:
    """One end of one person's track: where a person went into a group, or where they came out.

    Attributes:
        frame: the last of the track that went in, the first of the one that came out.
        position: `(2,)`, the middle of the box in that frame, pixels.
        velocity: `(2,)`, pixels a frame; of one that came out it does not matter.
        height: of the box, pixels.
        histogram: `(B,)`, the mean histogram of the track; B is 0 where none is known.
    """

    frame: int
    position: Floats
    velocity: Floats
    height: float
    histogram: Floats


def track_distance(before: TrackEnd, after: TrackEnd, close: int) -> float:
    """Return the distance I of two tracks of one person, 0 to 1.

    The motion counts where they are at most `close` frames apart: how far from where the first was heading
    the second begins, in heights.
    """
    looks = float(appearance_distance(before.histogram[None], after.histogram[None])[0, 0])
    frames = after.frame - before.frame
    if frames > close:
        return looks
    off = np.hypot(*(after.position - before.position - frames * before.velocity)) / max(before.height, 1.0)
    return (1.0 - _MOTION) * looks + _MOTION * min(float(off), 1.0)


def departed_member(
    group: Sequence[TrackEnd], out: TrackEnd, rest: TrackEnd, close: int, unlike: float
) -> int | None:
    """Return the index of the group member who left; `None` if it is none of them.

    Args:
        group: how everybody went in, at least one.
        out: the one who came out.
        rest: the track that goes on without them; it is compared where one person is left in it.
        close: frames between two tracks up to which their motion counts.
        unlike: distance above which nobody of the group is who came out.
    """
    costs = np.array([track_distance(member, out, close) for member in group])
    if len(group) == 2:  # noqa: PLR2004 — the state leaves one person on either side
        left = np.array([track_distance(member, rest, close) for member in group])
        totals = costs + left[::-1]
    else:
        totals = costs
    best = int(np.argmin(totals))
    return best if costs[best] <= unlike else None
