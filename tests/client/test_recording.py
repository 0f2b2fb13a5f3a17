"""Recording the best view over real HTTP."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from aiohttp import web
from hypothesis import given, settings
from hypothesis import strategies as st

import client
from client.fmp4 import BoxReader
from client.media_stream import MediaStreamError
from fakes.http.scripted_server import (
    FPS,
    GOP,
    SITE,
    ScriptedSite,
    StreamScript,
    box,
    fragment,
    gop,
    header,
    send_nothing,
    sse_event,
)
from fakes.timeouts import PATIENCE

HASTY = client.HttpSettings(stream_retries=2, backoff_first=0.01, backoff_most=0.01)


def plays(*pieces: bytes, stays: bool = False, step: int = 1000) -> StreamScript:
    """Send the pieces; then disconnect, or stay connected."""

    async def play(response: web.StreamResponse) -> None:
        stream = b"".join(pieces)
        for at in range(0, len(stream), step):
            await response.write(stream[at : at + step])
        if stays:
            await send_nothing(response)

    return play


def frames(first: int, count: int) -> bytes:
    return b"".join(fragment(pulse) for pulse in range(first, first + count))


def only(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


async def test_the_requested_seconds_are_recorded_unchanged(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path
) -> None:
    scripted_site.video_scripts.append(plays(header(), frames(5000, 100), stays=True))
    out = tmp_path / "one.mp4"
    result = await client.record(site_url, 1, out, seconds=2.0)
    assert out.read_bytes() == header() + frames(5000, 50)
    assert (result.complete, result.fragments, result.bytes) == (True, 50, out.stat().st_size)
    assert result.seconds == pytest.approx(49 / FPS)
    assert only(tmp_path) == ["one.mp4"]


async def test_progress_names_the_camera_and_counts_the_cuts(
    scripted_site: ScriptedSite, site_url: str
) -> None:
    events_sent = asyncio.Event()

    async def tell(response: web.StreamResponse) -> None:
        cameras = ("c0", "c1", "c1", "c0")
        stream = b"".join(sse_event("gop", gop(100 + GOP * i, camera)) for i, camera in enumerate(cameras))
        await response.write(sse_event("site", SITE) + stream)
        events_sent.set()
        await send_nothing(response)

    async def play(response: web.StreamResponse) -> None:
        await events_sent.wait()
        await plays(header(), stays=False)(response)
        for pulse in range(100, 121):
            await response.write(fragment(pulse))
            await reported.acquire()
        await send_nothing(response)

    scripted_site.event_scripts.append(tell)
    scripted_site.video_scripts.append(play)
    reported = asyncio.Semaphore(0)
    reports: list[client.Progress] = []

    def report(progress: client.Progress) -> None:
        reports.append(progress)
        reported.release()

    async with asyncio.timeout(PATIENCE):
        result = await client.watch(site_url, 1, None, 20 / FPS, report)
    assert [progress.camera for progress in reports[-10:]] == ["c1"] * 5 + ["c0"] * 5
    assert [progress.seconds for progress in reports] == sorted(progress.seconds for progress in reports)
    assert result.cuts == 2
    assert result.out is None


async def test_a_recording_continues_after_an_interruption(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path
) -> None:
    half = fragment(110)[:30]
    scripted_site.video_scripts.extend(
        [plays(header(), frames(100, 10), half), plays(header(), frames(105, 45), stays=True)]
    )
    out = tmp_path / "one.mp4"
    result = await client.watch(site_url, 1, out, 1.0, settings=HASTY)
    assert out.read_bytes() == header() + frames(100, 25)
    assert (result.complete, result.reconnections) == (True, 1)


async def test_a_server_that_stays_away_leaves_the_recording_so_far(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path
) -> None:
    scripted_site.video_scripts.append(plays(header(), frames(100, 10)))
    result = await client.watch(site_url, 1, tmp_path / "one.mp4", 60.0, settings=HASTY)
    assert not result.complete
    assert (tmp_path / "one.mp4").read_bytes() == header() + frames(100, 10)
    assert scripted_site.opened == 1 + HASTY.stream_retries


async def test_a_stream_of_another_format_ends_the_recording(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path
) -> None:
    other = header(picture=b"640x480")
    scripted_site.video_scripts.extend([plays(header(), frames(100, 10)), plays(other, frames(110, 10))])
    result = await client.watch(site_url, 1, tmp_path / "one.mp4", 60.0, settings=HASTY)
    assert not result.complete
    assert (tmp_path / "one.mp4").read_bytes() == header() + frames(100, 10)


async def test_cancelling_keeps_the_recording_so_far(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path
) -> None:
    scripted_site.video_scripts.append(plays(header(), frames(100, 10), stays=True))
    enough = asyncio.Event()

    def report(progress: client.Progress) -> None:
        if progress.seconds >= 9 / FPS:
            enough.set()

    task = asyncio.create_task(client.watch(site_url, 1, tmp_path / "one.mp4", None, report))
    async with asyncio.timeout(PATIENCE):
        await enough.wait()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert task.cancelled()
    assert (tmp_path / "one.mp4").read_bytes() == header() + frames(100, 10)
    assert only(tmp_path) == ["one.mp4"]


async def test_an_unknown_object_leaves_no_file(site_url: str, tmp_path: Path) -> None:
    with pytest.raises(client.NotFoundError):
        await client.record(site_url, 7, tmp_path / "one.mp4")
    assert only(tmp_path) == []


async def test_a_failed_recording_leaves_an_older_file_alone(site_url: str, tmp_path: Path) -> None:
    (tmp_path / "one.mp4").write_bytes(b"older")
    with pytest.raises(client.AwayError, match="starting"):
        await client.record(site_url, 1, tmp_path / "one.mp4", settings=HASTY)
    assert (tmp_path / "one.mp4").read_bytes() == b"older"
    assert only(tmp_path) == ["one.mp4"]


@pytest.mark.parametrize(
    "noise",
    [
        b"<html>" * 100,
        fragment(1),
        header(units=0),
        header() + box(b"mdat", b"no moof"),
        header() + box(b"moof", b""),
        box(b"ftyp") + box(b"moov", box(b"trak")),
    ],
)
async def test_an_invalid_stream_is_an_error(
    scripted_site: ScriptedSite, site_url: str, tmp_path: Path, noise: bytes
) -> None:
    scripted_site.video_scripts.append(plays(noise, stays=True))
    with pytest.raises(client.ContractError, match=r"best\.mp4"):
        await client.record(site_url, 1, tmp_path / "one.mp4", settings=HASTY)
    assert only(tmp_path) == []


async def test_a_missing_folder_is_an_error(site_url: str, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        await client.record(site_url, 1, tmp_path / "nowhere" / "one.mp4")


@settings(deadline=None, max_examples=60)
@given(st.lists(st.binary(max_size=30), max_size=8), st.integers(1, 13))
def test_boxes_are_the_same_however_the_bytes_arrive(contents: list[bytes], step: int) -> None:
    stream = b"".join(box(b"free", content) for content in contents)
    reader = BoxReader()
    found = [one for at in range(0, len(stream), step) for one in reader.feed(stream[at : at + step])]
    assert [one.content for one in found] == contents


@settings(deadline=None, max_examples=60)
@given(st.binary(max_size=200))
def test_any_bytes_are_boxes_or_an_error(data: bytes) -> None:
    try:
        boxes = list(BoxReader().feed(data))
    except MediaStreamError:
        return
    assert sum(len(one.data) for one in boxes) <= len(data)
