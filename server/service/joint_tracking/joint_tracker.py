"""Tracks the people on the common ground, epoch by epoch.

It has no clock: the same epochs give the same tracks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bestview import FloorView, overlapping_cameras
from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.observations import unpack_observations
from server.messaging.packed_arrays import PackedAreas, unpack_boxes
from server.messaging.picture_motion import calibrated_boxes, camera_motion
from server.messaging.track_conversion import solver_report
from server.service.joint_tracking.camera_track_builder import CameraTrackBuilder
from server.service.joint_tracking.joint_messages import (
    CameraObservations,
    GroundPath,
    JointSetup,
    JointTask,
    JointTracks,
)
from tracking import Detections, SolverBudget, create_solver
from tracking.ground_plane import GroundCamera, GroundFrame, GroundPlaneTracker, GroundSettings


class JointTracker:
    """Turns the observations of each epoch into tracks with one id in all cameras."""

    def __init__(self, setup: JointSetup) -> None:
        self._run, self._site_size = setup.run, setup.site_size
        self._homographies = {camera: np.array(rows) for camera, rows in setup.homographies.items()}
        self._calibrations: dict[str, GroundCamera] = {}
        """Of the cameras that have reported."""
        self._views: dict[str, FloorView] = {}
        """What they see of the floor, as calibrated."""
        self._motions: dict[str, PictureMotion | None] = {}
        """How those cameras were knocked or turned."""
        self._covered: dict[str, PackedAreas] = {}
        """Where people are hidden in their pictures."""
        self._joint: frozenset[str] = frozenset()
        """Those of them that overlap."""
        self._tracker = GroundPlaneTracker(
            # A camera's own size follows with its first observations.
            {
                camera: GroundCamera(homography, float(setup.site_size[0]), float(setup.site_size[1]))
                for camera, homography in self._homographies.items()
            },
            GroundSettings(lag_s=setup.lag_s, stride_s=setup.stride_s),
            create_solver(setup.solver, SolverBudget(setup.solver_work_s, setup.solver_time_s)),
            setup.fps,
            setup.units_per_meter,
        )
        self._builders = {camera: CameraTrackBuilder(camera, setup.fps) for camera in setup.homographies}
        self._detections: dict[str, dict[int, Detections]] = {camera: {} for camera in setup.homographies}
        """By camera and frame, from the first frame on that is not final."""
        self._last = self._final_to = -1
        self._ended: set[str] = set()

    def step(self, task: JointTask) -> JointTracks:
        """Track people in the frames of an epoch."""
        self._take(task)
        all_ended = bool(task.cameras) and all(camera in self._ended for camera in self._calibrations)
        last = max(part.last for part in task.cameras.values()) if all_ended else task.last
        final, ahead = self._track_to(last, all_ended=all_ended)
        cameras = {
            camera: self._builders[camera].tracks(
                [*final, *ahead],
                len(final),
                self._detections[camera],
                Letterbox(part.size, self._site_size),
                part.motion,
            )
            for camera, part in task.cameras.items()
            if camera in self._joint
        }
        for found in self._detections.values():
            for pulse in [pulse for pulse in found if pulse <= self._final_to]:
                del found[pulse]
        return JointTracks(
            run=self._run,
            first=self._final_to + 1 - len(final),
            last=last,
            final_to=self._final_to,
            person_height=self._tracker.person_height or 0.0,
            offsets={
                camera: offset for camera, offset in self._tracker.offsets.items() if camera in self._joint
            },
            paths=_paths(final),
            cameras=cameras,
            solve=solver_report(final[-1].report if final else None),
        )

    def _take(self, task: JointTask) -> None:
        """Store the observations of an epoch."""
        for camera, part in task.cameras.items():
            width, height = part.size
            known = self._calibrations.get(camera)
            if known is None or (known.width, known.height) != (width, height):
                calibration = GroundCamera(self._homographies[camera], width, height)
                self._calibrations[camera] = calibration
                self._tracker.set_camera(camera, calibration)
                self._motions[camera], self._covered[camera] = None, b""
                self._views[camera] = FloorView.of(self._homographies[camera], part.size)
                self._joint = overlapping_cameras(self._views)
            self._turn(camera, part)
            (self._ended.add if part.ended else self._ended.discard)(camera)
        for camera, part in task.cameras.items():
            if camera in self._joint:
                for frame in part.frames:
                    self._detections[camera][frame.pulse] = unpack_observations(frame)

    def _turn(self, camera: str, part: CameraObservations) -> None:
        """Take over how a camera was turned or covered: it sees another part of the floor."""
        if (part.motion, part.covered) == (self._motions[camera], self._covered[camera]):
            return
        self._motions[camera], self._covered[camera] = part.motion, part.covered
        letterbox = Letterbox(part.size, self._site_size)
        turned = None if part.motion is None else camera_motion(part.motion, letterbox)
        covered = letterbox.boxes_site_to_camera(calibrated_boxes(unpack_boxes([part.covered]), part.motion))
        self._tracker.set_camera(camera, replace(self._calibrations[camera], turned=turned, covered=covered))

    def _track_to(self, last: int, *, all_ended: bool) -> tuple[list[GroundFrame], list[GroundFrame]]:
        """Track up to frame `last`; return the frames that have become final, and those after them."""
        final = self._push_to(last)
        if all_ended:
            final += self._tracker.flush()
        first_open = self._tracker.first_open
        if final and first_open is not None and final[-1].frame + 1 < first_open:
            # Epochs were skipped for so long that nobody is known any more.
            final, self._final_to = [], first_open - 1
        final = _without_gap(final)
        if final:
            self._final_to = final[-1].frame
        ahead = [] if all_ended else self._tracker.provisional()
        # Before the first solution nobody is known.
        unsolved = range(self._final_to + 1 + len(ahead), last + 1)
        return final, [*ahead, *(GroundFrame(frame, (), None) for frame in unsolved)]

    def _push_to(self, last: int) -> list[GroundFrame]:
        """Push the frames up to `last`; return those that have become final."""
        observed = {pulse for found in self._detections.values() for pulse in found}
        # The tracker counts frames that nobody has searched by itself.
        final: list[GroundFrame] = []
        new = sorted(pulse for pulse in {*observed, last} if pulse > self._last)
        if self._last < 0 and new:
            self._final_to = new[0] - 1
        for pulse in new:
            here = {camera: found[pulse] for camera, found in self._detections.items() if pulse in found}
            final += self._tracker.push(pulse, here)
        self._last = max(self._last, last)
        return final


def _without_gap(frames: list[GroundFrame]) -> list[GroundFrame]:
    """Return the last of the frames, without those before a gap."""
    gaps = [at for at in range(1, len(frames)) if frames[at].frame != frames[at - 1].frame + 1]
    return frames[max(gaps, default=0) :]


def _paths(frames: list[GroundFrame]) -> list[GroundPath]:
    """Return the paths of everybody in final frames, by id."""
    paths: dict[int, GroundPath] = {}
    for at, frame in enumerate(frames):
        for track in frame.tracks:
            empty = GroundPath(id=track.id, places=[None] * len(frames), detected={})
            path = paths.setdefault(track.id, empty)
            x, y = track.place.tolist()
            path.places[at] = (x, y)
            for camera, box in track.boxes.items():
                if box.detection is not None:
                    path.detected.setdefault(camera, [False] * len(frames))[at] = True
    return [path for _, path in sorted(paths.items())]
