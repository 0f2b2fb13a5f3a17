"""Costs of the network's nodes and arcs (paper II.B), and motion costs, which are not in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.boxes import BOX_SIDES, Floats, corner_distance_in_heights, mean_corner_distance
from tracking.model.motion import MotionModel
from tracking.model.object_state import Template
from tracking.model.observations import ObservationArrays
from tracking.model.settings import CostSettings


@dataclass(frozen=True, slots=True, eq=False)
class MotionCosts:
    """Motion costs of the arcs to each observation; 0 for objects with unknown motion.

    Attributes:
        moving: (n, M, K) for arcs from another observation.
        reappearing: (n, M, K) for arcs out of an occlusion; infinite if the observation is too far from the
            predicted position, or its appearance too different.
    """

    moving: Floats
    reappearing: Floats


def motion_costs(
    templates: Sequence[Template], distances: Floats, places: ObservationArrays, settings: CostSettings
) -> MotionCosts | None:
    """Return the motion costs of all objects, or `None` if all are 0.

    `distances` (n, M, K): appearance distances to the templates.
    """
    known = any(template.motion is not None for template in templates)
    if not known or not (settings.motion or settings.reappearance):
        return None
    boxes = np.broadcast_to(places.boxes, (len(templates), *places.boxes.shape[1:]))
    costs = MotionCosts(np.zeros(distances.shape), np.zeros(distances.shape))
    for n, template in enumerate(templates):
        if template.motion is not None:
            costs.moving[n], costs.reappearing[n] = _object_motion_costs(
                template.motion, boxes[n], distances[n], settings
            )
    return costs


def _object_motion_costs(
    motion: MotionModel, boxes: Floats, distances: Floats, settings: CostSettings
) -> tuple[Floats, Floats]:
    """Return the costs `moving` and `reappearing` of one object for boxes (M, K, 4), both (M, K)."""
    deviations, elapsed = motion.deviations_in_heights(boxes), motion.damped_elapsed(len(boxes))[:, None]
    share = np.minimum(deviations / (settings.motion_slack + settings.motion_drift * elapsed), 1.0)
    moving = settings.motion * share
    if not settings.reappearance:
        return moving, moving
    share = deviations / (settings.motion_slack + settings.reappearance_drift * elapsed)
    reappearing = moving + settings.reappearance * share**2
    reappearing[(share > 1.0) | (distances > settings.reappearance_max_distance)] = np.inf
    return moving, reappearing


def node_costs(distances: Floats, places: ObservationArrays, settings: CostSettings) -> Floats:
    """Return the node costs, (n, M, S), of observations at `distances` (n, M, K) and of the occlusion."""
    objects, frames, width = distances.shape
    costs = np.empty((objects, frames, width + 1))
    score_costs = settings.confidence * (1.0 - places.scores)
    costs[:, :, :width] = distances + score_costs
    costs[:, :, :width][~np.broadcast_to(places.present, costs[:, :, :width].shape)] = np.inf
    costs[:, :, width] = settings.hidden
    return costs


def source_costs(
    templates: Sequence[Template],
    distances: Floats,
    motion: MotionCosts | None,
    places: ObservationArrays,
    settings: CostSettings,
) -> Floats:
    """Return the costs of arcs from the source without the node, (n, S); `distances` is (n, M, K)."""
    width = places.present.shape[2]
    costs = np.full((len(templates), width + 1), settings.change)
    costs[:, width] = 0.0
    first_boxes = np.broadcast_to(places.boxes[:, 0], (len(templates), width, BOX_SIDES))
    for n, template in enumerate(templates):
        if template.box is not None:
            moved = _displacement_costs(template.box[None], first_boxes[n], settings)[0]
            costs[n, :width] = settings.appearance * distances[n, 0] + moved
            costs[n, width] = settings.disappearance
        if motion is not None:
            first = motion.reappearing if template.box is None else motion.moving
            costs[n, :width] += first[n, 0]
    return costs


def transition_costs(motion: MotionCosts | None, places: ObservationArrays, settings: CostSettings) -> Floats:
    """Return the costs of arcs between two frames without the node, (Q, M - 1, S, S).

    Q is the number of sets of observations, or n if the motion of any object is known.
    """
    sets, frames, width = places.present.shape
    steps = max(frames - 1, 0)
    before, after = places.histograms[:, :-1], places.histograms[:, 1:]
    between = settings.appearance * appearance_distance_matrix(before, after, settings.measure)
    between += _displacement_costs(places.boxes[:, :-1], places.boxes[:, 1:], settings)
    costs = np.zeros((sets if motion is None else len(motion.moving), steps, width + 1, width + 1))
    costs[:, :, width, :width] = settings.change
    costs[:, :, :width, width] = settings.disappearance
    if motion is None:
        costs[:, :, :width, :width] = between
        return costs
    # The largest array of a window: it is written once.
    np.add(between, motion.moving[:, 1:, None], out=costs[:, :, :width, :width])
    costs[:, :, width, :width] += motion.reappearing[:, 1:]
    return costs


def sink_costs(objects: int, places: ObservationArrays, settings: CostSettings) -> Floats:
    """Return the constant costs of arcs to the sink, (n, S)."""
    return np.full((objects, places.present.shape[2] + 1), settings.hidden)


def _displacement_costs(before: Floats, after: Floats, settings: CostSettings) -> Floats:
    """Return the cost of moving from boxes (..., I, 4) to boxes (..., J, 4), (..., I, J)."""
    before, after = before[..., :, None, :], after[..., None, :, :]
    in_heights = settings.displacement_unit == "heights"
    moved = (corner_distance_in_heights if in_heights else mean_corner_distance)(before, after)
    costs = settings.displacement * moved
    if settings.gate is not None:
        costs[moved > settings.gate] = np.inf
    return costs


def template_distances(
    templates: Sequence[Template], places: ObservationArrays, settings: CostSettings
) -> Floats:
    """Return the appearance distance of each template to each place: g(s_n, v), (n, M, K)."""
    sets, frames, width, bins = places.histograms.shape
    distances = np.full((len(templates), frames, width), settings.unknown_appearance)
    known = [n for n, template in enumerate(templates) if template.histogram.size and bins]
    if not known:
        return distances
    wrong = {templates[n].histogram.size for n in known} - {bins}
    if wrong:
        raise ValueError(f"templates need histograms of {bins} bins like the frames, not {sorted(wrong)}")
    histograms = np.array([templates[n].histogram for n in known])
    if sets == 1:
        observed = places.histograms.reshape(frames * width, bins)
        table = appearance_distance_matrix(histograms, observed, settings.measure)
        distances[known] = table.reshape(len(known), frames, width)
    else:
        own = places.histograms[known].reshape(len(known), frames * width, bins)
        table = appearance_distance_matrix(histograms[:, None], own, settings.measure)
        distances[known] = table.reshape(len(known), frames, width)
    return distances
