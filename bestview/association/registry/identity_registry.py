"""Identity registry: the same person id for the same person in every camera."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_fusion import AffinityFusion
from bestview.association.affinity.affinity_matrix import SCORED_S, AffinityMatrix
from bestview.association.appearance.cross_camera import CrossCameraAppearance
from bestview.association.appearance.histograms import MeanHistogram
from bestview.association.co_occurrence import (
    GroundTrajectories,
    pairs_in_one_camera_frame,
    score_ground_proximity,
)
from bestview.association.ghost_check import GhostCheck
from bestview.association.registry.corrections import IdCorrections, IdentityUpdate, Merge, Split, swap_tracks
from bestview.association.registry.other_sites import (
    SINGLE_SITE,
    IdSeries,
    SiteSighting,
    sum_over_cameras,
)
from bestview.association.registry.people import PersonStore
from bestview.association.registry.person import Person
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import FootPointError, TrackObservations, TrackUpdate, align_tracks
from bestview.association.tracklet import TrackKey, TrackletKey
from bestview.association.tracklet_clusters import TrackletCluster, collect_clusters
from bestview.association.tracklet_splitter import TrackletSplitter
from bestview.geometry.ground_plane import PersonHeightEstimate, validate_homography


class IdentityRegistry:
    """Associates the cameras' tracks with persons, update by update.

    Tracks are split into tracklets where the tracker may have confused people (`TrackletSplitter`). Pairs of
    tracklets collect evidence of being one person: ground position, appearance, continuity and published ids.
    Every few frames all tracklets of the last seconds are clustered (`cluster`), where two that are seen
    simultaneously in one camera are two people, and each cluster gets the id that most of its frames were
    published with. Older tracklets are settled: they keep their published id and take part as one known
    person. Ids count from 1 and are never reused. Deterministic.

    Args:
        settings: of identity.
        homographies: by camera name, image pixels -> common ground plane; None: not calibrated.
        overhead: the cameras that look straight down.
        fps: frames per second; bounds the distance walked between frames.
        ids: those to assign, where several sites share their people.

    Raises:
        ValueError: an invalid homography.
    """

    def __init__(
        self,
        settings: IdentitySettings,
        homographies: Mapping[str, NDArray[np.float64] | None],
        overhead: Collection[str] = (),
        fps: float = 25.0,
        ids: IdSeries = SINGLE_SITE,
    ) -> None:
        self._settings = resolved = settings.resolve(fps)
        self._overhead = frozenset(overhead)
        self._foot_error = FootPointError(settings.foot_sideways, settings.foot_upwards)
        self._homographies = {
            camera: None if matrix is None else validate_homography(matrix, f"camera {camera}")
            for camera, matrix in sorted(homographies.items())
        }
        self._camera_index = {camera: i for i, camera in enumerate(self._homographies)}
        self._height_estimate = PersonHeightEstimate()
        calibrated = {camera: matrix is not None for camera, matrix in self._homographies.items()}
        self._cross_camera = CrossCameraAppearance(resolved, calibrated)
        self._splitter = TrackletSplitter(resolved)
        self._people = PersonStore(resolved, len(self._homographies), ids)
        # Whether a person should be detected is only known for views in which people stand upright.
        self._ghost_check = GhostCheck(
            {
                camera: None if camera in self._overhead else matrix
                for camera, matrix in self._homographies.items()
            }
        )
        self._picture_sizes: Mapping[str, tuple[int, int]] = {}
        self._affinity = AffinityMatrix(resolved)
        self._fusion = AffinityFusion(resolved, calibrated, resolved.maximum_speed_heights / fps)
        self._corrections = IdCorrections()
        self._visible_settled_ids: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._last_frame: int | None = None

    def update(
        self,
        tracks: Sequence[TrackUpdate],
        last_frame: int,
        picture_sizes: Mapping[str, tuple[int, int]] | None = None,
    ) -> IdentityUpdate:
        """Add the new final frames of all cameras' tracks, up to `last_frame`; single cameras may be ahead.

        A track that is missing may reappear. `picture_sizes` are the widths and heights in pixels of the
        cameras that have reported, even without tracks: only these can miss a person.

        Raises:
            ValueError: the frame is not after that of the last update, or tracks are invalid
                (`align_tracks`).
        """
        if self._last_frame is not None and last_frame <= self._last_frame:
            raise ValueError(f"the update for frame {last_frame} comes after that for {self._last_frame}")
        previous_frame, self._last_frame = self._last_frame, last_frame
        self._picture_sizes = picture_sizes or {}
        observations = align_tracks(tracks, self._homographies, self._foot_error, self._overhead)
        self._height_estimate.learn(observations.person_heights)
        rows, settled = self._splitter.update(observations, {track.key: track.appearance for track in tracks})
        self._visible_settled_ids = np.unique(settled[settled > 0])
        # Each pair of track and person once, instead of once a frame.
        id_count = int(settled.max(initial=0)) + 1
        track, person_id = np.divmod(
            np.unique((np.arange(len(settled))[:, None] * id_count + settled)[settled > 0]), id_count
        )
        cameras = [observations.keys[row].camera for row in track.tolist()]
        self._people.add_sightings(zip(person_id.tolist(), cameras, strict=True), last_frame)
        elapsed_s = SCORED_S if previous_frame is None else (last_frame - previous_frame) / self._settings.fps
        self._add_evidence(observations, rows, settled, last_frame, elapsed_s)
        tracklets = self._splitter.active
        created: tuple[int, ...] = ()
        merged: tuple[Merge, ...] = ()
        published: dict[TrackletKey, int] = {}
        interval = self._settings.clustering_interval
        clusters_now = previous_frame is None or last_frame // interval > previous_frame // interval
        if clusters_now:
            created, merged = self._cluster(last_frame)
            published = {
                tracklet.key: tracklet.person_id
                for tracklet in tracklets
                if tracklet.publish(last_frame - self._settings.publish_after)
            }
        returned, departed = self._people.update_presence(tracklets, last_frame)
        split = self._corrections.update(published, merged)
        person_ids = {
            tracklet.key: 0 if tracklet.is_forgotten else tracklet.person_id for tracklet in tracklets
        }
        if clusters_now:
            self._settle(last_frame)
        return IdentityUpdate(person_ids, created, returned, departed, merged, split)

    def split_off(self, tracks: Collection[TrackKey], people: Collection[int]) -> int | None:
        """Apply an operator's correction: these tracks show a new person instead of these people.

        The split is permanent: they are never merged with the new person again, as long as they are
        remembered.

        Returns:
            The new person's id; None: none of the tracks shows one of these people now.
        """
        if self._last_frame is None:
            return None
        known_ids = [person_id for person_id in sorted(people) if person_id in self._people]
        shown = self._splitter.showing(tracks, known_ids)
        if not shown:
            return None
        new_id = self._people.split_off(
            known_ids, {tracklet.key.camera for tracklet in shown}, self._last_frame
        )
        for tracklet in shown:
            tracklet.reassign_id(new_id)
        split_keys = {tracklet.key for tracklet in shown}
        rows = [tracklet.key for tracklet in self._splitter.active]
        others = [
            tracklet.key
            for tracklet in self._splitter.active
            if tracklet.person_id in known_ids and tracklet.key not in split_keys
        ]
        self._affinity.add_rows([new_id, *known_ids])
        self._corrections.split_off(split_keys, new_id)
        self._affinity.forbid_merging(
            [new_id, *(key for key in rows if key in split_keys)], [*known_ids, *others]
        )
        return new_id

    def swap_tracks(
        self, first: TrackKey, second: TrackKey, frame: int, ids_before: tuple[int, int]
    ) -> tuple[Split, ...]:
        """Apply an operator's correction: two tracks of a camera swapped their people in this frame.

        From that frame on each track shows the person of the other. Tracklets of other cameras that were
        assigned to one of the two since are swapped as well.

        Args:
            first: one track.
            second: the other track.
            frame: the first in which each of them shows the other's person.
            ids_before: person ids of the two tracks before that frame, for tracklets that are settled and
                over.

        Returns:
            The splits to report; none if the evidence has corrected the swap already, or a track has no id.
        """
        splits = swap_tracks(self._splitter, self._people, (first, second), frame, ids_before)
        self._corrections.reassign_each(splits)
        return tuple(sorted({Split(old_id, new_id, key.camera) for key, (old_id, new_id) in splits.items()}))

    @property
    def next_id(self) -> int:
        """The first id that was never assigned."""
        return self._people.next_id

    def reserve_below(self, person_id: int) -> None:
        """Assign only ids from this one on: those below were used by an earlier run."""
        self._people.reserve_below(person_id)

    def recall(self, track: TrackKey, person_id: int, frame: int) -> None:
        """Restore the person of a track that is not observed yet, from a run that ended with frame `frame`.

        It counts like a published id: later observations may override it.
        """
        self._people.recall(person_id, frame)
        self._splitter.recall(track, person_id)

    @property
    def people(self) -> Sequence[Person]:
        """All remembered people, by id: another run can `restore` them."""
        return self._people.all_people

    def restore(self, people: Iterable[Person]) -> None:
        """Add people whom another run remembers, before their first track is observed here."""
        self._people.restore(people)

    def add_site_sightings(
        self, sightings: Iterable[SiteSighting], reference_histograms: Mapping[str, NDArray[np.float64]]
    ) -> None:
        """Add people whom other sites see or have seen: who arrives here can be one who has left there.

        `reference_histograms` are what `reference_histogram` returns at these sites, by their names.
        """
        self._people.add_site_sightings(sightings, reference_histograms)

    def reference_histogram(self, bins: int) -> NDArray[np.float64]:
        """Return the sum of the (B,) histograms of all tracks: how this site's cameras render people."""
        return self._cross_camera.equalizer.reference_histogram(bins)

    def mean_histograms(self, people: Iterable[int]) -> dict[int, MeanHistogram]:
        """Return these people's mean histograms over this site's cameras, by id, as far as known."""
        parts = {person_id: [self._people.appearance(person_id)] for person_id in people}
        for tracklet in self._splitter.active:
            if tracklet.person_id in parts:
                parts[tracklet.person_id].append(tracklet.appearance)
        found = {person_id: sum_over_cameras(each) for person_id, each in parts.items()}
        return {person_id: histogram for person_id, histogram in found.items() if histogram is not None}

    def renumber(self, ids: Mapping[int, int]) -> None:
        """Replace ids by those of another run, one to one: by id, the new one, which nobody else has."""
        self._people.renumber(ids)
        self._splitter.renumber(ids)
        self._affinity.rename_people(ids)
        self._corrections.renumber(ids)
        renumbered = [ids.get(person_id, person_id) for person_id in self._visible_settled_ids.tolist()]
        self._visible_settled_ids = np.array(sorted(renumbered), dtype=np.int64)

    def forget(self, people: Collection[int]) -> None:
        """Forget people: appearance, sightings, tracks. Who is visible is confirmed anew, with another id."""
        self._people.forget(people)
        self._splitter.forget(people)
        self._corrections.forget(people)
        self._visible_settled_ids = self._visible_settled_ids[
            ~np.isin(self._visible_settled_ids, sorted(people))
        ]

    def _gate(self) -> float:
        """Return the ground distance at which two foot points are as likely of one person as of two."""
        settings = self._settings
        return (
            settings.gate_distance
            if settings.gate_distance is not None
            else settings.gate_heights * self._height_estimate.height
        )

    def _count_missing_cameras(self, cluster: TrackletCluster) -> int:
        return self._ghost_check.count_missing_cameras(
            cluster, self._picture_sizes, self._height_estimate.height
        )

    def _add_evidence(
        self,
        observations: TrackObservations,
        rows: NDArray[np.int64],
        settled: NDArray[np.int64],
        last_frame: int,
        elapsed_s: float,
    ) -> None:
        """Add the update's evidence about pairs of tracklets to the affinity matrix."""
        known_ids = [person.person_id for person in self._people.people_to_cluster(last_frame)]
        affinity = self._affinity
        count = len(self._splitter.active)
        affinity.set_rows([*(tracklet.key for tracklet in self._splitter.active), *known_ids])
        if known_ids:
            # Settled tracklets that continue have the row of their person.
            position = np.minimum(np.searchsorted(known_ids, settled), len(known_ids) - 1)
            rows = np.where(np.array(known_ids)[position] == settled, count + position, rows)
        camera = np.array([self._camera_index[key.camera] for key in observations.keys], dtype=np.int64)
        affinity.add_cannot_links(*pairs_in_one_camera_frame(rows, camera))
        if self._gate() > 0:
            trajectories = GroundTrajectories.of(observations, rows, camera)
            proximity = score_ground_proximity(
                trajectories, self._gate(), count, affinity.proximity_pairs(), len(affinity)
            )
            affinity.add_ground_evidence(
                proximity.first, proximity.second, proximity.score, proximity.frame_count
            )
            affinity.add_localized_frames(trajectories.sighting_rows, trajectories.sighting_frames)
        self._cross_camera.update(
            self._splitter.active, np.unique(rows[(rows >= 0) & (rows < count)]), affinity, elapsed_s
        )

    def _cluster(self, last_frame: int) -> tuple[tuple[int, ...], tuple[Merge, ...]]:
        """Cluster all tracklets and assign ids; return the new ids and the merges."""
        tracklets, people = self._splitter.active, self._people.people_to_cluster(last_frame)
        visible = np.isin([person.person_id for person in people], self._visible_settled_ids)
        labels = self._fusion.cluster(
            tracklets, people, visible, self._affinity, self._height_estimate.height
        )
        clusters = collect_clusters(tracklets, people, labels)
        created, merged = self._people.assign_ids(
            clusters, self._affinity, self._cross_camera, last_frame, self._count_missing_cameras
        )
        self._affinity.add_rows(merge.kept for merge in merged)
        self._affinity.merge([(merge.kept, merge.lost) for merge in merged])
        for merge in merged:
            self._splitter.merge_ids(merge.lost, merge.kept)
        return created, merged

    def _settle(self, last_frame: int) -> None:
        """Settle old tracklets: from now on they are part of their known person."""
        rows = self._splitter.settleable_rows(last_frame)
        self._fusion.keep_distances_of_settling(rows, self._splitter.active, self._affinity)
        settled = [self._splitter.active[row] for row in rows]
        settled_rows = [(tracklet.main_id, tracklet.key) for tracklet in settled if tracklet.main_id]
        self._affinity.add_rows(person_id for person_id, _ in settled_rows)
        self._affinity.merge(settled_rows)
        self._people.settle(settled)
        self._splitter.settle(settled, last_frame)
        self._people.forget_departed(last_frame)
        self._corrections.keep_only({tracklet.key for tracklet in self._splitter.active})
