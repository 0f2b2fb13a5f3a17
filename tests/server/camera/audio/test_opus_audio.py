"""Opus audio: passed through byte for byte, other audio encoded to it, in sync within 40 ms."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import client
from benchmarks.common.browser import chromium
from fakes.media.audio import (
    BEEP_TIMES,
    FLASH_INTERVAL,
    FRAMES,
    GOPS,
    MAX_AV_OFFSET_S,
    access_units,
    beeps,
    decode_audio,
    flashes,
    packets,
    send_audio,
    write_flashes,
)
from fakes.media.browser_playback import PLAY_JS
from fakes.media.ffprobe import probed
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffprobe
from fakes.service.fed_site import A, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, NO_REASON, video
from server.camera.audio import EncodedAudioFrame, RecordedAudioSource
from server.camera.audio.encoder import AudioEncoder
from server.camera.audio.passthrough import AudioPassthrough
from server.config.loader import build_config
from server.config.sections import SoundSettings
from server.media.audio.audio_format import AudioFormat
from server.media.audio.opus import packet_samples
from server.media.containers.mp4_audio import audio_fragment, audio_init_segment
from server.service.view_selection.decider import GopDecision, ObjectChoice
from server.system.errors import UserError

STEREO = SoundSettings(source="here", codec="opus")
FORM = AudioFormat(48_000, 2, "opus")


def as_mp4(frames: list[EncodedAudioFrame]) -> bytes:
    """Return the frames as a stream from frame 0 on; missing ones are silent."""
    found = {frame.number: frame.data for frame in frames}
    data = [found.get(number, FORM.silence) for number in range(max(found) + 1)]
    return audio_init_segment(FORM) + audio_fragment(FORM, data, 0)


@pytest.mark.parametrize("name", ["own.mp4", "own.mkv"])
def test_opus_is_passed_on_byte_for_byte(tmp_path: Path, name: str) -> None:
    path = write_flashes(tmp_path / name, FRAMES, codec="libopus")
    sound = RecordedAudioSource(str(path), STEREO, FPS, 0, "stop")
    with av.open(str(path)) as container:
        own = [
            bytes(packet)
            for packet in container.demux(audio=0)
            if packet.size and packet.pts is not None and packet.pts >= 0
        ]
    frames = [*sound.until(0), *sound.until(FRAMES + 10)]
    assert [frame.data for frame in frames] == own
    first = frames[0].number
    assert first <= 1, "the encoder delay is before the first picture"
    assert [frame.number for frame in frames] == list(range(first, first + len(own)))
    assert beeps(as_mp4(frames)) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)


@pytest.mark.parametrize(
    ("name", "codec", "rate", "channels", "options"),
    [
        ("aac.mp4", "aac", 48_000, 2, {}),
        ("mp3.mkv", "mp3", 32_000, 1, {}),
        ("mono.mkv", "libopus", 48_000, 1, {}),
        ("long.mkv", "libopus", 48_000, 2, {"frame_duration": "60"}),
        ("short.mkv", "libopus", 48_000, 2, {"frame_duration": "10"}),
    ],
)
def test_other_codecs_are_encoded_to_opus(
    tmp_path: Path, name: str, codec: str, rate: int, channels: int, options: dict[str, str]
) -> None:
    path = write_flashes(tmp_path / name, FRAMES, codec=codec, rate=rate, channels=channels, options=options)
    sound = RecordedAudioSource(str(path), STEREO, FPS, 0, "stop")
    frames = [*sound.until(0), *sound.until(FRAMES + 10)]
    encoder = getattr(sound._framer, "_framer", sound._framer)
    assert isinstance(encoder, AudioEncoder)
    assert {packet_samples(frame.data) for frame in frames} == {960}
    assert beeps(as_mp4(frames)) == pytest.approx(BEEP_TIMES, abs=0.005), "the encoder delay is compensated"


def test_a_site_of_aac_encodes_opus(tmp_path: Path) -> None:
    path = write_flashes(tmp_path / "own.mkv", 2 * FLASH_INTERVAL, codec="libopus")
    sound = RecordedAudioSource(str(path), SoundSettings(source="here"), FPS, 0, "stop")
    assert isinstance(sound._framer, AudioEncoder)
    assert not isinstance(
        RecordedAudioSource(str(path), STEREO, FPS, 0, "stop")._framer, AudioEncoder | AudioPassthrough
    )


@pytest.mark.parametrize("channels", [1, 2])
def test_silence_decodes_to_zero_samples(channels: int) -> None:
    form = AudioFormat(48_000, channels, "opus")
    data = audio_init_segment(form) + audio_fragment(form, [form.silence] * 20, 7)
    times, samples = decode_audio(data)
    assert times[0] == pytest.approx(7 * 0.02)
    assert len(samples) == 20 * 960
    assert not samples.any()


@pytest.mark.parametrize("lasts", ["2.5", "5", "10", "20", "40", "60"])
@pytest.mark.parametrize("purpose", ["audio", "voip", "lowdelay"])
def test_the_length_of_a_packet_is_parsed(lasts: str, purpose: str) -> None:
    encoder = av.CodecContext.create("libopus", "w")
    encoder.sample_rate, encoder.layout, encoder.format = 48_000, "mono", "s16"
    encoder.options = {"frame_duration": lasts, "application": purpose}
    encoder.open()
    noise = np.random.default_rng(1).integers(-9000, 9000, (1, 48_000), dtype=np.int16)
    frame = av.AudioFrame.from_ndarray(noise, format="s16", layout="mono")
    frame.sample_rate = 48_000
    fifo = av.AudioFifo()
    fifo.write(frame)
    size = round(48 * float(lasts))
    for piece in fifo.read_many(size):
        assert {packet_samples(bytes(packet)) for packet in encoder.encode(piece)} <= {size}


@given(st.binary(max_size=8))
def test_arbitrary_bytes_have_some_length_or_none(data: bytes) -> None:
    assert 0 <= packet_samples(data) <= 63 * 2880


def test_another_rate_is_refused_in_one_line(tmp_path: Path) -> None:
    content = {
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "sound": {"source": "c0", "codec": "opus", "rate": 44_100},
    }
    with pytest.raises(UserError, match=r"codec: opus has 48000 samples a second; rate is 44100"):
        build_config(content, where="hall", folder=tmp_path)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that flashes and beeps."""
    return write_flashes(tmp_path_factory.mktemp("opus") / "flashes.mkv", FRAMES, codec="libopus")


@pytest.fixture
async def served(recording: Path, tmp_path: Path) -> AsyncIterator[ServedSite]:
    """A site with the recording's audio, whose first GOP is decided."""
    record = {"folder": str(tmp_path / "kept"), "segment_s": 0.4}
    sound = {"source": str(recording), "codec": "opus"}
    async for served in serve_site(sound=sound, record=record, http={"viewer_queue_gops": 100}):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for camera in CAMERAS:
            for unit in access_units(recording):
                served.service.ingest.receive_video(video(camera, unit))
        yield served


def decide(served: ServedSite, gops: range) -> None:
    for gop in gops:
        choice = ObjectChoice(1, CAMERAS[gop % 2], None, departed=False)
        decision = GopDecision(gop * GOP, GOP, (choice,), {A: []}, {}, (), NO_REASON)
        served.service.recorder.put(served.service.decision_state.put(decision), None)
        served.service.splicer.publish_decision(decision)


async def watched(served: ServedSite, *urls: str) -> list[bytes]:
    decide(served, range(1))
    answers = [await served.session.get(url) for url in urls]
    for gop in range(1, GOPS):
        decide(served, range(gop, gop + 1))
        await asyncio.sleep(0.005)
    served.service.splicer.close()
    return [await answer.read() for answer in answers]


async def test_live_and_recorded_streams_have_opus_in_sync_and_transport_streams_no_audio(
    served: ServedSite, recording: Path
) -> None:
    own = send_audio(served.service, recording)
    assert (await served.get_json("/api/site"))["sound"] == "opus"
    live, ts = await watched(served, "/objects/1/best.mp4", "/objects/1/best.ts")
    while served.service.recorder.writer is not None and served.service.recorder.writer.written < GOPS:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    assert served.service.audio_buffer is not None
    served.service.audio_buffer._frames.clear()
    async with served.session.get(f"/objects/1/best.mp4?from=p0&to=p{FRAMES}") as answer:
        past = await answer.read()
    for data in (live, past):
        times, _ = decode_audio(data)
        assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
        assert flashes(data) == pytest.approx(BEEP_TIMES, abs=0.001)
        assert beeps(data) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
        got = packets(data)
        assert got[1:] == own[: len(got) - 1], "the first is from before the first picture"
    assert flashes(ts, "mpegts") == pytest.approx(BEEP_TIMES, abs=0.001)
    with av.open(io.BytesIO(ts), format="mpegts") as container:
        assert not container.streams.audio


@needs_ffprobe
async def test_ffprobe_reports_no_audio_errors(served: ServedSite, recording: Path, tmp_path: Path) -> None:
    send_audio(served.service, recording)
    live, ts = await watched(served, "/objects/1/best.mp4", "/objects/1/best.ts")
    (tmp_path / "live.mp4").write_bytes(live)
    (tmp_path / "live.ts").write_bytes(ts)
    found = {
        stream[0]: int(stream[1]) for stream in probed(tmp_path / "live.mp4", "codec_name,nb_read_frames")
    }
    assert found == {"h264": FRAMES, "opus": FRAMES * 2}
    assert {stream[0] for stream in probed(tmp_path / "live.ts", "codec_name,nb_read_frames")} == {"h264"}


@needs_ffprobe
async def test_a_download_contains_opus_audio(served: ServedSite, recording: Path, tmp_path: Path) -> None:
    send_audio(served.service, recording)
    decide(served, range(GOPS))
    out, url = tmp_path / "one.mp4", f"http://127.0.0.1:{served.port}/"
    await client.watch(url, 1, out, start="p0", end=f"p{FRAMES}")
    data = out.read_bytes()
    assert flashes(data) == pytest.approx(BEEP_TIMES, abs=0.001)
    assert beeps(data) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    assert [stream[0] for stream in probed(out, "codec_name,nb_read_frames")] == ["h264", "opus"]


@needs_chromium
async def test_chromium_plays_opus(served: ServedSite, recording: Path) -> None:
    send_audio(served.service, recording)
    decide(served, range(GOPS))
    parameters = served.service.stream_format.parameters
    assert parameters is not None
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{served.port}/healthz")
        url = f"/objects/1/best.mp4?from=p0&to=p{FRAMES}"
        played = await page.evaluate(PLAY_JS, [url, f'video/mp4; codecs="{parameters.codec},opus"', 4])
    assert (played["error"], played["ranges"], played["tracks"]) == ("", 1, [True, True])
    assert played["range"] == [0, pytest.approx(FRAMES / FPS, abs=0.03)]
