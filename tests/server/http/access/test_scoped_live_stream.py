"""Streams for a token limited to one person: without the person the picture is held, then gray."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fakes.http.tokens import token_of
from fakes.media.audio import FRAMES as SOUNDING
from fakes.media.audio import beeps, send_audio, write_flashes
from fakes.media.browser_playback import PLAY_JS, play_in_chromium
from fakes.programs import needs_chromium
from fakes.service.departure import (
    EPOCHS,
    PATIENT_HTTP,
    assert_equal_pictures,
    camera_pictures,
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
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE
from server.media.picture import Codec
from server.service.streaming.subscriber_queue import Chunk

HLS = {**PATIENT_HTTP, "hls_segment_s": 0.4, "hls_window_s": 8.0}
"""Two GOPs in a segment, and all that there is in the playlist."""


@pytest.mark.parametrize(
    ("form", "codec"),
    [("mp4", "h264"), ("ts", "h264"), ("mp4", "h265"), ("ts", "h265"), ("webm", "vp8")],
)
async def test_the_picture_is_held_then_gray_until_the_person_returns(
    tmp_path: Path, form: str, codec: Codec
) -> None:
    async with departure_site(tmp_path, encode={"codec": codec}) as served:
        decisions = feed_epochs(served, range(3))
        scoped, all_of_it = [
            await open_stream(served, f"/objects/1/best.{form}", token_name)
            for token_name in ("family", "desk")
        ]
        decisions += feed_epochs(served, range(3, EPOCHS))
        narrow, full = map(decoded, await finish_streams(served, scoped, all_of_it))
    right = expected_pictures(decisions, codec)
    if form == "ts":  # which begins at another time
        narrow, full = (
            {pulse - max(pictures) + max(right): shown for pulse, shown in pictures.items()}
            for pictures in (narrow, full)
        )
    assert_equal_pictures(narrow, right)
    assert_equal_pictures(full, chosen_pictures(decisions, codec))
    grey = [pulse for pulse in narrow if is_gray(narrow[pulse])]
    assert grey == list(range(grey[0], grey[-1] + 1))
    assert len(grey) > 3 * GOP
    assert np.array_equal(narrow[grey[0] - 1], narrow[grey[0] - 2]), "frozen before it is gray"
    assert grey[-1] < max(narrow), "a returned person is shown again"


async def test_a_stream_opened_while_the_person_is_away_begins_with_gray(tmp_path: Path) -> None:
    async with departure_site(tmp_path) as served:
        decisions = feed_epochs(served, range(14))
        scoped = await open_stream(served, "/objects/1/best.mp4", "family")
        decisions += feed_epochs(served, range(14, EPOCHS))
        shown = decoded((await finish_streams(served, scoped))[0])
    assert is_gray(shown[min(shown)])
    assert_equal_pictures(shown, expected_pictures(decisions))


async def test_a_preferred_camera_is_gray_without_the_person(tmp_path: Path) -> None:
    async with departure_site(tmp_path) as served:
        decisions = feed_epochs(served, range(3))
        scoped = await open_stream(served, "/objects/1/best.mp4?prefer=c0", "family")
        decisions += feed_epochs(served, range(3, EPOCHS))
        shown = decoded((await finish_streams(served, scoped))[0])
    is_as_expected = {
        pulse: is_gray(picture) for pulse, picture in expected_pictures(decisions).items() if pulse in shown
    }
    assert {pulse: is_gray(picture) for pulse, picture in shown.items()} == is_as_expected
    np.testing.assert_array_equal(shown[max(shown)], camera_pictures("c0")[max(shown)])


async def fetch_listed(served: ServedSite, pattern: str, token_name: str) -> bytes:
    """Fetch the segments of a playlist, after its init segment."""
    text = (await fetch(served, "/objects/1/hls/index.m3u8", token_name)).decode()
    names = ["init.mp4", *re.findall(pattern, text, re.MULTILINE)]
    return b"".join([await fetch(served, f"/objects/1/hls/{name}", token_name) for name in names])


@pytest.mark.parametrize("pattern", [r"^[0-9]+\.m4s$", r'PART:.*URI="([0-9.]+\.m4s)"'])
async def test_segments_and_parts_are_gray_only_for_the_scoped_token(tmp_path: Path, pattern: str) -> None:
    async with departure_site(tmp_path, http=HLS) as served:
        decisions = feed_epochs(served, range(EPOCHS - 5))
        narrow, full = [
            decoded(await fetch_listed(served, pattern, token_name)) for token_name in ("family", "desk")
        ]
    until = max(full) + 1
    right = expected_pictures(decisions)
    for pulse in range(min(narrow), until):  # a picture held for a whole segment has its duration
        standing = narrow[max(earlier for earlier in narrow if earlier <= pulse)]
        np.testing.assert_array_equal(standing, right[pulse], str(pulse))
    assert_equal_pictures(
        full, {pulse: picture for pulse, picture in chosen_pictures(decisions).items() if pulse < until}
    )
    assert any(map(is_gray, narrow.values()))


async def test_sound_is_silent_without_the_person(tmp_path: Path) -> None:
    recording = write_flashes(tmp_path / "flashes.mp4", SOUNDING)
    async with departure_site(tmp_path, sound={"source": str(recording)}) as served:
        send_audio(served.service, recording)
        feed_epochs(served, range(3))
        answers = [
            await open_stream(served, "/objects/1/best.mp4", token_name) for token_name in ("family", "desk")
        ]
        feed_epochs(served, range(3, EPOCHS))
        narrow, full = await finish_streams(served, *answers)
    assert [round(beep * FPS) for beep in beeps(full)] == [20, 40, 60, 80, 100]
    assert [round(beep * FPS) for beep in beeps(narrow)] == [20, 80, 100]


@needs_chromium
@pytest.mark.parametrize("form", ["mp4", "webm"])
async def test_a_browser_plays_held_and_gray_pictures_without_a_break(tmp_path: Path, form: str) -> None:
    codec = "vp8" if form == "webm" else "h264"
    async with departure_site(tmp_path, encode={"codec": codec}) as served:
        feed_epochs(served, range(3))
        kind = f'video/{form}; codecs="{served.service.stream_format.codec}"'
        path = f"/objects/1/best.{form}?token={token_of('family')}"
        decisions = await play_in_chromium(
            *(
                served.port,
                served.service.splicer,
                EPOCHS - 2,
                lambda gop: feed_epochs(served, range(gop + 2, gop + 3)),
            ),
            *(PLAY_JS, path, kind, 4),
        )
    assert decisions["error"] == ""
    assert decisions["ranges"] == 1
    assert decisions["range"][1] == pytest.approx((EPOCHS - 1) * GOP / FPS, abs=1e-3)


async def test_gray_pictures_are_encoded_once_for_all_viewers(tmp_path: Path) -> None:
    async with departure_site(tmp_path) as served:
        for epoch in range(2):
            served.service.feed(epoch, {camera: {1: LARGE, 2: LARGE} for camera in CAMERAS})
        for epoch in range(2, 14):
            served.service.feed(epoch, {camera: {1: None, 2: None} for camera in CAMERAS})
        viewers = [served.service.splicer.scoped_persons[number].subscribe() for number in (1, 2)]
        pieces: list[Chunk] = [viewer._queue[-1] for viewer in viewers]
    assert pieces[0] is pieces[1]
    assert pieces[0].random_access


async def test_a_site_without_tokens_has_no_scoped_streams(tmp_path: Path) -> None:
    async with departure_site(tmp_path, access={"tokens": None}) as served:
        decisions = feed_epochs(served, range(14))
        assert decisions[-1].choices[1]
        assert not served.service.splicer.scoped_persons
