"""Settings of temporal consistency; defaults are the report's numbers where it has any."""

from __future__ import annotations

from dataclasses import dataclass, field

_MAX_REGIONS = 3
_MAX_STAGES, _MAX_STAGE_S = 1000, 60.0
_MAX_DILATION_M, _MAX_SAMPLES = 1.0, 200
_NON_NEGATIVE = (
    *("merge_cost", "partial_overlap_m", "no_overlap_m", "unknown_appearance", "isolated_m"),
    *("absence_cost", "border_exit_cost", "inner_exit_cost", "min_person_m2", "forget_after_s"),
)


@dataclass(frozen=True, slots=True)
class BlobSettings:
    """Background model and blob segmentation (section 3).

    Raises:
        ValueError: a setting is out of range.
    """

    work_width: int = 320  # pixels; wider images are resized first
    threshold: float = 5.0  # Mahalanobis distance from the background above which a pixel is foreground
    brightness_floor: float = 6.0  # least standard deviation of the background's brightness, gray levels
    chroma_floor: float = (
        2.5  # the same for its two chroma channels: lower values detect noise and soft shadows
    )
    dilation_m: float = 0.06  # meters by which the foreground is dilated, so that parts of a body are one
    min_area_m2: float = 0.04  # square meters of floor below which a blob is noise
    bootstrap_s: float = 4.0  # seconds from which the background is learned live
    samples: int = 25  # frames of these that are used
    learn_s: float = 10.0  # seconds in which the background follows a change, outside of people

    def __post_init__(self) -> None:
        positive = (self.work_width, self.threshold, self.brightness_floor, self.chroma_floor, self.samples)
        if not all(value > 0 for value in positive):
            raise ValueError(
                "work_width, threshold, brightness_floor, chroma_floor and samples must be above 0"
            )
        if not self.bootstrap_s > 0.0 or self.samples > _MAX_SAMPLES:
            raise ValueError(f"bootstrap_s must be above 0, and samples at most {_MAX_SAMPLES}")
        if not self.learn_s > 0.0:
            raise ValueError(f"learn_s must be above 0, not {self.learn_s}")
        if not 0.0 <= self.dilation_m <= _MAX_DILATION_M or not self.min_area_m2 >= 0.0:
            raise ValueError(f"dilation_m must be 0 to {_MAX_DILATION_M:g} and min_area_m2 at least 0")


@dataclass(frozen=True, slots=True)
class TemporalSettings:
    """The window, its costs, and how people enter and leave.

    Raises:
        ValueError: a setting is out of range.
    """

    window_stages: int = 5  # samples in a window: a sample is decided when so many follow; 1: immediately
    stage_s: float = 0.5  # seconds between samples
    room_m: float = 6.0  # meters of floor across the image; metric ground calibration overrides it
    merge_cost: float = 0.35  # M: cost of each further person in a shared blob
    speed_m_s: float = 1.45  # V_a: usual speed of people, meters a second
    partial_overlap_m: float = 0.06  # C_PO: distance of two blobs whose boxes overlap in part, meters
    no_overlap_m: float = 0.16  # C_NO: meters added where boxes do not overlap
    prune_factor: float = 2.0  # multiple of the usual distance beyond which links are pruned; 0: none
    unknown_appearance: float = 0.5  # appearance cost of a person without learned appearance
    appearance_regions: int = 3  # image regions per side with a histogram each, 1 to 3
    isolated_m: float = 0.4  # meters to the next person from which appearance is learned
    closed_world: bool = False  # true: nobody enters or leaves after the first stage (the report)
    absence_cost: float = 1.0  # cost of each stage in which a person is absent
    border_exit_cost: float = 0.25  # cost of leaving or entering at the image border
    inner_exit_cost: float = 2.0  # the same away from the border
    confirm_stages: int = 3  # stages in a row in which a blob must be unassigned to be a new person
    min_person_m2: float = 0.1  # least square meters of floor covered by a new person
    forget_after_s: float = 10.0  # seconds of absence after which a person is forgotten
    max_people: int = 12  # most people tracked
    max_joint_states: int = 100_000  # joint states per stage; larger groups are solved in turn
    blobs: BlobSettings = field(default_factory=BlobSettings)

    def __post_init__(self) -> None:
        if not 1 <= self.window_stages <= _MAX_STAGES or not 0.0 < self.stage_s <= _MAX_STAGE_S:
            raise ValueError(
                f"window_stages must be 1 to {_MAX_STAGES}, and stage_s above 0 up to {_MAX_STAGE_S:g}"
            )
        if min(self.confirm_stages, self.max_people, self.max_joint_states) < 1:
            raise ValueError("confirm_stages, max_people and max_joint_states must be at least 1")
        if min(self.room_m, self.speed_m_s) <= 0:
            raise ValueError("room_m and speed_m_s must be above 0")
        for name in _NON_NEGATIVE:
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, and is {getattr(self, name)}")
        if not 1 <= self.appearance_regions <= _MAX_REGIONS:
            raise ValueError(
                f"appearance_regions must be 1 to {_MAX_REGIONS} on a side, not {self.appearance_regions}"
            )
        if self.prune_factor and self.prune_factor < 1:
            raise ValueError(f"prune_factor must be 0, for none, or at least 1, not {self.prune_factor}")

    def stage_frames(self, fps: float) -> int:
        """Return the frames from one sample to the next."""
        return max(1, round(self.stage_s * fps))

    def max_final_lag(self, fps: float) -> int:
        """Return the largest number of frames that follow a frame before it is final."""
        return self.window_stages * self.stage_frames(fps) - 1
