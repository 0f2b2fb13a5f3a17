"""Target for identity snapshots of cameras, received by a new best view."""

from __future__ import annotations

from random import Random

import msgspec

from benchmarks.fuzz.bus.damaged_messages import damaged_message
from benchmarks.fuzz.engine.fed_site import CAMERAS, FPS, HEIGHT, KEYS, STRIDE, WIDTH, make_tracks, site
from benchmarks.fuzz.engine.target import ScriptTarget
from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot, PersonSnapshot
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.state_replication import StateReplication
from server.service.ingest.epoch_aligner import Epoch

_SNAPSHOTS = 12
_EPOCHS = 2
_script = msgspec.msgpack.Decoder(tuple[int, list[tuple[str, bytes]]])


class RetainedStates(ScriptTarget):
    """Target for identity snapshots: valid, damaged, or of other people."""

    name = "bus-retained-state"

    def __init__(self) -> None:
        self._config = site()

    def make(self, rng: Random) -> bytes:
        """Return some snapshots, and the seed of the people who follow."""
        script = []
        for _ in range(_SNAPSHOTS):
            camera = rng.choice(CAMERAS)
            snapshot = CameraIdentitySnapshot(
                pulse=rng.randrange(40),
                boot=rng.randrange(1, 3),
                next_number=rng.randrange(1, 9),
                numbered_since=rng.random(),
                people=[self._person_snapshot(rng) for _ in range(rng.randrange(4))],
            )
            payload = msgspec.msgpack.encode(snapshot)
            message = Message(KEYS.camera(camera, "retained_identities"), payload, b"")
            sent = damaged_message(rng, message) if rng.random() < 0.5 else message
            script.append((sent.key, sent.payload))
        return msgspec.msgpack.encode((rng.randrange(1000), script))

    @staticmethod
    def _person_snapshot(rng: Random) -> PersonSnapshot:
        return PersonSnapshot(
            number=rng.randrange(1, 8),
            tracks=[rng.randrange(5) for _ in range(rng.randrange(3))],
            aliases=[rng.randrange(1, 8) for _ in range(rng.randrange(3))],
            name=rng.choice(("", "Ann", "Bob")),
            manual=rng.random() < 0.3,
        )

    def feed(self, data: bytes) -> bool:
        """Recover from the snapshots, track people for a while, and replicate to the cameras."""
        seed, script = _script.decode(data)
        published: list[bytes] = []
        people = PersonTracker(
            self._config.view.identity, CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=0, fps=FPS
        )
        replication = StateReplication(people, CAMERAS, FPS, lambda _, payload: published.append(payload))
        for camera in CAMERAS:
            replication.set_present(KEYS.camera(camera, "alive"), is_present=True)
        bad = 0
        for key, payload in script:
            self.messages += 1
            try:
                replication.receive_snapshot(Message(key, payload, b""))
            except DECODE_ERRORS:
                bad += 1
        rng = Random(seed)
        for epoch in range(_EPOCHS):
            last = end_of_epoch(30 // STRIDE + epoch, STRIDE)
            replication.begin(last)
            track_messages = [make_tracks(rng, camera, last // STRIDE) for camera in CAMERAS]
            people.update(
                Epoch(last // STRIDE, last, {message.camera: message for message in track_messages})
            )
            replication.advance(last)
            assert not set(people.registry.merged) & set(people.registry.all_numbers), (
                "a merged number is still in use"
            )
        for payload in published:
            msgspec.msgpack.decode(payload, type=CameraIdentitySnapshot)
        return not bad
