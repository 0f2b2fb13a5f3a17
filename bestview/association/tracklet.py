"""Tracklets, the parts of a camera's track that are certainly one person, and their keys."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.histograms import PersonAppearance

Floats = NDArray[np.float64]


class TrackKey(NamedTuple):
    """A track of one camera.

    A named tuple, since thousands are hashed and compared in every update.
    """

    camera: str
    local_id: int


class TrackletKey(NamedTuple):
    """The tracklet of a camera's track that starts with `first_frame`."""

    camera: str
    local_id: int
    first_frame: int

    @property
    def track(self) -> TrackKey:
        """The key of the whole track."""
        return TrackKey(self.camera, self.local_id)


@dataclass(frozen=True, slots=True, eq=False)
class TrackletEndpoint:
    """First or last observation of a tracklet: frame, (4,) box in pixels, (2,) ground point or NaN."""

    frame: int
    box: Floats
    ground_point: Floats


@dataclass(slots=True, eq=False)
class Tracklet:
    """Part of one camera's track.

    Attributes:
        key: camera, the camera's track id, and the first frame.
        start: first observation.
        end: last observation.
        predecessor: the tracklet of the same track before this one.
        crowd_frames_before: frames of crowd between the two.
        detections: by camera, the frames in which it detects the person.
        is_joint: several cameras track the person together.
        uncrowded_frames: observations outside crowds.
        crowd_frames_at_end: how many of the newest observations in a row are in a crowd.
        appearance: mean histograms of frames in which no other person is in the box.
        unpublished_frames: frames whose person id has not been published yet.
        published_frames: number of frames by published person id.
        person_id: the assigned person; 0: none yet.
        settled_id: the person id, if settled while the tracklet continues; 0: not settled.
        confirmed_continuation: an operator confirmed that it is the same person as the predecessor.
        is_forgotten: its person was forgotten; nobody gets its frames.
    """

    key: TrackletKey
    start: TrackletEndpoint
    end: TrackletEndpoint
    predecessor: Tracklet | None = None
    crowd_frames_before: int = 0
    detections: dict[str, int] = field(default_factory=dict)
    is_joint: bool = False
    uncrowded_frames: int = 0
    crowd_frames_at_end: int = 0
    appearance: PersonAppearance = field(default_factory=PersonAppearance)
    unpublished_frames: list[int] = field(default_factory=list)
    published_frames: dict[int, int] = field(default_factory=dict)
    person_id: int = 0
    settled_id: int = 0
    confirmed_continuation: bool = False
    is_forgotten: bool = False

    @property
    def frames_since_predecessor(self) -> int:
        """Frames from the end of the predecessor; 0: there is none."""
        return self.start.frame - self.predecessor.end.frame if self.predecessor is not None else 0

    @property
    def main_id(self) -> int:
        """The person id published for most frames, 0 before the first; of equals the lowest."""
        return max(sorted(self.published_frames), key=self.published_frames.__getitem__, default=0)

    def add_frames(self, frames: range, detections: Mapping[str, int], *, crowded: bool) -> None:
        """Count observations in consecutive frames, all in a crowd or none; `detections` by camera."""
        for camera, count in detections.items():
            self.detections[camera] = self.detections.get(camera, 0) + count
        self.uncrowded_frames += 0 if crowded else len(frames)
        self.crowd_frames_at_end = self.crowd_frames_at_end + len(frames) if crowded else 0
        if not self.settled_id:
            self.unpublished_frames.extend(frames)

    def publish(self, last_frame: int) -> bool:
        """Count frames up to `last_frame` as published with the current id; return whether there are any."""
        frames = [frame for frame in self.unpublished_frames if frame <= last_frame]
        if frames and self.person_id:
            self.published_frames[self.person_id] = self.published_frames.get(self.person_id, 0) + len(frames)
        self.unpublished_frames = self.unpublished_frames[len(frames) :]
        return bool(frames and self.person_id)

    def reassign_id(self, person_id: int) -> None:
        """Replace the person id, also that of the frames published so far."""
        self.published_frames = {person_id: max(1, sum(self.published_frames.values()))}
        self.person_id = person_id
        self.settled_id = person_id if self.settled_id else 0

    def continue_as(self, person_id: int, predecessor: Tracklet) -> None:
        """Apply an operator's correction: the person, and the tracklet that this one continues."""
        self.reassign_id(person_id)
        self.predecessor, self.crowd_frames_before, self.confirmed_continuation = predecessor, 0, True

    def renumber(self, ids: Mapping[int, int]) -> None:
        """Replace person ids by others, one to one."""
        self.published_frames = {
            ids.get(person_id, person_id): frames for person_id, frames in self.published_frames.items()
        }
        self.person_id = ids.get(self.person_id, self.person_id)
        self.settled_id = ids.get(self.settled_id, self.settled_id)

    def forget_ids(self, people: Collection[int]) -> None:
        """Forget people: as whom it was published, and, if it is one of them, all that it has shown."""
        if (self.settled_id or self.person_id or self.main_id) in people:
            self.is_forgotten = True
            self.person_id = self.settled_id = 0
            self.appearance, self.detections = PersonAppearance(), {}
            self.unpublished_frames, self.predecessor = [], None
        self.published_frames = {
            person_id: frames
            for person_id, frames in self.published_frames.items()
            if person_id not in people
        }

    def merge_ids(self, lost: int, kept: int) -> None:
        """Count frames published with the id `lost` as `kept`: both are one person."""
        frames = self.published_frames.pop(lost, 0)
        if frames:
            self.published_frames[kept] = self.published_frames.get(kept, 0) + frames
