"""An H.265 site: players show no warnings, and those without H.265 get H.264 that is encoded once for all."""

from __future__ import annotations

import asyncio
import io
import subprocess
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.common.browser import chromium
from fakes.media.decoding import video_decoder
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffmpeg, needs_mpv
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.real_time_feed import FRAMES, feed_epoch, feed_in_real_time
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    HEIGHT,
    WIDTH,
    encoded,
)

PLAYERS = {
    "ffmpeg": "ffmpeg -v warning -xerror -i {} -f null -",
    "mpv": "mpv --no-config --vo=null --no-audio --untimed --msg-level=all=warn --no-terminal {}",
}


@pytest.fixture
async def h265_site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    """A site of H.265 that records; its person is larger in the other camera every GOP, so there are cuts."""
    changes = {"encode": {"codec": "h265"}, "record": {"folder": str(tmp_path / "kept")}}
    async for served in serve_site(patience=90, http={"viewer_queue_gops": 100}, **changes):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            feed(served, epoch)
        yield served


def feed(served: ServedSite, epoch: int) -> None:
    feed_epoch(served, epoch, "h265", first_is_larger_in_first=epoch % 4 >= 2)


async def run_players(served: ServedSite, command: str, paths: tuple[str, ...]) -> None:
    """Run a player for each path while the site runs and ends; it must not say anything."""
    pipe = asyncio.subprocess.PIPE
    players = [
        await asyncio.create_subprocess_exec(
            *command.format(f"http://127.0.0.1:{served.port}{path}").split(), stdout=pipe, stderr=pipe
        )
        for path in paths
    ]
    ends = [asyncio.create_task(player.communicate()) for player in players]
    while served.service.splicer.viewers < len(paths):
        assert not any(end.done() for end in ends), await asyncio.wait(ends)
        await asyncio.sleep(0.01)
    for epoch in range(3, 12):
        feed(served, epoch)
        await asyncio.sleep(0.02)
    served.service.splicer.close()
    for player, path, (output, complaints) in zip(players, paths, await asyncio.gather(*ends), strict=True):
        assert (player.returncode, output, complaints.decode()) == (0, b"", ""), path


@needs_ffmpeg
@needs_mpv
@pytest.mark.parametrize("player", list(PLAYERS))
async def test_players_show_cuts_without_a_warning(h265_site: ServedSite, player: str) -> None:
    paths = ("/objects/1/best.mp4", "/objects/1/best.ts", "/cameras/c1/live.mp4")
    await run_players(h265_site, PLAYERS[player], paths)


@needs_ffmpeg
@pytest.mark.parametrize(
    "path", ["/objects/1/best.mp4?from=p0&to=p40", "/objects/1/hls/index.m3u8?from=p0&to=p40"]
)
async def test_the_past_plays_without_a_warning(h265_site: ServedSite, path: str) -> None:
    for epoch in range(3, 14):
        feed(h265_site, epoch)
    command = PLAYERS["ffmpeg"].format(f"http://127.0.0.1:{h265_site.port}{path}").split()
    run = asyncio.to_thread(subprocess.run, command, capture_output=True, text=True, timeout=60, check=False)
    ended = await run
    assert (ended.returncode, ended.stderr) == (0, "")


async def test_the_site_names_both_codecs(h265_site: ServedSite) -> None:
    site = await h265_site.get_json("/api/site")
    assert site["codec"].startswith("hvc1.1.6.L")
    assert (site["container"], site["h264"]) == ("mp4", "avc1.42C028")
    for epoch in range(3, 14):
        feed(h265_site, epoch)
    async with h265_site.session.get("/objects/1/hls/index.m3u8?from=p0") as answer:
        assert f'CODECS="{site["codec"]}"' in await answer.text()


async def read_frames(served: ServedSite, path: str, frames: int) -> tuple[str, list[NDArray[np.uint8]]]:
    """Return the codec and the first pictures of a stream, while the site runs."""
    feeding = asyncio.create_task(feed_in_real_time(partial(feed, served)))
    data = b""
    async with served.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        while data.count(b"moof") <= frames:
            data += await answer.content.readany()
    feeding.cancel()
    with av.open(io.BytesIO(data[: data.rindex(b"moof") - 4])) as container:
        name = container.streams.video[0].codec_context.name
        return name, [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]


@pytest.mark.parametrize(
    "path",
    [
        *("/objects/1/best.mp4", "/objects/1/best.mp4?delay=live", "/objects/1/best.mp4?prefer=c0"),
        *("/objects/1/best.mp4?camera=c1", "/cameras/c0/live.mp4"),
    ],
)
async def test_streams_are_encoded_anew_as_h264(h265_site: ServedSite, path: str) -> None:
    query = "&codec=h264" if "?" in path else "?codec=h264"
    name, pictures = await read_frames(h265_site, path + query, 10)
    assert name == "h264"
    assert len(pictures) >= 10
    assert {picture.shape for picture in pictures} == {(HEIGHT, WIDTH, 3)}
    own = [picture for seed in range(len(CAMERAS)) for picture in decoded_alone(seed)]
    for picture in pictures:
        assert min(np.abs(picture.astype(float) - one).mean() for one in own) < 12, "a camera's picture"


def decoded_alone(seed: int) -> list[NDArray[np.uint8]]:
    decoder = video_decoder("h265")
    units = encoded(seed, FRAMES, codec="h265")[:100]
    return [
        frame.to_ndarray(format="bgr24") for unit in units for frame in decoder.decode(av.Packet(unit.data))
    ]


async def test_many_viewers_share_one_encoder(h265_site: ServedSite) -> None:
    feeding = asyncio.create_task(feed_in_real_time(partial(feed, h265_site)))
    answers = [await h265_site.session.get("/objects/1/best.mp4?codec=h264") for _ in range(3)]
    heads = [await answer.content.readexactly(500) for answer in answers]
    assert len(set(heads)) == 1
    async with h265_site.session.get("/metrics") as answer:
        lines = (await answer.text()).splitlines()
    assert "myview_pictures 1.0" in lines
    for answer in answers:
        answer.close()
    feeding.cancel()


@pytest.mark.parametrize(
    ("path", "status", "error"),
    [
        ("/objects/1/best.mp4?codec=av1", 400, "codec=av1: must be h264"),
        ("/objects/1/best.ts?codec=h264", 400, "codec: only best.mp4 and live.mp4 are encoded anew"),
        ("/objects/1/best.mp4?codec=h264&from=-5", 400, "codec: the past is not encoded anew"),
        (
            "/objects/1/best.webm",
            404,
            "these streams are H.265 (encode.codec): there is best.mp4 and live.mp4",
        ),
        ("/objects/9/best.mp4?codec=h264", 404, "there is no object 9"),
    ],
)
async def test_other_requests_are_refused_with_one_line(
    h265_site: ServedSite, path: str, status: int, error: str
) -> None:
    assert await h265_site.get(path) == (status, {"error": error})


async def test_webrtc_is_refused_with_one_line(h265_site: ServedSite) -> None:
    headers = {"Content-Type": "application/sdp"}
    async with h265_site.session.post("/objects/1/whep", data="v=0", headers=headers) as answer:
        text = await answer.json()
    assert answer.status == 404
    assert text == {"error": "these streams are H.265 (encode.codec): WebRTC hands on H.264 only"}


async def test_jpeg_is_rendered_from_h265(h265_site: ServedSite) -> None:
    async with h265_site.session.get("/cameras/c1/live.jpg") as answer:
        assert (answer.status, answer.content_type) == (200, "image/jpeg")
        jpeg, pulse = await answer.read(), int(answer.headers["X-MyView-Pulse"])
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).astype(float)
    differences = [np.abs(picture - own).mean() for own in decoded_alone(1)]
    assert int(np.argmin(differences)) == pulse


@needs_chromium
async def test_chromium_shows_a_site_whose_codec_it_cannot_play(h265_site: ServedSite) -> None:
    """It asks for H.264 by itself, as it has no H.265 here."""
    errors: list[str] = []
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        page.on("pageerror", lambda error: errors.append(str(error)))
        feeding = asyncio.create_task(feed_in_real_time(partial(feed, h265_site)))
        await page.goto(f"http://127.0.0.1:{h265_site.port}/?object=1")
        codec = "hvc1.1.6.L30.90"
        if await page.evaluate(f"MediaSource.isTypeSupported('video/mp4; codecs=\"{codec}\"')"):
            pytest.skip("this Chromium plays H.265")
        await page.wait_for_function("myview.state === 'playing' && myview.pulse !== null")
        await page.wait_for_function(f"myview.pulse > {5 * FPS}")
        await page.keyboard.press(",")
        await page.wait_for_function("document.querySelector('#notice').textContent.includes('recordings')")
        feeding.cancel()
    assert errors == []
