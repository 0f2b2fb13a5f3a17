"""The network of one window: the places that each object can be in, and the costs of moving between them.

Paper II.B, Fig. 4. The observations of a frame are padded to K places; the last node, after them, is the
occlusion node, so that index -1 always means occluded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools, clique_rows, conflict_relation, star_exclusions
from tracking.model.costs import (
    motion_costs,
    node_costs,
    sink_costs,
    source_costs,
    template_distances,
    transition_costs,
)
from tracking.model.object_state import Template
from tracking.model.observations import ObservationArrays, stack_observations
from tracking.model.settings import ConflictRows, CostSettings
from tracking.types import Detections

__all__ = [
    "CostSettings",
    "Network",
    "Template",
    "build_network",
    "build_network_per_object",
]


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """One window of M frames and n objects; S = K + 1 states per frame, the last one occlusion.

    The cost of the arc from state i of frame m to state j of frame m + 1 of object n is
    `pair[q, m, i, j] + node[n, m + 1, j]`, where q is `pair_sets[n]`; infinite if there is no such arc.

    Attributes:
        boxes: (P, M, K, 4) pixels, zero on padding. P = 1: all objects share the observations;
            otherwise P = n and set n belongs to object n.
        present: (P, M, K) bool, False on padding.
        source: (n, S) cost of the arc from the source s_n to a state of the first frame, without `node`.
        node: (n, M, S) cost of being in a state, the same for all arcs into it.
        pair: (Q, M - 1, S, S) cost of going from one state to another; Q = 1: the same for all objects,
            otherwise n.
        sink: (n, S) cost of the arc from a state of the last frame to the sink t_n.
        conflicts: (M, P K, P K) bool, places `p K + i` of a frame that occupy one region.
        conflict_rows: how conflicts become rows of the program.
        locations: (P, M, S, 4) location vectors of the layout term, pixels.
        layout: μ, cost per pixel.
    """

    boxes: Floats
    present: NDArray[np.bool_]
    source: Floats
    node: Floats
    pair: Floats
    sink: Floats
    conflicts: Bools
    conflict_rows: ConflictRows
    locations: Floats
    layout: float

    @property
    def objects(self) -> int:
        """The number n of objects."""
        return int(self.node.shape[0])

    @property
    def frames(self) -> int:
        """The number M of frames."""
        return int(self.node.shape[1])

    @property
    def max_places(self) -> int:
        """The number K of places in the fullest frame."""
        return int(self.node.shape[2]) - 1

    @property
    def shared(self) -> bool:
        """Whether all objects share one set of observations."""
        return len(self.boxes) == 1

    @property
    def sets(self) -> NDArray[np.int64]:
        """The index of each object's set of observations, (n,)."""
        return np.zeros(self.objects, dtype=np.int64) if self.shared else np.arange(self.objects)

    @property
    def pair_sets(self) -> NDArray[np.int64]:
        """The index into `pair` of each object, (n,)."""
        shared = len(self.pair) == 1
        return np.zeros(self.objects, dtype=np.int64) if shared else np.arange(self.objects)

    @property
    def owners(self) -> NDArray[np.int64] | None:
        """The object of each place `p K + i`, (P K,); None if all objects share them."""
        return None if self.shared else np.repeat(np.arange(self.objects), self.max_places)

    def exclusions(self) -> Bools:
        """Return which places of each frame two objects cannot both take, (M, P K, P K)."""
        if self.conflict_rows == "clique":
            return self.conflicts
        return star_exclusions(self.conflicts, len(self.boxes), self.objects)

    def rows(self, frame: int) -> Bools:
        """Return the conflict rows of a frame, (R, n, K): at most one path passes through each."""
        relation = self.conflicts[frame]
        places = self.max_places
        if self.objects < 2 or not relation.size:  # noqa: PLR2004 — one object has no conflicts
            return np.zeros((0, self.objects, places), dtype=np.bool_)
        if self.conflict_rows == "clique":
            rows = clique_rows(relation, self.owners).reshape(-1, len(self.boxes), places)
            return np.broadcast_to(rows, (len(rows), self.objects, places))
        return self._stars(frame)

    def _stars(self, frame: int) -> Bools:
        """Return one row per place of each object: the place and the conflicting places of other objects."""
        sets, n, places = self.sets, self.objects, self.max_places
        relation = self.conflicts[frame].reshape(len(self.boxes), places, len(self.boxes), places)
        rows = relation[sets][:, :, sets].copy()
        for k in range(n):
            rows[k, :, k] = np.eye(places, dtype=np.bool_)
        used = self.present[sets, frame].ravel()
        return np.asarray(rows.reshape(n * places, n, places)[used])

    def select(self, objects: Sequence[int]) -> Network:
        """Return the network of some of the objects, in the order given."""
        chosen = np.asarray(objects, dtype=np.int64)
        if self.shared:
            boxes, present = self.boxes, self.present
            conflicts, locations = self.conflicts, self.locations
        else:
            boxes, present = self.boxes[chosen], self.present[chosen]
            places = (chosen[:, None] * self.max_places + np.arange(self.max_places)).ravel()
            conflicts = self.conflicts[:, places[:, None], places]
            locations = self.locations[chosen]
        return Network(
            boxes=boxes,
            present=present,
            source=self.source[chosen],
            node=self.node[chosen],
            pair=self.pair if len(self.pair) == 1 else self.pair[chosen],
            sink=self.sink[chosen],
            conflicts=conflicts,
            conflict_rows=self.conflict_rows,
            locations=locations,
            layout=self.layout,
        )


def build_network(
    templates: Sequence[Template],
    frames: Sequence[Detections],
    settings: CostSettings,
    center: tuple[float, float] | None = None,
) -> Network:
    """Build the network of a window in which all objects share the observations of each frame.

    `templates` are the n objects in the frame before the window, `frames` the M frames after it.
    `center`, pixels, is where the layout term places an occluded object (II.D: the center of the image);
    None: the center of all observations.

    Raises:
        ValueError: there is no frame, or histograms have different numbers of bins.
    """
    return _build(templates, stack_observations([frames]), settings, center)


def build_network_per_object(
    templates: Sequence[Template],
    frames: Sequence[Sequence[Detections]],
    settings: CostSettings,
    center: tuple[float, float] | None = None,
) -> Network:
    """Build the network of a window in which each object has separate observations (template matching).

    `frames[n][m]` are the observations of object n in frame m; otherwise like `build_network`.

    Raises:
        ValueError: there is no object or no frame, lengths differ, or histograms have different numbers of
        bins.
    """
    if len(templates) != len(frames):
        raise ValueError(f"{len(templates)} templates need as many lists of frames, not {len(frames)}")
    return _build(templates, stack_observations(frames), settings, center)


def _build(
    templates: Sequence[Template],
    places: ObservationArrays,
    settings: CostSettings,
    center: tuple[float, float] | None,
) -> Network:
    distances = template_distances(templates, places, settings)
    motion = motion_costs(templates, distances, places, settings)
    return Network(
        boxes=places.boxes,
        present=places.present,
        source=source_costs(templates, distances, motion, places, settings),
        node=node_costs(distances, places, settings),
        pair=transition_costs(motion, places, settings),
        sink=sink_costs(len(templates), places, settings),
        conflicts=conflict_relation(places, settings),
        conflict_rows=settings.conflict_rows,
        locations=_locations(places, center),
        layout=settings.layout,
    )


def _locations(places: ObservationArrays, center: tuple[float, float] | None) -> Floats:
    """Return the location vectors r of II.D, (P, M, S, 4); occlusion is a box without size at `center`."""
    sets, frames, width = places.present.shape
    if center is None:
        observed = places.boxes[places.present]
        middle = (observed.min(axis=0) + observed.max(axis=0)) / 2.0 if len(observed) else np.zeros(BOX_SIDES)
        center = (float(middle[[0, 2]].mean()), float(middle[[1, 3]].mean()))
    locations = np.empty((sets, frames, width + 1, BOX_SIDES))
    locations[:] = (*center, *center)
    locations[:, :, :width][places.present] = places.boxes[places.present]
    return locations
