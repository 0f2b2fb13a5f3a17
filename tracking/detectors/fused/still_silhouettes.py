"""Silhouettes that stand still and that the network hardly ever confirms: things, more and more likely.

A drop on the lens, a parked bicycle or a moved chair differs from the background for as long as a person
would, and its silhouette is taken for one. A network that finds people misses one now and then, but hardly
one who stands still for many of its runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats, iou, shares_within

_SAME = 0.5
"""Least overlap (IoU) of a silhouette with where it was first."""
_WITHIN = 0.7
"""Least share of a silhouette within a doubted one from which it is doubted as much.

The silhouettes of a thing that changes, such as a drop on the lens, are now this part of it and now that."""
_FORGET_S = 10.0
"""Seconds unseen after which a silhouette is forgotten: what flickers, such as a screen, returns."""
_LOG_ODDS_PER_S = 0.5
"""By how much the log-odds of a person fall per second: runs soon after each other err alike."""
_MOST = 6.0
"""By how much they fall at most."""
_CONFIRMATION, _MOST_CONFIRMED_S = 3.0, 10.0
"""How many unconfirmed seconds a confirmed one outweighs, and how many that follow at most have no effect.

Whoever passes a thing confirms it for a moment only."""


@dataclass(frozen=True, slots=True, eq=False)
class _Silhouette:
    """A silhouette at a place.

    Attributes:
        box: (4,) at the beginning: what moves away from it does not stand still.
        doubt_s: seconds for which the network has not confirmed it, less those that confirmations outweigh.
        unseen_s: seconds since it was seen last.
    """

    box: Floats
    doubt_s: float = 0.0
    unseen_s: float = 0.0


class StillSilhouettes:
    """The silhouettes that have stood still over the last runs of the network."""

    def __init__(self) -> None:
        self._known: list[_Silhouette] = []

    def penalties(self, boxes: Floats) -> Floats:
        """Return by how much the log-odds of hypotheses (P, 4) without a network box fall, (P,)."""
        doubted = [known for known in self._known if known.doubt_s > 0.0]
        if not doubted:
            return np.zeros(len(boxes))
        seconds = np.array([known.doubt_s for known in doubted])
        here = np.where(_are_within(boxes, _places(doubted)), seconds, 0.0).max(axis=1)
        return np.asarray(np.minimum(_LOG_ODDS_PER_S * here, _MOST))

    def update(
        self, boxes: Floats, is_confirmed: npt.NDArray[np.bool_], seconds: float, reliance: float
    ) -> None:
        """Take the silhouettes (K, 4) in a run of the network, and which of them it confirms, (K,).

        `seconds`: since the last run; `reliance`: how much the silence of the network says, 0 to 1.
        """
        same, kept = _are_same(boxes, _places(self._known)), []
        for known, is_same in zip(self._known, same.T, strict=True):
            if is_same.any():
                weight = -_CONFIRMATION if is_confirmed[is_same].any() else 1.0
                doubt = max(known.doubt_s + weight * reliance * seconds, -_MOST_CONFIRMED_S)
                kept.append(_Silhouette(known.box, doubt))
            elif known.unseen_s + seconds < _FORGET_S:
                kept.append(replace(known, unseen_s=known.unseen_s + seconds))
        self._known = [*kept, *map(_Silhouette, boxes[~same.any(axis=1)])]


def _places(known: Sequence[_Silhouette]) -> Floats:
    return np.array([silhouette.box for silhouette in known]).reshape(-1, BOX_SIDES)


def _are_same(boxes: Floats, places: Floats) -> npt.NDArray[np.bool_]:
    """Return which boxes (K, 4) are at some places (N, 4), (K, N)."""
    return np.asarray(iou(boxes[:, None], places[None]) >= _SAME)


def _are_within(boxes: Floats, places: Floats) -> npt.NDArray[np.bool_]:
    """Return which boxes (K, 4) are at some places (N, 4), or mostly inside of them, (K, N)."""
    return np.asarray(_are_same(boxes, places) | (shares_within(boxes, places) >= _WITHIN))
