"""Reversible jumps: a Markov chain over who is present, and where (Khan, Balch, Dellaert, PAMI 2005).

Each of N candidates is absent, or present in one of the M states of its pool. Pools are drawn from the
candidates' predictions, so that predictions cancel in the acceptance ratios, and the posterior is

    π(z) ∝ Π over present i of exp(log_odds[i, z_i]) / M · Π over present pairs of exp(-g overlap)

A move proposes a jump that adds a target of its group, the reverse jump that removes one, or another state
of a present target. Entering candidates are *added* and *deleted*, known ones *stay* and *leave*. A jump into
a state drawn uniformly from a pool is accepted with probability min(1, ratio of π · M · absent / (present +
1)): the last factor is that of the reverse jump's choice. The Jacobian is 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import log

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, intersections, iou

ABSENT = -1
"""The state of a candidate that is not present."""

_MOVES = 5
_ADD, _DELETE, _STAY, _LEAVE = range(4)
"""The moves; all further ones update a present target."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidatePools:
    """What the chain chooses from.

    Attributes:
        boxes: `(N, M, 4)`, states drawn from each candidate's prediction, in pixels.
        log_odds: `(N, M)`, log of the odds of being present with this state to being absent, alone.
        entering: `(N,)`, whether a candidate enters; the others are known.
    """

    boxes: Floats
    log_odds: Floats
    entering: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ChainLength:
    """Steps of the chain.

    Raises:
        ValueError: a setting is out of range.
    """

    samples: int = 60  # samples kept per image
    thinning: int = 4  # moves per candidate between two samples
    burn_in: int = 40  # moves per candidate before the first sample

    def __post_init__(self) -> None:
        if self.samples < 1 or self.thinning < 1 or self.burn_in < 0:
            raise ValueError("samples and thinning must be at least 1, burn_in at least 0")


def sample_targets(
    rng: np.random.Generator, pools: CandidatePools, overlap_weight: float, length: ChainLength
) -> NDArray[np.int64]:
    """Return samples of the posterior: `(samples, N)`, the pool's state of each candidate, or `ABSENT`."""
    candidates, size = pools.log_odds.shape
    steps = candidates * (length.burn_in + length.thinning * length.samples)
    samples = np.full((length.samples, candidates), ABSENT, dtype=np.int64)
    if not candidates:
        return samples
    chain = _Chain(pools, overlap_weight)
    moves = rng.integers(_MOVES, size=steps).tolist()
    states = rng.integers(size, size=steps).tolist()
    luck, log_uniform = rng.random(steps).tolist(), np.log(rng.random(steps)).tolist()
    for step in range(steps):
        chain.move(moves[step], luck[step], states[step], log_uniform[step])
        index, rest = divmod(step + 1 - candidates * length.burn_in, candidates * length.thinning)
        if index >= 1 and not rest:
            samples[index - 1] = chain.state
    return samples


class _Chain:
    """The chain's state, and its moves."""

    def __init__(self, pools: CandidatePools, overlap_weight: float) -> None:
        self.state = [ABSENT] * len(pools.log_odds)
        self._log_odds: list[list[float]] = pools.log_odds.tolist()
        self._penalties = _pair_penalties(pools.boxes, overlap_weight)
        entering = pools.entering.tolist()
        self._group = [int(not new) for new in entering]
        numbers = range(len(entering))
        self._absent = [[n for n in numbers if entering[n]], [n for n in numbers if not entering[n]]]
        self._present: list[list[int]] = [[], []]

    def move(self, move: int, luck: float, state: int, log_uniform: float) -> None:
        """Propose and accept or reject one move; `luck` in [0, 1) chooses the candidate."""
        if move in {_ADD, _STAY}:
            self._appear(int(move == _STAY), luck, state, log_uniform)
        elif move in {_DELETE, _LEAVE}:
            self._vanish(int(move == _LEAVE), luck, log_uniform)
        else:
            self._update(luck, state, log_uniform)

    def _appear(self, group: int, luck: float, state: int, log_uniform: float) -> None:
        absent, present = self._absent[group], self._present[group]
        if not absent:
            return
        n = absent[int(luck * len(absent))]
        ratio = self._gain(n, state) + log(len(absent)) - log(len(present) + 1)
        if log_uniform < ratio:
            self.state[n] = state
            absent.remove(n)
            present.append(n)

    def _vanish(self, group: int, luck: float, log_uniform: float) -> None:
        absent, present = self._absent[group], self._present[group]
        if not present:
            return
        n = present[int(luck * len(present))]
        ratio = -self._gain(n, self.state[n]) + log(len(present)) - log(len(absent) + 1)
        if log_uniform < ratio:
            self.state[n] = ABSENT
            present.remove(n)
            absent.append(n)

    def _update(self, luck: float, state: int, log_uniform: float) -> None:
        present = len(self._present[0]) + len(self._present[1])
        if not present:
            return
        index = int(luck * present)
        n = (*self._present[0], *self._present[1])[index]
        if log_uniform < self._gain(n, state) - self._gain(n, self.state[n]):
            self.state[n] = state

    def _gain(self, n: int, state: int) -> float:
        """Return the log of the ratio of π with candidate n in a state to π without it."""
        gain = self._log_odds[n][state]
        for other, penalties in self._penalties[n].items():
            if self.state[other] != ABSENT:
                gain -= penalties[state][self.state[other]]
        return gain


def _pair_penalties(boxes: Floats, weight: float) -> list[dict[int, list[list[float]]]]:
    """Return by candidate, and by other candidate whose pool it meets, the penalties of their states."""
    found: list[dict[int, list[list[float]]]] = [{} for _ in boxes]
    if weight <= 0.0:
        return found
    spans = np.concatenate([boxes[..., :2].min(axis=1), boxes[..., 2:].max(axis=1)], axis=-1)
    meets = intersections(spans[:, None], spans[None]) > 0.0
    for first, second in combinations(range(len(boxes)), 2):
        if meets[first, second]:
            penalties = weight * iou(boxes[first][:, None], boxes[second][None])
            found[first][second], found[second][first] = penalties.tolist(), penalties.T.tolist()
    return found
