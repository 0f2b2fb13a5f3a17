"""The track graph as a Bayesian network: exact inference, numbers of people, and whole recordings."""

from __future__ import annotations

from itertools import combinations, product
from math import factorial, prod

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.strolls import WalkingPerson, detections_at, final_boxes
from fakes.tracking.windows import window_of_frames
from tracking import Detections
from tracking.baselines.track_graphs.identity_network import IdentityNetwork
from tracking.baselines.track_graphs.interaction_graph import (
    GraphLink,
    GraphNode,
    InteractionGraph,
    Tracklet,
    build_graph,
)
from tracking.baselines.track_graphs.relative_positions import SimilaritySettings, relative_histograms
from tracking.baselines.track_graphs.variable_elimination import Factor, TableTooLargeError, minimize
from tracking.baselines.track_graphs.whole_recording import WholeRecordingSettings, WholeRecordingTracker
from tracking.boxes import iou


@given(st.integers(0, 5000))
@settings(deadline=None, max_examples=60)
def test_elimination_finds_the_least_of_all_joint_states(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = {int(v): int(rng.integers(1, 4)) for v in rng.permutation(9)[: rng.integers(1, 6)]}
    factors = []
    for _ in range(rng.integers(0, 8)):
        scope = tuple(
            sorted(rng.choice(list(sizes), size=rng.integers(0, min(3, len(sizes)) + 1), replace=False))
        )
        factors.append(Factor(tuple(map(int, scope)), rng.normal(size=[sizes[v] for v in scope])))

    def cost(states: dict[int, int]) -> float:
        return sum(float(factor.table[tuple(states[v] for v in factor.scope)]) for factor in factors)

    everything = [
        dict(zip(sizes, states, strict=True)) for states in product(*(range(size) for size in sizes.values()))
    ]
    least, states = minimize(factors, sizes)
    assert least == pytest.approx(min(map(cost, everything)))
    assert cost(states) == pytest.approx(least)


def test_too_large_a_table_is_refused() -> None:
    with pytest.raises(TableTooLargeError, match="more than 8 states"):
        minimize([Factor((0, 1), np.zeros((3, 3)))], {0: 3, 1: 3}, max_states=8)


def _meetings(rng: np.random.Generator, people: int, rounds: int) -> InteractionGraph:
    """Return a graph of people who meet in groups of two or three, and part into tracks of one or two."""
    nodes, links, flow = [GraphNode(n, 0, 0) for n in range(people)], [], []
    open_nodes = [(n, 1) for n in range(people)]
    for at in range(1, rounds + 1):
        rng.shuffle(open_nodes)
        meeting, open_nodes = open_nodes[: rng.integers(2, 4)], open_nodes[3:] + open_nodes[:0]
        count = sum(size for _, size in meeting)
        group = len(nodes)
        nodes.append(GraphNode(group, 2 * at - 1, 2 * at - 1))
        links += [GraphLink(node, group, same=False) for node, _ in meeting]
        flow += [size for _, size in meeting]
        while count:
            size = int(min(rng.integers(1, 3), count))
            open_nodes.append((len(nodes), size))
            links.append(GraphLink(group, len(nodes), same=False))
            flow.append(size)
            nodes.append(GraphNode(len(nodes), 2 * at, 2 * at))
            count -= size
    entered, left = {link.after for link in links}, {link.before for link in links}
    graph = InteractionGraph(nodes, links, flow, [int(n not in entered) for n in range(len(nodes))], [])
    gone = [0 if n in left else graph.people(n) for n in range(len(nodes))]
    return InteractionGraph(nodes, links, flow, graph.appearing, gone)


@given(st.integers(0, 5000))
@settings(deadline=None, max_examples=40)
def test_the_most_probable_identities_are_the_best_of_all_joint_states(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = _meetings(rng, people=3, rounds=int(rng.integers(1, 4)))
    network, distances = IdentityNetwork(graph), rng.random((len(graph.nodes),) * 2)

    def total(states: dict[int, int]) -> float:
        """Add up the distances of all pairs of tracks with the same one person."""
        persons = [who[0] if len(who) == 1 else None for who in network.people_of(states)]
        return sum(
            distances[a, b]
            for a, b in combinations(range(len(persons)), 2)
            if persons[a] is not None and persons[a] == persons[b]
        )

    everything = [
        dict(zip(network.states, states, strict=True))
        for states in product(*(range(len(states)) for states in network.states.values()))
    ]
    least, states = network.solve(lambda a, b: float(distances[a, b]), horizon=99)
    assert least == pytest.approx(min(map(total, everything)))
    assert total(states) == pytest.approx(least)


def test_a_split_has_as_many_states_as_there_are_ways_to_part() -> None:
    graph = _meetings(np.random.default_rng(1), people=3, rounds=3)
    network = IdentityNetwork(graph)
    for node, states in network.states.items():
        parts = [flow for link, flow in zip(graph.links, graph.flow, strict=True) if link.before == node]
        assert len(states) == factorial(sum(parts)) // prod(map(factorial, parts))
        assert len(set(states)) == len(states)


def test_nobody_is_in_two_tracks_at_once_and_nobody_gets_lost() -> None:
    graph = _meetings(np.random.default_rng(3), people=3, rounds=3)
    network = IdentityNetwork(graph)
    for choice in range(4):
        persons = network.people_of({node: choice % len(states) for node, states in network.states.items()})
        assert {who for row in persons for who in row} == {0, 1, 2}
        assert all(len(set(row)) == len(row) for row in persons)


def _two_meetings() -> InteractionGraph:
    """Return the graph of two people who meet twice, as the groups 2 and 5."""
    pairs = [(0, 2), (1, 2), (2, 3), (2, 4), (3, 5), (4, 5), (5, 6), (5, 7)]
    nodes = [GraphNode(n, (n + 1) // 3, (n + 1) // 3) for n in range(8)]
    links = [GraphLink(before, after, same=False) for before, after in pairs]
    return InteractionGraph(nodes, links, [1] * 8, [1, 1, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1, 1])


@pytest.mark.parametrize("horizon", [1, 2])
def test_a_look_after_the_second_meeting_settles_the_first(horizon: int) -> None:
    """Tracks 3 and 4 are seen from behind: they resemble 6 and 7, but say nothing about 0 and 1."""
    alike = {
        (0, 7): 0.0,
        (1, 6): 0.0,
        (3, 6): 0.0,
        (4, 7): 0.0,
        (0, 6): 1.0,
        (1, 7): 1.0,
        (3, 7): 1.0,
        (4, 6): 1.0,
    }
    network = IdentityNetwork(_two_meetings())
    _, states = network.solve(lambda a, b: alike.get((a, b), 0.5), horizon)
    persons = network.people_of(states)
    assert [persons[6], persons[7]] == [persons[3], persons[4]]
    assert (persons[7] == persons[0]) is (horizon == 2)


def _walk(first: int, lefts: list[float], top: float = 0.0) -> Tracklet:
    boxes = [np.array([left, top, left + 20, top + 60]) for left in lefts]
    return Tracklet(first, boxes)


def test_people_are_counted_through_merges_and_splits() -> None:
    """A second person vanishes beside the first, and somebody appears there again."""
    host = _walk(0, [100.0] * 60)
    before, after = _walk(0, [60.0 + n for n in range(25)]), _walk(40, [110.0 + n for n in range(20)])
    graph = build_graph([host, before, after])
    people = {(node.tracklet, node.first): graph.people(n) for n, node in enumerate(graph.nodes)}
    assert people == {(0, 0): 1, (0, 25): 2, (0, 40): 1, (1, 0): 1, (2, 40): 1}
    assert sum(graph.appearing) == sum(graph.disappearing) == 2


def test_somebody_who_appears_beside_one_person_is_new_if_nobody_merged() -> None:
    graph = build_graph([_walk(0, [100.0] * 60), _walk(40, [110.0 + n for n in range(20)])])
    assert [graph.people(n) for n in range(len(graph.nodes))] == [1, 1, 1]
    assert sum(graph.appearing) == 2


@given(st.integers(0, 2000))
@settings(deadline=None, max_examples=25)
def test_relative_positions_equal_counted_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracklets = []
    for n in range(5):
        lefts = (200.0 * n + rng.uniform(0, 900, 6)).tolist()
        tracklets.append(_walk(int(rng.integers(0, 5)), lefts, float(rng.integers(0, 3))))
    graph = build_graph(tracklets)
    for index, (node, found) in enumerate(
        zip(graph.nodes, relative_histograms(graph, tracklets), strict=True)
    ):
        expected = np.zeros(6**4)
        for frame in range(node.first, node.last + 1):
            own = tracklets[node.tracklet].box(frame)
            sides = [0, 0, 0, 0]
            for other, there in enumerate(graph.nodes):
                if other == index or not there.first <= frame <= there.last:
                    continue
                box, people = tracklets[there.tracklet].box(frame), graph.people(other)
                sides[0] += people * (box[0] < own[0])
                sides[1] += people * (box[0] > own[0])
                sides[2] += people * (box[3] > own[3])
                sides[3] += people * (box[3] < own[3])
            expected[sum(min(side // 2, 5) * 6**axis for axis, side in enumerate(sides))] += 1
        assert found == pytest.approx(expected / expected.sum())


def _ids(frames: list[Detections], people: list[WalkingPerson]) -> list[set[int]]:
    tracker = WholeRecordingTracker(window_of_frames(6, 3))
    assert all(tracker.push(frame, seen) is None for frame, seen in enumerate(frames)), (
        "nothing before the end"
    )
    result = tracker.flush()
    assert result is not None
    ids: list[set[int]] = [set() for _ in people]
    for frame, boxes in final_boxes([result]).items():
        for number, box in boxes.items():
            near = [float(iou(box, np.array(person.box(frame)))) for person in people]
            if max(near) > 0.6:
                ids[int(np.argmax(near))].add(number)
    return ids


def test_a_person_who_walks_past_another_keeps_the_id() -> None:
    standing = WalkingPerson(200.0, 50.0, 0.0, 2)
    walking = WalkingPerson(50.0, 45.0, 3.0, 6)
    frames = [
        detections_at(
            [standing] if abs(walking.box(frame)[0] - 200.0) < 24.0 else [standing, walking], frame, 0.5, 3
        )
        for frame in range(100)
    ]
    ids = _ids(frames, [standing, walking])
    assert [len(numbers) for numbers in ids] == [1, 1]
    assert ids[0] != ids[1]


def test_a_long_recording_is_decided_in_parts_with_new_ids() -> None:
    person = WalkingPerson(50.0, 45.0, 0.5, 6)
    tracker = WholeRecordingTracker(window_of_frames(6, 3), WholeRecordingSettings(recording_s=1.0), fps=25.0)
    results = [tracker.push(frame, detections_at([person], frame)) for frame in range(60)]
    found = [result for result in (*results, tracker.flush()) if result is not None]
    assert [(result.first, result.final_to) for result in found] == [(0, 24), (25, 49), (50, 59)]


@pytest.mark.parametrize("wrong", [{"tracklet_gap_s": -1.0}, {"recording_s": 0.0}, {"horizon": 0}])
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        WholeRecordingSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [{"end_share": 0.6}, {"relative_share": 1.5}])
def test_invalid_similarities_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be between"):
        SimilaritySettings(**wrong)
