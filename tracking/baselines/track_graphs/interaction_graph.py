"""The graph of a recording's tracks: merges into groups, splits from them, and how many people are in each.

A track that ends touching another one merges into it, a track that begins touching another one splits from
it. At every event the other track is cut, so that a node is a track during which nobody joins or leaves
(Nillius, Sullivan, Carlsson, CVPR 2006; Todor 2009, 7.1). The numbers of people are the cheapest flow: one
person appears or disappears for nothing where nothing touches, further ones and those elsewhere at a price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog

from tracking.boxes import Floats, intersections

_MARGIN = 0.5
"""Widths around a box within which another one touches it."""
_ALONE, _TOGETHER, _BESIDE, _INSIDE = 0.0, 2.0, 1.5, 3.0
"""Cost of appearing: where nothing touches; there as a further person; beside a track; inside of one."""


@dataclass(slots=True, eq=False)
class Tracklet:
    """Consecutive boxes that belong together.

    Attributes:
        first: first frame.
        boxes: `(4,)` each, NaN where there is none; neither the first nor the last.
        histograms: mean histograms with the frames where they end.
    """

    first: int
    boxes: list[Floats]
    histograms: list[tuple[int, Floats]] = field(default_factory=list)

    @property
    def last(self) -> int:
        """The last frame."""
        return self.first + len(self.boxes) - 1

    def box(self, frame: int) -> Floats:
        """Return the box in a frame, or the last one before it."""
        index = frame - self.first
        while np.isnan(self.boxes[index][0]):
            index -= 1
        return self.boxes[index]


@dataclass(frozen=True, slots=True)
class GraphNode:
    """A tracklet's frames between two events.

    Attributes:
        tracklet: index of the tracklet.
        first: first frame.
        last: last frame.
    """

    tracklet: int
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class GraphLink:
    """People may go from one node to the next; some must if it is the same tracklet."""

    before: int
    after: int
    same: bool


@dataclass(frozen=True, slots=True)
class InteractionGraph:
    """Nodes, links, and the people in them.

    Attributes:
        nodes: in order of their first frames.
        links: between nodes; a node's links are in this order.
        flow: people of each link.
        appearing: people who appear at the beginning of each node.
        disappearing: people who disappear at the end of each node.
    """

    nodes: Sequence[GraphNode]
    links: Sequence[GraphLink]
    flow: Sequence[int]
    appearing: Sequence[int]
    disappearing: Sequence[int]

    def people(self, node: int) -> int:
        """Return the number of people in a node."""
        entering = (flow for link, flow in zip(self.links, self.flow, strict=True) if link.after == node)
        return self.appearing[node] + sum(entering)


def build_graph(tracklets: Sequence[Tracklet]) -> InteractionGraph:
    """Build the graph of a recording's tracklets, and count the people."""
    cuts: dict[int, set[int]] = {number: set() for number in range(len(tracklets))}
    merges, splits = [], []
    for number, tracklet in enumerate(tracklets):
        host = _touched(tracklets, number, tracklet.last, tracklet.last + 1)
        if host is not None:
            merges.append((number, host, tracklet.last + 1))
            cuts[host].add(tracklet.last + 1)
        host = _touched(tracklets, number, tracklet.first, tracklet.first - 1)
        if host is not None:
            splits.append((host, number, tracklet.first))
            cuts[host].add(tracklet.first)
    nodes = sorted(
        (
            GraphNode(number, first, end - 1)
            for number, tracklet in enumerate(tracklets)
            for first, end in _pieces(tracklet, cuts[number])
        ),
        key=lambda node: (node.first, node.tracklet),
    )
    begins = {(node.tracklet, node.first): index for index, node in enumerate(nodes)}
    ends = {(node.tracklet, node.last + 1): index for index, node in enumerate(nodes)}
    links = [
        GraphLink(ends[number, cut], begins[number, cut], same=True)
        for number, found in cuts.items()
        for cut in sorted(found)
    ]
    links += [GraphLink(ends[number, at], begins[host, at], same=False) for number, host, at in merges]
    links += [GraphLink(ends[host, at], begins[number, at], same=False) for host, number, at in splits]
    return _with_counts(nodes, links, tracklets)


def _pieces(tracklet: Tracklet, cuts: set[int]) -> list[tuple[int, int]]:
    limits = [tracklet.first, *sorted(cuts), tracklet.last + 1]
    return list(pairwise(limits))


def _touched(tracklets: Sequence[Tracklet], number: int, frame: int, beyond: int) -> int | None:
    """Return the tracklet that one's box in `frame` touches most, of those that are also `beyond` it."""
    box = tracklets[number].box(frame)
    margin = _MARGIN * (box[2] - box[0])
    around = box + np.array([-margin, -margin, margin, margin])
    best, host = 0.0, None
    for other, candidate in enumerate(tracklets):
        if other == number or not all(candidate.first <= at <= candidate.last for at in (frame, beyond)):
            continue
        shared = float(intersections(candidate.box(frame), around))
        if shared > best:
            best, host = shared, other
    return host


def _with_counts(
    nodes: Sequence[GraphNode], links: Sequence[GraphLink], tracklets: Sequence[Tracklet]
) -> InteractionGraph:
    """Count the people by the cheapest flow; it is integral, as the costs are of a network."""
    n, m = len(nodes), len(links)
    # Columns: the links, then for each node the first and further people who appear, and disappear.
    costs = np.zeros(m + 4 * n)
    balance, entering = np.zeros((n, m + 4 * n)), np.zeros((n, m + 4 * n))
    for column, link in enumerate(links):
        balance[link.after, column] += 1.0
        entering[link.after, column] = 1.0
        balance[link.before, column] -= 1.0
    has_in, has_out = ({getattr(link, side) for link in links} for side in ("after", "before"))
    for index, node in enumerate(nodes):
        begins, ends = (
            node.first == tracklets[node.tracklet].first,
            node.last == tracklets[node.tracklet].last,
        )
        for offset, sign, linked, at_end in ((0, 1.0, has_in, begins), (2 * n, -1.0, has_out, ends)):
            first, further = m + offset + 2 * index, m + offset + 2 * index + 1
            alone = index not in linked
            costs[first] = _ALONE if alone else _BESIDE if at_end else _INSIDE
            costs[further] = max(_TOGETHER, costs[first] + 0.5)
            balance[index, [first, further]] = sign
        entering[index, [m + 2 * index, m + 2 * index + 1]] = 1.0
    bounds = [(float(link.same), np.inf) for link in links]
    bounds += [(0.0, 1.0 if column % 2 == 0 else np.inf) for column in range(4 * n)]
    if not n:
        return InteractionGraph((), (), (), (), ())
    found = linprog(costs, -entering, -np.ones(n), balance, np.zeros(n), bounds, method="highs-ds")
    counts = np.rint(np.asarray(found.x)).astype(int)
    appear, vanish = (counts[m + at : m + at + 2 * n].reshape(n, 2).sum(axis=1) for at in (0, 2 * n))
    return InteractionGraph(nodes, links, counts[:m].tolist(), appear.tolist(), vanish.tolist())
