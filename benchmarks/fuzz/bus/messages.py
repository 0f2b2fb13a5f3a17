"""Targets for messages from the bus: single ones, and whole sessions of a site up to its viewers' media."""

from __future__ import annotations

import asyncio
from random import Random

import msgspec
import numpy as np
from prometheus_client import generate_latest

from benchmarks.fuzz.bus.damaged_messages import damaged_message
from benchmarks.fuzz.bus.other_sites import OtherSitesMessages
from benchmarks.fuzz.bus.retained_state import RetainedStates
from benchmarks.fuzz.engine.fed_site import (
    CAMERAS,
    FPS,
    HEIGHT,
    KEYS,
    STRIDE,
    WIDTH,
    FedService,
    make_tracks,
    pictures,
    site,
    sound,
    status,
    thumbnail,
    tracks,
    video,
)
from benchmarks.fuzz.engine.target import ScriptTarget, Target
from server.camera.operator_corrections import CorrectionInbox
from server.camera.peers.detection_buffer import PeerDetectionBuffer
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.http.api.responses import cameras_info, objects_info, site_info
from server.http.app import make_app
from server.http.metrics.http_collector import METRICS
from server.media.audio.audio_format import AudioFormat
from server.media.stream_format import StreamFormat
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import FrameDetections
from server.messaging.operator_messages import CORRECTIONS_MAX, CorrectedPosition, PositionCorrections
from server.messaging.packed_arrays import pack_detections
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.service import BestViewService
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Subscriber

_EPOCHS = 3
"""Two GOPs are decided, and one is look-ahead."""
_API_EVERY = 8
Script = list[tuple[str, bytes, bytes]]
"""Messages: key, payload, attachment. An empty key is the end of an epoch."""
_script = msgspec.msgpack.Decoder(Script)
_packed = msgspec.msgpack.encode


class IngestMessages(Target):
    """One message to a new ingest."""

    name = "bus-messages"

    def __init__(self) -> None:
        self._pictures = pictures(0, 10)
        self._form = AudioFormat(48_000, 2)

    def make(self, rng: Random) -> bytes:
        """Return a message."""
        pulse = rng.randrange(10)
        message = rng.choice(
            (
                lambda: video("c0", self._pictures[pulse]),
                lambda: tracks(make_tracks(rng, "c0", pulse)),
                lambda: status("c0", pulse),
                lambda: thumbnail("c0", pulse),
                lambda: sound(pulse),
            )
        )()
        sent = damaged_message(rng, message) if rng.random() < 0.95 else message
        return _packed([(sent.key.encode("utf-8", "replace").decode(), sent.payload, sent.attachment)])

    def feed(self, data: bytes) -> bool:
        """Handle the message, and the epoch that it may complete."""
        stream_format = StreamFormat()
        frame_buffers = {camera: FrameBuffer(FPS, 50, stream_format) for camera in CAMERAS}
        aligner = EpochAligner(CAMERAS, STRIDE, grace=5)
        audio_buffer = AudioBuffer(self._form, FPS, 10.0)
        ingest = Ingest(frame_buffers, aligner, lambda *_: None, audio_buffer, audio_sender=CAMERAS[0])
        handlers = {
            "video": ingest.receive_video,
            "tracks": ingest.receive_tracks,
            "status": ingest.receive_status,
            "thumbs": ingest.receive_thumbnail,
            "unavailable": ingest.receive_unavailable,
        }
        for key, payload, head in _script.decode(data):
            message = Message(key, payload, head)
            if key == KEYS.sound:
                ingest.receive_audio(message)
            for topic, handle in handlers.items():
                if f"/{topic}" in key:
                    handle(message)
        aligner.take_ready(now=100)
        ingest.forget_thumbnails_before(1)
        return not any(state.bad_messages for state in ingest.states.values())


class PeerMessages(ScriptTarget):
    """Detections that a camera receives from another one."""

    name = "bus-detections"

    def __init__(self) -> None:
        self._exchange = PeerDetectionExchange(site(), "c0", None, 50)

    def make(self, rng: Random) -> bytes:
        """Return some messages of the other camera."""
        script: Script = []
        for pulse in range(3):
            count = rng.randrange(3)
            boxes = pack_detections(np.full((count, 4), [1.0, 2.0, 9.0, 30.0]), np.full(count, 0.9))
            detections = FrameDetections(camera="c1", boot=1, size=(WIDTH, HEIGHT), pulse=pulse, boxes=boxes)
            message = Message(KEYS.camera("c1", "detections"), msgspec.msgpack.encode(detections), b"")
            sent = damaged_message(rng, message) if rng.random() < 0.7 else message
            script.append((sent.key, sent.payload, b""))
        return _packed(script)

    def feed(self, data: bytes) -> bool:
        """Handle the messages."""
        buffer, bad = PeerDetectionBuffer(("c1",), 50, lambda _: True), self._exchange.bad_messages
        for pulse, (_, payload, _) in enumerate(_script.decode(data)):
            self.messages += 1
            # The bus delivers only the subscribed key.
            received = self._exchange._decode(Message(KEYS.camera("c1", "detections"), payload, b""))
            if received is not None and received.camera == "c1":
                buffer.put(received, 0.0)
            buffer.expect(pulse, 1.0)
            buffer.must_wait(pulse)
            buffer.give_up(pulse)
            buffer.detections_at(pulse)
        return self._exchange.bad_messages == bad


class OperatorPlaces(ScriptTarget):
    """Position corrections of an operator that a camera receives."""

    name = "bus-operator-points"

    def make(self, rng: Random) -> bytes:
        """Return some messages of the best view."""
        script: Script = []
        for pulse in range(3):
            place = CorrectedPosition(pulse=pulse, track=1, x=9.0, y=9.0, tolerance=rng.random() + 0.1)
            points = [place] * rng.randrange(3)
            payload = msgspec.msgpack.encode(PositionCorrections(boot=1, corrections=points))
            message = Message(KEYS.camera("c0", "position_corrections"), payload, b"")
            sent = damaged_message(rng, message) if rng.random() < 0.7 else message
            script.append((sent.key, sent.payload, b""))
        return _packed(script)

    def feed(self, data: bytes) -> bool:
        """Handle the messages."""
        inbox = CorrectionInbox("c0", 1)
        for key, payload, _ in _script.decode(data):
            self.messages += 1
            inbox.put(Message(key, payload, b""))
            assert len(inbox.take()) <= CORRECTIONS_MAX
        return not inbox.bad_messages


class SiteSessions(ScriptTarget):
    """A site over some epochs with damaged, lost, duplicated and reordered messages; its API is read, too."""

    name = "bus-sessions"

    def __init__(self) -> None:
        self._pictures = [pictures(seed, _EPOCHS * STRIDE) for seed in range(len(CAMERAS))]
        self._config = site()
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Return some hundred messages, some of them damaged."""
        script: Script = []
        share = rng.choice((0.0, 0.02, 0.02, 0.1, 0.5))
        only_second_camera = rng.random() < 0.5
        for epoch in range(_EPOCHS):
            messages = [sound(epoch)]
            for seed, camera in enumerate(CAMERAS):
                messages += [
                    video(camera, picture) for picture in self._pictures[seed][epoch * STRIDE :][:STRIDE]
                ]
                messages += [
                    tracks(make_tracks(rng, camera, epoch)),
                    status(camera, epoch),
                    thumbnail(camera, epoch),
                ]
            for message in messages:
                if rng.random() >= share or (only_second_camera and "c1" not in message.key):
                    sent = [message]
                else:
                    sent = rng.choice(
                        ([], [message] * 2, [damaged_message(rng, message)], [damaged_message(rng, message)])
                    )
                script += [(_plain(message.key), message.payload, message.attachment) for message in sent]
            if rng.random() < share:
                at = rng.randrange(len(script) + 1)
                alive = (KEYS.camera(rng.choice(CAMERAS), "alive"), rng.choice((b"0", b"1")), b"")
                script.insert(at, alive)
                rng.shuffle(script[-20:])
            script.append(("", b"", b""))
        return _packed(script)

    def feed(self, data: bytes) -> bool:
        """Run the session."""
        return self._loop.run_until_complete(self._session(_script.decode(data)))

    async def _session(self, script: Script) -> bool:
        service = FedService(self._config)
        service.stream_format.accept(self._pictures[0][0].data)
        viewers = [
            broadcaster.subscribe()
            for broadcaster in (*service.splicer.cameras.values(), *service.splicer.decided_cameras.values())
        ]
        epoch = 0
        for key, payload, head in script:
            if key:
                self.messages += 1
                service.handle(Message(key, payload, head))
                continue
            service.pulses.newest = end_of_epoch(epoch, STRIDE)
            epoch += 1
            service.decide()
        service.pulses.newest += 2 * STRIDE
        service.decide()
        if len(script) % _API_EVERY == 0:
            read_api(service)
        for viewer in viewers:
            drain(viewer)
        return service.dropped == 0

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


def read_api(service: FedService) -> None:
    """Read everything in a service's API."""
    facade = BestViewService(service)
    for content in (site_info(facade), objects_info(facade), cameras_info(facade)):
        msgspec.json.encode(content)
    for number in [*service.decision_state.selected_views, 99]:
        msgspec.json.encode(facade.people.view_selection_of(number))
    generate_latest(make_app(facade)[METRICS])


def drain(subscriber: Subscriber) -> None:
    """Read all queued media of a subscriber in every container format, and empty the queue."""
    for piece in list(subscriber._queue):
        if isinstance(piece, MediaChunk):
            assert piece.data
            assert piece.mpegts
            assert piece.data_with_audio
    subscriber._queue.clear()


def _plain(key: str) -> str:
    return key.encode("utf-8", "replace").decode()


TARGETS = (IngestMessages, PeerMessages, OperatorPlaces, RetainedStates, OtherSitesMessages, SiteSessions)
