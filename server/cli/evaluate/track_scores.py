"""``myview evaluate``: scores of tracks against ground truth, per camera and jointly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from server.cli.evaluate.file_pairing import pair_files
from server.system.errors import UserError, reason_of
from tracking.evaluation import HEADINGS, MultiCameraScores, TruthAndTracks, evaluate_cameras, format_scores
from tracking.motchallenge import MotRow, read_rows


def read_recordings(tracks: Sequence[Path], truth: Sequence[Path]) -> dict[str, TruthAndTracks]:
    """Read tracks and ground truth by camera, paired by :func:`pair_files`.

    Raises:
        UserError: there is nothing to compare, or a file is missing or malformed.
    """
    recordings = {}
    for pair in pair_files(tracks, truth):
        recording = TruthAndTracks(truth=rows_of(pair.truth), tracks=rows_of(pair.tracks))
        _check(recording, pair.tracks, pair.truth)
        recordings[pair.camera] = recording
    return recordings


def evaluate_recordings(recordings: Mapping[str, TruthAndTracks], least_iou: float) -> MultiCameraScores:
    """Score recordings.

    Raises:
        UserError: an id is twice in one frame of a camera.
    """
    try:
        return evaluate_cameras(recordings, least_iou)
    except ValueError as error:
        raise UserError(str(error)) from error


def print_table(scores: MultiCameraScores) -> None:
    """Print a row for each camera and, for several cameras, their mean and the joint scores."""
    # Without frame and color, to fit into 80 columns and for scripts.
    table = Table("camera", box=None, padding=(0, 1, 0, 0))
    for heading in HEADINGS.values():
        table.add_column(heading, justify="right", no_wrap=True)
    for camera, camera_scores in scores.cameras.items():
        table.add_row(camera, *format_scores(camera_scores, HEADINGS))
    if len(scores.cameras) > 1:
        table.add_row("mean, total", *format_scores(scores.mean, HEADINGS))
        table.add_row("joint", *format_scores(scores.joint, HEADINGS))
    console = Console(highlight=False)
    console.print(table, width=max(console.width, console.measure(table).maximum))


def content_of(scores: MultiCameraScores) -> dict[str, Any]:
    """Return all scores for a JSON file; shares are in [0, 1]."""
    return {
        "cameras": {camera: asdict(camera_scores) for camera, camera_scores in scores.cameras.items()},
        "mean": asdict(scores.mean),
        "joint": asdict(scores.joint),
    }


def rows_of(path: Path) -> list[MotRow]:
    """Read a MOTChallenge file.

    Raises:
        UserError: it cannot be read, or is malformed.
    """
    try:
        return read_rows(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason_of(error)}") from error
    except ValueError as error:
        raise UserError(str(error)) from error


def _check(recording: TruthAndTracks, tracks: Path, truth: Path) -> None:
    """Check that the ground truth is not empty and that both files have a common frame."""
    truth_frames = {row.frame for row in recording.truth if row.confidence != 0.0}
    track_frames = {row.frame for row in recording.tracks}
    if not truth_frames:
        raise UserError(f"{truth}: no person in it counts (confidence, the seventh field, is 0)")
    if track_frames and not truth_frames & track_frames:
        raise UserError(
            f"{tracks}: has no frame in common with {truth}: frames {min(track_frames)} to "
            f"{max(track_frames)} here, {min(truth_frames)} to {max(truth_frames)} there (both count from 1)"
        )
