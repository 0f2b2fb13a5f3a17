"""Whether the delay grows over an hour: pulses as fast as the service can take them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from benchmarks.scaling.simulated_hall import STRIDE, WINDOW, SimulatedHall, SimulatedTracker
from benchmarks.streaming.simulated_cameras import CAMERAS, ENCODE, SITE
from server.camera.encoding.encoder import AccessUnit
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.media.containers.fmp4 import ticks
from server.messaging.inbox import Message
from server.messaging.messages import FrameHeader, GopChoices, ZenohKeys
from server.service.pipeline import BestViewPipeline
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk

_PER_CAMERA = 2
"""People in a camera's view, on average: few, so that an hour passes in minutes."""
_BOOT = 1
_PARTS = 10
_VIDEO = b"\x00\x00\x01\xe0"
_PTS_AT = 9
"""Where the time stands in a packet of video (ISO/IEC 13818-1, 2.4.3.6)."""


@dataclass(frozen=True, slots=True)
class DelayDrift:
    """What changed from the beginning to the end."""

    pulses: int
    gops: int
    """That were sent."""
    least: int
    """Pulses from a GOP's first picture to the pulse with which it was sent."""
    most: int
    """Likewise."""
    off: int
    """1/90000 s by which any GOP's time in the MP4 or the transport stream differs from its pulse's."""
    costs: tuple[float, ...]
    """Processor milliseconds a pulse, in each tenth."""


class PacedCameras:
    """Cameras that send at whatever pace they are asked."""

    def __init__(
        self, service: BestViewPipeline, films: Sequence[Sequence[AccessUnit]], hall: SimulatedHall
    ) -> None:
        self._service, self._films, self._hall = service, films, hall
        self._keys = ZenohKeys(service.config.site.name)
        self._trackers = [SimulatedTracker(hall, camera, _BOOT) for camera in range(CAMERAS)]
        for name in hall.ids:
            service.ingest.alive(self._keys.camera(name, "alive"), is_present=True)

    def pulse(self, number: int) -> None:
        """Send what comes with a pulse, and let the service decide."""
        service = self._service
        for name, film in zip(self._hall.ids, self._films, strict=True):
            unit = film[number % len(film)]
            head = FrameHeader(pulse=number, key=unit.key, boot=_BOOT, due=0.0, taken=0.0, encoded=0.0)
            service.ingest.video(self._message(name, "video", unit.data, msgspec.json.encode(head)))
        service.pulse = number
        if (number + 1) % STRIDE:
            return
        places = self._hall.places(max(0, number + 1 - WINDOW), number)
        for name, tracker in zip(self._hall.ids, self._trackers, strict=True):
            word = msgspec.json.encode(tracker.message(number // STRIDE, places))
            service.ingest.tracks(self._message(name, "tracks", word, b""))
        service.decide()

    def _message(self, camera: str, what: str, payload: bytes, attachment: bytes) -> Message:
        return Message(self._keys.camera(camera, what), payload, attachment)


async def drift(films: Sequence[Sequence[AccessUnit]], pulses: int) -> DelayDrift:
    """Let so many pulses pass through the service, without a bus, and watch a camera as it is decided."""
    hall = SimulatedHall(CAMERAS, _PER_CAMERA)
    cameras = [
        CameraSettings(id=name, source=f"rtsp://{name}/", ground=ground.tolist())
        for name, ground in zip(hall.ids, hall.grounds, strict=True)
    ]
    service = BestViewPipeline(Config(site=SITE, encode=ENCODE, cameras=cameras))
    source, decided = PacedCameras(service, films, hall), list[GopChoices]()
    service.on_decision.append(decided.append)
    viewer = service.splicer.decided_cameras[hall.ids[0]].subscribe().chunks()
    delays: list[int] = []
    off, costs, part, began = 0, list[float](), pulses // _PARTS, time.process_time()
    for number in range(pulses):
        source.pulse(number)
        for choices in decided:
            piece = await anext(viewer)
            delays.append(number - choices.first)
            off = max(off, *(abs(it - ticks(choices.first, SITE.fps)) for it in times(piece)))
        decided.clear()
        if number % part == part - 1:
            now = time.process_time()
            costs.append(1e3 * (now - began) / part)
            began = now
    service.close()
    return DelayDrift(pulses, len(delays), min(delays), max(delays), off, tuple(costs))


def times(piece: Chunk) -> tuple[int, int]:
    """Read when a piece is shown, 1/90000 s: as MP4 says it, and as the transport stream does."""
    assert isinstance(piece, MediaChunk)  # noqa: S101 — streams are made of nothing else
    at = piece.data.index(b"tfdt") + len(b"tfdt") + 4
    stamp = piece.mpegts.index(_VIDEO) + _PTS_AT
    first, middle, last = (
        piece.mpegts[stamp],
        piece.mpegts[stamp + 1 : stamp + 3],
        piece.mpegts[stamp + 3 : stamp + 5],
    )
    high, low = int.from_bytes(middle, "big") >> 1, int.from_bytes(last, "big") >> 1
    return int.from_bytes(piece.data[at : at + 8], "big"), (first >> 1 & 7) << 30 | high << 15 | low
