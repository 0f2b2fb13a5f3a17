"""Single pictures: everybody who asks at one moment is given the same one."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from server.media.rendering_messages import Jpeg, Still


@dataclass(slots=True)
class _Wish:
    pulse: int
    given: asyncio.Event
    picture: Jpeg | None = None


class Stills:
    """Who waits for a picture with boxes or without, and from which frame on it is new enough."""

    def __init__(self) -> None:
        self._wishes: dict[Still, _Wish] = {}
        self.asked = asyncio.Event()
        """Somebody has asked since it was cleared."""

    async def get(self, kind: Still, pulse: int) -> Jpeg | None:
        """Wait for a picture of this frame or a newer one; None: there will be none."""
        while True:
            wish = self._wishes.get(kind)
            if wish is None:
                wish = self._wishes[kind] = _Wish(pulse, asyncio.Event())
            self.asked.set()
            await wish.given.wait()
            if wish.picture is None or wish.picture.pulse >= pulse:
                return wish.picture  # else it was good enough for who has asked before

    def possible(self, newest: int) -> list[Still]:
        """List what can be given when ``newest`` is the newest frame."""
        return [kind for kind, wish in self._wishes.items() if wish.pulse <= newest]

    def give(self, kind: Still, picture: Jpeg | None) -> None:
        """Give everybody their picture."""
        wish = self._wishes.pop(kind)
        wish.picture = picture
        wish.given.set()

    def close(self) -> None:
        """Tell everybody who waits that there will be none."""
        for kind in list(self._wishes):
            self.give(kind, None)
