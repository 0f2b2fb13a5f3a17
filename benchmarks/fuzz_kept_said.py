"""What was said of people by hand, read by the next service after somebody has damaged it."""

from __future__ import annotations

import asyncio
import pickle
from pathlib import Path
from random import Random
from typing import Any

import msgspec

from benchmarks.fuzz_kept_runs import WORDS
from benchmarks.fuzz_mutate import as_json, damaged, otherwise
from benchmarks.fuzz_site import CAMERAS, KEYS, STRIDE, Fed, one_each, site, tracks
from benchmarks.fuzz_target import Target, folder
from server.view.by_hand_file import NAME, ByHandFile
from server.view.people import People
from server.wire.epochs import end_of_epoch

_LATER = 10_000


class Said(Target):
    """What was said of people by hand: whoever is found again is given it back, and it is written anew."""

    name = "kept-said"

    def __init__(self) -> None:
        self._folder = folder()
        self._path = Path(self._folder.name)
        self._loop = asyncio.new_event_loop()
        people = self._loop.run_until_complete(self._met())
        self._unnamed = pickle.dumps(people)
        self._begin()
        people.call(people.known[0], "Ada")
        file = ByHandFile(self._path, KEYS.site, 25.0)
        file.open()
        file.take(people, 2 * STRIDE)
        file.close()
        self._right: Any = msgspec.json.decode((self._path / NAME).read_bytes())
        self._right["people"].append({**self._right["people"][0], "merged": True})

    def _begin(self) -> None:
        """Have people about whom nothing was said; to let them be met takes forty times as long."""
        self._people: People = pickle.loads(self._unnamed)  # noqa: S301 — our own

    @staticmethod
    async def _met() -> People:
        service, rng = Fed(site()), Random(3)
        for epoch in range(2):
            for camera in CAMERAS:
                service.handle(tracks(one_each(rng, camera, epoch)))
            service.pulse = end_of_epoch(epoch, STRIDE)
            service.decide()
        return service.decider.people

    def make(self, rng: Random) -> bytes:
        """Give a file."""
        right = {**self._right, "pulse": rng.choice((0, 5, 9, 10**15))}
        return as_json(otherwise(rng, right)) if rng.random() < 0.7 else damaged(rng, as_json(right), WORDS)

    def feed(self, data: bytes) -> bool:
        """Come back to it."""
        (self._path / NAME).write_bytes(data)
        people = self._people
        file = ByHandFile(self._path, KEYS.site, 25.0)
        file.open()
        try:
            for pulse in (end_of_epoch(1, STRIDE), end_of_epoch(2, STRIDE), _LATER):
                file.take(people, pulse)
        finally:
            file.close()
        taken = bool(people.names or people.merged_by_hand)
        if taken:
            self._begin()
        return taken

    def close(self) -> None:
        """Take the folder away."""
        self._loop.close()
        self._folder.cleanup()
