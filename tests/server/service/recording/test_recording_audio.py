"""The site's audio is recorded once, indexed by frame number, and played with all recorded pictures."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.audio import (
    BEEP_TIMES,
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
from fakes.media.ffprobe import probed
from fakes.media.mpegts import check_counters, parse_packets
from fakes.programs import needs_ffprobe
from fakes.service.fed_site import A, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, NO_REASON, FedService, video
from fakes.service.scripted_recordings import PULSE0, UNLIMITED, ManualClocks, gop_record, session_info
from server.media.audio.aac import SAMPLES as FRAME
from server.media.audio.audio_chunk import AudioChunk
from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import audio_fragment
from server.messaging.messages import GopChoices
from server.service.recording.recording_folder import GopRecord, RecordingFolder
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments
from server.service.time_shift.playback_audio import read_audio_frames
from server.service.view_selection.decider import GopDecision, ObjectChoice

FORM = AudioFormat(48_000, 2)
PATIENT = {"viewer_queue_gops": 100}  # with a slow reader


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that flashes and beeps."""
    return write_flashes(tmp_path_factory.mktemp("sound") / "flashes.mp4", FRAMES)


@pytest.fixture
async def served(recording: Path, tmp_path: Path) -> AsyncIterator[ServedSite]:
    """A site with that sound, which records into segments of two GOPs."""
    record = {"folder": str(tmp_path / "kept"), "segment_s": 0.4}
    async for served in serve_site(
        sound={"source": str(recording)}, record=record, http={"viewer_queue_gops": 100}
    ):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        yield served


def decide_gops(
    served: ServedSite, recording: Path, gops: range, choices: Mapping[int, str | None] | None = None
) -> None:
    """Decide some GOPs of the recording: person 1 is in either camera in turn, or as in ``choices``."""
    service = served.service
    for gop in gops:
        for camera in CAMERAS:
            for unit in access_units(recording)[gop * GOP : (gop + 1) * GOP]:
                service.ingest.receive_video(video(camera, unit))
        camera = CAMERAS[gop % 2] if choices is None else choices[gop]
        choices_of_gop = GopChoices(
            first=gop * GOP, frames=GOP, choices={} if camera is None else {1: camera}, boxes={}, cuts=[]
        )
        service.recorder.put(choices_of_gop, PULSE0)
        choice = ObjectChoice(1, camera, None, departed=False)
        service.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def until_written(service: FedService, gops: int) -> None:
    while service.recorder.writer is not None and service.recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)


def drop_from_memory(service: FedService) -> None:
    """Drop all but the last GOPs' pictures and audio from memory."""
    assert service.audio_buffer is not None
    service.recorder.recent._frames = GOP
    for number in list(service.audio_buffer._frames)[:-20]:
        del service.audio_buffer._frames[number]


async def download(served: ServedSite, path: str) -> bytes:
    async with served.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        return await answer.read()


def check_no_audio_gap(stream: bytes, kind: str | None = None) -> tuple[float, float]:
    """Assert that the audio has no gap; return its first and last time."""
    times, _ = decode_audio(stream, kind)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    return float(times[0]), float(times[-1])


async def test_in_a_recording_each_beep_is_with_its_flash_in_any_file(
    served: ServedSite, recording: Path
) -> None:
    own = send_audio(served.service, recording)
    decide_gops(served, recording, range(GOPS))
    await until_written(served.service, GOPS)
    drop_from_memory(served.service)
    data = await download(served, f"/objects/1/best.mp4?from=p7&to=p{FRAMES - 2}")
    assert flashes(data) == pytest.approx(BEEP_TIMES, abs=0.001)
    assert beeps(data) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    assert check_no_audio_gap(data) == (
        pytest.approx(GOP / FPS, abs=0.022),
        pytest.approx(FRAMES / FPS, abs=0.1),
    )
    begin = FORM.frame_at(GOP, FPS)
    assert packets(data) == own[begin : begin + len(packets(data))], "byte for byte the recording's"
    camera = await download(served, f"/cameras/c1/live.mp4?from=p0&to=p{FRAMES}")
    assert beeps(camera) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)


@pytest.mark.parametrize(
    "path", ["/objects/1/best.mp4", "/cameras/c0/live.mp4", "/objects/1/best.ts", "/cameras/c0/live.ts"]
)
async def test_audio_has_no_gap_where_a_recording_meets_the_live_stream(
    served: ServedSite, recording: Path, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.service.time_shift.time_shift_stream._LEAD_S", 60.0)
    service, half = served.service, GOPS // 2
    own = send_audio(service, recording)
    decide_gops(served, recording, range(half))
    await until_written(service, half)
    async with served.session.get(f"{path}?from=p0") as answer:
        while not service.splicer.viewers:  # noqa: ASYNC110 — the past is sent first
            await asyncio.sleep(0.001)
        for gop in range(half, GOPS):
            decide_gops(served, recording, range(gop, gop + 1))
            await asyncio.sleep(0.005)
        service.splicer.close()
        data = await answer.read()
    kind = "mpegts" if path.endswith("ts") else "mp4"
    assert flashes(data, kind) == pytest.approx(BEEP_TIMES, abs=0.001)
    assert beeps(data, kind) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    assert check_no_audio_gap(data, kind)[1] == pytest.approx(FRAMES / FPS, abs=0.03)
    if kind == "mpegts":
        check_counters(parse_packets(data))
    else:
        assert packets(data) == own[: len(packets(data))]


async def test_audio_continues_where_no_picture_is_shown_for_long(
    served: ServedSite, recording: Path
) -> None:
    send_audio(served.service, recording)
    choices = {gop: A if gop < 2 or gop >= GOPS - 2 else None for gop in range(GOPS)}
    decide_gops(served, recording, range(GOPS), choices)
    await until_written(served.service, GOPS)
    drop_from_memory(served.service)
    data = await download(served, f"/objects/1/best.mp4?from=p0&to=p{FRAMES}")
    assert beeps(data) == pytest.approx(BEEP_TIMES, abs=MAX_AV_OFFSET_S)
    assert check_no_audio_gap(data)[1] == pytest.approx(FRAMES / FPS, abs=0.03)


async def test_audio_that_was_deleted_or_not_recorded_is_silent(served: ServedSite, recording: Path) -> None:
    send_audio(served.service, recording, silent=range(30, 60))
    decide_gops(served, recording, range(GOPS))
    await until_written(served.service, GOPS)
    drop_from_memory(served.service)
    session = served.service.recorder.session
    assert session is not None
    deleted = session.segments[6].first
    session.paths.audio_file(deleted).unlink()
    data = await download(served, f"/objects/1/best.mp4?from=p0&to=p{FRAMES}")
    check_no_audio_gap(data)
    _, samples = decode_audio(data)
    assert not samples[31 * FRAME : 59 * FRAME].any()
    assert not samples[(deleted + 1) * 1920 + FRAME : (deleted + 2 * GOP) * 1920 - 2 * FRAME].any()
    silent = {*range(round(30 * FRAME / 1920), round(60 * FRAME / 1920)), *range(deleted, deleted + 2 * GOP)}
    kept = [at for at in BEEP_TIMES if round(at * FPS) not in silent]
    # The frame before the deleted part has the start of a beep: AAC frames overlap.
    assert [beep for beep in beeps(data) if abs(beep - deleted / FPS) > MAX_AV_OFFSET_S] == pytest.approx(
        kept, abs=MAX_AV_OFFSET_S
    )


async def test_the_audio_of_an_earlier_session_plays_after_a_restart(recording: Path, tmp_path: Path) -> None:
    record = {"folder": str(tmp_path / "kept"), "segment_s": 0.4}
    for gops in (range(GOPS - 1), range(GOPS - 1, GOPS)):
        async for served in serve_site(
            sound={"source": str(recording)}, record=record, http={"viewer_queue_gops": 100}
        ):
            served.service.pulses.pulse0 = PULSE0
            served.service.recorder.open()
            served.service.connect_cameras(*CAMERAS)
            if not gops.start:
                send_audio(served.service, recording)
            decide_gops(served, recording, gops)
            await until_written(served.service, len(gops))
            if gops.start:
                data = await download(served, f"/cameras/c0/live.mp4?from=p0&to=p{FRAMES}")
                assert beeps(data) == pytest.approx(
                    [time for time in BEEP_TIMES if time < FRAMES / FPS - 0.2], abs=MAX_AV_OFFSET_S
                )
                check_no_audio_gap(data)


async def test_audio_is_deleted_with_its_segments(tmp_path: Path) -> None:
    clocks = ManualClocks()
    store = RecordingFolder(tmp_path, RetentionLimits(keep_s=2.0, max_mb=1e6, segment_s=0.4), clocks.machine)
    store.open()
    for gop in range(GOPS):
        clocks.now = PULSE0 + gop * GOP / FPS
        record = gop_record(gop, {1: A})
        begin, end = (FORM.frame_at(pulse, FPS) for pulse in (gop * GOP, (gop + 1) * GOP))
        chunk = AudioChunk(begin, tuple(bytes([number % 251]) * 9 for number in range(begin, end)), FORM)
        store.write(
            GopRecord(record.choices, record.cameras, chunk),
            session_info(),
            InitSegments(b"pictures", b"sound"),
        )
    session = store.session
    assert session is not None
    firsts = [segment.first for segment in session.segments]
    assert firsts[0] > 0
    assert sorted(int(path.stem) for path in (session.folder / "sound").glob("0*.mp4")) == firsts
    assert session.audio.index.all[0].first == firsts[0]
    assert session.size == pytest.approx(
        sum(path.stat().st_size for path in session.folder.rglob("*") if path.is_file()), abs=3000
    )
    store.close()
    reopened = RecordingFolder(tmp_path, UNLIMITED)
    reopened.open()
    assert reopened.earlier[0].audio.index.all == session.audio.index.all


@needs_ffprobe
async def test_the_audio_playlist_plays_from_the_disk(served: ServedSite, recording: Path) -> None:
    send_audio(served.service, recording)
    decide_gops(served, recording, range(GOPS))
    await until_written(served.service, GOPS)
    session = served.service.recorder.session
    assert session is not None
    for path in (session.audio.path, session.paths.audio_file(0)):
        ((codec, frames, *_),) = probed(path, "codec_name,nb_read_frames")
        assert codec == "aac"
        assert int(frames) >= 18


async def test_a_site_without_audio_records_none(tmp_path: Path, recording: Path) -> None:
    async for served in serve_site(record={"folder": str(tmp_path / "kept"), "segment_s": 0.4}):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        decide_gops(served, recording, range(4))
        await until_written(served.service, 4)
        session = served.service.recorder.session
        assert session is not None
        assert not (session.folder / "sound").exists()
        assert not session.audio.path.exists()
        assert b"soun" not in await download(served, "/objects/1/best.mp4?from=p0&to=p20")


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_of_a_damaged_file_the_readable_frames_are_read(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "sound.mp4"
    content = bytearray(b"".join(audio_fragment(FORM, [b"abc", b"de"], 2 * number) for number in range(4)))
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    found = read_audio_frames(path, 0, data.draw(st.integers(0, len(content))), 0, 8, FORM)
    assert found.keys() <= set(range(8))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.binary(min_size=1, max_size=40), max_size=6), min_size=1, max_size=8),
    st.integers(0, 5),
    st.data(),
)
def test_audio_frames_are_read_by_their_numbers(
    tmp_path_factory: pytest.TempPathFactory, written: list[list[bytes]], first: int, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("frames") / "sound.mp4"
    content, number, all_of_them = b"junk", first, {}
    for frames in written:
        content += audio_fragment(FORM, frames, number) if frames else b""
        all_of_them |= dict(enumerate(frames, start=number))
        number += len(frames) + data.draw(st.integers(0, 2))
    path.write_bytes(content + b"junk")
    begin, end = (data.draw(st.integers(0, number + 2)) for _ in range(2))
    assert read_audio_frames(path, 4, len(content) - 4, begin, end, FORM) == {
        number: frame for number, frame in all_of_them.items() if begin <= number < end
    }
