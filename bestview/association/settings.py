"""Settings of the association of tracklets to persons across cameras (`view.identity`)."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class IdentitySettings:
    """When two tracklets are one person, and for how long a person is remembered.

    Evidence is a log-likelihood ratio: the logarithm of how many times likelier the observations are if they
    are of one person than if they are of two. The values are round numbers, not fitted distributions.

    Raises:
        ValueError: a setting is out of range.
    """

    # Overlap (IoU) with another track of the camera above which a track is in a crowd.
    crowd_iou: float = 0.2
    # Frames in a crowd after which a track that leaves it starts a new tracklet.
    crowd_frames: int = 3
    # Frames hidden after which a track that reappears starts a new tracklet.
    gap_frames: int = 10
    # Distance, in ground units, at which two foot points are as likely of one person as of two. None:
    # `gate_heights`.
    gate_distance: float | None = None
    # The same in person heights, for a ground plane of any unit (0.7: about 1.2 m).
    gate_heights: float = 0.7
    # Standard deviations of foot points in box heights. The gate is longer along the line of sight, where
    # foot points are less certain.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.15
    # Frames on the same ground that count as one: errors of neighboring frames are correlated.
    ground_correlation_frames: float = 5.0
    # Largest evidence from the ground, for or against.
    maximum_ground_evidence: float = 20.0
    # Evidence at the appearance distance that is typical of one person in a camera.
    appearance_evidence: float = 8.0
    # Largest evidence from appearance in one camera, for or against.
    maximum_appearance_evidence: float = 12.0
    # Unoccluded frames from which a mean histogram has full weight.
    appearance_frames: int = 8
    # Evidence that a camera's track is the same person before and after a crowd...
    continuation_evidence: float = 3.0
    # ... which decays with the frames of the crowd: to a third after this many.
    continuation_decay_frames: float = 40.0
    # Evidence that a track starting where another of the camera just ended is the same person.
    reappearance_evidence: float = 2.0
    # Distance allowed at once, and fastest plausible walk per second (1.5: 2.5 m/s), in person heights. Twice
    # as far is another person.
    reappearance_reach_heights: float = 0.6
    maximum_speed_heights: float = 1.5
    # Largest gap in frames of a reappearance.
    reappearance_frames: int = 75
    # Evidence for rows with the same published id.
    id_persistence_evidence: float = 1.0
    # Least affinity that merges two clusters.
    merge_threshold: float = 0.5
    # Appearance distance (mean difference of CDFs, 0 to 1) above which two histograms are of two people:
    # between cameras without common ground, and for re-identification.
    appearance_gate: float = 0.05
    # The gate is at most this times the lower quartile of distances between simultaneous people.
    appearance_gate_share: float = 1.0
    # Share of the cross-camera appearance evidence that is kept from one update to the next.
    cross_camera_memory: float = 0.95
    # Largest such evidence, for or against.
    maximum_cross_camera_evidence: float = 8.0
    # Frames, over all cameras, in which a person must be seen to get an id.
    confirmation_frames: int = 25
    # Additional multiples of these frames for each calibrated camera that should see the person and does not,
    # unless a second one sees them: shadows and ghosts of the background are seen by one camera.
    ghost_penalty: float = 4.0
    # Frames between two clusterings.
    clustering_interval: int = 10
    # Frames after which an id counts as published, and as evidence.
    publish_after: int = 5
    # Frames after which an old tracklet is settled: its person id does not change any more.
    settle_after: int = 120
    # Active tracklets up to which that holds; of more, the longest unseen are settled first, then those with
    # the same id for longest. Bounds the cost of clustering in a large site.
    maximum_open_tracklets: int = 400
    # Frames for which an id must be unused, its tracks having another, to be reported as merged.
    merge_after: int = 50
    # Frames unseen by any camera after which a person is reported as departed (250: ten seconds at 25/s).
    departed_after: int = 250
    # Longest travel time between cameras, in frames, that is learned (4500: three minutes at 25/s).
    travel_frames: int = 4500
    # Transitions out of a camera at which its travel times have half their weight.
    travel_half_weight_count: float = 5.0
    # Largest evidence from travel times, for or against; 0: appearance alone.
    maximum_travel_evidence: float = 4.0
    # Weight of appearance beside it: the evidence of a distance smaller by a factor of e.
    travel_appearance_weight: float = 3.0
    # Frames for which an unseen person takes part in clustering; later only re-identification by appearance.
    comparable_frames: int = 750
    # Frames after which a departed person is forgotten (15000: ten minutes at 25/s).
    forget_after: int = 15000
    # Departed people remembered at most; the longest departed are forgotten first.
    maximum_departed_people: int = 1000

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.gate_distance is not None and not self.gate_distance > 0:
            raise ValueError(f"identity gate_distance: {self.gate_distance} is not above 0")
        if not 0 < self.cross_camera_memory <= 1:
            raise ValueError(f"identity cross_camera_memory: {self.cross_camera_memory} is not in (0, 1]")
        for name in (
            "clustering_interval",
            "appearance_frames",
            "ground_correlation_frames",
            "continuation_decay_frames",
            "reappearance_reach_heights",
            "travel_appearance_weight",
        ):
            if not getattr(self, name) > 0:
                raise ValueError(f"identity {name}: {getattr(self, name)} is not above 0")
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not value >= 0:
                raise ValueError(f"identity {field.name}: {value} is below 0")
