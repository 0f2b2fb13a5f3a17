"""``myview evaluate``: from options to tables and files."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.cli.evaluate.choices_file import read_choices
from server.cli.evaluate.file_pairing import files_by_camera
from server.cli.evaluate.ground_truth import build_truth, people_of_objects
from server.cli.evaluate.plots import plot_views
from server.cli.evaluate.site_facts import SiteOptions, collect_site_info, videos_by_camera
from server.cli.evaluate.track_scores import (
    content_of,
    evaluate_recordings,
    print_table,
    read_recordings,
    rows_of,
)
from server.cli.evaluate.view_scores import ViewEvaluation, content_of_views, evaluate_views, print_views
from server.system.atomic_write import atomic_file, atomic_folder
from server.system.errors import UserError
from tracking.evaluation import TruthAndTracks


@dataclass(frozen=True, slots=True)
class EvaluateOptions:
    """The options."""

    truth: list[Path]
    tracks: list[Path]
    views: Path | None
    videos: list[Path]
    site: SiteOptions
    least_iou: float
    least_shown: float
    json_file: Path | None
    plots: Path | None


def evaluate(asked: EvaluateOptions) -> None:
    """Score tracks, choices of views, or both; print, and write what is asked for.

    Raises:
        UserError: something is missing or malformed; nothing is written then.
    """
    _check(asked)
    read = (*asked.tracks, *asked.truth, asked.views, *asked.videos)
    content: dict[str, Any] = {"iou": asked.least_iou}
    with ExitStack() as outputs:  # all of them, or none
        numbers = outputs.enter_context(atomic_file(asked.json_file, *read)) if asked.json_file else None
        plots = outputs.enter_context(atomic_folder(asked.plots)) if asked.plots else None
        if asked.tracks:
            recordings = read_recordings(asked.tracks, asked.truth)
            scores = evaluate_recordings(recordings, asked.least_iou)
            content |= content_of(scores)
        else:
            files = files_by_camera("--gt", asked.truth, "gt")
            recordings = {camera: TruthAndTracks(rows_of(path), []) for camera, path in files.items()}
        judged = None
        if asked.views is not None:
            judged, content["views"] = _judge(asked, asked.views, recordings, plots)
        if numbers is not None:
            numbers.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    if asked.tracks:
        print_table(scores)
    if judged is not None:
        print_views(judged)


def _check(asked: EvaluateOptions) -> None:
    if not asked.tracks and asked.views is None:
        raise UserError("evaluate: name what is to be scored: --tracks, or --views, or both")
    if asked.views is None and (asked.plots is not None or asked.videos):
        raise UserError("evaluate: --plots and --videos are about choices: name them with --views")


def _judge(
    asked: EvaluateOptions, choices_file: Path, recordings: dict[str, TruthAndTracks], plots: Path | None
) -> tuple[ViewEvaluation, dict[str, Any]]:
    cameras = tuple(recordings)
    choices = read_choices(choices_file)
    videos = videos_by_camera(asked.videos, cameras) if asked.videos else {}
    facts = collect_site_info(choices_file, cameras, videos, asked.site)
    rows = {camera: it.truth for camera, it in recordings.items()}
    truth = build_truth(rows, facts.sizes, asked.least_shown)
    if not truth.views.evaluated.any():
        raise UserError("--gt: nobody is ever visible in it")
    if asked.tracks:
        person_of = people_of_objects(truth.people, recordings, asked.least_iou)
    else:
        person_of = {person: person for person in truth.people}
        if choices and not {choice.object for choice in choices} & set(person_of):
            raise UserError(
                f"--views: {choices_file}: none of its objects has the number of a person in the "
                "ground truth; say who is who with --tracks"
            )
    judged = evaluate_views(truth, choices, person_of, facts)
    if plots is not None:
        plot_views(plots, truth, judged, facts, videos)
    return judged, content_of_views(judged, facts)
