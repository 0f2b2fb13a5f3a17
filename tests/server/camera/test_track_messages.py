"""Track messages of a window."""

from __future__ import annotations

import msgspec
import numpy as np

from server.camera.track_messages import TrackMessageBuilder
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import pack_boxes
from tracking import WindowResult, WindowTrack

SEEN: Box = (10.0, 20.0, 40.0, 110.0)


def test_bridged_occlusions_have_interpolated_boxes() -> None:
    boxes = np.array([SEEN, (np.nan,) * 4, SEEN, (np.nan,) * 4])
    bridged = boxes.copy()
    bridged[1] = SEEN
    track = WindowTrack(7, boxes, bridged, np.full(4, 0.25), 0.5)
    message = TrackMessageBuilder("c0", 1, (640, 360), stride=4).regular(
        WindowResult(0, 3, 3, (track,), None)
    )
    assert [track.boxes for track in message.tracks] == [pack_boxes([SEEN, SEEN, SEEN, None])]


def test_a_box_far_outside_the_image_can_be_encoded() -> None:
    boxes = np.array([(-4e9, 20.0, 3e9, 110.0)])
    track = WindowTrack(7, boxes, boxes, np.full(1, 0.25), 0.5)
    message = TrackMessageBuilder("c0", 1, (640, 360), stride=1).regular(
        WindowResult(0, 0, 1, (track,), None)
    )
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=CameraTracks) == message
