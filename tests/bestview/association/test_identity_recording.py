"""On a real recording with realistic tracking errors, most pairs of views agree on identities."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, TrackUpdate

FRAMES, WINDOW, STRIDE = 1200, 15, 5
NOISE = 0.06  # of the box height, on every edge, correlated in time
BREAK_EVERY = 200  # mean number of frames after which a tracker loses a track and starts another

Boxes = dict[int, NDArray[np.float64]]
Track = tuple[int, NDArray[np.float64]]  # person, and (FRAMES, 4) boxes, NaN where hidden


def people(path: Path) -> dict[int, Boxes]:
    """Read the ground truth: person -> frame (from 0) -> box; only where the annotator saw the person."""
    found: dict[int, Boxes] = {}
    for line in path.read_text().splitlines():
        frame, person, left, top, width, height, _, _, visible = (float(x) for x in line.split(",")[:9])
        if visible:
            box = np.array([left, top, left + width, top + height])
            found.setdefault(int(person), {})[int(frame) - 1] = box
    return found


def simulate_tracks(truth: dict[int, Boxes], rng: np.random.Generator) -> list[Track]:
    """Simulate the tracks of a poor tracker from ground truth, in the order of their start."""
    tracks: list[tuple[int, int, NDArray[np.float64]]] = []
    for person, boxes in sorted(truth.items()):
        last, error = -FRAMES, np.zeros(4)
        for frame in sorted(boxes):
            if frame - last > WINDOW or rng.random() < 1 / BREAK_EVERY:
                tracks.append((frame, person, np.full((FRAMES, 4), np.nan)))
            error = 0.8 * error + 0.6 * rng.normal(size=4)
            tracks[-1][2][frame] = boxes[frame] + NOISE * error * (boxes[frame][3] - boxes[frame][1])
            last = frame
    return [(person, boxes) for _, person, boxes in sorted(tracks, key=lambda item: item[:2])]


def agreement(
    tracks: Mapping[str, list[Track]],
    homographies: Mapping[str, NDArray[np.float64] | None],
) -> tuple[float, float, int]:
    """Compute precision and recall of "these two views show one person", and the number of ids."""
    registry = IdentityRegistry(IdentitySettings(), homographies)
    right = wrong = missed = numbers = 0
    for last in range(STRIDE - 1, FRAMES, STRIDE):
        track_updates, person_of = [], {}
        first = last - STRIDE + 1
        for camera, camera_tracks in tracks.items():
            for local, (person, boxes) in enumerate(camera_tracks):
                rows = boxes[first : last + 1]
                if not np.isnan(rows).all():
                    track_updates.append(TrackUpdate(camera, local, first, rows))
                    person_of[track_updates[-1].key] = person
        update = registry.update(track_updates, last)
        numbers = max(numbers, *update.created, 0)
        number = {key.track: number for key, number in update.person_ids.items() if number}
        for one, two in combinations(person_of, 2):
            if one.camera != two.camera:
                same = number.get(one, -1) == number.get(two, -2)
                right += same and person_of[one] == person_of[two]
                wrong += same and person_of[one] != person_of[two]
                missed += not same and person_of[one] == person_of[two]
    return right / max(right + wrong, 1), right / (right + missed), numbers


@pytest.mark.parametrize("cameras", [("c0", "c1"), ("c0", "c1", "c2", "c3")])
def test_cameras_agree_on_identities_on_a_common_ground(shared_data: Path, cameras: tuple[str, ...]) -> None:
    rng = np.random.default_rng(1)
    folder = shared_data / "terrace"
    matrices = json.loads((folder / "ground.json").read_text())["homography"]
    tracks = {camera: simulate_tracks(people(folder / "gt" / f"{camera}.txt"), rng) for camera in cameras}
    precision, recall, numbers = agreement(tracks, {c: np.array(matrices[c], float) for c in cameras})
    assert precision > 0.93
    assert recall > 0.9
    assert numbers <= 8  # of five people, in more than thirty tracks of two views


def test_without_ground_and_appearance_people_are_not_confused(shared_data: Path) -> None:
    rng = np.random.default_rng(1)
    folder = shared_data / "terrace" / "gt"
    tracks = {camera: simulate_tracks(people(folder / f"{camera}.txt"), rng) for camera in ("c0", "c1")}
    precision, recall, numbers = agreement(tracks, {"c0": None, "c1": None})
    assert (precision, recall) == (0.0, 0.0)  # no pair is joined at all
    assert numbers <= 16  # each view's fragments are still joined
