"""Viewers of a site under fault: the Python client's player, with the arrival time of each picture."""

from __future__ import annotations

import asyncio
import contextlib
import io
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import cast

import av
import numpy as np

from benchmarks.faults.video.stamped_views import FPS, FrameStamp, read_stamp
from client import Cameras, ClientError, Event, Gop, HttpSettings, events
from client.fmp4 import BoxReader, decode_time
from client.recording import Recording
from client.session import Session
from client.stream_events import ViewHistory

_TICKS = 90_000
_RETRY_S = 0.2
_GOP_S = 10 / FPS
_SETTINGS = HttpSettings()


@dataclass(frozen=True, slots=True)
class ReceivedPicture:
    """A picture that a viewer received."""

    pulse: int
    at: float
    """Time of arrival, seconds of the monotonic clock."""
    stamp: FrameStamp | None
    """Its camera and frame number; None: illegible."""


@dataclass(slots=True)
class StreamRecorder:
    """A file-like sink of the player that records the arrival time of each write."""

    data: bytearray = field(default_factory=bytearray)
    writes: list[tuple[float, int]] = field(default_factory=list)
    """Arrival time and end offset of each write."""

    def write(self, data: bytes) -> int:
        """Append a header or a fragment."""
        self.data += data
        self.writes.append((time.monotonic(), len(self.data)))
        return len(data)

    def pictures(self) -> list[ReceivedPicture]:
        """Decode all pictures."""
        moments: dict[int, float] = {}
        at = 0
        for moment, end in self.writes:
            for box in BoxReader().feed(bytes(self.data[at:end])):
                if box.kind == b"moof":
                    moments[round(decode_time(box) * FPS / _TICKS)] = moment
            at = end
        if not moments:
            return []
        shown = []
        with av.open(io.BytesIO(bytes(self.data)), "r", format="mp4") as container:
            for frame in container.decode(video=0):
                pulse = round(float(frame.time or 0.0) * FPS)
                stamp = read_stamp(np.asarray(frame.to_ndarray(format="gray"), dtype=np.uint8))
                shown.append(ReceivedPicture(pulse, moments.get(pulse, 0.0), stamp))
        return shown


class Viewer:
    """Watches the best view of one object; where its server is gone, at one of the others of the site."""

    def __init__(self, url: str, number: int, others: Sequence[str] = ()) -> None:
        self.number = number
        self.recorders: list[StreamRecorder] = []
        self.restarts = 0
        """Number of restarts of the player."""
        self._sessions: list[Session] = []
        self._settings = _SETTINGS.failing_over(url, tuple(others), _GOP_S) if others else _SETTINGS
        self._streams = [server / f"objects/{number}/best.mp4" for server in self._settings.servers(url)]

    @property
    def reconnections(self) -> int:
        """Number of times that the stream was reopened."""
        return self.restarts + sum(session.reconnections for session in self._sessions)

    async def run(self) -> None:
        """Watch until cancelled."""
        while True:
            self.recorders.append(StreamRecorder())
            record = Recording(cast("io.BufferedWriter", self.recorders[-1]), None)
            self._sessions.append(Session(record, ViewHistory(self.number), None, None, None))
            with contextlib.suppress(ClientError):
                await self._sessions[-1].run(self._streams, self._settings)
            self.restarts += 1
            await asyncio.sleep(_RETRY_S)

    @property
    def last_arrival(self) -> float:
        """Time of the last arrival; 0 if nothing has arrived."""
        return max((recorder.writes[-1][0] for recorder in self.recorders if recorder.writes), default=0.0)

    def pictures(self) -> list[ReceivedPicture]:
        """Decode all received pictures, in order of arrival."""
        return [picture for recorder in self.recorders for picture in recorder.pictures()]


@dataclass(slots=True)
class EventLog:
    """The server's events, with their time of arrival."""

    gops: list[tuple[float, Gop]] = field(default_factory=list)
    cameras: Cameras | None = None
    merged: dict[int, int] = field(default_factory=dict)

    def add(self, event: Event) -> None:
        """Add an event; GOPs that are repeated after a reconnection are skipped."""
        match event:
            case Gop() if not self.gops or event.first > self.gops[-1][1].first:
                self.gops.append((time.monotonic(), event))
                self.merged.update({merge.lost: merge.kept for merge in event.merged})
            case Cameras():
                self.cameras = event

    async def listen(self, url: str) -> None:
        """Listen until cancelled."""
        while True:
            with contextlib.suppress(ClientError):
                async for event in events(url, _SETTINGS):
                    self.add(event)
            await asyncio.sleep(_RETRY_S)

    def state(self, camera: str) -> str | None:
        """Return a camera's last reported state."""
        cameras = self.cameras.cameras if self.cameras else ()
        return next((camera_state.state for camera_state in cameras if camera_state.camera == camera), None)

    def shown(self, number: int) -> str | None:
        """Return the camera that shows an object now."""
        return self.choice(self.gops[-1][1], number) if self.gops else None

    def choice(self, gop: Gop, number: int) -> str | None:
        """Return the camera of an object in a GOP, under its number after merges."""
        while number not in gop.choices and number in self.merged:
            number = self.merged[number]
        return gop.choices.get(number)
