"""Settings of the association of tracklets to persons across cameras (`view.identity`)."""

from __future__ import annotations

from dataclasses import dataclass, fields

_MIN_HISTOGRAM_FRAMES = 3
"""Frames from which a mean histogram may have full weight at any frame rate: single ones are noisy."""


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
    # Seconds in a crowd after which a track that leaves it starts a new tracklet.
    crowd_s: float = 0.12
    # Seconds hidden after which a track that reappears starts a new tracklet.
    gap_s: float = 0.4
    # Distance, in ground units, at which two foot points are as likely of one person as of two. None:
    # `gate_heights`.
    gate_distance: float | None = None
    # The same in person heights, for a ground plane of any unit (0.7: about 1.2 m).
    gate_heights: float = 0.7
    # Standard deviations of foot points in box heights. The gate is longer along the line of sight, where
    # foot points are less certain.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.15
    # Seconds on the same ground that count as one observation: errors of neighboring frames are correlated.
    ground_correlation_s: float = 0.2
    # Largest evidence from the ground, for or against.
    maximum_ground_evidence: float = 20.0
    # Evidence at the appearance distance that is typical of one person in a camera.
    appearance_evidence: float = 8.0
    # Largest evidence from appearance in one camera, for or against.
    maximum_appearance_evidence: float = 12.0
    # Unoccluded seconds from which a mean histogram has full weight.
    appearance_s: float = 0.32
    # Evidence that a camera's track is the same person before and after a crowd...
    continuation_evidence: float = 3.0
    # ... which decays with the seconds of the crowd: to a third after this many.
    continuation_decay_s: float = 1.6
    # ... and with the seconds of a gap: to a third after this many.
    gap_decay_s: float = 1.0
    # Evidence that a track starting where another of the camera just ended is the same person.
    reappearance_evidence: float = 2.0
    # Distance allowed at once, and fastest plausible walk per second (1.5: 2.5 m/s), in person heights. Twice
    # as far is another person.
    reappearance_reach_heights: float = 0.6
    maximum_speed_heights: float = 1.5
    # Largest gap in seconds of a reappearance.
    reappearance_s: float = 3.0
    # Evidence for rows with the same published id.
    id_persistence_evidence: float = 1.0
    # Least affinity that merges two clusters.
    merge_threshold: float = 0.5
    # Appearance distance (mean difference of CDFs, 0 to 1) above which two histograms are of two people:
    # between cameras without common ground, and for re-identification.
    appearance_gate: float = 0.05
    # The gate is at most this times the lower quartile of distances between simultaneous people.
    appearance_gate_share: float = 1.0
    # Seconds over which cross-camera appearance evidence fades.
    cross_camera_memory_s: float = 4.0
    # Largest such evidence, for or against.
    maximum_cross_camera_evidence: float = 8.0
    # Seconds, summed over all cameras, for which a person must be seen to get an id.
    confirmation_s: float = 1.0
    # The same where cameras track together, and have weighed already whether somebody is there.
    joint_confirmation_s: float = 0.4
    # Additional multiples of them for each calibrated camera that should see the person and does not, unless
    # a second one sees them: shadows and ghosts of the background are seen by one camera.
    ghost_penalty: float = 4.0
    # Seconds between two clusterings.
    clustering_interval_s: float = 0.4
    # Seconds after which an id counts as published, and as evidence.
    publish_after_s: float = 0.2
    # Seconds after which an old tracklet is settled: its person id does not change any more.
    settle_after_s: float = 4.8
    # Active tracklets up to which that holds; of more, the longest unseen are settled first, then those with
    # the same id for longest. Bounds the cost of clustering in a large site.
    maximum_open_tracklets: int = 400
    # Seconds for which an id must be unused, its tracks having another, to be reported as merged.
    merge_after_s: float = 2.0
    # Seconds unseen by any camera after which a person is reported as departed.
    departed_after_s: float = 10.0
    # Longest travel time between cameras, in seconds, that is learned.
    maximum_travel_s: float = 180.0
    # Transitions out of a camera at which its travel times have half their weight.
    travel_half_weight_count: float = 5.0
    # Largest evidence from travel times, for or against; 0: appearance alone.
    maximum_travel_evidence: float = 4.0
    # Weight of appearance beside it: the evidence of a distance smaller by a factor of e.
    travel_appearance_weight: float = 3.0
    # Seconds for which an unseen person takes part in clustering; later only re-identification by appearance.
    comparable_s: float = 30.0
    # Seconds after which a departed person is forgotten.
    forget_after_s: float = 600.0
    # Departed people remembered at most; the longest departed are forgotten first.
    maximum_departed_people: int = 1000

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.gate_distance is not None and not self.gate_distance > 0:
            raise ValueError(f"identity gate_distance: {self.gate_distance} is not above 0")
        for name in (
            "clustering_interval_s",
            "cross_camera_memory_s",
            "appearance_s",
            "ground_correlation_s",
            "continuation_decay_s",
            "gap_decay_s",
            "reappearance_reach_heights",
            "travel_appearance_weight",
        ):
            if not getattr(self, name) > 0:
                raise ValueError(f"identity {name}: {getattr(self, name)} is not above 0")
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not value >= 0:
                raise ValueError(f"identity {field.name}: {value} is below 0")

    def resolve(self, fps: float) -> ResolvedIdentitySettings:
        """Return the settings with all times also in frames, for so many frames per second."""

        def frames(seconds: float, least: int = 0) -> int:
            return max(round(seconds * fps), least)

        publish_after, clustering_interval = (
            frames(self.publish_after_s),
            frames(self.clustering_interval_s, 1),
        )
        return ResolvedIdentitySettings(
            **{field.name: getattr(self, field.name) for field in fields(self)},
            fps=fps,
            crowd_frames=frames(self.crowd_s),
            gap_frames=frames(self.gap_s),
            ground_correlation_frames=max(self.ground_correlation_s * fps, 1.0),
            appearance_frames=frames(self.appearance_s, _MIN_HISTOGRAM_FRAMES),
            continuation_decay_frames=self.continuation_decay_s * fps,
            gap_decay_frames=self.gap_decay_s * fps,
            reappearance_frames=frames(self.reappearance_s),
            confirmation_frames=frames(self.confirmation_s),
            joint_confirmation_frames=frames(self.joint_confirmation_s),
            clustering_interval=clustering_interval,
            publish_after=publish_after,
            settle_after=frames(self.settle_after_s, publish_after + 2 * clustering_interval),
            merge_after=frames(self.merge_after_s),
            departed_after=frames(self.departed_after_s),
            maximum_travel_frames=frames(self.maximum_travel_s),
            comparable_frames=frames(self.comparable_s),
            forget_after=frames(self.forget_after_s),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedIdentitySettings(IdentitySettings):
    """Settings for one frame rate: each time is also given as a number of frames."""

    fps: float
    crowd_frames: int
    gap_frames: int
    ground_correlation_frames: float
    appearance_frames: int
    continuation_decay_frames: float
    gap_decay_frames: float
    reappearance_frames: int
    confirmation_frames: int
    joint_confirmation_frames: int
    clustering_interval: int
    publish_after: int
    settle_after: int
    merge_after: int
    departed_after: int
    maximum_travel_frames: int
    comparable_frames: int
    forget_after: int
