"""The area of a best-view service: which tracks are near it, and which are in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from bestview import foot_points, to_ground
from server.config.sections import ShardingSettings
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from server.messaging.observations import FrameObservations, select_observations
from server.messaging.packed_arrays import unpack_boxes, unpack_detections
from server.messaging.picture_motion import calibrated_boxes
from server.service.ingest.epoch_aligner import Epoch

Floats = NDArray[np.float64]


class ServiceArea:
    """The floor and the cameras of a service's area; its shard must have one.

    Args:
        sharding: how the site's services divide it.
        homographies: by camera, from its own picture to the ground; None: there is none.
        site_size: width and height of the site's pictures.
    """

    def __init__(
        self,
        sharding: ShardingSettings,
        homographies: Mapping[str, Floats | None],
        site_size: tuple[int, int],
    ) -> None:
        area = sharding.areas[sharding.shard]
        self._cameras = frozenset(area.cameras)
        self._floor = None if area.floor is None else np.array(area.floor).reshape(2, 2)
        self._margin = area.margin
        self._homographies, self._site_size = homographies, site_size

    def without_far_people(self, epoch: Epoch) -> Epoch:
        """Return an epoch without people who are beyond the margin around the floor."""
        if self._floor is None:
            return epoch
        return replace(
            epoch,
            tracks={camera: self._near_tracks(message) for camera, message in epoch.tracks.items()},
            late_revisions=tuple(map(self._near_tracks, epoch.late_revisions)),
        )

    def votes(self, message: CameraTracks) -> list[bool]:
        """Return for each track of a camera whether it is in the area.

        Its place says so, or where that is not known, whether the camera is one of the area.
        """
        is_own = message.camera in self._cameras
        return [
            is_own if np.isnan(distance) else distance == 0.0
            for distance in self._distances(message).tolist()
        ]

    def _near_tracks(self, message: CameraTracks) -> CameraTracks:
        matrix = self._homographies.get(message.camera)
        if matrix is None:
            return message
        far = self._distances(message) > self._margin
        return msgspec.structs.replace(
            message,
            tracks=[track for track, is_far in zip(message.tracks, far.tolist(), strict=True) if not is_far],
            observations=[self._near_observations(frame, matrix) for frame in message.observations],
        )

    def _near_observations(self, frame: FrameObservations, matrix: Floats) -> FrameObservations:
        boxes, _ = unpack_detections(frame.boxes)
        kept = ~(self._beyond(to_ground(matrix, foot_points(boxes))) > self._margin)
        return frame if kept.all() else select_observations(frame, kept)

    def _distances(self, message: CameraTracks) -> Floats:
        """Return how far the last place of each of T tracks is from the floor, (T,); NaN: not known."""
        matrix = self._homographies.get(message.camera)
        if matrix is None or self._floor is None or not message.tracks:
            return np.full(len(message.tracks), np.nan)
        letterbox = Letterbox(message.size, self._site_size)
        boxes = unpack_boxes(track.boxes for track in message.tracks).reshape(len(message.tracks), -1, 4)
        if not boxes.shape[1]:
            return np.full(len(message.tracks), np.nan)
        visible = ~np.isnan(boxes[..., 0])
        last = boxes.shape[1] - 1 - visible[:, ::-1].argmax(axis=1)
        newest = calibrated_boxes(boxes[np.arange(len(boxes)), last], message.motion)
        return self._beyond(to_ground(matrix, foot_points(letterbox.boxes_site_to_camera(newest))))

    def _beyond(self, places: Floats) -> Floats:
        """Return how far places (K, 2) are from the floor, (K,); NaN: the place is not known."""
        assert self._floor is not None  # noqa: S101 — callers have asked
        lower, upper = self._floor
        return np.asarray(np.hypot(*np.maximum(np.maximum(lower - places, places - upper), 0.0).T))


def ingest_area(config: Config, homographies: Mapping[str, Floats | None]) -> ServiceArea | None:
    """Return the area beyond which a service takes in nobody; None: it takes in whom its cameras see.

    Where viewers may see people pixelated only, everybody in a picture must be known.
    """
    sharding = config.view.sharding
    if not sharding.areas or sharding.areas[sharding.shard].floor is None or config.access.may_blur:
        return None
    return ServiceArea(sharding, homographies, config.site.size)
