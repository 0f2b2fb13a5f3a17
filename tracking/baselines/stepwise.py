"""Frame-by-frame trackers: one assignment per frame, decisions are final.

All of them start, match and end tracks in the same way, so that a comparison measures the prediction
method. A detection that overlaps no track starts a new one, which is confirmed in its third consecutive
frame. In each frame tracks and detections are matched by one assignment over their overlaps (IoU). A track
without a match for `max_missed_frames` frames ends, and its id with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from tracking.appearance_samples import add_appearance_samples
from tracking.assignment import assign_pairs
from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.detectors.base import Image
from tracking.model.object_state import mean_histogram
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, WindowTrack

S = TypeVar("S")
"""What a method remembers of one object."""


class PredictionMethod(Protocol, Generic[S]):
    """How a tracker predicts targets from image to image. Deterministic: no clock, its own seed."""

    name: str
    uses_image: bool
    """It looks at the picture: where it says that somebody is counts without a detection there, too."""

    def initialize(self, image: Image, box: Floats) -> S:
        """Create a target from a box `(4,)`. A method that does not use images gets an empty one."""
        ...

    def predict(self, image: Image | None, objects: Sequence[S]) -> Floats:
        """Predict the boxes in the next image: `(N, 4)`, NaN for targets that are lost."""
        ...

    def update(self, known: S, box: Floats) -> Floats:
        """Update a target with its matched detection `(4,)`; return its new box `(4,)`."""
        ...


_NO_PICTURE: Image = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class StepwiseSettings:
    """When tracks start, match and end.

    Raises:
        ValueError: a setting is out of range.
    """

    min_birth_score: float = 0.5  # least score of a detection that somebody new begins with
    max_birth_iou: float = (
        0.3  # overlap (IoU) with a known object above which a detection is not somebody new
    )
    min_match_iou: float = 0.3  # least overlap (IoU) of an object and the detection it is matched with
    confirm_frames: int = 3  # frames in a row in which somebody new must be matched
    max_missed_frames: int = 25  # frames without a match after which an object is gone
    max_unmatched_frames: int = (
        5  # frames without a match in which a method that looks at the picture is believed
    )

    def __post_init__(self) -> None:
        shares = (self.min_birth_score, self.max_birth_iou, self.min_match_iou)
        if not all(0.0 <= share <= 1.0 for share in shares):
            raise ValueError(
                f"min_birth_score, max_birth_iou and min_match_iou are shares between 0 and 1, not {shares}"
            )
        if self.confirm_frames < 1 or self.max_missed_frames < 1 or self.max_unmatched_frames < 0:
            raise ValueError(
                "confirm_frames and max_missed_frames must be at least 1, max_unmatched_frames at least 0"
            )


@dataclass(slots=True)
class StepwiseTrack(Generic[S]):
    """One track of a frame-by-frame tracker."""

    id: int
    """Published id; 0 while the track is not published."""
    target: S
    box: Floats
    serial: int
    """Unique number, also while unpublished."""
    matches: int = 1
    missed_frames: int = 0
    """Frames since the last match."""
    observations: dict[int, tuple[Floats, int]] = field(default_factory=dict)
    """By frame of the window: the box, and which detection it is, -1 for none."""


class StepwiseTracker(Generic[S]):
    """Frame-by-frame tracker around a prediction method. Its results are final at once."""

    def __init__(
        self, method: PredictionMethod[S], window: WindowSettings, settings: StepwiseSettings | None = None
    ) -> None:
        self._method, self._window = method, window
        self._settings = settings or StepwiseSettings()
        self._objects: list[StepwiseTrack[S]] = []
        self._ended: list[StepwiseTrack[S]] = []
        """Tracks that ended since the last result."""
        self._numbers = self._serials = 0
        self._detections: dict[int, Detections] = {}
        self._first: int | None = None
        self._last: int | None = None

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Take a frame; return a result where one or more windows end.

        A frame number that is left out is a frame of which nothing is known. After a gap longer than
        `forget_after` of the window everybody is forgotten, and the frames of the gap are in no result.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        if self._last is not None and frame <= self._last:
            raise ValueError(f"frame {frame} came after frame {self._last}")
        if self._last is not None and frame - self._last > self._window.forget_after:
            return self._restart(frame, detections, image)
        if self._last is not None:
            self._skip_frames(frame - self._last - 1)
        if self._first is None:
            self._first = frame
        self._detections[frame] = detections
        self._step(frame, detections, image)
        stride, before = self._window.stride, self._first - 1 if self._last is None else self._last
        self._last = frame
        return self._result(frame) if (frame + 1) // stride > (before + 1) // stride else None

    def flush(self) -> WindowResult | None:
        """Finish the recording; `None` where everything was published already."""
        if self._first is None or self._last is None or self._last < self._first:
            return None
        return self._result(self._last)

    def _restart(self, frame: int, detections: Detections, image: Image | None) -> WindowResult | None:
        """Start again after a long gap, so that no result has to span it."""
        result = self.flush()
        self._objects, self._detections = [], {frame: detections}
        self._first = self._last = frame
        self._step(frame, detections, image)
        return result

    def _skip_frames(self, frames: int) -> None:
        """Count frames without data as missed."""
        for item in self._objects:
            item.missed_frames += frames
        self._end_lost_tracks()

    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        moved = self._method.predict(image, [item.target for item in self._objects])
        for item, box in zip(self._objects, moved, strict=True):
            item.box = box if not np.isnan(box).any() else item.box
        taken = self._match(frame, detections)
        for item in self._objects:
            if frame not in item.observations:
                item.missed_frames += 1
                if item.matches < self._settings.confirm_frames:
                    item.missed_frames = self._settings.max_missed_frames  # nobody yet, and not there
                elif self._method.uses_image and item.missed_frames <= self._settings.max_unmatched_frames:
                    item.observations[frame] = (item.box, OCCLUDED)
        self._end_lost_tracks()
        self._start_tracks(frame, detections, taken, image)

    def _match(self, frame: int, detections: Detections) -> NDArray[np.bool_]:
        """Match tracks with detections; return which detections are taken, `(K,)`."""
        taken = np.zeros(len(detections), dtype=np.bool_)
        if not self._objects or not len(detections):
            return taken
        places = np.stack([item.box for item in self._objects])
        overlaps = iou(places[:, None], detections.boxes[None])
        for row, column in zip(*assign_pairs(overlaps, max(self._settings.min_match_iou, 1e-9)), strict=True):
            item = self._objects[row]
            item.box = self._method.update(item.target, detections.boxes[column])
            item.matches, item.missed_frames = item.matches + 1, 0
            item.observations[frame] = (item.box, int(column))
            taken[column] = True
        return taken

    def _start_tracks(
        self, frame: int, detections: Detections, taken: NDArray[np.bool_], image: Image | None
    ) -> None:
        """Start tracks from unmatched detections, in descending order of score."""
        if image is None:
            if self._method.uses_image:
                return  # there is nothing to know them by
            image = _NO_PICTURE
        order = np.argsort(-detections.scores, kind="stable")
        for place in (int(it) for it in order if not taken[it]):
            box = detections.boxes[place]
            if detections.scores[place] < self._settings.min_birth_score:
                break
            near = [item.box for item in self._objects]
            if near and float(iou(box[None], np.stack(near)).max()) > self._settings.max_birth_iou:
                continue
            self._serials += 1
            item = StepwiseTrack(0, self._method.initialize(image, box), box, self._serials)
            item.observations[frame] = (box, place)
            self._objects.append(item)

    def _end_lost_tracks(self) -> None:
        gone = [item for item in self._objects if item.missed_frames >= self._settings.max_missed_frames]
        self._ended += [item for item in gone if item.matches >= self._settings.confirm_frames]
        self._objects = [
            item for item in self._objects if item.missed_frames < self._settings.max_missed_frames
        ]

    def _result(self, last: int) -> WindowResult:
        """Return the result for all frames not yet published."""
        first = last if self._first is None else self._first
        frames = range(first, last + 1)
        confirmed = [item for item in self._all_tracks() if self._is_confirmed(item)]
        for item in confirmed:
            if not item.id:
                self._numbers += 1
                item.id = self._numbers
        confirmed = sorted((item for item in confirmed if item.observations), key=lambda item: item.id)
        seen = [self._detections.get(frame, Detections.empty(self._bins())) for frame in frames]
        tracks = [self._track(item, frames, seen) for item in confirmed]
        states = [
            np.array(
                [item.observations[it][1] if it in item.observations else OCCLUDED for it in frames],
                dtype=np.int64,
            )
            for item in confirmed
        ]
        report = SolveReport(self._method.name, 0.0, 0.0, integral=False, conflicts=0, rounds=0)
        result = WindowResult(first, last, last, add_appearance_samples(tracks, states, first, seen), report)
        for item in self._all_tracks():
            # Unconfirmed tracks are not published; once confirmed, they are from the next window on.
            item.observations = {}
        self._ended, self._detections, self._first = [], {}, last + 1
        return result

    def _all_tracks(self) -> Iterable[StepwiseTrack[S]]:
        """Return all tracks that may have something to publish."""
        return (*self._ended, *self._objects)

    def _is_confirmed(self, item: StepwiseTrack[S]) -> bool:
        """Return whether a track is confirmed."""
        return item.matches >= self._settings.confirm_frames

    def _bins(self) -> int:
        return next((seen.histograms.shape[1] for seen in self._detections.values()), 0)

    def _track(self, item: StepwiseTrack[S], frames: range, seen: list[Detections]) -> WindowTrack:
        boxes = np.full((len(frames), BOX_SIDES), np.nan)
        looks, scores = [], 0.0
        for row, frame in enumerate(frames):
            if frame in item.observations:
                boxes[row], place = item.observations[frame]
                if place != OCCLUDED:
                    looks.append(seen[row].histograms[place])
                    scores += float(seen[row].scores[place])
        histogram = mean_histogram(np.stack(looks)) if looks else np.empty(self._bins())
        return WindowTrack(item.id, boxes, boxes, histogram, scores / len(frames))
