"""The checks of the fault benchmark: they accept correct pictures and detect each kind of error."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.report import Report
from benchmarks.faults.injection.processes import FAULTS
from benchmarks.faults.outcomes.fault_run import FaultOutcome, _inject
from benchmarks.faults.outcomes.measurement import _run_group
from benchmarks.faults.outcomes.promise_table import keeps_promises
from benchmarks.faults.outcomes.recording_check import RecordedFile, add_recording_results
from benchmarks.faults.site.fault_site import FaultSite
from benchmarks.faults.video.stamp_detector import write_stamp_detector
from benchmarks.faults.video.stamped_views import (
    FRAMES,
    HEIGHT,
    WIDTH,
    FrameStamp,
    StampedViews,
    read_stamp,
    stamp_picture,
)
from benchmarks.faults.viewing.live_pictures import MAX_AHEAD, MAX_BEHIND
from benchmarks.faults.viewing.picture_check import check_pictures
from benchmarks.faults.viewing.viewers import EventLog, ReceivedPicture
from client import Box, Gop
from tracking.detectors.neural.onnx import OnnxDetector, OnnxSettings

GOP = 10
SIDES = (10, 20, 30, 60)


def box_of(frame: int) -> Box:
    left, top, right, bottom = (side + frame / FRAMES for side in SIDES)
    return Box(1, left, top, right, bottom)


FOUND = {("c0", *(1000 * side + frame for side in SIDES)): frame for frame in range(FRAMES)}
VIEWS = StampedViews([], {}, None, FOUND)


def events_of(gops: int) -> EventLog:
    log = EventLog()
    for number in range(gops):
        first = number * GOP
        boxes = {"c0": tuple((box_of(frame % FRAMES),) for frame in range(first, first + GOP))}
        log.add(Gop(first=first, frames=GOP, choices={1: "c0"}, boxes=boxes, cuts=()))
    return log


def pictures_of(gops: int, behind: int = 0) -> list[ReceivedPicture]:
    return [
        ReceivedPicture(pulse, 100.0 + pulse // GOP * 0.4, FrameStamp("c0", (pulse - behind) % FRAMES))
        for pulse in range(gops * GOP)
    ]


def recorded_frames(pulses: Iterable[int]) -> dict[int, int]:
    return {pulse: pulse % FRAMES for pulse in pulses}


@pytest.mark.parametrize(("camera", "frame"), [(0, 0), (1, 517), (2, 999)])
def test_the_stamp_of_a_picture_is_read(camera: int, frame: int) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (144, 256, 3), dtype=np.uint8)
    gray = stamp_picture(noise, camera, frame).mean(axis=2).astype(np.uint8)
    assert read_stamp(gray) == FrameStamp(f"c{camera}", frame)
    assert read_stamp(noise.mean(axis=2).astype(np.uint8)) is None


def test_correct_pictures_are_accepted_across_the_end_of_the_looped_film() -> None:
    received = check_pictures(pictures_of(102), events_of(102), 1, VIEWS)
    assert (received.frames, received.wrong, received.repeated) == (1020, 0, 0)
    assert (received.boxes, received.wrong_boxes, received.averaged) == (1020, 0, 0)
    assert received.longest_gap(100.0, 140.0) == pytest.approx(0.4)


def test_a_picture_of_another_camera_is_wrong() -> None:
    pictures = pictures_of(3)
    pictures[14] = replace(pictures[14], stamp=FrameStamp("c1", 14))
    assert check_pictures(pictures, events_of(3), 1, VIEWS).wrong == 1


def test_a_picture_of_another_frame_is_wrong_and_so_is_its_box() -> None:
    pictures = pictures_of(3)
    pictures[14] = replace(pictures[14], stamp=FrameStamp("c0", 12))
    received = check_pictures(pictures, events_of(3), 1, VIEWS)
    assert (received.wrong, received.wrong_boxes) == (1, 1)


def test_a_repeated_picture_is_not_fresh_and_boxes_of_the_next_one_are_wrong_on_it() -> None:
    pictures = pictures_of(3)
    pictures[14] = replace(pictures[14], stamp=FrameStamp("c0", 13))
    received = check_pictures(pictures, events_of(3), 1, VIEWS)
    assert (received.wrong, received.repeated, received.wrong_boxes, len(received.fresh)) == (0, 1, 1, 29)


def test_a_picture_without_an_event_breaks_a_promise_unless_the_server_is_killed() -> None:
    received = check_pictures(pictures_of(3), events_of(2), 1, VIEWS)
    assert (received.wrong, received.unnamed) == (0, 10)
    unproven = FaultOutcome(FAULTS[0], received=[received])
    assert not keeps_promises(unproven)
    assert keeps_promises(replace(unproven, fault=replace(FAULTS[0], kills_server=True), recovery_s=1.0)), (
        "the events end with the server"
    )


def test_without_a_selected_camera_the_last_one_is_expected() -> None:
    log = events_of(1)
    log.add(Gop(first=GOP, frames=GOP, choices={}, boxes={}, cuts=()))
    pictures = pictures_of(2)
    assert check_pictures(pictures, log, 1, VIEWS).wrong == 0
    pictures[14] = replace(pictures[14], stamp=FrameStamp("c1", 14))
    assert check_pictures(pictures, log, 1, VIEWS).wrong == 1


def test_pictures_of_a_network_camera_are_within_bounds_and_in_order() -> None:
    for behind, wrong in ((0, 0), (3, 0), (MAX_BEHIND, 0), (MAX_BEHIND + 1, 30), (-MAX_AHEAD - 1, 30)):
        assert check_pictures(pictures_of(3, behind), events_of(3), 1, VIEWS, ["c0"]).wrong == wrong
    assert check_pictures(pictures_of(3, 3), events_of(3), 1, VIEWS).wrong == 30, (
        "a recording's are known exactly"
    )
    pictures = pictures_of(3, 3)
    pictures[14] = replace(pictures[14], stamp=FrameStamp("c0", 14 - 3 - 5))
    assert check_pictures(pictures, events_of(3), 1, VIEWS, ["c0"]).wrong == 1


def test_boxes_of_a_network_camera_belong_on_the_picture_of_their_detection() -> None:
    assert check_pictures(pictures_of(3), events_of(3), 1, VIEWS, ["c0"]).wrong_boxes == 0
    assert check_pictures(pictures_of(3, 3), events_of(3), 1, VIEWS, ["c0"]).wrong_boxes == 30


def test_recorded_pictures_of_a_network_camera_must_equal_the_shown_ones() -> None:
    outcome = FaultOutcome(
        FAULTS[0], received=[check_pictures(pictures_of(3), events_of(3), 1, VIEWS, ["c0"])], gops=(0, 3)
    )
    for there, mismatches in ((recorded_frames(range(30)), 0), ({**recorded_frames(range(30)), 14: 13}, 1)):
        add_recording_results([outcome], events_of(3), [RecordedFile("c0", 0, there, plays=True)])
        assert len(outcome.mismatches) == mismatches
        assert keeps_promises(outcome) == (mismatches == 0)


def test_the_stamp_detector_returns_the_boxes_of_the_stamped_frame(tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    model = write_stamp_detector(VIEWS, "c0", tmp_path / "reader.onnx")
    detector = OnnxDetector(OnnxSettings(model=model, nms_iou=1.0))
    noise = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    for frame in (0, 517, 999):
        (box,) = detector.detect(stamp_picture(noise, 2, frame)).boxes.tolist()
        assert VIEWS.frame_of("c0", Box(1, *box)) == frame
    assert len(detector.detect(noise)) == 0


def test_missing_pictures_make_a_gap() -> None:
    pictures = [picture for picture in pictures_of(10) if not 30 <= picture.pulse < 70]
    assert check_pictures(pictures, events_of(10), 1, VIEWS).longest_gap(100.0, 104.0) == pytest.approx(2.0)
    assert check_pictures([], events_of(10), 1, VIEWS).longest_gap(100.0, 104.0) == pytest.approx(4.0)


def test_a_shown_gop_that_is_not_recorded_is_lost() -> None:
    outcome = FaultOutcome(FAULTS[0], gops=(0, 3))
    there = recorded_frames(range(25))
    add_recording_results(
        [outcome],
        events_of(3),
        [
            RecordedFile("c0", 0, there, plays=True),
            RecordedFile("c1", 0, recorded_frames(range(30)), plays=False),
        ],
    )
    assert (outcome.lost, outcome.broken_files) == (1, 1)
    assert not keeps_promises(outcome)


def test_a_recording_must_resume_after_the_disk_was_full() -> None:
    full = replace(FAULTS[0], stops_recording=True)
    before, after = recorded_frames(range(50)), recorded_frames(range(100, 200))
    for pulses, lost, goes_on in ((before, 15, False), (before | after, 5, True)):
        outcome = FaultOutcome(full, gops=(0, 20))
        add_recording_results([outcome], events_of(20), [RecordedFile("c0", 0, pulses, plays=True)])
        assert outcome.lost == lost
        assert keeps_promises(outcome) == goes_on


def test_promises_are_kept_or_not() -> None:
    kept_promises = FaultOutcome(
        FAULTS[0], received=[check_pictures(pictures_of(3), events_of(3), 1, VIEWS)], gap_after=0.9
    )
    assert keeps_promises(kept_promises)
    assert not keeps_promises(replace(kept_promises, gap_after=1.1))
    assert not keeps_promises(replace(kept_promises, reconnections=1))
    assert not keeps_promises(replace(kept_promises, failed="there is no process c0"))


async def test_faults_of_a_site_that_does_not_start_are_broken_promises(tmp_path: Path) -> None:
    def not_started(views: StampedViews, folder: Path) -> AbstractAsyncContextManager[FaultSite]:
        raise RuntimeError(f"{folder}, {len(views.cameras)} cameras: did not start")

    faults = [replace(fault, setup=not_started) for fault in FAULTS[:2]]
    outcomes = await _run_group(faults, VIEWS, tmp_path / "site", Report())
    assert [outcome.fault for outcome in outcomes] == faults
    assert not any(keeps_promises(outcome) for outcome in outcomes)


async def test_an_interrupted_stream_fails_its_fault_only() -> None:
    async def broken_off(fault_site: FaultSite) -> None:
        raise asyncio.IncompleteReadError(fault_site.url.encode(), 10)

    outcome = FaultOutcome(replace(FAULTS[0], inject=broken_off))
    await _inject(outcome.fault, FaultSite("here", Path(), 0), outcome)
    assert outcome.failed.startswith("IncompleteReadError: 4 bytes read")
    assert not keeps_promises(outcome)
