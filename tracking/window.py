"""Settings and results of the online tracker's window (paper II.E)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats
from tracking.frame_rate import frames_in
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections, RiskEvent

SHORTEST_WINDOW = 3
"""Frames: a shorter window tracks nobody, since the path of a new object has no cost to be tested."""

_MIN_INTERPOLATED = 2
"""Missed frames that are interpolated at any frame rate."""


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """Settings of the moving window, of initiation and of termination.

    Raises:
        ValueError: a setting is out of range.
    """

    length_s: float = 0.6  # M: seconds of a window; a frame is final length_s - stride_s later
    stride_s: float = 0.2  # s: seconds between two windows
    min_frames: int = 6  # frames of a window at least, 3 or more: at low frame rates it is longer
    birth_s: float = 0.6  # seconds over which a new object is tested; at most the window
    birth_min_visible: float = 0.5  # share of these frames in which a new object must be detected
    birth_max_cost: float = 0.7  # largest mean cost per frame of its path: appearance, motion, confidence
    birth_min_score: float = 0.3  # least score of the detections of a new object
    birth_min_peak_score: float = 0.65  # least score of the best of them
    birth_max_tests: int = 8  # most tests per window, best detections first
    birth_max_iou: float = 0.35  # overlap (IoU) with a track above which a detection starts no new one
    duplicate_overlap: float = 0.8  # mean overlap of two tracks above which they are duplicates
    forget_after_s: float = 60.0  # F: seconds occluded after which an object is dropped, its id retired
    max_objects: int = 100  # most objects kept; the longest occluded one is dropped first
    template_memory_s: float = (
        0.8  # seconds of detections over which an object's template is averaged; inf: all
    )
    gate_heights: float = 0.2  # box heights by which an object may move at once
    gate_speed: float = 7.5  # box heights per second since its last detection, added to that
    max_height_ratio: float = 1.5  # factor by which its height may change meanwhile
    max_interpolated_gap_s: float = 0.8  # longest occlusion, in seconds, that is interpolated
    reidentify_after_s: float = 4.0  # seconds of occlusion after which it only returns by re-identification
    reidentify_max_distance: float = 0.35  # largest appearance distance for that, 0 to 1

    def __post_init__(self) -> None:
        if not 0.0 < self.stride_s <= self.length_s:
            raise ValueError(
                f"stride_s must be above 0, and at most length_s, {self.length_s:g}, not {self.stride_s:g}"
            )
        if not 0.0 < self.birth_s <= self.length_s:
            raise ValueError(
                f"birth_s must be above 0, and at most length_s, {self.length_s:g}, not {self.birth_s:g}"
            )
        if not 0.0 < self.birth_min_visible <= 1.0:
            raise ValueError(f"birth_min_visible is a share between 0 and 1, not {self.birth_min_visible}")
        if not min(self.forget_after_s, self.template_memory_s) > 0.0 or self.max_objects < 1:
            raise ValueError(
                "forget_after_s and template_memory_s must be above 0, and max_objects at least 1"
            )
        if self.min_frames < SHORTEST_WINDOW:
            raise ValueError(
                f"min_frames must be at least {SHORTEST_WINDOW}, not {self.min_frames}:"
                " in a shorter window no track is confirmed"
            )

    def resolve(self, fps: float) -> ResolvedWindowSettings:
        """Return the settings with all times in frames, for so many frames per second."""
        window = frames_in(self.length_s, fps, self.min_frames)
        return ResolvedWindowSettings(
            **{field.name: getattr(self, field.name) for field in fields(WindowSettings)},
            fps=fps,
            window=window,
            stride=min(frames_in(self.stride_s, fps), window),
            birth_window=min(frames_in(self.birth_s, fps, self.min_frames), window),
            forget_after=frames_in(self.forget_after_s, fps, window),
            template_update_rate=min(1.0 / (self.template_memory_s * fps), 1.0),
            max_interpolated_gap=frames_in(
                self.max_interpolated_gap_s, fps, _MIN_INTERPOLATED if self.max_interpolated_gap_s else 0
            ),
            reidentify_after=frames_in(self.reidentify_after_s, fps, window),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedWindowSettings(WindowSettings):
    """Settings for one frame rate: each time is also given as a number of frames.

    `template_update_rate` is the weight of a new histogram in a template. Windows end at the frames n where
    `stride` divides n + 1.
    """

    fps: float
    window: int
    stride: int
    birth_window: int
    forget_after: int
    template_update_rate: float
    max_interpolated_gap: int
    reidentify_after: int

    @property
    def min_final_lag(self) -> int:
        """Least number of frames that follow a frame before it is final."""
        return self.window - self.stride


@dataclass(frozen=True, slots=True, eq=False)
class AppearanceHistogram:
    """Mean histogram of an object over consecutive frames without occlusion.

    Attributes:
        first: the first of these frames.
        last: the last one.
        histogram: `(B,)`, the mean of their histograms.
    """

    first: int
    last: int
    histogram: Floats


@dataclass(frozen=True, slots=True, eq=False)
class WindowTrack:
    """One object in one window.

    Attributes:
        id: the object's id: from 1 in each tracker, never reused.
        boxes: `(F, 4)` pixels, one row per frame of the window, NaN where the object is occluded.
        interpolated: `(F, 4)` the same, with gaps of up to `max_interpolated_gap` frames interpolated.
        histogram: `(B,)`, its template.
        confidence: mean score of its boxes over the window, 0 where occluded; in [0, 1].
        appearance_histograms: mean histograms over unoccluded frames up to `final_to`, in order.
    """

    id: int
    boxes: Floats
    interpolated: Floats
    histogram: Floats
    confidence: float
    appearance_histograms: tuple[AppearanceHistogram, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class WindowResult:
    """The tracks of the frames `first`..`last`.

    Attributes:
        first: the first frame that was not final before.
        last: the newest frame.
        final_to: every frame up to this one is final and does not change any more; the others are
            provisional. An object without a final frame may still be dropped.
        tracks: the objects detected in any of the frames, by ascending id.
        report: the solver's report on the last window.
        risk_events: predicted identity failures, the riskiest first; of trackers that help an operator.
        revised_from: the first final frame changed by an operator's correction: all frames from `first` on
            replace earlier results. None: no final frame has changed.
    """

    first: int
    last: int
    final_to: int
    tracks: tuple[WindowTrack, ...]
    report: SolveReport
    risk_events: tuple[RiskEvent, ...] = ()
    revised_from: int | None = None


def merge_results(results: list[WindowResult]) -> WindowResult | None:
    """Merge the results of successive windows into one; `None` for no window.

    Later windows overwrite provisional frames of earlier ones.
    """
    if len(results) <= 1:
        return results[0] if results else None
    first, newest = results[0].first, results[-1]
    tracks: dict[int, WindowTrack] = {}
    for result in results:
        kept = result.last if result is newest else result.final_to
        window = slice(result.first - first, kept - first + 1)
        for track in result.tracks:
            absent = np.full((newest.last - first + 1, BOX_SIDES), np.nan)
            known = tracks.get(track.id)
            boxes, interpolated = (known.boxes, known.interpolated) if known else (absent, absent.copy())
            boxes[window] = track.boxes[: kept - result.first + 1]
            interpolated[window] = track.interpolated[: kept - result.first + 1]
            histograms = (
                (*known.appearance_histograms, *track.appearance_histograms)
                if known
                else track.appearance_histograms
            )
            tracks[track.id] = replace(
                track, boxes=boxes, interpolated=interpolated, appearance_histograms=histograms
            )
    visible = [tracks[id_] for id_ in sorted(tracks) if not np.isnan(tracks[id_].boxes).all()]
    return replace(newest, first=first, tracks=tuple(visible))


def select_boxes(states: npt.NDArray[np.int64], frames: Sequence[Detections]) -> Floats:
    """Return the boxes of states `(F,)`, `(F, 4)` pixels, NaN where the object is occluded."""
    boxes = np.full((len(frames), BOX_SIDES), np.nan)
    for m, state in enumerate(states):
        if state != OCCLUDED:
            boxes[m] = frames[m].boxes[state]
    return boxes


def mean_confidence(states: npt.NDArray[np.int64], frames: Sequence[Detections]) -> float:
    """Return the mean score of the boxes of states `(F,)`, 0 where the object is occluded; in [0, 1]."""
    scores = [float(frames[m].scores[state]) for m, state in enumerate(states) if state != OCCLUDED]
    return sum(scores) / len(frames)
