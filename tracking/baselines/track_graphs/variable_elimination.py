"""Exact minimization of a sum of factors over discrete variables, by variable elimination (Dechter 1999)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from tracking.boxes import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A cost of some variables.

    Attributes:
        scope: the variables, each once, ascending.
        table: the cost of each of their joint states; axes as in the scope.
    """

    scope: tuple[int, ...]
    table: Floats


class TableTooLargeError(ValueError):
    """An intermediate table would be larger than allowed."""


def minimize(
    factors: Iterable[Factor], sizes: Mapping[int, int], max_states: int = 1_000_000
) -> tuple[float, dict[int, int]]:
    """Return the least total cost, and the state of each variable where it is attained.

    The variable whose table is smallest is eliminated first.

    Args:
        factors: the costs; their sum is minimized.
        sizes: number of states of each variable.
        max_states: largest size of an intermediate table.

    Raises:
        TableTooLargeError: a table would be larger than `max_states`.
    """
    left, remaining = list(factors), set(sizes)
    eliminated: list[tuple[int, Factor]] = []
    while remaining:
        variable = min(remaining, key=lambda v: (prod(sizes[u] for u in _joint_scope(left, v)) or 1, v))
        scope = tuple(sorted({variable, *_joint_scope(left, variable)}))
        if prod(sizes[v] for v in scope) > max_states:
            raise TableTooLargeError(f"a table of {len(scope)} variables has more than {max_states} states")
        joined = Factor(scope, _total([f for f in left if variable in f.scope], scope, sizes))
        left = [f for f in left if variable not in f.scope]
        axis = scope.index(variable)
        left.append(Factor(scope[:axis] + scope[axis + 1 :], joined.table.min(axis=axis)))
        eliminated.append((variable, joined))
        remaining.remove(variable)
    cost = float(sum(float(factor.table) for factor in left))
    states: dict[int, int] = {}
    for variable, joined in reversed(eliminated):
        known = tuple(slice(None) if v == variable else states[v] for v in joined.scope)
        states[variable] = int(np.argmin(joined.table[known]))
    return cost, states


def _joint_scope(factors: Sequence[Factor], variable: int) -> set[int]:
    """Return the variables that share a factor with a variable, and itself if there is any."""
    return {v for factor in factors if variable in factor.scope for v in factor.scope}


def _total(factors: Sequence[Factor], scope: tuple[int, ...], sizes: Mapping[int, int]) -> Floats:
    """Return the sum of factors as one table over a scope that contains all of theirs."""
    total = np.zeros([sizes[v] for v in scope])
    for factor in factors:
        shape = [sizes[v] if v in factor.scope else 1 for v in scope]
        total += factor.table.reshape(shape)
    return total
