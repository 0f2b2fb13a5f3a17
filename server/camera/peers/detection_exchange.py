"""A camera among others on the bus: it tells what it found in each frame, and waits a little for them."""

from __future__ import annotations

import asyncio
import logging
from collections import defaultdict
from collections.abc import Callable

import msgspec

from logthrottle import LogThrottle
from server.camera.peers.cross_view_scorer import CrossViewScorer, PeerDetections
from server.camera.peers.detection_buffer import PeerDetectionBuffer
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS, FrameDetections, ZenohKeys, camera_of_key
from server.system.errors import UserError

log = logging.getLogger(__name__)

_JOINED_S = 2.0
_AGAIN_S = 1.0
_LISTENERS_S = 1.0
"""How long the first word waits until all the others can hear it: all have come when pulses begin."""
_DECODER = msgspec.json.Decoder(FrameDetections)


class PeerDetectionExchange:
    """Exchanges detections between one camera and the others of the same ground.

    It has a session of its own, since the one that a camera has from the start hears no other camera.
    """

    def __init__(self, config: Config, camera_id: str, witness: CrossViewScorer | None, most: int) -> None:
        self._config, self._camera = config, camera_id
        self._keys = ZenohKeys(config.site.name)
        self._others = config.witnesses(camera_id) if witness else ()
        self._patience = config.track.cross_view_wait_s
        looks_here = witness.looks_here if witness else lambda _: False
        self._earshot = PeerDetectionBuffer(self._others, most, looks_here)
        self._listening: set[str] = set()
        self._came = asyncio.Event()
        self._joining: asyncio.Task[None] | None = None
        self._opening: asyncio.Task[Bus] | None = None
        self._bus: Bus | None = None
        self._told = False
        self._waits = LogThrottle(quiet_s=0.0)
        self._late: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self._bad: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self.bad_messages = 0
        """Messages of the others that were none."""

    async def join(self) -> None:
        """Join the others; where the router is not there yet, that goes on meanwhile.

        What goes wrong with it then ends whoever next asks what the others found.
        """
        if not self._others:
            return
        self._joining = asyncio.create_task(self._join(), name="join")
        await asyncio.wait({self._joining}, timeout=_JOINED_S)

    async def leave(self) -> None:
        """Leave the others."""
        self._bus = None
        if self._joining is not None:
            self._joining.cancel()
            await asyncio.gather(self._joining, return_exceptions=True)
        if self._opening is not None:
            (opened,) = await asyncio.gather(self._opening, return_exceptions=True)
            if isinstance(opened, Bus):
                opened.close()

    async def _join(self) -> None:
        while True:
            self._opening = asyncio.create_task(
                asyncio.to_thread(Bus.hearing, self._config.zenoh, self._camera)
            )
            try:
                # Shielded: a session that nobody knows of could not be closed, and the process not end.
                bus = await asyncio.shield(self._opening)
                break
            except UserError as problem:
                if (more := self._waits.record(str(problem))) is not None:
                    log.info("camera %s: cannot hear the others yet: %s%s", self._camera, problem, more)
                await asyncio.sleep(_AGAIN_S)
        if self._waits.end():
            log.info("camera %s: hears the others", self._camera)
        for other in self._others:
            self._listen(bus, other)
        bus.watch_alive(self._keys.camera("*", "peer_listener"), self._alive)
        # After the subscriptions: who knows this token knows them, too.
        bus.declare_alive(self._keys.camera(self._camera, "peer_listener"))
        self._bus = bus

    async def of(
        self, pulse: int, word: FrameDetections | None, taken: float, *, needed: bool
    ) -> PeerDetections:
        """Publish a frame's detections; return the peers' of the same frame, waiting where needed.

        ``taken`` is when the frame was taken, by the loop's clock. From then on patience is counted, and not
        from when it was searched: a camera that falls behind takes no other with it.
        """
        if word is None:
            return PeerDetections()
        if self._joining is not None and self._joining.done():
            self._joining.result()
        await self._tell(word)
        until = taken + self._patience
        self._earshot.ask(pulse, until)
        if not needed:
            return PeerDetections()
        if self._bus is not None:
            await self._until(lambda: not self._earshot.misses(pulse), until)
        for camera in self._earshot.give_up(pulse):
            self._tell_late(camera, pulse)
        heard = self._earshot.heard(pulse)
        for it in heard.words:
            self._tell_in_time(it.camera)
        return heard

    def _tell_late(self, camera: str, pulse: int) -> None:
        more = self._late[camera].record()
        if more is not None:
            told = "camera %s: what %s found in frame %d came too late%s"
            log.info(told, self._camera, camera, pulse, more)

    def _tell_in_time(self, camera: str) -> None:
        if self._late[camera].end():
            log.info("camera %s: what %s finds comes in time again", self._camera, camera)

    async def end(self, word: FrameDetections | None) -> None:
        """Publish that no more frames follow."""
        if word is not None:
            await self._tell(word)

    async def _tell(self, word: FrameDetections) -> None:
        if self._bus is None:
            return
        if not self._told:
            self._told = True
            until = asyncio.get_running_loop().time() + _LISTENERS_S
            await self._until(lambda: self._listening.issuperset(self._others), until)
        self._bus.publish(self._keys.camera(self._camera, "detections"), msgspec.json.encode(word))

    async def _until(self, done: Callable[[], bool], until: float) -> None:
        """Wait until something holds, asked whenever anything comes; no longer than until then."""
        try:
            async with asyncio.timeout_at(until):
                while not done():
                    self._came.clear()
                    await self._came.wait()
        except TimeoutError:
            return

    def _listen(self, bus: Bus, other: str) -> None:
        def take(message: Message) -> None:
            word = self._read(message)
            if word is not None and not self._earshot.put(word, asyncio.get_running_loop().time()):
                end()  # of a hundred cameras most look elsewhere
            self._came.set()

        end = bus.listen(self._keys.camera(other, "detections"), take)

    def _read(self, message: Message) -> FrameDetections | None:
        other = camera_of_key(message.key)
        try:
            word = _DECODER.decode(message.payload)
            if word.camera != other:
                raise msgspec.ValidationError("it is another camera's")
        except DECODE_ERRORS as problem:
            self.bad_messages += 1
            if (more := self._bad[other].record(str(problem))) is not None:
                told = "camera %s: a message on %s is none: %s%s"
                log.warning(told, self._camera, message.key, problem, more)
            return None
        if ended := self._bad[other].end():
            told = "camera %s: what %s says is understood again; %d messages were not"
            log.info(told, self._camera, other, ended.count)
        return word

    def _alive(self, key: str, there: bool) -> None:
        (self._listening.add if there else self._listening.discard)(camera_of_key(key))
        self._came.set()
