"""Where people are in a camera's frames, for viewers who must not recognize them.

More than the published boxes: also tracks that are not a confirmed person yet, detections that no track
follows, people whom a camera does not detect for a moment, and a margin, since boxes are cut short and may be
a little old.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey
from server.messaging.messages import NumberedBox
from server.messaging.packed_arrays import unpack_boxes, unpack_detections
from server.service.identity.camera_window import CameraWindow
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.track_parts import UNCONFIRMED
from server.service.ingest.epoch_aligner import Epoch
from server.service.ingest.window_history import HistorySpan
from tracking.boxes import iou
from tracking.frame_rate import frames_in

Regions = list[list[NumberedBox] | None]
"""By frame: the regions with people, by person or `UNCONFIRMED`; None: the camera has not looked."""

HOLD_S = 1.0
"""Seconds for which a region stays before a first box, as far as that is known, and after a last one."""
UNSEARCHED_S = 0.5
"""Seconds from the next frame in which the camera has looked for people after which nothing is known."""
MARGIN = 0.3
"""How far a region reaches beyond a box, on each side, in parts of its width and height.

Boxes often end below the hair (`python -m benchmarks.blurring`).
"""
_GROWTH = 0.4
"""How much further it reaches `HOLD_S` away from the next box: people move on."""
_MARGIN_MIN = 4.0
"""Pixels of the margin at least."""
GLIMPSE_S = 0.5
"""Seconds before and after a detection that no track follows for which its region stays."""
_FOLLOWED_SHARE = 0.3
"""Part of a detection in another region from which on it is of that person, or of several who are close: it
would hide the chosen one."""
_COVERED_SHARE = 0.95
"""Part of a detection in the region of another from which on it needs none of its own."""
_SAME_PERSON_IOU = 0.5
"""Overlap of two regions from which they are of one person."""


@dataclass(slots=True)
class _TrackBoxes:
    """A track's known boxes, by rising frame, and the last frame in which the tracker still follows it."""

    pulses: list[int] = field(default_factory=list)
    boxes: list[NDArray[np.float64]] = field(default_factory=list)
    followed_to: int = -1
    number: int = UNCONFIRMED


class OccupiedRegions:
    """Returns the regions with people, GOP by GOP in order; ``stride`` frames are between two windows."""

    def __init__(self, people: PersonTracker, cameras: Sequence[str], fps: float, stride: int) -> None:
        self._people = people
        self._hold = max(frames_in(HOLD_S, fps), stride)
        self._unsearched = max(frames_in(UNSEARCHED_S, fps), stride)
        self._before: dict[str, dict[TrackKey, _TrackBoxes]] = {camera: {} for camera in cameras}
        """By camera: the last box of each track before the next GOP."""
        self._trackless: dict[str, set[int]] = {camera: set() for camera in cameras}
        """By camera: frames whose newest window has no tracks because they were late."""
        self._own: dict[str, dict[int, NDArray[np.float64]]] = {camera: {} for camera in cameras}
        """By camera that is tracked jointly, and frame: the boxes of its own tracks, (N, 4)."""
        self._glimpse = frames_in(GLIMPSE_S, fps)
        self._detected: dict[str, dict[int, NDArray[np.float64]]] = {camera: {} for camera in cameras}
        """By camera and frame: all detections, (N, 4)."""
        self._searched: dict[str, int] = {}
        """By camera: the last frame before the next GOP in which it looked for people."""

    def take(self, epoch: Epoch) -> None:
        """Take the windows of an epoch, which must be in the person tracker already."""
        for camera, message in epoch.tracks.items():
            frames = range(message.first, message.last + 1)
            if camera in epoch.trackless:
                self._trackless[camera].update(frames)
            else:
                self._trackless[camera].difference_update(frames)
        for camera, message in {} if epoch.joint is None else epoch.joint.own.items():
            count = max(0, message.last - message.first + 1)
            boxes = unpack_boxes(track.boxes for track in message.tracks).reshape(
                len(message.tracks), count, 4
            )
            for at in range(count):
                self._own[camera][message.first + at] = boxes[~np.isnan(boxes[:, at, 0]), at]

        messages = dict(epoch.tracks) | ({} if epoch.joint is None else dict(epoch.joint.own))
        for camera, message in messages.items():
            for found in message.detections:
                if message.first <= found.pulse <= message.last:
                    self._detected[camera][found.pulse] = unpack_detections(found.boxes)[0]

    def next(self, camera: str, first: int, frames: int) -> Regions:
        """Return the regions of the next GOP, the frames from ``first`` on."""
        end = first + frames
        spans = self._people.windows(camera, first, end - 1 + self._hold)
        tracks = self._tracks(camera, first, end, spans)
        searched = self._searched_frames(camera, first, end, spans)
        regions: Regions = [
            [] if (np.abs(searched - pulse) <= self._unsearched).any() else None
            for pulse in range(first, end)
        ]
        numbers = self._people.numbers(list(tracks), first, frames).tolist()
        for track, track_numbers in zip(tracks.values(), numbers, strict=True):
            pulses, boxes = self._extended(track, first, end)
            for pulse, box in zip(pulses.tolist(), boxes.tolist(), strict=True):
                number = track_numbers[pulse - first]
                frame = regions[pulse - first]
                if frame is not None:
                    frame.append((track.number if number == UNCONFIRMED else number, *box))
        for pulse, frame in enumerate(regions, start=first):
            if frame is not None:
                self._add_own(frame, self._own[camera].pop(pulse, np.empty((0, 4))))
                self._add_unfollowed(frame, camera, pulse)
        self._remember(camera, end, tracks, [row[-1] for row in numbers], searched)
        return regions

    def _add_own(self, frame: list[NumberedBox], own: NDArray[np.float64]) -> None:
        """Add the people whom a camera tracks by itself alone: joint tracking may have doubts about them."""
        if not len(own):
            return
        widened = _with_margin(own, MARGIN)
        known = np.array([region[1:] for region in frame]).reshape(-1, 4)
        is_new = iou(widened[:, None], known).max(axis=1, initial=0.0) < _SAME_PERSON_IOU
        for left, top, right, bottom in widened[is_new].tolist():
            frame.append((UNCONFIRMED, left, top, right, bottom))

    def _add_unfollowed(self, frame: list[NumberedBox], camera: str, pulse: int) -> None:
        """Add detections near a frame that are far from everybody whom a track follows."""
        detected = self._detected[camera]
        near = sorted(
            (at for at in detected if abs(at - pulse) <= self._glimpse), key=lambda at: (abs(at - pulse), at)
        )
        boxes = np.concatenate([np.empty((0, 4)), *(detected[at] for at in near)])
        known = np.array([region[1:] for region in frame]).reshape(-1, 4)
        boxes = boxes[_share_in(boxes, known) < _FOLLOWED_SHARE]
        while len(boxes):  # the nearest in time first; most of the others are of the same people
            region = _with_margin(boxes[:1], MARGIN + _GROWTH)
            left, top, right, bottom = region[0].tolist()
            frame.append((UNCONFIRMED, left, top, right, bottom))
            boxes = boxes[_share_in(boxes, region) < _COVERED_SHARE]

    def _tracks(
        self, camera: str, first: int, end: int, spans: Sequence[HistorySpan[CameraWindow]]
    ) -> dict[TrackKey, _TrackBoxes]:
        """Return the tracks' boxes from before the GOP to as far as is known behind it."""
        tracks = {
            key: track
            for key, track in self._before[camera].items()
            if first - self._hold <= track.followed_to < first
        }
        for span in spans:
            window, at = span.window, span.first - span.window.first
            part = window.boxes[:, at : at + span.last - span.first + 1]
            for key, boxes in zip(window.keys, part, strict=True):
                track = tracks.setdefault(key, _TrackBoxes())
                track.followed_to = min(span.last, end - 1)
                (known,) = np.nonzero(~np.isnan(boxes[:, 0]))
                track.pulses += (known + span.first).tolist()
                track.boxes += list(boxes[known])
        return {key: track for key, track in tracks.items() if track.pulses}

    def _searched_frames(
        self, camera: str, first: int, end: int, spans: Sequence[HistorySpan[CameraWindow]]
    ) -> NDArray[np.int64]:
        """Return the frames near the GOP in which the camera looked for people."""
        count = end - first + self._hold
        searched = np.zeros(count, dtype=np.bool_)
        for span in spans:
            searched[span.first - first : span.last - first + 1] = True
        searched &= ~self._people.undetected.over(camera, first, count)
        searched &= [first + at not in self._trackless[camera] for at in range(count)]
        before = self._searched.get(camera)
        return np.concatenate(([] if before is None else [before], first + np.flatnonzero(searched))).astype(
            np.int64
        )

    def _extended(
        self, track: _TrackBoxes, first: int, end: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the frames of the GOP in which a track may be, (F,), and its regions there, (F, 4)."""
        known, boxes = np.array(track.pulses), np.array(track.boxes)
        begins = max(first, track.pulses[0] - self._hold)
        ends = min(end, max(track.pulses[-1], track.followed_to) + self._hold + 1)
        pulses = np.arange(begins, max(begins, ends))
        between = np.stack([np.interp(pulses, known, side) for side in boxes.T], axis=1)
        age = np.abs(pulses[:, None] - known).min(axis=1)
        reach = MARGIN + _GROWTH * np.minimum(1, age / self._hold)
        return pulses, _with_margin(between, reach[:, None])

    def _remember(
        self,
        camera: str,
        end: int,
        tracks: dict[TrackKey, _TrackBoxes],
        numbers: Sequence[int],
        searched: NDArray[np.int64],
    ) -> None:
        """Keep each track's last box in or before the GOP that ends."""
        self._before[camera] = remembered = {}
        for (key, track), number in zip(tracks.items(), numbers, strict=True):
            past = [at for at, pulse in enumerate(track.pulses) if pulse < end]
            if past:
                last = past[-1]
                remembered[key] = _TrackBoxes(
                    [track.pulses[last]],
                    [track.boxes[last]],
                    max(track.pulses[last], track.followed_to),
                    track.number if number == UNCONFIRMED else number,
                )
        self._detected[camera] = {
            pulse: boxes for pulse, boxes in self._detected[camera].items() if pulse >= end - self._glimpse
        }
        self._own[camera] = {pulse: own for pulse, own in self._own[camera].items() if pulse >= end}
        self._trackless[camera] = {pulse for pulse in self._trackless[camera] if pulse >= end}
        if (before := searched[searched < end]).size:
            self._searched[camera] = int(before[-1])


def _share_in(boxes: NDArray[np.float64], regions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest part of each box (N, 4) that is in one of the regions (R, 4)."""
    low = np.maximum(boxes[:, None, :2], regions[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], regions[None, :, 2:])
    inside = np.prod(np.maximum(high - low, 0.0), axis=2).max(axis=1, initial=0.0)
    area = np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0), axis=1)
    return np.asarray(np.where(area > 0, inside / np.maximum(area, 1e-9), 1.0))


def _with_margin(boxes: NDArray[np.float64], reach: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return boxes (N, 4) that reach further on each side, by parts of their width and height."""
    margin = np.maximum(_MARGIN_MIN, reach * (boxes[:, 2:] - boxes[:, :2]))
    return np.hstack([boxes[:, :2] - margin, boxes[:, 2:] + margin])
