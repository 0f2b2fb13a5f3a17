"""Other ways to say who is who across cameras: by the nearest feet, and by the truth."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmarks.bestview.camera_tracks import Messages, Rows
from bestview import IdentitySettings, foot_points, person_heights, to_ground
from tracking.boxes import Floats
from tracking.evaluation import oracle_association
from tracking.evaluation.frame_matching import align_frames
from tracking.motchallenge import MotRow

LEAST_COMMON = 5
"""Frames that two tracks must share to be compared."""


@dataclass(frozen=True, slots=True, order=True)
class _TrackKey:
    camera: str
    id: int


@dataclass(frozen=True, slots=True, eq=False)
class _GroundTrack:
    """Where a track stands: `(F,)` frames, `(F, 2)` feet on the ground."""

    frames: np.ndarray[tuple[int], np.dtype[np.int64]]
    feet: Floats


def own_tracks(messages: Messages) -> dict[str, list[MotRow]]:
    """Return each camera's final boxes by its own numbers: what `myview track` finds, without its bridges."""
    tracks: dict[str, list[MotRow]] = {}
    for camera, said in messages.items():
        rows: list[MotRow] = []
        done = -1
        for message in said:
            final_to = message.last if message.ended else message.final_to
            for track in message.tracks:
                for frame in range(max(done + 1, message.first), final_to + 1):
                    box = track.boxes[frame - message.first]
                    if box is not None:
                        left, top, right, bottom = box
                        rows.append(MotRow(frame + 1, track.id, left, top, right - left, bottom - top))
            done = max(done, final_to)
        tracks[camera] = sorted(rows, key=lambda row: (row.frame, row.id))
    return tracks


def not_joined(rows: Rows) -> dict[str, list[MotRow]]:
    """Return every track of every camera a number of its own."""
    keys = sorted({_TrackKey(camera, row.id) for camera, found in rows.items() for row in found})
    number = {key: place for place, key in enumerate(keys, start=1)}
    return {
        camera: [replace(row, id=number[_TrackKey(camera, row.id)]) for row in found]
        for camera, found in rows.items()
    }


def by_nearest_feet(rows: Rows, ground: Mapping[str, Floats]) -> dict[str, list[MotRow]]:
    """Join whole tracks of different cameras by the median distance of their feet, the nearest first.

    The gate is MyView's own, `gate_heights` of a person. Two tracks of one camera that are there at once are
    never joined, and neither are those of a camera without homography.
    """
    walks, heights = _walks(rows, ground)
    gate = IdentitySettings().gate_heights * heights
    keys = sorted(walks)
    near = sorted(
        (distance, one, other)
        for place, one in enumerate(keys)
        for other in keys[place + 1 :]
        if one.camera != other.camera and (distance := _apart(walks[one], walks[other])) <= gate
    )
    group = {key: [key] for key in keys}
    for _, one, other in near:
        ours, theirs = group[one], group[other]
        if ours is not theirs and not _clash(ours, theirs, walks):
            ours += theirs
            group.update(dict.fromkeys(theirs, ours))
    alone = not_joined(rows)
    number = {
        _TrackKey(camera, it.id): new.id
        for camera in rows
        for it, new in zip(rows[camera], alone[camera], strict=True)
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
    """Return each box the number of the person it is at; boxes at nobody go."""
    return {camera: oracle_association(found, gt[camera]) for camera, found in rows.items()}


def tracks_by_truth(rows: Rows, gt: Rows, least_iou: float = 0.5) -> dict[str, list[MotRow]]:
    """Return each track, for all its life, the number of the person it is most often at.

    A track that is never at anybody goes. Where two of a person are there at once, the one that is with them
    for longer stays.
    """
    joined = {}
    for camera, found in rows.items():
        met: dict[int, Counter[int]] = defaultdict(Counter)
        for frame in align_frames(gt[camera], found, least_iou):
            for person, track in zip(*np.nonzero(frame.similarity >= least_iou), strict=True):
                met[int(frame.tracks[track])][int(frame.truth[person])] += 1
        best = {track: max(sorted(people), key=people.__getitem__) for track, people in met.items()}
        long = {track: people[best[track]] for track, people in met.items()}
        kept = sorted((row for row in found if row.id in best), key=lambda row: (row.frame, -long[row.id]))
        joined[camera] = _first_of_each([replace(row, id=best[row.id]) for row in kept])
    return joined


def bridged(rows: Rows, most: int) -> dict[str, list[MotRow]]:
    """Put boxes, on the straight line, where a camera finds somebody again within `most` frames."""
    filled = {}
    for camera, found in rows.items():
        by_person: dict[int, list[MotRow]] = defaultdict(list)
        for row in sorted(found, key=lambda row: row.frame):
            by_person[row.id].append(row)
        between = [
            _between(one, other, frame)
            for track in by_person.values()
            for one, other in pairwise(track)
            if other.frame - one.frame <= most
            for frame in range(one.frame + 1, other.frame)
        ]
        filled[camera] = sorted([*found, *between], key=lambda row: (row.frame, row.id))
    return filled


def _between(one: MotRow, other: MotRow, frame: int) -> MotRow:
    share = (frame - one.frame) / (other.frame - one.frame)
    sides = {
        name: (1.0 - share) * getattr(one, name) + share * getattr(other, name)
        for name in ("left", "top", "width", "height")
    }
    return replace(one, frame=frame, **sides)


def _first_of_each(rows: Sequence[MotRow]) -> list[MotRow]:
    """Keep the first row of each number in each frame."""
    kept: dict[tuple[int, int], MotRow] = {}
    for row in rows:
        kept.setdefault((row.frame, row.id), row)
    return list(kept.values())


def _walks(rows: Rows, ground: Mapping[str, Floats]) -> tuple[dict[_TrackKey, _GroundTrack], float]:
    """Return where each track stands, and the height of a person in ground units."""
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


def _apart(one: _GroundTrack, other: _GroundTrack) -> float:
    """Return the median distance in the frames that both are in; infinite where these are few."""
    _, here, there = np.intersect1d(one.frames, other.frames, return_indices=True)
    distances = np.linalg.norm(one.feet[here] - other.feet[there], axis=1)
    distances = distances[~np.isnan(distances)]
    return float(np.median(distances)) if len(distances) >= LEAST_COMMON else np.inf


def _clash(
    ours: Sequence[_TrackKey], theirs: Sequence[_TrackKey], walks: Mapping[_TrackKey, _GroundTrack]
) -> bool:
    return any(
        one.camera == other.camera and np.intersect1d(walks[one].frames, walks[other].frames).size > 0
        for one in ours
        for other in theirs
    )
