"""Stays from sampled sightings: against brute force, in areas, from files of decisions."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.rules import Area
from server.service.past_search.search import search
from server.service.past_search.sightings import read_sightings
from server.service.past_search.stays import Place, RecordedPerson, StayCollector
from server.service.past_search.worker import CameraMessage, RunFiles, SearchTask, ZoneMessage

STEP, GOP = 2, 5
HALL = Place()
IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.001, 1.0]]
LEFT, RIGHT = (2.0, 10.0, 8.0, 28.0), (50.0, 10.0, 56.0, 28.0)
TASK = SearchTask(
    start=0,
    end=1000,
    step=STEP,
    gap=10,
    shortest=1,
    runs=[],
    recent=b"",
    site_size=(64, 48),
    cameras=[CameraMessage(name, (64, 48), IDENTITY, is_overhead=False) for name in ("c0", "c1")],
    zones=[],
    by_camera=[],
    anywhere=True,
    number=None,
    merged={},
    order="time",
    limit=100,
    work_s=60.0,
)


def line(first: int, boxes: dict[str, dict[int, Any]], **more: Any) -> bytes:
    rows = {
        camera: [[[number, *box] for number, box in people.items()]] * GOP for camera, people in boxes.items()
    }
    return msgspec.json.encode(
        {"first": first, "frames": GOP, "choices": {}, "boxes": rows, "cuts": [], **more}
    )


def brute_force(
    seen: set[tuple[int, int]], kept: dict[int, int], gap: int, shortest: int
) -> set[tuple[int, int, int]]:
    """Walk through every pulse of every person."""
    stays = set()
    for person in {kept.get(number, number) for _, number in seen}:
        present = {
            pulse + offset
            for pulse, number in seen
            if kept.get(number, number) == person
            for offset in range(STEP)
        }
        first = last = min(present)
        for pulse in range(first, max(present) + gap + 3):
            if pulse in present:
                last = pulse
            elif pulse - last > gap:
                later = [at for at in present if at > pulse - 1]
                if last - first + 1 >= shortest:
                    stays.add((person, first, last + 1))
                if not later:
                    break
                if pulse < min(later):
                    first = last = min(later)
                    continue
    return stays


SIGHTINGS = st.lists(st.tuples(st.integers(0, 60).map(lambda k: k * STEP), st.integers(1, 4)), max_size=40)


@settings(max_examples=60, deadline=None)
@given(SIGHTINGS, st.integers(0, 9), st.integers(1, 12), st.integers(1, 5), st.booleans(), st.randoms())
def test_stays_are_those_found_by_walking_through_every_pulse(
    sightings: list[tuple[int, int]], gap: int, shortest: int, parts: int, merged: bool, rng: Random
) -> None:
    kept = {4: 1} if merged else {}
    collector = StayCollector(STEP, gap, kept)
    rng.shuffle(sightings)
    for part in range(parts):
        rows = np.array(sightings[part::parts], dtype=np.int64).reshape(-1, 2)
        collector.add("", HALL, rows[:, 0], rows[:, 1], rows[:, 0] % 3)
    found = collector.stays(shortest)
    assert {(stay.person.number, stay.first, stay.end) for stay in found} == brute_force(
        set(sightings), kept, gap, shortest
    )
    if shortest <= STEP:
        assert sum(sum(stay.seen.values()) for stay in found) == len(sightings)


def test_merges_of_an_earlier_run_count_in_that_run_alone() -> None:
    collector = StayCollector(STEP, 0, {})
    collector.merge("old", 1, 2)
    collector.merge("old", 3, 1)
    collector.merge("old", 2, 3)  # a circle ends
    for run in ("old", ""):
        collector.add(run, HALL, np.array([0]), np.array([1]), np.array([0]))
    assert {stay.person.run for stay in collector.stays(1)} == {"old", ""}
    assert RecordedPerson("", 1) in {stay.person for stay in collector.stays(1)}


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=3, max_size=7), st.randoms())
def test_points_are_inside_an_area_where_their_depth_is_positive(
    corners: list[tuple[int, int]], rng: Random
) -> None:
    area = Area("a", tuple((float(x), float(y)) for x, y in corners))
    points = np.array([[rng.uniform(-4, 4), rng.uniform(-4, 4)] for _ in range(20)])
    depths = [area.depth((x, y)) for x, y in points.tolist()]
    for inside, depth in zip(area.contains(points).tolist(), depths, strict=True):
        assert depth == 0.0 or inside == (depth > 0.0), "on the border either may be told"


@pytest.fixture
def recording(tmp_path: Path) -> list[RunFiles]:
    """Person 1 goes from left to right, where both cameras see them; in an earlier run 1 is another."""
    old, first, second = (tmp_path / name for name in ("0.jsonl", "100.jsonl", "110.jsonl"))
    old.write_bytes(line(0, {"c0": {1: LEFT}}) + b"\n")
    lines = [line(100, {"c0": {1: LEFT}}), line(105, {"c0": {1: LEFT, 2: RIGHT}})]
    first.write_bytes(b"\n".join(lines) + b'\n{"first": 110, "fra')
    lines = [line(110, {"c0": {1: RIGHT}, "c1": {1: RIGHT}}), line(115, {"c1": {1: RIGHT}})]
    second.write_bytes(b"not JSON\n" + b"\n".join(lines))
    files = [str(first), str(tmp_path / "deleted.jsonl"), str(second)]
    return [RunFiles("20261121T161336Z", [str(old)]), RunFiles("", files)]


def found(task: SearchTask) -> list[tuple[Any, ...]]:
    return [
        (stay.run[:4], stay.number, stay.zone or stay.camera, stay.first, stay.end)
        for stay in search(task).stays
    ]


def test_stays_are_found_anywhere_and_by_camera(recording: list[RunFiles]) -> None:
    task = msgspec.structs.replace(TASK, runs=recording)
    assert found(task) == [("2026", 1, None, 0, 6), ("", 1, None, 100, 120), ("", 2, None, 106, 110)]
    by_camera = msgspec.structs.replace(task, anywhere=False, by_camera=["c1"])
    assert found(by_camera) == [("", 1, "c1", 110, 120)]
    result = search(msgspec.structs.replace(task, order="longest", limit=1))
    assert [(stay.first, stay.end, stay.cameras) for stay in result.stays] == [(100, 120, ["c0", "c1"])]
    assert (result.found, result.end, len(result.people)) == (3, 1000, 1)
    assert [stay.first for stay in search(msgspec.structs.replace(task, order="newest")).stays] == [
        106,
        100,
        0,
    ]


def test_zones_apply_to_places_on_the_floor_and_in_pictures(recording: list[RunFiles]) -> None:
    right = [(32.0, 0.0), (64.0, 0.0), (64.0, 48.0), (32.0, 48.0)]
    zones = [ZoneMessage("floor", None, right), ZoneMessage("c0 right", "c0", right)]
    task = msgspec.structs.replace(TASK, runs=recording, anywhere=False, zones=zones, number=1, gap=0)
    assert found(task) == [("", 1, "floor", 110, 120), ("", 1, "c0 right", 110, 116)]
    (person,) = search(task).people
    assert (person.first, person.end, person.frames, person.stays) == (110, 120, 10, 2)
    blind = [
        CameraMessage("c0", None, None, is_overhead=False),
        CameraMessage("c1", (64, 48), None, is_overhead=True),
    ]
    assert found(msgspec.structs.replace(task, cameras=blind)) == []


def test_a_merged_number_is_one_person_and_the_newest_lines_follow(recording: list[RunFiles]) -> None:
    recent = b"\n".join([line(115, {"c0": {7: LEFT}}), line(120, {"c0": {7: LEFT}})])
    task = msgspec.structs.replace(TASK, runs=recording, recent=recent, number=1, merged={7: 1})
    assert found(task) == [("", 1, None, 100, 126)], "a decision that is on the disk already counts once"
    assert found(msgspec.structs.replace(task, start=108, end=112)) == [("", 1, None, 108, 112)]


def test_a_search_ends_with_its_processor_time_and_continues_there(recording: list[RunFiles]) -> None:
    task = msgspec.structs.replace(TASK, runs=recording, work_s=0.0)
    stays, start, searches = [], 0, 0
    while start < task.end:
        result = search(msgspec.structs.replace(task, start=start))
        assert result.end > start
        stays += [(stay.number, stay.first, stay.end) for stay in result.stays if not stay.run]
        start, searches = result.end, searches + 1
    assert searches > 2
    assert stays == [(1, 100, 110), (2, 106, 110), (1, 110, 120)]


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=80), st.integers(0, 200), st.integers(0, 200), st.integers(1, 4))
def test_no_line_crashes_the_reader(noise: bytes, at: int, length: int, step: int) -> None:
    valid = line(10, {"c0": {1: LEFT, 2: RIGHT}, "c9": {3: LEFT}}, merged=[{"kept": 1, "lost": 2}])
    damaged = valid[:at] + noise + valid[at + length :]
    read = read_sightings([damaged, noise, line(20, {"c0": {1: LEFT}})], {"c0": 0}, 0, 100, step)
    assert read.end == 25
    assert len(read.pulses) == len(read.numbers) == len(read.cameras) == len(read.boxes)
    assert set(read.cameras.tolist()) <= {0}
    assert (read.pulses % step == 0).all()
