"""The audio of every stream is gapless across cuts and losses, and within 40 ms of the pictures."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

import client
from fakes.media.audio import (
    BEEP_TIMES,
    FRAMES,
    GOPS,
    MAX_AV_OFFSET_S,
    access_units,
    audio_messages,
    beeps,
    decode_audio,
    flashes,
    packets,
    send_audio,
    write_flashes,
)
from fakes.media.browser_playback import PLAY_JS, play_in_chromium
from fakes.media.ffprobe import probed
from fakes.media.mpegts import check_counters, parse_packets
from fakes.programs import needs_chromium, needs_ffprobe
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    NO_REASON,
    SMALL,
    FedService,
    encoded,
    small_config,
    video,
)
from server.camera.audio import RecordedAudioSource
from server.config.sections import SoundSettings
from server.media.audio.aac import SAMPLES as FRAME
from server.media.containers.fmp4 import init_segment
from server.service.view_selection.decider import GopDecision, ObjectChoice


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that flashes and beeps."""
    return write_flashes(tmp_path_factory.mktemp("sound") / "flashes.mp4", FRAMES)


@pytest.fixture
async def site_with_audio(recording: Path) -> AsyncIterator[ServedSite]:
    """A site with the recording's audio."""
    async for served in serve_site(sound={"source": str(recording)}, http={"viewer_queue_gops": 100}):
        yield served


def decide(service: FedService, gop: int, camera: str | None) -> None:
    choice = ObjectChoice(1, camera, None, departed=False)
    service.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def watched(
    served: ServedSite, recording: Path, paths: list[str], lost: frozenset[int] = frozenset()
) -> list[bytes]:
    """Show the recording's pictures as alternating cameras; return the streams of these paths."""
    service = served.service
    service.connect_cameras(*CAMERAS)
    for camera in CAMERAS:
        for unit in access_units(recording):
            if unit.pulse not in lost:
                service.ingest.receive_video(video(camera, unit))
    decide(service, 0, A)
    answers = [await served.session.get(path) for path in paths]
    for gop in range(1, GOPS):
        decide(service, gop, CAMERAS[gop % 2])
        await asyncio.sleep(0.005)
    service.splicer.close()
    return [await answer.read() for answer in answers]


@pytest.mark.parametrize(("path", "kind"), [("best.mp4", "mp4"), ("best.ts", "mpegts")])
async def test_after_every_cut_a_beep_is_with_its_flash(
    site_with_audio: ServedSite, recording: Path, path: str, kind: str
) -> None:
    own = send_audio(site_with_audio.service, recording)
    (data,) = await watched(site_with_audio, recording, [f"/objects/1/{path}"])
    assert flashes(data, kind) == pytest.approx(BEEP_TIMES, abs=0.001)
    assert beeps(data, kind) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    if kind == "mp4":
        assert packets(data) == own[: len(packets(data))], "byte for byte the recording's"
        assert len(packets(data)) == FRAMES * 48_000 // FPS // FRAME


async def test_audio_has_no_gap_where_pictures_or_audio_are_missing(
    site_with_audio: ServedSite, recording: Path
) -> None:
    send_audio(site_with_audio.service, recording, silent=range(60, 80))
    lost = frozenset({13, *range(30, 45), 71})
    data, ts = await watched(site_with_audio, recording, ["/objects/1/best.mp4", "/objects/1/best.ts"], lost)
    for stream, kind in ((data, "mp4"), (ts, "mpegts")):
        times, samples = decode_audio(stream, kind)
        assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4), "without a gap"
        quiet = (times > 61 * FRAME / 48_000) & (times < 80 * FRAME / 48_000)
        assert quiet.sum() > 18 * FRAME
        assert not samples[quiet].any()
    check_counters(parse_packets(ts))


async def test_a_camera_stream_has_audio_at_once_or_silence_half_a_second_later(
    site_with_audio: ServedSite, recording: Path
) -> None:
    service = site_with_audio.service
    own = send_audio(service, recording, silent=range(60, 1000))
    service.connect_cameras(*CAMERAS)
    units = access_units(recording)
    service.ingest.receive_video(video(B, units[0]))
    answers = [await site_with_audio.session.get(f"/cameras/c1/live.{kind}") for kind in ("mp4", "ts")]
    for unit in units[1:]:
        service.ingest.receive_video(video(B, unit))
        await asyncio.sleep(0.002)
    service.splicer.close()
    data, ts = [await answer.read() for answer in answers]
    frames = packets(data)
    assert frames[:60] == own[:60]
    assert {*frames[60:]} == {service.config.sound.format.silence}  # type: ignore[union-attr]
    assert 0 <= FRAMES * 1.92 / FRAME * 1000 - len(frames) <= 0.5 * 48_000 / FRAME + 1, "half a second later"
    assert beeps(data) == beeps(ts, "mpegts") == pytest.approx(BEEP_TIMES[:1], abs=MAX_AV_OFFSET_S)
    check_counters(parse_packets(ts))


@pytest.mark.parametrize("parts", [0, 5])
async def test_segments_and_their_parts_have_the_audio_of_their_pictures(
    site_with_audio: ServedSite, recording: Path, parts: int
) -> None:
    send_audio(site_with_audio.service, recording)
    await watched(site_with_audio, recording, [])
    listed = await (await site_with_audio.session.get("/objects/1/hls/index.m3u8")).text()
    numbers = [line.removesuffix(".m4s") for line in listed.splitlines() if line.endswith(".m4s")]
    names = [f"{number}.{part}.m4s" for number in numbers for part in range(parts)] or [
        f"{number}.m4s" for number in numbers
    ]
    fetched = [
        await (await site_with_audio.session.get(f"/objects/1/hls/{name}")).read()
        for name in ("init.mp4", *names)
    ]
    data = b"".join(fetched)
    times, _ = decode_audio(data)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    began = int(numbers[0]) * 25 / FPS
    assert times[0] == pytest.approx(began, abs=0.022)
    assert flashes(data) == pytest.approx([time for time in BEEP_TIMES if time > began], abs=0.001)
    assert beeps(data) == pytest.approx([time for time in BEEP_TIMES if time > began], abs=MAX_AV_OFFSET_S)


async def test_all_streams_share_the_bytes_of_the_audio(site_with_audio: ServedSite, recording: Path) -> None:
    service = site_with_audio.service
    send_audio(service, recording)
    for camera in CAMERAS:
        for unit in encoded(0):
            service.ingest.receive_video(video(camera, unit))
    both = (ObjectChoice(1, A, None, departed=False), ObjectChoice(2, B, None, departed=False))
    service.splicer.publish_decision(GopDecision(0, GOP, both, {}, {}, (), NO_REASON))
    segmenters = [service.splicer.segmenter_of_person(number) for number in (1, 2)]
    one, two = [segmenter._segments[0]._chunks[0] for segmenter in segmenters if segmenter is not None]
    assert one.audio is not None
    assert one.audio is two.audio


async def test_a_site_without_audio_has_no_audio_track(served: ServedSite) -> None:
    service = served.service
    service.connect_cameras(*CAMERAS)
    for epoch in range(3):
        service.feed(epoch, {A: {1: SMALL}, B: {}})
    site = small_config().site
    parameters = service.stream_format.parameters
    assert parameters is not None
    answer = await served.session.get("/objects/1/best.mp4")
    head = await answer.content.readexactly(len(init_segment(parameters, site.width, site.height)))
    assert head == init_segment(parameters, site.width, site.height)
    assert b"soun" not in head
    assert (await answer.content.readexactly(8))[4:] == b"moof"
    assert (await served.get_json("/api/site"))["sound"] is None
    service.splicer.close()
    assert b"soun" not in await answer.read()


async def test_the_site_names_its_audio_codec_and_ignores_invalid_audio(site_with_audio: ServedSite) -> None:
    assert (await site_with_audio.get_json("/api/site"))["sound"] == "mp4a.40.2"
    (good,) = audio_messages(
        RecordedAudioSource(
            str(site_with_audio.service.config.sound.source), SoundSettings(source="x"), FPS, 0, "stop"
        ).until(5)
    )
    for bad in (
        b"",
        b"{}",
        b'{"first":-1,"sizes":[1]}',
        b'{"first":1,"sizes":[0]}',
        b'{"first":1,"sizes":[7]}',
    ):
        site_with_audio.service.ingest.receive_audio(type(good)(good.key, good.payload, bad))
    state = site_with_audio.service.ingest.states[A]
    assert state.bad_messages == 5, "of the camera that sends the audio"
    assert state.metrics.last_error is not None
    assert state.metrics.last_error.text.startswith("invalid message: audio: ")


async def test_in_videos_with_boxes_a_beep_is_with_its_flash(
    site_with_audio: ServedSite, recording: Path
) -> None:
    service = site_with_audio.service
    own = send_audio(service, recording)
    service.connect_cameras(*CAMERAS)
    for unit in access_units(recording):
        service.ingest.receive_video(video(A, unit))
    choice = ObjectChoice(1, A, None, departed=False)
    decisions = [GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON) for gop in range(GOPS)]
    service.decision_state.put(decisions[0])
    service.splicer.publish_decision(decisions[0])
    answer = await site_with_audio.session.get("/objects/1/best.mp4?overlay=1")
    assert answer.status == 200, await answer.text()
    for decision in decisions[1:]:
        service.splicer.publish_decision(decision)
        await asyncio.sleep(0.02)
    service.splicer.close()
    data = await answer.read()
    times, _ = decode_audio(data)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    assert (times[0], times[-1]) == (pytest.approx(0, abs=0.001), pytest.approx(FRAMES / FPS, abs=0.03))
    assert flashes(data) == pytest.approx(BEEP_TIMES, abs=0.001)
    assert beeps(data) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    assert packets(data) == own[: len(packets(data))]


@needs_ffprobe
async def test_ffprobe_reports_no_errors(
    site_with_audio: ServedSite, recording: Path, tmp_path: Path
) -> None:
    send_audio(site_with_audio.service, recording)
    paths = ["best.mp4", "best.ts"]
    for path, data in zip(
        paths,
        await watched(site_with_audio, recording, [f"/objects/1/{path}" for path in paths]),
        strict=True,
    ):
        (tmp_path / path).write_bytes(data)
        found = {stream[0]: int(stream[1]) for stream in probed(tmp_path / path, "codec_name,nb_read_frames")}
        assert found["h264"] == FRAMES
        assert found["aac"] >= FRAMES * 48_000 // FPS // FRAME


@needs_chromium
async def test_chromium_plays_both_to_the_end_where_either_is_missing(
    site_with_audio: ServedSite, recording: Path
) -> None:
    send_audio(site_with_audio.service, recording, silent=range(100, 1000))
    service = site_with_audio.service
    service.connect_cameras(*CAMERAS)
    for camera in CAMERAS:
        for unit in access_units(recording):
            if unit.pulse not in range(30, 45):
                service.ingest.receive_video(video(camera, unit))

    def show(gop: int) -> None:
        decide(service, gop, CAMERAS[gop % 2])

    decide(service, 0, A)
    parameters = service.stream_format.parameters
    assert parameters is not None
    played = await play_in_chromium(
        *(site_with_audio.port, service.splicer, GOPS, show),
        *(PLAY_JS, "/objects/1/best.mp4", f'video/mp4; codecs="{parameters.codec},mp4a.40.2"', 4),
    )
    assert (played["error"], played["ranges"], played["tracks"]) == ("", 1, [True, True])
    assert played["range"] == [0, pytest.approx(FRAMES / FPS, abs=0.03)]


async def test_a_recording_has_audio_from_its_first_picture_to_its_last(
    site_with_audio: ServedSite, recording: Path, tmp_path: Path
) -> None:
    service, out = site_with_audio.service, tmp_path / "one.mp4"
    send_audio(service, recording)
    service.connect_cameras(*CAMERAS)
    for camera in CAMERAS:
        for unit in access_units(recording):
            service.ingest.receive_video(video(camera, unit))
    decide(service, 0, A)
    decide(service, 1, A)
    recorded = asyncio.create_task(
        client.record(f"http://127.0.0.1:{site_with_audio.port}/", 1, out, seconds=3.3)
    )
    while not service.splicer.viewers:  # noqa: ASYNC110 — the client comes when it comes
        await asyncio.sleep(0.01)
    for gop in range(2, GOPS):
        decide(service, gop, CAMERAS[gop % 2])
        await asyncio.sleep(0.005)
    result = await recorded
    assert result.complete
    data, begin = out.read_bytes(), GOP / FPS
    expected = [moment - begin for moment in BEEP_TIMES if begin < moment < begin + 3.3]
    assert flashes(data) == pytest.approx(expected, abs=0.001)
    assert beeps(data) == pytest.approx(expected, abs=MAX_AV_OFFSET_S)
    times, _ = decode_audio(data)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    assert (times[0], times[-1]) == (pytest.approx(0, abs=0.025), pytest.approx(3.3, abs=0.025))
