"""What cameras remember of who is who, said to a best view that has just begun."""

from __future__ import annotations

from random import Random

import msgspec

from benchmarks.fuzz.bus.damaged_messages import wrong
from benchmarks.fuzz.engine.fed_site import CAMERAS, FPS, HEIGHT, KEYS, STRIDE, WIDTH, site, word
from benchmarks.fuzz.engine.target import ScriptTarget
from server.messaging.epochs import end_of_epoch
from server.messaging.identity_snapshot import IdentitySnapshot, PersonSnapshot
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.service.identity.people import PersonTracker
from server.service.identity.state_replication import StateReplication
from server.service.ingest.epoch_aligner import Epoch

_SAID = 12
_EPOCHS = 2
_script = msgspec.msgpack.Decoder(tuple[int, list[tuple[str, bytes]]])


class RetainedStates(ScriptTarget):
    """What cameras say, again and again: memories that are right, wrong in something, or of somebody else."""

    name = "bus-retained-state"

    def __init__(self) -> None:
        self._config = site()

    def make(self, rng: Random) -> bytes:
        """Return some memories, and by what the people of the site walk."""
        script = []
        for _ in range(_SAID):
            camera = rng.choice(CAMERAS)
            said = IdentitySnapshot(
                pulse=rng.randrange(40),
                boot=rng.randrange(1, 3),
                next_number=rng.randrange(1, 9),
                numbered_since=rng.random(),
                people=[self._somebody(rng) for _ in range(rng.randrange(4))],
            )
            message = Message(KEYS.camera(camera, "retained_identities"), msgspec.json.encode(said), b"")
            it = wrong(rng, message) if rng.random() < 0.5 else message
            script.append((it.key, it.payload))
        return msgspec.msgpack.encode((rng.randrange(1000), script))

    @staticmethod
    def _somebody(rng: Random) -> PersonSnapshot:
        return PersonSnapshot(
            number=rng.randrange(1, 8),
            tracks=[rng.randrange(5) for _ in range(rng.randrange(3))],
            aliases=[rng.randrange(1, 8) for _ in range(rng.randrange(3))],
            name=rng.choice(("", "Ann", "Bob")),
            manual=rng.random() < 0.3,
        )

    def feed(self, data: bytes) -> bool:
        """Begin with them, follow people for a while, and tell the cameras."""
        seed, script = _script.decode(data)
        told: list[bytes] = []
        people = PersonTracker(
            self._config.view.identity, CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=0, fps=FPS
        )
        it = StateReplication(people, CAMERAS, FPS, lambda _, payload: told.append(payload))
        for camera in CAMERAS:
            it.alive(KEYS.camera(camera, "alive"), is_present=True)
        wrong = 0
        for key, payload in script:
            self.messages += 1
            try:
                it.snapshot_received(Message(key, payload, b""))
            except DECODE_ERRORS:
                wrong += 1
        rng = Random(seed)
        for epoch in range(_EPOCHS):
            last = end_of_epoch(30 // STRIDE + epoch, STRIDE)
            it.begin(last)
            words = [word(rng, camera, last // STRIDE) for camera in CAMERAS]
            people.update(Epoch(last // STRIDE, last, {said.camera: said for said in words}))
            it.advance(last)
            assert not set(people.registry.merged) & set(people.registry.everybody), (
                "a number that is another's is somebody's"
            )
        for payload in told:
            msgspec.json.decode(payload, type=IdentitySnapshot)
        return not wrong
