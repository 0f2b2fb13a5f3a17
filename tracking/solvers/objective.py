"""Costs and conflicts of states: the discrete problem of paper II.C."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED

Ints = NDArray[np.int64]


def nodes_from_states(network: Network, states: Ints) -> Ints:
    """Return node numbers for states: the occlusion node is the last one instead of -1."""
    return np.where(states == OCCLUDED, network.max_places, states)


def states_from_nodes(network: Network, nodes: Ints) -> Ints:
    """Return states for node numbers: occluded is -1."""
    return np.where(nodes == network.max_places, OCCLUDED, nodes)


def path_costs(network: Network, nodes: Ints) -> Floats:
    """Return the cost (n,) of each object's path through `nodes` (n, M); infinite where an arc is missing."""
    each = np.arange(network.objects)
    frames = np.arange(network.frames)
    visited = network.node[each[:, None], frames, nodes].sum(axis=1)
    between = network.pair[network.pair_sets[:, None], frames[:-1], nodes[:, :-1], nodes[:, 1:]].sum(axis=1)
    ends = network.source[each, nodes[:, 0]] + network.sink[each, nodes[:, -1]]
    return np.asarray(visited + between + ends)


def path_cost(network: Network, nodes: Ints, owner: int) -> float:
    """Return the cost of one object's path through `nodes` (M,); infinite where an arc is missing."""
    frames = np.arange(network.frames)
    visited = network.node[owner, frames, nodes].sum()
    between = network.pair[network.pair_sets[owner], frames[:-1], nodes[:-1], nodes[1:]].sum()
    return float(visited + between + network.source[owner, nodes[0]] + network.sink[owner, nodes[-1]])


def unweighted_layout_cost(network: Network, nodes: Ints, power: int = 1) -> float:
    """Return the layout term of II.C without its weight μ, over all pairs of objects.

    `power` 1: the L1 norm, pixels; 2: the square of the L2 norm, square pixels.
    """
    moves = np.diff(locations_at(network, nodes), axis=1)
    changes = (np.abs(moves[:, None] - moves[None]) ** power).sum(axis=(2, 3))
    return float(np.triu(changes, 1).sum())


def locations_at(network: Network, nodes: Ints) -> Floats:
    """Return the location vectors p of objects in `nodes`, (n, M, 4) pixels."""
    return network.locations[network.sets[:, None], np.arange(network.frames), nodes]


def total_cost(network: Network, nodes: Ints, power: int = 1) -> float:
    """Return the cost of all paths together, the layout term with its `power` included (II.C)."""
    total = float(path_costs(network, nodes).sum())
    if network.layout:
        total += network.layout * unweighted_layout_cost(network, nodes, power)
    return total


def conflict_count(network: Network, nodes: Ints) -> int:
    """Count the pairs of objects that exclude each other, over all frames."""
    exclusions = network.exclusions()
    visible = nodes < network.max_places
    places = np.where(visible, network.sets[:, None] * network.max_places + nodes, 0)
    first, second = np.triu_indices(network.objects, 1)
    if not exclusions.size or not len(first):
        return 0
    frames = np.arange(network.frames)
    excluded = exclusions[frames, places[first], places[second]]
    return int((excluded & visible[first] & visible[second]).sum())


def block_conflicting_nodes(
    network: Network, exclusions: NDArray[np.bool_], node: Floats, fixed: tuple[int, Ints]
) -> None:
    """Set the costs `node` (n, M, S) to infinity where others conflict with a `fixed` object and its path."""
    owner, path = fixed
    if not exclusions.size:
        return
    places, frames = network.max_places, np.arange(network.frames)
    visible = path < places
    index = np.where(visible, network.sets[owner] * places + path, 0)
    blocked = (exclusions[frames, index] & visible[:, None]).reshape(network.frames, -1, places)
    blocked = np.broadcast_to(np.swapaxes(blocked, 0, 1), (network.objects, network.frames, places)).copy()
    blocked[owner] = False
    node[:, :, :places][blocked] = np.inf
