"""Computations of the benchmarks, without long measurements."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.common.environment import SKIPPED, CannotRunError
from benchmarks.common.process_load import OTHER, read_processor_usage
from benchmarks.common.recorded_views import find_views
from benchmarks.common.stopwatch import Stopwatch
from benchmarks.latency.bus_subscriber import BusTimestamps
from benchmarks.latency.shown_frames import ShownFrames
from benchmarks.latency.stage_delays import STAGES, split
from benchmarks.render import __main__ as render
from benchmarks.screenshots.__main__ import small_png
from benchmarks.solvers.random_windows import WindowSize
from benchmarks.solvers.tracked_crowd import track_crowd
from server.messaging.messages import CameraTracks, FrameHeader, GopChoices

FPS, GOP, LOOKAHEAD, STRIDE = 25.0, 10, 20, 5
START = 1_000.0


def due(pulse: int) -> float:
    return START + pulse / FPS


def head(pulse: int) -> FrameHeader:
    at = due(pulse)
    return FrameHeader(pulse=pulse, key=False, boot=1, due=at, captured_at=at + 0.01, encoded=at + 0.015)


def window(camera: str, last: int, solved_at: float) -> CameraTracks:
    return CameraTracks(
        camera=camera,
        boot=1,
        size=(640, 360),
        epoch=last // STRIDE,
        first=0,
        last=last,
        final_to=0,
        ended=False,
        shed=[],
        tracks=[],
        solve=None,
        solved_at=solved_at,
    )


def choices(first: int, camera: str) -> GopChoices:
    return GopChoices(first=first, frames=GOP, choices={7: camera}, boxes={}, cuts=[])


def live_marks() -> BusTimestamps:
    """Two GOPs of two cameras: solved 30 ms (c1: 50 ms) after the last frame, decided 10 ms later."""
    marks = BusTimestamps()
    for pulse in range(40):
        for camera in ("c0", "c1"):
            marks.video(camera, head(pulse), due(pulse) + 0.02)
    for last in range(STRIDE - 1, 40, STRIDE):
        marks.tracks(window("c0", last, due(last) + 0.03))
        marks.tracks(window("c1", last, due(last) + 0.05))
    for first, camera in ((0, "c0"), (10, "c1")):
        marks.choices(choices(first, camera), due(first + LOOKAHEAD - 1) + 0.06)
    return marks


def shown(at: dict[int, float]) -> ShownFrames:
    return ShownFrames(object=7, at=at, lookahead=LOOKAHEAD, fps=FPS, cores={})


def test_all_frames_of_a_gop_wait_equally_for_the_look_ahead() -> None:
    delays = split(live_marks(), shown({pulse: due(pulse) + 0.95 for pulse in range(20)}))
    expected = [0.01, 0.005, 0.005, 0.76 - 0.02, 0.05, 0.01, 0.95 - 0.82]
    assert np.array_equal(delays.pulses, np.arange(20))
    assert np.allclose(delays.stages, expected)


def test_the_stages_add_up_to_the_total() -> None:
    at = {pulse: due(pulse) + 1.0 + 0.01 * (pulse % 3) for pulse in range(20)}
    delays = split(live_marks(), shown(at))
    assert delays.stages.shape == (20, len(STAGES))
    assert np.allclose(delays.totals, [at[pulse] - due(pulse) for pulse in range(20)])


def test_frames_that_were_not_shown_are_counted() -> None:
    delays = split(live_marks(), shown({pulse: due(pulse) + 1.0 for pulse in range(20) if pulse % 4}))
    assert delays.shown_share == pytest.approx(15 / 19)
    assert len(delays.pulses) == 15


def test_a_late_camera_counts_as_waiting_for_the_decision() -> None:
    marks = live_marks()
    marks.tracks(window("c1", LOOKAHEAD - 1, due(LOOKAHEAD - 1) + 0.4))
    delays = split(marks, shown({pulse: due(pulse) + 1.0 for pulse in range(20)}))
    assert delays.late == 1
    assert np.allclose(delays.stages[:GOP, 4:6], [0.03, 0.03])
    assert np.allclose(delays.stages[GOP:, 4:6], [0.05, 0.01])


def test_a_decision_without_any_camera_in_time_is_only_waiting() -> None:
    marks = live_marks()
    for camera in ("c0", "c1"):
        marks.tracks(window(camera, LOOKAHEAD - 1, due(LOOKAHEAD - 1) + 0.4))
    delays = split(marks, shown({pulse: due(pulse) + 1.0 for pulse in range(10)}))
    assert delays.late == 1
    assert np.allclose(delays.stages[:, 4:6], [0.0, 0.06])


def test_frames_with_missing_timestamps_are_counted() -> None:
    marks = live_marks()
    del marks.frames["c0", 3]
    delays = split(marks, shown({pulse: due(pulse) + 1.0 for pulse in range(20)}))
    assert (delays.unknown, len(delays.pulses)) == (1, 19)


def test_a_page_that_showed_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="no shown frame has all timestamps"):
        split(live_marks(), shown({}))


def spin(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


class ManualClock:
    """A processor clock that a test advances."""

    seconds = 0.0

    def process_time(self) -> float:
        return self.seconds


CLOCK = ManualClock()


class Work:
    def outer(self) -> str:
        CLOCK.seconds += 2.0
        self.inner()
        return "done"

    def inner(self) -> None:
        CLOCK.seconds += 6.0


def test_the_time_of_a_nested_stage_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.common.stopwatch.time", CLOCK)
    watch = Stopwatch()
    with watch.watching((Work, "outer", "outside"), (Work, "inner", "inside")):
        assert Work().outer() == "done"
    assert watch.seconds == {"outside": 2.0, "inside": 6.0}


def test_timed_functions_are_restored() -> None:
    before = Work.inner
    watch = Stopwatch()
    with pytest.raises(ZeroDivisionError), watch.watching((Work, "inner", "inside")):
        _ = 1 / 0
    assert Work.inner is before


def test_a_picture_with_many_colors_is_compressed_with_little_error() -> None:
    across, down = np.meshgrid(np.arange(640), np.arange(400))
    noise = np.random.default_rng(1).integers(0, 12, (400, 640, 3))
    pixels = (np.stack([across / 3, down / 2, (across + down) / 5], axis=2) + noise).astype(np.uint8)
    png = io.BytesIO()
    Image.fromarray(pixels).save(png, "PNG")
    small = small_png(png.getvalue())
    assert len(small) < 300_000 < len(png.getvalue())
    error = np.abs(np.asarray(Image.open(io.BytesIO(small)).convert("RGB")).astype(int) - pixels)
    assert error.mean() < 12


def test_missing_recordings_are_named(tmp_path: Path) -> None:
    with pytest.raises(CannotRunError, match="campus4"):
        find_views(tmp_path, "campus4")


@pytest.mark.skipif(not Path("/proc/stat").exists(), reason="needs Linux")
def test_processor_usage_is_split_by_process() -> None:
    before = read_processor_usage()
    spin(0.2)
    cores = read_processor_usage().cores_since(before)
    assert cores["measuring"] > 0.01
    assert OTHER in cores


def test_a_benchmark_without_its_recordings_is_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["render", "--data", str(tmp_path), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        render.main()
    assert ended.value.code == SKIPPED
    assert "render: skipped: needs the recordings" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()


def test_everybody_of_a_small_crowd_is_tracked_within_the_budget() -> None:
    found = track_crowd(WindowSize(4, 6), 1.0, 0)
    assert len(found.windows) == 5
    assert found.objects.max() == 4
    assert found.gaps.max() < 1e-9
    assert not found.stopped.any()
