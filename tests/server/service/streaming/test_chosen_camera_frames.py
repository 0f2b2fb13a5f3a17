"""Every frame of a stream is the chosen camera's, to the pixel, over any cuts; a wrong one is detected."""

from __future__ import annotations

from itertools import pairwise

import pytest

from benchmarks.streaming.frame_correctness import FrameCorrectness, check_frames, schedule
from server.config.sections import EncodeSettings
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.spliced_stream import GopAssembler


async def test_every_frame_is_the_chosen_cameras_to_the_pixel() -> None:
    assert await check_frames(300, 15, seed=1) == FrameCorrectness(
        300, 15, in_file=300, in_ts=300, ambiguous=0
    )


async def test_every_frame_of_vp8_is_the_chosen_cameras_too() -> None:
    vp8 = EncodeSettings(codec="vp8")
    assert await check_frames(300, 15, seed=1, encode=vp8) == FrameCorrectness(
        300, 15, in_file=300, in_ts=None, ambiguous=0
    )


async def test_another_cameras_gop_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    original = GopAssembler.complete_chunk

    def mistaken(self: GopAssembler, camera: str) -> MediaChunk | None:
        wrong = self.first == 40
        return original(self, "c0" if wrong and camera != "c0" else "c3" if wrong else camera)

    monkeypatch.setattr(GopAssembler, "complete_chunk", mistaken)
    assert await check_frames(100, 5, seed=1) == FrameCorrectness(100, 5, in_file=90, in_ts=90, ambiguous=0)
    vp8 = EncodeSettings(codec="vp8")
    assert await check_frames(100, 5, seed=1, encode=vp8) == FrameCorrectness(
        100, 5, in_file=90, in_ts=None, ambiguous=0
    )


@pytest.mark.parametrize("cuts", [0, 7, 98])
def test_a_schedule_has_the_requested_number_of_cuts(cuts: int) -> None:
    chosen = schedule(99, cuts, seed=2)
    assert sum(a != b for a, b in pairwise(chosen)) == cuts


@pytest.mark.slow
async def test_ten_thousand_frames_over_five_hundred_cuts_are_all_correct() -> None:
    assert await check_frames(10_000, 500) == FrameCorrectness(
        10_000, 500, in_file=10_000, in_ts=10_000, ambiguous=0
    )
