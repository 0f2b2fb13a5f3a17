"""Recordings of cameras with different parameter sets play as the live stream did, gaps included."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator
from pathlib import Path

import av
import numpy as np
import pytest

from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.parameter_sets import (
    GOPS,
    LOST_GOPS,
    OWN_PARAMETERS,
    decision,
    expected_pictures,
    put_frames,
)
from fakes.service.scripted_cameras import FPS, GOP
from fakes.service.scripted_recordings import PULSE0
from server.messaging.messages import GopChoices

FRAMES = GOPS * GOP


@pytest.fixture
async def served(tmp_path: Path) -> AsyncIterator[ServedSite]:
    record = {"folder": str(tmp_path / "kept"), "segment_s": 1.0}
    async for served in serve_site(**OWN_PARAMETERS, record=record, http={"hls_segment_s": 0.4}):
        service = served.service
        service.recorder.open()
        put_frames(service.frame_buffers)
        for gop in range(GOPS):
            chosen = decision(gop)
            choices = {choice.number: choice.camera for choice in chosen.choices}
            service.recorder.put(
                GopChoices(first=gop * GOP, frames=GOP, choices=choices, boxes={}, cuts=[]), PULSE0
            )
            service.splicer.publish_decision(chosen)
        while service.recorder.writer is not None and service.recorder.writer.written < GOPS - 2:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        yield served


async def fetch(served: ServedSite, *paths: str) -> bytes:
    data = []
    for path in paths:
        async with served.session.get(path) as answer:
            assert answer.status == 200, await answer.text()
            data.append(await answer.read())
    return b"".join(data)


@pytest.mark.parametrize("form", ["mp4", "ts", "hls"])
async def test_time_shift_plays_what_was_live(served: ServedSite, form: str) -> None:
    segmenter = served.service.splicer.segmenter_of_person(1)
    assert segmenter is not None
    segmenter._segments.clear()
    if form == "hls":
        names = ["init.mp4", *(f"{number}.m4s" for number in range(GOPS // 2))]
        data = await fetch(served, *(f"/objects/1/hls/{name}" for name in names))
    else:
        data = await fetch(served, f"/objects/1/best.{form}?from=p0&to=p{FRAMES}")
    with av.open(io.BytesIO(data), "r") as container:
        frames = list(container.decode(video=0))
    start = float(frames[0].time or 0) if form == "ts" else 0.0
    shown = {
        round((float(frame.time or 0) - start) * FPS): frame.to_ndarray(format="yuv420p") for frame in frames
    }
    assert LOST_GOPS, "there are gaps, which are filled"
    assert form == "hls" or list(shown) == list(range(FRAMES))
    for pulse, right in enumerate(expected_pictures()):
        np.testing.assert_array_equal(
            shown[max(earlier for earlier in shown if earlier <= pulse)], right, str(pulse)
        )
