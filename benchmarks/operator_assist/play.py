"""The thesis's soccer clips: separated particle filters, and an operator whose gaze pulls the particles.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.operator_assist.play --data ../shared/data --out out/bench

Todor (2009, section 8.3) tracks four clips of 2,500 frames of a game. Targets are given where they enter, and
never again. 17 fail, 3 of them while another one is flagged; failures are known beforehand, from a run
without help. While the operator points at a flagged target, half of each particle's weight is its closeness
to the point. 12 of the 14 flagged failures are corrected. Here the same is done on drawn play (the court),
and on real people where recordings with ground truth are available: none of them is of a game.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.paper_experiments.scene import ObjectTruth
from synthetic import Scene
from tracking.baselines.particles.particle_filter import ParticleTarget, particle_boxes
from tracking.baselines.particles.separated_particles import SeparatedParticles, SeparatedTarget
from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.detectors import Image
from tracking.motchallenge import read_rows

_LOST_IOU = 0.1
"""Overlap (IoU) with its person below which a target has failed."""
_LASTS_S = 1.0
"""Seconds for which it must be below, in frames where the person is visible."""
_MIN_VISIBLE = 0.3
"""Visible share of a person from which a frame counts, and at which a target may enter."""
_EARLY_S, _POINTED_S = 1.0, 4.0
"""Seconds from the first pointing to the failure, and of pointing; flags do not overlap."""
_GAZE_ERROR, _CLOSENESS = 0.1, 0.2
"""Standard deviations of pointing, and of the closeness of particles to the point, in heights."""
_COURT_SIZE, _COURT_FPS = (640, 360), 25.0
_RECORDED = (("pets09", "view1", 7.0, 400), ("terrace", "c0", 25.0, 600), ("terrace2", "c1", 25.0, 400))
"""Scene, view, frame rate, and how many of the last frames."""


@dataclass(frozen=True, slots=True, eq=False)
class PlayClip:
    """Pictures and ground truth."""

    name: str
    images: Sequence[Image]
    truth: ObjectTruth
    fps: float


@dataclass(frozen=True, slots=True)
class TargetFailure:
    """A target that leaves its person, from a frame on."""

    target: int
    frame: int


def draw_play(seed: int, seconds: float, players: int) -> PlayClip:
    """Draw a clip of the court."""
    scene = Scene("court", 1, players, seed, *_COURT_SIZE, _COURT_FPS)
    count = round(seconds * _COURT_FPS)
    boxes, visible = np.full((players, count, BOX_SIDES), np.nan), np.zeros((players, count))
    for frame in range(count):
        there = scene.truth(frame)[0]
        boxes[there.ids - 1, frame], visible[there.ids - 1, frame] = there.boxes, there.visibility
    images = [scene.image(0, frame) for frame in range(count)]
    return PlayClip(f"drawn play, seed {seed}", images, ObjectTruth(boxes, visible), _COURT_FPS)


def recorded_people(data: Path) -> Iterator[PlayClip]:
    """Yield the available recordings of real people."""
    for scene, view, fps, last in _RECORDED:
        video, rows = data / scene / f"{view}.mp4", data / scene / "gt" / f"{view}.txt"
        if video.is_file() and rows.is_file():
            yield _read_clip(f"{scene} {view}", video, rows, fps, last)


def _read_clip(name: str, video: Path, rows: Path, fps: float, last: int) -> PlayClip:
    capture, images = cv2.VideoCapture(str(video)), []
    while (read := capture.read())[0]:
        images.append(np.asarray(read[1], dtype=np.uint8))
    first = max(len(images) - last, 0)
    truth = [row for row in read_rows(rows) if first < row.frame <= len(images)]
    numbers = {number: index for index, number in enumerate(sorted({row.id for row in truth}))}
    boxes = np.full((len(numbers), len(images) - first, BOX_SIDES), np.nan)
    visible = np.zeros(boxes.shape[:2])
    for row in truth:
        place = numbers[row.id], row.frame - 1 - first
        boxes[place] = [row.left, row.top, row.left + row.width, row.top + row.height]
        visible[place] = float(row.confidence != 0.0)
    return PlayClip(name, images[first:], ObjectTruth(boxes, visible), fps)


def follow(clip: PlayClip, pointed: Mapping[int, range], seed: int = 1) -> Floats:
    """Track all people; return the targets' boxes `(n, T, 4)`, NaN before they enter and after they left.

    `pointed`: the frames in which the operator points at a target.
    """
    method, rng = SeparatedParticles(), np.random.default_rng(seed)
    truth = clip.truth
    boxes = np.full_like(truth.boxes, np.nan)
    present = ~np.isnan(truth.boxes[..., 0])
    leaves = present.shape[1] - present[:, ::-1].argmax(axis=1)
    active: dict[int, SeparatedTarget] = {}
    for frame, image in enumerate(clip.images):
        active = {number: target for number, target in active.items() if frame < leaves[number]}
        method.predict(image, list(active.values()))
        for number, target in active.items():
            if frame in pointed.get(number, range(0)) and present[number, frame]:
                pull(target, truth.boxes[number, frame], rng)
            boxes[number, frame] = target.box
        entering = (truth.visible[:, frame] >= _MIN_VISIBLE) & np.isnan(boxes[:, :frame, 0]).all(axis=1)
        for number in np.flatnonzero(entering & present[:, frame]).tolist():
            active[number] = method.initialize(image, truth.boxes[number, frame])
            boxes[number, frame] = truth.boxes[number, frame]
    return boxes


def pull(target: ParticleTarget, box: Floats, rng: np.random.Generator) -> None:
    """Reweigh a target's particles: half by their weight, half by their closeness to a point near `box`."""
    height = float(box[3] - box[1])
    point = (box[:2] + box[2:]) / 2.0 + _GAZE_ERROR * height * rng.standard_normal(2)
    distances = np.square(target.states[:, :2] - point).sum(axis=1) / (_CLOSENESS * height) ** 2
    closeness = np.exp(-0.5 * (distances - distances.min()))
    target.weights = 0.5 * target.weights + 0.5 * closeness / closeness.sum()
    target.box = particle_boxes(target.weights @ target.states, target.aspect)


def target_failures(clip: PlayClip, boxes: Floats) -> list[TargetFailure]:
    """Return the first failure of each target, in order of time."""
    found, lasts = [], max(round(_LASTS_S * clip.fps), 1)
    for number in range(clip.truth.objects):
        counts = np.flatnonzero((clip.truth.visible[number] >= _MIN_VISIBLE) & ~np.isnan(boxes[number, :, 0]))
        away = iou(boxes[number, counts], clip.truth.boxes[number, counts]) < _LOST_IOU
        run = 0
        for place, is_away in enumerate(away):
            run = run + 1 if is_away else 0
            if run == lasts:
                found.append(TargetFailure(number, int(counts[place - lasts + 1])))
                break
    return sorted(found, key=lambda failure: (failure.frame, failure.target))


def choose_flags(failures: Sequence[TargetFailure], fps: float) -> dict[int, range]:
    """Return the frames in which the operator points at each flagged target; one at a time."""
    flags: dict[int, range] = {}
    free = 0
    for failure in failures:
        start = max(failure.frame - round(_EARLY_S * fps), 0)
        if start >= free:
            free = start + round(_POINTED_S * fps)
            flags[failure.target] = range(start, free)
    return flags


@dataclass(frozen=True, slots=True)
class PlayCounts:
    """The counts of one clip.

    Attributes:
        targets: people.
        minutes: of video.
        failures: targets that fail without help.
        flagged: those of them that are flagged.
        corrected: flagged targets that are on their person for a second after the pointing.
        caused: targets that fail with help only.
    """

    targets: int
    minutes: float
    failures: int
    flagged: int
    corrected: int
    caused: int


def count_play(clip: PlayClip) -> PlayCounts:
    """Track a clip without and with help."""
    alone = target_failures(clip, follow(clip, {}))
    flags = choose_flags(alone, clip.fps)
    helped = {failure.target: failure.frame for failure in target_failures(clip, follow(clip, flags))}
    caused = helped.keys() - {failure.target for failure in alone}
    settled = round(_LASTS_S * clip.fps)
    corrected = [
        number
        for number, frames in flags.items()
        if number not in helped or helped[number] >= frames.stop + settled
    ]
    minutes = len(clip.images) / clip.fps / 60.0
    return PlayCounts(clip.truth.objects, minutes, len(alone), len(flags), len(corrected), len(caused))


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    rows = [["thesis: 4 soccer clips", "-", "6.7", "17", "14", "12", "-"]]
    for clip in _clips(options):
        found = count_play(clip)
        counts = (found.failures, found.flagged, found.corrected, found.caused)
        rows.append([clip.name, str(found.targets), f"{found.minutes:.1f}", *map(str, counts)])
    report.table(
        "Targets that fail, and those that the operator's gaze corrects",
        ["", "targets", "minutes", "failures", "flagged", "corrected", "new failures"],
        rows,
    )
    report.save(options.out / "play.txt")


def _clips(options: argparse.Namespace) -> Iterator[PlayClip]:
    for seed in range(1, options.clips + 1):
        yield draw_play(seed, options.seconds, options.players)
    yield from recorded_people(options.data)


def main() -> None:
    """Run the benchmark."""
    cv2.setNumThreads(1)
    options = parser(__doc__, "play")
    options.add_argument("--clips", type=int, default=4, help="of drawn play")
    options.add_argument("--seconds", type=float, default=20.0, help="of each")
    options.add_argument("--players", type=int, default=10, help="in each")
    measure(options.parse_args())


if __name__ == "__main__":
    main()
