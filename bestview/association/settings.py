"""Settings of the association of tracklets to persons across cameras (`view.identity`)."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class IdentitySettings:
    """When two tracklets are one person, and for how long a person is remembered.

    Evidence is a log-likelihood ratio: the logarithm of how many times likelier the observations are if they
    are of one person than if they are of two. The values are round numbers, not fitted distributions.

    Raises:
        ValueError: a setting outside its range.
    """

    # Overlap (IoU) with somebody else in the same picture above which a track is in a crowd.
    crowd_iou: float = 0.2
    # Frames of crowd after which it is asked anew who has come out of it.
    crowd_frames: int = 3
    # Frames unseen after which a track that goes on is asked likewise.
    gap_frames: int = 10
    # How far apart two cameras may see the same feet, in units of the ground plane. None: by person height.
    gate_distance: float | None = None
    # The same in person heights, which the boxes tell in a ground plane of any unit (0.7: about 1.2 m).
    gate_heights: float = 0.7
    # How well boxes find the feet, standard deviations in box heights: the gate is longer where they do
    # not, which is along the line of sight.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.15
    # Frames of standing on the same ground that are worth one: neighbouring frames err alike.
    ground_correlation_frames: float = 5.0
    # The most evidence that the ground gives, for or against.
    maximum_ground_evidence: float = 20.0
    # Evidence of looking as much alike as the same person usually does in a camera.
    appearance_evidence: float = 8.0
    # The most evidence that looks give in one camera, for or against.
    maximum_appearance_evidence: float = 12.0
    # Frames alone after which a look is known well enough to weigh in full.
    appearance_frames: int = 8
    # Evidence that a camera's track is the same person before and after a crowd...
    continuation_evidence: float = 3.0
    # ... which fades with the frames of the crowd.
    continuation_decay_frames: float = 40.0
    # Evidence that who begins where somebody of the same camera was just lost is the same person.
    reappearance_evidence: float = 2.0
    # How far that may be at once, and the fastest plausible walk in a second (1.5: 2.5 m/s), in person
    # heights. Twice as far, and it is somebody else.
    reappearance_reach_heights: float = 0.6
    maximum_speed_heights: float = 1.5
    # Frames within which place tells who was lost and found.
    reappearance_frames: int = 75
    # Evidence that who was told to be one person is one.
    id_persistence_evidence: float = 1.0
    # Evidence that joins.
    merge_threshold: float = 0.5
    # Histograms further apart than this (mean difference of their CDFs, 0..1) are two people's: between
    # cameras without a common ground, and for who comes back after long.
    appearance_gate: float = 0.05
    # ... and so are those further apart than this times the lower quartile between people seen side by side.
    appearance_gate_share: float = 1.0
    # Share of the evidence of looks between cameras that lives on from one update to the next.
    cross_camera_memory: float = 0.95
    # The most such evidence, for or against.
    maximum_cross_camera_evidence: float = 8.0
    # Frames, of all cameras together, in which someone must be seen before they are given a number.
    confirmation_frames: int = 25
    # Times as many more for each camera that should see them too and does not, and that no second one which
    # does makes up for: shadows, and ghosts of the background, are seen by one camera.
    ghost_penalty: float = 4.0
    # Frames between two times at which everybody is grouped anew.
    clustering_interval: int = 10
    # Frames after which a number was told, and weighs for staying.
    publish_after: int = 5
    # Frames after which an old part of a track is settled: it stays whose it was told to be.
    settle_after: int = 120
    # Parts of tracks up to which that is so; of more, those unseen for longest are settled sooner, then those
    # that have been told one number for longest: a bound on what grouping costs in a large site.
    maximum_open_tracklets: int = 400
    # Frames for which a number must be nobody's, its tracks somebody else's, to be told as merged.
    merge_after: int = 50
    # Frames after which someone whom no camera sees is said to be gone (250: ten seconds at 25/s).
    departed_after: int = 250
    # Frames within which the way from camera to camera says who has come (4500: three minutes at 25/s).
    travel_frames: int = 4500
    # Ways out of a camera that must be known for their times to weigh half.
    travel_half_weight_count: float = 5.0
    # The most evidence that they give, for or against; 0: looks alone.
    maximum_travel_evidence: float = 4.0
    # What looks weigh beside them: the evidence of being nearer than the gate by a factor of e.
    travel_appearance_weight: float = 3.0
    # Frames for which who is gone is compared like everybody; later only a clear likeness brings them back.
    comparable_frames: int = 750
    # Frames after which someone gone is forgotten (15000: ten minutes at 25/s).
    forget_after: int = 15000
    # The most people remembered who are gone; the longest gone are forgotten first.
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
