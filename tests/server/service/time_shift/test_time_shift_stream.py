"""Time shift plays from the disk, then from memory, then live, without a gap."""

from __future__ import annotations

import asyncio
import io
import json
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import av
import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL
from fakes.service.scripted_recordings import (
    PULSE0,
    UNLIMITED,
    A,
    B,
    Picture,
    filled_buffers,
    fragments,
    gop_record,
    own_pictures,
    session_info,
    written_folder,
)
from server.media.containers.mpegts import ContinuityCounters
from server.media.picture import EncodedPicture as Shown
from server.media.stream_format import StreamFormat
from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot
from server.messaging.inbox import Message
from server.messaging.messages import Box, ZenohKeys
from server.service.recording.media_files import pulse_of
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.segment_index import PulseRange
from server.service.recording.session_files import InitSegments
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import MediaChunk
from server.service.time_shift import time_shift_stream as past_stream
from server.service.time_shift.availability import available_ranges, end_of_available, first_available
from server.service.time_shift.playback import CameraPlayback, PersonPlayback, SessionEntries
from server.service.time_shift.time_reference import TimeReferenceError, parse_time_reference
from server.service.time_shift.time_shift_stream import PlaybackRange, TimeShiftStream

MOMENT = "use seconds ago (-60), a pulse (p1250) or a time (2026-11-21T16:13:36Z)"
IN_A: Mapping[str, Mapping[int, Box | None]] = {A: {1: LARGE}, B: {1: SMALL}}
IN_B: Mapping[str, Mapping[int, Box | None]] = {A: {1: SMALL}, B: {1: LARGE}}


@pytest.fixture
async def recorded_site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    """Six GOPs of person 1, in c0, then in c1; all but the last two are only on the disk."""
    async for served in serve_site(record={"folder": str(tmp_path / "kept"), "segment_s": 0.4}):
        served.service.recorder.recent._frames = GOP
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(7):
            served.service.feed(epoch, IN_A if epoch < 3 else IN_B)
        await until_written(served, 6)
        yield served


async def until_written(served: ServedSite, gops: int) -> None:
    while served.service.recorder.writer is not None and served.service.recorder.writer.written < gops:  # noqa: ASYNC110
        await asyncio.sleep(0.001)


def decoded(data: bytes) -> list[tuple[int, Picture]]:
    with av.open(io.BytesIO(data), "r") as container:
        return [
            (round(float(frame.time or 0) * FPS), frame.to_ndarray(format="yuv420p"))
            for frame in container.decode(video=0)
        ]


async def fetch(served: ServedSite, path: str) -> list[tuple[int, Picture]]:
    async with served.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        assert answer.content_type == "video/mp4"
        return decoded(await answer.read())


async def read_up_to(served: ServedSite, path: str, pulse: int, then: int) -> list[tuple[int, Picture]]:
    """Read a stream up to a pulse, then feed one more epoch and read the rest."""
    data, fed = b"", False
    async with served.session.get(path) as answer:
        while True:
            data += await answer.content.readany()
            newest = max((pulse_of(fragment, FPS) for fragment in fragments(data)), default=-1)
            if not fed and newest >= pulse - 1:
                served.service.feed(then, IN_B)
                fed = True
            if newest >= pulse + GOP - 1:
                return decoded(data)


async def test_a_persons_recording_continues_into_the_live_stream_without_a_gap(
    recorded_site: ServedSite,
) -> None:
    camera = {
        pulse: choices.choices[1]
        for choices in recorded_site.service.recorder.recent.choices(0)
        for pulse in range(choices.first, choices.first + GOP)
    }
    assert min(camera) >= 4 * GOP, "the start is only on the disk"
    shown = await read_up_to(recorded_site, "/objects/1/best.mp4?from=p7", 6 * GOP, 7)
    assert [pulse for pulse, _ in shown] == list(range(GOP, 7 * GOP))
    used = set()
    for pulse, picture in shown:
        (equal,) = [camera for camera in CAMERAS if np.array_equal(picture, own_pictures(camera)[pulse])]
        assert camera.get(pulse, equal) == equal
        used.add(equal)
    assert used == {A, B}


async def test_a_cameras_recording_continues_into_the_live_stream_without_a_gap(
    recorded_site: ServedSite,
) -> None:
    shown = await read_up_to(recorded_site, "/cameras/c0/live.mp4?from=p0", 7 * GOP, 7)
    assert [pulse for pulse, _ in shown] == list(range(8 * GOP))
    for pulse, picture in shown:
        np.testing.assert_array_equal(picture, own_pictures(A)[pulse])


@pytest.mark.parametrize(
    ("query", "pulses"),
    [
        ("from=p0&to=p13", range(13)),
        ("from=p12&to=p24", range(10, 24)),
        ("from=-0.4&to=p30", range(20, 30)),
        ("from=2025-11-21T04:40:00.200Z&to=2025-11-21T05:40:00.8%2B01:00", range(5, 20)),
    ],
)
async def test_a_range_with_an_end_is_a_download_of_its_frames(
    recorded_site: ServedSite, query: str, pulses: range
) -> None:
    recorded_site.service.pulses.pulse0 = 1_763_700_000.0
    shown = await fetch(recorded_site, f"/objects/1/best.mp4?{query}")
    assert [pulse for pulse, _ in shown] == list(pulses)


async def test_a_download_waits_for_an_end_in_the_future(recorded_site: ServedSite) -> None:
    reading = asyncio.create_task(fetch(recorded_site, "/objects/1/best.mp4?from=p20&to=p33"))
    while not recorded_site.service.splicer.viewers:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    recorded_site.service.feed(7, IN_B)
    assert [pulse for pulse, _ in await reading] == list(range(20, 33))


async def test_without_a_recording_frames_in_memory_are_played(site_with_people: ServedSite) -> None:
    for source in (
        PersonPlayback(site_with_people.service.recorder, (1,)),
        CameraPlayback(site_with_people.service.recorder, A),
    ):
        (span,) = available_ranges(source)
        assert (first_available(source, 0), end_of_available(source)) == (span.first, span.end)
        assert first_available(source, span.end) is None
    assert [pulse for pulse, _ in await fetch(site_with_people, "/objects/1/best.mp4?from=p0&to=p9")] == list(
        range(9)
    )


@pytest.mark.parametrize(
    ("path", "status", "error"),
    [
        ("/objects/9/best.mp4?from=-60", 404, "there is no object 9"),
        ("/cameras/c9/live.mp4?from=-60", 404, "there is no camera 'c9'; there are c0, c1"),
        (
            "/objects/1/best.mp4?from=p99",
            416,
            "nothing of object 1 is recorded from p99 on; there is p0 to p29",
        ),
        (
            "/cameras/c0/live.mp4?from=p99",
            416,
            "nothing of camera c0 is recorded from p99 on; there is p0 to p34",
        ),
        (
            "/objects/1/best.mp4?from=yesterday",
            400,
            f"from: 'yesterday' is not a time; {MOMENT}",
        ),
        ("/objects/1/best.mp4?from=p9&to=p9", 400, "to: p9 is not after from, which is p9"),
        ("/objects/1/best.mp4?to=p9", 400, "from: is missing; it is the start, such as ?from=-60"),
        (
            "/objects/1/best.mp4?from=2025-11-21",
            400,
            "from: no pulse has been received yet; use seconds ago (-60) or a pulse (p1250)",
        ),
        ("/api/objects/9/past", 404, "nothing is recorded of object 9"),
        ("/api/objects/1/past?from=p9&to=p9", 400, "to: p9 is not after from, which is p9"),
        ("/api/cameras/c0/past?to=yesterday", 400, f"to: 'yesterday' is not a time; {MOMENT}"),
    ],
)
async def test_impossible_requests_are_answered_with_a_one_line_error(
    recorded_site: ServedSite, path: str, status: int, error: str
) -> None:
    assert await recorded_site.get(path) == (status, {"error": error})


async def test_spans_list_the_recorded_time(recorded_site: ServedSite) -> None:
    recorded_site.service.pulses.pulse0 = 1_763_700_000.0
    span = {
        "begins": "2025-11-21T04:40:00.000Z",
        "ends": "2025-11-21T04:40:01.200Z",
        "first": 0,
        "frames": 30,
    }
    assert (await recorded_site.get_json("/api/objects/1/past"))["spans"] == [span]
    assert (await recorded_site.get_json("/api/cameras/c1/past"))["spans"][0]["frames"] == 35


async def test_views_list_the_chosen_cameras(recorded_site: ServedSite) -> None:
    async with recorded_site.session.get("/api/past?from=p0") as answer:
        decisions = [json.loads(line) async for line in answer.content]
    chosen = {
        decision["first"] + n: decision["choices"]["1"]
        for decision in decisions
        for n in range(decision["frames"])
    }
    views = (await recorded_site.get_json("/api/objects/1/past"))["views"]
    assert {view["first"] + n: view["camera"] for view in views for n in range(view["frames"])} == chosen
    assert [view["camera"] for view in views] == [A, B]
    assert (await recorded_site.get_json("/api/cameras/c1/past"))["views"] == [
        {"camera": B, "first": 0, "frames": 35}
    ]


@pytest.mark.parametrize(("query", "frames"), [("from=p7&to=p24", 17), ("from=p20", 10), ("to=p4", 4)])
async def test_spans_and_views_are_limited_to_the_requested_range(
    recorded_site: ServedSite, query: str, frames: int
) -> None:
    def cameras(views: list[dict[str, Any]]) -> dict[int, str]:
        return {view["first"] + n: view["camera"] for view in views for n in range(view["frames"])}

    whole = cameras((await recorded_site.get_json("/api/objects/1/past"))["views"])
    part = await recorded_site.get_json(f"/api/objects/1/past?{query}")
    begin = int(query.partition("from=p")[2].partition("&")[0] or 0)
    assert [(span["first"], span["frames"]) for span in part["spans"]] == [(begin, frames)]
    assert cameras(part["views"]) == {number: whole[number] for number in range(begin, begin + frames)}
    span = (await recorded_site.get_json(f"/api/cameras/c1/past?{query}"))["spans"][0]
    assert (span["first"], span["frames"]) == (begin, 15 if query == "from=p20" else frames)
    beyond_end = await recorded_site.get_json("/api/objects/1/past?from=p900")
    assert beyond_end == {"spans": [], "views": []}


async def test_a_session_without_a_segment_has_no_decisions(recorded_site: ServedSite) -> None:
    """It has none before the first one begins, and when all have been deleted."""
    session = recorded_site.service.recorder.session
    assert session is not None
    assert session.decision_files(0, 10), "there are some of its segments"
    session.segments = []
    assert session.decision_files(0, 10) == []
    async with recorded_site.session.get("/api/past?from=p0&to=p10") as answer:
        assert answer.status != 500


async def test_recorded_decisions_have_choices_and_boxes(recorded_site: ServedSite) -> None:
    async with recorded_site.session.get("/api/past?from=p7&to=p24") as answer:
        assert answer.content_type == "application/x-ndjson"
        lines = [json.loads(line) async for line in answer.content]
    assert [line["first"] for line in lines] == [5, 10, 15, 20]
    assert lines[0]["choices"] == {"1": A}
    assert lines[0]["boxes"][A][0][0][0] == 1


async def test_a_viewer_of_time_shift_counts_like_others(
    recorded_site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(past_stream, "_LEAD_S", 0.2)
    recorder = recorded_site.service.recorder
    async with recorded_site.session.get("/objects/1/best.mp4?from=p0") as answer:
        await answer.content.readany()
        assert (recorder.viewers, recorded_site.service.splicer.viewers) == (1, 0)
        async with recorded_site.session.get("/metrics") as metrics:
            assert "myview_viewers 1.0" in (await metrics.text()).splitlines()
        answer.close()
    while recorder.viewers:  # noqa: ASYNC110
        await asyncio.sleep(0.001)


async def test_a_viewer_of_time_shift_occupies_a_slot_and_frees_it(recorded_site: ServedSite) -> None:
    recorder = recorded_site.service.recorder
    async with recorded_site.session.get("/objects/1/best.mp4?from=p0") as answer:
        await answer.content.readany()
        while not recorded_site.service.splicer.viewers:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        assert recorder.viewers == 0, "the broadcaster counts from the present on"
        answer.close()
    while recorder.viewers or recorded_site.service.splicer.viewers:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    assert (await recorded_site.get("/objects/1/best.mp4?from=p0", "HEAD"))[0] == 200


class DiskSource:
    """A source with nothing in memory."""

    presence = None

    def __init__(self, *recorded_site: SessionEntries, end: int) -> None:
        self.recorded, self.end = recorded_site, end

    def gop_in_memory_from(self, pulse: int) -> None:
        del pulse

    def gop_in_memory_until(self, pulse: int) -> None:
        del pulse


def stream_format_and_header(store: RecordingFolder) -> tuple[StreamFormat, bytes]:
    del store
    frame_buffers, header = filled_buffers()
    return frame_buffers[A]._stream_format, header


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.sampled_from([A, B, None]), min_size=1, max_size=20),
    st.integers(0, 20 * GOP),
    st.integers(1, 20 * GOP),
)
async def test_any_range_of_any_recording_is_played_without_a_gap(
    tmp_path_factory: pytest.TempPathFactory, shown: list[str | None], start: int, frames: int
) -> None:
    folder = tmp_path_factory.mktemp("part")
    pieces = [gop_record(gop, {} if camera is None else {1: camera}) for gop, camera in enumerate(shown)]
    store = written_folder(RecordingFolder(folder, UNLIMITED), pieces)
    assert store.session is not None
    tapes = (
        [SessionEntries(store.session, store.session.objects[1].index)] if 1 in store.session.objects else []
    )
    source = DiskSource(*tapes, end=len(shown) * GOP)
    stream_format, header = stream_format_and_header(store)
    stream = TimeShiftStream(source, GaplessTimeline(stream_format, FPS, GOP), FPS, lambda: None)
    data = b"".join([chunk.data async for chunk in stream.send(PlaybackRange(start, start + frames))])
    store.close()
    available = available_ranges(source)
    assert first_available(source, start) == next(
        (max(span.first, start) for span in available if span.end > start), None
    )
    assert end_of_available(source) == (available[-1].end if available else 0)
    kept = [gop for gop, camera in enumerate(shown) if camera is not None]
    wanted = [gop for gop in kept if (gop + 1) * GOP > start and gop * GOP < start + frames]
    if not wanted:
        assert not data
        return
    last = min(start + frames, (wanted[-1] + 1) * GOP)
    played = decoded(header + data)
    assert [pulse for pulse, _ in played] == list(range(wanted[0] * GOP, last))
    for pulse, picture in played:
        camera = shown[pulse // GOP]
        if camera is not None:
            np.testing.assert_array_equal(picture, own_pictures(camera)[pulse])
    assert all(
        any(available.first <= gop * GOP < available.end for available in available_ranges(source))
        for gop in wanted
    )


async def test_segments_deleted_during_playback_are_left_out(tmp_path: Path) -> None:
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in range(12)]
    )
    assert store.session is not None
    store.session.paths.camera_file(A, 25).unlink()
    source = DiskSource(SessionEntries(store.session, store.session.objects[1].index), end=60)
    stream_format, header = stream_format_and_header(store)
    stream = TimeShiftStream(source, GaplessTimeline(stream_format, FPS, GOP), FPS, lambda: None)
    data = b"".join([chunk.data async for chunk in stream.send(PlaybackRange(0, 60))])
    assert [pulse for pulse, _ in decoded(header + data)] == list(range(60)), "filled, as live"
    assert available_ranges(source) == [PulseRange(0, 60)]


@pytest.mark.parametrize("end", [2 * GOP + 1, 10 * GOP])
async def test_a_person_out_of_view_at_the_end_is_not_waited_for(tmp_path: Path, end: int) -> None:
    now = 10 * GOP + FPS
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED),
        [gop_record(gop, {1: A} if gop < 2 else {}) for gop in range(now // GOP)],
    )
    assert store.session is not None
    source = DiskSource(SessionEntries(store.session, store.session.objects[1].index), end=now)
    stream_format, header = stream_format_and_header(store)
    stream = TimeShiftStream(
        source, GaplessTimeline(stream_format, FPS, GOP), FPS, Broadcaster
    )  # without a GOP
    data = b"".join([chunk.data async for chunk in stream.send(PlaybackRange(0, end))])
    assert [pulse for pulse, _ in decoded(header + data)] == list(range(2 * GOP))


async def test_a_person_who_returns_after_the_end_does_not_extend_the_download(tmp_path: Path) -> None:
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A} if gop < 2 else {}) for gop in range(4)]
    )
    assert store.session is not None
    source = DiskSource(SessionEntries(store.session, store.session.objects[1].index), end=4 * GOP)
    stream_format, header = stream_format_and_header(store)
    broadcaster, back = Broadcaster(), gop_record(8, {1: A}).cameras[A]
    live_pictures = [
        Shown(back.first + at, not at, fragment, boot=1) for at, fragment in enumerate(back.fragments)
    ]
    broadcaster.publish(MediaChunk(live_pictures, FPS, ContinuityCounters()))
    stream = TimeShiftStream(source, GaplessTimeline(stream_format, FPS, GOP), FPS, lambda: broadcaster)
    data = b"".join([chunk.data async for chunk in stream.send(PlaybackRange(0, 5 * GOP))])
    assert [pulse for pulse, _ in decoded(header + data)] == list(range(2 * GOP))
    assert len(fragments(data)) == 2 * GOP, "no picture that lasts until then"


async def test_a_few_seconds_are_sent_at_once_and_the_rest_in_real_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in range(40)]
    )
    assert store.session is not None
    now, loop = [100.0], asyncio.get_running_loop()

    async def slept(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(loop, "time", lambda: now[0])
    monkeypatch.setattr(asyncio, "sleep", slept)
    stream_format, _ = stream_format_and_header(store)
    source = DiskSource(SessionEntries(store.session, store.session.objects[1].index), end=200)
    stream = TimeShiftStream(source, GaplessTimeline(stream_format, FPS, GOP), FPS, lambda: None)
    arrived = [now[0] - 100.0 async for _ in stream.send(PlaybackRange(0))]
    lead = 4.0
    for gop, at in enumerate(arrived):
        assert at == pytest.approx(max(0.0, gop * GOP / FPS - lead))
    store.close()


async def test_a_cameras_recording_includes_earlier_sessions(tmp_path: Path) -> None:
    written_folder(
        RecordingFolder(tmp_path / "kept", UNLIMITED), [gop_record(gop, {1: A}) for gop in range(4)]
    ).close()
    async for served in serve_site(record={"folder": str(tmp_path / "kept"), "segment_s": 0.4}):
        served.service.pulses.pulse0 = PULSE0 + 0.01
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(5, 8):
            served.service.feed(epoch, IN_A)
        await until_written(served, 1)
        shown = await fetch(served, "/cameras/c0/live.mp4?from=p7&to=p35")
        assert [pulse for pulse, _ in shown] == list(range(GOP, 35))
        for pulse, picture in shown:
            if not 4 * GOP <= pulse < 5 * GOP:  # while the service was away the last picture is repeated
                np.testing.assert_array_equal(picture, own_pictures(A)[pulse])
        assert (await served.get_json("/api/cameras/c0/past"))["spans"][0]["frames"] == 4 * GOP
        assert (await served.get_json("/api/objects/1/past"))["spans"][0]["first"] == 5 * GOP, (
            "another person 1"
        )
        async with served.session.get("/api/past?from=p7") as answer:
            lines = [json.loads(line) async for line in answer.content]
        assert [line["first"] for line in lines] == [5, 10, 15, 25, 30]
        (earlier,) = served.service.recorder.folder.earlier
        assert [line.get("run") for line in lines] == [earlier.folder.name] * 3 + [None] * 2
    other = RecordingFolder(tmp_path / "kept", UNLIMITED)
    other.open()
    assert len(other.earlier) == 2


async def test_a_persons_recording_includes_earlier_sessions_with_the_same_numbers(tmp_path: Path) -> None:
    folder, since = tmp_path / "kept", PULSE0 - 9.0
    store = RecordingFolder(folder, UNLIMITED)
    written_folder(store, [gop_record(gop, {}) for gop in range(1)])
    for gop in range(1, 4):  # numbering began with the first camera
        store.write(
            gop_record(gop, {1: A}), session_info(numbers_since=since), InitSegments(filled_buffers()[1])
        )
    store.close()
    async for served in serve_site(record={"folder": str(folder), "segment_s": 0.4}):
        served.service.pulses.pulse0 = PULSE0 + 0.01
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        snapshot = CameraIdentitySnapshot(pulse=19, boot=1, next_number=9, numbered_since=since, people=[])
        key = ZenohKeys("hall").camera(A, "retained_identities")
        served.service.state_replication.receive_snapshot(Message(key, msgspec.msgpack.encode(snapshot), b""))
        for epoch in range(5, 8):
            served.service.feed(epoch, IN_A)
        await until_written(served, 1)
        shown = await fetch(served, "/objects/1/best.mp4?from=p7&to=p35")
        assert [pulse for pulse, _ in shown] == list(range(GOP, 35))
        assert (await served.get_json("/api/objects/1/past"))["spans"][0]["first"] == GOP
        async with served.session.get("/api/past?from=p7") as answer:
            lines = [json.loads(line) async for line in answer.content]
        assert [(line["first"], line.get("run")) for line in lines] == [
            (first, None) for first in (5, 10, 15, 25, 30)
        ]


@pytest.mark.parametrize(
    ("text", "pulse"),
    [
        ("-60", 3500),
        ("-0.04", 4999),
        ("-100000", 0),
        ("p1250", 1250),
        ("2025-11-21T04:40:10Z", 250),
        ("2025-11-21T05:40:10+01:00", 250),
        ("2025-11-21T05:40:10 01:00", 250),
        ("2025-11-21T04:40:10.199", 254),
        ("2025-11-21", 0),
    ],
)
def test_time_references_are_parsed(text: str, pulse: int) -> None:
    assert parse_time_reference(text, now=5000, fps=FPS, pulse0=1_763_700_000.0) == pulse


@settings(max_examples=50, deadline=None)
@given(st.text(max_size=30))
def test_any_text_is_a_time_reference_or_a_one_line_error(text: str) -> None:
    try:
        pulse = parse_time_reference(text, now=5000, fps=FPS, pulse0=0.0)
    except TimeReferenceError as error:
        pulse = 1 - len(str(error).splitlines())
    assert pulse >= 0
