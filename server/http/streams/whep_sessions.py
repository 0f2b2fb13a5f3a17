"""WebRTC sessions: H.264 handed on to one viewer each by aiortc, without encoding it again.

aiortc is an extra: it is loaded with the first session, in a thread, since that takes a second.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import logging
import re
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from aiohttp import web

from server.http.viewers.traffic import Traffic
from server.media.nal_units import split_sample
from server.media.picture import EncodedPicture
from server.service.facade.streams import Broadcaster, MediaChunk, Subscriber

log = logging.getLogger(__name__)

_CLOCK = 90_000
"""Units of RTP times of video, per second (RFC 6184, 8.1)."""
_CONNECT_S = 20.0
"""Seconds within which a viewer must connect."""
_START_CODE = b"\x00\x00\x00\x01"
_HIDDEN_HOST = re.compile(r"^(a=candidate:\S+ \d+ \S+ \d+ )[0-9A-Za-z-]+\.local(?= )", re.MULTILINE)
"""The beginning of a candidate (RFC 8839, 5.1) whose host is a multicast DNS name."""
HOW_TO_INSTALL = "WebRTC needs aiortc: pip install 'myview[webrtc]'"


class NoWebRtcError(Exception):
    """aiortc is not installed."""


async def load_webrtc() -> ModuleType:
    """Return aiortc.

    Raises:
        NoWebRtcError: it is not installed.
    """
    try:
        return await asyncio.to_thread(importlib.import_module, "server.http.streams.webrtc_track")
    except ImportError as error:
        raise NoWebRtcError from error


def access_unit(picture: EncodedPicture) -> bytes:
    """Return a picture as Annex B; a keyframe with its parameter sets, for who begins there."""
    return b"".join(_START_CODE + unit for unit in split_sample(picture.sample))


def reveal_viewer(offer: str, address: str) -> str:
    """Return an SDP offer with a viewer's address in place of the names that browsers hide it behind.

    Multicast DNS resolves these (draft-ietf-mmusic-mdns-ice-candidates) neither from another network, as
    from a container, nor in time on a busy machine. Without any address aioice gives up at once, although the
    viewer's own checks would arrive; these are enough where the address is that of a proxy.
    """
    host, _, _ = address.partition("%")  # without the scope of a link-local address
    return _HIDDEN_HOST.sub(rf"\g<1>{host}", offer) if host else offer


async def timed_packets(viewer: Subscriber, fps: float, traffic: Traffic) -> AsyncIterator[tuple[bytes, int]]:
    """Yield access units and their RTP times, at the pace of the site.

    A GOP that arrives as a whole is spread over its duration, unless more is waiting.
    """
    clock = asyncio.get_running_loop()
    async for chunk in viewer.chunks():
        if not isinstance(chunk, MediaChunk):
            continue
        begun = clock.time()
        for index, picture in enumerate(chunk.pictures):
            if index and not viewer.queued:
                await asyncio.sleep(begun + index / fps - clock.time())
            data = access_unit(picture)
            traffic.streams += len(data)
            yield data, round(picture.pulse * _CLOCK / fps)


@dataclass(eq=False)
class WhepSession:
    """One viewer's session.

    Attributes:
        id: the last part of its path; unguessable.
        path: of its address, by which it is ended.
    """

    id: str
    path: str
    connection: Any
    ended: asyncio.Event = field(default_factory=asyncio.Event)

    def end(self) -> None:
        """End the session soon."""
        self.ended.set()

    async def run(self) -> None:
        """Wait until the session ends: by the viewer or the site, or because no connection comes about."""
        deadline = asyncio.get_running_loop().call_later(_CONNECT_S, self.end)

        def changed() -> None:
            if self.connection.connectionState == "connected":
                deadline.cancel()
            elif self.connection.connectionState in {"failed", "closed"}:
                self.end()

        self.connection.on("connectionstatechange", changed)
        try:
            await self.ended.wait()
        finally:
            deadline.cancel()
            await self.connection.close()


class WhepSessions:
    """The sessions of a service, by id; ``traffic`` counts what is sent at the site's rate."""

    def __init__(self, fps: float, traffic: Traffic) -> None:
        self._fps, self._traffic = fps, traffic
        self._sessions: dict[str, WhepSession] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def find(self, session_id: str, path: str) -> WhepSession | None:
        """Return a session by its id and path; None: there is none."""
        session = self._sessions.get(session_id)
        return session if session is not None and session.path == path else None

    async def answer(
        self,
        offer: str,
        channel: Broadcaster,
        path: str,
        holding: Callable[[WhepSession], contextlib.AbstractContextManager[None]],
    ) -> tuple[WhepSession, str]:
        """Begin a session for an SDP offer; return it and the SDP answer.

        Args:
            offer: of the viewer, who receives one video; see `reveal_viewer`.
            channel: what is sent.
            path: of the stream's WHEP address.
            holding: entered while the session lasts.

        Raises:
            NoWebRtcError: aiortc is not installed.
            UserError: the offer is invalid, or has no H.264.
        """
        webrtc = await load_webrtc()
        viewer = channel.subscribe()
        self._traffic.join(viewer)
        try:
            track = webrtc.EncodedTrack(timed_packets(viewer, self._fps, self._traffic))
            connection, text = await webrtc.answer_offer(offer, track)
        except BaseException:
            self._traffic.leave(viewer)
            channel.unsubscribe(viewer)
            raise
        session_id = secrets.token_urlsafe(16)
        session = WhepSession(session_id, f"{path}/{session_id}", connection)
        track.on("ended", session.end)
        self._sessions[session_id] = session

        async def run() -> None:
            try:
                with holding(session):
                    await session.run()
            except Exception:
                log.exception("a WebRTC session failed")
            finally:
                del self._sessions[session_id]
                self._traffic.leave(viewer)
                channel.unsubscribe(viewer)

        task = asyncio.create_task(run(), name="webrtc")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return session, text

    async def close(self) -> None:
        """End all sessions."""
        for session in self._sessions.values():
            session.end()
        await asyncio.gather(*self._tasks, return_exceptions=True)


WHEP_SESSIONS = web.AppKey("WHEP sessions", WhepSessions)
