"""All people with an id, and how ids are assigned, published, merged and split."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.appearance.cross_camera import CrossCameraAppearance
from bestview.association.appearance.histograms import PersonAppearance
from bestview.association.registry.corrections import Merge
from bestview.association.registry.other_sites import SINGLE_SITE, IdSeries, SiteSighting
from bestview.association.registry.person import Person
from bestview.association.registry.reidentification import LostPerson, Reidentifier
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import Tracklet
from bestview.association.tracklet_clusters import TrackletCluster


class PersonStore:
    """The known people by id."""

    def __init__(self, settings: ResolvedIdentitySettings, cameras: int, ids: IdSeries = SINGLE_SITE) -> None:
        self._settings, self._ids = settings, ids
        self._reidentifier = Reidentifier(settings, cameras)
        self._by_id: dict[int, Person] = {}
        self.next_id = ids.first_from(1)
        """The first id of the series that was never assigned."""

    def __len__(self) -> int:
        """Return the number of people remembered."""
        return len(self._by_id)

    def __contains__(self, person_id: object) -> bool:
        """Return whether a person of this id is remembered."""
        return person_id in self._by_id

    def people_to_cluster(self, frame: int) -> list[Person]:
        """Return the people who take part in clustering, by id: seen recently, with a settled tracklet."""
        earliest = frame - self._settings.comparable_frames
        return [
            person
            for _, person in sorted(self._by_id.items())
            if person.settled_frames and person.last_frame >= earliest and not person.elsewhere
        ]

    def assign_ids(
        self,
        clusters: Sequence[TrackletCluster],
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
        count_missing_cameras: Callable[[TrackletCluster], int],
    ) -> tuple[tuple[int, ...], tuple[Merge, ...]]:
        """Assign ids to clusters and their tracklets; return the new ids and the merges.

        `count_missing_cameras` counts the cameras that should see a cluster and do not.
        """
        published = [
            {number: frames for number, frames in cluster.published_frames.items() if number in self._by_id}
            for cluster in clusters
        ]
        for cluster, person_id in zip(clusters, assign_published_ids(published), strict=True):
            cluster.person_id = person_id
        created = self._assign_new_ids(clusters, affinity, cross_camera, frame, count_missing_cameras)
        for cluster in clusters:
            for tracklet in cluster.tracklets:
                tracklet.person_id = cluster.person_id
            if cluster.person_id:
                person = self._by_id[cluster.person_id]
                for tracklet in cluster.tracklets:
                    person.add_sighting(tracklet.key.camera, tracklet.end.frame)
                for before in cluster.people:
                    person.add_sighting(before.camera, before.last_frame)
        self._reidentifier.learn_covisible_cameras(
            (cluster for cluster in clusters if cluster.person_id), frame
        )
        return created, self._merge(clusters, frame)

    def _assign_new_ids(
        self,
        clusters: Sequence[TrackletCluster],
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
        count_missing_cameras: Callable[[TrackletCluster], int],
    ) -> tuple[int, ...]:
        """Assign ids to clusters that were seen often enough: a new one, or that of a lost person."""
        new = [
            cluster
            for cluster in clusters
            if cluster.tracklets
            and not cluster.person_id
            and self._is_confirmed(cluster, frame, count_missing_cameras)
        ]
        new.sort(key=lambda cluster: (cluster.first_frame, cluster.rows[0]))
        by_id = {cluster.person_id: cluster for cluster in clusters if cluster.person_id}
        lost = [
            LostPerson(person, by_id.get(person_id))
            for person_id, person in sorted(self._by_id.items())
            if not person.visible_elsewhere
            and (person_id not in by_id or by_id[person_id].last_frame < frame - self._settings.gap_frames)
        ]
        matches = self._reidentifier.match(new, lost, affinity, cross_camera, frame)
        created = []
        for cluster, match in zip(new, matches, strict=True):
            if match >= 0:
                cluster.person_id = lost[match].person.person_id
                continue
            cluster.person_id = self._create().person_id
            created.append(cluster.person_id)
        return tuple(created)

    def _create(self) -> Person:
        person = self._by_id[self.next_id] = Person(self.next_id)
        self._reserve_after(person.person_id)
        return person

    def _is_confirmed(
        self, new: TrackletCluster, frame: int, count_missing_cameras: Callable[[TrackletCluster], int]
    ) -> bool:
        """Return whether a cluster was seen recently, and often enough to be a person."""
        settings = self._settings
        least = settings.joint_confirmation_frames if new.is_joint else settings.confirmation_frames
        if (
            new.detection_count < least
            or new.last_frame < frame - settings.gap_frames - settings.clustering_interval
        ):
            return False
        unconfirmed_misses = (
            max(0, count_missing_cameras(new) - len(new.cameras_so_far) + 1) if settings.ghost_penalty else 0
        )
        return new.detection_count >= least * (1.0 + settings.ghost_penalty * unconfirmed_misses)

    def _merge(self, clusters: Sequence[TrackletCluster], frame: int) -> tuple[Merge, ...]:
        """Merge ids that no cluster has had for long into those of the clusters with their frames."""
        successors = _successors(clusters)
        merged = []
        for person_id, person in sorted(self._by_id.items()):
            if person_id not in successors:
                person.unused_since = -1
            elif person.unused_since < 0:
                person.unused_since = frame
            elif frame - person.unused_since >= self._settings.merge_after:
                merged.append(Merge(successors[person_id], person_id))
        for merge in merged:
            self._by_id[merge.kept].merge(self._by_id.pop(merge.lost))
        return tuple(merged)

    def split_off(self, people: Iterable[int], cameras: Iterable[str], frame: int) -> int:
        """Create a person that these cameras see and that was confused with these people; return the id."""
        new = self._create()
        for camera in cameras:
            new.add_sighting(camera, frame)
        self.include_in_clustering([new.person_id, *people])
        return new.person_id

    def reserve_below(self, person_id: int) -> None:
        """Assign only ids from this one on."""
        self.next_id = max(self.next_id, self._ids.first_from(person_id))

    def _reserve_after(self, person_id: int) -> None:
        """Assign no id up to this one any more; one of another site's series does not count."""
        if self._ids.has(person_id):
            self.reserve_below(person_id + 1)

    def recall(self, person_id: int, frame: int) -> None:
        """Restore a person last seen in a frame."""
        self._reserve_after(person_id)
        self._by_id.setdefault(person_id, Person(person_id, frame))

    def add_site_sightings(
        self, sightings: Iterable[SiteSighting], reference_histograms: Mapping[str, NDArray[np.float64]]
    ) -> None:
        """Add what other sites know about people, and how they render them, by site."""
        for site, histogram in reference_histograms.items():
            self._reidentifier.reference_histograms.put(site, histogram)
        for sighting in sightings:
            unknown = Person(sighting.person_id, departed=True, elsewhere=True)
            self._by_id.setdefault(sighting.person_id, unknown).add_site_sighting(sighting)

    @property
    def all_people(self) -> list[Person]:
        """All people, by id."""
        return [person for _, person in sorted(self._by_id.items())]

    def appearance(self, person_id: int) -> PersonAppearance:
        """Return a person's settled appearance; empty: they are not known."""
        person = self._by_id.get(person_id)
        return PersonAppearance() if person is None else person.appearance

    def restore(self, people: Iterable[Person]) -> None:
        """Add people whom another run knows; those known here stay as they are."""
        for person in people:
            self._reserve_after(person.person_id)
            self._by_id.setdefault(person.person_id, person)

    def renumber(self, ids: Mapping[int, int]) -> None:
        """Replace ids by others, one to one."""
        self._by_id = {ids.get(person_id, person_id): person for person_id, person in self._by_id.items()}
        for person_id, person in self._by_id.items():
            person.person_id = person_id
        for person_id in ids.values():
            self._reserve_after(person_id)

    def include_in_clustering(self, person_ids: Iterable[int]) -> None:
        """Make people take part in clustering, so that they can have cannot-links."""
        for person_id in person_ids:
            self._by_id[person_id].settled_frames = max(1, self._by_id[person_id].settled_frames)

    def settle(self, tracklets: Iterable[Tracklet]) -> None:
        """Add settled tracklets to the people whose id was published for most of their frames."""
        for tracklet in tracklets:
            person = self._by_id.get(tracklet.main_id)
            if person is not None:
                person.appearance.add_all(tracklet.appearance)
                person.settled_frames += tracklet.published_frames[person.person_id]

    def add_sightings(self, sightings: Iterable[tuple[int, str]], frame: int) -> None:
        """Record sightings of people by settled tracklets that continue."""
        for person_id, camera in sightings:
            if person_id in self._by_id:
                self._by_id[person_id].add_sighting(camera, frame)

    def update_presence(
        self, tracklets: Iterable[Tracklet], frame: int
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the ids of people who returned, and of people that no camera has seen for a while."""
        for tracklet in tracklets:
            person = self._by_id.get(tracklet.person_id)
            if person is not None:
                person.add_sighting(tracklet.key.camera, tracklet.end.frame)
        returned: list[int] = []
        departed: list[int] = []
        for person_id, person in sorted(self._by_id.items()):
            is_absent = person.elsewhere or frame - person.last_frame > self._settings.departed_after
            if is_absent != person.departed:
                (departed if is_absent else returned).append(person_id)
                person.departed = is_absent
        return tuple(returned), tuple(departed)

    def forget(self, people: Iterable[int]) -> None:
        """Forget people; their ids are not assigned again."""
        for person_id in people:
            self._reserve_after(person_id)
            self._by_id.pop(person_id, None)

    def forget_departed(self, frame: int) -> None:
        """Forget people who departed too long ago."""
        settings = self._settings
        settled_before = frame - settings.settle_after
        candidates = sorted(
            (person.last_frame, person_id)
            for person_id, person in self._by_id.items()
            if person.departed and person.last_frame < settled_before
        )
        surplus = len(candidates) - settings.maximum_departed_people
        for i, (last, person_id) in enumerate(candidates):
            if i < surplus or frame - last > settings.forget_after:
                del self._by_id[person_id]


def _successors(clusters: Sequence[TrackletCluster]) -> dict[int, int]:
    """Return for each published id that no cluster has the id of the cluster with most of its frames."""
    best: dict[int, tuple[int, int]] = {}
    for cluster in clusters:
        for person_id, frames in cluster.published_frames.items():
            if cluster.person_id and frames > best.get(person_id, (0, 0))[0]:
                best[person_id] = (frames, cluster.person_id)
    assigned = {cluster.person_id for cluster in clusters}
    return {person_id: successor for person_id, (_, successor) in best.items() if person_id not in assigned}


def assign_published_ids(published: Sequence[Mapping[int, int]]) -> list[int]:
    """Assign one of the published ids to each of G clusters; 0: none.

    The assignment maximizes the total number of frames that keep their published id.

    Args:
        published: for each cluster, frames by published id.
    """
    person_ids = sorted({person_id for frames in published for person_id in frames})
    assigned = [0] * len(published)
    if not person_ids:
        return assigned
    column = {person_id: i for i, person_id in enumerate(person_ids)}
    frames_kept = np.zeros((len(published), len(person_ids)))
    for cluster, frames in enumerate(published):
        for person_id, count in frames.items():
            frames_kept[cluster, column[person_id]] = count
    rows, columns = scipy.optimize.linear_sum_assignment(frames_kept, maximize=True)
    for cluster, place in zip(rows.tolist(), columns.tolist(), strict=True):
        if frames_kept[cluster, place] > 0:
            assigned[cluster] = person_ids[place]
    return assigned
