"""A basketball game: two teams attack in turn, and each defender marks one attacker.

In even rounds the first team attacks the eastern basket, in odd ones the second team the western.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.choreographed_crowd import (
    BEFORE,
    ROUND,
    RoundPath,
    avoid_collisions,
    heading_to,
    straight_path,
)

# Positions of attackers: meters from the basket towards the center of the court, and to the side.
_SPOTS = np.array(
    [(6.9, 0.0), (5.9, 3.6), (5.9, -3.6), (1.2, 4.2), (1.2, -4.2), (3.2, 1.5), (3.4, -1.6), (8.4, 1.9)]
)
_TURNS = (
    (0.0, 0.7, 2.5, 3.4),
    (3.5, 4.6, 4.9, 6.0),
    (6.0, 7.2, 7.4, 8.8),
)  # earliest, latest start and arrival
_OFF = 0.35  # meters: standard deviation of their positions
_MARKING = 0.28  # position of the defender on the way from the attacker to the basket, as a share
_CLOSE = 0.95  # least meters from the attacker
_LATE = 0.25  # seconds by which defenders follow
_SPRINT = 5.2  # meters per second
_KEEP = 0.8  # meters between any two players, if possible
_MOVERS = 0.6  # share of a team that changes positions in a turn


@dataclass(frozen=True, slots=True)
class Court:
    """A court, in meters."""

    bounds: tuple[float, float, float, float]  # west, south, east and north
    baskets: tuple[tuple[float, float], tuple[float, float]]  # the western and the eastern


class Game:
    """The rounds of a game; players 0, 2, 4 … are one team."""

    def __init__(self, court: Court, players: int, seed: int) -> None:
        self._court, self._players, self._seed = court, players, seed

    def team(self, player: int) -> int:
        """Return which team a player is in, 0 or 1."""
        return player % 2

    def paths(self, number: int) -> list[RoundPath]:
        """Return all players' paths in a round, which is one attack."""
        if not self._players:
            return []
        start, turns = self._turns(number - 1)[-1], self._turns(number)
        rng = np.random.default_rng([self._seed, 0x6A3E, number + BEFORE])
        basket = self._basket(number)
        paths = []
        for player in range(self._players):
            attacks = self.team(player) == number % 2
            spots = [start[player], *(turn[player] for turn in turns)]
            look = np.array(basket if attacks else self._basket(number + 1))
            paths.append(_run(rng, np.array(spots), look, 0.0 if attacks else _LATE))
        return list(avoid_collisions(paths, np.full((self._players, self._players), _KEEP)))

    def _basket(self, number: int) -> tuple[float, float]:
        """Return the basket that is attacked in a round."""
        return self._court.baskets[1 - number % 2]

    def _turns(self, number: int) -> list[Floats]:
        """Return all players' positions after each turn of a round: ``(players, 2)`` meters."""
        rng = np.random.default_rng([self._seed, 0x5B07, number + BEFORE])
        attackers = [player for player in range(self._players) if self.team(player) == number % 2]
        defenders = [player for player in range(self._players) if self.team(player) != number % 2]
        basket = np.array(self._basket(number))
        inwards = np.array([-1.0 if number % 2 == 0 else 1.0, 1.0])
        order = rng.permutation(max(len(_SPOTS), len(attackers)))[: len(attackers)]
        turns = []
        for _ in _TURNS:
            moving = np.flatnonzero(rng.random(len(order)) < _MOVERS)
            order[moving] = order[np.roll(moving, 1)]
            places = np.empty((self._players, 2))
            spots = _SPOTS[order % len(_SPOTS)] + rng.normal(0, _OFF, (len(order), 2))
            places[attackers] = basket + inwards * spots
            places[defenders] = _marking(rng, places[attackers], basket, len(defenders))
            west, south, east, north = self._court.bounds
            turns.append(np.clip(places, (west, south), (east, north)))
        return turns


def _marking(rng: np.random.Generator, attackers: Floats, basket: Floats, count: int) -> Floats:
    """Place defenders ``(count, 2)`` between attackers and the basket; the remaining ones stay near it."""
    free = basket + rng.normal(0, 1.2, (count, 2))
    marked = min(count, len(attackers))
    line = basket - attackers[:marked]
    far = np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-6)
    share = np.maximum(_MARKING, np.minimum(_CLOSE / far, 0.9))
    free[:marked] = attackers[:marked] + share * line + rng.normal(0, 0.2, (marked, 2))
    return free


def _run(rng: np.random.Generator, spots: Floats, look: Floats, late: float) -> RoundPath:
    """Build a path from spot to spot, one per turn, facing a point while standing."""
    times, places, facing = [0.0], [spots[0]], [heading_to(spots[0], spots[1])]
    for (earliest_start, latest_start, earliest_end, latest_end), here, there in zip(
        _TURNS, spots[:-1], spots[1:], strict=True
    ):
        departure = max(float(rng.uniform(earliest_start, latest_start)) + late, times[-1])
        arrival = max(
            float(rng.uniform(earliest_end, latest_end)) + late,
            departure + float(np.linalg.norm(there - here)) / _SPRINT,
        )
        times += [departure, min(arrival, ROUND - 0.2)]
        places += [here, there]
        facing += [heading_to(here, there), heading_to(there, look)]
    return straight_path(
        np.array([*times, ROUND]), np.array([*places, spots[-1]]), np.array([*facing, facing[-1]])
    )
