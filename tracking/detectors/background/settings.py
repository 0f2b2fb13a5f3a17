"""Settings of the background-subtraction detector, and those of the paper's and of an overhead camera's."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar

from tracking.appearance import GRAY_LEVELS
from tracking.detectors.background.box_filter import BoxFilterSettings
from tracking.detectors.background.foreground_fit import ForegroundFitSettings
from tracking.detectors.background.height_model import HeightModelSettings
from tracking.detectors.background.median import MedianSettings
from tracking.detectors.background.mog2 import Mog2Settings
from tracking.detectors.background.segmentation import ShadowSettings
from tracking.detectors.background.static_foreground import StaticForegroundSettings
from tracking.detectors.base import require_at_least_one, require_positive
from tracking.detectors.color_histogram import AppearanceSettings
from tracking.frame_rate import frames_in


@dataclass(frozen=True, slots=True)
class BackgroundSettings:
    """The background-subtraction detector of paper IV.A.2.

    Raises:
        ValueError: a setting is out of range.
    """

    model: Literal["median", "mog2"] = "median"  # how the background is learned
    work_width: int = 360  # pixels; wider images are resized first
    gray_bins: int = 64  # bins of the gray histograms, 1 to 256
    prescan_s: float = 20.0  # seconds of a recording scanned before its first frame is searched; 0: none
    prescan_every_s: float = 0.8  # seconds between two of the frames that are used
    ignore: tuple[tuple[tuple[float, float], ...], ...] = ()  # polygons of (x, y) in pixels to ignore
    border_margin: float = 0.25  # share of the image height by which people may extend beyond the image
    appearance: AppearanceSettings = field(default_factory=AppearanceSettings)
    median: MedianSettings = field(default_factory=MedianSettings)
    shadows: ShadowSettings = field(default_factory=ShadowSettings)
    mog2: Mog2Settings = field(default_factory=Mog2Settings)
    static_foreground: StaticForegroundSettings = field(default_factory=StaticForegroundSettings)
    box_filter: BoxFilterSettings = field(default_factory=BoxFilterSettings)
    height_model: HeightModelSettings = field(default_factory=HeightModelSettings)
    foreground_fit: ForegroundFitSettings = field(default_factory=ForegroundFitSettings)

    def __post_init__(self) -> None:
        if self.prescan_s < 0.0:
            raise ValueError(f"prescan_s is at least 0, not {self.prescan_s:g}")
        require_positive(self, "prescan_every_s")
        require_at_least_one(self, "work_width")
        if not 1 <= self.gray_bins <= GRAY_LEVELS:
            raise ValueError(f"gray_bins must be 1 to {GRAY_LEVELS}, not {self.gray_bins}")

    def prescan_frames(self, fps: float) -> range:
        """Return the numbers of the frames of a recording from which the background is learned ahead."""
        return range(0, frames_in(self.prescan_s, fps, 0), frames_in(self.prescan_every_s, fps))


def paper_settings(settings: BackgroundSettings) -> BackgroundSettings:
    """Return the settings of the paper's detector (IV.A.2): all extensions off.

    This leaves independent full boxes over position and height, and gray histograms.
    """
    return replace(
        settings,
        appearance=replace(settings.appearance, color=False),
        shadows=replace(settings.shadows, enabled=False),
        box_filter=replace(settings.box_filter, body="box"),
        height_model=replace(settings.height_model, enabled=False),
        foreground_fit=replace(settings.foreground_fit, enabled=False),
    )


_SPAN = 0.5
"""Extent of a person seen from above, as a share of their height."""


S = TypeVar("S", bound=BackgroundSettings)


def overhead_settings(settings: S) -> S:
    """Return the settings for a camera that looks straight down: square boxes and no height model.

    The smallest box has half of the height of an upright person.
    """
    boxes = replace(
        settings.box_filter, body="box", aspect_ratio=1.0, min_height=_SPAN * settings.box_filter.min_height
    )
    return replace(settings, box_filter=boxes, height_model=replace(settings.height_model, enabled=False))


PAPER_DETECTOR = paper_settings(BackgroundSettings())
"""The paper's box filters, like `PAPER_COSTS` its costs."""
