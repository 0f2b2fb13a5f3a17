"""A VP8 site: players show no warnings, and unsupported addresses are refused with one line."""

from __future__ import annotations

import asyncio
import io
from functools import partial

import av
import cv2
import numpy as np
import pytest

from benchmarks.common.browser import chromium
from fakes.media.browser_playback import PLAY_JS, play_in_chromium
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffmpeg, needs_mpv
from fakes.service.fed_site import A, B, ServedSite
from fakes.service.real_time_feed import feed_epoch, feed_in_real_time
from fakes.service.scripted_cameras import (
    FPS,
    GOP,
    HEIGHT,
    NO_REASON,
    WIDTH,
    encoded,
)
from fakes.service.vp8_site import EPOCHS, decoded_alone, feed
from server.service.view_selection.decider import GopDecision, ObjectChoice

PATHS = ("/objects/1/best.webm", "/cameras/c1/live.webm")


async def run_players(served: ServedSite, command: str) -> list[tuple[int | None, bytes, str]]:
    """Run a player for each path while the site runs and ends; return exit code, output and warnings."""
    pipe = asyncio.subprocess.PIPE
    urls = [f"http://127.0.0.1:{served.port}{path}" for path in PATHS]
    players = [
        await asyncio.create_subprocess_exec(*command.format(url).split(), stdout=pipe, stderr=pipe)
        for url in urls
    ]
    ends = [asyncio.create_task(player.communicate()) for player in players]
    while served.service.splicer.viewers < len(PATHS):
        assert not any(end.done() for end in ends), await asyncio.wait(ends)
        await asyncio.sleep(0.01)
    for epoch in range(3, EPOCHS):
        feed(served, epoch)
        await asyncio.sleep(0.02)
    served.service.splicer.close()
    results = await asyncio.gather(*ends)
    return [
        (player.returncode, output, complaints.decode())
        for player, (output, complaints) in zip(players, results, strict=True)
    ]


@needs_ffmpeg
async def test_ffmpeg_plays_across_cuts_without_a_warning(vp8_site: ServedSite) -> None:
    command = "ffmpeg -nostdin -v warning -i {} -f rawvideo -pix_fmt yuv420p -fps_mode passthrough pipe:1"
    alone = np.array([decoded_alone(camera) for camera in range(2)])
    best, live = await run_players(vp8_site, command)
    for path, player in zip(PATHS, (best, live), strict=True):
        assert (player[0], player[2]) == (0, ""), path
    camera = np.frombuffer(live[1], np.uint8).reshape(-1, HEIGHT * 3 // 2, WIDTH)
    np.testing.assert_array_equal(camera, alone[1, -len(camera) :])
    shown = np.frombuffer(best[1], np.uint8).reshape(-1, HEIGHT * 3 // 2, WIDTH)
    end = vp8_site.service.decider._next_gop or 0
    is_from_second = [
        int(np.array_equal(picture, alone[1, end - len(shown) + n])) for n, picture in enumerate(shown)
    ]
    for n, picture in enumerate(shown):
        np.testing.assert_array_equal(
            picture, alone[is_from_second[n], end - len(shown) + n], f"frame {n} of {len(shown)}"
        )
    assert np.abs(np.diff(is_from_second)).sum() >= 2, "there are cuts"


@needs_mpv
async def test_mpv_plays_to_the_end_without_a_warning(vp8_site: ServedSite) -> None:
    command = "mpv --no-config --vo=null --no-audio --untimed --msg-level=all=warn --no-terminal {}"
    for path, player in zip(PATHS, await run_players(vp8_site, command), strict=True):
        assert player == (0, b"", ""), path


GOPS = 8
SILENT = (2, 3, 6)
"""GOPs without pictures, as when no camera can be shown."""
LOST = 22
"""A pulse whose picture is lost, in an otherwise complete GOP."""


@needs_chromium
async def test_chromium_plays_across_cuts_and_gaps_to_the_end(vp8_site: ServedSite) -> None:
    splicer, frame_buffers = vp8_site.service.splicer, vp8_site.service.frame_buffers
    splicer.forget([], [])  # begin with another person
    for seed, camera in enumerate((A, B)):
        for unit in encoded(seed, codec="vp8"):
            if unit.pulse // GOP not in SILENT and unit.pulse != LOST:
                frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
            elif frame_buffers[camera].has(unit.pulse):
                del frame_buffers[camera]._pictures[unit.pulse]

    def show(gop: int) -> None:
        camera = (A, B)[gop % 2]
        choice = ObjectChoice(
            7, camera if frame_buffers[camera].has(gop * GOP) else None, None, departed=False
        )
        splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))

    show(0)
    played_in_browser = await play_in_chromium(
        *(vp8_site.port, splicer, GOPS, show),
        *(PLAY_JS, "/objects/7/best.webm", 'video/webm; codecs="vp8"', 1),
    )
    assert (played_in_browser["error"], played_in_browser["ranges"]) == ("", 1)
    assert played_in_browser["range"] == [0, pytest.approx(GOPS * GOP / FPS)]
    pulses = [time * FPS for time in played_in_browser["shown"]]
    assert pulses == pytest.approx([round(pulse) for pulse in pulses], abs=0.03), "frames are at their pulses"
    # A busy browser need not show the last frames.
    assert played_in_browser["end"] == pytest.approx(GOPS * GOP / FPS, abs=0.01)


def feed_two(served: ServedSite, epoch: int) -> None:
    """Send an epoch of two people, each larger in the other camera every second."""
    feed_epoch(served, epoch, "vp8", first_is_larger_in_first=not epoch // 5 % 2)


@needs_chromium
@pytest.mark.slow
async def test_the_page_plays_across_cuts_and_from_one_person_to_another(vp8_site: ServedSite) -> None:
    errors: list[str] = []
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        page.on("pageerror", lambda error: errors.append(str(error)))
        feeding = asyncio.create_task(feed_in_real_time(partial(feed_two, vp8_site)))
        await page.goto(f"http://127.0.0.1:{vp8_site.port}/?object=1")
        await page.wait_for_function("myview.state === 'playing' && myview.cuts.length > 1")
        await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
        await page.locator("#people button.person[aria-current=false]").first.click()
        await page.wait_for_function("myview.object === 2 && myview.switches.at(-1).shownAt !== null")
        pulse = await page.evaluate("myview.pulse")
        await page.wait_for_function(f"myview.pulse > {pulse} + {FPS}")
        assert await page.evaluate("document.querySelector('video').dataset.same") == "yes", "one player"
        await page.goto(f"http://127.0.0.1:{vp8_site.port}/?object=1&camera=c1")
        await page.wait_for_function("myview.state === 'playing' && myview.camera === 'c1'")
        await page.keyboard.press(",")
        results = await page.locator("#notice").text_content()
        assert results == "There is no recording of that time. This is live."
        feeding.cancel()
    assert errors == []


@pytest.mark.parametrize(
    "path",
    [
        *("/objects/1/best.mp4", "/objects/1/best.ts"),
        *("/objects/1/best.mp4?overlay=1", "/objects/1/best.mp4?from=-5", "/objects/1/hls/index.m3u8"),
        *("/cameras/c0/live.mp4", "/cameras/c0/live.ts", "/cameras/c0/hls/init.mp4"),
        *("/api/objects/1/past", "/api/cameras/c0/past"),
    ],
)
async def test_mp4_addresses_of_a_vp8_site_are_refused_with_one_line(vp8_site: ServedSite, path: str) -> None:
    code, content = await vp8_site.get(path)
    assert code == 404
    assert "VP8 (encode.codec): there is best.webm" in content["error"]


async def test_vp8_is_encoded_anew_as_h264(vp8_site: ServedSite) -> None:
    feeding = asyncio.create_task(feed_in_real_time(partial(feed_two, vp8_site)))
    async with vp8_site.session.get("/objects/1/best.mp4?codec=h264") as answer:
        assert answer.status == 200
        data = b""
        while data.count(b"moof") < GOP:
            data += await answer.content.readany()
    feeding.cancel()
    with av.open(io.BytesIO(data[: data.rindex(b"moof") - 4])) as container:
        assert container.streams.video[0].codec_context.name == "h264"
        assert len(list(container.decode(video=0))) >= GOP - 1


async def test_jpeg_is_rendered_from_vp8_with_and_without_boxes(vp8_site: ServedSite) -> None:
    pictures = {}
    for path in ("/objects/1/best.jpg", "/objects/1/best.jpg?overlay=1", "/cameras/c1/live.jpg"):
        async with vp8_site.session.get(path) as answer:
            assert (answer.status, answer.content_type) == (200, "image/jpeg"), path
            jpeg, pulse = await answer.read(), int(answer.headers["X-MyView-Pulse"])
        pictures[path] = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), pulse
    alone = [
        av.VideoFrame.from_ndarray(picture, format="yuv420p").to_ndarray(format="bgr24")
        for picture in decoded_alone(1)
    ]
    for path in ("/objects/1/best.jpg", "/cameras/c1/live.jpg"):
        picture, pulse = pictures[path]
        differences = [np.abs(picture.astype(float) - own_picture).mean() for own_picture in alone]
        assert int(np.argmin(differences)) == pulse, "the picture of its pulse, of the chosen camera"
    plain, boxed = (pictures[f"/objects/1/best.jpg{query}"][0] for query in ("", "?overlay=1"))
    assert np.abs(plain.astype(float) - boxed).max() > 50, "boxes are drawn"


async def test_unknown_people_and_webm_of_an_h264_site_are_refused_with_one_line(
    vp8_site: ServedSite, site_with_people: ServedSite
) -> None:
    assert await vp8_site.get("/objects/9/best.webm") == (404, {"error": "there is no object 9"})
    code, content = await vp8_site.get("/cameras/c9/live.webm")
    assert (code, content["error"]) == (404, "there is no camera 'c9'; there are c0, c1")
    code, content = await vp8_site.get("/objects/1/best.webm?from=-5")
    assert code == 400
    code, content = await site_with_people.get("/objects/1/best.webm")
    assert code == 404
    assert "H.264 (encode.codec): there is best.mp4" in content["error"]


async def test_the_site_names_codec_and_container(vp8_site: ServedSite, site_with_people: ServedSite) -> None:
    site = await vp8_site.get_json("/api/site")
    assert (site["codec"], site["container"]) == ("vp8", "webm")
    site = await site_with_people.get_json("/api/site")
    assert (site["codec"][:5], site["container"]) == ("avc1.", "mp4")
