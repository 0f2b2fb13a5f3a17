"""Random windows for solver tests, and their optimum by exhaustive search."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from hypothesis import strategies as st

from tracking.model.motion import MotionModel
from tracking.model.network import CostSettings, Network, Template, build_network, build_network_per_object
from tracking.model.settings import PAPER_COSTS
from tracking.solvers.objective import conflict_count, total_cost
from tracking.types import Detections

BINS = 4
SETTINGS = replace(PAPER_COSTS, conflict_rows="clique")
SPARSE = 0.3
"""Share of windows and frames with fewer observations, down to none."""
MOTION = {"motion": 0.2, "reappearance": 1.0, "disappearance": 1.0}
"""Weights of each object's own motion, which the paper does not have."""


@dataclass(frozen=True)
class Case:
    """The parameters of a random window."""

    objects: int
    frames: int
    places: int
    shared: bool
    settings: CostSettings
    seed: int


@st.composite
def cases(
    draw: st.DrawFn,
    *,
    objects: int = 3,
    frames: int = 3,
    places: int = 3,
    layouts: tuple[float, ...] = (0.0,),
    stars: bool = True,
) -> Case:
    """Draw a window: ties, empty frames, gates, own observations, and motion of each object included."""
    seed = draw(st.integers(0, 2**32 - 1))
    # Sizes come from the seed, not from hypothesis, which would draw mostly the smallest windows.
    rng = np.random.default_rng(seed)
    settings = replace(
        SETTINGS,
        layout=float(rng.choice(layouts)),
        gate=None if rng.integers(2) else 40.0,
        conflict_rows="star" if stars and rng.integers(2) else "clique",
        conflict_distance=float(rng.choice([40.0, 120.0])),
        **(MOTION if rng.integers(2) else {}),
    )
    return Case(
        objects=int(rng.integers(1, objects + 1)),
        frames=int(rng.integers(1, frames + 1)),
        places=int(rng.integers(0 if rng.uniform() < SPARSE else places, places + 1)),
        shared=bool(rng.integers(2)),
        settings=settings,
        seed=seed,
    )


def network_of(case: Case) -> Network:
    """Build the window; odd seeds have whole coordinates and few appearances, hence ties."""
    rng = np.random.default_rng(case.seed)
    coarse = bool(case.seed % 2)

    def looks(count: int) -> np.ndarray:
        if coarse:
            return np.eye(BINS)[rng.integers(0, 2, count)]
        return rng.dirichlet(np.ones(BINS), count)

    def seen() -> Detections:
        count = int(rng.integers(0, case.places + 1)) if rng.uniform() < SPARSE else case.places
        corner = rng.integers(0, 5, (count, 2)) * 20.0 if coarse else rng.uniform(0.0, 100.0, (count, 2))
        return Detections(
            np.hstack([corner, corner + np.array([20.0, 50.0])]), rng.uniform(size=count), looks(count)
        )

    templates = []
    for index in range(case.objects):
        box = seen().boxes[:1].reshape(-1) if rng.uniform() < 0.8 else np.empty(0)
        motion = _motion(np.random.default_rng([case.seed, index]))
        templates.append(Template(index + 1, looks(1)[0], box if box.size else None, motion))
    if case.shared:
        return build_network(templates, [seen() for _ in range(case.frames)], case.settings)
    own = [[seen() for _ in range(case.frames)] for _ in range(case.objects)]
    return build_network_per_object(templates, own, case.settings)


def _motion(rng: np.random.Generator) -> MotionModel | None:
    """Return how an object moved before the window; `None`: unknown."""
    if rng.uniform() < SPARSE:
        return None
    corner = rng.uniform(0.0, 100.0, 2)
    box = np.concatenate([corner, corner + np.array([20.0, 50.0])])
    return MotionModel(box, rng.uniform(-250.0, 250.0, 2), int(rng.integers(1, 20)))


def exhaustive_optimum(network: Network) -> float:
    """Return the cost of the optimum by exhaustive search over all states."""
    states = range(network.max_places + 1)
    best = np.inf
    for flat in product(states, repeat=network.objects * network.frames):
        nodes = np.array(flat).reshape(network.objects, network.frames)
        cost = total_cost(network, nodes)
        if cost < best and conflict_count(network, nodes) == 0:
            best = cost
    return best
