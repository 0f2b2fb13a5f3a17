"""Implausible messages of one camera do not affect the people and streams of another."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from prometheus_client import generate_latest

from benchmarks.fuzz.engine.mutations import as_message
from fakes.service.scripted_cameras import (
    CAMERAS,
    GOP,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    camera_tracks,
    encoded,
    small_config,
    status,
    thumbnail,
    tracks,
    video,
)
from server.http.app import make_app
from server.http.metrics.http_collector import METRICS
from server.media.audio.audio_format import AudioFormat
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import (
    AUDIO_FRAMES_MAX,
    TRACKS_MAX,
    AudioHeader,
    CameraTracks,
    GopChoices,
    TrackMessage,
    ZenohKeys,
)
from server.messaging.packed_arrays import pack_boxes
from server.service.service import BestViewService
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.media_chunk import MediaChunk

KEYS = ZenohKeys("hall")
LIAR, OTHER = CAMERAS
EPOCHS = 8
FAR = 500_000_000_000
"""A pulse within the allowed range, far in the future."""
LyingMessages = Callable[[int], Sequence[Message]]
"""The messages that the camera sends at an epoch."""


def frames(epoch: int, /, **changes: Any) -> list[Message]:
    """Return an epoch's frames of the lying camera with changed headers."""
    sent = [video(LIAR, unit) for unit in encoded(0)[epoch * STRIDE : (epoch + 1) * STRIDE]]
    return [
        Message(
            message.key,
            message.payload,
            as_message(msgspec.msgpack.decode(message.attachment) | changes),
        )
        for message in sent
    ]


def altered_tracks(epoch: int, /, **changes: Any) -> list[Message]:
    """Return its track message of an epoch with changed fields."""
    fields = msgspec.to_builtins(camera_tracks(LIAR, epoch, {1: SMALL}), builtin_types=(bytes,))
    return [Message(KEYS.camera(LIAR, "tracks"), as_message(fields | changes), b"")]


def altered_track(epoch: int, /, **changes: Any) -> list[Message]:
    (track,) = msgspec.to_builtins(camera_tracks(LIAR, epoch, {1: SMALL}), builtin_types=(bytes,))["tracks"]
    return altered_tracks(epoch, tracks=[track | changes])


def too_many_tracks(epoch: int) -> list[Message]:
    boxes = [SMALL] * STRIDE
    track_messages = [
        TrackMessage(id=number, boxes=pack_boxes(boxes), confidence=1.0) for number in range(TRACKS_MAX + 1)
    ]
    return altered_tracks(epoch, tracks=msgspec.to_builtins(track_messages))


SOLVED = {"objective": 1.0, "bound": 1.0, "gap": 0.0, "integral": True, "rounds": 1}
REFUSED: dict[str, LyingMessages] = {
    "frames far ahead": lambda epoch: frames(epoch, pulse=FAR + epoch),
    "frames of 2^53": lambda epoch: frames(epoch, pulse=2**53 + epoch),
    "frames of 2^63": lambda epoch: frames(epoch, pulse=2**63 + epoch),
    "reference to an impossible frame": lambda epoch: frames(epoch, reference_pulse=2**63),
    "impossible capture time": lambda epoch: frames(epoch, due=-1e308, captured_at=1e308),
    "windows far ahead": lambda epoch: altered_tracks(
        epoch, epoch=FAR, first=FAR * STRIDE, last=FAR * STRIDE - 1, final_to=FAR * STRIDE - 1, tracks=[]
    ),
    "final far ahead": lambda epoch: altered_tracks(epoch, final_to=FAR),
    "final to 2^63": lambda epoch: altered_tracks(epoch, final_to=2**63, revised_from=epoch * STRIDE),
    "without detection far ahead": lambda epoch: altered_tracks(
        epoch, without_detection=list(range(FAR, FAR + 1000))
    ),
    "shed far ahead": lambda epoch: altered_tracks(epoch, shed=[FAR]),
    "without peers far ahead": lambda epoch: altered_tracks(epoch, without_peers=[FAR]),
    "impossible solution time": lambda epoch: altered_tracks(epoch, solved_at=1e308),
    "infinite gap": lambda epoch: altered_tracks(epoch, solve=SOLVED | {"gap": 1e308}),
    "infinite confidence": lambda epoch: altered_track(epoch, confidence=1e308),
    "too many tracks": too_many_tracks,
    "infinite frame rate": lambda _: [status(LIAR, fps=1e308)],
    "infinite clock offset": lambda _: [status(LIAR, clock_offset=-1e308)],
    "at pulse 10^18": lambda _: [status(LIAR, pulse=10**18)],
    "state of a million characters": lambda _: [status(LIAR, state="x" * 10**6)],
    "half a histogram value": lambda epoch: altered_track(
        epoch, appearance=[{"first": epoch * STRIDE, "last": epoch * STRIDE, "histogram": bytes(7)}]
    ),
    "infinite box": lambda epoch: altered_track(
        epoch, boxes=np.full(4 * STRIDE, np.inf, dtype="<f4").tobytes()
    ),
    "half a box": lambda epoch: altered_track(epoch, boxes=bytes(16 * STRIDE - 8)),
    "histogram of too many colors": lambda epoch: altered_track(
        epoch, appearance=[{"first": epoch * STRIDE, "last": epoch * STRIDE, "histogram": bytes(20_000)}]
    ),
    "thumbnails far ahead": lambda _: [thumbnail(LIAR, 1, b"jpeg", pulse=FAR)],
    "thumbnails that are too large": lambda _: [thumbnail(LIAR, 1, bytes(10**6))],
}
ACCEPTED: dict[str, LyingMessages] = {
    "nothing": lambda _: [],
    "frames of the past": lambda epoch: frames(epoch, pulse=epoch),
    "frames a minute ahead": lambda epoch: frames(epoch, pulse=1400 + epoch),
    "windows a minute ahead": lambda epoch: [
        track for ahead in range(40) for track in correct_tracks(epoch + ahead)
    ],
    "a new boot at every epoch": lambda epoch: [
        *frames(epoch, boot=epoch),
        *altered_tracks(epoch, boot=epoch),
    ],
    "ended at every epoch": lambda epoch: [*frames(epoch), *altered_tracks(epoch, ended=True)],
    "pictures of any size": lambda epoch: altered_tracks(epoch, size=[1 + epoch * 997, 1 + epoch * 31]),
    "largest boxes": lambda epoch: altered_track(epoch, boxes=pack_boxes([(-1e6, -1e6, 1e6, 1e6)] * STRIDE)),
    "inverted boxes": lambda epoch: altered_track(epoch, boxes=pack_boxes([(1e6, 1e6, -1e6, -1e6)] * STRIDE)),
    "histograms of changing length": lambda epoch: altered_track(
        epoch,
        appearance=[
            {"first": epoch * STRIDE, "last": epoch * STRIDE, "histogram": b"\x01\x00" * (8 + epoch)}
        ],
    ),
    "changing track ids": lambda epoch: altered_track(epoch, id=2**62 - epoch),
    "endless thumbnails": lambda epoch: [
        thumbnail(LIAR, epoch * 1000 + number, b"jpeg", pulse=epoch) for number in range(400)
    ],
}


def correct_tracks(epoch: int) -> list[Message]:
    return [tracks(camera_tracks(LIAR, epoch, {1: SMALL}))]


def deliver(service: FedService, message: Message) -> None:
    kind = message.key.split("/")[4]
    ingest = service.ingest
    handlers = {
        "video": ingest.receive_video,
        "tracks": ingest.receive_tracks,
        "status": ingest.receive_status,
    }
    handlers.get(kind, ingest.receive_thumbnail)(message)


class LyingSite:
    """Two cameras send some epochs, one of them implausible messages; all is decided."""

    def __init__(self, lying_messages: LyingMessages) -> None:
        self.service = service = FedService(small_config())
        self.decided: list[GopChoices] = []
        service.on_decision.append(self.decided.append)
        service.connect_cameras(*CAMERAS)
        self._viewer = service.splicer.decided_cameras[OTHER].subscribe()
        self.shown: list[MediaChunk] = []
        """The chunks sent to viewers of the other camera."""
        service.pulses.newest = 0
        service.ingest.receive_video(video(OTHER, encoded(1)[0]))
        for epoch in range(EPOCHS):
            self._send(epoch)
            for message in lying_messages(epoch):
                deliver(service, message)
            self._pass(end_of_epoch(epoch, STRIDE))
        self.last = end_of_epoch(EPOCHS - 2, STRIDE)
        """The last pulse whose look-ahead is complete."""
        # The lying camera is waited for only so long.
        self._pass(service.pulses.newest + service.aligner._grace + service.aligner._backlog + 1)

    def _send(self, epoch: int) -> None:
        ingest = self.service.ingest
        for unit in encoded(1)[epoch * STRIDE : (epoch + 1) * STRIDE]:
            ingest.receive_video(video(OTHER, unit))
        ingest.receive_tracks(tracks(camera_tracks(OTHER, epoch, {7: LARGE})))
        ingest.receive_status(status(OTHER))
        ingest.receive_thumbnail(thumbnail(OTHER, 7, b"jpeg", pulse=end_of_epoch(epoch, STRIDE)))

    def _pass(self, pulse: int) -> None:
        while self.service.pulses.newest < pulse:
            self.service.pulses.newest += 1
            self.service.decide()
            self.shown += [chunk for chunk in self._viewer._queue if isinstance(chunk, MediaChunk)]
            self._viewer._queue.clear()


def check_reported_values(service: FedService) -> None:
    """Check that diagnostics and metrics have only finite numbers."""
    facade = BestViewService(service)
    for camera in facade.cameras.diagnose_cameras():
        json.loads(msgspec.json.encode(camera), parse_constant=pytest.fail)
    for line in generate_latest(make_app(facade)[METRICS]).decode().splitlines():
        assert line.startswith("#") or line.rpartition(" ")[2] not in {"NaN", "+Inf", "-Inf"}, line


@pytest.mark.parametrize("name", [*REFUSED, *ACCEPTED])
async def test_implausible_messages_of_one_camera_do_not_affect_the_other(name: str) -> None:
    lying_messages = (REFUSED | ACCEPTED)[name]
    site = LyingSite(lying_messages)
    service, people = site.service, site.service.decider.people
    number = people.person_of(OTHER, 1, 7, site.last)
    assert number is not None, "its person has a number"
    assert number < 20
    decisions = [decision for decision in site.decided if STRIDE <= decision.first <= site.last]
    assert [decision.first for decision in decisions] == list(range(STRIDE, site.last, GOP)), (
        "every GOP is decided in order"
    )
    assert all(decision.choices.get(number) in CAMERAS for decision in decisions), (
        "the person is always shown"
    )
    sent = [picture.pulse for chunk in site.shown for picture in chunk.pictures]
    assert [pulse for pulse in sent if pulse <= site.last] == list(range(site.last + 1)), (
        "the stream continues"
    )
    assert any(camera == OTHER for camera, *_ in service.ingest.thumbnails)
    states = service.ingest.states
    assert states[OTHER].bad_messages == 0
    assert (states[LIAR].bad_messages > 0) == (name in REFUSED)
    assert sum(map(len, people.undetected._frames.values())) < 1000
    check_reported_values(service)


def test_finishing_decides_no_pulses_beyond_the_last_epoch() -> None:
    """Before the first pulse a frame far ahead cannot be recognized."""
    service = FedService(small_config())
    service.connect_cameras(*CAMERAS)
    service.ingest.receive_video(video(LIAR, replace(encoded(0)[0], pulse=FAR)))
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed)[: 2 * STRIDE]:
            service.ingest.receive_video(video(camera, unit))
        service.ingest.receive_tracks(tracks(camera_tracks(camera, 0, {1: LARGE})))
        service.ingest.receive_tracks(tracks(camera_tracks(camera, 1, {1: LARGE}, ended=True)))
    service.pulses.newest = 2 * STRIDE - 1
    service.decide()
    assert service.aligner.all_ended_and_decided
    decisions = list(itertools.islice(service.finish(), 10))
    assert decisions[-1].first + decisions[-1].frames == 2 * STRIDE


def test_an_audio_message_with_too_many_frames_is_refused_quickly() -> None:
    head = {"first": 2**62, "sizes": [1] * (AUDIO_FRAMES_MAX + 1)}
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(as_message(head), type=AudioHeader)
    frame_buffer = AudioBuffer(AudioFormat(48_000, 2), 25.0, 10.0)
    for first in range(0, 20 * AUDIO_FRAMES_MAX, AUDIO_FRAMES_MAX):
        frame_buffer.put(AudioHeader(first=first, sizes=[1] * AUDIO_FRAMES_MAX), bytes(AUDIO_FRAMES_MAX))
    assert len(frame_buffer._frames) == 469


def test_unaltered_scripted_messages_equal_a_cameras() -> None:
    messages = [video(LIAR, unit) for unit in encoded(0)[:STRIDE]]
    assert [msgspec.msgpack.decode(frame.attachment) for frame in frames(0)] == [
        msgspec.msgpack.decode(message.attachment) for message in messages
    ]
    assert msgspec.msgpack.decode(altered_tracks(1)[0].payload, type=CameraTracks) == camera_tracks(
        LIAR, 1, {1: SMALL}
    )
