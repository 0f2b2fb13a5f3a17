"""``myview evaluate --views``: scores of view choices against the optimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from bestview import ViewScore, optimal_views, score_views
from server.cli.evaluate.choices_file import Choice, views_of
from server.cli.evaluate.ground_truth import SceneTruth
from server.cli.render.site_file import RenderedSite


@dataclass(frozen=True, slots=True, eq=False)
class ViewEvaluation:
    """Scores of view choices against the optimum.

    Attributes:
        object_of: by person, the matched object.
        views: (K, N) indices of the cameras chosen for each person and frame; -1: none.
        best: (K, N) indices of the optimum; -1: no camera sees the person.
        people: scores of each person who is visible in some frame, by number.
        total: the scores of all people.
        unmatched: objects that match no person.
    """

    object_of: Mapping[int, int]
    views: NDArray[np.int64]
    best: NDArray[np.int64]
    people: Mapping[int, ViewScore]
    total: ViewScore
    unmatched: int


def evaluate_views(
    truth: SceneTruth, choices: Sequence[Choice], person_of: Mapping[int, int], site_info: RenderedSite
) -> ViewEvaluation:
    """Score choices; ``person_of`` maps objects to people.

    Raises:
        UserError: a choice names a camera without ground truth.
    """
    frames = truth.boxes.shape[1]
    views = views_of(choices, person_of, truth.people, truth.cameras, frames)
    cost, visible = truth.views.cost, truth.views.visible

    def score(rows: slice) -> ViewScore:
        return score_views(cost[rows], visible[rows], views[rows], site_info.switch_cost, site_info.fps)

    return ViewEvaluation(
        object_of={person: number for number, person in person_of.items()},
        views=views,
        best=optimal_views(truth.views, site_info.switch_cost),
        people={
            person: score(slice(row, row + 1))
            for row, person in enumerate(truth.people)
            if truth.views.evaluated[row].any()
        },
        total=score(slice(None)),
        unmatched=len({choice.object for choice in choices} - set(person_of)),
    )


HEADINGS = (
    "person",
    "object",
    "frames",
    "Agree",
    "Regret",
    "Visible",
    "Chosen",
    "Cuts",
    "Best",
    "Shot",
)


def print_views(evaluation: ViewEvaluation) -> None:
    """Print a row for each person and one for all people."""
    table = Table(box=None, padding=(0, 1, 0, 0))
    for column, heading in enumerate(HEADINGS):
        table.add_column(heading, justify="right" if column else "left", no_wrap=True)
    for person, score in evaluation.people.items():
        table.add_row(str(person), str(evaluation.object_of.get(person, "-")), *score_cells(score))
    table.add_row("all", "", *score_cells(evaluation.total))
    console = Console(highlight=False)
    console.print(table, width=max(console.width, console.measure(table).maximum))


def score_cells(score: ViewScore) -> list[str]:
    """Return a row's cells: shares in percent, cuts per minute, the shortest shot in frames."""
    shares = [100.0 * share for share in _shares(score)]
    cuts = [score.cuts_per_minute, score.optimum_cuts_per_minute]
    return [
        str(score.frames),
        *(f"{value:.1f}" for value in (*shares, *cuts)),
        str(score.shortest_shot or "-"),
    ]


def _shares(score: ViewScore) -> tuple[float, ...]:
    return score.agreement, score.regret, score.visible, score.chosen


def content_of_views(evaluation: ViewEvaluation, site_info: RenderedSite) -> dict[str, Any]:
    """Return the evaluation for a JSON file; shares are in [0, 1], null if infinite."""

    def content(score: ViewScore) -> dict[str, Any]:
        return {name: value if np.isfinite(value) else None for name, value in asdict(score).items()}

    return {
        "fps": site_info.fps,
        "switch_cost_s": site_info.switch_cost_s,
        "people": {
            str(person): {"object": evaluation.object_of.get(person), **content(score)}
            for person, score in evaluation.people.items()
        },
        "all": content(evaluation.total),
        "unmatched_objects": evaluation.unmatched,
    }
