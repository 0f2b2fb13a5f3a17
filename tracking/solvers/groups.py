"""Objects that meet, directly or through others: each such group is a problem of its own."""

from __future__ import annotations

import numpy as np

from tracking.conflicts import Bools
from tracking.solvers.objective import Ints


def groups_of(meets: Bools) -> Ints:
    """Give the lowest object of the group of each, (n,); `meets` (n, n) is symmetric."""
    reached = meets | np.eye(len(meets), dtype=np.bool_)
    while True:
        further = reached @ reached
        if (further == reached).all():
            return np.asarray(reached.argmax(axis=1))
        reached = further
