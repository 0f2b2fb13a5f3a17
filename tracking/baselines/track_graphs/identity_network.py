"""The track graph as a Bayesian network: who is in each track, most probably (Todor 2009, 7.2, 7.3).

Every node in which several people are and that has several ways out has a variable: which of its people go
which way, `Π C(N - n_1 - … - n_{i-1}, n_i)` states. Two tracks of one person each, on the same path, have a
distance I. With the pairs of a path that lie at most `horizon` variables apart (the network is reduced, as
theirs is), a joint state has the probability `Π exp(-λ I)`. Each pair and each way between them is a factor
over the variables on that way; variable elimination finds the most probable state exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.track_graphs.interaction_graph import InteractionGraph
from tracking.baselines.track_graphs.variable_elimination import Factor, TableTooLargeError, minimize

State = tuple[int, ...]
"""Where each person of a node goes: the index of a way out."""
_GONE = -1
"""The node behind a way out on which people disappear."""
_MAX_FACTOR = 4096
"""States of a factor, beyond which a pair is left out."""


@dataclass(frozen=True, slots=True)
class _Way:
    """A way out of a node: the next node, the place of its first person there, and how many take it."""

    node: int
    offset: int
    people: int


class IdentityNetwork:
    """The network of a graph.

    People have places in a node, from 0: first those of each incoming link in the order of links, then those
    who appear. People who take the same way keep their order.
    """

    def __init__(self, graph: InteractionGraph) -> None:
        self._graph = graph
        self._ways = _ways_out(graph)
        self._people = [graph.people(node) for node in range(len(graph.nodes))]
        self.states: dict[int, list[State]] = {
            node: list(_partitions([way.people for way in ways]))
            for node, ways in enumerate(self._ways)
            if len(ways) > 1
        }
        """The states of each node that has a variable."""

    def solve(self, distance: Callable[[int, int], float], horizon: int = 3) -> tuple[float, dict[int, int]]:
        """Return the least total distance, and the index of the state of each node with a variable.

        Args:
            distance: I of two nodes with one person each; the first ends before the second begins.
            horizon: variables between two nodes at most; fewer where tables would be too large.
        """
        sizes = {node: len(states) for node, states in self.states.items()}
        while True:
            try:
                return minimize(self.factors(distance, horizon), sizes)
            except TableTooLargeError:
                if horizon == 1:
                    raise
                horizon -= 1

    def factors(self, distance: Callable[[int, int], float], horizon: int) -> Iterator[Factor]:
        """Yield the factors of all pairs."""
        for node, people in enumerate(self._people):
            if people == 1:
                yield from self._from(node, node, 0, (), distance, horizon)

    def people_of(self, states: dict[int, int]) -> list[list[int]]:
        """Return the persons in each node, by place: numbers from 0 in order of appearance."""
        persons = [[_GONE] * people for people in self._people]
        numbers = count()
        for node in range(len(persons)):  # in order of time
            persons[node] = [next(numbers) if who == _GONE else who for who in persons[node]]
            for place, who in enumerate(persons[node]):
                after, there = self._next(node, place, states.get(node, 0))
                if after != _GONE:
                    persons[after][there] = who
        return persons

    def _next(self, node: int, place: int, state: int) -> tuple[int, int]:
        """Return the next node of a person, and the place there."""
        ways = self._ways[node]
        taken = self.states[node][state] if node in self.states else (0,) * self._people[node]
        way = ways[taken[place]]
        return way.node, way.offset + taken[:place].count(taken[place])

    def _from(
        self,
        source: int,
        node: int,
        place: int,
        passed: tuple[tuple[int, NDArray[np.bool_]], ...],
        distance: Callable[[int, int], float],
        horizon: int,
    ) -> Iterator[Factor]:
        """Yield the factors of the pairs of `source` with all nodes behind a person's place in a node."""
        nexts: dict[tuple[int, int], list[int]] = {}
        for state in range(len(self.states[node]) if node in self.states else 1):
            nexts.setdefault(self._next(node, place, state), []).append(state)
        for (after, there), chosen in nexts.items():
            way = passed
            if node in self.states:
                mask = np.zeros(len(self.states[node]), dtype=np.bool_)
                mask[chosen] = True
                way = (*passed, (node, mask))
            if after == _GONE or len(way) > horizon:
                continue
            if self._people[after] == 1 and np.prod([len(mask) for _, mask in way]) <= _MAX_FACTOR:
                yield _indicator(way, distance(source, after))
            yield from self._from(source, after, there, way, distance, horizon)


def _ways_out(graph: InteractionGraph) -> list[list[_Way]]:
    offsets = [0] * len(graph.nodes)
    ways: list[list[_Way]] = [[] for _ in graph.nodes]
    for link, people in zip(graph.links, graph.flow, strict=True):
        if people:
            ways[link.before].append(_Way(link.after, offsets[link.after], people))
            offsets[link.after] += people
    for node, people in enumerate(graph.disappearing):
        if people:
            ways[node].append(_Way(_GONE, 0, people))
    return ways


def _partitions(people: Sequence[int]) -> Iterator[State]:
    """Yield all ways to send people, of whom so many take each way."""
    if not sum(people):
        yield ()
        return
    for way, left in enumerate(people):
        if left:
            rest = [number - (index == way) for index, number in enumerate(people)]
            for tail in _partitions(rest):
                yield (way, *tail)


def _indicator(way: Sequence[tuple[int, NDArray[np.bool_]]], cost: float) -> Factor:
    """Return the factor that costs so much where the state of each node on a way is in its mask."""
    table = np.array(cost)
    for _, mask in way:
        table = table[..., None] * mask
    order = np.argsort([node for node, _ in way])
    return Factor(tuple(sorted(node for node, _ in way)), np.asarray(table.transpose(order)))
