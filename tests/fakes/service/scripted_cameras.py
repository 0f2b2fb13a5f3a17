"""Cameras whose frames and messages a test decides, and a small site that receives them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from bestview import IdentityUpdate, TrackletKey, TrackUpdate
from server.camera.encoder import AccessUnit, Encoder
from server.config.loader import build_config
from server.config.sections import EncodeSettings, SiteSettings
from server.config.site_config import Config
from server.media.picture import Codec
from server.messaging.camera_status import CameraStatus, RetryCause, UnavailableCamera
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import (
    AppearanceHistogram,
    Box,
    CameraTracks,
    FrameHeader,
    ThumbnailHeader,
    TrackMessage,
    ZenohKeys,
)
from server.messaging.packed_arrays import PackedHistogram, pack_boxes, pack_histograms
from server.service.ingest.epoch_aligner import Epoch
from server.service.pipeline import BestViewPipeline
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.explanation import GopExplanation

WIDTH, HEIGHT, FPS = 64, 48, 25
GOP = STRIDE = 5
CAMERAS = ("c0", "c1")
SMALL: Box = (10.0, 10.0, 16.0, 28.0)
LARGE: Box = (20.0, 4.0, 36.0, 44.0)
NO_REASON = cast("GopExplanation", None)
"""The reasons of invented decisions, which no test reads."""


def small_config(cameras: Sequence[str | dict[str, Any]] = CAMERAS, **changes: Any) -> Config:
    """Return a site in which every epoch is a GOP, and one detection confirms a person."""
    content: dict[str, Any] = {
        "site": {"name": "hall", "fps": FPS, "width": WIDTH, "height": HEIGHT},
        "encode": {"gop_s": GOP / FPS},
        "cameras": [
            {"id": camera, "source": "scene:room"} if isinstance(camera, str) else camera
            for camera in cameras
        ],
        "track": {
            "window": {
                "length_s": 5 / FPS,
                "stride_s": STRIDE / FPS,
                "birth_s": 5 / FPS,
                "min_frames": 3,
            }
        },
        "view": {
            "lookahead_s": 2 * GOP / FPS,
            "switch_cost_s": 0.04,
            "identity": {"confirmation_s": 0.04, "clustering_interval_s": 0.04},
        },
    }
    for section, value in changes.items():
        content[section] = {**content.get(section, {}), **value} if isinstance(value, dict) else value
    return build_config(content, where="hall", folder=Path())


@cache
def encoded(
    seed: int, frames: int = 40, *, gop: int = GOP, crf: int = 23, codec: Codec = "h264"
) -> tuple[AccessUnit, ...]:
    """Encode pictures that differ from camera to camera (by seed) and from frame to frame."""
    encoder = Encoder(
        SiteSettings(width=WIDTH, height=HEIGHT, fps=FPS),
        EncodeSettings(gop_s=gop / FPS, crf=crf, codec=codec),
    )
    rng = np.random.default_rng(seed)
    pictures = rng.integers(0, 255, (frames, HEIGHT // 8, WIDTH // 8, 3), dtype=np.uint8)
    return tuple(
        encoder.encode(pulse, np.repeat(np.repeat(picture, 8, axis=0), 8, axis=1))
        for pulse, picture in enumerate(pictures)
    )


def joined_fragments(frame_buffer: FrameBuffer, first: int, frames: int) -> bytes:
    """Return the bytes of the frames ``first … first + frames - 1``, all of which must be in the buffer."""
    pictures = frame_buffer.pictures(first, frames)
    assert len(pictures) == frames
    return b"".join(picture.fragment for picture in pictures)


def color_histogram(person: int) -> PackedHistogram:
    """Return a color histogram that distinguishes a person from others."""
    return pack_histograms(np.eye(8)[person % 8])


def camera_tracks(camera: str, epoch: int, boxes: Mapping[int, Box | None], **changes: Any) -> CameraTracks:
    """Return a camera's track message of an epoch in which each track has one box throughout."""
    last = end_of_epoch(epoch, STRIDE)
    message = CameraTracks(
        camera=camera,
        boot=1,
        size=(WIDTH, HEIGHT),
        epoch=epoch,
        first=last - STRIDE + 1,
        last=last,
        final_to=last,
        ended=False,
        shed=[],
        tracks=[
            TrackMessage(
                id=track,
                boxes=pack_boxes([box] * STRIDE),
                confidence=1.0,
                appearance=[]
                if box is None
                else [
                    AppearanceHistogram(first=last - STRIDE + 1, last=last, histogram=color_histogram(track))
                ],
            )
            for track, box in boxes.items()
        ],
        solve=None,
    )
    return msgspec.structs.replace(message, **changes)


def epoch_of(number: int, *words: CameraTracks) -> Epoch:
    """Return an epoch as the aligner would."""
    return Epoch(number, end_of_epoch(number, STRIDE), {message.camera: message for message in words})


def video(camera: str, unit: AccessUnit, boot: int = 1) -> Message:
    """Return a frame as received from the bus."""
    head = FrameHeader(pulse=unit.pulse, key=unit.key, boot=boot, due=0.0, captured_at=0.0, encoded=0.0)
    return Message(ZenohKeys("hall").camera(camera, "video"), unit.data, msgspec.msgpack.encode(head))


def tracks(message: CameraTracks) -> Message:
    """Return a track message as received from the bus."""
    return Message(ZenohKeys("hall").camera(message.camera, "tracks"), msgspec.msgpack.encode(message), b"")


def unavailable(camera: str, cause: RetryCause, retry_s: float, reason: str) -> Message:
    """Return why a camera's source cannot be used, as received from the bus."""
    message = UnavailableCamera(reason=reason, cause=cause, retry_s=retry_s)
    return Message(ZenohKeys("hall").camera(camera, "unavailable"), msgspec.msgpack.encode(message), b"")


def lost_source(reason: str, retry_s: float) -> UnavailableCamera:
    """Return why a camera's source has stopped sending, as its status has it."""
    return UnavailableCamera(reason=reason, cause="lost", retry_s=retry_s, address="rtsp://10.0.0.9/...")


def thumbnail(camera: str, track: int, jpeg: bytes, pulse: int = 0, boot: int = 1) -> Message:
    """Return a thumbnail as received from the bus."""
    head = ThumbnailHeader(track=track, boot=boot, pulse=pulse)
    return Message(ZenohKeys("hall").camera(camera, f"thumbs/{track}"), jpeg, msgspec.msgpack.encode(head))


def status(camera: str, **changes: Any) -> Message:
    """Return a status message as received from the bus."""
    status = CameraStatus(
        camera=camera,
        boot=1,
        state="live",
        pulse=0,
        fps=25.0,
        missed=0,
        shed=0,
        synchronized=True,
        clock_offset=0.0,
        round_trip=0.001,
    )
    payload = msgspec.msgpack.encode(msgspec.structs.replace(status, **changes))
    return Message(ZenohKeys("hall").camera(camera, "status"), payload, b"")


class TrackNumbers:
    """An identity registry for which a track's number is the person's, in every camera."""

    next_id = 1
    again = 100
    """Added to a track's number when its person was forgotten."""

    def __init__(self) -> None:
        self._forgotten: set[int] = set()

    def forget(self, people: Collection[int]) -> None:
        """Forget people: their tracks are somebody else from now on."""
        self._forgotten.update(people)

    def reserve_below(self, person_id: int) -> None:
        """Ignore the reservation: numbers are the tracks' own."""

    def update(
        self, tracks: Sequence[TrackUpdate], last_frame: int, pictures: Mapping[str, tuple[int, int]]
    ) -> IdentityUpdate:
        """Return each track's number as the person's."""
        del last_frame, pictures
        return IdentityUpdate(
            {TrackletKey(*track.key, 0): self._number(track.local_id) for track in tracks},
            (),
            (),
            (),
            (),
            (),
        )

    def _number(self, number: int) -> int:
        while number in self._forgotten:
            number += self.again
        return number


class FedService(BestViewPipeline):
    """The best-view pipeline without a bus: a test passes it the cameras' messages."""

    frames = 40
    """The number of frames of each camera."""

    def connect_cameras(self, *cameras: str) -> None:
        """Connect cameras that have no retained identities."""
        for camera in cameras:
            for part in (self.ingest, self.state_replication):
                part.set_present(ZenohKeys("hall").camera(camera, "alive"), is_present=True)
            self.state_replication.receive_snapshot(
                Message(ZenohKeys("hall").camera(camera, "retained_identities"), b"", b"")
            )

    def feed(self, epoch: int, seen: Mapping[str, Mapping[int, Box | None]]) -> None:
        """Send an epoch's frames and track messages of the cameras in ``seen``, and decide."""
        for seed, camera in enumerate(self.config.camera_ids):
            if camera not in seen:
                continue
            units = encoded(seed, self.frames, codec=self.config.encode.codec)
            for unit in units[epoch * STRIDE : (epoch + 1) * STRIDE]:
                self.ingest.receive_video(video(camera, unit))
            self.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, seen[camera])))
        self.pulses.newest = end_of_epoch(epoch, STRIDE)
        self.decide()
