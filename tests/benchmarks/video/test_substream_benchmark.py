"""The benchmark of substreams on a real camera pipeline: the large stream is not decoded."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.substream import run, site_of, write_film

MAIN, SMALL = (640, 360), (160, 90)
FRAMES = 60


@pytest.mark.slow
def test_a_stream_that_passes_through_costs_little_with_a_substream(tmp_path: Path) -> None:
    write_film(tmp_path / "main.h264", MAIN, FRAMES)
    write_film(tmp_path / "small.h264", SMALL, FRAMES)
    alone, both = (
        run(site_of(MAIN, tmp_path, passes=True, has_substream=has_substream), 10)
        for has_substream in (False, True)
    )
    assert both.video_ms < alone.video_ms / 2
    assert both.people_ms > 0
