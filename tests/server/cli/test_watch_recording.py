"""`myview watch --out` writes a file that plays everywhere, and sidecar files with boxes."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path

import av
import numpy as np
import pytest
from typer.testing import CliRunner

import client
from benchmarks.common.browser import chromium
from client.model import Box, Site
from client.sidecar import write_sidecars
from client.stream_events import Frame
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffprobe
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, HEIGHT, LARGE, SMALL, WIDTH
from fakes.service.scripted_recordings import A, B, own_pictures, pictures
from server.cli.main import app

FIRST = 2 * GOP  # of the watched stream


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    """Person 1, three GOPs in c0, then in c1; person 2 in c0."""
    async for recorded_site in serve_site():
        recorded_site.service.connect_cameras(*CAMERAS)
        for epoch in range(7):
            in_a, in_b = (LARGE, SMALL) if epoch < 3 else (SMALL, LARGE)
            recorded_site.service.feed(epoch, {A: {1: in_a, 2: SMALL}, B: {1: in_b}})
        yield recorded_site


async def watched(served: ServedSite, out: Path) -> client.WatchResult:
    url = f"http://127.0.0.1:{served.port}"
    return await client.watch(url, 1, out, start=f"p{FIRST}", end="p28")


def chosen_cameras(served: ServedSite) -> dict[int, str]:
    return {
        pulse: choices.choices[1]
        for choices in served.service.recorder.recent.choices(0)
        for pulse in range(choices.first, choices.first + GOP)
    }


async def test_the_recording_begins_at_0_with_unchanged_pictures(served: ServedSite, tmp_path: Path) -> None:
    out = tmp_path / "one.mp4"
    result = await watched(served, out)
    assert (result.complete, result.cuts, result.fragments) == (True, 1, 28 - FIRST)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.ass", "one.mp4", "one.vtt"]
    shown = list(pictures(out))
    assert [place for place, _ in shown] == list(range(28 - FIRST))
    for place, picture in shown:
        camera = chosen_cameras(served)[FIRST + place]
        np.testing.assert_array_equal(picture, own_pictures(camera)[FIRST + place])
    with av.open(str(out), "r") as film:
        assert film.streams.video[0].frames == 28 - FIRST, "counted in its table"
        assert film.duration == pytest.approx((28 - FIRST) / FPS * av.time_base)
        film.seek(round(12 / FPS * av.time_base))
        assert round(float(next(film.decode(video=0)).time or 0) * FPS) == 10, "the keyframe before"


async def test_a_live_stream_is_recorded_like_the_past(tmp_path: Path) -> None:
    async for served in serve_site():
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(4):
            served.service.feed(epoch, {A: {1: LARGE}, B: {1: SMALL}})
        url = f"http://127.0.0.1:{served.port}"
        out = tmp_path / "one.mp4"
        watching = asyncio.create_task(client.watch(url, 1, out, 3 * GOP / FPS))
        while not served.service.splicer.viewers:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        for epoch in range(4, 8):
            served.service.feed(epoch, {A: {1: LARGE}, B: {1: SMALL}})
        result = await watching
        assert (result.complete, result.fragments) == (True, 3 * GOP)
        assert [place for place, _ in pictures(out)] == list(range(3 * GOP))
        assert (tmp_path / "one.vtt").read_text().count("\np") == 3 * GOP


@needs_chromium
async def test_a_browser_plays_the_recording_with_its_duration(served: ServedSite, tmp_path: Path) -> None:
    await watched(served, tmp_path / "one.mp4")
    (tmp_path / "page.html").write_text("<video src=one.mp4 muted></video>")
    async with chromium() as browser:
        page = await new_page(browser)
        await page.goto(f"file://{tmp_path}/page.html")
        played = await page.evaluate("""async () => {
            const video = document.querySelector('video');
            const over = new Promise((done, failed) => {
                video.onended = done;
                video.onerror = () => failed(video.error.message);
            });
            await video.play();
            await over;
            return [video.duration, video.currentTime, video.videoWidth, video.buffered.start(0)];
        }""")
    assert played == pytest.approx([(28 - FIRST) / FPS, (28 - FIRST) / FPS, WIDTH, 0.0])


@needs_ffprobe
async def test_ffprobe_reports_no_problem_of_the_recording(served: ServedSite, tmp_path: Path) -> None:
    await watched(served, tmp_path / "one.mp4")
    options = ["-v", "warning", "-show_entries", "format=start_time,duration", "-of", "csv=p=0"]
    result = subprocess.run(
        ["ffprobe", *options, str(tmp_path / "one.mp4")], capture_output=True, check=True, text=True
    )
    assert (result.stderr, result.stdout.strip()) == ("", "0.000000,0.720000")


async def test_every_frame_has_its_boxes_in_the_sidecar(served: ServedSite, tmp_path: Path) -> None:
    await watched(served, tmp_path / "one.mp4")
    head, note, *cues = (tmp_path / "one.vtt").read_text().strip().split("\n\n")
    assert head == "WEBVTT"
    assert f"{WIDTH}x{HEIGHT}" in note
    assert len(cues) == 28 - FIRST
    for place, cue in enumerate(cues):
        name, times, text = cue.split("\n")
        assert name == f"p{FIRST + place}"
        begin, end = (float(part.rpartition(":")[2]) for part in times.split(" --> "))
        assert (begin, end) == pytest.approx((place / FPS, (place + 1) / FPS))
        content = json.loads(text)
        assert content["camera"] == chosen_cameras(served)[FIRST + place]
        boxes_by_number = {number: tuple(box) for number, *box in content["boxes"]}
        assert boxes_by_number == {1: LARGE, 2: SMALL} if content["camera"] == A else {1: LARGE}


def test_drawn_boxes_have_the_right_positions(tmp_path: Path) -> None:
    if shutil.which("ffmpeg") is None or b" ass " not in _ffmpeg("-hide_banner", "-filters"):
        pytest.skip("needs an ffmpeg that draws subtitles")
    site = Site("hall", 25.0, 320, 240, GOP, 25, None, None, 0.0, ("c0",))
    frames = [
        Frame(pulse, "c0", (Box(1, 40.0 + 4 * pulse, 60.0, 80.0 + 4 * pulse, 160.0),)) for pulse in range(25)
    ]
    write_sidecars(tmp_path / "one.mp4", frames, 0, 1, site)
    source = "color=black:size=320x240:rate=25:duration=1"
    drawn = _ffmpeg(
        *("-v", "error", "-f", "lavfi", "-i", source, "-vf", f"ass={tmp_path / 'one.ass'}"),
        *("-f", "rawvideo", "-pix_fmt", "gray", "-"),
    )
    shown = np.frombuffer(drawn, np.uint8).reshape(25, 240, 320)
    for pulse in (2, 12, 22):
        bright = np.flatnonzero(shown[pulse, 110] > 100)
        assert abs(bright.min() - (40 + 4 * pulse)) <= 2
        assert abs(bright.max() - (80 + 4 * pulse)) <= 2


def _ffmpeg(*arguments: str) -> bytes:
    return subprocess.run(["ffmpeg", *arguments], capture_output=True, check=True).stdout


async def test_an_invalid_moment_leaves_no_file(served: ServedSite, tmp_path: Path) -> None:
    url = f"http://127.0.0.1:{served.port}"
    with pytest.raises(client.RefusedError, match="'soon' is not a time"):
        await client.watch(url, 1, tmp_path / "one.mp4", start="soon")
    with pytest.raises(
        client.RefusedError, match="nothing of object 1 is recorded from p99 on; there is p0 to p29"
    ):
        await client.watch(url, 1, tmp_path / "one.mp4", start="p99")
    assert not list(tmp_path.iterdir())


async def test_recorded_spans_and_events_can_be_fetched(served: ServedSite) -> None:
    url = f"http://127.0.0.1:{served.port}"
    (span,) = await client.spans(url, 1)
    assert (span.first, span.frames) == (0, 30)
    assert [gop.first async for gop in client.past(url, "p7", "p16")] == [5, 10, 15]
    with pytest.raises(client.NotFoundError, match="nothing is recorded of object 9"):
        await client.spans(url, 9)


def test_the_command_explains_its_options() -> None:
    help_text = CliRunner().invoke(app, ["watch", "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"}).output
    assert all(re.search(rf"{option}\b", help_text) for option in ("--from", "--to", "--out", "--seconds"))
