"""The costs of the network program of a window on the ground plane (paper II.B), arc by arc.

Its objects are the people known, and newcomers, who have not arrived yet. Each takes one of the places of a
frame, is hidden, or is gone for good. All costs are negative log likelihoods, so that a known person takes a
place only where an arrival there is less likely. Newcomers are alike: one row of costs stands for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import OffsetDensities
from tracking.ground_plane.motion import (
    MotionState,
    is_possible,
    jump_densities,
    may_walk,
    move_costs,
    reach_costs,
    with_misplaced_feet,
)
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.settings import GroundSettings

Ints = NDArray[np.int64]

_MIN_HIDDEN_COST = 0.3
"""Of a frame in which no camera should see the person: being seen is always likelier."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownPeople:
    """The P people known before the window.

    Attributes:
        states: (P,) in the frame in which each was seen last.
        misplacements: (P, 2, 2) covariances of the errors of those places if the feet were wrong.
        seconds: (P,) from that frame to the window's first one.
        hidden: (P, M) costs of being missed by all cameras in each frame.
        appearance: (P, K) costs of the places of each frame, by appearance.
    """

    states: MotionState
    misplacements: Floats
    seconds: Floats
    hidden: Floats
    appearance: Sequence[Floats]

    def __len__(self) -> int:
        return len(self.seconds)


@dataclass(frozen=True, slots=True, eq=False)
class MoveArcs:
    """The E arcs from places of a frame to places of the next.

    Attributes:
        row: (E,) whose they are: of a known person, or of newcomers.
        origin, target: (E,) places in the two frames.
        cost: (E,) without that of the target.
    """

    row: Ints
    origin: Ints
    target: Ints
    cost: Floats

    def select(self, kept: NDArray[np.bool_]) -> MoveArcs:
        """Return the arcs where `kept` (E,) is true."""
        return MoveArcs(self.row[kept], self.origin[kept], self.target[kept], self.cost[kept])


@dataclass(frozen=True, slots=True, eq=False)
class ProgramCosts:
    """The costs of the program of M frames; R rows: the people known, and last the newcomers.

    Attributes:
        hidden: (R, M) of being hidden in each frame.
        leave: of being gone from the next frame on.
        node: (R, K) of each frame's places.
        reach: (R, K) of being at a place of each frame when hidden, or not there, in the one before; infinite
            where nobody can.
        steps: the arcs between places, M - 1; those that nobody can take are left out.
    """

    hidden: Floats
    leave: float
    node: tuple[Floats, ...]
    reach: tuple[Floats, ...]
    steps: tuple[MoveArcs, ...]

    @property
    def people(self) -> int:
        """The number of people known, and the row of the newcomers."""
        return len(self.hidden) - 1

    def may_hide(self) -> NDArray[np.bool_]:
        """Return which rows may be hidden after they were at a place, (R,): newcomers have just been seen."""
        return np.arange(len(self.hidden)) < self.people


def program_costs(
    people: KnownPeople,
    frames: Sequence[Places],
    seconds: float,
    arrival_cost: float,
    first_arrival_costs: Floats,
    settings: GroundSettings,
) -> ProgramCosts:
    """Return the costs of a window of M frames, `seconds` apart.

    `arrival_cost`: negative log of the people who arrive per m² and frame; `first_arrival_costs` (K,): the
    same at each place of the first frame.
    """
    node = [
        np.concatenate([places.costs + looks, places.arrival_costs[None]])
        for places, looks in zip(frames, people.appearance, strict=True)
    ]
    reach = []
    for m, places in enumerate(frames):
        known = reach_costs(
            people.states,
            people.seconds + m * seconds,
            places.means,
            places.covariances,
            people.misplacements[:, None] + places.misplacements,
            settings,
        )
        arriving = first_arrival_costs if m == 0 else np.full(len(places), arrival_cost)
        reach.append(np.concatenate([known, arriving[None]]))
    steps = []
    there = np.isfinite(reach[0])
    for m, (before, after) in enumerate(pairwise(frames)):
        ahead = people.states.predict(people.seconds + m * seconds, settings.acceleration)
        arcs = _step_arcs(ahead, there[:-1], before, after, seconds, settings)
        steps.append(arcs)
        there = np.isfinite(reach[m + 1])
        there[arcs.row, arcs.target] = True
    return ProgramCosts(
        np.concatenate([np.maximum(people.hidden, _MIN_HIDDEN_COST), np.zeros((1, len(frames)))]),
        -float(np.log(min(settings.departure_rate * seconds, 1.0))),
        tuple(node),
        tuple(reach),
        tuple(steps),
    )


def _step_arcs(
    people: MotionState,
    there: NDArray[np.bool_],
    before: Places,
    after: Places,
    seconds: float,
    settings: GroundSettings,
) -> MoveArcs:
    """Return the arcs from places of one frame to the next for P people, `there` (P, K), and newcomers."""
    offsets = after.means[None] - before.means[:, None]
    spread = before.covariances[:, None] + after.covariances[None]
    around = spread + (settings.speed * seconds) ** 2 * np.eye(2)
    turned = OffsetDensities.of(offsets, around)
    jumped = jump_densities(offsets, around, before.misplacements[:, None] + after.misplacements[None])
    can_turn = is_possible(turned)
    new_origin, new_target = np.nonzero(can_turn)
    weight = settings.detection_weight(seconds)
    new_costs = turned.correlated(weight)[new_origin, new_target]

    uncertain = people.velocity_covariance * seconds**2
    uncertain = uncertain + (0.5 * settings.acceleration * seconds**2) ** 2 * np.eye(2)
    row, place = np.nonzero(there)
    walked_to = before.means[place] + seconds * people.velocity[row]
    reachable = may_walk(
        walked_to, before.covariances[place] + uncertain[row], after.means, after.covariances
    )
    at, target = np.nonzero(reachable | (can_turn | is_possible(jumped))[place])
    row, origin = row[at], place[at]
    walked = OffsetDensities.of(
        offsets[origin, target] - seconds * people.velocity[row], spread[origin, target] + uncertain[row]
    )
    costs = move_costs(walked, turned.at(origin, target), settings.turn_probability(seconds))
    jumps = jumped.at(origin, target)
    costs = with_misplaced_feet(costs, jumps, settings.misplacing_probability(seconds))
    known = MoveArcs(row, origin, target, costs).select(np.isfinite(costs))
    newcomers = np.full(len(new_origin), len(there))
    return MoveArcs(
        np.concatenate([known.row, newcomers]),
        np.concatenate([known.origin, new_origin]),
        np.concatenate([known.target, new_target]),
        np.concatenate([known.cost, new_costs]),
    )
