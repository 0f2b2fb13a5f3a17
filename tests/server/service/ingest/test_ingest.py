"""What cameras send is taken in, or counted and dropped: nothing from outside raises."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    HEIGHT,
    LARGE,
    SMALL,
    STRIDE,
    WIDTH,
    encoded,
    status,
    thumbnail,
    tracks,
    video,
    word,
)
from server.media.stream_format import StreamFormat
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.service.identity.people import PersonTracker
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.streaming.frame_buffer import FrameBuffer

KEYS = ZenohKeys("hall")


class Hall:
    """An ingest and what it fills."""

    def __init__(self) -> None:
        stream_format = StreamFormat()
        self.frame_buffers = {camera: FrameBuffer(FPS, 50, stream_format) for camera in CAMERAS}
        self.aligner = EpochAligner(CAMERAS, STRIDE, grace=5)
        self.frames: list[tuple[str]] = []
        self.ingest = Ingest(self.frame_buffers, self.aligner, lambda *frame: self.frames.append(frame))
        for camera in CAMERAS:
            self.ingest.alive(KEYS.camera(camera, "alive"), is_present=True)

    def handle(self, what: str, message: Message) -> None:
        handlers = {
            "video": self.ingest.video,
            "tracks": self.ingest.tracks,
            "status": self.ingest.status,
            "thumbs": self.ingest.thumbnail,
        }
        handlers[what](message)

    def bad(self, camera: str = "c0") -> int:
        return self.ingest.states[camera].bad_messages


KINDS = ["video", "tracks", "status", "thumbs"]


@pytest.mark.parametrize("what", KINDS)
def test_invalid_utf8_is_counted_and_dropped(what: str) -> None:
    hall = Hall()
    broken = b'{"camera": "\xff", "histogram": "\xc3\x28", "state": "\xed\xa0\x80", "\xff": "\xff"}'
    hall.handle(what, Message(KEYS.camera("c0", what), broken, broken))
    assert hall.bad() == 1


@pytest.mark.parametrize("field", ["missed", "shed", "boot"])
def test_a_count_too_large_for_a_metric_is_refused(field: str) -> None:
    hall = Hall()
    hall.handle("status", status("c0", **{field: 10**400}))
    assert hall.bad() == 1
    assert hall.ingest.states["c0"].status is None


@pytest.mark.parametrize("words", ["\x1b[2J", "searching\n", "x" * 201, "suchend: zu groß"])
def test_a_load_text_with_unprintable_characters_is_refused(words: str) -> None:
    hall = Hall()
    hall.handle("status", status("c0", load=words))
    assert hall.bad() == 1
    assert hall.ingest.states["c0"].status is None


def test_a_connected_cameras_load_text_is_its_message() -> None:
    hall = Hall()
    words = "detecting in every 3rd frame: the machine is too busy"
    state = hall.ingest.states["c0"]
    hall.handle("status", status("c0", load_level=2, load=words))
    assert state.message == words
    hall.handle("status", status("c0"))
    assert state.message == ""
    hall.handle("status", status("c0", load_level=2, load=words))
    hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=False)
    assert state.message == ""


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@settings(deadline=None, max_examples=200)
@given(what=st.sampled_from(KINDS), payload=st.binary(max_size=100), attachment=st.binary(max_size=100))
def test_arbitrary_bytes_are_counted_and_dropped(what: str, payload: bytes, attachment: bytes) -> None:
    hall = Hall()
    hall.handle(what, Message(KEYS.camera("c0", what), payload, attachment))
    assert hall.bad() == 1
    assert not hall.frames
    assert hall.aligner.ready(now=100) == []


@settings(deadline=None, max_examples=100)
@given(what=st.sampled_from(KINDS), key=st.text(max_size=40))
def test_arbitrary_keys_are_ignored(what: str, key: str) -> None:
    hall = Hall()
    hall.handle(what, Message(key, b"", b""))
    hall.ingest.alive(key, is_present=True)
    assert hall.bad() == 0


GOOD: dict[str, Message] = {
    "video": video("c0", encoded(0)[0]),
    "tracks": tracks(word("c0", 0, {1: SMALL})),
    "status": status("c0"),
    "thumbs": thumbnail("c0", 1, b"jpeg"),
}


@settings(deadline=None, max_examples=80)
@given(data=st.data(), what=st.sampled_from(KINDS))
def test_a_message_with_one_wrong_field_raises_no_error(data: st.DataObject, what: str) -> None:
    hall, good = Hall(), GOOD[what]
    in_head = bool(good.attachment)
    fields: dict[str, Any] = msgspec.json.decode(good.attachment if in_head else good.payload)
    name = data.draw(st.sampled_from(sorted(fields)))
    fields[name] = data.draw(anything | st.integers(-(2**70), 2**70))
    changed = json.dumps(fields).encode()
    hall.handle(
        what, Message(good.key, good.payload, changed) if in_head else Message(good.key, changed, b"")
    )
    people = PersonTracker(IdentitySettings(), CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=0)
    for epoch in hall.aligner.ready(now=1000):
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
        {"tracks": word("c0", 0, {1: SMALL}).tracks * 2},
    ],
)
def test_inconsistent_tracks_are_refused(changes: dict[str, Any]) -> None:
    hall = Hall()
    fields = {**msgspec.json.decode(GOOD["tracks"].payload), **msgspec.to_builtins(changes)}
    payload = json.dumps(fields).encode()
    hall.ingest.tracks(Message(GOOD["tracks"].key, payload, b""))
    assert hall.bad() == 1


def test_unconfigured_cameras_are_ignored(caplog: pytest.LogCaptureFixture) -> None:
    hall = Hall()
    hall.ingest.video(video("cellar", encoded(0)[0]))
    hall.ingest.tracks(tracks(word("cellar", 0, {})))
    for there in (True, False) * 5:
        hall.ingest.alive(KEYS.camera("cellar", "alive"), is_present=there)
    assert len(caplog.messages) == 1
    assert list(hall.ingest.states) == list(CAMERAS)
    assert not hall.frames


def test_a_camera_with_other_parameter_sets_is_refused() -> None:
    hall = Hall()
    hall.ingest.video(video("c0", encoded(0)[0]))
    for unit in encoded(1, crf=40)[:10]:
        hall.ingest.video(video("c1", unit))
    state = hall.ingest.states["c1"]
    assert state.label == "refused"
    assert "differ from the other cameras'" in state.refused
    assert "same configuration?" in state.refused
    assert "\n" not in state.refused
    assert [camera for camera, _ in hall.frames] == ["c0"]
    assert not any(hall.frame_buffers["c1"].has(pulse) for pulse in range(10))


def test_a_refused_camera_is_accepted_after_a_restart_with_the_right_settings() -> None:
    hall = Hall()
    hall.ingest.video(video("c0", encoded(0)[0]))
    hall.ingest.video(video("c1", encoded(1, crf=40)[0]))
    hall.ingest.alive(KEYS.camera("c1", "alive"), is_present=False)
    hall.ingest.alive(KEYS.camera("c1", "alive"), is_present=True)
    hall.ingest.video(video("c1", encoded(1)[5], boot=2))
    assert hall.ingest.states["c1"].label == "live"
    assert hall.frame_buffers["c1"].has(5)


def test_a_cameras_state_follows_its_messages() -> None:
    hall = Hall()
    state = hall.ingest.states["c0"]
    words = [state.label]
    hall.ingest.video(video("c0", encoded(0)[0]))
    words.append(state.label)
    hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=False)
    words.append(state.label)
    hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=True)
    hall.ingest.tracks(tracks(word("c0", 0, {}, ended=True)))
    words.append(state.label)
    hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=False)
    words.append(state.label)
    hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=True)
    words.append(state.label)
    assert words == ["starting", "live", "gone", "ended", "ended", "live"]


def test_thumbnails_are_kept_by_boot_and_track_until_they_expire_or_the_camera_disconnects() -> None:
    hall = Hall()
    hall.ingest.thumbnail(thumbnail("c0", 1, b"old", pulse=5))
    hall.ingest.thumbnail(thumbnail("c0", 2, b"new", pulse=50))
    hall.ingest.thumbnail(thumbnail("c1", 1, b"other", pulse=50))
    hall.ingest.forget_thumbnails_before(20)
    assert [kept.jpeg for kept in hall.ingest.thumbnails.values()] == [b"new", b"other"]
    hall.ingest.alive(KEYS.camera("c1", "alive"), is_present=False)
    assert list(hall.ingest.thumbnails) == [("c0", 1, 2)]


def test_messages_of_pulses_far_in_the_future_are_counted_and_dropped() -> None:
    hall = Hall()
    hall.ingest = Ingest(
        hall.frame_buffers, hall.aligner, lambda *_: None, current_pulse=lambda: 20, max_ahead=50
    )
    far = 2**40
    unit = dataclasses.replace(encoded(0)[0], pulse=far)
    hall.handle("video", video("c0", unit))
    hall.handle("tracks", tracks(word("c0", far // STRIDE, {})))
    hall.handle("thumbs", thumbnail("c0", 1, b"jpeg", pulse=far))
    assert hall.bad() == 3
    assert hall.frame_buffers["c0"].newest == -1
    assert not hall.ingest.thumbnails
    hall.handle("tracks", tracks(word("c0", 0, {})))
    hall.handle("tracks", tracks(word("c1", 0, {})))
    assert [epoch.number for epoch in hall.aligner.ready(now=4)] == [0]


def test_thumbnails_are_limited_for_each_camera() -> None:
    hall = Hall()
    hall.ingest.thumbnail(thumbnail("c1", 7, b"jpeg"))
    for track in range(1200):
        hall.ingest.thumbnail(thumbnail("c0", track, b"jpeg"))
    assert len(hall.ingest.thumbnails) == 301
    assert ("c0", 1, 1199) in hall.ingest.thumbnails
    assert ("c1", 1, 7) in hall.ingest.thumbnails


def test_an_invalid_thumbnail_is_counted_and_dropped() -> None:
    hall = Hall()
    hall.ingest.thumbnail(thumbnail("c0", 1, bytes(1 << 18)))
    assert hall.bad() == 1
    assert not hall.ingest.thumbnails


def test_a_flapping_camera_writes_few_log_lines(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    hall = Hall()
    caplog.clear()
    for there in (False, True) * 50:
        hall.ingest.alive(KEYS.camera("c0", "alive"), is_present=there)
    assert caplog.messages == ["camera c0 disconnected", "camera c0 connected"] * 4 + [
        "camera c0 disconnected"
    ]


def test_a_status_is_kept() -> None:
    hall = Hall()
    hall.ingest.status(status("c0", fps=24.5))
    told = hall.ingest.states["c0"].status
    assert told is not None
    assert told.fps == 24.5


def test_frames_and_tracks_become_epochs() -> None:
    hall = Hall()
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed)[:STRIDE]:
            hall.ingest.video(video(camera, unit))
        hall.ingest.tracks(tracks(word(camera, 0, {1: LARGE})))
    [epoch] = hall.aligner.ready(now=4)
    assert list(epoch.tracks) == list(CAMERAS)
    assert len(hall.frames) == 2 * STRIDE
