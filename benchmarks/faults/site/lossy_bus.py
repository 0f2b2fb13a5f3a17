"""A bus that loses, duplicates and reorders messages: a process between the cameras and their receivers.

    python -m benchmarks.faults.site.lossy_bus CONNECT c0=LISTEN c1=LISTEN ...

has a router for each camera. A camera's messages are forwarded to the best view's router, its detections to
the other cameras; an operator's corrections go the other way. A line on standard input sets the mode: plain,
lost, doubled or disordered; the answer is the number of altered messages so far, by kind. Three in ten of all
messages except pictures are altered, by a seeded random generator.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
from collections import Counter
from collections.abc import Mapping
from typing import Protocol

from server.config.sections import ZenohSettings
from server.messaging.bus import Bus
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys, camera_of_key
from server.supervisor.shutdown import run_process
from server.system.child_process import terminate_with_parent

SITE = "faults"
SHARE = 0.3
PICTURES = "video"
FOUND = "detections"
CORRECTIONS = "position_corrections"
_FROM_CAMERAS = (PICTURES, "tracks", "status", "thumbs/*", FOUND)
_DELAY = 2
"""Number of messages with the same key after which a delayed message is sent."""
_KIND = 4


def kind_of(key: str) -> str:
    """Return the kind of a camera's message, such as ``tracks``."""
    return key.split("/")[_KIND]


class MessageSink(Protocol):
    """What messages are published to, such as a bus."""

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message."""


class LossyLink:
    """Forwards messages, and alters some of them."""

    def __init__(self, sink: MessageSink) -> None:
        self._sink, self.mode = sink, "plain"
        self._random = random.Random(1)
        self._delayed: dict[str, list[tuple[int, Message]]] = {}
        self.altered: Counter[str] = Counter()
        """Altered messages, by kind."""

    def forward(self, message: Message) -> None:
        """Forward a message, or drop, duplicate or delay it."""
        kind = kind_of(message.key)
        altered = self.mode != "plain" and kind != PICTURES and self._random.random() < SHARE
        self.altered[kind] += altered
        delayed = [
            (left - 1, delayed_message) for left, delayed_message in self._delayed.pop(message.key, ())
        ]
        if altered and self.mode == "disordered":
            delayed.append((_DELAY, message))
        elif not (altered and self.mode == "lost"):
            self._forward(message)
        if altered and self.mode == "doubled":
            self._forward(message)
        for left, delayed_message in delayed:
            if left <= 0:
                self._forward(delayed_message)
        if waiting := [(left, delayed_message) for left, delayed_message in delayed if left > 0]:
            self._delayed[message.key] = waiting

    def _forward(self, message: Message) -> None:
        self._sink.publish(message.key, message.payload, message.attachment)


class MessageRouter:
    """Sends each message to its receivers: other cameras, one camera, or the best view."""

    def __init__(self, cameras: Mapping[str, MessageSink], bestview: MessageSink) -> None:
        self._cameras, self._bestview = cameras, bestview

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message."""
        for receiver in self._receivers(camera_of_key(key), kind_of(key)):
            receiver.publish(key, payload, attachment)

    def _receivers(self, camera: str, kind: str) -> list[MessageSink]:
        if kind == FOUND:
            return [bus for other, bus in self._cameras.items() if other != camera]
        return [self._cameras[camera] if kind == CORRECTIONS else self._bestview]


class _BestViewLiveliness:
    """Mirrors the cameras' liveliness tokens at the best view's router, one session each."""

    def __init__(self, settings: ZenohSettings) -> None:
        self._settings = settings
        self._sessions: dict[str, Bus] = {}

    def update(self, key: str, alive: bool) -> None:
        """Declare or withdraw a token."""
        if alive and key not in self._sessions:
            self._sessions[key] = Bus.client(self._settings)
            self._sessions[key].declare_alive(key)
        elif not alive and key in self._sessions:
            self._sessions.pop(key).close()


class _RouterLiveliness:
    """Mirrors liveliness tokens at some routers, for the life of this process."""

    def __init__(self, *routers: Bus) -> None:
        self._routers, self._declared = routers, set[str]()

    def update(self, key: str, alive: bool) -> None:
        """Declare a token once."""
        if alive and key not in self._declared:
            self._declared.add(key)
            for router in self._routers:
                router.declare_alive(key)


async def _run() -> None:
    connect = ZenohSettings(connect=sys.argv[1])
    listens = dict(word.split("=", 1) for word in sys.argv[2:])
    near = {camera: Bus.router(ZenohSettings(listen=address)) for camera, address in listens.items()}
    far, keys, liveliness = Bus.client(connect), ZenohKeys(SITE), _BestViewLiveliness(connect)
    link = LossyLink(MessageRouter(near, far))
    for camera, router in near.items():
        for kind in _FROM_CAMERAS:
            router.subscribe(keys.camera(camera, kind), link.forward)
        others = [bus for other, bus in near.items() if other != camera]
        router.watch_alive(keys.camera(camera, "peer_listener"), _RouterLiveliness(*others).update)
        router.watch_alive(keys.camera(camera, "alive"), liveliness.update)
    far.subscribe(keys.camera("*", CORRECTIONS), link.forward)
    far.watch_alive(keys.bestview("alive"), _RouterLiveliness(*near.values()).update)
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin.buffer
    )
    while word := await reader.readline():
        link.mode = word.decode().strip()
        print(json.dumps(link.altered), flush=True)


def main() -> None:
    """Run until terminated."""
    terminate_with_parent()
    run_process(_run)


if __name__ == "__main__":
    main()
