"""Size of a camera's track messages, and of the same numbers as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from benchmarks.scaling.simulated_hall import FPS, STRIDE, WINDOW, SimulatedHall, SimulatedTracker
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_boxes, unpack_histograms

_EPOCHS = range(10, 20)
_SHARE_DIGITS = 5


@dataclass(frozen=True, slots=True)
class TrackMessageSize:
    """Kilobytes that a camera's tracks take in a second, at 25 frames a second."""

    packed: float
    json: float


def track_message_size(hall: SimulatedHall) -> TrackMessageSize:
    """Measure the messages of all cameras of a hall."""
    trackers = [SimulatedTracker(hall, camera, 1) for camera in range(hall.cameras)]
    packed, text = 0, 0
    for epoch in _EPOCHS:
        last = (epoch + 1) * STRIDE - 1
        places = hall.places(last + 1 - WINDOW, last)
        for tracker in trackers:
            message = tracker.message(epoch, places)
            packed += len(msgspec.msgpack.encode(message))
            text += len(msgspec.json.encode(_as_lists(message)))
    to_rate = FPS / STRIDE / len(_EPOCHS) / hall.cameras / 1e3
    return TrackMessageSize(packed * to_rate, text * to_rate)


def _as_lists(message: CameraTracks) -> dict[str, Any]:
    """Return a message with arrays as lists of numbers: coordinates with all digits, null where hidden."""
    content: dict[str, Any] = msgspec.to_builtins(message, builtin_types=(bytes,))
    for track in content["tracks"]:
        boxes = unpack_boxes([track["boxes"]])
        track["boxes"] = [None if np.isnan(box[0]) else box.tolist() for box in boxes]
        for sample in track["appearance"]:
            shares = unpack_histograms(sample["histogram"], 1)[0]
            sample["histogram"] = shares.round(_SHARE_DIGITS).tolist()
    return content
