"""Exclusions between places, and the constraint rows that express them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.conflicts import clique_rows, connected_component
from tracking.model.network import CostSettings, Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers.cutting_planes import ConflictSeparator
from tracking.types import Detections

PERSON = np.array([0.0, 0.0, 20.0, 50.0])
CORNERS = replace(PAPER_COSTS, conflict_distance=60.0, conflict_rows="clique")
random_networks = settings(deadline=None, max_examples=60)


def row_of_people(*lefts: float, rules: CostSettings = CORNERS, objects: int = 3) -> Network:
    boxes = np.array([PERSON + np.array([left, 0.0, left, 0.0]) for left in lefts])
    seen = Detections(boxes, np.ones(len(boxes)), np.ones((len(boxes), 1)))
    return build_network([Template(n, np.ones(1), None) for n in range(objects)], [seen], rules)


def test_boxes_conflict_below_the_corner_distance_and_with_themselves() -> None:
    relation = row_of_people(0.0, 14.9, 15.0).conflicts[0]
    np.testing.assert_array_equal(relation, [[True, True, False], [True, True, True], [False, True, True]])


def test_boxes_conflict_above_the_overlap() -> None:
    rules = replace(PAPER_COSTS, conflict_rule="overlap", conflict_overlap=0.5)
    relation = row_of_people(0.0, 9.0, 11.0, rules=rules).conflicts[0]
    np.testing.assert_array_equal(relation[0], [True, True, False])


def test_a_box_between_two_people_excludes_them_only_with_star_rows() -> None:
    """A and C do not conflict; B between them conflicts with both and is unused: `A--B--C`."""
    network = row_of_people(0.0, 14.0, 28.0)
    assert not network.exclusions()[0, 0, 2]
    stars = row_of_people(0.0, 14.0, 28.0, rules=replace(CORNERS, conflict_rows="star"))
    assert stars.exclusions()[0, 0, 2]
    two = row_of_people(0.0, 14.0, 28.0, rules=replace(CORNERS, conflict_rows="star"), objects=2)
    assert not two.exclusions()[0, 0, 2]


def test_the_star_of_a_place_contains_itself_and_conflicting_places_of_other_objects() -> None:
    stars = row_of_people(0.0, 14.0, rules=replace(CORNERS, conflict_rows="star"), objects=2)
    rows = {row.tobytes() for row in stars.rows(0)}
    both, first, second = [True, True], [True, False], [False, True]
    assert rows == {
        np.array(row).tobytes() for row in ([first, both], [second, both], [both, first], [both, second])
    }


@random_networks
@given(case=cases(objects=4, frames=2, places=6))
def test_rows_forbid_exactly_the_exclusions(case: Case) -> None:
    network = network_of(case)
    exclusions, sets, places = network.exclusions(), network.sets, network.max_places
    for m in range(network.frames):
        rows = network.rows(m)
        together = np.einsum("rai,rbj->aibj", rows.astype(int), rows.astype(int)) > 0
        for a in range(network.objects):
            for b in range(network.objects):
                if a != b:
                    at = slice(sets[a] * places, (sets[a] + 1) * places)
                    to = slice(sets[b] * places, (sets[b] + 1) * places)
                    np.testing.assert_array_equal(together[a, :, b], exclusions[m, at, to])


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), own=st.booleans())
def test_rows_are_cliques_and_components_are_covered_independently(seed: int, own: bool) -> None:
    rng = np.random.default_rng(seed)
    relation = rng.uniform(size=(12, 12)) < 0.15
    relation |= relation.T | np.eye(12, dtype=np.bool_)
    owners = np.repeat(np.arange(3), 4) if own else None
    joined = relation if owners is None else relation | (owners[:, None] == owners)
    rows = clique_rows(relation, owners)
    for row in rows:
        assert joined[np.ix_(row, row)].all()
    for place in range(12):
        part = connected_component(relation, place)
        inside = rows[rows[:, part].any(axis=1)]
        alone = clique_rows(relation[np.ix_(part, part)], None if owners is None else owners[part])
        assert {row.tobytes() for row in inside[:, part]} == {row.tobytes() for row in alone}


@random_networks
@given(case=cases(objects=5, frames=2, places=6))
def test_the_separator_finds_every_violated_row_once(case: Case) -> None:
    network = network_of(case)
    rng = np.random.default_rng(case.seed)
    usage = rng.dirichlet(np.full(network.max_places + 1, 0.3), (network.objects, network.frames))
    usage[:, :, :-1] *= network.present[network.sets]
    expected = {
        (m, row.tobytes())
        for m in range(network.frames)
        for row in network.rows(m)
        if usage[:, m, :-1][row].sum() > 1.0 + 1e-9
    }
    finder = ConflictSeparator(network)
    found = [
        (row.frame, np.ascontiguousarray(row.members[:, :-1]).tobytes())
        for row in finder.find_new_violated(usage)
    ]
    assert sorted(found) == sorted(expected)
    assert not finder.find_new_violated(usage)
