"""What a camera says of a window."""

from __future__ import annotations

import numpy as np

from server.camera.report import Reporter
from server.wire.messages import Box
from tracking import WindowResult, WindowTrack

SEEN: Box = (10.0, 20.0, 40.0, 110.0)


def test_moments_of_hiding_are_told_where_the_tracker_bridges_them() -> None:
    boxes = np.array([SEEN, (np.nan,) * 4, SEEN, (np.nan,) * 4])
    bridged = boxes.copy()
    bridged[1] = SEEN
    track = WindowTrack(7, boxes, bridged, np.full(4, 0.25), 0.5)
    told = Reporter("c0", 1, (640, 360), stride=4).regular(WindowResult(0, 3, 3, (track,), None))
    assert [it.boxes for it in told.tracks] == [[SEEN, SEEN, SEEN, None]]
