"""What a layout term could gain on public detections, and what one between companions gains.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.layout_gain --data ../shared/data --out out/bench

`true positions` tells the program where everybody is: a layout term can know no more. `of companions` tells
it only of people who keep their relative position for a second. Three forms do not know the truth: the
paper's, between all pairs, in pixels; the same in heights of people on the ground; and, in heights and
seconds, capped, one only between those who walked together (`companions`). `--development` compares their
weights on other recordings, where one is to be chosen. Each seed but the first drops 3 % of the detections: a
single swap changes IDF1 by several points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.public_detections import (
    Recording,
    configured,
    detections,
    find_development_recordings,
    find_recordings,
)
from benchmarks.common.report import Report
from benchmarks.layout_gain.companions import CompanionSettings, CompanionTracker
from benchmarks.layout_gain.ground_layout import GroundLayoutTracker
from benchmarks.layout_gain.true_positions import TruePositionTracker, true_boxes, true_companions
from server.cli.render.plots import new_figure, save_figure
from server.cli.track.command import newly_final_rows
from tracking import Detections, OnlineTracker
from tracking.boxes import Floats
from tracking.motchallenge import MotRow, read_rows

_DROPPED = 0.03
_PIXEL_WEIGHTS, _HEIGHT_WEIGHTS, _COMPANION_WEIGHTS = (1e-4, 5e-4), (1e-2, 5e-2), (0.1, 0.3)
"""Weights of the three forms: per pixel, per height, and of a place where no companion expects somebody."""

Tracker = Callable[..., OnlineTracker]


@dataclass(frozen=True, slots=True, eq=False)
class DetectedRecording:
    """A recording's detections, with histograms if it has pictures."""

    recording: Recording
    name: str
    frames: Sequence[Detections]

    @classmethod
    def of(cls, recording: Recording, *, pictures: bool) -> DetectedRecording:
        """Read the detections, with pictures or without."""
        name = f"{recording.name}, pictures" if pictures else recording.name
        config = configured(recording, pictures=pictures)
        return cls(recording, name, list(detections(recording, config, pictures=pictures)))

    def ways(self) -> dict[str, Tracker]:
        """Return the trackers by name; the first one is the default."""
        people = true_boxes(read_rows(self.recording.truth))
        together = true_companions(people, self.recording.fps)
        return {
            "default": OnlineTracker,
            **forms(),
            "true positions of companions": lambda *args: TruePositionTracker(
                *args, people=people, applies=together
            ),
            "true positions": lambda *args: TruePositionTracker(*args, people=people, applies=None),
        }

    def idf1(self, tracker: Tracker, seed: int) -> float:
        """Track with these detections, of which every seed but 0 drops some; return IDF1, per cent."""
        track, fps = configured(self.recording).track, self.recording.fps
        online = tracker(track.window, track.costs, track.create_solver(fps), fps)
        rng, rows = np.random.default_rng(seed), list[MotRow]()
        for number, seen in enumerate(self.frames):
            kept = rng.random(len(seen)) >= _DROPPED if seed else np.ones(len(seen), dtype=np.bool_)
            some = replace(
                seen, boxes=seen.boxes[kept], scores=seen.scores[kept], histograms=seen.histograms[kept]
            )
            rows += newly_final_rows(online.push(number, some))
        rows += newly_final_rows(online.flush())
        return 100.0 * self.recording.score(rows).idf1


def forms() -> dict[str, Tracker]:
    """Return the trackers with each form of the layout term at each weight, by name."""

    def paper(weight: float) -> Tracker:
        return lambda window, costs, *more: OnlineTracker(window, replace(costs, layout=weight), *more)

    return {
        **{f"the paper's, {weight:g} a pixel": paper(weight) for weight in _PIXEL_WEIGHTS},
        **{
            f"on the ground, {weight:g} a height": partial(GroundLayoutTracker, weight=weight)
            for weight in _HEIGHT_WEIGHTS
        },
        **{
            f"companions, {weight:g}": partial(CompanionTracker, companions=CompanionSettings(weight))
            for weight in _COMPANION_WEIGHTS
        },
    }


def development(recordings: Sequence[Recording], seeds: int, out: Path) -> None:
    """Compare the weights of each form on recordings that are for nothing else."""
    ways = {"default": OnlineTracker, **forms()}
    inputs = [DetectedRecording.of(recording, pictures=True) for recording in recordings]
    found = {item.name: measured(item, ways, seeds) for item in inputs}
    save(found, seeds, out / "layout_gain-development")


def run(recordings: Sequence[Recording], seeds: int, out: Path) -> None:
    """Measure, print and save."""
    inputs = [DetectedRecording.of(recording, pictures=False) for recording in recordings]
    inputs += [
        DetectedRecording.of(recording, pictures=True)
        for recording in recordings
        if recording.video and recording.video.is_file()
    ]
    save({item.name: measured(item, item.ways(), seeds) for item in inputs}, seeds, out / "layout_gain")


def measured(item: DetectedRecording, ways: Mapping[str, Tracker], seeds: int) -> dict[str, Floats]:
    """Return IDF1, per cent, by each way, `(seeds,)`."""
    return {name: np.array([item.idf1(way, seed) for seed in range(seeds)]) for name, way in ways.items()}


def save(found: Mapping[str, Mapping[str, Floats]], seeds: int, path: Path) -> None:
    """Print and save the table and the plot: by recording, then by way, the default first."""
    report = Report()
    first, *others = next(iter(found.values()))
    gains = {name: [scores[name] - scores[first] for scores in found.values()] for name in others}
    rows = [[first, *(f"{scores[first].mean():.1f}" for scores in found.values())]]
    rows += [
        [name, *(f"{gain.mean():+.1f} (≥ {gain.min():+.1f})" for gain in by)] for name, by in gains.items()
    ]
    report.table(f"IDF1, %, and gain by each term: mean of {seeds} seeds (the least)", ["", *found], rows)
    report.save(path.with_suffix(".txt"))
    plot(gains, list(found), path.with_suffix(".png"))


def plot(gains: Mapping[str, Sequence[Floats]], recordings: Sequence[str], path: Path) -> None:
    """Draw each form's gain: a point for each recording's mean, and a line from the least to the greatest."""
    figure = new_figure((8.0, 0.5 + 0.55 * len(gains)))
    axis = figure.subplots()
    for index, recording in enumerate(recordings):
        mean = np.array([by[index].mean() for by in gains.values()])
        spread = np.array([[by[index].min(), by[index].max()] for by in gains.values()]).T
        rows = np.arange(len(gains)) + 0.6 * (index / max(1, len(recordings) - 1) - 0.5)
        axis.errorbar(mean, rows, xerr=np.abs(spread - mean), fmt="o", markersize=4, label=recording)
    axis.axvline(0.0, color="gray", linewidth=0.8)
    axis.set_yticks(range(len(gains)), list(gains))
    axis.invert_yaxis()
    axis.set(xlabel="IDF1 gained by the layout term, points")
    axis.legend(fontsize="small")
    save_figure(figure, path)


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "layout_gain")
    options.add_argument("--sequence", action="append", help="only this one; may be repeated")
    options.add_argument("--seeds", type=int, default=3, help="runs of each, with other detections dropped")
    options.add_argument("--development", action="store_true", help="compare weights on other recordings")
    chosen = options.parse_args()
    try:
        if chosen.development:
            development(find_development_recordings(chosen.data), chosen.seeds, chosen.out)
        else:
            run(find_recordings(chosen.data, chosen.sequence), chosen.seeds, chosen.out)
    except CannotRunError as problem:
        finish(problem, "layout_gain")


if __name__ == "__main__":
    main()
