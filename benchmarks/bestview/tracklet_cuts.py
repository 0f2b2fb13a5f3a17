"""Tracklets as the service splits them: tracks cut where a camera's tracker may have swapped people."""

from __future__ import annotations

from itertools import chain, zip_longest

import numpy as np

from benchmarks.bestview.camera_tracks import Messages
from bestview.association.sightings import FootPointError, align_tracks
from bestview.association.tracklet_splitter import TrackletSplitter
from server.config.site_config import Config
from server.service.identity.camera_window import WindowReader
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.view_selection.decider import camera_homographies
from tracking.motchallenge import MotRow


def own_tracklets(config: Config, messages: Messages) -> dict[str, list[MotRow]]:
    """Return each camera's final boxes, numbered by tracklet as the service splits tracks."""
    settings = config.view.identity.resolve(config.site.fps)
    tracklets, reader = TrackletSplitter(settings), WindowReader((config.site.width, config.site.height))
    ground, error = camera_homographies(config), FootPointError(settings.foot_sideways, settings.foot_upwards)
    aligner = EpochAligner(config.camera_ids, config.window.stride, grace=0)
    for camera in config.camera_ids:
        aligner.camera_connected(camera)
        aligner.frame_received(camera, messages[camera][0].boot, 0)
    parts: dict[str, list[MotRow]] = {camera: [] for camera in config.camera_ids}
    for message in chain.from_iterable(zip_longest(*messages.values())):
        if message is not None:
            aligner.add_tracks(message)
        for epoch in aligner.take_ready(now=-1):
            tracks = [track for window in reader.read(epoch) for track in window.fresh_tracks()]
            seen = align_tracks(tracks, ground, error, config.overhead)
            # No tracklet is finalized here, so that a row remains the same tracklet.
            rows, _ = tracklets.update(seen, {track.key: track.appearance for track in tracks})
            for track, column in zip(*np.nonzero(rows >= 0), strict=True):
                camera = seen.keys[track].camera
                box = reader.letterboxes[camera].boxes_camera_to_site(seen.boxes[track, column])
                frame, number = seen.first_frame + int(column) + 1, int(rows[track, column]) + 1
                parts[camera].append(MotRow.of_box(frame, number, box.tolist()))
    return parts
