"""Finding again who left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bestview.appearance import Appearances
from bestview.identity_settings import IdentitySettings
from bestview.looks import unlike
from bestview.persons import Person
from bestview.succession import Place, clearly_least, picture_cost

_APPEARANCE_RATIO = 1.5
"""How many times further the second likeliest must be before appearance alone decides."""

_LOOSE = 2.0
"""How many appearance gates apart two sightings may be that place already joins."""

_NEVER = 1e6


@dataclass(frozen=True, slots=True)
class Finding:
    """What finding people again goes by.

    Attributes:
        settings: of identity.
        appearances: to compare looks with.
        gate: distance within which feet are the same, ground units (NaN: no ground yet).
        height: of a person in ground units (NaN likewise).
    """

    settings: IdentitySettings
    appearances: Appearances
    gate: float
    height: float

    def match(self, found: list[Person], lost: list[Person]) -> list[int]:
        """For each newly `found` person the index of the `lost` one they are, or -1.

        Place decides for those lost a moment ago; appearance for the others, and only where nobody
        else looks nearly as like: a wrong number is worse than a new one. One assignment.
        """
        if not found or not lost:
            return [-1] * len(found)
        cost, looks = self._place_costs(found, lost), unlike(self.appearances, found, lost)
        gate = self.appearances.gate(self.settings.appearance_gate, self.settings.appearance_share)
        by_place = (cost <= 1.0) & ~(looks > _LOOSE * gate)
        by_look = (
            ~np.isfinite(cost) & (cost != np.inf) & (looks <= gate) & clearly_least(looks, _APPEARANCE_RATIO)
        )
        cost = np.where(by_place, cost, np.where(by_look, 1.0 + looks, _NEVER))
        row, column = linear_sum_assignment(cost)
        answer = [-1] * len(found)
        for i, j in zip(row, column, strict=True):
            if cost[i, j] < _NEVER:
                answer[int(i)] = int(j)
        return answer

    def _place_costs(self, found: list[Person], lost: list[Person]) -> NDArray[np.float64]:
        """(N, L): see `_place_cost`; asked only about those lost a moment ago."""
        cost = np.full((len(found), len(lost)), np.nan)
        first, last = (
            np.array(frames) for frames in ([p.first_frame for p in found], [p.last_frame for p in lost])
        )
        recent = first[:, None] - last[None, :] <= self.settings.continuity
        for i, j in np.argwhere(recent).tolist():
            cost[i, j] = self._place_cost(found[i], lost[j])
        return cost

    def _place_cost(self, new: Person, old: Person) -> float:
        """Distance between loss and finding in units of what is plausible; NaN: place says nothing."""
        gap = new.first_frame - old.last_frame
        if gap <= 0 and any(new.first[c].frame <= old.last[c].frame for c in new.first if c in old.last):
            return float("inf")  # seen at the same time: two people
        gap = max(gap, 0)
        costs = [self._ground_cost(a, b, gap) for a in new.first.values() for b in old.last.values()]
        costs += [picture_cost(new.first[c], old.last[c]) for c in sorted(new.first) if c in old.last]
        known = [cost for cost in costs if not np.isnan(cost)]
        if not known:
            return float("nan")
        best = min(known)
        return best if best <= 1.0 else float("inf")  # nobody is that fast

    def _ground_cost(self, new: Place, old: Place, gap: int) -> float:
        apart = float(np.hypot(*(new.ground - old.ground)))
        return apart / (self.gate + self.settings.speed_heights * self.height * gap)
