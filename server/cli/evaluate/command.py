"""``myview evaluate``: computes scores of tracks and view choices, prints and writes them."""

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
from server.cli.evaluate.site_info import SiteOptions, collect_site_info, videos_by_camera
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
    """The options of the command."""

    truth: list[Path]
    tracks: list[Path]
    views: Path | None
    videos: list[Path]
    site: SiteOptions
    least_iou: float
    least_shown: float
    json_file: Path | None
    plots: Path | None


def evaluate(options: EvaluateOptions) -> None:
    """Score tracks, view choices, or both; print the scores and write the requested files.

    Raises:
        UserError: an input is missing or malformed; nothing is written then.
    """
    _check(options)
    read = (*options.tracks, *options.truth, options.views, *options.videos)
    content: dict[str, Any] = {"iou": options.least_iou}
    with ExitStack() as outputs:  # all files or none
        numbers = outputs.enter_context(atomic_file(options.json_file, *read)) if options.json_file else None
        plots = outputs.enter_context(atomic_folder(options.plots)) if options.plots else None
        if options.tracks:
            recordings = read_recordings(options.tracks, options.truth)
            scores = evaluate_recordings(recordings, options.least_iou)
            content |= content_of(scores)
        else:
            files = files_by_camera("--gt", options.truth, "gt")
            recordings = {camera: TruthAndTracks(rows_of(path), []) for camera, path in files.items()}
        evaluation = None
        if options.views is not None:
            evaluation, content["views"] = _evaluate_views(options, options.views, recordings, plots)
        if numbers is not None:
            numbers.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    if options.tracks:
        print_table(scores)
    if evaluation is not None:
        print_views(evaluation)


def _check(options: EvaluateOptions) -> None:
    if not options.tracks and options.views is None:
        raise UserError("evaluate: give --tracks, --views, or both")
    if options.views is None and (options.plots is not None or options.videos):
        raise UserError("evaluate: --plots and --videos need --views")


def _evaluate_views(
    options: EvaluateOptions, choices_file: Path, recordings: dict[str, TruthAndTracks], plots: Path | None
) -> tuple[ViewEvaluation, dict[str, Any]]:
    cameras = tuple(recordings)
    choices = read_choices(choices_file)
    videos = videos_by_camera(options.videos, cameras) if options.videos else {}
    site_info = collect_site_info(choices_file, cameras, videos, options.site)
    rows = {camera: recording.truth for camera, recording in recordings.items()}
    truth = build_truth(rows, site_info.sizes, options.least_shown)
    if not truth.views.evaluated.any():
        raise UserError("--gt: no person is ever visible in it")
    if options.tracks:
        person_of = people_of_objects(truth.people, recordings, options.least_iou)
    else:
        person_of = {person: person for person in truth.people}
        if choices and not {choice.object for choice in choices} & set(person_of):
            raise UserError(
                f"--views: {choices_file}: none of its objects has the number of a person in the "
                "ground truth; match them with --tracks"
            )
    evaluation = evaluate_views(truth, choices, person_of, site_info)
    if plots is not None:
        plot_views(plots, truth, evaluation, site_info, videos)
    return evaluation, content_of_views(evaluation, site_info)
