"""The network program of a window on the ground plane, in the form that all solvers take (paper II.B).

Its objects are the people known, and some who have not arrived yet. Each takes one of the places of a frame,
is hidden, or is gone for good: the last place of every frame, which any number can take. All costs are
negative log likelihoods, so that a known person takes a place only where an arrival there is less likely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.ground_plane.gaussians import OffsetDensities
from tracking.ground_plane.motion import MotionState, is_possible, move_costs, reach_costs
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.settings import GroundSettings
from tracking.model.network import Network

_MIN_HIDDEN_COST = 0.3
"""Of a frame in which no camera should see the person: being seen is always likelier."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownPerson:
    """A person in the frame before the window.

    Attributes:
        state: in the frame in which they were seen last.
        seconds: from that frame to the window's first one.
        hidden: (M,) costs of being missed by all cameras in each frame.
        appearance: (K,) costs of the places of each frame, by appearance.
    """

    state: MotionState
    seconds: float
    hidden: Floats
    appearance: Sequence[Floats]


def build_ground_network(
    people: Sequence[KnownPerson],
    newcomers: int,
    frames: Sequence[Places],
    seconds: float,
    arrival_cost: float,
    first_arrival_costs: Floats,
    settings: GroundSettings,
) -> Network:
    """Build the network of M frames, `seconds` apart, of the people known and `newcomers` who may arrive.

    `arrival_cost`: negative log of the people who arrive per m² and frame; `first_arrival_costs` (K,): the
    same at each place of the first frame.
    """
    objects, length = len(people) + newcomers, len(frames)
    gone = max(len(places) for places in frames)
    hidden = gone + 1
    weight = settings.detection_weight(seconds)
    departure = -float(np.log(min(settings.departure_rate * seconds, 1.0)))
    node = np.full((objects, length, hidden + 1), np.inf)
    source = np.full((objects, hidden + 1), np.inf)
    pair = np.full((objects, length - 1, hidden + 1, hidden + 1), np.inf)
    node[:, :, gone] = 0.0
    pair[:, :, gone, gone] = pair[:, :, hidden, hidden] = 0.0
    source[:, hidden] = 0.0
    for m, places in enumerate(frames):
        node[: len(people), m, : len(places)] = places.costs
        node[len(people) :, m, : len(places)] = places.arrival_costs
    for n, person in enumerate(people):
        node[n, :, hidden] = np.maximum(person.hidden, _MIN_HIDDEN_COST)
        source[n, gone] = departure
        pair[n, :, :gone, gone] = pair[n, :, hidden, gone] = departure
        pair[n, :, :gone, hidden] = 0.0
        for m, places in enumerate(frames):
            reach = reach_costs(
                person.state, person.seconds + m * seconds, places.means, places.covariances, settings
            )
            node[n, m, : len(places)] += person.appearance[m]
            (source[n] if m == 0 else pair[n, m - 1, hidden])[: len(places)] = reach
    node[len(people) :, :, hidden] = 0.0
    source[len(people) :, : len(frames[0])] = first_arrival_costs
    pair[len(people) :, :, :gone, gone] = departure
    for m, (before, after) in enumerate(pairwise(frames)):
        steps = _Steps.between(before, after, seconds, settings)
        pair[len(people) :, m, hidden, : len(after)] = arrival_cost
        pair[len(people) :, m, : len(before), : len(after)] = steps.costs_of_newcomers(weight)
        for n, person in enumerate(people):
            ahead = person.state.predict(person.seconds + m * seconds, settings.acceleration)
            pair[n, m, : len(before), : len(after)] = steps.costs(ahead, seconds, settings)
    return _network(node, source, pair, frames)


def _network(node: Floats, source: Floats, pair: Floats, frames: Sequence[Places]) -> Network:
    length, states = node.shape[1:]
    places = states - 1
    boxes = np.zeros((1, length, places, BOX_SIDES))
    present = np.zeros((1, length, places), dtype=np.bool_)
    present[:, :, -1] = True
    conflicts = np.zeros((length, places, places), dtype=np.bool_)
    for m, found in enumerate(frames):
        present[0, m, : len(found)] = True
        conflicts[m, : len(found), : len(found)] = found.conflicts
    return Network(
        boxes=boxes,
        present=present,
        source=source,
        node=node,
        pair=pair,
        sink=np.zeros((len(node), states)),
        conflicts=conflicts,
        conflict_rows="clique",
        locations=np.zeros((1, length, states, BOX_SIDES)),
        layout=0.0,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """The steps from each place of a frame to each of the next.

    Attributes:
        offsets: (K, L, 2) metres.
        spread: (K, L, 2, 2) their covariances.
        turned: their densities for somebody who may walk anywhere.
    """

    offsets: Floats
    spread: Floats
    turned: OffsetDensities

    @classmethod
    def between(cls, before: Places, after: Places, seconds: float, settings: GroundSettings) -> _Steps:
        offsets = after.means[None] - before.means[:, None]
        spread = before.covariances[:, None] + after.covariances[None]
        anywhere = (settings.speed * seconds) ** 2 * np.eye(2)
        return cls(offsets, spread, OffsetDensities.of(offsets, spread + anywhere))

    def costs(self, person: MotionState, seconds: float, settings: GroundSettings) -> Floats:
        """Return the costs of the steps for a person whose velocity is known, (K, L)."""
        uncertain = person.velocity_covariance * seconds**2
        uncertain = uncertain + (0.5 * settings.acceleration * seconds**2) ** 2 * np.eye(2)
        walked = OffsetDensities.of(self.offsets - seconds * person.velocity, self.spread + uncertain)
        return move_costs(walked, self.turned, settings.turn_probability(seconds))

    def costs_of_newcomers(self, weight: float) -> Floats:
        """Return the costs of the steps for somebody whose velocity is not known, (K, L).

        `weight`: of a frame's detections, as in the costs of places.
        """
        return np.where(is_possible(self.turned), self.turned.correlated(weight), np.inf)
