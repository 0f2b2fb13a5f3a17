"""Players that people use: nothing to complain of, and pixel for pixel the cameras' own pictures."""

from __future__ import annotations

import asyncio
import re
import shutil
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass

import av
import numpy as np
import pytest
from cameras_by_hand import CAMERAS, FPS, HEIGHT, LARGE, SMALL, STRIDE, WIDTH, encoded, tracks, video, word
from halls import A, B, Hall, opened
from numpy.typing import NDArray

from benchmarks.browser import CHROMIUM, chromium
from server.wire.epochs import end_of_epoch

EPOCHS = 48
PATHS = ("/objects/1/best.mp4", "/objects/1/best.ts", "/cameras/c0/live.ts", "/objects/1/hls/index.m3u8")
STREAMS = len(PATHS) - 1
# ffmpeg reads the init segment again with each playlist, of its own live HLS too, and wonders about it.
OF_EVERY_PLAYLIST = re.compile(
    r"(\[.*\] Found duplicated MOOV Atom. Skipped it|    Last message repeated .*)\n"
)
NEVER = re.compile(r"$^")

needs_ffmpeg = pytest.mark.skipif(not shutil.which("ffmpeg"), reason="needs ffmpeg")
needs_mpv = pytest.mark.skipif(not shutil.which("mpv"), reason="needs mpv")


def feed(hall: Hall, epoch: int) -> None:
    """Send an epoch; the person is larger in the other camera every other GOP, so there are cuts."""
    sizes = {A: SMALL, B: LARGE} if epoch % 4 < 2 else {A: LARGE, B: SMALL}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed, EPOCHS * STRIDE)[epoch * STRIDE : (epoch + 1) * STRIDE]:
            hall.service.intake.video(video(camera, unit))
        hall.service.intake.tracks(tracks(word(camera, epoch, {1: sizes[camera]})))
    hall.service.pulse = end_of_epoch(epoch, STRIDE)
    hall.service.pulse0 = 1_800_000_000.0
    hall.service.decide()


@pytest.fixture
async def live() -> AsyncIterator[Hall]:
    """A site that runs at five times its rate, too fast for a window of HLS, and ends."""
    async for hall in opened(http={"hls_segment_s": 0.4, "hls_window_s": 60.0, "viewer_queue_gops": 100}):
        hall.service.come(*CAMERAS)
        for epoch in range(20):
            feed(hall, epoch)
        yield hall


@dataclass(frozen=True)
class Played:
    """What a player gave."""

    code: int | None
    output: bytes
    complaints: str


async def played(hall: Hall, *commands: Sequence[str]) -> list[Played]:
    """Run players, one for each of the paths, while the site goes on and ends."""
    pipe = asyncio.subprocess.PIPE
    players = [await asyncio.create_subprocess_exec(*it, stdout=pipe, stderr=pipe) for it in commands]
    ends = [asyncio.create_task(player.communicate()) for player in players]
    try:
        while hall.service.splicer.viewers < STREAMS:
            assert not any(end.done() for end in ends), await asyncio.wait(ends)
            await asyncio.sleep(0.01)
        for epoch in range(20, EPOCHS):
            await asyncio.sleep(STRIDE / FPS / 5)
            feed(hall, epoch)
        hall.service.splicer.close()
        said = await asyncio.gather(*ends)
    finally:
        for player in players:
            if player.returncode is None:
                player.kill()
        await asyncio.gather(*ends, return_exceptions=True)
    return [
        Played(player.returncode, output, complaints.decode())
        for player, (output, complaints) in zip(players, said, strict=True)
    ]


def own(camera: int) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("h264", "r")
    packets = [*(av.Packet(unit.data) for unit in encoded(camera, EPOCHS * STRIDE)), None]
    return [it.to_ndarray(format="yuv420p") for packet in packets for it in decoder.decode(packet)]


@needs_ffmpeg
async def test_ffmpeg_plays_across_cuts_and_reloads_without_a_warning(live: Hall) -> None:
    command = "ffmpeg -nostdin -v warning {} -i {} -f rawvideo -pix_fmt yuv420p -fps_mode passthrough pipe:1"
    urls = [f"http://127.0.0.1:{live.port}{path}" for path in PATHS]
    starts = ["-live_start_index 0" if "m3u8" in path else "" for path in PATHS]
    seen = await played(live, *(command.format(*it).split() for it in zip(starts, urls, strict=True)))
    alone = np.array([own(camera) for camera in range(2)])
    decided = live.service.decider._next_gop or 0
    for path, it in zip(PATHS, seen, strict=True):
        own_doing = OF_EVERY_PLAYLIST if "m3u8" in path else NEVER
        assert (it.code, own_doing.sub("", it.complaints)) == (0, ""), path
        pictures = np.frombuffer(it.output, np.uint8).reshape(-1, HEIGHT * 3 // 2, WIDTH)
        last = EPOCHS * STRIDE if "cameras" in path else decided
        first = last - len(pictures)
        assert first <= 20 * STRIDE, f"{path}: from where the player came, to the end"
        cameras = [int(np.array_equal(picture, alone[1, first + n])) for n, picture in enumerate(pictures)]
        for n, picture in enumerate(pictures):
            np.testing.assert_array_equal(picture, alone[cameras[n], first + n], f"{path}: pulse {first + n}")
        cuts = int(np.abs(np.diff(cameras)).sum())
        assert cuts == 0 if "cameras" in path else cuts >= 10, path


@needs_mpv
async def test_mpv_plays_to_the_end_without_a_warning(live: Hall) -> None:
    command = "mpv --no-config --vo=null --no-audio --untimed --msg-level=all=warn --no-terminal"
    urls = [f"http://127.0.0.1:{live.port}{path}" for path in PATHS]
    seen = await played(live, *([*command.split(), url] for url in urls))
    for path, it in zip(PATHS, seen, strict=True):
        assert (it.code, it.output + it.complaints.encode()) == (0, b""), path


HLS_BY_ITSELF = """async (url) => {
  const video = document.createElement('video');
  if (!video.canPlayType('application/vnd.apple.mpegurl')) return null;
  const end = new Promise((done) => {
    video.onended = () => done('ended');
    video.onerror = () => done(video.error.message);
  });
  video.muted = true;
  video.src = url;  // at its own rate: what is live can be played at no other
  await video.play();
  return { end: await end, seconds: video.currentTime };
}"""


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a Chromium at {CHROMIUM}")
async def test_chromium_plays_hls_by_itself_up_to_the_end(live: Hall) -> None:
    async with chromium() as browser:
        page = await browser.new_page(bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{live.port}/healthz")
        playing = asyncio.create_task(page.evaluate(HLS_BY_ITSELF, "/objects/1/hls/index.m3u8"))
        async with asyncio.timeout(60):
            for epoch in range(20, EPOCHS):
                await asyncio.sleep(STRIDE / FPS / 5)
                feed(live, epoch)
            live.service.splicer.close()
            seen = await playing
    if seen is None:
        pytest.skip("this Chromium plays no HLS by itself")
    assert seen["end"] == "ended"
    assert seen["seconds"] > 2, "players begin some segments before the end"
