"""Baselines of cross-camera association: by the nearest foot points, and by the ground truth."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmarks.bestview.camera_tracks import Messages, Rows
from bestview import IdentitySettings, foot_points, person_heights, to_ground
from server.messaging.packed_arrays import unpack_boxes
from tracking.boxes import Floats
from tracking.evaluation import oracle_association
from tracking.evaluation.frame_matching import align_frames
from tracking.motchallenge import MotRow

MIN_COMMON_FRAMES = 5
"""Common frames needed to compare two tracks."""


@dataclass(frozen=True, slots=True, order=True)
class _TrackKey:
    camera: str
    id: int


@dataclass(frozen=True, slots=True, eq=False)
class _GroundTrack:
    """A track on the ground: `(F,)` frames, `(F, 2)` foot points."""

    frames: np.ndarray[tuple[int], np.dtype[np.int64]]
    feet: Floats


def own_tracks(messages: Messages) -> dict[str, list[MotRow]]:
    """Return each camera's final boxes by local track id: `myview track` without interpolation."""
    tracks: dict[str, list[MotRow]] = {}
    for camera, camera_messages in messages.items():
        rows: list[MotRow] = []
        done = -1
        for message in camera_messages:
            final_to = message.last if message.ended else message.final_to
            for track in message.tracks:
                boxes = unpack_boxes([track.boxes])
                for frame in range(max(done + 1, message.first), final_to + 1):
                    box = boxes[frame - message.first]
                    if not np.isnan(box[0]):
                        rows.append(MotRow.of_box(frame + 1, track.id, box))
            done = max(done, final_to)
        tracks[camera] = sorted(rows, key=lambda row: (row.frame, row.id))
    return tracks


def unassociated_tracks(rows: Rows) -> dict[str, list[MotRow]]:
    """Return the tracks with a unique id for each track of each camera."""
    keys = sorted({_TrackKey(camera, row.id) for camera, found in rows.items() for row in found})
    number = {key: index for index, key in enumerate(keys, start=1)}
    return {
        camera: [replace(row, id=number[_TrackKey(camera, row.id)]) for row in found]
        for camera, found in rows.items()
    }


def by_nearest_feet(rows: Rows, ground: Mapping[str, Floats]) -> dict[str, list[MotRow]]:
    """Associate whole tracks of different cameras greedily by the median distance of foot points.

    The gate is MyView's `gate_heights`. Tracks of one camera that overlap in time, and tracks of cameras
    without a homography, are never joined.
    """
    walks, heights = _walks(rows, ground)
    gate = IdentitySettings().gate_heights * heights
    keys = sorted(walks)
    near = sorted(
        (distance, one, other)
        for place, one in enumerate(keys)
        for other in keys[place + 1 :]
        if one.camera != other.camera and (distance := _distance(walks[one], walks[other])) <= gate
    )
    group = {key: [key] for key in keys}
    for _, one, other in near:
        group_a, group_b = group[one], group[other]
        if group_a is not group_b and not _overlap_in_time(group_a, group_b, walks):
            group_a += group_b
            group.update(dict.fromkeys(group_b, group_a))
    unassociated = unassociated_tracks(rows)
    number = {
        _TrackKey(camera, row.id): new.id
        for camera in rows
        for row, new in zip(rows[camera], unassociated[camera], strict=True)
    }
    joined = {key: min(number[member] for member in members) for key, members in group.items()}
    return {
        camera: [
            replace(row, id=joined.get(key, number[key]))
            for row in found
            for key in (_TrackKey(camera, row.id),)
        ]
        for camera, found in rows.items()
    }


def boxes_by_truth(rows: Rows, gt: Rows) -> dict[str, list[MotRow]]:
    """Return each box with the id of the person in it; false positives are dropped."""
    return {camera: oracle_association(found, gt[camera]) for camera, found in rows.items()}


def apart_by_floor(rows: Rows, one_floor: Collection[str]) -> dict[str, list[MotRow]]:
    """Return the rows with ids that the cameras of one floor share, and no other cameras."""
    floors = {camera: "" if camera in one_floor else camera for camera in rows}
    by_floor = {(floors[camera], row.id) for camera, found in rows.items() for row in found}
    number = {key: index for index, key in enumerate(sorted(by_floor), start=1)}
    return {
        camera: [replace(row, id=number[floors[camera], row.id]) for row in found]
        for camera, found in rows.items()
    }


def tracks_by_truth(rows: Rows, gt: Rows, least_iou: float = 0.5) -> dict[str, list[MotRow]]:
    """Return each whole track with the id of its most frequent person.

    A track without a person is dropped. Of overlapping tracks of one person, the one with more frames on them
    is kept.
    """
    joined = {}
    for camera, found in rows.items():
        overlaps: dict[int, Counter[int]] = defaultdict(Counter)
        for frame in align_frames(gt[camera], found, least_iou):
            for person, track in zip(*np.nonzero(frame.similarity >= least_iou), strict=True):
                overlaps[int(frame.tracks[track])][int(frame.truth[person])] += 1
        best = {track: max(sorted(people), key=people.__getitem__) for track, people in overlaps.items()}
        frames_on_person = {track: people[best[track]] for track, people in overlaps.items()}
        matched = sorted(
            (row for row in found if row.id in best), key=lambda row: (row.frame, -frames_on_person[row.id])
        )
        joined[camera] = _first_of_each([replace(row, id=best[row.id]) for row in matched])
    return joined


def interpolated_gaps(rows: Rows, max_gap: int) -> dict[str, list[MotRow]]:
    """Interpolate boxes linearly over gaps of up to `max_gap` frames."""
    filled = {}
    for camera, found in rows.items():
        by_person: dict[int, list[MotRow]] = defaultdict(list)
        for row in sorted(found, key=lambda row: row.frame):
            by_person[row.id].append(row)
        interpolated = [
            _interpolated(one, other, frame)
            for track in by_person.values()
            for one, other in pairwise(track)
            if other.frame - one.frame <= max_gap
            for frame in range(one.frame + 1, other.frame)
        ]
        filled[camera] = sorted([*found, *interpolated], key=lambda row: (row.frame, row.id))
    return filled


def _interpolated(one: MotRow, other: MotRow, frame: int) -> MotRow:
    share = (frame - one.frame) / (other.frame - one.frame)
    sides = {
        name: (1.0 - share) * getattr(one, name) + share * getattr(other, name)
        for name in ("left", "top", "width", "height")
    }
    return replace(one, frame=frame, **sides)


def _first_of_each(rows: Sequence[MotRow]) -> list[MotRow]:
    """Keep the first row of each id in each frame."""
    matched: dict[tuple[int, int], MotRow] = {}
    for row in rows:
        matched.setdefault((row.frame, row.id), row)
    return list(matched.values())


def _walks(rows: Rows, ground: Mapping[str, Floats]) -> tuple[dict[_TrackKey, _GroundTrack], float]:
    """Return each track on the ground, and the height of a person in ground units."""
    tracks: dict[_TrackKey, list[MotRow]] = defaultdict(list)
    for camera, found in rows.items():
        for row in found:
            tracks[_TrackKey(camera, row.id)].append(row)
    walks, heights = {}, []
    for key, found in tracks.items():
        if key.camera not in ground:
            continue
        boxes = np.array([row.box for row in found])
        places = to_ground(ground[key.camera], foot_points(boxes))
        walks[key] = _GroundTrack(np.array([row.frame for row in found]), places)
        heights.append(person_heights(ground[key.camera], boxes))
    known = np.concatenate(heights) if heights else np.zeros(0)
    return walks, float(np.nanmedian(known)) if known.size else 0.0


def _distance(one: _GroundTrack, other: _GroundTrack) -> float:
    """Return the median distance in the common frames; infinite if there are too few."""
    _, here, there = np.intersect1d(one.frames, other.frames, return_indices=True)
    distances = np.linalg.norm(one.feet[here] - other.feet[there], axis=1)
    distances = distances[~np.isnan(distances)]
    return float(np.median(distances)) if len(distances) >= MIN_COMMON_FRAMES else np.inf


def _overlap_in_time(
    group_a: Sequence[_TrackKey], group_b: Sequence[_TrackKey], walks: Mapping[_TrackKey, _GroundTrack]
) -> bool:
    return any(
        one.camera == other.camera and np.intersect1d(walks[one].frames, walks[other].frames).size > 0
        for one in group_a
        for other in group_b
    )
