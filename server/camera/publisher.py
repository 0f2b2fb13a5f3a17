"""Publishes what one camera's process produces: frames, audio, tracks, thumbnails, status."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec

from camsync import Pulse
from server.camera.audio import EncodedAudioFrame, consecutive_runs
from server.camera.encoder import AccessUnit
from server.messaging.bus import Bus
from server.messaging.camera_status import CameraStatus
from server.messaging.messages import (
    AudioHeader,
    CameraTracks,
    FrameHeader,
    ThumbnailHeader,
    ZenohKeys,
)


class CameraPublisher:
    """Encodes a camera's messages and publishes them on the bus; before ``connect`` they are dropped.

    Args:
        keys: the site's keys.
        camera_id: the camera.
        boot: its process's start, in every message.
        clock: the pulses' clock.
    """

    def __init__(self, keys: ZenohKeys, camera_id: str, boot: int, clock: Callable[[], float]) -> None:
        self._keys, self._id, self._boot, self._clock = keys, camera_id, boot, clock
        self._bus: Bus | None = None

    def connect(self, bus: Bus) -> None:
        """Publish on this bus from now on."""
        self._bus = bus

    def publish_frame(self, pulse: Pulse, unit: AccessUnit, captured_at: float) -> None:
        """Publish the access unit of a pulse, which has just been encoded."""
        head = FrameHeader(
            pulse=pulse.number,
            key=unit.key,
            boot=self._boot,
            reference_pulse=unit.reference_pulse,
            due=pulse.due,
            captured_at=captured_at,
            encoded=self._clock(),
        )
        self._publish("video", unit.data, msgspec.msgpack.encode(head))

    def publish_audio(self, frames: Sequence[EncodedAudioFrame]) -> None:
        """Publish frames of the site's audio, one message for each run of consecutive frames."""
        if self._bus is None:
            return
        for run in consecutive_runs(frames):
            head = AudioHeader(first=run[0].number, sizes=[len(frame.data) for frame in run])
            data = b"".join(frame.data for frame in run)
            self._bus.publish(self._keys.sound, data, msgspec.msgpack.encode(head))

    def publish_tracks(self, tracks: CameraTracks) -> None:
        """Publish the tracks of a window, solved just now."""
        message = msgspec.structs.replace(tracks, solved_at=self._clock())
        self._publish("tracks", msgspec.msgpack.encode(message))

    def publish_thumbnails(self, thumbnails: Mapping[int, bytes], pulse: int) -> None:
        """Publish the JPEGs of a frame by track."""
        for track, jpeg in thumbnails.items():
            head = ThumbnailHeader(track=track, boot=self._boot, pulse=pulse)
            self._publish(f"thumbs/{track}", jpeg, msgspec.msgpack.encode(head))

    def publish_status(self, status: CameraStatus) -> None:
        """Publish the camera's status."""
        self._publish("status", msgspec.msgpack.encode(status))

    def publish_retained_identities(self, snapshot: bytes) -> None:
        """Send the retained identity snapshot, encoded already, back to the best-view service."""
        self._publish("retained_identities", snapshot)

    def _publish(self, topic: str, payload: bytes, attachment: bytes | None = None) -> None:
        if self._bus is not None:
            self._bus.publish(self._keys.camera(self._id, topic), payload, attachment)
