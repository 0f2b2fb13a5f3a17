"""Recordings age by time that has certainly passed: a clock that jumps deletes nothing."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

import pytest

from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, FedService, small_config
from fakes.service.scripted_recordings import A, ManualClocks, filled_buffers, gop_record, session_info
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments

KEEP_S = 20.0
BOUNDS = RetentionLimits(keep_s=KEEP_S, max_mb=1e6, segment_s=0.2)
"""A segment for each GOP."""
STEP_S = GOP / FPS
TRIAL_S = 600.0
YEAR_S = 365 * 86_400.0
PARTLY = '{"id": "x", "seconds": -5}'
ENDLESS = '{"id": "x", "seconds": 1e300, "boot": "", "steady": 0, "origin": null}'


@pytest.fixture
def clocks() -> ManualClocks:
    return ManualClocks()


def opened(folder: Path, clocks: ManualClocks, bounds: RetentionLimits = BOUNDS) -> RecordingFolder:
    store = RecordingFolder(folder, bounds, clocks.machine)
    store.open()
    return store


def records(store: RecordingFolder, clocks: ManualClocks, gops: range) -> None:
    """Write GOPs in real time."""
    for gop in gops:
        store.write(gop_record(gop, {1: A}), session_info(clocks.wall), InitSegments(filled_buffers()[1]))
        clocks.now += STEP_S


def segments_on_disk(folder: Path) -> list[int]:
    """Return the GOPs whose pictures are on the disk."""
    return sorted(int(path.stem) // GOP for path in folder.glob("*/cameras/c0/*.mp4"))


def recorded(folder: Path, clocks: ManualClocks, gops: int = 10) -> None:
    """Record some GOPs and close the folder."""
    store = opened(folder, clocks)
    records(store, clocks, range(gops))
    store.close()


@pytest.mark.parametrize("seconds", [YEAR_S, -YEAR_S, 2 * KEEP_S, -2 * KEEP_S])
@pytest.mark.parametrize("is_kept", [False, True])
def test_setting_the_clock_during_recording_neither_deletes_nor_delays_deletion(
    tmp_path: Path, clocks: ManualClocks, seconds: float, is_kept: bool
) -> None:
    store = opened(tmp_path, clocks)
    records(store, clocks, range(10))
    clocks.jump(seconds)
    clocks.is_synchronized = is_kept
    records(store, clocks, range(10, 20))
    assert segments_on_disk(tmp_path) == list(range(20))
    clocks.now += KEEP_S - 10.5 * STEP_S
    records(store, clocks, range(20, 21))
    assert segments_on_disk(tmp_path) == list(range(10, 21)), "ten have expired, despite the clock"
    store.close()


def test_a_clock_that_jumped_during_recording_is_not_trusted_later_either(
    tmp_path: Path, clocks: ManualClocks
) -> None:
    bounds = RetentionLimits(keep_s=3.5 * TRIAL_S, max_mb=1e6, segment_s=0.2)
    store = opened(tmp_path, clocks, bounds)
    records(store, clocks, range(2))
    clocks.wall += YEAR_S  # and it still counts as synchronized
    records(store, clocks, range(2, 4))
    clocks.now += TRIAL_S
    store.close()
    store = opened(tmp_path, clocks, bounds)
    records(store, clocks, range(4, 6))
    store.close()
    clocks.power_off(TRIAL_S)
    store = opened(tmp_path, clocks, bounds)
    clocks.now += TRIAL_S
    records(store, clocks, range(6, 7))
    assert segments_on_disk(tmp_path) == list(range(7))
    clocks.now += 0.75 * TRIAL_S
    records(store, clocks, range(7, 8))
    assert segments_on_disk(tmp_path) == [4, 5, 6, 7], "time off counts, a clock jump does not"
    store.close()


@pytest.mark.parametrize("seconds", [YEAR_S, 5 * KEEP_S])
@pytest.mark.parametrize("reboots", [False, True])
def test_a_clock_that_is_ahead_at_the_start_deletes_nothing(
    tmp_path: Path, clocks: ManualClocks, caplog: pytest.LogCaptureFixture, seconds: float, reboots: bool
) -> None:
    recorded(tmp_path, clocks)
    if reboots:
        clocks.power_off(1.0)
    clocks.jump(seconds)
    store = opened(tmp_path, clocks)
    assert segments_on_disk(tmp_path) == list(range(10))
    (logged,) = [message for message in caplog.messages if "does not count" in message]
    assert "the clock is not synchronized (NTP)" in logged
    for gop in range(10, 18):
        records(store, clocks, range(gop, gop + 1))
        clocks.now += TRIAL_S / 1000
    assert segments_on_disk(tmp_path) == list(range(18)), "while it is not synchronized"
    clocks.now += KEEP_S
    records(store, clocks, range(20, 21))
    assert not set(range(8)) & set(segments_on_disk(tmp_path)), "but not kept forever"
    store.close()


def test_a_clock_that_is_corrected_in_time_deletes_nothing(tmp_path: Path, clocks: ManualClocks) -> None:
    recorded(tmp_path, clocks)
    clocks.power_off(5.0, wrong_by=YEAR_S)
    bounds = RetentionLimits(keep_s=2 * TRIAL_S, max_mb=1e6, segment_s=0.2)
    store = opened(tmp_path, clocks, bounds)
    clocks.now += TRIAL_S / 2
    records(store, clocks, range(10, 11))
    clocks.jump(-YEAR_S)
    clocks.is_synchronized = True
    clocks.now += TRIAL_S
    records(store, clocks, range(11, 12))
    clocks.now += TRIAL_S / 4
    records(store, clocks, range(12, 13))
    assert segments_on_disk(tmp_path) == list(range(13))
    store.close()


@pytest.mark.parametrize("trusted", [False, True])
def test_after_a_week_off_old_recordings_are_deleted_soon_if_the_clock_is_synchronized(
    tmp_path: Path, clocks: ManualClocks, caplog: pytest.LogCaptureFixture, trusted: bool
) -> None:
    caplog.set_level(logging.INFO)
    bounds = RetentionLimits(keep_s=86_400.0, max_mb=1e6, segment_s=0.2, trust_clock=trusted)
    clocks.is_synchronized = not trusted
    store = opened(tmp_path, clocks, bounds)
    records(store, clocks, range(30))
    store.close()
    clocks.power_off(7 * 86_400.0)
    store = opened(tmp_path, clocks, bounds)
    assert segments_on_disk(tmp_path) == list(range(30)), "a wrong clock can still be corrected"
    assert [
        message
        for message in caplog.messages
        if "was off for 7.0 days" in message and "UTC on that counts" in message
    ]
    clocks.now += TRIAL_S
    deleted = []
    for gop in range(30, 34):
        records(store, clocks, range(gop, gop + 1))
        deleted.append(30 - len([first for first in segments_on_disk(tmp_path) if first < 30]))
    assert deleted == [10, 20, 30, 30], "in parts"
    logged = [message for message in caplog.messages if "deleted the oldest" in message]
    assert (
        "10 older than record.keep_s (86400 s); 20 more are too old and are deleted in the next passes"
        in logged[0]
    )
    store.close()


def test_days_off_add_up(tmp_path: Path, clocks: ManualClocks) -> None:
    bounds = RetentionLimits(keep_s=2.5 * 86_400.0, max_mb=1e6, segment_s=0.2)
    for day in range(4):
        store = opened(tmp_path, clocks, bounds)
        clocks.now += TRIAL_S
        records(store, clocks, range(day, day + 1))
        store.close()
        clocks.power_off(86_400.0)
    store = opened(tmp_path, clocks, bounds)
    clocks.now += TRIAL_S
    records(store, clocks, range(4, 5))
    assert segments_on_disk(tmp_path) == [2, 3, 4]
    store.close()


def test_a_restarted_service_continues_the_age_clock_while_the_machine_runs(
    tmp_path: Path, clocks: ManualClocks
) -> None:
    recorded(tmp_path, clocks)
    clocks.is_synchronized = False
    clocks.now += KEEP_S - 4.5 * STEP_S
    clocks.jump(-YEAR_S)
    opened(tmp_path, clocks).close()
    assert segments_on_disk(tmp_path) == list(range(5, 10))


def test_a_killed_service_continues_the_age_clock_from_its_last_segment(
    tmp_path: Path, clocks: ManualClocks
) -> None:
    store = opened(tmp_path, clocks)
    records(store, clocks, range(10))
    (tmp_path / ".lock").unlink()  # as when its process is killed
    clocks.now += KEEP_S - 4.5 * STEP_S
    opened(tmp_path, clocks).close()
    assert segments_on_disk(tmp_path) == list(range(5, 10))
    assert store.session is not None


def test_a_machine_without_a_battery_clock_counts_time_off_once_synchronized(
    tmp_path: Path, clocks: ManualClocks
) -> None:
    recorded(tmp_path, clocks)
    clocks.power_off(7 * 86_400.0, wrong_by=-7 * 86_400.0)
    clocks.is_synchronized = False
    store = opened(tmp_path, clocks)
    clocks.now += 15.0
    records(store, clocks, range(10, 11))
    assert segments_on_disk(tmp_path) == list(range(11))
    clocks.jump(7 * 86_400.0)
    clocks.is_synchronized = True
    bounds = RetentionLimits(keep_s=2 * TRIAL_S, max_mb=1e6, segment_s=0.2)
    store.close()
    store = opened(tmp_path, clocks, bounds)
    clocks.now += TRIAL_S
    records(store, clocks, range(11, 12))
    assert segments_on_disk(tmp_path) == [10, 11], "a week has passed by the synchronized clock"
    records(store, clocks, range(12, 14))
    assert segments_on_disk(tmp_path) == [10, 11, 12, 13], "except what was recorded since boot"
    store.close()


@pytest.mark.parametrize("restarts", [False, True])
def test_recordings_made_before_the_clock_was_trusted_do_not_age_by_time_off(
    tmp_path: Path, clocks: ManualClocks, restarts: bool
) -> None:
    bounds = RetentionLimits(keep_s=2 * TRIAL_S, max_mb=1e6, segment_s=0.2)
    store = opened(tmp_path, clocks, bounds)
    records(store, clocks, range(8))
    store.close()
    clocks.power_off(YEAR_S)
    store = opened(tmp_path, clocks, bounds)
    records(store, clocks, range(10, 12))
    if restarts:
        store.close()
        store = opened(tmp_path, clocks, bounds)
    clocks.now += TRIAL_S
    records(store, clocks, range(12, 14))
    assert segments_on_disk(tmp_path) == [10, 11, 12, 13]
    store.close()
    opened(tmp_path, clocks, bounds).close()
    assert segments_on_disk(tmp_path) == [10, 11, 12, 13], "the age is known later"


def test_excess_recordings_are_deleted_by_age_though_the_clock_went_back(
    tmp_path: Path, clocks: ManualClocks
) -> None:
    clocks.wall += YEAR_S
    recorded(tmp_path, clocks)
    (late,) = [path.name for path in tmp_path.iterdir() if path.is_dir()]
    clocks.jump(-YEAR_S)
    store = opened(tmp_path, clocks)
    records(store, clocks, range(10, 20))
    store.close()
    early = next(path.name for path in tmp_path.iterdir() if path.is_dir() and path.name != late)
    assert early < late, "names follow the clock"
    size = sum(session.size for session in (*store.earlier, store.session) if session is not None)
    restarted = opened(tmp_path, clocks, RetentionLimits(KEEP_S, size / 1e6, 0.2))
    deleted = sorted(set(range(20)) - set(segments_on_disk(tmp_path)))
    assert deleted
    assert deleted == list(range(len(deleted)))
    restarted.close()


def test_recordings_of_an_earlier_version_are_dated_once(tmp_path: Path, clocks: ManualClocks) -> None:
    recorded(tmp_path, clocks)
    (tmp_path / "clock.json").unlink()
    (path,) = tmp_path.glob("*/session.json")
    info = json.loads(path.read_bytes())
    del info["age_clock_at_pulse0"], info["age_clock"]
    path.write_text(json.dumps(info))
    for index in path.parent.glob("index/*"):
        os.utime(index, (clocks.wall, clocks.wall))
    clocks.now += KEEP_S / 2
    opened(tmp_path, clocks).close()
    assert "age_clock_at_pulse0" in json.loads(path.read_bytes())
    clocks.now += KEEP_S / 2 - 4.5 * STEP_S
    opened(tmp_path, clocks).close()
    assert segments_on_disk(tmp_path) == list(range(5, 10)), "by time of writing"


@pytest.mark.parametrize("text", ["", "{", "[]", PARTLY, ENDLESS])
def test_a_damaged_clock_file_deletes_nothing(tmp_path: Path, clocks: ManualClocks, text: str) -> None:
    recorded(tmp_path, clocks)
    (tmp_path / "clock.json").write_text(text)
    store = opened(tmp_path, clocks)
    assert segments_on_disk(tmp_path) == list(range(10))
    clocks.now += KEEP_S - 4.5 * STEP_S
    records(store, clocks, range(10, 11))
    assert segments_on_disk(tmp_path) == list(range(5, 11)), "its end is new and ages"
    store.close()


@pytest.mark.parametrize("clock0", [1e9, -1e9])
def test_a_session_of_another_age_clock_deletes_no_other_and_is_deleted_in_time(
    tmp_path: Path, clocks: ManualClocks, clock0: float
) -> None:
    recorded(tmp_path, clocks, 5)
    (path,) = tmp_path.glob("*/session.json")
    path.write_text(
        json.dumps({**json.loads(path.read_bytes()), "age_clock": "another", "age_clock_at_pulse0": clock0})
    )
    clocks.now += 1.0
    store = opened(tmp_path, clocks)
    records(store, clocks, range(10, 15))
    store.close()
    assert segments_on_disk(tmp_path) == [*range(5), *range(10, 15)]
    clocks.now += KEEP_S + 1.0
    opened(tmp_path, clocks).close()
    assert segments_on_disk(tmp_path) == []


def test_deletions_are_logged_rarely_and_with_their_reason(
    tmp_path: Path, clocks: ManualClocks, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    store = opened(tmp_path, clocks, RetentionLimits(1.0, 1e6, 0.2))
    records(store, clocks, range(20))
    clocks.now += 3600
    records(store, clocks, range(20, 21))
    (first, second) = [message for message in caplog.messages if "deleted the oldest" in message]
    assert first.endswith("/0: 1 older than record.keep_s (1 s)")
    assert second.endswith("/95: 19 older than record.keep_s (1 s)")
    store.close()


def test_a_service_uses_the_machines_clocks(tmp_path: Path) -> None:
    service = FedService(small_config(record={"folder": str(tmp_path / "kept"), "trust_clock": True}))
    service.connect_cameras(*CAMERAS)
    service.recorder.open()
    service.close()
    clock_state = json.loads((tmp_path / "kept" / "clock.json").read_bytes())
    assert clock_state["seconds"] >= 0
    assert clock_state["origin"] is not None
    assert clock_state["steady"] > 0
