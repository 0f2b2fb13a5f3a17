"""What temporal consistency is set by; the report's own numbers are the defaults where it has any."""

from __future__ import annotations

from dataclasses import dataclass, field

_MOST_PLACES = 3
_MOST_STAGES, _LONGEST_STAGE_S = 1000, 60.0
_MOST_GROWN_M, _MOST_SAMPLES = 1.0, 200
_NOT_NEGATIVE = (
    *("merge", "partly", "apart", "unknown", "isolated_m"),
    *("outside", "leave", "vanish", "person_m2", "forget_s"),
)


@dataclass(frozen=True, slots=True)
class BlobSettings:
    """The background, and what of the foreground is a blob (section 3).

    Raises:
        ValueError: a number makes no sense.
    """

    work_width: int = 320  # pixels; wider pictures are made smaller first
    threshold: float = 5.0  # Mahalanobis distance from the background above which a pixel is foreground
    brightness_floor: float = 6.0  # least standard deviation of the background's brightness, grey levels
    colour_floor: float = 2.5  # and of its two colours: lower ones would see noise and soft shadows
    grow_m: float = 0.06  # metres by which the foreground is dilated, so that parts of a body are one
    least_m2: float = 0.04  # square metres of floor below which a blob is noise
    bootstrap_frames: int = 100  # frames from which the background is learned, without a recording to look at
    samples: int = 25  # how many of them it is taken from
    learn_rate: float = 0.05  # share of each sample that enters the background, where nobody is

    def __post_init__(self) -> None:
        least = (self.work_width, self.threshold, self.brightness_floor, self.colour_floor, self.samples)
        if not all(it > 0 for it in least):
            raise ValueError(
                "work_width, threshold, brightness_floor, colour_floor and samples must be above 0"
            )
        if not self.samples <= min(self.bootstrap_frames, _MOST_SAMPLES):
            raise ValueError(f"samples must be at most bootstrap_frames, and at most {_MOST_SAMPLES}")
        if not 0.0 <= self.learn_rate <= 1.0:
            raise ValueError(f"learn_rate is a share between 0 and 1, not {self.learn_rate}")
        if not 0.0 <= self.grow_m <= _MOST_GROWN_M or not self.least_m2 >= 0.0:
            raise ValueError(f"grow_m must be 0 to {_MOST_GROWN_M:g} and least_m2 at least 0")


@dataclass(frozen=True, slots=True)
class TemporalSettings:
    """The window, its costs, and how people come and go.

    Raises:
        ValueError: a number makes no sense.
    """

    stages: int = 5  # samples of a window: somebody's place is decided when so many are there; 1 is at once
    stage_s: float = 0.5  # seconds from one sample to the next
    room_m: float = 6.0  # metres of floor that the picture is wide
    merge: float = 0.35  # M: what each person costs who is in a blob with others, but for one of them
    speed: float = 1.45  # V_a: metres a second that people go, a little less than walking
    partly: float = 0.06  # C_PO: metres that two blobs are apart whose boxes overlap in part
    apart: float = 0.16  # C_NO: metres added where they do not overlap
    prune: float = 2.0  # times the way at that speed beyond which a link is left out of the graph; 0: none is
    unknown: float = 0.5  # what a look costs of somebody whose looks are not known
    places: int = 3  # parts of the room on each side, with a histogram of everybody in each of them
    isolated_m: float = 0.4  # metres to the next person from which on somebody's looks are learned
    closed: bool = False  # the report's own: nobody comes or goes after the first stage
    outside: float = 1.0  # what each stage costs in which somebody is nowhere
    leave: float = 0.25  # what going out of the picture costs, and coming in
    vanish: float = 2.0  # the same in the middle of the picture
    confirm: int = 3  # stages in a row in which a blob must be nobody's to be somebody new
    person_m2: float = 0.1  # square metres of floor that somebody new covers at least
    forget_s: float = 10.0  # seconds nowhere after which somebody is gone for good
    most_people: int = 12  # people followed at most
    most_states: int = 100_000  # joint states of a stage; more people are decided one group after the other
    blobs: BlobSettings = field(default_factory=BlobSettings)

    def __post_init__(self) -> None:
        if not 1 <= self.stages <= _MOST_STAGES or not 0.0 < self.stage_s <= _LONGEST_STAGE_S:
            raise ValueError(
                f"stages must be 1 to {_MOST_STAGES}, and stage_s above 0 and at most {_LONGEST_STAGE_S:g}"
            )
        if min(self.confirm, self.most_people, self.most_states) < 1:
            raise ValueError("confirm, most_people and most_states must be at least 1")
        if min(self.room_m, self.speed) <= 0:
            raise ValueError("room_m and speed must be above 0")
        for name in _NOT_NEGATIVE:
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, and is {getattr(self, name)}")
        if not 1 <= self.places <= _MOST_PLACES:
            raise ValueError(f"places must be 1 to {_MOST_PLACES} on a side, not {self.places}")
        if self.prune and self.prune < 1:
            raise ValueError(f"prune must be 0, for none, or at least 1, not {self.prune}")

    def stage_frames(self, fps: float) -> int:
        """Give the frames from one sample to the next."""
        return max(1, round(self.stage_s * fps))

    def lag(self, fps: float) -> int:
        """Give the frames that follow a frame at most before it is final."""
        return self.stages * self.stage_frames(fps) - 1
