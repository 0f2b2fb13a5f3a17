"""The joint path is the best of all paths; pruning removes only links that are too long to walk."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.baselines.temporal_consistency.graph import (
    StageGraph,
    count_edges_without_pruning,
    count_joint_edges,
    merge_costs,
    prune_links,
)
from tracking.baselines.temporal_consistency.joint_path import (
    cheapest_joint_path,
    cheapest_path_by_edges,
    solve_joint_path,
)

_MANY = 100_000


def _cost(graph: StageGraph, path: np.ndarray) -> float:
    """Compute equation (1) over the stages; infinite along a pruned link."""
    total = 0.0
    for before, now, step, appearance, shared in zip(
        [graph.start, *path[:-1]],
        path,
        graph.distance_costs,
        graph.appearance_costs,
        graph.shared,
        strict=True,
    ):
        steps = [step[a, b] for a, b in zip(before, now, strict=True)]
        total += sum(cost if cost <= graph.max_step_cost else np.inf for cost in steps)
        total += sum(appearance[person, blob] for person, blob in enumerate(now))
        here = [blob for blob in now.tolist() if shared[blob]]
        total += graph.merge_cost * (len(here) - len(set(here)))
    return total / graph.people


def _best(graph: StageGraph) -> float:
    """Return the cost of the cheapest of all joint paths."""
    nodes = [list(product(range(step.shape[1]), repeat=graph.people)) for step in graph.distance_costs]
    return min(_cost(graph, np.array(path)) for path in product(*nodes))


@st.composite
def graphs(draw: st.DrawFn, most_people: int = 3, most_stages: int = 3, most_blobs: int = 3) -> StageGraph:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    people, stages = draw(st.integers(1, most_people)), draw(st.integers(1, most_stages))
    blobs = [draw(st.integers(1, most_blobs)) for _ in range(stages + 1)]
    steps = tuple(np.round(rng.exponential(0.7, pair), 2) for pair in pairwise(blobs))
    appearance = tuple(np.round(rng.random((people, count)), 2) for count in blobs[1:])
    shared = tuple(rng.random(count) < 0.8 for count in blobs[1:])
    return StageGraph(rng.integers(0, blobs[0], people), steps, appearance, shared, 0.35, np.inf)


@given(graphs(most_people=2))
@settings(deadline=None, max_examples=80)
def test_the_joint_path_is_the_cheapest_of_all(graph: StageGraph) -> None:
    found = solve_joint_path(graph, prune_links(graph), _MANY)
    assert found.exact
    assert found.cost == pytest.approx(_best(graph))
    assert _cost(graph, found.blobs) == pytest.approx(found.cost)


@given(graphs(most_stages=2))
@settings(deadline=None, max_examples=30)
def test_the_joint_path_is_the_cheapest_for_three_people(graph: StageGraph) -> None:
    assert solve_joint_path(graph, prune_links(graph), _MANY).cost == pytest.approx(_best(graph))


@given(graphs(most_people=4, most_stages=6, most_blobs=4), st.sampled_from([0.6, 1.5, np.inf]))
@settings(deadline=None, max_examples=60)
def test_solving_person_by_person_equals_solving_edge_by_edge(graph: StageGraph, longest: float) -> None:
    graph = replace(graph, max_step_cost=longest)
    links = prune_links(graph)
    no_others = [np.zeros(len(shared), dtype=np.int64) for shared in graph.shared]
    path, cost = cheapest_joint_path(links, graph.shared, no_others, graph.merge_cost)
    by_edges, same = cheapest_path_by_edges(links, graph.shared, graph.merge_cost)
    assert cost == pytest.approx(same)
    # People who cannot meet are solved separately without loss.
    apart = solve_joint_path(graph, links, _MANY)
    assert apart.cost == pytest.approx(cost / graph.people)
    for found in (path, by_edges, apart.blobs):
        unpruned = replace(graph, max_step_cost=np.inf)
        assert _cost(unpruned, found) == pytest.approx(cost / graph.people)


@given(graphs(most_people=3, most_stages=4, most_blobs=4))
@settings(deadline=None, max_examples=80)
def test_pruning_keeps_the_best_path_if_all_its_steps_are_short_enough(graph: StageGraph) -> None:
    whole = solve_joint_path(graph, prune_links(graph), _MANY)
    step_costs = [
        step[a, b]
        for before, now, step in zip(
            [graph.start, *whole.blobs[:-1]], whole.blobs, graph.distance_costs, strict=True
        )
        for a, b in zip(before, now, strict=True)
    ]
    pruned = replace(graph, max_step_cost=max(step_costs))
    links = prune_links(pruned)
    assert solve_joint_path(pruned, links, _MANY).cost == pytest.approx(whole.cost)
    assert all(
        some <= every
        for some, every in zip(count_joint_edges(links), count_edges_without_pruning(graph), strict=True)
    )


def test_without_pruning_the_edges_are_all_pairs_of_nodes() -> None:
    graph = StageGraph(
        np.array([0, 1, 2]),
        (np.zeros((3, 3)), np.zeros((3, 2))),
        (np.zeros((3, 3)), np.zeros((3, 2))),
        (np.ones(3, dtype=bool), np.ones(2, dtype=bool)),
        0.35,
        np.inf,
    )
    # 27 nodes, then 8, as in the example of the report; the first stage has one predecessor.
    assert count_edges_without_pruning(graph) == [27, 27 * 8]


def test_pruning_leaves_a_chain_where_all_people_are_far_apart() -> None:
    far = np.where(np.eye(3, dtype=bool), 0.0, 30.0)
    graph = StageGraph(
        np.arange(3),
        (far, far),
        (np.full((3, 3), 0.5),) * 2,
        (np.ones(3, dtype=bool),) * 2,
        0.35,
        2.0,
    )
    assert count_joint_edges(prune_links(graph)) == [1, 1]
    assert solve_joint_path(graph, prune_links(graph), _MANY).blobs.tolist() == [[0, 1, 2], [0, 1, 2]]


def test_a_person_out_of_reach_of_all_blobs_is_assigned_the_nearest() -> None:
    graph = StageGraph(
        np.array([0]), (np.array([[40.0, 30.0]]),), (np.zeros((1, 2)),), (np.ones(2, dtype=bool),), 0.35, 2.0
    )
    assert solve_joint_path(graph, prune_links(graph), _MANY).blobs.tolist() == [[1]]


def test_a_merge_costs_for_each_person_but_one() -> None:
    blobs = [np.array([0, 1]), np.array([0, 1]), np.array([1])]
    shared, no_others = np.ones(2, dtype=bool), np.zeros(2, dtype=np.int64)
    costs = merge_costs(blobs, shared, no_others, 0.35)
    for a, b in product(range(2), repeat=2):
        here = [a, b, 1]
        assert costs[a, b, 0] == pytest.approx(0.35 * (3 - len(set(here))))
    # With another person in the blob each one costs; in blobs where sharing is free none does.
    assert merge_costs(blobs, shared, np.array([1, 0]), 0.35)[0, 0, 0] == pytest.approx(0.7)
    assert not merge_costs(blobs, np.zeros(2, dtype=bool), no_others, 0.35).any()


@given(graphs(most_people=4, most_stages=3, most_blobs=3))
@settings(deadline=None, max_examples=40)
def test_too_many_people_for_one_table_are_solved_one_after_the_other(graph: StageGraph) -> None:
    found = solve_joint_path(graph, prune_links(graph), 1)
    whole = solve_joint_path(graph, prune_links(graph), _MANY)
    assert _cost(graph, found.blobs) == pytest.approx(found.cost)
    assert found.cost >= whole.cost - 1e-9
    assert not found.exact or found.cost == pytest.approx(whole.cost)


def test_later_evidence_corrects_an_earlier_match() -> None:
    # Two people meet in one blob and part; first their appearances are swapped, then right.
    near = np.full((1, 2), 0.22)
    apart = np.array([[0.0, 9.0], [9.0, 0.0]])
    alone = (np.ones(2, dtype=bool),)
    wrong, right = np.array([[0.6, 0.4], [0.4, 0.6]]), np.array([[0.1, 0.9], [0.9, 0.1]])
    at_once = StageGraph(np.zeros(2, dtype=np.int64), (near,), (wrong,), alone, 0.35, 2.0)
    assert solve_joint_path(at_once, prune_links(at_once), _MANY).blobs[0].tolist() == [1, 0]
    later = replace(at_once, distance_costs=(near, apart), appearance_costs=(wrong, right), shared=alone * 2)
    assert solve_joint_path(later, prune_links(later), _MANY).blobs.tolist() == [[0, 1], [0, 1]]
