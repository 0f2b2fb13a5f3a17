"""The load shedder raises its level at once, lowers it slowly, and does not oscillate."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.service.scripted_cameras import small_config
from server.camera.load.load_monitor import LoadMonitor
from server.camera.load.load_shedder import LevelBounds, LoadShedder, ShedLevel, shed_levels

FPS, STRIDE, GOP = 25.0, 5, 10
BOUNDS = LevelBounds(0.5, 0.2)
BACKLOG_S = 2.0


def simulate_levels(seconds: float, speed: Callable[[float], float], *, live: bool = True) -> list[int]:
    """Return the level at each frame of a camera that needs a whole machine; `speed` is its share by time.

    Detection takes three quarters of a frame's time, everything else a quarter.
    """
    shedder = LoadShedder(shed_levels(STRIDE, live=live), BOUNDS)
    idle_at, levels = 0.0, []
    for pulse in range(round(seconds * FPS)):
        due, level = pulse / FPS, shedder.current
        work = 0.75 * level.detects(pulse, STRIDE) + 0.25 * level.captures(pulse, STRIDE, GOP)
        start = max(due, idle_at)
        idle_at = min(start + work / FPS / speed(start), due + BACKLOG_S)
        shedder.measure_lag(idle_at - due, idle_at)
        levels.append(shedder.level)
    return levels


def count_changes(levels: list[int]) -> int:
    return sum(before != after for before, after in pairwise(levels))


def test_a_camera_that_keeps_up_sheds_nothing() -> None:
    assert set(simulate_levels(120.0, lambda _: 1.05)) == {0}


@pytest.mark.parametrize("share", [0.9, 0.7, 0.6, 0.5, 0.4])
def test_the_level_settles_where_the_camera_keeps_up(share: float) -> None:
    levels = simulate_levels(600.0, lambda _: share)
    level = shed_levels(STRIDE, live=True)[max(levels)]
    work = sum(
        0.75 * level.detects(number, STRIDE) + 0.25 * level.captures(number, STRIDE, GOP)
        for number in range(STRIDE * GOP)
    )
    assert work / (STRIDE * GOP) < share  # high enough to keep up
    assert levels.index(max(levels)) < 10 * FPS
    assert count_changes(levels[-round(240 * FPS) :]) <= 18  # a lower level is tried rarely


def test_the_level_returns_to_zero_after_an_overload() -> None:
    levels = simulate_levels(240.0, lambda now: 0.4 if 20.0 <= now < 60.0 else 1.2)
    assert max(levels[: round(20 * FPS)]) == 0
    assert levels[round(30 * FPS)] >= 2
    assert set(levels[round(180 * FPS) :]) == {0}


def test_after_a_short_stall_the_level_returns_to_zero() -> None:
    levels = simulate_levels(60.0, lambda now: 0.05 if 20.0 <= now < 20.3 else 2.0)
    assert max(levels) <= 1
    assert levels[-1] == 0


@given(
    stride=st.integers(1, 20),
    gop=st.integers(1, 40),
    live=st.booleans(),
    has_network=st.booleans(),
    pulse=st.integers(0, 10**9),
)
def test_no_level_skips_the_end_of_a_window_or_the_beginning_of_a_gop(
    stride: int, gop: int, *, live: bool, has_network: bool, pulse: int
) -> None:
    for level in shed_levels(stride, live=live, has_network=has_network):
        end = (pulse + 1) * stride - 1
        assert level.detects(end, stride)
        assert level.captures(end, stride, gop)
        assert level.captures(pulse * gop, stride, gop)


@given(stride=st.integers(1, 20), live=st.booleans(), has_network=st.booleans())
def test_every_level_sheds_more_and_a_recording_is_always_complete(
    stride: int, *, live: bool, has_network: bool
) -> None:
    levels = shed_levels(stride, live=live, has_network=has_network)
    assert levels[0] == ShedLevel()
    factors = [level.network_factor for level in levels]
    assert factors == sorted(factors)
    frames = range(stride * 60)
    detected = [sum(level.detects(pulse, stride) for pulse in frames) for level in levels]
    captured = [sum(level.captures(pulse, stride, 60) for pulse in frames) for level in levels]
    assert all(lower >= higher for lower, higher in pairwise(detected))
    # Of short windows all frames are captured: every one or every second is the last of a window.
    assert stride < 3 or not live or captured[-1] < captured[-2] < captured[0]
    if not live:
        assert set(captured) == {len(frames)}


@pytest.mark.parametrize("fps", [0.5, 1.0, 2.0, FPS])
def test_a_frame_may_take_its_whole_interval_at_any_rate(fps: float) -> None:
    load = LoadMonitor(small_config(site={"fps": fps}, view={"lookahead_s": 6.0}), "c0", live=True)
    for pulse in range(200):
        load.measure_lag(0.95 / fps, pulse / fps)
        assert load.level == 0


def test_levels_have_a_description() -> None:
    assert [level.description for level in shed_levels(5, live=True)] == [
        "",
        "detecting in every 2nd frame: the machine is too busy",
        "detecting in every 3rd frame: the machine is too busy",
        "detecting in every 5th frame: the machine is too busy",
        "showing every 2nd and detecting in every 5th frame: the machine is too busy",
        "showing every 4th and detecting in every 5th frame: the machine is too busy",
    ]
    assert [level.description for level in shed_levels(1, live=False, has_network=True)] == [
        "",
        "running the network 2 times less often: the machine is too busy",
        "running the network 4 times less often: the machine is too busy",
    ]


def test_a_network_runs_less_often_before_frames_are_skipped() -> None:
    levels = shed_levels(STRIDE, live=True, has_network=True)
    assert [(level.network_factor, level.detection_interval) for level in levels[:4]] == [
        (1, 1),
        (2, 1),
        (4, 1),
        (4, 2),
    ]
