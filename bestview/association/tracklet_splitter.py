"""Split tracks into tracklets where the tracker may have confused people.

Trackers confuse people mostly where these occlude each other. A track that leaves a crowd or that reappears
after a gap starts a new tracklet, whose person is determined again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.histograms import MeanHistogram
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.sightings import AppearanceHistogram, TrackObservations
from bestview.association.tracklet import TrackKey, Tracklet, TrackletEndpoint, TrackletKey

Floats = NDArray[np.float64]
_MINIMUM_UNCROWDED_S = 0.16
"""Seconds outside crowds that a tracklet needs before the next crowd can end it."""
_STABLE_CLUSTERINGS = 2
"""Clusterings for which a tracklet must have kept one person id to be settled while it continues."""


class ObservedTracklets(NamedTuple):
    """The tracklet of each observation of an update.

    Attributes:
        rows: (T, W) its row in `TrackletSplitter.active`, -1: none.
        settled_ids: (T, W) its settled person id, 0: not settled.
    """

    rows: NDArray[np.int64]
    settled_ids: NDArray[np.int64]


class TrackletSplitter:
    """Splits every camera's tracks into tracklets, update by update.

    Attributes:
        active: tracklets that are not settled yet, in the order of their start: the rows of the affinity
            matrix.
    """

    def __init__(self, settings: ResolvedIdentitySettings) -> None:
        self._settings = settings
        self._minimum_uncrowded = max(round(_MINIMUM_UNCROWDED_S * settings.fps), 1)
        self.active: list[Tracklet] = []
        self._current: dict[TrackKey, Tracklet] = {}
        self._row: dict[TrackletKey, int] = {}
        self._pending_splits: dict[TrackKey, tuple[int, Tracklet]] = {}
        """Tracks whose next observation starts a new tracklet: its person id and its predecessor."""
        self._recalled_ids: dict[TrackKey, int] = {}
        """Person ids restored from an earlier run, for tracks that are not observed yet."""

    def update(
        self, observations: TrackObservations, appearance: Mapping[TrackKey, Sequence[AppearanceHistogram]]
    ) -> ObservedTracklets:
        """Add the observations of an update, and return their tracklets.

        Args:
            observations: of all tracks.
            appearance: histograms by track; those in a crowd do not count.
        """
        shape = observations.visible.shape
        rows, settled_ids = np.full(shape, -1), np.zeros(shape, dtype=np.int64)
        crowded = observations.crowded(self._settings.crowd_iou)
        # With a setting of 0 every frame may start a tracklet.
        frame_by_frame = min(self._settings.crowd_frames, self._settings.gap_frames) <= 0
        for run in observation_runs(observations.visible, crowded, frame_by_frame=frame_by_frame):
            key = observations.keys[run.track]
            tracklet, frame = self._current.get(key), observations.first_frame + run.start
            is_joint = run.track in observations.detected
            if key in self._pending_splits:
                person_id, predecessor = self._pending_splits.pop(key)
                tracklet = self._start_tracklet(
                    key, _endpoint(observations, run.track, run.start), predecessor, is_joint=is_joint
                )
                tracklet.continue_as(person_id, predecessor)
            elif tracklet is None or self._starts_new_tracklet(tracklet, frame, crowded=run.crowded):
                tracklet = self._start_tracklet(
                    key, _endpoint(observations, run.track, run.start), tracklet, is_joint=is_joint
                )
                if key in self._recalled_ids:
                    tracklet.reassign_id(self._recalled_ids.pop(key))
            tracklet.add_frames(
                range(frame, observations.first_frame + run.stop),
                observations.count_detections(run.track, run.start, run.stop),
                crowded=run.crowded,
            )
            tracklet.end = _endpoint(observations, run.track, run.stop - 1)
            rows[run.track, run.start : run.stop] = self._row.get(tracklet.key, -1)
            settled_ids[run.track, run.start : run.stop] = tracklet.settled_id
            for sample in appearance.get(key, ()):
                first, last = (
                    sample.first_frame - observations.first_frame,
                    sample.last_frame - observations.first_frame,
                )
                if run.start <= last < run.stop and not crowded[run.track, first : last + 1].any():
                    histogram = MeanHistogram.of(sample.histogram, last - first + 1)
                    tracklet.appearance.add(sample.camera or key.camera, histogram)
        return ObservedTracklets(rows, settled_ids)

    def _start_tracklet(
        self, key: TrackKey, at: TrackletEndpoint, predecessor: Tracklet | None, *, is_joint: bool
    ) -> Tracklet:
        tracklet = Tracklet(
            TrackletKey(*key, at.frame),
            at,
            at,
            predecessor,
            predecessor.crowd_frames_at_end if predecessor is not None else 0,
            is_joint=is_joint,
        )
        self._current[key] = tracklet
        self._row[tracklet.key] = len(self.active)
        self.active.append(tracklet)
        return tracklet

    def _starts_new_tracklet(self, tracklet: Tracklet, frame: int, *, crowded: bool) -> bool:
        """Return whether an observation in `frame` starts a new tracklet.

        Without appearance and ground point there is nothing to compare, and the tracker is trusted; so it is
        where cameras track together: it has compared both, and where else the person may be.
        """
        if tracklet.is_joint:
            return False
        if not tracklet.appearance.by_camera and np.isnan(tracklet.end.ground_point).any():
            return False
        settings = self._settings
        out_of_crowd = (
            not crowded
            and tracklet.crowd_frames_at_end >= settings.crowd_frames
            and tracklet.uncrowded_frames >= self._minimum_uncrowded
        )
        return out_of_crowd or frame - tracklet.end.frame > settings.gap_frames

    def showing(self, tracks: Iterable[TrackKey], people: Collection[int]) -> list[Tracklet]:
        """Return the current tracklets of these tracks that are one of these people, in the tracks' order."""
        current = [self._current[key] for key in sorted(set(tracks)) if key in self._current]
        return [tracklet for tracklet in current if (tracklet.settled_id or tracklet.person_id) in people]

    def predecessor(self, track: TrackKey, frame: int, settled_id: int) -> Tracklet | None:
        """Return the newest tracklet of a track that started before a frame; None: the track is unknown.

        For a settled tracklet that is over, it has this `settled_id`: nothing else is stored.
        """
        earlier = [
            tracklet
            for tracklet in self.active
            if tracklet.key.track == track and tracklet.start.frame < frame
        ]
        current = self._current.get(track)
        if earlier or current is None or current.start.frame < frame:
            return earlier[-1] if earlier else current
        endpoint = TrackletEndpoint(frame - 1, current.start.box, current.start.ground_point)
        return Tracklet(
            TrackletKey(*track, frame - 1), endpoint, endpoint, person_id=settled_id, settled_id=settled_id
        )

    def current_if_started_since(self, track: TrackKey, frame: int) -> Tracklet | None:
        """Return the current tracklet of a track if it is not settled and started in this frame or later."""
        current = self._current.get(track)
        return (
            current
            if current is not None and not current.settled_id and current.start.frame >= frame
            else None
        )

    def split_next(self, track: TrackKey, person_id: int, predecessor: Tracklet) -> None:
        """Start a new tracklet at a track's next observation: its person, and the tracklet it continues."""
        self._pending_splits[track] = person_id, predecessor

    def recall(self, track: TrackKey, person_id: int) -> None:
        """Assign a person id to the first tracklet of a track that is not observed yet."""
        if track not in self._current:
            self._recalled_ids[track] = person_id

    def merge_ids(self, lost: int, kept: int) -> None:
        """Replace a person id that was merged into another."""
        for tracklet in chain(self.active, self._current.values()):
            tracklet.merge_ids(lost, kept)
            tracklet.settled_id = kept if tracklet.settled_id == lost else tracklet.settled_id
        for track, (person_id, predecessor) in self._pending_splits.items():
            self._pending_splits[track] = kept if person_id == lost else person_id, predecessor
        self._recalled_ids = {
            track: kept if person_id == lost else person_id for track, person_id in self._recalled_ids.items()
        }

    def renumber(self, ids: Mapping[int, int]) -> None:
        """Replace person ids by others, one to one."""
        for tracklet in {
            id(tracklet): tracklet for tracklet in chain(self.active, self._current.values())
        }.values():
            tracklet.renumber(ids)
        self._pending_splits = {
            track: (ids.get(person_id, person_id), predecessor)
            for track, (person_id, predecessor) in self._pending_splits.items()
        }
        self._recalled_ids = {
            track: ids.get(person_id, person_id) for track, person_id in self._recalled_ids.items()
        }

    def forget(self, people: Collection[int]) -> None:
        """Forget people: their tracks start anew with the next observation, without past and appearance.

        Their active tracklets stay as rows until they are settled, but say nothing about anybody.
        """
        for tracklet in chain(self.active, self._current.values()):
            tracklet.forget_ids(people)
        self._current = {
            key: tracklet for key, tracklet in self._current.items() if not tracklet.is_forgotten
        }
        for tracklet in self.active:
            if tracklet.predecessor is not None and tracklet.predecessor.is_forgotten:
                tracklet.predecessor = None
        self._pending_splits = {
            key: split for key, split in self._pending_splits.items() if key in self._current
        }
        self._recalled_ids = {
            key: person_id for key, person_id in self._recalled_ids.items() if person_id not in people
        }

    def settleable_rows(self, last_frame: int) -> list[int]:
        """Return the rows of tracklets that are old enough to be settled, in order.

        If more than `maximum_open_tracklets` are active, those unseen for longest are settled earlier, though
        not before their id was published.
        """
        settings = self._settings
        ends = np.array([tracklet.end.frame for tracklet in self.active], dtype=np.int64)
        longest = np.argsort(ends, kind="stable")[: max(0, len(ends) - settings.maximum_open_tracklets)]
        earliest = last_frame - settings.publish_after - 2 * settings.clustering_interval
        old = ends <= last_frame - settings.settle_after
        old[longest[ends[longest] <= earliest]] = True
        excess = len(ends) - int(old.sum()) - settings.maximum_open_tracklets
        if excess > 0:
            # If these are too few, those with the same id for longest are settled until the next crowd.
            stable_frames = [
                tracklet.published_frames.get(tracklet.person_id, 0)
                if tracklet.person_id == tracklet.main_id
                else 0
                for tracklet in self.active
            ]
            most_stable = np.argsort(-np.where(old, 0, stable_frames), kind="stable")[:excess]
            old[
                most_stable[
                    np.array(stable_frames)[most_stable] >= _STABLE_CLUSTERINGS * settings.clustering_interval
                ]
            ] = True
        return [int(row) for row in np.flatnonzero(old)]

    def settle(self, old: Iterable[Tracklet], last_frame: int) -> None:
        """Remove tracklets from the active ones; tracks that continue keep the settled id."""
        oldest = last_frame - self._settings.settle_after
        closed = {tracklet.key for tracklet in old}
        for tracklet in self.active:
            if tracklet.key in closed:
                tracklet.predecessor = None  # otherwise all earlier tracklets would stay in memory
                tracklet.settled_id, tracklet.unpublished_frames = tracklet.main_id, []
        self.active = [tracklet for tracklet in self.active if tracklet.key not in closed]
        self._row = {tracklet.key: row for row, tracklet in enumerate(self.active)}
        # Settled tracks continue; those without an id, or ended long ago, start a new tracklet.
        self._current = {
            key: tracklet
            for key, tracklet in self._current.items()
            if tracklet.key in self._row or (tracklet.settled_id and tracklet.end.frame > oldest)
        }
        self._pending_splits = {
            key: split for key, split in self._pending_splits.items() if key in self._current
        }


def _endpoint(observations: TrackObservations, track: int, column: int) -> TrackletEndpoint:
    # Copies, so that a long-lived endpoint does not keep the arrays of a whole update in memory.
    return TrackletEndpoint(
        observations.first_frame + column,
        observations.boxes[track, column].copy(),
        observations.ground_point[track, column].copy(),
    )


class ObservationRun(NamedTuple):
    """Consecutive observations of a track from column `start` on, all crowded or all uncrowded."""

    track: int
    start: int
    stop: int
    crowded: bool


def observation_runs(
    visible: NDArray[np.bool_], crowded: NDArray[np.bool_], *, frame_by_frame: bool
) -> Iterator[ObservationRun]:
    """Yield runs of observations, (T, W) visible and crowded: only the first frame can start a tracklet.

    Runs are as long as possible; with `frame_by_frame` each is one frame.
    """
    kind = np.where(visible, 1 + crowded, 0)
    kind = np.pad(kind, ((0, 0), (1, 1)))
    change = (kind[:, 1:] != kind[:, :-1]) | frame_by_frame
    track, start = np.nonzero(change[:, :-1] & visible)
    # Ends are as many as starts, in the same order.
    _, stop = np.nonzero(change[:, 1:] & visible)
    for run in zip(
        track.tolist(), start.tolist(), (stop + 1).tolist(), crowded[track, start].tolist(), strict=True
    ):
        yield ObservationRun(*run)
