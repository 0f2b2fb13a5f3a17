"""The settings of identity across cameras."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class IdentitySettings:
    """What makes two tracks one person, and for how long a person is remembered.

    Evidence is counted in "agreeing updates": an update in which two tracks stand on the very same
    ground gives 1, one in which they stand a gate apart gives 0, and one further apart takes away.

    Raises:
        ValueError: a setting outside its range.
    """

    # How far apart two cameras may see the same feet, in units of the ground plane. None: by person height.
    gate: float | None = None
    # The same in person heights, which the boxes tell in a ground plane of any unit (0.7: about 1.2 m).
    gate_heights: float = 0.7
    # How well boxes find the feet, standard deviations in box heights: the gate is longer where they do
    # not, which is along the line of sight.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.2
    # Sightings of people in two cameras that weigh as much as the homographies, which they correct.
    trust_ground: float = 50.0
    # Fastest plausible walk in person heights per frame, for who was lost and found (0.06: 2.5 m/s at 25/s).
    speed_heights: float = 0.06
    # Histograms further apart than this (mean difference of their CDFs, 0..1) are two people's.
    appearance_gate: float = 0.05
    # ... and so are those further apart than this times the lower quartile between people seen side by side.
    appearance_share: float = 1.0
    # Evidence that a track is the heir of one of the same camera that was lost where it begins.
    heir: float = 2.0
    # Evidence that lets a track join a person, in agreeing updates.
    join: float = 1.0
    # Evidence against that it takes to part a track from its person, in disagreeing updates.
    hold: float = 4.0
    # The most evidence a pair of tracks can have, for or against: how fast an old error is forgotten.
    cap: float = 8.0
    # Share of the evidence that lives on from one update to the next (0.95: half is forgotten in 14).
    memory: float = 0.95
    # Updates in which someone must be seen before they are given a number.
    confirm_updates: int = 4
    # Frames after which someone whom no camera sees is said to be gone (250: ten seconds at 25/s).
    gone_after: int = 250
    # Frames within which someone lost may be found again by place alone.
    continuity: int = 50
    # Frames for which a track that is not heard of keeps its evidence.
    track_memory: int = 500
    # Frames after which someone gone, and a track not heard of, are forgotten (15000: ten minutes at 25/s).
    forget_after: int = 15000
    # The most people remembered who are gone; the longest gone are forgotten first.
    remember: int = 1000

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.gate is not None and not self.gate > 0:
            raise ValueError(f"identity gate: {self.gate} is not above 0")
        if not 0 < self.memory <= 1:
            raise ValueError(f"identity memory: {self.memory} is not in (0, 1]")
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not value >= 0:
                raise ValueError(f"identity {field.name}: {value} is below 0")
