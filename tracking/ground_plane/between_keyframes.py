"""The people of the frames between two keyframes: interpolated, and where they are detected in these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tracking.assignment import assign_pairs
from tracking.boxes import Floats, iou
from tracking.ground_plane.tracks import GroundBox, GroundFrame, GroundTrack
from tracking.types import Detections

Searched = Mapping[int, Mapping[str, Detections]]
"""Detections by frame and camera."""

_MIN_IOU = 0.5
"""Least overlap of a detection and the box where the person should be."""


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """The people of a keyframe.

    Attributes:
        frame: number of the frame.
        people: their tracks.
        searched: by camera, the frame that its detections are of, not after `frame`; cameras that have not
            searched any are left out.
    """

    frame: int
    people: GroundFrame
    searched: Mapping[str, int]

    def found_in(self, camera: str) -> int:
        """Return the frame that the boxes in a camera are of."""
        return self.searched.get(camera, self.frame)


def frames_until(
    keyframe: Keyframe, previous: Keyframe | None, first: int, searched: Searched
) -> list[GroundFrame]:
    """Return the frames from `first`, after the previous keyframe, to this one.

    Before it only those are tracked whom both keyframes have.
    """
    before = {} if previous is None else {track.id: track for track in previous.people.tracks}
    former = keyframe.people.exchanged
    before |= {number: before[old] for number, old in former.items() if old in before}
    frames = []
    for frame in range(first, keyframe.frame):
        tracks = []
        if previous is not None:
            share = (frame - previous.frame) / (keyframe.frame - previous.frame)
            for track in keyframe.people.tracks:
                if track.id in before:
                    boxes = _boxes_between(before[track.id], track, previous, keyframe, frame)
                    tracks.append(_between(before[track.id], track, share, boxes))
        frames.append(_frame(frame, tracks, keyframe, searched))
    return [*frames, _frame(keyframe.frame, _held(keyframe, keyframe.frame), keyframe, searched)]


def frames_after(keyframe: Keyframe, last: int, searched: Searched) -> list[GroundFrame]:
    """Return the frames after a keyframe up to `last`, in which people stay where they were."""
    frames = range(keyframe.frame + 1, last + 1)
    return [_frame(frame, _held(keyframe, frame), keyframe, searched) for frame in frames]


def _frame(number: int, tracks: Sequence[GroundTrack], keyframe: Keyframe, searched: Searched) -> GroundFrame:
    """Return a frame in which people have the boxes of detections that are where they should be."""
    for camera, detections in searched.get(number, {}).items():
        tracks = _with_detections(tracks, camera, detections)
    return GroundFrame(number, tuple(tracks), keyframe.people.report)


def _held(keyframe: Keyframe, frame: int) -> list[GroundTrack]:
    """Return a keyframe's tracks in a frame after its cameras have searched."""
    return [
        replace(
            track,
            boxes={
                camera: box if keyframe.searched.get(camera) == frame else GroundBox(box.box, None)
                for camera, box in track.boxes.items()
            },
        )
        for track in keyframe.people.tracks
    ]


def _between(
    before: GroundTrack, after: GroundTrack, share: float, boxes: Mapping[str, GroundBox]
) -> GroundTrack:
    return GroundTrack(
        after.id,
        _mean(before.place, after.place, share),
        _mean(before.covariance, after.covariance, share),
        boxes,
    )


def _boxes_between(
    before: GroundTrack, after: GroundTrack, previous: Keyframe, keyframe: Keyframe, frame: int
) -> dict[str, GroundBox]:
    """Return a person's boxes between two keyframes, in the cameras in which both have one."""
    boxes = {}
    for camera, end in after.boxes.items():
        begin, found = before.boxes.get(camera), keyframe.found_in(camera)
        if found == frame:
            boxes[camera] = end
        elif begin is not None:
            begun = previous.found_in(camera)
            share = min((frame - begun) / (found - begun), 1.0)
            boxes[camera] = GroundBox(_mean(begin.box, end.box, share), None)
    return boxes


def _mean(before: Floats, after: Floats, share: float) -> Floats:
    return np.asarray((1.0 - share) * before + share * after)


def _with_detections(tracks: Sequence[GroundTrack], camera: str, detections: Detections) -> list[GroundTrack]:
    """Return the tracks with a camera's detections in place of the boxes that they overlap most.

    Boxes that are detections, and these, stay.
    """
    found, used, seen = list(tracks), set[int](), []
    for at, track in enumerate(found):
        box = track.boxes.get(camera)
        if box is not None and box.detection is not None:
            used.add(box.detection)
        elif box is not None:
            seen.append(at)
    free = np.array([index for index in range(len(detections)) if index not in used], dtype=np.int64)
    if not seen or not len(free):
        return found
    boxes = np.stack([found[at].boxes[camera].box for at in seen])
    rows, columns = assign_pairs(iou(boxes[:, None], detections.boxes[None, free]), _MIN_IOU)
    for row, index in zip(rows.tolist(), free[columns].tolist(), strict=True):
        track = found[seen[row]]
        box = GroundBox(detections.boxes[index], index)
        found[seen[row]] = replace(track, boxes={**track.boxes, camera: box})
    return found
