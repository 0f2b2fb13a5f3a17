"""Time shift for a token limited to one person: gray and silent without the person."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

from fakes.media.audio import FRAMES as SOUNDING
from fakes.media.audio import beeps, send_audio, write_flashes
from fakes.service.departure import (
    EPOCHS,
    PATIENT_HTTP,
    Picture,
    assert_equal_pictures,
    chosen_pictures,
    decoded,
    departure_site,
    expected_pictures,
    feed_epochs,
    fetch,
    finish_streams,
    is_gray,
    open_stream,
)
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import FPS, GOP
from server.messaging.messages import GopChoices

Kept = tuple[ServedSite, list[GopChoices]]
HLS = {**PATIENT_HTTP, "hls_segment_s": 0.4, "hls_window_s": 0.8}


async def wait_until_on_disk(served: ServedSite, gops: int) -> None:
    """Drop all but the newest GOP from memory."""
    recorder = served.service.recorder
    while recorder.writer is not None and recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    recorder.recent._frames = GOP
    while len(recorder.recent._choices) > 1:
        recorder.recent._choices.popleft()


@pytest.fixture(params=["memory", "disk"])
async def recorded_site(tmp_path: Path, request: pytest.FixtureRequest) -> AsyncIterator[Kept]:
    """A site that records in memory or on the disk, and its decisions."""
    on_disk = request.param == "disk"
    record = {"folder": str(tmp_path / "kept") if on_disk else None, "segment_s": 1.0}
    async with departure_site(tmp_path, record=record, http=HLS) as served:
        served.service.recorder.open()
        decisions = feed_epochs(served, range(EPOCHS))
        if on_disk:
            await wait_until_on_disk(served, len(decisions) - 2)
        yield served, decisions


@pytest.mark.parametrize("form", ["mp4", "ts"])
async def test_a_time_shifted_stream_is_gray_without_the_person(recorded_site: Kept, form: str) -> None:
    served, decisions = recorded_site
    path = f"/objects/1/best.{form}?from=p0&to=p{len(decisions) * GOP}"
    narrow, full = [decoded(await fetch(served, path, token_name)) for token_name in ("family", "desk")]
    if form == "ts":
        narrow, full = (
            {pulse - min(pictures): shown for pulse, shown in pictures.items()} for pictures in (narrow, full)
        )
    assert_equal_pictures(narrow, expected_pictures(decisions, freezes=False))
    assert_equal_pictures(full, chosen_pictures(decisions))
    assert sum(map(is_gray, narrow.values())) > 8 * GOP


async def test_a_time_shifted_stream_continues_live(tmp_path: Path) -> None:
    async with departure_site(tmp_path) as served:
        decisions = feed_epochs(served, range(12))
        scoped = await open_stream(served, "/objects/1/best.mp4?from=p25", "family")
        while not served.service.splicer.scoped_persons[1].viewers:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        decisions += feed_epochs(served, range(12, EPOCHS))
        shown = decoded((await finish_streams(served, scoped))[0])
    right = expected_pictures(decisions, freezes=False)
    assert min(shown) == 25
    assert [is_gray(shown[pulse]) for pulse in (29, 30, 79, 80)] == [False, True, True, False]
    assert_equal_pictures(shown, right)


async def test_recorded_segments_are_gray_without_the_person(
    recorded_site: Kept,
) -> None:
    served, decisions = recorded_site
    shown: dict[str, dict[int, Picture]] = {}
    for token_name in ("family", "desk"):
        listed = (await fetch(served, "/objects/1/hls/index.m3u8?from=p0&to=p90", token_name)).decode()
        names = ["init.mp4", *re.findall(r"^[0-9]+\.m4s$", listed, re.MULTILINE)]
        for scoped in (True, False):
            segmenter = served.service.splicer.segmenter_of_person(1, scoped_to_person=scoped)
            assert segmenter is not None
            segmenter._segments.clear()
        shown[token_name] = decoded(
            b"".join([await fetch(served, f"/objects/1/hls/{name}", token_name) for name in names])
        )
    assert max(shown["desk"]) == 89
    right = {"family": expected_pictures(decisions, freezes=False), "desk": chosen_pictures(decisions)}
    for token_name, pictures in shown.items():
        for pulse, picture in pictures.items():
            np.testing.assert_array_equal(picture, right[token_name][pulse], f"{token_name} {pulse}")
    assert sum(map(is_gray, shown["family"].values())) > 8 * GOP


@pytest.mark.parametrize("hls", [False, True])
async def test_recorded_sound_is_silent_without_the_person(tmp_path: Path, *, hls: bool) -> None:
    recording = write_flashes(tmp_path / "flashes.mp4", SOUNDING)
    record = {"folder": str(tmp_path / "kept"), "segment_s": 1.0}
    async with departure_site(tmp_path, sound={"source": str(recording)}, record=record, http=HLS) as served:
        served.service.recorder.open()
        send_audio(served.service, recording)
        decisions = feed_epochs(served, range(EPOCHS))
        await wait_until_on_disk(served, len(decisions) - 2)
        beep_times: dict[str, list[int]] = {}
        for token_name in ("family", "desk"):
            names = [f"best.mp4?from=p0&to=p{len(decisions) * GOP}"]
            if hls:
                names = [f"hls/{file}" for file in ("init.mp4", *(f"{number}.m4s" for number in range(11)))]
                for scoped in (True, False):
                    segmenter = served.service.splicer.segmenter_of_person(1, scoped_to_person=scoped)
                    assert segmenter is not None
                    segmenter._segments.clear()
            data = b"".join([await fetch(served, f"/objects/1/{name}", token_name) for name in names])
            beep_times[token_name] = [round(beep * FPS) for beep in beeps(data)]
    assert beep_times == {"family": [20, 80, 100], "desk": [20, 40, 60, 80, 100]}
