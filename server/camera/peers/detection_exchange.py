"""Exchanges detections with the peer cameras over the bus, and waits a short time for theirs."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import defaultdict
from collections.abc import Callable
from functools import partial

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
_DECODER = msgspec.msgpack.Decoder(FrameDetections)


class PeerDetectionExchange:
    """Exchanges detections between one camera and the others of the same ground.

    It opens a further bus session to each router, since the camera's first one receives nothing from other
    cameras. Messages come once from each router: one that stops costs none.
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
        self._listening: set[tuple[str, str]] = set()
        """Routers, and the peers that listen there."""
        self._changed = asyncio.Event()
        self._join_tasks: list[asyncio.Task[None]] = []
        """One for each router."""
        self._is_tried: dict[str, asyncio.Event] = {}
        """By router: set once it has responded, or has not in time."""
        self._open_tasks: dict[str, asyncio.Task[Bus]] = {}
        self._buses: list[Bus] = []
        self._has_published = False
        self._join_log = LogThrottle(quiet_s=0.0)
        self._late_log: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self._bad_log: dict[str, LogThrottle] = defaultdict(LogThrottle)
        self.bad_messages = 0
        """Messages of peers that could not be parsed."""

    async def join(self) -> None:
        """Connect to the peers; if a router does not respond, connecting continues in the background.

        An error in the background is raised by the next :meth:`exchange`.
        """
        if not self._peers:
            return
        for router in self._config.zenoh.routers:
            tried = self._is_tried[router] = asyncio.Event()
            task = asyncio.create_task(self._join(router), name="join")
            task.add_done_callback(partial(_set, tried))
            self._join_tasks.append(task)
        # A busy machine may take seconds to connect; peers would miss the first frames' detections.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._config.sync.start_timeout_s):
                for tried in self._is_tried.values():
                    await tried.wait()

    async def leave(self) -> None:
        """Disconnect from the peers."""
        self._buses.clear()
        for task in self._join_tasks:
            task.cancel()
        await asyncio.gather(*self._join_tasks, return_exceptions=True)
        for opened in await asyncio.gather(*self._open_tasks.values(), return_exceptions=True):
            if isinstance(opened, Bus):
                opened.close()

    async def _join(self, router: str) -> None:
        settings = self._config.zenoh.model_copy(update={"connect": router})
        while True:
            opening = asyncio.create_task(asyncio.to_thread(Bus.peer_listener, settings, self._camera))
            self._open_tasks[router] = opening
            try:
                # Shielded: a session opened after cancellation could not be closed, and the process hangs.
                bus = await asyncio.shield(opening)
                break
            except UserError as error:
                if (more := self._join_log.record(str(error))) is not None:
                    log.info(
                        "camera %s: cannot receive the peers' detections yet: %s%s", self._camera, error, more
                    )
                self._is_tried[router].set()
                await asyncio.sleep(_RETRY_S)
        if self._join_log.end():
            log.info("camera %s: receives the peers' detections", self._camera)
        for peer in self._peers:
            self._listen(bus, peer)
        bus.watch_alive(
            self._keys.camera("*", "peer_listener"),
            lambda key, is_present: self._on_listener(router, key, is_present=is_present),
        )
        # After the subscriptions: a peer that sees this token can rely on them.
        bus.declare_alive(self._keys.camera(self._camera, "peer_listener"))
        self._buses.append(bus)

    async def exchange(
        self, pulse: int, message: FrameDetections | None, captured: float, *, needed: bool
    ) -> PeerDetections:
        """Publish a frame's detections; return the peers' of the same frame, waiting where needed.

        ``captured`` is the time of capture, by the loop's clock. The deadline counts from it, not from
        detection, so that a slow peer does not delay this camera further.
        """
        if message is None:
            return PeerDetections()
        for task in self._join_tasks:
            if task.done():
                task.result()
        await self._publish(message)
        deadline = captured + self._wait_s
        self._buffer.expect(pulse, deadline)
        if not needed:
            return PeerDetections()
        if self._buses:
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
        if not self._buses:
            return
        if not self._has_published:
            self._has_published = True
            deadline = asyncio.get_running_loop().time() + max(_LISTENERS_S, self._wait_s / 2)
            await self._wait_until(
                lambda: {peer for _, peer in self._listening}.issuperset(self._peers), deadline
            )
        payload = msgspec.msgpack.encode(message)
        for bus in self._buses:
            bus.publish(self._keys.camera(self._camera, "detections"), payload)

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

    def _on_listener(self, router: str, key: str, *, is_present: bool) -> None:
        (self._listening.add if is_present else self._listening.discard)((router, camera_of_key(key)))
        self._changed.set()


def _set(event: asyncio.Event, _: asyncio.Task[None]) -> None:
    event.set()
