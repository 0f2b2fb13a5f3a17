"""A bus that loses, doubles and disorders messages: a process between the cameras and whom they speak with.

    python -m benchmarks.faults.site.lossy_bus CONNECT c0=LISTEN c1=LISTEN ...

has a router for each camera, which nobody else connects to. What a camera says is passed on to the best
view's router, and what it has found to the other cameras; where an operator points comes the other way. A
word on its standard input says how: plain, lost, doubled or disordered; it answers with how many that has
befallen so far, by what they are. It happens to three in ten of all messages but pictures, by numbers drawn
from a seed.
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
POINTING = "position_corrections"
_FROM_CAMERAS = (PICTURES, "tracks", "status", "thumbs/*", FOUND)
_LATER = 2
"""A message that is held back comes after so many others of its key: others of its camera and kind."""
_KIND = 4


def kind_of(key: str) -> str:
    """Return what a message of a camera is, such as ``tracks``."""
    return key.split("/")[_KIND]


class MessageSink(Protocol):
    """What a message can be passed on to, such as a bus."""

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message."""


class LossyLink:
    """Passes messages on, more or less."""

    def __init__(self, to: MessageSink) -> None:
        self._to, self.how = to, "plain"
        self._random = random.Random(1)
        self._held: dict[str, list[tuple[int, Message]]] = {}
        self.faulty: Counter[str] = Counter()
        """Messages that something was done to, by what they are."""

    def take(self, message: Message) -> None:
        """Pass a message on, or not, or twice, or later."""
        kind = kind_of(message.key)
        faulty = self.how != "plain" and kind != PICTURES and self._random.random() < SHARE
        self.faulty[kind] += faulty
        held = [(left - 1, it) for left, it in self._held.pop(message.key, ())]
        if faulty and self.how == "disordered":
            held.append((_LATER, message))
        elif not (faulty and self.how == "lost"):
            self._pass_on(message)
        if faulty and self.how == "doubled":
            self._pass_on(message)
        for left, it in held:
            if left <= 0:
                self._pass_on(it)
        if waiting := [(left, it) for left, it in held if left > 0]:
            self._held[message.key] = waiting

    def _pass_on(self, message: Message) -> None:
        self._to.publish(message.key, message.payload, message.attachment)


class MessageRouter:
    """Sends each message to whom it is for: other cameras, one camera, or the best view."""

    def __init__(self, cameras: Mapping[str, MessageSink], bestview: MessageSink) -> None:
        self._cameras, self._bestview = cameras, bestview

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message."""
        for receiver in self._receivers(camera_of_key(key), kind_of(key)):
            receiver.publish(key, payload, attachment)

    def _receivers(self, camera: str, kind: str) -> list[MessageSink]:
        if kind == FOUND:
            return [bus for other, bus in self._cameras.items() if other != camera]
        return [self._cameras[camera] if kind == POINTING else self._bestview]


class _BestViewLiveliness:
    """Holds liveliness tokens at the best view's router, one session each."""

    def __init__(self, settings: ZenohSettings) -> None:
        self._settings = settings
        self._there: dict[str, Bus] = {}

    def note(self, key: str, there: bool) -> None:
        """Note that somebody has come or gone."""
        if there and key not in self._there:
            self._there[key] = Bus.client(self._settings)
            self._there[key].declare_alive(key)
        elif not there and key in self._there:
            self._there.pop(key).close()


class _RouterLiveliness:
    """Holds liveliness tokens at some routers, for the life of this process."""

    def __init__(self, *routers: Bus) -> None:
        self._routers, self._known = routers, set[str]()

    def note(self, key: str, there: bool) -> None:
        """Note that somebody has come."""
        if there and key not in self._known:
            self._known.add(key)
            for router in self._routers:
                router.declare_alive(key)


async def _run() -> None:
    there = ZenohSettings(connect=sys.argv[1])
    listens = dict(word.split("=", 1) for word in sys.argv[2:])
    near = {camera: Bus.router(ZenohSettings(listen=address)) for camera, address in listens.items()}
    far, keys, presence = Bus.client(there), ZenohKeys(SITE), _BestViewLiveliness(there)
    way = LossyLink(MessageRouter(near, far))
    for camera, router in near.items():
        for what in _FROM_CAMERAS:
            router.subscribe(keys.camera(camera, what), way.take)
        others = [bus for other, bus in near.items() if other != camera]
        router.watch_alive(keys.camera(camera, "peer_listener"), _RouterLiveliness(*others).note)
        router.watch_alive(keys.camera(camera, "alive"), presence.note)
    far.subscribe(keys.camera("*", POINTING), way.take)
    far.watch_alive(keys.bestview("alive"), _RouterLiveliness(*near.values()).note)
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin.buffer
    )
    while word := await reader.readline():
        way.how = word.decode().strip()
        print(json.dumps(way.faulty), flush=True)


def main() -> None:
    """Run until told to end."""
    terminate_with_parent()
    run_process(_run)


if __name__ == "__main__":
    main()
