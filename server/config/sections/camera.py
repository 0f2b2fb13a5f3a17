"""The sections `cameras` and `track`: a camera's source, and tracking."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    NonNegativeFloat,
    PositiveFloat,
    ValidationInfo,
    field_validator,
)

from bestview import CrossViewSettings, validate_homography
from server.config.ground_unit import check_unit_spelling
from server.config.sections.base import Identifier, OffsetSeconds, Polygon, Section
from server.config.unknown_keys import no_unknown_keys
from tracking import DEFAULT_SOLVER, CostSettings, Solver, SolverBudget, WindowSettings, create_solver
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.interactive import InteractiveSettings
from tracking.registry import DEFAULT_TRACKER, OFFLINE_TRACKERS, TEMPORAL_TRACKER, tracker_names


def _spell_off(value: object) -> object:
    """Return YAML's ``off``, which is a boolean, as text."""
    return "off" if value is False else value


class CameraSettings(Section):
    """One camera."""

    id: Identifier
    source: str
    """A file, a folder of images, a URL that FFmpeg opens, /dev/video0, or scene:NAME?camera=0&…"""
    substream: str | None = None
    """The same view in a smaller stream or file, in which people are tracked; None: in the source."""
    password: Path | None = None
    """A file whose one line, the camera's password, replaces `{password}` in `source` and `substream`."""
    kind: Literal["upright", "overhead"] = "upright"
    """People stand upright in its picture, or it looks straight down on them."""
    offset_s: OffsetSeconds = 0.0
    """A recording shows at pulse n its moment n / fps - offset_s, to the next frame."""
    at_end: Literal["stop", "loop"] = "stop"
    """What a recording does after its last frame."""
    passthrough: Annotated[Literal["off", "auto", "pass"], BeforeValidator(_spell_off)] = "off"
    """The source's own video: re-encode it, pass it through if it fits, or refuse what does not fit."""
    options: dict[str, str] = {}
    """Options for FFmpeg's opener, e.g. rtsp_transport: tcp."""
    ignore: list[Polygon] = []
    """Regions without detection, in pixels of the camera's own picture."""
    ground: list[list[float]] | None = None
    """3x3 homography from the camera's own picture (pixels) to the ground plane."""
    ground_unit: Annotated[str, AfterValidator(check_unit_spelling)] | None = None
    """The ground plane's unit; m, cm or mm also tell how tall people are in the picture."""
    detections: Path | None = None
    """A MOTChallenge detection file to use instead of a detector."""

    def first_pulse(self, fps: float) -> int:
        """Return the pulse of a recording's first frame at so many pulses per second."""
        return round(self.offset_s * fps)

    @field_validator("password")
    @classmethod
    def _password_has_its_place(cls, password: Path | None, info: ValidationInfo) -> Path | None:
        addresses = (info.data.get("source", ""), info.data.get("substream") or "")
        if password is not None and not any("{password}" in address for address in addresses):
            raise ValueError("names a file, but source has no place for it: rtsp://name:{password}@…")
        return password

    @field_validator("ground")
    @classmethod
    def _ground_is_invertible(
        cls, ground: list[list[float]] | None, info: ValidationInfo
    ) -> list[list[float]] | None:
        if ground is not None:
            validate_homography(ground, f"camera {info.data.get('id', '?')}")
        return ground


class TrackSettings(Section):
    """Tracking in one camera: the network LP over a moving window (paper, II)."""

    tracker: str = DEFAULT_TRACKER
    """MyView's own tracker, or a baseline."""
    joint: bool = True
    """Track people on the common ground of overlapping calibrated cameras in all of them at once; not where
    operators correct tracks, or a baseline tracks people: both know single cameras only."""
    solver: str = DEFAULT_SOLVER
    solver_share: PositiveFloat | None = 0.35
    """Work of a solve at most, as a share of the stride on an ordinary machine; None: no limit."""
    solver_time_s: PositiveFloat | None = None
    """Seconds by the clock after which a solver stops; answers then depend on the machine. None: never."""
    backlog_s: PositiveFloat = 2.0
    """Seconds of frames that may wait on a busy machine; older ones are skipped and reported."""
    shed_load: bool = True
    """On an overloaded machine, search only every 2nd frame, every 3rd and so on."""
    window: Annotated[WindowSettings, no_unknown_keys(WindowSettings)] = WindowSettings()
    costs: Annotated[CostSettings, no_unknown_keys(CostSettings)] = CostSettings()
    temporal: Annotated[TemporalSettings, no_unknown_keys(TemporalSettings)] = TemporalSettings()
    """The tracker `temporal`: person-to-blob matching over some seconds."""
    assist: Annotated[InteractiveSettings, no_unknown_keys(InteractiveSettings)] = InteractiveSettings()
    """Prediction of failures for an operator, and the weight of their corrections."""
    cross_view: Annotated[CrossViewSettings, no_unknown_keys(CrossViewSettings)] = CrossViewSettings()
    """How a camera uses the detections of others that see the same ground."""
    cross_view_wait_s: NonNegativeFloat = 0.3
    """Seconds after its capture that a frame waits for the other cameras' detections."""

    @property
    def is_joint(self) -> bool:
        """Whether people are tracked on the common ground of calibrated cameras that overlap."""
        return self.joint and self.tracker == DEFAULT_TRACKER and not self.assist.enabled

    def final_lag(self, fps: float) -> int:
        """Return the frames that follow a final frame at most when a window ends."""
        return (
            self.temporal.max_final_lag(fps)
            if self.tracker == TEMPORAL_TRACKER
            else self.window.resolve(fps).min_final_lag
        )

    def solver_budget(self, fps: float) -> SolverBudget:
        """Return the limits of a solve at so many frames per second."""
        stride_s = self.window.resolve(fps).stride / fps
        work_s = None if self.solver_share is None else self.solver_share * stride_s
        return SolverBudget(work_s, self.solver_time_s)

    def create_solver(self, fps: float, name: str | None = None) -> Solver:
        """Create the solver, or that of another name, with its budget at so many frames per second."""
        return create_solver(name or self.solver, self.solver_budget(fps))

    @field_validator("tracker")
    @classmethod
    def _tracker_is_known(cls, tracker: str) -> str:
        if tracker not in tracker_names():
            raise ValueError(f"there is no tracker {tracker!r}; there are {', '.join(tracker_names())}")
        if tracker in OFFLINE_TRACKERS:
            raise ValueError(f"{tracker} needs the whole recording: use `myview track --tracker {tracker}`")
        return tracker

    @field_validator("solver")
    @classmethod
    def _solver_is_known(cls, solver: str) -> str:
        create_solver(solver)
        return solver
