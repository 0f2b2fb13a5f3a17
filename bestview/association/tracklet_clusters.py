"""Clusters of tracklets that are one person, with the known people that they continue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.histograms import PersonAppearance
from bestview.association.registry.person import Person
from bestview.association.tracklet import Tracklet


@dataclass(eq=False)
class TrackletCluster:
    """Tracklets and known people that are one person. Complete before it is queried.

    Attributes:
        rows: of the affinity matrix.
        tracklets: active ones.
        people: known people in the cluster.
        person_id: the assigned id; 0: none yet.
    """

    rows: list[int] = field(default_factory=list)
    tracklets: list[Tracklet] = field(default_factory=list)
    people: list[Person] = field(default_factory=list)
    person_id: int = 0

    @property
    def detection_count(self) -> int:
        """Detections by all cameras."""
        return sum(sum(tracklet.detections.values()) for tracklet in self.tracklets)

    @property
    def is_joint(self) -> bool:
        """Whether several cameras track the person together."""
        return any(tracklet.is_joint for tracklet in self.tracklets)

    @property
    def first_frame(self) -> int:
        """First frame of the active tracklets, of which there must be some."""
        return min(tracklet.start.frame for tracklet in self.tracklets)

    @property
    def last_frame(self) -> int:
        """Last frame in which the person was seen, as a tracklet or as a known person."""
        return max(
            [
                *(tracklet.end.frame for tracklet in self.tracklets),
                *(person.last_frame for person in self.people),
            ]
        )

    @cached_property
    def cameras_so_far(self) -> set[str]:
        """Cameras that see the person, or have seen them before."""
        return set[str]().union(
            *(tracklet.detections for tracklet in self.tracklets),
            *(person.appearance.by_camera for person in self.people),
        )

    @cached_property
    def appearance(self) -> PersonAppearance:
        """Mean histograms of everything in the cluster."""
        appearance = PersonAppearance()
        for part in [person.appearance for person in self.people] + [
            tracklet.appearance for tracklet in self.tracklets
        ]:
            appearance.add_all(part)
        return appearance

    @property
    def published_frames(self) -> dict[int, int]:
        """Frames by published person id; an id that is about to be published counts as one frame."""
        frames_by_id = {person.person_id: person.settled_frames for person in self.people}
        for tracklet in self.tracklets:
            if tracklet.person_id:
                frames_by_id[tracklet.person_id] = frames_by_id.get(tracklet.person_id, 0) + 1
            for person_id, frames in tracklet.published_frames.items():
                frames_by_id[person_id] = frames_by_id.get(person_id, 0) + frames
        return frames_by_id


def collect_clusters(
    tracklets: Sequence[Tracklet], people: Sequence[Person], labels: NDArray[np.int64]
) -> list[TrackletCluster]:
    """Collect the rows of each cluster from (N,) labels, tracklets first; in the order of the rows."""
    clusters: dict[int, TrackletCluster] = {}
    for row, label in enumerate(labels.tolist()):
        cluster = clusters.setdefault(label, TrackletCluster())
        cluster.rows.append(row)
        if row < len(tracklets):
            cluster.tracklets.append(tracklets[row])
        else:
            cluster.people.append(people[row - len(tracklets)])
    return list(clusters.values())
