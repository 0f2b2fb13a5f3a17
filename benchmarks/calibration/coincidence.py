"""Pairs of cameras that calibration from a walk keeps: those of one floor, and, by coincidence, others.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.calibration.coincidence --rooms 2 --recording terrace

The walks are true boxes of people who are half visible at least. *One floor*: all pairs of cameras of a drawn
room, or of a recording. *Another floor*: a camera of one room with each of a room that looks the same but has
other visitors; the cameras of a gallery, between which people go, but which have no floor in common. *Another
time*: one camera's first half of a recording with another's second half.

A pair is refused for the first reason that applies, in the order of the columns; the last is *quarters*: each
quarter of the walk must be predicted by the rest (`minimum_held_out`). *Kept at* is for other thresholds, and
*closest* are the worst quarters nearest to it. *Misplaced* are kept pairs whose floor is wrong: half of the
foot points by half a person's height or more.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.report import Report
from bestview import foot_points, to_ground
from bestview.calibration import Floats, Walk, WalkSettings, WalkTrack, build_walk
from bestview.calibration.camera_groups import align_camera_pairs
from bestview.calibration.pair_search import PairAlignment
from bestview.geometry import ground_handedness
from synthetic import Scene
from tracking.motchallenge import read_rows

_ROOM_CAMERAS, _GALLERY_CAMERAS = 4, 3
_GALLERY_TIMES = 2.0
"""How many times longer people walk in a gallery."""
_SIZE, _FPS = (320, 180), 5.0
"""Of drawn walks: cameras are compared five times a second, whatever their frame rate is."""
_PEOPLE = (1, 4)
_MIN_VISIBLE = 0.5
_MISPLACED = 0.5
"""Median error of foot points in person heights."""
_THRESHOLDS = (0.33, 0.5, 0.67)
_NEAREST = 3
"""Pairs of each row whose worst quarter is printed: those nearest to the threshold."""
_REASONS = ("places", "share", "error", "line", "chance")
"""By which a pair is refused, in the order of the tests, before that of the quarters."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording with true boxes: its folders, which follow each other in time, each with as many frames."""

    parts: tuple[str, ...]
    size: tuple[int, int]
    fps: float
    frames: int


_RECORDINGS = {
    "terrace": Recording(("terrace", "terrace2"), (360, 288), 25.0, 1200),
    "wildtrack": Recording(("wildtrack",), (1920, 1080), 2.0, 300),
}


@dataclass(frozen=True, slots=True)
class RecordedFloor:
    """Cameras of one floor: their walks, and their true homographies to it."""

    walks: tuple[Walk, ...]
    truth: Mapping[str, Floats]
    fps: float


@dataclass(frozen=True, slots=True)
class WalkedPair:
    """Two cameras to be aligned.

    Attributes:
        kind: the row of the table that it counts in.
        walks: of the two.
        truth: their homographies to the floor that they share, if they do.
        fps: frames a second of the walks.
    """

    kind: str
    walks: tuple[Walk, ...]
    truth: Mapping[str, Floats] | None
    fps: float


@dataclass(frozen=True, slots=True)
class JudgedPair:
    """A pair, the first of the `_REASONS` that it is refused for, if any, and what the quarters say.

    Attributes:
        kind: the row of the table that it counts in.
        reason: None: only the quarters are left to refuse it.
        held_out: the share of the agreement that is predicted in the worst quarter.
        misplaced: whether the floors of the two differ; False where the pair shares no floor.
    """

    kind: str
    reason: str | None
    held_out: float
    misplaced: bool


def draw_floor(scene_name: str, cameras: int, people: int, seed: int, seconds: float) -> RecordedFloor:
    """Return the walks of a drawn scene's cameras."""
    scene = Scene(scene_name, cameras, people, seed, *_SIZE, _FPS)
    frames: list[list[tuple[int, int, Floats]]] = [[] for _ in range(cameras)]
    for frame in range(round(seconds * _FPS)):
        for number, truth in enumerate(scene.truth(frame)):
            visible = truth.visibility >= _MIN_VISIBLE
            frames[number] += [
                (frame, int(person), box)
                for person, box in zip(truth.ids[visible], truth.boxes[visible], strict=True)
            ]
    walks = tuple(
        build_walk(
            f"c{number}",
            _SIZE,
            [frame for frame, _, _ in seen],
            [person for _, person, _ in seen],
            np.array([box for _, _, box in seen]).reshape(-1, 4),
            _FPS,
        )
        for number, seen in enumerate(frames)
    )
    matrices = {f"c{number}": scene.homography(number) for number in range(cameras)}
    return RecordedFloor(
        walks, {name: matrix for name, matrix in matrices.items() if matrix is not None}, _FPS
    )


def read_floor(data: Path, recording: Recording) -> RecordedFloor:
    """Return the true walks of a recording.

    Raises:
        CannotRunError: it is missing.
    """
    first, *_ = folders = [data / part for part in recording.parts]
    if not (first / "ground.json").is_file():
        raise CannotRunError(f"needs {first}")
    matrices = json.loads((first / "ground.json").read_text(encoding="utf-8"))["homography"]
    walks = []
    for path in sorted((first / "gt").iterdir()):
        rows = [
            (row.frame - 1 + number * recording.frames, row.id, row.box)
            for number, folder in enumerate(folders)
            for row in read_rows(folder / "gt" / path.name)
            if row.confidence != 0.0
        ]
        frames, people, boxes = zip(*rows, strict=True)
        camera = path.name.split(".")[0]
        walks.append(build_walk(camera, recording.size, frames, people, np.array(boxes), recording.fps))
    return RecordedFloor(
        tuple(walks), {name: np.array(matrix) for name, matrix in matrices.items()}, recording.fps
    )


def pairs_of_rooms(people: int, seeds: Sequence[int], seconds: float) -> Iterator[WalkedPair]:
    """Yield the pairs within rooms, and those between each room and the next one."""
    floors = [draw_floor("room", _ROOM_CAMERAS, people, seed, seconds) for seed in seeds]
    for floor in floors:
        yield from pairs_of_one_floor(f"room, {people} walking: one floor", floor)
    for other, floor in pairwise([*floors, *floors[:1]] if len(floors) > 1 else floors):
        for pair in product(floor.walks, other.walks):
            yield WalkedPair(f"room, {people} walking: another floor", pair, None, floor.fps)


def pairs_of_galleries(people: int, seeds: Sequence[int], seconds: float) -> Iterator[WalkedPair]:
    """Yield the pairs within galleries, whose cameras have no floor in common."""
    for seed in seeds:
        floor = draw_floor("gallery", _GALLERY_CAMERAS, people, seed, _GALLERY_TIMES * seconds)
        for pair in combinations(floor.walks, 2):
            yield WalkedPair(f"gallery, {people} walking: another floor", pair, None, floor.fps)


def pairs_of_one_floor(kind: str, floor: RecordedFloor) -> Iterator[WalkedPair]:
    """Yield all pairs of cameras."""
    for pair in combinations(floor.walks, 2):
        yield WalkedPair(kind, pair, floor.truth, floor.fps)


def pairs_of_recording(name: str, floor: RecordedFloor) -> Iterator[WalkedPair]:
    """Yield the pairs of cameras at the same time, and those of one's first half with another's second."""
    yield from pairs_of_one_floor(f"{name}: one floor", floor)
    half = max(walk.end_frame for walk in floor.walks) // 2
    halves = [(between(walk, 0, half), between(walk, half, 2 * half)) for walk in floor.walks]
    for one, other in product(range(len(halves)), repeat=2):
        if one != other:
            yield WalkedPair(f"{name}: another time", (halves[one][0], halves[other][1]), None, floor.fps)


def between(walk: Walk, start: int, end: int) -> Walk:
    """Return a part of a walk, which begins at frame 0."""
    parts = []
    for track in walk.tracks:
        boxes = track.boxes[max(0, start - track.first_frame) : max(0, end - track.first_frame)]
        if len(boxes) > 1:
            parts.append(WalkTrack(max(track.first_frame, start) - start, boxes))
    return replace(walk, tracks=tuple(parts))


def judge_pair(pair: WalkedPair, shift_s: float) -> JudgedPair:
    """Align two cameras that may be out of sync by some seconds, and find out which test refuses them."""
    settings = replace(WalkSettings.at_rate(pair.fps, shift_s), minimum_held_out=1e-9)
    alignment = align_camera_pairs(pair.walks, settings)[0].alignment
    if alignment is None:
        return JudgedPair(pair.kind, _REASONS[0], 0.0, misplaced=False)
    return JudgedPair(
        pair.kind,
        first_reason(alignment, settings),
        alignment.held_out,
        pair.truth is not None and _is_misplaced(alignment, pair.walks, pair.truth),
    )


def first_reason(alignment: PairAlignment, settings: WalkSettings) -> str | None:
    """Return the first reason but the quarters that refuses an alignment."""
    refused = (
        alignment.places < settings.minimum_places,
        alignment.share < settings.minimum_share,
        alignment.error > settings.maximum_error,
        alignment.breadth < settings.minimum_breadth,
        alignment.merit < settings.minimum_over_chance * alignment.chance,
    )
    return next((reason for reason, applies in zip(_REASONS, refused, strict=True) if applies), None)


def _is_misplaced(alignment: PairAlignment, walks: Sequence[Walk], truth: Mapping[str, Floats]) -> bool:
    """Return whether most foot points are wrong, after the best rotation, shift and scale of the floor."""
    found, true = [], []
    for walk, camera in zip(walks, alignment.rig.cameras, strict=True):
        image = np.concatenate([foot_points(track.boxes) for track in walk.tracks])
        found.append(_floor(camera.floor_homography(), image))
        true.append(_floor(truth[walk.camera], image))
    x, y = np.concatenate(found), np.concatenate(true)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known] - x[known].mean(), y[known] - y[known].mean()
    return bool(np.median(np.abs(x - y * np.vdot(y, x) / np.vdot(y, y))) >= _MISPLACED)


def _floor(homography: Floats, image: Floats) -> NDArray[np.complex128]:
    """Map foot points (K, 2) to the floor, (K,), seen from above whatever the handedness of its axes is."""
    return np.asarray(to_ground(homography, image) @ np.array([1, 1j * ground_handedness(homography)]))


def row(kind: str, judged: Sequence[JudgedPair]) -> list[str]:
    """Return a row of the table: numbers of pairs."""
    refused = Counter(pair.reason for pair in judged)
    undecided = [pair for pair in judged if pair.reason is None]
    default = WalkSettings.at_rate(_FPS).minimum_held_out
    held_out = sorted(100.0 * pair.held_out for pair in undecided)
    nearest = sorted(held_out, key=lambda percent: abs(percent - 100.0 * default))[:_NEAREST]
    kept = [pair for pair in undecided if pair.held_out >= default]
    return [
        kind,
        str(len(judged)),
        *(str(refused[reason]) for reason in _REASONS),
        str(len(undecided) - len(kept)),
        str(len(kept)),
        str(sum(pair.misplaced for pair in kept)),
        ", ".join(str(sum(percent >= 100.0 * least for percent in held_out)) for least in _THRESHOLDS),
        " ".join(f"{percent:.0f}" for percent in sorted(nearest)),
    ]


def measure(options: argparse.Namespace, report: Report) -> None:
    """Measure, and print the table."""
    seeds = range(options.first_seed, options.first_seed + options.rooms)
    pairs: list[WalkedPair] = []
    for people in _PEOPLE:
        pairs += pairs_of_rooms(people, seeds, options.seconds)
    pairs += pairs_of_galleries(_PEOPLE[-1], seeds, options.seconds)
    for name in options.recording or ():
        try:
            pairs += pairs_of_recording(name, read_floor(options.data, _RECORDINGS[name]))
        except CannotRunError as problem:
            report.line(f"{name}: skipped: {problem}")
    judged = [judge_pair(pair, options.shift) for pair in pairs]
    columns = ["pairs of cameras", "pairs", *_REASONS, "quarters", "kept", "misplaced"]
    columns += ["kept at " + ", ".join(f"{least:.2f}"[1:] for least in _THRESHOLDS), "closest, %"]
    report.table(
        f"Pairs that are refused, by the first reason, and kept; rooms of {options.seconds:g} s",
        columns,
        [
            row(kind, [pair for pair in judged if pair.kind == kind])
            for kind in dict.fromkeys(pair.kind for pair in judged)
        ],
    )


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "calibration.coincidence")
    options.add_argument(
        "--rooms", type=int, default=2, help="drawn rooms of each kind, two for pairs between them"
    )
    options.add_argument("--seconds", type=float, default=60.0, help="length of the walk in a drawn room")
    options.add_argument(
        "--shift", type=float, default=3.0, help="seconds by which cameras may be out of sync"
    )
    options.add_argument("--first-seed", type=int, default=1000, help="seed of the first of them")
    options.add_argument(
        "--recording", action="append", choices=_RECORDINGS, help="also pairs of this one; may be repeated"
    )
    chosen, report = options.parse_args(), Report()
    measure(chosen, report)
    report.save(chosen.out / "calibration_coincidence.txt")


if __name__ == "__main__":
    main()
