"""How unlike two tracks of one person are: relative positions, appearance and motion (Todor 2009, 7.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.baselines.track_graphs.interaction_graph import GraphNode, InteractionGraph, Tracklet
from tracking.boxes import Floats
from tracking.model.object_state import mean_histogram

_BINS, _PEOPLE_PER_BIN = 6, 2
"""Bins of the number of people on one side, and numbers in a bin."""
_VELOCITY_S = 0.5
"""Seconds at a track's end from which its velocity is measured."""


@dataclass(frozen=True, slots=True)
class SimilaritySettings:
    """Weights of the parts of the distance.

    Raises:
        ValueError: a setting is out of range.
    """

    close_s: float = 1.0  # gap between two tracks up to which their ends are compared
    end_share: float = 0.3  # weight of appearance, and of motion, at the ends of tracks that are close
    relative_share: float = 0.3  # weight of relative positions, beside appearance, over whole tracks

    def __post_init__(self) -> None:
        if not 0.0 <= self.end_share <= 0.5 or not 0.0 <= self.relative_share <= 1.0:  # noqa: PLR2004
            raise ValueError("end_share must be between 0 and 0.5, relative_share between 0 and 1")


def relative_histograms(graph: InteractionGraph, tracklets: Sequence[Tracklet]) -> list[Floats]:
    """Return for each node the histogram `(6^4,)` of the numbers of people left, right, before and behind.

    A frame counts once. Whose center is left is left, whose feet are lower is before; people of a group count
    each. Rows of nodes with several people are of no use.
    """
    last = max((node.last for node in graph.nodes), default=-1)
    present: list[list[tuple[int, float, float]]] = [[] for _ in range(last + 1)]
    for index, node in enumerate(graph.nodes):
        for frame in range(node.first, node.last + 1):
            box = tracklets[node.tracklet].box(frame)
            present[frame].append((index, float(box[0] + box[2]) / 2.0, float(box[3])))
    people = np.array([graph.people(node) for node in range(len(graph.nodes))])
    histograms = [np.zeros(_BINS**4) for _ in graph.nodes]
    for row in present:
        if not row:
            continue
        indices = np.array([index for index, _, _ in row])
        x, feet = (np.array([entry[axis] for entry in row]) for axis in (1, 2))
        sides = (
            x[None] < x[:, None],
            x[None] > x[:, None],
            feet[None] > feet[:, None],
            feet[None] < feet[:, None],
        )
        counts = np.stack([side @ people[indices] for side in sides], axis=1)
        bins = np.minimum(counts // _PEOPLE_PER_BIN, _BINS - 1) @ (_BINS ** np.arange(4))
        for index, place in zip(indices.tolist(), bins.tolist(), strict=True):
            histograms[index][place] += 1.0
    return [histogram / max(histogram.sum(), 1.0) for histogram in histograms]


class TrackDistance:
    """The distance I of two nodes with one person each, in [0, 1]."""

    def __init__(
        self, graph: InteractionGraph, tracklets: Sequence[Tracklet], settings: SimilaritySettings, fps: float
    ) -> None:
        self._nodes, self._tracklets, self._settings, self._fps = graph.nodes, tracklets, settings, fps
        self._relative = relative_histograms(graph, tracklets)
        self._known: dict[tuple[int, int], float] = {}

    def __call__(self, before: int, after: int) -> float:
        """Return I; `before` ends before `after` begins."""
        if (before, after) not in self._known:
            self._known[before, after] = self._compared(before, after)
        return self._known[before, after]

    def _compared(self, before: int, after: int) -> float:
        first, second, settings = self._nodes[before], self._nodes[after], self._settings
        relative = 1.0 - float(np.sqrt(self._relative[before] * self._relative[after]).sum())
        looks = _look_distance(self._look(first), self._look(second))
        share = settings.relative_share
        whole = relative if looks is None else share * relative + (1.0 - share) * looks
        if second.first - first.last > settings.close_s * self._fps:
            return whole
        ends = _look_distance(self._look(first, at=first.last), self._look(second, at=second.first))
        alpha = settings.end_share
        return (
            (1.0 - 2.0 * alpha) * whole
            + alpha * (whole if ends is None else ends)
            + alpha * self._motion(first, second)
        )

    def _look(self, node: GraphNode, at: int | None = None) -> Floats | None:
        """Return the mean histogram of a node, or that nearest to a frame; `None` without any."""
        found = [
            (frame, histogram)
            for frame, histogram in self._tracklets[node.tracklet].histograms
            if node.first <= frame <= node.last
        ]
        if not found:
            return None
        if at is not None:
            return min(found, key=lambda entry: abs(entry[0] - at))[1]
        return mean_histogram(np.stack([histogram for _, histogram in found]))

    def _motion(self, first: GraphNode, second: GraphNode) -> float:
        """Return the distance of the second's begin from the first's extrapolation, in heights, up to 1."""
        tracklet = self._tracklets[first.tracklet]
        last = tracklet.box(first.last)
        earlier = max(first.last - round(_VELOCITY_S * self._fps), first.first)
        velocity = (_center(last) - _center(tracklet.box(earlier))) / max(first.last - earlier, 1)
        expected = _center(last) + (second.first - first.last) * velocity
        begin = self._tracklets[second.tracklet].box(second.first)
        height = max(float(last[3] - last[1]), 1.0)
        return min(float(np.hypot(*(_center(begin) - expected))) / height, 1.0)


def _center(box: Floats) -> Floats:
    return np.asarray((box[:2] + box[2:]) / 2.0)


def _look_distance(first: Floats | None, second: Floats | None) -> float | None:
    """Return the appearance distance of two histograms, `None` if one is missing or empty."""
    if first is None or second is None or not len(first):
        return None
    return float(appearance_distance_matrix(first[None], second[None])[0, 0])
