"""A site of three cameras around a floor, as the epochs of a scripted walk: observations, and own tracks."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fakes.tracking.walked_floor import HEIGHT, WIDTH, FloorNoise, detect_walkers, floor_views
from server.camera.observations import ObservationCollector
from server.config.loader import build_config
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import Box, CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from server.service.ingest.epoch_aligner import Epoch
from tracking import Detections
from tracking.boxes import Floats

FPS, STRIDE = 5.0, 2
SIZE = (int(WIDTH), int(HEIGHT))
VIEWS = floor_views()
BINS = 8


def joint_config(**changes: Any) -> Config:
    """Return a site whose cameras are tracked jointly; changes are of whole sections."""
    content: dict[str, Any] = {
        "site": {"name": "hall", "fps": FPS, "width": SIZE[0], "height": SIZE[1]},
        "encode": {"gop_s": 2 / FPS},
        "cameras": [
            {
                "id": name,
                "source": "scene:room",
                "ground": view.camera.homography.tolist(),
                "ground_unit": "m",
            }
            for name, view in VIEWS.items()
        ],
        "track": {
            "joint": True,
            "window": {"length_s": 1.2, "stride_s": STRIDE / FPS, "birth_s": 1.2, "min_frames": 3},
        },
        "view": {"lookahead_s": 8 / FPS, "identity": {"confirmation_s": 0.4}},
    }
    return build_config({**content, **changes}, where="hall", folder=Path())


def walk_past(frames: int = 40) -> Floats:
    """Return two people who walk past each other, (F, 2, 2) meters."""
    along = np.linspace(2.0, 8.0, frames)
    return np.stack(
        [
            np.column_stack([along, np.full(frames, 4.2)]),
            np.column_stack([along[::-1], np.full(frames, 5.8)]),
        ],
        axis=1,
    )


def walked_epochs(
    walks: Floats,
    *,
    noise: FloorNoise = FloorNoise(),  # noqa: B008 — frozen
    first: int = 0,
    stride: int = STRIDE,
    ends: Mapping[str, int] | None = None,
    boots: Mapping[str, int] | None = None,
    absent: Collection[tuple[str, int]] = (),
) -> Iterator[Epoch]:
    """Yield the epochs of walks (F, N, 2) that begin with frame `first`, a multiple of the stride.

    `ends`: cameras whose recording ends with a frame earlier than the walk. `absent`: pairs of camera and
    epoch without a message. A camera's own track of a person has their index + 1 as its number.
    """
    detections = detect_walkers(walks, VIEWS, noise)
    last_of = {name: first + len(walks) - 1 for name in VIEWS} | dict(ends or {})
    for number in range(first // stride, (first + len(walks)) // stride + 1):  # the last one closes
        end, tracks = end_of_epoch(number, stride), {}
        for name in VIEWS:
            last = min(end, last_of[name])
            start = end - stride + 1
            if start > last_of[name] + 1 or (name, number) in absent:
                continue
            collector = ObservationCollector(Letterbox(SIZE, SIZE), stride)
            for frame in range(start, last + 1):
                collector.add(
                    frame, _with_looks(detections[frame - first][name], walks[frame - first], name), None
                )
            tracks[name] = CameraTracks(
                camera=name,
                boot=(boots or {}).get(name, 1),
                size=SIZE,
                epoch=number,
                first=start,
                last=last,
                final_to=last,
                ended=last < end,
                shed=[],
                tracks=[
                    TrackMessage(
                        id=person + 1,
                        boxes=pack_boxes(
                            [_box(walks[frame - first, person], name) for frame in range(start, last + 1)]
                        ),
                        confidence=1.0,
                    )
                    for person in range(walks.shape[1])
                    if not np.isnan(walks[max(start, first) - first, person, 0])
                ]
                if start <= last
                else [],
                solve=None,
                observations=collector.take(last),
            )
        if tracks:
            yield Epoch(number, end, tracks)


def _with_looks(found: Detections, places: Floats, camera: str) -> Detections:
    """Return the detections with a color for each person."""
    view, histograms = VIEWS[camera], np.zeros((len(found), BINS))
    for row, box in enumerate(found.boxes):
        offsets = [np.abs(view.box(place) - box).max() for place in places]
        histograms[row, int(np.nanargmin(offsets)) % BINS] = 1.0
    return Detections(found.boxes, found.scores, histograms)


def _box(place: Floats, camera: str) -> Box:
    left, top, right, bottom = VIEWS[camera].box(place).tolist()
    return left, top, right, bottom
