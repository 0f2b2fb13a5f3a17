"""The live camera benchmark: the counters of a site, and the timing of a camera's stages."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.common.recorded_views import ROOM, RecordedViews
from benchmarks.live_cameras.frame_counters import counts_in
from benchmarks.live_cameras.looped_views import CROWD, FPS, LoopedViews, usual_views
from benchmarks.live_cameras.stage_times import (
    REST,
    STAGES,
    CameraStageTimes,
    ThreadStopwatch,
    hooked_environment,
    read_stages,
)

METRICS = """\
# TYPE myview_camera_frames_total counter
myview_camera_frames_total{{camera="c1"}} {frames}
# TYPE myview_camera_missed_total counter
myview_camera_missed_total{{camera="c1"}} {missed}
# TYPE myview_camera_shed_total counter
myview_camera_shed_total{{camera="c1"}} {shed}
# TYPE myview_camera_live gauge
myview_camera_live{{camera="c1"}} 1.0
"""


def test_counts_are_differences_between_two_moments() -> None:
    before = counts_in(METRICS.format(frames=100, missed=2, shed=0), late=1)
    after = counts_in(METRICS.format(frames=350, missed=3, shed=4), late=3)
    since = after.since(before)
    assert since.cameras["c1"]["frames"] == 250
    assert since.dropped == 5
    assert since.late == 2


class Outer:
    def work(self, inner: Inner) -> None:
        CLOCK.seconds += 2.0
        inner.work()


class Inner:
    def work(self) -> None:
        CLOCK.seconds += 4.0


class HandClock:
    """A clock of the processor's time that a test moves on."""

    seconds = 0.0

    def thread_time(self) -> float:
        return self.seconds


CLOCK = HandClock()


def test_a_stage_inside_a_stage_counts_only_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.live_cameras.stage_times.time", CLOCK)
    watch = ThreadStopwatch()
    calls: list[int] = []
    outer, inner = type("O", (Outer,), {}), type("I", (Inner,), {})
    watch.wrap(outer, "work", "track", lambda: calls.append(1))
    watch.wrap(inner, "work", "solve")
    outer().work(inner())
    assert watch.seconds["solve"] == 4.0
    assert watch.seconds["track"] == 2.0
    assert calls == [1]


def test_what_no_stage_explains_is_the_rest(tmp_path: Path) -> None:
    seconds = dict.fromkeys(STAGES, 0.0)
    (tmp_path / "c0.json").write_text(json.dumps({"frames": 10, "seconds": seconds, "process": 1.0}))
    start = read_stages(tmp_path)["c0"]
    later = CameraStageTimes(20, {**seconds, "detect": 0.05}, 1.08)
    used = later.milliseconds_since(start)
    assert used["detect"] == pytest.approx(5.0)
    assert used[REST] == pytest.approx(3.0)


def test_only_camera_processes_are_hooked(tmp_path: Path) -> None:
    path = hooked_environment(tmp_path)["PYTHONPATH"]
    hook = Path(path.split(":")[0]) / "sitecustomize.py"
    assert '"camera" in sys.orig_argv' in hook.read_text(encoding="utf-8")


def test_four_cameras_of_two_scenes_never_end(tmp_path: Path) -> None:
    views = tuple(
        RecordedViews(name, tuple(tmp_path / name / f"c{n}.mp4" for n in range(count)), None)
        for name, count in (("terrace", 2), ("campus4", 3))
    )
    live = LoopedViews(CROWD, views)
    assert [camera["id"] for camera in live.cameras] == ["c0", "c1", "c2", "c3"]
    assert all(camera["at_end"] == "loop" for camera in live.cameras)
    assert live.ground is None
    assert live.site["fps"] == FPS
    assert (live.site["width"], live.site["height"]) == (352, 288)


def test_the_scene_takes_the_place_of_recordings_that_are_not_there(tmp_path: Path) -> None:
    assert usual_views(tmp_path) == ROOM
