"""The cameras' messages are accepted, or counted and dropped; none raises an error."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fuzz.engine.mutations import as_message
from bestview import IdentitySettings
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
    status,
    thumbnail,
    tracks,
    video,
)
from server.media.stream_format import StreamFormat
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.messaging.picture_motion import picture_motion
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.streaming.frame_buffer import FrameBuffer
from tracking.detectors.background.motion import Motion

KEYS = ZenohKeys("hall")
REASON = "rtsp://10.0.0.9: Connection refused"
UNAVAILABLE = Message(KEYS.camera("c0", "unavailable"), msgspec.msgpack.encode({"reason": REASON}), b"")


class IngestWithBuffers:
    """An ingest with its buffers."""

    def __init__(self) -> None:
        stream_format = StreamFormat()
        self.frame_buffers = {camera: FrameBuffer(FPS, 50, stream_format) for camera in CAMERAS}
        self.aligner = EpochAligner(CAMERAS, STRIDE, grace=5)
        self.frames: list[tuple[str]] = []
        self.ingest = Ingest(self.frame_buffers, self.aligner, lambda *frame: self.frames.append(frame))
        for camera in CAMERAS:
            self.ingest.set_present(KEYS.camera(camera, "alive"), is_present=True)

    def handle(self, kind: str, message: Message) -> None:
        handlers = {
            "video": self.ingest.receive_video,
            "tracks": self.ingest.receive_tracks,
            "status": self.ingest.receive_status,
            "thumbs": self.ingest.receive_thumbnail,
            "unavailable": self.ingest.receive_unavailable,
        }
        handlers[kind](message)

    def bad(self, camera: str = "c0") -> int:
        return self.ingest.states[camera].bad_messages


KINDS = ["video", "tracks", "status", "thumbs", "unavailable"]


@pytest.mark.parametrize("kind", KINDS)
def test_invalid_utf8_is_counted_and_dropped(kind: str) -> None:
    served = IngestWithBuffers()
    broken = b'{"camera": "\xff", "histogram": "\xc3\x28", "state": "\xed\xa0\x80", "\xff": "\xff"}'
    served.handle(kind, Message(KEYS.camera("c0", kind), broken, broken))
    assert served.bad() == 1


@pytest.mark.parametrize("field", ["missed", "shed", "boot"])
def test_a_count_too_large_for_a_metric_is_refused(field: str) -> None:
    served = IngestWithBuffers()
    served.handle("status", status("c0", **{field: 2**63}))
    assert served.bad() == 1
    assert served.ingest.states["c0"].status is None


@pytest.mark.parametrize("text", ["\x1b[2J", "searching\n", "x" * 201, "suchend: zu groß"])
def test_a_load_text_with_unprintable_characters_is_refused(text: str) -> None:
    served = IngestWithBuffers()
    served.handle("status", status("c0", load=text))
    assert served.bad() == 1
    assert served.ingest.states["c0"].status is None


def test_a_connected_cameras_load_text_is_its_message() -> None:
    served = IngestWithBuffers()
    text = "detecting in every 3rd frame: the machine is too busy"
    state = served.ingest.states["c0"]
    served.handle("status", status("c0", load_level=2, load=text))
    assert state.message == text
    served.handle("status", status("c0"))
    assert state.message == ""
    served.handle("status", status("c0", load_level=2, load=text))
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=False)
    assert state.message == ""


def test_a_picture_that_is_not_clear_is_the_cameras_message_and_its_last_error() -> None:
    served = IngestWithBuffers()
    state = served.ingest.states["c0"]
    served.handle("status", status("c0", condition="covered", condition_since=5.0, load_level=2, load="busy"))
    assert state.message.startswith("the lens is covered: ")
    assert state.message.endswith("; busy")
    assert state.metrics.last_error is not None
    first = state.metrics.last_error
    assert first.text.startswith("the lens is covered: ")
    served.handle("status", status("c0", condition="covered", condition_since=5.0))
    assert state.metrics.last_error == first, "it is recorded once"
    served.handle("status", status("c0"))
    assert state.message == ""


def test_a_partly_covered_picture_is_the_cameras_message_and_its_last_error() -> None:
    served = IngestWithBuffers()
    state = served.ingest.states["c0"]
    served.handle("status", status("c0", covered_share=0.304, load="busy"))
    assert state.message.startswith("30 % of the picture is covered: ")
    assert state.message.endswith("; busy")
    first = state.metrics.last_error
    assert first is not None
    assert first.text.startswith("30 % of the picture is covered: ")
    served.handle("status", status("c0", covered_share=0.39))
    assert state.message.startswith("39 % of the picture is covered: ")
    assert state.metrics.last_error == first, "it is recorded once"
    served.handle("status", status("c0", covered_share=0.5, condition="covered", condition_since=5.0))
    assert state.message.startswith("the lens is covered: ")
    served.handle("status", status("c0"))
    assert state.message == ""


def test_a_substream_without_pictures_is_the_cameras_message_and_its_last_error() -> None:
    served = IngestWithBuffers()
    state = served.ingest.states["c0"]
    served.handle("status", status("c0", substream="live"))
    assert (state.message, state.metrics.last_error) == ("", None)
    served.handle("status", status("c0", substream="away", load="busy"))
    text = "its substream delivers no pictures: people are tracked in its source"
    assert state.message == f"{text}; busy"
    assert state.metrics.last_error is not None
    assert state.metrics.last_error.text == text
    served.handle("status", status("c0", substream="live"))
    assert state.message == ""


def test_a_camera_that_was_knocked_is_to_be_calibrated_again() -> None:
    served = IngestWithBuffers()
    motion = picture_motion(Motion(6.0, 0.0, turn=0.0175).homography((640, 360)), (640, 360))
    served.handle("status", status("c0", motion=motion, motion_since=60.0))
    message = served.ingest.states["c0"].message
    assert message.startswith("it has moved by 6 pixels and 1.0 degrees since ")
    assert message.endswith(": calibrate it again")


def test_why_a_camera_cannot_be_opened_is_for_operators_until_it_connects() -> None:
    served = IngestWithBuffers()
    state = served.ingest.states["c0"]
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=False)
    served.handle("unavailable", UNAVAILABLE)
    assert state.unavailable is not None
    assert (state.unavailable.retry_s, state.message, state.operator_message) == (
        0.0,
        "its source cannot be opened",
        REASON,
    )
    assert state.metrics.last_error is not None
    first = state.metrics.last_error
    assert first.text == REASON
    served.handle("unavailable", UNAVAILABLE)
    assert state.metrics.last_error is first, "it is recorded once"
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=True)
    assert state.unavailable is None
    served.handle("unavailable", UNAVAILABLE)
    assert state.unavailable is None, "it was late"


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@settings(deadline=None, max_examples=200)
@given(kind=st.sampled_from(KINDS), payload=st.binary(max_size=100), attachment=st.binary(max_size=100))
def test_arbitrary_bytes_are_counted_and_dropped(kind: str, payload: bytes, attachment: bytes) -> None:
    served = IngestWithBuffers()
    served.handle(kind, Message(KEYS.camera("c0", kind), payload, attachment))
    assert served.bad() == 1
    assert not served.frames
    assert served.aligner.take_ready(now=100) == []


@settings(deadline=None, max_examples=100)
@given(kind=st.sampled_from(KINDS), key=st.text(max_size=40))
def test_arbitrary_keys_are_ignored(kind: str, key: str) -> None:
    served = IngestWithBuffers()
    served.handle(kind, Message(key, b"", b""))
    served.ingest.set_present(key, is_present=True)
    assert served.bad() == 0


GOOD: dict[str, Message] = {
    "video": video("c0", encoded(0)[0]),
    "tracks": tracks(camera_tracks("c0", 0, {1: SMALL})),
    "status": status("c0"),
    "thumbs": thumbnail("c0", 1, b"jpeg"),
    "unavailable": UNAVAILABLE,
}


@settings(deadline=None, max_examples=80)
@given(data=st.data(), kind=st.sampled_from(KINDS))
def test_a_message_with_one_wrong_field_raises_no_error(data: st.DataObject, kind: str) -> None:
    served, good = IngestWithBuffers(), GOOD[kind]
    in_head = bool(good.attachment)
    fields: dict[str, Any] = msgspec.msgpack.decode(good.attachment if in_head else good.payload)
    name = data.draw(st.sampled_from(sorted(fields)))
    fields[name] = data.draw(anything | st.integers(-(2**70), 2**70))
    changed = as_message(fields)
    served.handle(
        kind, Message(good.key, good.payload, changed) if in_head else Message(good.key, changed, b"")
    )
    people = PersonTracker(IdentitySettings(), CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=0)
    for epoch in served.aligner.take_ready(now=1000):
        people.update(epoch)


@pytest.mark.parametrize(
    "changes",
    [
        {"last": 3},
        {"last": 5},
        {"first": 1},
        {"first": 10, "last": 0},
        {"first": 0, "last": 10**9, "tracks": []},
        {"epoch": -1},
        {"epoch": 10**30},
        {"size": (0, 48)},
        {"camera": "c1"},
        {"tracks": camera_tracks("c0", 0, {1: SMALL}).tracks * 2},
    ],
)
def test_inconsistent_tracks_are_refused(changes: dict[str, Any]) -> None:
    served = IngestWithBuffers()
    sent = msgspec.msgpack.decode(GOOD["tracks"].payload)
    payload = as_message(sent | msgspec.to_builtins(changes, builtin_types=(bytes,)))
    served.ingest.receive_tracks(Message(GOOD["tracks"].key, payload, b""))
    assert served.bad() == 1


def test_unconfigured_cameras_are_ignored(caplog: pytest.LogCaptureFixture) -> None:
    served = IngestWithBuffers()
    served.ingest.receive_video(video("cellar", encoded(0)[0]))
    served.ingest.receive_tracks(tracks(camera_tracks("cellar", 0, {})))
    for is_present in (True, False) * 5:
        served.ingest.set_present(KEYS.camera("cellar", "alive"), is_present=is_present)
    assert len(caplog.messages) == 1
    assert list(served.ingest.states) == list(CAMERAS)
    assert not served.frames


def test_a_camera_with_other_parameter_sets_is_refused() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_video(video("c0", encoded(0)[0]))
    for unit in encoded(1, crf=40)[:10]:
        served.ingest.receive_video(video("c1", unit))
    state = served.ingest.states["c1"]
    assert state.label == "refused"
    assert "differ from the other cameras'" in state.refused
    assert "same configuration?" in state.refused
    assert "\n" not in state.refused
    assert [camera for camera, _ in served.frames] == ["c0"]
    assert not any(served.frame_buffers["c1"].has(pulse) for pulse in range(10))


def test_a_refused_camera_is_accepted_after_a_restart_with_the_right_settings() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_video(video("c0", encoded(0)[0]))
    served.ingest.receive_video(video("c1", encoded(1, crf=40)[0]))
    served.ingest.set_present(KEYS.camera("c1", "alive"), is_present=False)
    served.ingest.set_present(KEYS.camera("c1", "alive"), is_present=True)
    served.ingest.receive_video(video("c1", encoded(1)[5], boot=2))
    assert served.ingest.states["c1"].label == "live"
    assert served.frame_buffers["c1"].has(5)


def test_a_cameras_state_follows_its_messages() -> None:
    served = IngestWithBuffers()
    state = served.ingest.states["c0"]
    labels = [state.label]
    served.ingest.receive_video(video("c0", encoded(0)[0]))
    labels.append(state.label)
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=False)
    labels.append(state.label)
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=True)
    served.ingest.receive_tracks(tracks(camera_tracks("c0", 0, {}, ended=True)))
    labels.append(state.label)
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=False)
    labels.append(state.label)
    served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=True)
    labels.append(state.label)
    assert labels == ["starting", "live", "gone", "ended", "ended", "live"]


def test_thumbnails_are_kept_by_boot_and_track_until_they_expire_or_the_camera_disconnects() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_thumbnail(thumbnail("c0", 1, b"old", pulse=5))
    served.ingest.receive_thumbnail(thumbnail("c0", 2, b"new", pulse=50))
    served.ingest.receive_thumbnail(thumbnail("c1", 1, b"other", pulse=50))
    served.ingest.forget_thumbnails_before(20)
    assert [kept.jpeg for kept in served.ingest.thumbnails.values()] == [b"new", b"other"]
    served.ingest.set_present(KEYS.camera("c1", "alive"), is_present=False)
    assert list(served.ingest.thumbnails) == [("c0", 1, 2)]


def test_messages_of_pulses_far_in_the_future_are_counted_and_dropped() -> None:
    served = IngestWithBuffers()
    served.ingest = Ingest(
        served.frame_buffers, served.aligner, lambda *_: None, current_pulse=lambda: 20, max_ahead=50
    )
    far = 2**40
    unit = dataclasses.replace(encoded(0)[0], pulse=far)
    served.handle("video", video("c0", unit))
    served.handle("tracks", tracks(camera_tracks("c0", far // STRIDE, {})))
    served.handle("thumbs", thumbnail("c0", 1, b"jpeg", pulse=far))
    assert served.bad() == 3
    assert served.frame_buffers["c0"].newest == -1
    assert not served.ingest.thumbnails
    served.handle("tracks", tracks(camera_tracks("c0", 0, {})))
    served.handle("tracks", tracks(camera_tracks("c1", 0, {})))
    assert [epoch.number for epoch in served.aligner.take_ready(now=4)] == [0]


def test_thumbnails_are_limited_for_each_camera() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_thumbnail(thumbnail("c1", 7, b"jpeg"))
    for track in range(1200):
        served.ingest.receive_thumbnail(thumbnail("c0", track, b"jpeg"))
    assert len(served.ingest.thumbnails) == 301
    assert ("c0", 1, 1199) in served.ingest.thumbnails
    assert ("c1", 1, 7) in served.ingest.thumbnails


def test_an_invalid_thumbnail_is_counted_and_dropped() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_thumbnail(thumbnail("c0", 1, bytes(1 << 18)))
    assert served.bad() == 1
    assert not served.ingest.thumbnails


def test_a_flapping_camera_writes_few_log_lines(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    served = IngestWithBuffers()
    caplog.clear()
    for is_present in (False, True) * 50:
        served.ingest.set_present(KEYS.camera("c0", "alive"), is_present=is_present)
    assert caplog.messages == ["camera c0 disconnected", "camera c0 connected"] * 4 + [
        "camera c0 disconnected"
    ]


def test_a_status_is_kept() -> None:
    served = IngestWithBuffers()
    served.ingest.receive_status(status("c0", fps=24.5))
    current_status = served.ingest.states["c0"].status
    assert current_status is not None
    assert current_status.fps == 24.5


def test_frames_and_tracks_become_epochs() -> None:
    served = IngestWithBuffers()
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed)[:STRIDE]:
            served.ingest.receive_video(video(camera, unit))
        served.ingest.receive_tracks(tracks(camera_tracks(camera, 0, {1: LARGE})))
    [epoch] = served.aligner.take_ready(now=4)
    assert list(epoch.tracks) == list(CAMERAS)
    assert len(served.frames) == 2 * STRIDE
