"""Ablation of the tracker: scores with one part switched off, on the same public detections.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.ablation --data ../shared/data --out out/bench --jobs 2

An ablation is a set of settings of the configuration's section `track`; to add one, add a row to ABLATIONS.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.public_detections import Recording, TrackSettings, find_recordings, track
from benchmarks.common.report import Report
from tracking import PAPER, PAPER_COSTS, PAPER_CVPR
from tracking.evaluation import Scores, average_scores
from tracking.paper import MORE_THAN_75_PERCENT


@dataclass(frozen=True, slots=True)
class Ablation:
    """A part of the tracker that is switched off, and the settings that do it."""

    name: str
    settings: TrackSettings = field(default_factory=dict)


DEFAULT = Ablation("default")

ABLATIONS = (
    Ablation("no confidence in the cost", {"costs": {"confidence": 0.0}}),
    Ablation("no cost of disappearing", {"costs": {"disappearance": 0.0}}),
    Ablation("no motion cost", {"costs": {"motion": 0.0}}),
    Ablation("no cost of reappearing elsewhere", {"costs": {"reappearance": 0.0}}),
    Ablation("no gate on displacement", {"costs": {"gate": None}}),
    Ablation("births from weak boxes alone", {"window": {"birth_min_peak_score": 0.0}}),
    Ablation("births from weak boxes too", {"window": {"birth_min_score": 0.0}}),
    Ablation(
        "births from any number of boxes", {"window": {"birth_max_tests": PAPER.window.birth_max_tests}}
    ),
    Ablation("no interpolation of gaps", {"window": {"max_interpolated_gap_s": 0.0}}),
    Ablation("no displacement cost", {"costs": {"displacement": 0.0}}),
    Ablation(
        "displacement in pixels",
        {"costs": {"displacement_unit": "pixels", "displacement": 0.01, "gate": None}},
    ),
    Ablation("no appearance cost", {"costs": {"appearance": 0.0}}),
    Ablation("appearance of the preset", {"costs": {"appearance": PAPER.costs.appearance}}),
    Ablation("hiding as cheap as in the preset", {"costs": {"occlusion": PAPER.costs.occlusion}}),
    Ablation("conflicts by corners", {"costs": {"conflict_rule": "corners"}}),
    Ablation("conflict rows of II.D", {"costs": {"conflict_rows": "star"}}),
    Ablation(
        "no gating",
        {"window": {"gate_heights": 1e3, "max_height_ratio": 1e3}},
    ),
    Ablation("window of 0.2 seconds", {"window": {"length_s": 0.2, "birth_s": 0.2, "min_frames": 3}}),
    Ablation("no re-identification", {"window": {"reidentify_max_distance": 0.0}}),
    Ablation(
        "hidden objects stay in the program",
        {"window": {"reidentify_after_s": PAPER.window.reidentify_after_s}},
    ),
    Ablation(
        "hidden objects are never dropped",
        {"window": {"forget_after_s": PAPER.window.forget_after_s, "max_objects": PAPER.window.max_objects}},
    ),
    Ablation("fixed templates", {"window": {"template_memory_s": 1e6}}),
    Ablation("the paper's layout term", {"costs": {"layout": PAPER.costs.layout}}),
    Ablation("unknown appearance costs nothing", {"costs": {"unknown_appearance": 0.0}}),
    Ablation("hiding costs c_b alone (CVPR)", {"costs": {"occlusion_adds_change": False}}),
    Ablation(
        "births in more than 75 % of the frames", {"window": {"birth_min_visible": MORE_THAN_75_PERCENT}}
    ),
    Ablation("windows overlap in one frame", {"window": {"stride_s": 0.6}}),
    Ablation("windows of the paper's length", {"window": {"length_s": 0.72, "birth_s": 0.72}}),
    Ablation("duplicates are kept", {"window": {"duplicate_overlap": 1.0}}),
    Ablation("the paper's costs", {"costs": asdict(PAPER_COSTS)}),
    Ablation("the paper", {"costs": asdict(PAPER.costs), "window": asdict(PAPER.window)}),
    Ablation("the CVPR paper", {"costs": asdict(PAPER_CVPR.costs), "window": asdict(PAPER_CVPR.window)}),
)
"""The parts that are switched off, one at a time: each way in which MyView differs from the paper."""

SCORES = ("idf1", "hota", "mota", "switches")
_NAMES = {"idf1": "IDF1, %", "hota": "HOTA, %", "mota": "MOTA, %", "switches": "identity switches"}


@dataclass(frozen=True, slots=True)
class InputSequence:
    """A sequence of detections, with or without its video."""

    recording: Recording
    pictures: bool = False

    @property
    def name(self) -> str:
        """The name in the table."""
        return f"{self.recording.name}, pictures" if self.pictures else self.recording.name


def input_sequences(recordings: list[Recording]) -> list[InputSequence]:
    """Return each sequence, and once more with its video (needed for appearance) where there is one."""
    without_pictures = [InputSequence(recording) for recording in recordings]
    return without_pictures + [
        InputSequence(recording, pictures=True)
        for recording in recordings
        if recording.video and recording.video.is_file()
    ]


def score(ablation: Ablation, sequence: InputSequence) -> Scores:
    """Track one sequence with the ablation's settings, and score the tracks."""
    return sequence.recording.score(track(sequence.recording, ablation.settings, pictures=sequence.pictures))


def cell(name: str, scores: Scores, default: Scores | None) -> str:
    """Format a score, as a difference from the default's if there is one."""
    value = getattr(scores, name)
    if default is not None:
        value -= getattr(default, name)
    sign = "" if default is None else "+"
    return f"{value:{sign}d}" if isinstance(value, int) else f"{100 * value:{sign}.1f}"


def tables(report: Report, names: list[str], scores_by_name: dict[str, list[Scores]]) -> None:
    """Print a table for each score: the default's, and its change by each ablation."""
    several = len(names) > 1
    with_total = {
        name: scores + [average_scores(scores)] * several for name, scores in scores_by_name.items()
    }
    for name in SCORES:
        rows = [
            [
                ablation,
                *(
                    cell(name, *pair)
                    for pair in zip(scores, _reference_scores(ablation, with_total), strict=True)
                ),
            ]
            for ablation, scores in with_total.items()
        ]
        last_column = ["total" if name == "switches" else "mean"] * several
        report.table(f"{_NAMES[name]}, and its change by each ablation", ["", *names, *last_column], rows)


def _reference_scores(ablation: str, with_total: dict[str, list[Scores]]) -> Sequence[Scores | None]:
    """Return the scores that a row is compared with; the default's row is compared with none."""
    default = with_total[DEFAULT.name]
    return [None] * len(default) if ablation == DEFAULT.name else default


def run(recordings: list[Recording], out: Path, jobs: int, names: list[str] | None = None) -> None:
    """Measure the ablations, or those named, beside the default; print and save."""
    sequences = input_sequences(recordings)
    report = Report()
    chosen = (DEFAULT, *(one for one in ABLATIONS if not names or one.name in names))
    pairs = [(ablation, sequence) for ablation in chosen for sequence in sequences]
    with ProcessPoolExecutor(jobs) as pool:
        scores = iter(list(pool.map(score, *zip(*pairs, strict=True))))
    tables(
        report,
        [sequence.name for sequence in sequences],
        {ablation.name: [next(scores) for _ in sequences] for ablation in chosen},
    )
    report.save(out / "ablation.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "ablation")
    options.add_argument("--sequence", action="append", help="only this one; may be repeated")
    rows = [ablation.name for ablation in ABLATIONS]
    options.add_argument("--row", action="append", choices=rows, help="only this one; may be repeated")
    options.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="parallel processes")
    chosen = options.parse_args()
    try:
        run(find_recordings(chosen.data, chosen.sequence), chosen.out, chosen.jobs, chosen.row)
    except CannotRunError as problem:
        finish(problem, "ablation")


if __name__ == "__main__":
    main()
