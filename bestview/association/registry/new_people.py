"""Re-identification: clusters without an id are matched with people who were lost, or are new people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.affinity.travel_times import CameraSighting, TravelTimeModel
from bestview.association.appearance.cross_camera import CrossCameraAppearance
from bestview.association.appearance.mean_histograms import PersonAppearance
from bestview.association.registry.person import Person
from bestview.association.registry.reidentification import match_by_appearance
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet_groups import TrackletCluster


@dataclass(frozen=True, slots=True, eq=False)
class LostPerson:
    """A person whom no camera sees.

    Attributes:
        person: who.
        group: their cluster; None: they take part in no clustering.
    """

    person: Person
    group: TrackletCluster | None

    @property
    def appearance(self) -> PersonAppearance:
        """Their appearance, including tracklets that are not settled yet."""
        return self.person.appearance if self.group is None else self.group.appearance


class Reidentifier:
    """Matches new clusters with lost people by appearance and travel time.

    Args:
        settings: of identity.
        cameras: how many there are.
    """

    def __init__(self, settings: IdentitySettings, cameras: int) -> None:
        self._settings = settings
        self._travel = TravelTimeModel(settings, cameras)
        self._meeting: set[tuple[str, str]] = set()
        """Cameras that have seen one person at once."""

    def learn_covisible_cameras(self, groups: Iterable[TrackletCluster], frame: int) -> None:
        """Learn from clusters which cameras see the same people simultaneously: their views overlap."""
        since = frame - self._settings.clustering_interval
        for group in groups:
            cameras = {it.key.camera for it in group.tracklets if it.end.frame >= since}
            self._meeting.update(combinations(sorted(cameras), 2))

    def match(
        self,
        new: Sequence[TrackletCluster],
        lost: Sequence[LostPerson],
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
    ) -> list[int]:
        """Return for each new cluster the index of the lost person it is, or -1."""
        allowed = [self._may_be(one, other, affinity, cross_camera, frame) for one in new for other in lost]
        possible = np.array(allowed, dtype=np.bool_).reshape(len(new), len(lost))
        if not possible.any():
            return [-1] * len(new)
        appearances = [it.appearance for it in new], [it.appearance for it in lost]
        arrivals, departures = [_first_sighting(it) for it in new], [it.person.last_sighting for it in lost]
        time = self._travel.evidence(arrivals, departures)
        by_appearance = match_by_appearance(
            cross_camera.equalizer, *appearances, possible, cross_camera.same_person_gate
        )
        distance_factor = np.exp(-time / self._settings.travel_appearance_weight)
        matches = match_by_appearance(
            cross_camera.equalizer, *appearances, possible, cross_camera.same_person_gate, distance_factor
        )
        for i, match in enumerate(by_appearance):
            if match < 0:
                continue
            # Only what looks alone say teaches times, or these would prove themselves.
            self._travel.learn(departures[match], arrivals[i])
            if (
                matches[i] < 0
                and match not in matches
                and time[i, match] > -self._settings.maximum_travel_evidence / 2.0
            ):
                matches[i] = match
        return matches

    def _may_be(
        self,
        new: TrackletCluster,
        lost: LostPerson,
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
    ) -> bool:
        """Return whether appearance and travel time alone may match a new cluster with a lost person."""
        known_cluster = lost.group
        if known_cluster is None:
            # Who has no group though they are compared with everybody is in somebody else's.
            return lost.person.last_frame < frame - self._settings.comparable_frames
        # Where there was something to compare by, grouping has had its say.
        compared = bool(new.cameras & known_cluster.cameras) or (
            cross_camera.share_ground(new.cameras, known_cluster.cameras)
            and self._share_view(new, known_cluster)
        )
        return not compared and not affinity.any_cannot_link(new.rows, known_cluster.rows)

    def _share_view(self, first: TrackletCluster, second: TrackletCluster) -> bool:
        pairs = {(min(a, b), max(a, b)) for a in first.cameras for b in second.cameras}
        return not pairs.isdisjoint(self._meeting)


def _first_sighting(new: TrackletCluster) -> CameraSighting:
    """Return where and when a cluster was seen first."""
    frame, camera = min((it.start.frame, it.key.camera) for it in new.tracklets)
    return CameraSighting(camera, frame)
