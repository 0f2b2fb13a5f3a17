"""Time shift for a token limited to one person: gray and silent without the person."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

from fakes.media.audio import FRAMES as SOUNDING
from fakes.media.audio import beeps, sends, write_flashes
from fakes.service.departure import (
    EPOCHS,
    PATIENT,
    Picture,
    begun,
    chosen,
    decoded,
    equal,
    expected,
    fetched,
    go_on,
    is_gray,
    left,
    to_the_end,
)
from fakes.service.fed_site import Hall
from fakes.service.scripted_cameras import FPS, GOP
from server.messaging.messages import GopChoices

Kept = tuple[Hall, list[GopChoices]]
HLS = {**PATIENT, "hls_segment_s": 0.4, "hls_window_s": 0.8}


async def written(hall: Hall, gops: int) -> None:
    """Let the disk alone know what was, but for the newest GOP."""
    recorder = hall.service.recorder
    while recorder.writer is not None and recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    recorder.recent._frames = GOP
    while len(recorder.recent._choices) > 1:
        recorder.recent._choices.popleft()


@pytest.fixture(params=["memory", "disk"])
async def kept(tmp_path: Path, request: pytest.FixtureRequest) -> AsyncIterator[Kept]:
    """A site that keeps what was, in memory or on the disk, and what it decided."""
    on_disk = request.param == "disk"
    record = {"folder": str(tmp_path / "kept") if on_disk else None, "segment_s": 1.0}
    async with left(tmp_path, record=record, http=HLS) as hall:
        hall.service.recorder.open()
        decisions = go_on(hall, range(EPOCHS))
        if on_disk:
            await written(hall, len(decisions) - 2)
        yield hall, decisions


@pytest.mark.parametrize("form", ["mp4", "ts"])
async def test_a_time_shifted_stream_is_gray_without_the_person(kept: Kept, form: str) -> None:
    hall, decisions = kept
    path = f"/objects/1/best.{form}?from=p0&to=p{len(decisions) * GOP}"
    narrow, full = [decoded(await fetched(hall, path, who)) for who in ("family", "desk")]
    if form == "ts":
        narrow, full = ({pulse - min(it): shown for pulse, shown in it.items()} for it in (narrow, full))
    equal(narrow, expected(decisions, holds=False))
    equal(full, chosen(decisions))
    assert sum(map(is_gray, narrow.values())) > 8 * GOP


async def test_a_time_shifted_stream_continues_live(tmp_path: Path) -> None:
    async with left(tmp_path) as hall:
        decisions = go_on(hall, range(12))
        theirs = await begun(hall, "/objects/1/best.mp4?from=p25", "family")
        while not hall.service.splicer.scoped_persons[1].viewers:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        decisions += go_on(hall, range(12, EPOCHS))
        shown = decoded((await to_the_end(hall, theirs))[0])
    right = expected(decisions, holds=False)
    assert min(shown) == 25
    assert [is_gray(shown[it]) for it in (29, 30, 79, 80)] == [False, True, True, False]
    equal(shown, right)


async def test_recorded_segments_are_gray_without_the_person(
    kept: Kept,
) -> None:
    hall, decisions = kept
    shown: dict[str, dict[int, Picture]] = {}
    for who in ("family", "desk"):
        listed = (await fetched(hall, "/objects/1/hls/index.m3u8?from=p0&to=p90", who)).decode()
        names = ["init.mp4", *re.findall(r"^[0-9]+\.m4s$", listed, re.MULTILINE)]
        for scoped in (True, False):
            reel = hall.service.splicer.segmenter_of_person(1, scoped=scoped)
            assert reel is not None
            reel._segments.clear()
        shown[who] = decoded(b"".join([await fetched(hall, f"/objects/1/hls/{it}", who) for it in names]))
    assert max(shown["desk"]) == 89
    right = {"family": expected(decisions, holds=False), "desk": chosen(decisions)}
    for who, pictures in shown.items():
        for pulse, picture in pictures.items():
            np.testing.assert_array_equal(picture, right[who][pulse], f"{who} {pulse}")
    assert sum(map(is_gray, shown["family"].values())) > 8 * GOP


@pytest.mark.parametrize("hls", [False, True])
async def test_recorded_sound_is_silent_without_the_person(tmp_path: Path, *, hls: bool) -> None:
    recording = write_flashes(tmp_path / "flashes.mp4", SOUNDING)
    record = {"folder": str(tmp_path / "kept"), "segment_s": 1.0}
    async with left(tmp_path, sound={"source": str(recording)}, record=record, http=HLS) as hall:
        hall.service.recorder.open()
        sends(hall.service, recording)
        decisions = go_on(hall, range(EPOCHS))
        await written(hall, len(decisions) - 2)
        heard: dict[str, list[int]] = {}
        for who in ("family", "desk"):
            names = [f"best.mp4?from=p0&to=p{len(decisions) * GOP}"]
            if hls:
                names = [f"hls/{it}" for it in ("init.mp4", *(f"{number}.m4s" for number in range(11)))]
                for scoped in (True, False):
                    reel = hall.service.splicer.segmenter_of_person(1, scoped=scoped)
                    assert reel is not None
                    reel._segments.clear()
            data = b"".join([await fetched(hall, f"/objects/1/{it}", who) for it in names])
            heard[who] = [round(it * FPS) for it in beeps(data)]
    assert heard == {"family": [20, 80, 100], "desk": [20, 40, 60, 80, 100]}
