"""Delay drift over an hour of pulses, fed as fast as the service can process them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from benchmarks.scaling.simulated_hall import STRIDE, WINDOW, SimulatedHall, SimulatedTracker
from benchmarks.streaming.simulated_cameras import CAMERAS, ENCODE, SITE
from server.camera.encoder import AccessUnit
from server.config.sections import CameraSettings, TrackSettings
from server.config.site_config import Config
from server.media.containers.fmp4 import ticks
from server.messaging.inbox import Message
from server.messaging.messages import FrameHeader, GopChoices, ZenohKeys
from server.service.pipeline import BestViewPipeline
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk

_PER_CAMERA = 2
"""People per camera on average: few, so that an hour takes minutes."""
_BOOT = 1
_PARTS = 10
_VIDEO = b"\x00\x00\x01\xe0"
_PTS_AT = 9
"""Offset of the PTS in a video PES packet (ISO/IEC 13818-1, 2.4.3.6)."""


@dataclass(frozen=True, slots=True)
class DelayDrift:
    """The range of the delay, and the cost over time."""

    pulses: int
    gops: int
    """GOPs sent."""
    min_delay: int
    """Smallest delay: pulses from a GOP's first picture to the pulse with which it was sent."""
    max_delay: int
    """Largest delay, in pulses."""
    max_time_error: int
    """Largest difference of a GOP's timestamps in MP4 and transport stream from its pulse, 1/90000 s."""
    costs: tuple[float, ...]
    """Processor milliseconds per pulse, in each tenth of the time."""


class PacedCameras:
    """Simulated cameras that send one pulse at a time, at the caller's pace."""

    def __init__(
        self, service: BestViewPipeline, films: Sequence[Sequence[AccessUnit]], hall: SimulatedHall
    ) -> None:
        self._service, self._films, self._hall = service, films, hall
        self._keys = ZenohKeys(service.config.site.name)
        self._trackers = [SimulatedTracker(hall, camera, _BOOT) for camera in range(CAMERAS)]
        for name in hall.ids:
            service.ingest.set_present(self._keys.camera(name, "alive"), is_present=True)

    def pulse(self, number: int) -> None:
        """Feed the messages of a pulse, and let the service decide."""
        service = self._service
        for name, film in zip(self._hall.ids, self._films, strict=True):
            unit = film[number % len(film)]
            head = FrameHeader(pulse=number, key=unit.key, boot=_BOOT, due=0.0, captured_at=0.0, encoded=0.0)
            service.ingest.receive_video(
                self._message(name, "video", unit.data, msgspec.msgpack.encode(head))
            )
        service.pulses.newest = number
        if (number + 1) % STRIDE:
            return
        places = self._hall.places(max(0, number + 1 - WINDOW), number)
        for name, tracker in zip(self._hall.ids, self._trackers, strict=True):
            payload = msgspec.msgpack.encode(tracker.message(number // STRIDE, places))
            service.ingest.receive_tracks(self._message(name, "tracks", payload, b""))
        service.decide()

    def _message(self, camera: str, topic: str, payload: bytes, attachment: bytes) -> Message:
        return Message(self._keys.camera(camera, topic), payload, attachment)


async def drift(films: Sequence[Sequence[AccessUnit]], pulses: int) -> DelayDrift:
    """Feed pulses to the service without a bus, and measure the stream of a decided camera."""
    hall = SimulatedHall(CAMERAS, _PER_CAMERA)
    cameras = [
        CameraSettings(id=name, source=f"rtsp://{name}/", ground=ground.tolist())
        for name, ground in zip(hall.ids, hall.grounds, strict=True)
    ]
    track = TrackSettings(joint=False)  # simulated cameras send tracks alone
    service = BestViewPipeline(Config(site=SITE, encode=ENCODE, cameras=cameras, track=track))
    source, decided = PacedCameras(service, films, hall), list[GopChoices]()
    service.on_decision.append(decided.append)
    viewer = service.splicer.decided_cameras[hall.ids[0]].subscribe().chunks()
    delays: list[int] = []
    max_time_error, costs, part, began = 0, list[float](), pulses // _PARTS, time.process_time()
    for number in range(pulses):
        source.pulse(number)
        for choices in decided:
            chunk = await anext(viewer)
            delays.append(number - choices.first)
            max_time_error = max(
                max_time_error, *(abs(stamp - ticks(choices.first, SITE.fps)) for stamp in timestamps(chunk))
            )
        decided.clear()
        if number % part == part - 1:
            now = time.process_time()
            costs.append(1e3 * (now - began) / part)
            began = now
    service.close()
    return DelayDrift(pulses, len(delays), min(delays), max(delays), max_time_error, tuple(costs))


def timestamps(chunk: Chunk) -> tuple[int, int]:
    """Parse the presentation times of a chunk, 1/90000 s, in its MP4 and its transport stream."""
    assert isinstance(chunk, MediaChunk)  # noqa: S101 — streams consist of these
    at = chunk.data.index(b"tfdt") + len(b"tfdt") + 4
    stamp = chunk.mpegts.index(_VIDEO) + _PTS_AT
    first, middle, last = (
        chunk.mpegts[stamp],
        chunk.mpegts[stamp + 1 : stamp + 3],
        chunk.mpegts[stamp + 3 : stamp + 5],
    )
    high, low = int.from_bytes(middle, "big") >> 1, int.from_bytes(last, "big") >> 1
    return int.from_bytes(chunk.data[at : at + 8], "big"), (first >> 1 & 7) << 30 | high << 15 | low
