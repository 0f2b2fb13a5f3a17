"""``myview evaluate --views``: the cameras that were chosen beside the best that could have been."""

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
from server.cli.render.site_file import SiteInfo


@dataclass(frozen=True, slots=True, eq=False)
class ViewEvaluation:
    """Scores of view choices against the optimum.

    Attributes:
        objects: by person, the object that stands for them.
        views: (K, N) the camera chosen for each person at each frame, an index; -1: none.
        best: (K, N) the optimum's; -1 where no camera sees the person.
        people: scores of each person who is ever visible, by number.
        total: the scores of all.
        unmatched: objects that match no person.
    """

    objects: Mapping[int, int]
    views: NDArray[np.int64]
    best: NDArray[np.int64]
    people: Mapping[int, ViewScore]
    total: ViewScore
    unmatched: int


def evaluate_views(
    truth: SceneTruth, choices: Sequence[Choice], person_of: Mapping[int, int], facts: SiteInfo
) -> ViewEvaluation:
    """Score choices; ``person_of`` maps objects to people.

    Raises:
        UserError: a choice names a camera without ground truth.
    """
    frames = truth.boxes.shape[1]
    views = views_of(choices, person_of, truth.people, truth.cameras, frames)
    cost, visible = truth.views.cost, truth.views.visible

    def score(rows: slice) -> ViewScore:
        return score_views(cost[rows], visible[rows], views[rows], facts.switch_cost, facts.fps)

    return ViewEvaluation(
        objects={person: number for number, person in person_of.items()},
        views=views,
        best=optimal_views(truth.views, facts.switch_cost),
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


def print_views(judged: ViewEvaluation) -> None:
    """Print a row for each person and one for all."""
    table = Table(box=None, padding=(0, 1, 0, 0))
    for place, heading in enumerate(HEADINGS):
        table.add_column(heading, justify="right" if place else "left", no_wrap=True)
    for person, score in judged.people.items():
        table.add_row(str(person), str(judged.objects.get(person, "-")), *score_cells(score))
    table.add_row("all", "", *score_cells(judged.total))
    console = Console(highlight=False)
    console.print(table, width=max(console.width, console.measure(table).maximum))


def score_cells(score: ViewScore) -> list[str]:
    """Return a row's numbers: shares in percent, cuts per minute, the shortest shot in frames."""
    shares = [100.0 * it for it in _shares(score)]
    cuts = [score.cuts_per_minute, score.optimum_cuts_per_minute]
    return [str(score.frames), *(f"{it:.1f}" for it in (*shares, *cuts)), str(score.shortest_shot or "-")]


def _shares(score: ViewScore) -> tuple[float, ...]:
    return score.agreement, score.regret, score.visible, score.chosen


def content_of_views(judged: ViewEvaluation, facts: SiteInfo) -> dict[str, Any]:
    """Return it all for a file; shares are parts of 1, and null where they are infinite."""

    def content(score: ViewScore) -> dict[str, Any]:
        return {name: value if np.isfinite(value) else None for name, value in asdict(score).items()}

    return {
        "fps": facts.fps,
        "switch_cost_s": facts.switch_cost_s,
        "people": {
            str(person): {"object": judged.objects.get(person), **content(score)}
            for person, score in judged.people.items()
        },
        "all": content(judged.total),
        "unmatched_objects": judged.unmatched,
    }
