"""Recombination: each object takes one of its known paths, so that all together cost little."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.objective import Ints, path_costs

_MAX_PATHS = 240
"""Most paths that are compared in pairs."""

_CHANGES_PER_OBJECT = 8
"""Limit of the changes, far above what convergence takes."""

_PAIR_FRAME, _PAIR_CHANGE = 8e-9, 1e-8
"""Seconds of work for a pair of paths and a frame, and for a pair that is compared once more."""

_MIN_GAIN = 1e-9
"""Relative gain below which costs count as equal."""


def recombine(network: Network, known: Sequence[Ints], power: int, meter: BudgetMeter) -> Ints:
    """Return nodes (n, M) without conflicts, from the first of `known`, which has none.

    Each of `known` are paths (n, M) of all objects. One or two objects at a time change to another known path
    of theirs, whichever gains most, until none does. `power` is that of the layout term.
    """
    objects = network.objects
    known = known[: max(1, _MAX_PATHS // objects)]
    owners = np.tile(np.arange(objects), len(known))
    nodes = np.concatenate(known)
    costs = np.concatenate([path_costs(network, paths) for paths in known])
    _, first = np.unique(np.column_stack([owners, nodes]), axis=0, return_index=True)
    # The first choice stays, in front.
    kept = np.sort(first[np.isfinite(costs[first]) | (first < objects)])
    owners, nodes, costs = owners[kept], nodes[kept], costs[kept]
    meter.work_s += _PAIR_FRAME * len(kept) ** 2 * network.frames
    together = _costs_together(network, owners, nodes, power)
    # Conflicts are dearer than whatever could be gained.
    dear = 1.0 + 2.0 * float(np.abs(costs[np.isfinite(costs)]).sum() + together[np.isfinite(together)].sum())
    together[np.isinf(together)] = dear
    costs[np.isinf(costs)] = dear
    chosen = np.arange(objects)
    for _ in range(_CHANGES_PER_OBJECT * objects):
        if meter.reached():
            break
        meter.work_s += _PAIR_CHANGE * len(kept) ** 2
        change = _changes(costs, together, owners, chosen)
        best = np.unravel_index(int(change.argmin()), change.shape)
        if not change[best] < -_MIN_GAIN * max(1.0, float(np.abs(costs[chosen]).sum())):
            break
        chosen[owners[list(best)]] = best
    return np.asarray(nodes[chosen])


def _changes(costs: Floats, together: Floats, owners: Ints, chosen: Ints) -> Floats:
    """Return how the total cost changes if the owners of two paths change to them, (T, T), or one does.

    `costs` (T,) are those of the paths, `together` (T, T) more for each pair; `chosen` (n,) are those now.
    """
    with_chosen = together[:, chosen]
    own = costs + with_chosen.sum(axis=1) - with_chosen[np.arange(len(owners)), owners]
    single = own - own[chosen][owners]
    with_other = with_chosen[:, owners]
    before = with_chosen[chosen][:, owners][owners]
    change = single[:, None] + single + together - with_other - with_other.T + before
    change[owners[:, None] == owners] = np.inf
    np.fill_diagonal(change, single)
    return np.asarray(change)


def _costs_together(network: Network, owners: Ints, nodes: Ints, power: int) -> Floats:
    """Return what pairs of paths (T, M) cost beside their own costs, (T, T): infinite in conflict."""
    frames, places, sets = np.arange(network.frames), network.max_places, network.sets[owners]
    moves = np.diff(network.locations[sets[:, None], frames, nodes], axis=1).reshape(len(nodes), -1)
    costs = np.empty((len(nodes), len(nodes)))
    for row, own in enumerate(moves):
        costs[row] = network.layout * (np.abs(moves - own) ** power).sum(axis=1)
    exclusions = network.exclusions()
    if exclusions.size:
        visible = nodes < places
        index = np.where(visible, sets[:, None] * places + nodes, 0)
        for m in range(network.frames):
            excluded = exclusions[m][np.ix_(index[:, m], index[:, m])]
            costs[excluded & visible[:, m, None] & visible[:, m]] = np.inf
    np.fill_diagonal(costs, 0.0)
    return costs
