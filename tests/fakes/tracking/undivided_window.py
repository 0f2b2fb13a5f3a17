"""Random windows on the ground plane, and their program as one network over everybody and all places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tracking.boxes import BOX_SIDES
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.gaussians import OffsetDensities
from tracking.ground_plane.motion import (
    MotionState,
    is_possible,
    jump_densities,
    move_costs,
    reach_costs,
    with_misplaced_feet,
)
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.places.measurements import Measurements
from tracking.ground_plane.program.costs import KnownPeople, ProgramCosts, program_costs
from tracking.model.network import Network

SECONDS = 0.2
SETTINGS = GroundSettings()
_MIN_HIDDEN_COST = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A window of frames, who is known before it, and what arrivals cost."""

    people: KnownPeople
    frames: Sequence[Places]
    arrival_cost: float
    first_arrival_costs: np.ndarray

    def costs(self) -> ProgramCosts:
        """Return the costs of its program."""
        return program_costs(
            self.people, self.frames, SECONDS, self.arrival_cost, self.first_arrival_costs, SETTINGS
        )


def random_window(seed: int, people: int, frames: int, places: int, width: float) -> Window:
    """Return a window of at most so many people, frames and places on a floor `width` meters wide, 2 deep."""
    rng = np.random.default_rng(seed)
    people, length = int(rng.integers(0, people + 1)), int(rng.integers(1, frames + 1))
    size = np.array([width, 2.0])
    found = [_random_places(rng, int(rng.integers(0, places + 1)), size) for _ in range(length)]
    means = np.concatenate([rng.uniform(0.0, size, (people, 2)), rng.normal(0.0, 0.8, (people, 2))], axis=1)
    deviations = rng.uniform(0.05, 0.4, (people, 4))
    states = MotionState(means, deviations[:, :, None] ** 2 * np.eye(4))
    known = KnownPeople(
        states,
        _random_misplacements(rng, people),
        rng.choice([SECONDS, 3 * SECONDS], people),
        rng.uniform(0.0, 4.0, (people, length)),
        [rng.normal(0.0, 0.5, (people, len(each))) for each in found],
    )
    arrival = float(rng.uniform(1.0, 6.0))
    first = arrival - rng.uniform(0.0, 1.0, len(found[0])) * arrival * rng.integers(0, 2)
    return Window(known, found, arrival, first)


def _random_misplacements(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return covariances (N, 2, 2) of errors along lines of sight, some of which are 0."""
    along = rng.normal(0.0, 0.7, (count, 2)) * rng.integers(0, 2, (count, 1))
    return along[:, :, None] * along[:, None, :]


def _random_places(rng: np.random.Generator, count: int, size: np.ndarray) -> Places:
    conflicts = rng.random((count, count)) < rng.choice([0.0, 0.3])
    conflicts = conflicts | conflicts.T | np.eye(count, dtype=np.bool_)
    measurements = Measurements(
        looked=np.ones(1, dtype=np.bool_),
        camera=np.zeros(count, dtype=np.int64),
        index=np.arange(count),
        boxes=np.zeros((count, BOX_SIDES)),
        histograms=(np.zeros(0),) * count,
        places=np.zeros((count, 2)),
        covariances=np.tile(np.eye(2), (count, 1, 1)),
        log_odds=rng.choice([-3.0, 2.0], count),
        log_clutter=np.zeros(count),
        misplacements=_random_misplacements(rng, count),
    )
    return Places(
        measurements,
        tuple((k,) for k in range(count)),
        rng.uniform(0.0, size, (count, 2)),
        rng.uniform(0.05, 0.3, count)[:, None, None] ** 2 * np.eye(2),
        rng.normal(-2.0, 3.0, count),
        conflicts,
        np.zeros((count, count), dtype=np.bool_),
    )


def undivided_network(window: Window, newcomers: int) -> Network:
    """Return the network of a window as paper II.B has it: everybody can go from every place to every other.

    The last place of every frame is being gone.
    """
    people, frames = window.people, window.frames
    known, length = len(people), len(frames)
    objects = known + newcomers
    gone = max(len(places) for places in frames)
    hidden = gone + 1
    weight = SETTINGS.detection_weight(SECONDS)
    departure = -float(np.log(SETTINGS.departure_rate * SECONDS))
    node = np.full((objects, length, hidden + 1), np.inf)
    source = np.full((objects, hidden + 1), np.inf)
    pair = np.full((objects, length - 1, hidden + 1, hidden + 1), np.inf)
    node[:, :, gone] = 0.0
    pair[:, :, gone, gone] = pair[:, :, hidden, hidden] = 0.0
    source[:, hidden] = 0.0
    node[:known, :, hidden] = np.maximum(people.hidden, _MIN_HIDDEN_COST)
    node[known:, :, hidden] = 0.0
    source[:known, gone] = pair[:known, :, hidden, gone] = departure
    pair[:, :, :gone, gone] = departure
    pair[:known, :, :gone, hidden] = 0.0
    source[known:, : len(frames[0])] = window.first_arrival_costs
    for m, places in enumerate(frames):
        node[:known, m, : len(places)] = places.costs + people.appearance[m]
        node[known:, m, : len(places)] = places.arrival_costs
    states = [MotionState(*each) for each in zip(people.states.mean, people.states.covariance, strict=True)]
    for n, state in enumerate(states):
        for m, places in enumerate(frames):
            unseen = float(people.seconds[n]) + m * SECONDS
            misplacements = people.misplacements[n] + places.misplacements
            reach = reach_costs(state, unseen, places.means, places.covariances, misplacements, SETTINGS)
            (source[n] if m == 0 else pair[n, m - 1, hidden])[: len(places)] = reach
    for m, (before, after) in enumerate(pairwise(frames)):
        offsets = after.means[None] - before.means[:, None]
        spread = before.covariances[:, None] + after.covariances[None]
        around = spread + (SETTINGS.speed * SECONDS) ** 2 * np.eye(2)
        misplacements = before.misplacements[:, None] + after.misplacements[None]
        turned, jumped = OffsetDensities.of(offsets, around), jump_densities(offsets, around, misplacements)
        possible = np.where(is_possible(turned), turned.correlated(weight), np.inf)
        pair[known:, m, hidden, : len(after)] = window.arrival_cost
        pair[known:, m, : len(before), : len(after)] = possible
        for n, state in enumerate(states):
            ahead = state.predict(float(people.seconds[n]) + m * SECONDS, SETTINGS.acceleration)
            uncertain = ahead.velocity_covariance * SECONDS**2
            uncertain = uncertain + (0.5 * SETTINGS.acceleration * SECONDS**2) ** 2 * np.eye(2)
            walked = OffsetDensities.of(offsets - SECONDS * ahead.velocity, spread + uncertain)
            costs = move_costs(walked, turned, SETTINGS.turn_probability(SECONDS))
            costs = with_misplaced_feet(costs, jumped, SETTINGS.misplacing_probability(SECONDS))
            pair[n, m, : len(before), : len(after)] = costs
    conflicts = np.zeros((length, gone + 1, gone + 1), dtype=np.bool_)
    present = np.zeros((1, length, gone + 1), dtype=np.bool_)
    present[:, :, gone] = True
    for m, places in enumerate(frames):
        present[0, m, : len(places)] = True
        conflicts[m, : len(places), : len(places)] = places.conflicts
    return Network(
        boxes=np.zeros((1, length, gone + 1, BOX_SIDES)),
        present=present,
        source=source,
        node=node,
        pair=pair,
        sink=np.zeros((objects, hidden + 1)),
        conflicts=conflicts,
        conflict_rows="clique",
        locations=np.zeros((1, length, hidden + 1, BOX_SIDES)),
        layout=0.0,
    )
