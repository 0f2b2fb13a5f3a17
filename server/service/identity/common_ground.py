"""People tracked jointly on the common ground, as identity sees them: one camera whose picture is a map.

The map's pixels are ground units, so that its homography is the identity matrix. One track stands for a
person in all cameras; looks stay apart by the camera that saw them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestview import AppearanceHistogram, Merge, Split, TrackKey, TrackUpdate
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_histograms
from server.service.identity.camera_window import CameraWindow
from server.service.identity.local_numbers import GROUND, LocalNumbers, TrackName
from server.service.identity.own_tracks import OwnTracks
from server.service.ingest.epoch_aligner import JointEpoch
from server.service.joint_tracking.joint_messages import JointTracks

Floats = NDArray[np.float64]


class CommonGround:
    """The cameras that are tracked jointly: their tracks on the ground, and which of their own those are.

    ``cameras`` may be, where they overlap, and are taken to be until an epoch says. ``local_numbers`` names
    the tracks on the ground.
    """

    def __init__(self, cameras: Sequence[str], local_numbers: LocalNumbers) -> None:
        self._has_map = bool(cameras)
        self.cameras = frozenset(cameras)
        self._local_numbers = local_numbers
        self._own_tracks = OwnTracks()

    def homographies(self, of_cameras: Mapping[str, Floats | None]) -> dict[str, Floats | None]:
        """Return the homographies of all cameras, and of the map if any are tracked jointly."""
        return {**of_cameras, **({GROUND: np.eye(3)} if self._has_map else {})}

    def link(
        self, joint: JointEpoch, reported: Collection[str], windows: Iterable[CameraWindow]
    ) -> dict[TrackName, TrackKey]:
        """Learn which of the cameras' own tracks show whom; return what is new.

        ``reported`` are all cameras of the epoch; ``windows`` of those tracked jointly have the tracks on the
        ground.
        """
        self.cameras = self.cameras - set(reported) | joint.own.keys()
        return self._own_tracks.update(joint.own, windows)

    def updates(self, joint: JointTracks, messages: Iterable[CameraTracks]) -> list[TrackUpdate]:
        """Return the new final frames of everybody on the ground; ``messages`` have their looks."""
        ids = [path.id for path in joint.paths]
        keys = dict(zip(ids, self._local_numbers.keys(GROUND, joint.run, ids), strict=True))
        return ground_updates(joint, keys, messages)

    def key(self, track: TrackName) -> TrackKey | None:
        """Return the key behind a camera's own track; None: unknown."""
        if track.camera in self.cameras:
            return self._own_tracks.key(track)
        return self._local_numbers.known(track.camera, track.boot, track.track)

    def own_tracks(self, key: TrackKey) -> list[TrackName]:
        """Return the cameras' own tracks behind a key."""
        return self._own_tracks.names(key) if key.camera == GROUND else [self._local_numbers.origin(key)]

    def seen_as(self, cameras: Collection[str]) -> set[str]:
        """Return what the keys of tracks that these cameras show begin with."""
        return {GROUND if camera in self.cameras else camera for camera in cameras}

    def in_cameras(self, corrections: Iterable[Merge | Split]) -> tuple[Merge | Split, ...]:
        """Return corrections with a split of each camera instead of one on the ground."""
        return tuple(
            each
            for correction in corrections
            for each in (
                [replace(correction, camera=camera) for camera in sorted(self.cameras)]
                if isinstance(correction, Split) and correction.camera == GROUND
                else [correction]
            )
        )

    def keep_only(self, keys: Iterable[TrackKey]) -> None:
        """Forget everything about other tracks."""
        self._own_tracks.keep_only(keys)


def ground_updates(
    joint: JointTracks, keys: Mapping[int, TrackKey], messages: Iterable[CameraTracks]
) -> list[TrackUpdate]:
    """Return the new final frames of everybody on the ground.

    `keys` by id; `messages` of the cameras, with the same ids.
    """
    looks: dict[int, list[AppearanceHistogram]] = {}
    for message in messages:
        for track in message.tracks:
            looks.setdefault(track.id, []).extend(
                AppearanceHistogram(
                    sample.first, sample.last, unpack_histograms(sample.histogram, 1)[0], message.camera
                )
                for sample in track.appearance
                if joint.first <= sample.first and sample.last <= joint.final_to
            )
    return [
        TrackUpdate(
            camera=GROUND,
            local_id=keys[path.id].local_id,
            first_frame=joint.first,
            boxes=_boxes(path.places, joint.person_height),
            appearance=tuple(looks.get(path.id, ())),
            detected={camera: np.array(frames) for camera, frames in path.detected.items()},
        )
        for path in joint.paths
    ]


def _boxes(places: Sequence[tuple[float, float] | None], height: float) -> Floats:
    """Return the boxes (F, 4) of people on the map.

    They have no width, so that nobody is in a crowd there: the joint program has decided already who is who
    after people met.
    """
    feet = np.array([(np.nan, np.nan) if place is None else place for place in places]).reshape(-1, 2)
    return np.column_stack([feet[:, 0], feet[:, 1] - height, feet])
