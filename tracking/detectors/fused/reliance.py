"""How much the silence of a network says: little if it finds few of the clear silhouettes of a scene.

A network knows the people it was trained on. Of drawn people, in thermal pictures or from far above it may
find nobody; then the silhouettes count as without a network.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_EXPECTED, _EXPECTED_SIGHTINGS = 0.9, 10.0
"""Share of clear silhouettes that a network finds, and how many sightings this expectation is worth."""
_MEMORY = 500.0
"""Sightings after which a sighting has lost two thirds of its weight."""
_RELIABLE = 0.3
"""Share found from which the silence of a network counts in full."""


class NetworkReliance:
    """Estimates the share of clear silhouettes that the network finds, too."""

    def __init__(self) -> None:
        self._found = _EXPECTED * _EXPECTED_SIGHTINGS
        self._all = _EXPECTED_SIGHTINGS

    def observe(self, is_supported: npt.NDArray[np.bool_]) -> None:
        """Add the clear silhouettes `(K,)` of a frame in which the network ran."""
        kept = float(np.exp(-len(is_supported) / _MEMORY))
        self._found = kept * self._found + float(np.count_nonzero(is_supported))
        self._all = kept * self._all + float(len(is_supported))

    @property
    def share(self) -> float:
        """How much the network's silence counts, 0 to 1."""
        return min(self._found / self._all / _RELIABLE, 1.0)
