"""Solves a program part by part, and puts the answers together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.program.costs import Ints, ProgramCosts
from tracking.ground_plane.program.parts import Part, divide, part_network
from tracking.ground_plane.program.program_flow import ProgramFlow
from tracking.ground_plane.program.useful_arcs import GONE, HIDDEN, UnseenPaths, unseen_paths, useful_arcs
from tracking.solvers.base import PartsSolver, Solution, SolveReport, add_reports
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.programs.linear_program import WorkLimitError
from tracking.solvers.programs.linear_program import solve_program as solve_linear_program

_NEWCOMERS = 4
"""People who may arrive in one part of a window; doubled as long as all of them do."""


@dataclass(frozen=True, slots=True, eq=False)
class ProgramSolution:
    """Where everybody is in each frame of a window.

    Attributes:
        states: (n, M) the place, `HIDDEN` or `GONE`: of the people known, then of those who arrive, by the
            first frame in which they are there, then by the place.
        report: what is proven about all parts together.
    """

    states: Ints
    report: SolveReport


def solve_program(costs: ProgramCosts, frames: Sequence[Places], solver: PartsSolver) -> ProgramSolution:
    """Return the optimum of a program, with as many newcomers as it takes.

    `solver` solves it part by part if its relaxation is not integral, or takes too much of the budget.
    """
    unseen = unseen_paths(costs)
    useful, conflicts = useful_arcs(costs, unseen), [places.conflicts for places in frames]
    meter = solver.start()
    with suppress(WorkLimitError):
        if (found := _solve_flow(useful, conflicts, meter, solver.name)) is not None:
            return found
    return solve_by_parts(useful, conflicts, unseen, solver, meter)


def solve_by_parts(
    costs: ProgramCosts,
    conflicts: Sequence[NDArray[np.bool_]],
    unseen: UnseenPaths,
    solver: PartsSolver,
    meter: BudgetMeter | None = None,
) -> ProgramSolution:
    """Return the solution of a program of useful arcs, each part solved by itself."""
    parts = divide(costs, conflicts)
    return join_parts(unseen, parts, solve_parts(parts, solver, meter), solver.name)


def _solve_flow(
    costs: ProgramCosts, conflicts: Sequence[NDArray[np.bool_]], meter: BudgetMeter, solver: str
) -> ProgramSolution | None:
    """Return the optimum of a program whose relaxation is integral; None: it is not.

    Raises:
        WorkLimitError: the relaxation's share of the meter's budget is spent before.
    """
    began = time.perf_counter()
    flow = ProgramFlow(costs, conflicts)
    found = solve_linear_program(flow.program, meter=meter)
    states = flow.states(found.values)
    if states is None:
        return None
    report = SolveReport(
        solver=solver,
        objective=found.objective,
        bound=found.objective,
        integral=True,
        conflicts=0,
        rounds=1,
        seconds=time.perf_counter() - began,
    )
    return ProgramSolution(states, report)


def solve_parts(
    parts: Sequence[Part], solver: PartsSolver, meter: BudgetMeter | None = None
) -> list[Solution]:
    """Return the solution of each part, with more newcomers as long as all of them arrive."""
    meter = meter or solver.start()
    newcomers = [min(_NEWCOMERS, part.arrivals) for part in parts]
    solutions: dict[int, Solution] = {}
    unsolved = list(range(len(parts)))
    while unsolved:
        networks = [part_network(parts[k], newcomers[k]) for k in unsolved]
        solutions |= zip(unsolved, solver.solve_parts(networks, meter), strict=True)
        unsolved = [k for k in unsolved if _needs_more(parts[k], newcomers[k], solutions[k])]
        for k in unsolved:
            newcomers[k] = min(2 * newcomers[k], parts[k].arrivals)
    return [solutions[k] for k in range(len(parts))]


def _needs_more(part: Part, newcomers: int, solution: Solution) -> bool:
    """Return whether all newcomers have arrived, and more can."""
    arrived = (_states(part, solution)[len(part.people) :] >= 0).any(axis=1)
    return newcomers < part.arrivals and bool(arrived.all())


def join_parts(
    unseen: UnseenPaths, parts: Sequence[Part], solutions: Sequence[Solution], name: str
) -> ProgramSolution:
    """Return the solution of all parts together; people in none of them take their `unseen` path."""
    people = len(unseen.costs) - 1
    states = unseen.states[:people].copy()
    alone = np.ones(people, dtype=np.bool_)
    arrived = [np.zeros((0, states.shape[1]), dtype=np.int64)]
    for part, solution in zip(parts, solutions, strict=True):
        found = _states(part, solution)
        known = len(part.people)
        states[part.people] = found[:known]
        alone[part.people] = False
        arrived.append(found[known:][(found[known:] >= 0).any(axis=1)])
    newcomers = np.concatenate(arrived)
    begins = (newcomers >= 0).argmax(axis=1)
    order = np.lexsort((newcomers[np.arange(len(newcomers)), begins], begins))
    rest = float(unseen.costs[:-1][alone].sum())
    report = add_reports(name, [solution.report for solution in solutions], rest)
    return ProgramSolution(np.concatenate([states, newcomers[order]]), report)


def _states(part: Part, solution: Solution) -> Ints:
    """Return a part's states with the numbers of the window's places."""
    gone = max(len(places) for places in part.places)
    numbers = np.full((len(part.places), gone + 2), HIDDEN)
    numbers[:, gone] = GONE
    for m, places in enumerate(part.places):
        numbers[m, : len(places)] = places
    return np.asarray(numbers[np.arange(len(part.places)), solution.states])
