"""Track graph: identities are restored when a merged group splits (Todor 2009, chapter 7).

Tracks are predicted by a Kalman filter and matched by assignment. A track that is no longer detected and is
covered by another one merges into that track, which then represents a group of people. A new track that
starts beside a group splits from it: after some frames `departed_member` decides which member split off. The
original method processes the whole recording; here a split is decided after some frames, and earlier results
stay.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from tracking.baselines.frame_by_frame import StepwiseSettings
from tracking.baselines.kalman_prediction import KalmanPrediction
from tracking.baselines.stepwise import StepwiseTracker
from tracking.baselines.track_graphs.track_groups import (
    KalmanTrack,
    MeanAppearance,
    SplitCandidate,
    TrackEndpoint,
    TrackGraphSettings,
    TrackGroup,
    departed_member,
)
from tracking.boxes import Floats, areas, intersections
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import WindowSettings

_VELOCITY = slice(4, 6)
"""The velocity of the center in the filter's state."""


class TrackGraph(StepwiseTracker[cv2.KalmanFilter]):
    """Kalman tracks with merges into groups and splits from them."""

    def __init__(
        self,
        window: WindowSettings,
        settings: StepwiseSettings | None = None,
        graph: TrackGraphSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        super().__init__(KalmanPrediction(), window, settings, fps)
        self._graph = graph or TrackGraphSettings()
        self._merge_after = frames_in(self._graph.merge_after_s, fps)
        self._split_decision = frames_in(self._graph.split_decision_s, fps)
        self._max_group = frames_in(self._graph.max_group_s, fps)
        self._motion_frames = frames_in(self._graph.motion_s, fps)
        self._appearances: dict[int, MeanAppearance] = {}
        self._groups: dict[int, TrackGroup] = {}
        self._split_candidates: dict[int, SplitCandidate] = {}

    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        super()._step(frame, detections, image)
        self._remove_ended(frame)
        self._learn(frame, detections)
        self._merge(frame)
        self._add_split_candidates(frame)
        self._split()

    def _all_tracks(self) -> Iterable[KalmanTrack]:
        return (
            *super()._all_tracks(),
            *(item for group in self._groups.values() for item in group.merged_tracks),
        )

    def _is_confirmed(self, item: KalmanTrack) -> bool:
        return super()._is_confirmed(item) and item.serial not in self._split_candidates

    def _remove_ended(self, frame: int) -> None:
        """Remove ended groups, members that stayed too long, and ended split candidates."""
        alive = {item.serial for item in self._objects}
        self._split_candidates = {
            serial: candidate
            for serial, candidate in self._split_candidates.items()
            if serial in alive and candidate.host.serial in alive and candidate.host.serial in self._groups
        }
        for serial, group in list(self._groups.items()):
            expired = [frame - end.frame > self._max_group for end in group.entries[1:]]
            gone = [serial not in alive or too_long for too_long in expired]
            self._ended += [item for item, ended in zip(group.merged_tracks, gone, strict=True) if ended]
            group.entries[1:] = [end for end, ended in zip(group.entries[1:], gone, strict=True) if not ended]
            group.merged_tracks = [
                item for item, ended in zip(group.merged_tracks, gone, strict=True) if not ended
            ]
            if not group.merged_tracks:
                del self._groups[serial]
        known = {item.serial for item in self._all_tracks()}
        self._appearances = {
            serial: appearance for serial, appearance in self._appearances.items() if serial in known
        }

    def _learn(self, frame: int, detections: Detections) -> None:
        """Update the appearance of matched tracks: single ones, split candidates and their hosts."""
        for item in self._objects:
            _, index = item.observations.get(frame, (item.box, OCCLUDED))
            if index == OCCLUDED:
                continue
            histogram = detections.histograms[index]
            if item.serial in self._split_candidates:
                self._split_candidates[item.serial].appearance.add(histogram)
            elif item.serial in self._groups:
                for candidate in self._split_candidates.values():
                    if candidate.host is item:
                        candidate.host_appearance.add(histogram)
            else:
                self._appearances.setdefault(item.serial, MeanAppearance.empty(detections)).add(histogram)

    def _merge(self, frame: int) -> None:
        """Merge tracks that are no longer detected into the track that covers them."""
        confirmed = [item for item in self._objects if self._is_confirmed(item)]
        for item in confirmed:
            hosts = [other for other in confirmed if other.missed_frames == 0 and other in self._objects]
            if item.missed_frames < self._merge_after or not hosts:
                continue
            shared = intersections(np.stack([host.box for host in hosts]), item.box)
            best = int(np.argmax(shared))
            if shared[best] >= self._graph.min_covered_share * float(areas(item.box)):
                self._join(hosts[best], item, frame)

    def _join(self, host: KalmanTrack, item: KalmanTrack, frame: int) -> None:
        """Merge `item`, which may be a group itself, into `host`."""
        group = self._groups.setdefault(host.serial, TrackGroup([self._end(host, frame)]))
        merged = self._groups.pop(item.serial, None)
        group.entries += [self._end(item, frame)] if merged is None else merged.entries
        group.merged_tracks += [item] if merged is None else [item, *merged.merged_tracks]
        self._objects.remove(item)
        self._split_candidates = {
            serial: candidate
            for serial, candidate in self._split_candidates.items()
            if candidate.host is not item
        }

    def _end(self, item: KalmanTrack, frame: int) -> TrackEndpoint:
        """Return the end of a track that enters a group."""
        velocity = np.asarray(item.target.statePost, dtype=np.float64)[_VELOCITY, 0]
        return _track_end(frame, item.box, velocity, self._appearances[item.serial].mean)

    def _add_split_candidates(self, frame: int) -> None:
        """Register new tracks beside a group as split candidates."""
        hosts = [other for other in self._objects if other.serial in self._groups]
        for item in self._objects:
            if item.matches > 1 or frame not in item.observations or not hosts:
                continue
            near = intersections(np.stack([self._around(host.box) for host in hosts]), item.box)
            host = hosts[int(np.argmax(near))]
            if near.max() > 0.0 and item is not host:
                appearance, host_appearance = (
                    MeanAppearance(np.zeros_like(self._appearances[host.serial].total)) for _ in range(2)
                )
                self._split_candidates[item.serial] = SplitCandidate(
                    item, host, frame, item.box, host.box, appearance, host_appearance
                )

    def _around(self, box: Floats) -> Floats:
        margin = self._graph.split_margin * (box[2] - box[0])
        return np.asarray(box + np.array([-margin, -margin, margin, margin]))

    def _split(self) -> None:
        """Decide the identity of split candidates that were observed long enough."""
        for serial, candidate in list(self._split_candidates.items()):
            enough = (
                candidate.track.matches >= self._split_decision
                and candidate.host_appearance.frames
                and candidate.appearance.frames
            )
            group = self._groups.get(candidate.host.serial)
            if not enough and group is not None:
                continue
            del self._split_candidates[serial]
            if group is None:
                continue
            no_velocity = np.zeros(2)
            split = _track_end(
                candidate.first_frame, candidate.first_box, no_velocity, candidate.appearance.mean
            )
            remaining = _track_end(
                candidate.first_frame, candidate.first_host_box, no_velocity, candidate.host_appearance.mean
            )
            departed = departed_member(
                group.entries, split, remaining, self._motion_frames, self._graph.max_distance
            )
            if departed is not None:
                self._reassign_tracks(candidate, group, departed)

    def _reassign_tracks(self, candidate: SplitCandidate, group: TrackGroup, departed: int) -> None:
        """Reassign the tracks after a split: member `departed` of the group has left it."""
        host = candidate.host
        del self._groups[host.serial]
        continued, index = host, departed
        if departed == 0:
            # The host itself left: the next member of the group continues its track.
            continued, index = group.merged_tracks[0], 1
            self._objects.append(continued)
            _take_over(continued, host, candidate.first_frame)
            _take_over(host, candidate.track, candidate.first_frame)
            group.entries[0], group.entries[1] = group.entries[1], group.entries[0]
        else:
            self._objects.append(group.merged_tracks[departed - 1])
            _take_over(group.merged_tracks[departed - 1], candidate.track, candidate.first_frame)
        self._objects.remove(candidate.track)
        del group.entries[index], group.merged_tracks[index - 1]
        if group.merged_tracks:
            self._groups[continued.serial] = group
        for other in self._split_candidates.values():
            other.host = continued if other.host is host else other.host


def _track_end(frame: int, box: Floats, velocity: Floats, histogram: Floats) -> TrackEndpoint:
    return TrackEndpoint(frame, (box[:2] + box[2:]) / 2, velocity, float(box[3] - box[1]), histogram)


def _take_over(item: KalmanTrack, track: KalmanTrack, first: int) -> None:
    """Let `item` continue `track`, with its observations from the frame `first` on."""
    item.target, item.box, item.missed_frames = track.target, track.box, track.missed_frames
    item.observations.update(
        {frame: track.observations[frame] for frame in track.observations if frame >= first}
    )
    track.observations = {
        frame: observation for frame, observation in track.observations.items() if frame < first
    }
