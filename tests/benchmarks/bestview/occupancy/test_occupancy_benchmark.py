"""The occupancy reference tracker: occupancy maps and shortest paths, checked by brute force."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.sparse import lil_matrix

from benchmarks.bestview.occupancy.occupancy_map import ForegroundObservation, OccupancyMap, OccupancySettings
from benchmarks.bestview.occupancy.shortest_paths import INFINITE, GridPath, Lattice, shortest_paths

bounded = settings(max_examples=40)


def corridor(places: int) -> np.ndarray:
    """Places in a row: from each to itself and to those beside it."""
    row = np.arange(places)
    return np.stack([np.where(row > 0, row - 1, places), row, np.minimum(row + 1, places)], axis=1)


@st.composite
def lattices(draw: st.DrawFn, most_frames: int, max_places: int) -> Lattice:
    frames, places = draw(st.integers(1, most_frames)), draw(st.integers(1, max_places))
    cost = st.integers(-9, 9)
    costs = draw(st.lists(cost, min_size=frames * places, max_size=frames * places))
    gates = draw(st.lists(st.sampled_from([0, 2, 7, int(INFINITE)]), min_size=places, max_size=places))
    return Lattice(np.array(costs).reshape(frames, places), corridor(places), np.array(gates))


def cost_of(lattice: Lattice, path: GridPath) -> int:
    """What one path costs; it has to keep to the moves."""
    frames = path.first + np.arange(len(path.places))
    assert all(other in lattice.moves[one] for one, other in pairwise(path.places.tolist()))
    cost = int(lattice.costs[frames, path.places].sum())
    if path.first > 0:
        cost += int(lattice.gates[path.places[0]])
    if frames[-1] < len(lattice.costs) - 1:
        cost += int(lattice.gates[path.places[-1]])
    return cost


def all_paths(lattice: Lattice) -> list[GridPath]:
    frames, places = lattice.costs.shape
    return [
        GridPath(first, np.array(walk))
        for first in range(frames)
        for length in range(1, frames - first + 1)
        for walk in product(range(places), repeat=length)
        if all(abs(one - other) <= 1 for one, other in pairwise(walk))
    ]


def least_by_trying(lattice: Lattice) -> int:
    """The least cost of paths that never share a place: every set of nodes, by its lowest path."""
    frames, places = lattice.costs.shape
    best = np.full(2 ** (frames * places), 0)
    priced = []
    for path in all_paths(lattice):
        nodes = sum(
            1 << ((path.first + step) * places + int(place)) for step, place in enumerate(path.places)
        )
        priced.append((nodes, cost_of(lattice, path)))
    for free in range(len(best)):
        best[free] = min([0] + [cost + best[free & ~nodes] for nodes, cost in priced if not nodes & ~free])
    return int(best[-1])


@bounded
@given(lattices(most_frames=4, max_places=2) | lattices(most_frames=2, max_places=4))
def test_paths_are_the_cheapest_of_all_that_never_share_a_place(lattice: Lattice) -> None:
    paths = shortest_paths(lattice)
    nodes = [(path.first + step, int(place)) for path in paths for step, place in enumerate(path.places)]
    assert len(nodes) == len(set(nodes))
    assert sum(cost_of(lattice, path) for path in paths) == least_by_trying(lattice)


def least_by_program(lattice: Lattice) -> float:
    """The same as a linear program, whose best corner is whole numbers (Berclaz et al., section 4)."""
    frames, places = lattice.costs.shape
    arcs: list[tuple[int, int, int]] = []  # from node, to node, cost; nodes -1 outside
    for frame, place in product(range(frames), range(places)):
        node = frame * places + place
        arcs.append((-1, node, 0 if frame == 0 else int(lattice.gates[place])))
        arcs.append((node, -1, 0 if frame == frames - 1 else int(lattice.gates[place])))
        arcs += [
            (node, node + places + int(to) - place, 0)
            for to in lattice.moves[place]
            if frame < frames - 1 and to < places
        ]
    arcs = [arc for arc in arcs if arc[2] < INFINITE]
    balance, entered = (lil_matrix((frames * places, len(arcs))) for _ in range(2))
    price = np.zeros(len(arcs))
    for column, (one, other, cost) in enumerate(arcs):
        price[column] = cost
        if one >= 0:
            balance[one, column] = -1
        if other >= 0:
            balance[other, column] += 1
            entered[other, column] = 1
            price[column] += lattice.costs.ravel()[other]
    zeros, ones = np.zeros(frames * places), np.ones(frames * places)
    found = linprog(price, A_ub=entered.tocsr(), b_ub=ones, A_eq=balance.tocsr(), b_eq=zeros, bounds=(0, 1))
    assert found.status == 0
    return float(found.fun)


@bounded
@given(lattices(most_frames=8, max_places=6))
def test_paths_are_the_optimum_of_the_flow_program(lattice: Lattice) -> None:
    paths = shortest_paths(lattice)
    assert sum(cost_of(lattice, path) for path in paths) == pytest.approx(least_by_program(lattice), abs=1e-6)


def test_a_later_path_may_take_a_part_of_an_earlier_one_over() -> None:
    costs = np.array([[-9, 20, -1], [-5, -9, 20], [-1, 20, -9]])
    lattice = Lattice(costs, corridor(3), np.full(3, INFINITE))
    assert min(cost_of(lattice, path) for path in all_paths(lattice)) == -27, "alone: from 0 through 1 to 2"
    assert [path.places.tolist() for path in shortest_paths(lattice)] == [[0, 0, 0], [2, 1, 2]]


WIDE, HIGH = 24, 10
"""Cells of a tiny picture, two of which see a row of people from the front and from the back."""


def row_of_people(places: int, apart: int) -> list[np.ndarray]:
    left = np.arange(places) * apart
    front = np.stack([left, np.full(places, 2), left + 3, np.full(places, 9)], axis=1)
    back = np.stack([WIDE - left - 3, np.full(places, 1), WIDE - left, np.full(places, 8)], axis=1)
    return [front, back]


def covered(rectangles: np.ndarray, people: tuple[int, ...]) -> np.ndarray:
    picture = np.zeros((HIGH, WIDE))
    for left, top, right, bottom in rectangles[list(people)]:
        picture[top:bottom, left:right] = 1.0
    return picture


def marginals_by_trying(
    rectangles: list[np.ndarray], sights: list[ForegroundObservation], model: OccupancySettings
) -> np.ndarray:
    """The model's own probabilities: every set of people, weighed by its prior and by all pictures."""
    places = len(rectangles[0])
    weights, sets = [], list(product((0, 1), repeat=places))
    for there in sets:
        people = tuple(np.flatnonzero(there))
        log = sum(np.log(model.prior if is_present else 1 - model.prior) for is_present in there)
        for camera, sight in zip(rectangles, sights, strict=True):
            picture = covered(camera, people)
            distance = np.abs(picture - sight.foreground).sum()
            area = np.prod(camera[:, 2:] - camera[:, :2], axis=1).mean() * model.least_area
            log -= distance / (model.sigma * max(picture.sum(), area))
        weights.append(log)
    share = np.exp(np.array(weights) - max(weights))
    return np.array(sets).T @ share / share.sum()


def noisy(picture: np.ndarray, seed: int, share: float) -> np.ndarray:
    flipped = np.random.default_rng(seed).random(picture.shape) < share
    return np.where(flipped, 1.0 - picture, picture)


@settings(max_examples=25)
@given(
    people=st.sets(st.integers(0, 6), max_size=1) | st.sampled_from([{0, 3}, {0, 6}, {1, 5}, {2, 6}]),
    seed=st.integers(0, 1000),
)
def test_one_person_and_two_apart_are_where_the_exact_posterior_has_them(people: set[int], seed: int) -> None:
    rectangles = row_of_people(7, 3)
    model = OccupancySettings(sigma=0.05, least_area=1.0)
    sights = [
        ForegroundObservation(
            noisy(covered(rectangle, tuple(people)), seed + 2000 * camera, 0.04), np.ones((HIGH, WIDE))
        )
        for camera, rectangle in enumerate(rectangles)
    ]
    exact = marginals_by_trying(rectangles, sights, model)
    q = OccupancyMap(rectangles, model).compute(sights)
    assert set(np.flatnonzero(exact > 0.5)) == people
    np.testing.assert_allclose(q, exact, atol=0.05)


def test_who_hides_behind_somebody_in_one_picture_is_found_by_the_other() -> None:
    """Two people stand in line before the first camera; the second sees them side by side."""
    first = np.array([[10, 1, 13, 8], [10, 2, 13, 9], [2, 2, 5, 9]])
    second = np.array([[4, 2, 7, 9], [14, 2, 17, 9], [19, 2, 22, 9]])
    sights = [
        ForegroundObservation(covered(rectangle, (0, 1)), np.ones((HIGH, WIDE)))
        for rectangle in (first, second)
    ]
    q = OccupancyMap([first, second], OccupancySettings()).compute(sights)
    assert (q > 0.9).tolist() == [True, True, False]


def test_what_does_not_count_in_a_picture_changes_nothing() -> None:
    rectangles = row_of_people(7, 3)
    weight = np.ones((HIGH, WIDE))
    weight[:, 15:] = 0.0
    clear = covered(rectangles[0], (1,))
    dirty = np.where(weight > 0, clear, 1.0)
    recall = ForegroundObservation(covered(rectangles[1], (1,)), np.ones((HIGH, WIDE)))
    occupancy = OccupancyMap(rectangles, OccupancySettings())
    one, other = (occupancy.compute([ForegroundObservation(mask, weight), recall]) for mask in (clear, dirty))
    np.testing.assert_array_equal(one, other)


def test_nobody_is_found_in_nothing() -> None:
    rectangles = row_of_people(7, 3)
    unseen = ForegroundObservation(np.zeros((HIGH, WIDE)), np.zeros((HIGH, WIDE)))
    empty = ForegroundObservation(np.zeros((HIGH, WIDE)), np.ones((HIGH, WIDE)))
    occupancy = OccupancyMap(rectangles, OccupancySettings())
    assert (occupancy.compute([empty, empty]) < 0.05).all()
    np.testing.assert_allclose(occupancy.compute([unseen, unseen]), 0.01, atol=1e-3)
