"""A solver that says how long it took."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar

from tracking.network import Network
from tracking.solvers.base import Solution
from tracking.solvers.hint import Hint


class TimedSolver(ABC):
    """Puts the time of the solve into its report."""

    name: ClassVar[str]

    def solve(self, network: Network, hint: Hint | None = None) -> Solution:
        """Give the states of all objects in all frames; a hint only makes it quicker."""
        start = time.perf_counter()
        solution = self._answer(network, hint)
        seconds = time.perf_counter() - start
        return replace(solution, report=replace(solution.report, seconds=seconds))

    @abstractmethod
    def _answer(self, network: Network, _hint: Hint | None) -> Solution:
        """Solve the network, which may be one without objects."""
