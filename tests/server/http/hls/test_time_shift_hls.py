"""Time shift over HLS: recorded segments keep the URLs and bytes of live ones."""

from __future__ import annotations

import asyncio
import io
import re
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path

import av
import numpy as np
import pytest

from benchmarks.common.browser import chromium
from fakes.http.hls_recording import (
    FRAMES,
    GOPS,
    HTTP_SETTINGS,
    SEGMENT_FRAMES,
    decide_gops,
    drop_from_memory,
    fetch,
    fetch_text,
    segment_numbers,
    wait_until_written,
)
from fakes.media.audio import FRAMES as SOUNDING
from fakes.media.audio import decode_audio, send_audio, write_flashes
from fakes.media.browser_playback import NATIVE_HLS_JS
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffmpeg
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP
from fakes.service.scripted_recordings import Picture, own_pictures
from fakes.timeouts import PATIENCE

NOTHING = "nothing of camera c0 is recorded from p999 on; there is p0 to p104"


@pytest.fixture
async def served(tmp_path: Path) -> AsyncIterator[ServedSite]:
    """A site that keeps everything."""
    async for served in serve_site(
        record={"folder": str(tmp_path / "kept"), "segment_s": 1.0}, http=HTTP_SETTINGS
    ):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        served.service.state_replication.begin(0)
        yield served


async def played(served: ServedSite, stream: str, listed: list[int]) -> list[tuple[int, Picture]]:
    """Decode segments, after their init segment; return the last picture of each pulse."""
    parts = [
        await fetch(served, f"{stream}/hls/{file}") for file in ("init.mp4", *(f"{n}.m4s" for n in listed))
    ]
    with av.open(io.BytesIO(b"".join(parts)), "r") as container:
        frames = list(container.decode(video=0))
    shown = {round(float(frame.time or 0) * FPS): frame.to_ndarray(format="yuv420p") for frame in frames}
    return list(shown.items())


async def test_a_time_range_is_a_complete_playlist_of_its_segments(served: ServedSite) -> None:
    decide_gops(served, range(GOPS))
    await wait_until_written(served, GOPS)
    drop_from_memory(served)
    listed = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p13&to=p55")
    assert segment_numbers(listed) == [1, 2, 3, 4, 5], "whole segments, which hold these moments"
    assert "#EXT-X-MEDIA-SEQUENCE:1\n" in listed
    assert "#EXT-X-PLAYLIST-TYPE" not in listed, "EVENT would promise that no segment is removed"
    assert listed.endswith("#EXT-X-ENDLIST\n")
    shown = await played(served, "/objects/1", segment_numbers(listed))
    assert [pulse for pulse, _ in shown] == list(range(SEGMENT_FRAMES, 6 * SEGMENT_FRAMES))
    for pulse, picture in shown:
        np.testing.assert_array_equal(picture, own_pictures(CAMERAS[pulse // GOP % 2])[pulse])


@pytest.mark.parametrize("stream", ["/objects/1", "/cameras/c0"])
async def test_a_recorded_segment_has_the_bytes_of_the_live_one(served: ServedSite, stream: str) -> None:
    choices = {gop: A if gop % 7 < 3 else B if gop % 7 < 5 else None for gop in range(GOPS)}
    new: dict[int, bytes] = {}
    for gop in range(GOPS):
        decide_gops(served, range(gop, gop + 1), choices)
        if gop > 3:
            for number in segment_numbers(await fetch_text(served, f"{stream}/hls/index.m3u8")):
                new[number] = await fetch(served, f"{stream}/hls/{number}.m4s")
    await wait_until_written(served, GOPS)
    drop_from_memory(served)
    for segmenter in (
        served.service.splicer.segmenter_of_person(1),
        served.service.splicer.segmenter_of_camera("c0"),
    ):
        assert segmenter is not None
        segmenter._segments.clear()
    assert len(new) > 15
    for number, data in new.items():
        assert await fetch(served, f"{stream}/hls/{number}.m4s") == data, number


async def test_an_endless_playlist_grows_without_changing_listed_segments(served: ServedSite) -> None:
    decide_gops(served, range(21))
    await wait_until_written(served, 21)
    before = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p0&to=live")
    assert segment_numbers(before) == list(range(10)), "the eleventh is incomplete"
    assert "#EXT-X-ENDLIST" not in before
    assert "#EXT-X-START:TIME-OFFSET=0\n" in before, "otherwise players begin near the end"
    decide_gops(served, range(21, 30))
    after = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p0&to=live")
    assert segment_numbers(after) == list(range(15))
    assert after.startswith(before)


async def test_a_playlist_grows_until_an_end_in_the_future(served: ServedSite) -> None:
    decide_gops(served, range(21))
    before = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p0&to=p115")
    assert segment_numbers(before) == list(range(10))
    decide_gops(served, range(21, 30))
    after = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p0&to=p115")
    assert segment_numbers(after) == list(range(12))
    assert after.startswith(before.replace("#EXT-X-START:TIME-OFFSET=0\n", ""))
    assert after.endswith("#EXT-X-ENDLIST\n")


async def test_relative_moments_redirect_to_a_playlist_with_pulses(served: ServedSite) -> None:
    decide_gops(served, range(20))
    head = await fetch_text(served, "/objects/1/hls/index.m3u8?from=-2&to=-1")
    assert head.splitlines()[-1] == "index.m3u8?from=p50&to=p75"
    bandwidth = re.search(
        r'^#EXT-X-STREAM-INF:BANDWIDTH=(\d+),CODECS="avc1\.\w+",RESOLUTION=64x48,FRAME-RATE=25\.000$',
        head,
        re.MULTILINE,
    )
    assert bandwidth
    sizes = [len(await fetch(served, f"/objects/1/hls/{number}.m4s")) for number in range(5, 8)]
    assert int(bandwidth[1]) >= max(sizes) * 8 / (SEGMENT_FRAMES / FPS)
    assert segment_numbers(await fetch_text(served, "/objects/1/hls/index.m3u8?from=p50&to=p75")) == [5, 6, 7]


async def test_without_a_view_every_segment_holds_the_last_picture(served: ServedSite) -> None:
    choices = {gop: A if gop < 5 or gop >= 35 else None for gop in range(GOPS)}
    decide_gops(served, range(GOPS), choices)
    await wait_until_written(served, GOPS)
    drop_from_memory(served)
    listed = await fetch_text(served, f"/objects/1/hls/index.m3u8?from=p0&to=p{FRAMES}")
    assert segment_numbers(listed) == list(range(GOPS // 2))
    for number in (2, 9, 17):
        shown = await played(served, "/objects/1", [number])
        for pulse, picture in shown:
            expected = own_pictures(A)[24 if 25 <= pulse < 175 else pulse]
            np.testing.assert_array_equal(picture, expected, str(pulse))


async def test_without_recording_the_buffer_serves_time_shift() -> None:
    async for served in serve_site(http=HTTP_SETTINGS):
        served.service.connect_cameras(*CAMERAS)
        decide_gops(served, range(20))
        listed = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p20&to=live")
        assert segment_numbers(listed) == list(range(2, 10))
        shown = await played(served, "/objects/1", segment_numbers(listed))
        assert [pulse for pulse, _ in shown] == list(range(20, 100))


async def test_segments_of_a_forgotten_person_can_be_fetched(served: ServedSite) -> None:
    decide_gops(served, range(21))
    await wait_until_written(served, 21)
    served.service.splicer.forget([], [])
    served.service.splicer._persons._ended.clear()
    listed = await fetch_text(served, "/objects/1/hls/index.m3u8?from=p0&to=live")
    assert segment_numbers(listed) == list(range(11))
    assert listed.endswith("#EXT-X-ENDLIST\n")
    assert re.findall(r"#EXTINF:([\d.]+),", listed)[-1] == "0.20000", "it ends with the last GOP"
    shown = await played(served, "/objects/1", segment_numbers(listed))
    assert [pulse for pulse, _ in shown] == list(range(21 * GOP))
    assert (await served.session.get("/objects/1/hls/index.m3u8")).status == 404


@pytest.mark.parametrize(
    ("path", "status", "error"),
    [
        ("/objects/9/hls/index.m3u8?from=-60", 404, "there is no object 9"),
        ("/cameras/c9/hls/index.m3u8?from=-60", 404, "there is no camera 'c9'; there are c0, c1"),
        ("/cameras/c0/hls/index.m3u8?from=p999", 416, NOTHING),
        ("/objects/1/hls/index.m3u8?from=p9&to=p9", 400, "to: p9 is not after from, which is p9"),
        ("/objects/1/hls/index.m3u8?from=p100", 503, "the first segment is not complete yet"),
        ("/objects/1/hls/10.m4s", 404, "no segment 10: expired, or not available yet"),
        ("/objects/1/hls/999999999999.m4s", 404, "no segment 999999999999: expired, or not available yet"),
    ],
)  # fmt: skip
async def test_an_unavailable_time_range_is_refused_with_one_line(
    served: ServedSite, path: str, status: int, error: str
) -> None:
    decide_gops(served, range(21))
    assert await served.get(path) == (status, {"error": error})


@needs_ffmpeg
async def test_ffmpeg_plays_a_time_range_with_sound_to_the_end(tmp_path: Path) -> None:
    recording = write_flashes(tmp_path / "flashes.mp4", SOUNDING)
    record = {"folder": str(tmp_path / "kept"), "segment_s": 1.0}
    async for served in serve_site(record=record, http=HTTP_SETTINGS, sound={"source": str(recording)}):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        send_audio(served.service, recording)
        gops = SOUNDING // GOP
        decide_gops(served, range(gops))
        await wait_until_written(served, gops)
        out = tmp_path / "past.mp4"
        url = f"http://127.0.0.1:{served.port}/objects/1/hls/index.m3u8?from=p0&to=p{SOUNDING}"
        command = ["ffmpeg", "-v", "warning", "-i", url, "-c", "copy", str(out)]
        completed = await asyncio.to_thread(
            subprocess.run, command, capture_output=True, text=True, timeout=PATIENCE
        )
        assert (completed.returncode, completed.stderr) == (0, "")
        times, _ = decode_audio(out.read_bytes())
        assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
        assert times[-1] == pytest.approx(SOUNDING / FPS, abs=0.03)
        with av.open(str(out)) as container:
            assert sum(1 for _ in container.decode(video=0)) == SOUNDING


@needs_chromium
async def test_chromium_plays_a_time_range_to_the_end(served: ServedSite) -> None:
    decide_gops(served, range(20))
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{served.port}/healthz")
        playback = await page.evaluate(NATIVE_HLS_JS, "/objects/1/hls/index.m3u8?from=-2.4&to=-0.4")
    if playback is None:
        pytest.skip("this Chromium plays no HLS by itself")
    assert playback == {"end": "ended", "seconds": pytest.approx(2.0, abs=0.05)}
