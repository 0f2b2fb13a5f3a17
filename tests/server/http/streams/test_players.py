"""Common players play without warnings, and show the cameras' pictures pixel by pixel."""

from __future__ import annotations

import asyncio
import os
import re
import tempfile
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.common.browser import chromium
from fakes.media.browser_playback import NATIVE_HLS_JS
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffmpeg, needs_mpv, needs_vlc
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    HEIGHT,
    LARGE,
    SMALL,
    STRIDE,
    WIDTH,
    camera_tracks,
    encoded,
    tracks,
    video,
)
from fakes.timeouts import PATIENCE
from server.messaging.epochs import end_of_epoch

EPOCHS = 48
PATHS = ("/objects/1/best.mp4", "/objects/1/best.ts", "/cameras/c0/live.ts", "/objects/1/hls/index.m3u8")
STREAMS = len(PATHS) - 1
# ffmpeg rereads the init segment with each playlist, even of its own live HLS, and warns about it.
OF_EVERY_PLAYLIST = re.compile(
    r"(\[.*\] Found duplicated MOOV Atom. Skipped it|    Last message repeated .*)\n"
)
NEVER = re.compile(r"$^")
# VLC also warns about missing audio devices, settings and graphics cards.
OF_A_STREAM = re.compile(
    r"^.* (?:access|stream|demux|packetizer|input|adaptive\S*) (?:warning|error): .*$", re.MULTILINE
)
# In fragmented MP4 the table of pictures is empty, in VLC's eyes a thing to mention.
OF_EVERY_FRAGMENT = re.compile(r"no chunk defined|STTS table of 0 entries")


def feed(served: ServedSite, epoch: int) -> None:
    """Send an epoch; the person is larger in the other camera every other GOP, so there are cuts."""
    sizes = {A: SMALL, B: LARGE} if epoch % 4 < 2 else {A: LARGE, B: SMALL}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed, EPOCHS * STRIDE)[epoch * STRIDE : (epoch + 1) * STRIDE]:
            served.service.ingest.receive_video(video(camera, unit))
        served.service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, {1: sizes[camera]})))
    served.service.pulses.newest = end_of_epoch(epoch, STRIDE)
    served.service.pulses.pulse0 = 1_800_000_000.0
    served.service.decide()


@pytest.fixture
async def ending_site() -> AsyncIterator[ServedSite]:
    """A site that runs at five times its rate, too fast for a window of HLS, and ends."""
    async for served in serve_site(
        http={"hls_segment_s": 0.4, "hls_window_s": 60.0, "viewer_queue_gops": 100}
    ):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(20):
            feed(served, epoch)
        yield served


@dataclass(frozen=True)
class PlayerOutput:
    """The output of a player."""

    code: int | None
    output: bytes
    complaints: str


async def run_players(
    served: ServedSite, *commands: Sequence[str], user: str | None = None
) -> list[PlayerOutput]:
    """Run a player for each path while the site runs and ends."""
    pipe = asyncio.subprocess.PIPE
    players = [
        await asyncio.create_subprocess_exec(*command, stdout=pipe, stderr=pipe, user=user)
        for command in commands
    ]
    ends = [asyncio.create_task(player.communicate()) for player in players]
    try:
        while served.service.splicer.viewers < STREAMS:
            assert not any(end.done() for end in ends), await asyncio.wait(ends)
            await asyncio.sleep(0.01)
        for epoch in range(20, EPOCHS):
            await asyncio.sleep(STRIDE / FPS / 5)
            feed(served, epoch)
        served.service.splicer.close()
        results = await asyncio.gather(*ends)
    finally:
        for player in players:
            if player.returncode is None:
                player.kill()
        await asyncio.gather(*ends, return_exceptions=True)
    return [
        PlayerOutput(player.returncode, output, complaints.decode())
        for player, (output, complaints) in zip(players, results, strict=True)
    ]


def decoded_alone(camera: int) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("h264", "r")
    packets = [*(av.Packet(unit.data) for unit in encoded(camera, EPOCHS * STRIDE)), None]
    return [frame.to_ndarray(format="yuv420p") for packet in packets for frame in decoder.decode(packet)]


def check_pictures(served: ServedSite, path: str, output: bytes) -> None:
    """Find each picture that was shown, none left out, up to the last, in one of the cameras."""
    alone = np.array([decoded_alone(camera) for camera in range(2)])
    pictures = np.frombuffer(output, np.uint8).reshape(-1, HEIGHT * 3 // 2, WIDTH)
    last = end_of(served, path)
    first = last - len(pictures)
    assert first <= 20 * STRIDE, f"{path}: from its first picture to the end"
    cameras = [int(np.array_equal(picture, alone[1, first + n])) for n, picture in enumerate(pictures)]
    for n, picture in enumerate(pictures):
        np.testing.assert_array_equal(picture, alone[cameras[n], first + n], f"{path}: pulse {first + n}")
    cuts = int(np.abs(np.diff(cameras)).sum())
    assert cuts == 0 if "cameras" in path else cuts >= 10, path


def end_of(served: ServedSite, path: str) -> int:
    """Return the first pulse that a stream does not show."""
    return EPOCHS * STRIDE if "cameras" in path else served.service.decider._next_gop or 0


@needs_ffmpeg
async def test_ffmpeg_plays_across_cuts_and_reloads_without_a_warning(ending_site: ServedSite) -> None:
    command = "ffmpeg -nostdin -v warning {} -i {} -f rawvideo -pix_fmt yuv420p -fps_mode passthrough pipe:1"
    urls = [f"http://127.0.0.1:{ending_site.port}{path}" for path in PATHS]
    starts = ["-live_start_index 0" if "m3u8" in path else "" for path in PATHS]
    outputs = await run_players(
        ending_site, *(command.format(*start).split() for start in zip(starts, urls, strict=True))
    )
    for path, player in zip(PATHS, outputs, strict=True):
        own_doing = OF_EVERY_PLAYLIST if "m3u8" in path else NEVER
        assert (player.code, own_doing.sub("", player.complaints)) == (0, ""), path
        check_pictures(ending_site, path, player.output)


@needs_mpv
async def test_mpv_plays_to_the_end_without_a_warning(ending_site: ServedSite) -> None:
    command = "mpv --no-config --vo=null --no-audio --untimed --msg-level=all=warn --no-terminal"
    urls = [f"http://127.0.0.1:{ending_site.port}{path}" for path in PATHS]
    outputs = await run_players(ending_site, *([*command.split(), url] for url in urls))
    for path, player in zip(PATHS, outputs, strict=True):
        assert (player.code, player.output + player.complaints.encode()) == (0, b""), path


@pytest.fixture
def shared_folder() -> Iterator[Path]:
    """A world-writable folder: VLC does not run as root."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        yield Path(folder)


VLC = (
    "cvlc --no-audio --no-drop-late-frames --no-skip-frames --no-osd --play-and-exit "
    "--no-video-title-show --verbose 1 --vout yuv --yuv-file={} {} vlc://quit"
)


def check_order(served: ServedSite, path: str, pictures: list[bytes]) -> None:
    """Find each picture in a camera; a player may repeat or skip pictures, but not go back."""
    frame_of_picture = {
        picture.tobytes(): (pulse, camera)
        for camera in range(2)
        for pulse, picture in enumerate(decoded_alone(camera))
    }
    assert len(frame_of_picture) == 2 * EPOCHS * STRIDE, "all pictures differ"
    shown = [frame_of_picture[picture] for picture in pictures]
    pulses = [pulse for pulse, _ in shown]
    assert all(before <= after for before, after in pairwise(pulses)), path
    assert pulses[0] <= 20 * STRIDE, path
    assert pulses[-1] >= end_of(served, path) - STRIDE, path
    assert len(set(pulses)) > 0.8 * (pulses[-1] - pulses[0]), path
    cuts = sum(before != after for (_, before), (_, after) in pairwise(shown))
    assert cuts == 0 if "cameras" in path else cuts >= 10, path


def pictures_of(film: bytes) -> list[bytes]:
    """Return the pictures of a YUV4MPEG2 stream (a header line, and a line before each picture)."""
    _, _, rest = film.partition(b"\n")
    mark = b"FRAME\n"
    whole = len(mark) + WIDTH * HEIGHT * 3 // 2
    pieces = [rest[at : at + whole] for at in range(0, len(rest), whole)]
    assert all(piece.startswith(mark) and len(piece) == whole for piece in pieces)
    return [piece.removeprefix(mark) for piece in pieces]


@needs_vlc
@pytest.mark.slow  # plays in real time: faster, it drops pictures on a busy machine
async def test_vlc_plays_across_cuts_without_a_warning(ending_site: ServedSite, shared_folder: Path) -> None:
    files = [shared_folder / f"{number}.yuv" for number in range(len(PATHS))]
    urls = [f"http://127.0.0.1:{ending_site.port}{path}" for path in PATHS]
    user = "nobody" if os.geteuid() == 0 else None
    commands = [VLC.format(shown, url).split() for shown, url in zip(files, urls, strict=True)]
    outputs = await run_players(ending_site, *commands, user=user)
    for path, player, shown in zip(PATHS, outputs, files, strict=True):
        complaints = [
            line for line in OF_A_STREAM.findall(player.complaints) if not OF_EVERY_FRAGMENT.search(line)
        ]
        assert (player.code, complaints) == (0, []), path
        check_order(ending_site, path, pictures_of(shown.read_bytes()))


@needs_chromium
async def test_chromium_plays_hls_natively_to_the_end(ending_site: ServedSite) -> None:
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{ending_site.port}/healthz")
        playing = asyncio.create_task(page.evaluate(NATIVE_HLS_JS, "/objects/1/hls/index.m3u8"))
        async with asyncio.timeout(PATIENCE):
            for epoch in range(20, EPOCHS):
                await asyncio.sleep(STRIDE / FPS / 5)
                feed(ending_site, epoch)
            ending_site.service.splicer.close()
            outputs = await playing
    if outputs is None:
        pytest.skip("this Chromium plays no HLS by itself")
    assert outputs["end"] == "ended"
    assert outputs["seconds"] > 2, "players begin some segments before the end"
