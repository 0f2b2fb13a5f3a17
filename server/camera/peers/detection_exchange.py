"""Exchanges detections with the peer cameras over the bus, and waits a short time for theirs."""

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

_RETRY_S = 1.0
_LISTENERS_S = 1.0
"""How long the first message waits for all peers to subscribe, or half as long as for their detections."""
_DECODER = msgspec.json.Decoder(FrameDetections)


class PeerDetectionExchange:
    """Exchanges detections between one camera and the others of the same ground.

    It opens a second bus session: the camera's first one receives nothing from other cameras.
    """

    def __init__(
        self, config: Config, camera_id: str, cross_view: CrossViewScorer | None, messages_max: int
    ) -> None:
        self._config, self._camera = config, camera_id
        self._keys = ZenohKeys(config.site.name)
        self._peers = config.peers_of(camera_id) if cross_view else ()
        self._wait_s = config.track.cross_view_wait_s
        view_overlaps = cross_view.view_overlaps if cross_view else lambda _: False
        self._buffer = PeerDetectionBuffer(self._peers, messages_max, view_overlaps)
        self._listening: set[str] = set()
        self._changed = asyncio.Event()
        self._join_task: asyncio.Task[None] | None = None
        self._is_unreachable = asyncio.Event()
        """Set once the router did not respond."""
        self._open_task: asyncio.Task[Bus] | None = None
        self._bus: Bus | None = None
        self._has_published = False
        self._join_log = LogThrottle(quiet_s=0.0)
        self._late_log: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self._bad_log: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self.bad_messages = 0
        """Messages of peers that could not be parsed."""

    async def join(self) -> None:
        """Connect to the peers; if no router responds, connecting continues in the background.

        An error in the background is raised by the next :meth:`exchange`.
        """
        if not self._peers:
            return
        self._join_task = asyncio.create_task(self._join(), name="join")
        unreachable = asyncio.create_task(self._is_unreachable.wait())
        # A busy machine may take seconds to connect; peers would miss the first frames' detections.
        await asyncio.wait(
            {self._join_task, unreachable},
            timeout=self._config.sync.start_timeout_s,
            return_when=asyncio.FIRST_COMPLETED,
        )
        unreachable.cancel()

    async def leave(self) -> None:
        """Disconnect from the peers."""
        self._bus = None
        if self._join_task is not None:
            self._join_task.cancel()
            await asyncio.gather(self._join_task, return_exceptions=True)
        if self._open_task is not None:
            (opened,) = await asyncio.gather(self._open_task, return_exceptions=True)
            if isinstance(opened, Bus):
                opened.close()

    async def _join(self) -> None:
        while True:
            self._open_task = asyncio.create_task(
                asyncio.to_thread(Bus.peer_listener, self._config.zenoh, self._camera)
            )
            try:
                # Shielded: a session opened after cancellation could not be closed, and the process hangs.
                bus = await asyncio.shield(self._open_task)
                break
            except UserError as error:
                if (more := self._join_log.record(str(error))) is not None:
                    log.info(
                        "camera %s: cannot receive the peers' detections yet: %s%s", self._camera, error, more
                    )
                self._is_unreachable.set()
                await asyncio.sleep(_RETRY_S)
        if self._join_log.end():
            log.info("camera %s: receives the peers' detections", self._camera)
        for peer in self._peers:
            self._listen(bus, peer)
        bus.watch_alive(self._keys.camera("*", "peer_listener"), self._on_listener)
        # After the subscriptions: a peer that sees this token can rely on them.
        bus.declare_alive(self._keys.camera(self._camera, "peer_listener"))
        self._bus = bus

    async def exchange(
        self, pulse: int, message: FrameDetections | None, captured: float, *, needed: bool
    ) -> PeerDetections:
        """Publish a frame's detections; return the peers' of the same frame, waiting where needed.

        ``captured`` is the time of capture, by the loop's clock. The deadline counts from it, not from
        detection, so that a slow peer does not delay this camera further.
        """
        if message is None:
            return PeerDetections()
        if self._join_task is not None and self._join_task.done():
            self._join_task.result()
        await self._publish(message)
        deadline = captured + self._wait_s
        self._buffer.expect(pulse, deadline)
        if not needed:
            return PeerDetections()
        if self._bus is not None:
            await self._wait_until(lambda: not self._buffer.must_wait(pulse), deadline)
        for camera in self._buffer.give_up(pulse):
            self._log_late(camera, pulse)
        peers = self._buffer.detections_at(pulse)
        for received in peers.messages:
            self._log_in_time(received.camera)
        return peers

    def _log_late(self, camera: str, pulse: int) -> None:
        more = self._late_log[camera].record()
        if more is not None:
            text = "camera %s: detections of camera %s in frame %d arrived too late%s"
            log.info(text, self._camera, camera, pulse, more)

    def _log_in_time(self, camera: str) -> None:
        if self._late_log[camera].end():
            log.info("camera %s: detections of camera %s arrive in time again", self._camera, camera)

    async def publish_end(self, message: FrameDetections | None) -> None:
        """Publish that no more frames follow."""
        if message is not None:
            await self._publish(message)

    async def _publish(self, message: FrameDetections) -> None:
        if self._bus is None:
            return
        if not self._has_published:
            self._has_published = True
            deadline = asyncio.get_running_loop().time() + max(_LISTENERS_S, self._wait_s / 2)
            await self._wait_until(lambda: self._listening.issuperset(self._peers), deadline)
        self._bus.publish(self._keys.camera(self._camera, "detections"), msgspec.json.encode(message))

    async def _wait_until(self, done: Callable[[], bool], deadline: float) -> None:
        """Wait until a condition holds, checked on every event, or the deadline passes."""
        try:
            async with asyncio.timeout_at(deadline):
                while not done():
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            return

    def _listen(self, bus: Bus, peer: str) -> None:
        def receive(received: Message) -> None:
            message = self._decode(received)
            if message is not None and not self._buffer.put(message, asyncio.get_running_loop().time()):
                unsubscribe()  # only a few of many cameras see the same ground
            self._changed.set()

        unsubscribe = bus.subscribe_temporarily(self._keys.camera(peer, "detections"), receive)

    def _decode(self, received: Message) -> FrameDetections | None:
        peer = camera_of_key(received.key)
        try:
            message = _DECODER.decode(received.payload)
            if message.camera != peer:
                raise msgspec.ValidationError("it names another camera")
        except DECODE_ERRORS as error:
            self.bad_messages += 1
            if (more := self._bad_log[peer].record(str(error))) is not None:
                text = "camera %s: cannot parse a message on %s: %s%s"
                log.warning(text, self._camera, received.key, error, more)
            return None
        if ended := self._bad_log[peer].end():
            text = "camera %s: messages of camera %s can be parsed again; %d could not"
            log.info(text, self._camera, peer, ended.count)
        return message

    def _on_listener(self, key: str, is_present: bool) -> None:
        (self._listening.add if is_present else self._listening.discard)(camera_of_key(key))
        self._changed.set()
