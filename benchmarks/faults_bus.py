"""A bus that loses, doubles and disorders messages: a process between the cameras and the best view.

    python -m benchmarks.faults_bus LISTEN CONNECT

is the router that cameras connect to; what they say it passes on to the best view's router. A word on its
standard input says how: plain, lost, doubled or disordered, and how many that has befallen so far is printed.
It happens to three in ten of all messages but pictures, by numbers drawn from a seed.
"""

from __future__ import annotations

import asyncio
import random
import sys
from typing import Protocol

from server.run.ending import end_with_parent, run_process
from server.wire.bus import Bus
from server.wire.inbox import Message
from server.wire.messages import Keys
from server.wire.sections import Zenoh

SITE = "faults"
SHARE = 0.3
_LATER = 3
"""A message that is held back comes after so many others of its camera."""


class Sends(Protocol):
    """What a message can be passed on to, such as a bus."""

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message."""


class Way:
    """Passes messages on, more or less."""

    def __init__(self, to: Sends) -> None:
        self._to, self.how = to, "plain"
        self._random = random.Random(1)
        self._held: list[tuple[int, Message]] = []
        self.faulty = 0
        """Messages that something was done to."""

    def take(self, message: Message) -> None:
        """Pass a message on, or not, or twice, or later."""
        faulty = self.how != "plain" and not message.key.endswith("/video") and self._random.random() < SHARE
        self.faulty += faulty
        self._held = [(left - 1, held) for left, held in self._held]
        if faulty and self.how == "disordered":
            self._held.append((_LATER, message))
        elif not (faulty and self.how == "lost"):
            self._pass_on(message)
        if faulty and self.how == "doubled":
            self._pass_on(message)
        for left, held in self._held:
            if left <= 0:
                self._pass_on(held)
        self._held = [(left, held) for left, held in self._held if left > 0]

    def _pass_on(self, message: Message) -> None:
        self._to.publish(message.key, message.payload, message.attachment)


class _Presence:
    """Says at the best view's router who is there, by a session each."""

    def __init__(self, settings: Zenoh) -> None:
        self._settings = settings
        self._there: dict[str, Bus] = {}

    def note(self, key: str, there: bool) -> None:
        """Note that somebody has come or gone."""
        if there and key not in self._there:
            self._there[key] = Bus.client(self._settings)
            self._there[key].declare_alive(key)
        elif not there and key in self._there:
            self._there.pop(key).close()


async def _run() -> None:
    listen, connect = sys.argv[1:3]
    there, here = Zenoh(connect=connect), Bus.router(Zenoh(listen=listen))
    far = Bus.client(there)
    way, keys = Way(far), Keys(SITE)
    presence = _Presence(there)
    for what in ("video", "tracks", "status", "thumbs/*"):
        here.subscribe(keys.camera("*", what), way.take)
    here.watch_alive(keys.camera("*", "alive"), presence.note)
    far.watch_alive(keys.bestview("alive"), lambda key, there: here.declare_alive(key) if there else None)
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin.buffer
    )
    while word := await reader.readline():
        way.how = word.decode().strip()
        print(way.faulty, flush=True)


def main() -> None:
    """Run until told to end."""
    end_with_parent()
    run_process(_run)


if __name__ == "__main__":
    main()
