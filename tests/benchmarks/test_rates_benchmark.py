"""The benchmark of frame rates: the truth of the frames that remain, and a whole run on a small recording."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks.rates import __main__ as rates
from benchmarks.rates.__main__ import RATES, rows_at_rate
from fakes.media.videos import STEP, write_video
from server.camera.sources import Recording
from tracking.motchallenge import MotRow, format_rows

FRAMES, FPS = 25, 25.0
TRUTH = [MotRow(frame + 1, 100 + frame, 10.0, 5.0, 8.0, 30.0) for frame in range(FRAMES)]


@pytest.mark.parametrize("fps", [rate for rate in RATES if rate <= FPS])
def test_the_truth_at_a_lower_rate_is_that_of_the_shown_frames(tmp_path: Path, fps: float) -> None:
    recording = Recording(str(write_video(tmp_path / "c0.mp4", FRAMES)), fps=fps)
    rows = rows_at_rate(TRUTH, FPS, fps)
    assert [row.frame for row in rows] == list(range(1, len(rows) + 1))
    for row in rows[:-1]:  # the last frame may be followed by others
        image = recording.take(row.frame - 1)
        assert image is not None
        assert round(float(image.mean()) / STEP) == row.id - 100
    recording.close()


def test_a_recording_is_run_at_the_rates_that_it_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "pets09"
    (folder / "gt").mkdir(parents=True)
    write_video(folder / "c0.mp4", FRAMES)
    (folder / "gt" / "c0.txt").write_text(format_rows(TRUTH), encoding="ascii")
    command = ["rates", "--data", str(tmp_path), "--out", str(tmp_path / "out"), "--scene", "pets09"]
    monkeypatch.setattr(sys, "argv", [*command, "--rate", "50", "--rate", "5"])
    rates.main()
    text = (tmp_path / "out" / "rates.txt").read_text(encoding="utf-8")
    assert [rate for rate in ("50.0", "25.0", "5.0") if f"│ {rate:>15}" in text] == ["25.0", "5.0"]
    assert (tmp_path / "out" / "rates.png").exists()
