"""The temporal consistency tracker of one camera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.appearance_histograms import add_appearance_histograms
from tracking.baselines.temporal_consistency.blobs import BlobDetector
from tracking.baselines.temporal_consistency.initiation import PersonLifecycle, initial_people
from tracking.baselines.temporal_consistency.settings import TemporalSettings
from tracking.baselines.temporal_consistency.trajectories import BlobBoxHistory, SampledBoxes
from tracking.baselines.temporal_consistency.window import Stage, StageDecision, TemporalWindow
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.model.object_state import mean_histogram, uniform_histogram
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, WindowTrack


class TemporalBlobTracker:
    """Person-to-blob matching over a window of samples. A decided sample is final.

    It tracks in the images only; detections only provide appearance histograms.
    """

    def __init__(
        self, window: WindowSettings, settings: TemporalSettings | None = None, fps: float = DEFAULT_FPS
    ) -> None:
        """Set up for results every `stride` frames of a recording at `fps` frames per second."""
        self._window, self._settings, self._fps = window.resolve(fps), settings or TemporalSettings(), fps
        self._every = self._settings.stage_frames(fps)
        self._blobs: BlobDetector | None = None
        self._scale = 1.0
        """Pixels of the image per pixel of the working image."""
        self._bootstrap_images: list[Image] = []
        self._bootstrap_frames = 0
        """Frames received while the background is learned."""
        self._last_id = 0
        self._detections: dict[int, Detections] = {}
        self._bins = 0
        self._first: int | None = None
        """The first frame that is not final yet."""
        self._last: int | None = None
        self._people: TemporalWindow | None = None
        self._lifecycle: PersonLifecycle | None = None
        self._blob_history = BlobBoxHistory()
        self._samples: SampledBoxes = {}
        self._final: int | None = None
        """The last decided frame."""
        self._next_stage = 0

    def prepare(self, images: Iterable[Image]) -> None:
        """Learn the background from images of a recording before its first frame; without any, live."""
        work_images = [self._blobs_of(image).resize(image) for image in images]
        if work_images and self._blobs is not None:
            self._blobs.prepare(work_images)

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Add a frame; return a result if one or more windows end.

        A frame without an image has no data; the sample is taken from the next one. After a gap longer than
        `forget_after` of the window all people are dropped, and the frames of the gap are in no result.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        last = self._last
        if last is not None and frame <= last:
            raise ValueError(f"frame {frame} came after frame {last}")
        ended = None
        if last is not None and frame - last > self._window.forget_after:
            ended = self.flush()
            self._forget()
            self._first, last = None, None
        if self._first is None:
            self._first = frame
        self._last = frame
        self._detections[frame], self._bins = detections, detections.histograms.shape[1]
        if image is not None:
            self._observe(frame, image)
        self._decide_overdue(frame)
        stride, before = self._window.stride, self._first - 1 if last is None else last
        if ended is not None:
            return ended
        return self._result() if (frame + 1) // stride > (before + 1) // stride else None

    def flush(self) -> WindowResult | None:
        """End the recording: all frames become final. Return `None` if they were final already."""
        if self._first is None or self._last is None or self._last < self._first:
            return None
        while (done := None if self._people is None else self._people.commit()) is not None:
            self._apply_decision(done)
        self._final = self._last
        return self._result()

    def _forget(self) -> None:
        """Drop all people, but keep the background."""
        self._people, self._lifecycle = None, None
        self._blob_history, self._samples = BlobBoxHistory(), {}
        self._final, self._next_stage = None, 0

    def _observe(self, frame: int, image: Image) -> None:
        """Segment an image into blobs, and decide the stages that are due."""
        blobs = self._blobs_of(image)
        work_image = blobs.resize(image)
        if not blobs.ready:
            self._bootstrap(blobs, work_image)
            return
        is_due = frame >= self._next_stage
        found = blobs.detect(work_image, learn=is_due)
        boxes = np.array([blob.box for blob in found]).reshape(-1, 4) * self._scale
        self._blob_history.add(frame, boxes)
        if not is_due or (self._settings.closed_world and not found):
            return  # everyone must be in a blob: the sample is taken later
        self._next_stage = (frame // self._every + 1) * self._every
        self._sample(Stage(frame, found), blobs)

    def _decide_overdue(self, frame: int) -> None:
        """Decide overdue stages if images have been missing for long."""
        oldest = frame - self._settings.max_final_lag(self._fps)
        while self._people is not None and self._final is not None and self._final < oldest:
            done = self._people.commit()
            if done is None:
                self._final = oldest
            else:
                self._apply_decision(done)

    def _bootstrap(self, blobs: BlobDetector, work_image: Image) -> None:
        samples = self._settings.blobs.samples
        needed = frames_in(self._settings.blobs.bootstrap_s, self._fps, samples)
        if (self._bootstrap_frames + 1) * samples // needed > self._bootstrap_frames * samples // needed:
            self._bootstrap_images.append(work_image)
        self._bootstrap_frames += 1
        if self._bootstrap_frames >= needed:
            blobs.prepare(self._bootstrap_images)
            self._bootstrap_images = []

    def _sample(self, stage: Stage, blobs: BlobDetector) -> None:
        if self._people is None or self._lifecycle is None:
            first = initial_people(stage, self._settings, blobs.pixels_per_meter)
            if self._settings.closed_world and not first:
                return  # people are only counted once
            self._people = TemporalWindow(self._settings, blobs.size, blobs.pixels_per_meter, 1.0 / self._fps)
            self._lifecycle = PersonLifecycle(self._settings, blobs.pixels_per_meter)
            self._people.begin(stage, [(self._last_id + number, at) for number, at in first])
            self._last_id += len(first)
            self._apply_decision(
                StageDecision(stage, {person.id: person.blob for person in self._people.people})
            )
        elif (done := self._people.push(stage)) is not None:
            self._apply_decision(done)

    def _apply_decision(self, done: StageDecision) -> None:
        """Store a decision, and update who has entered and left."""
        for number, at in done.blob_by_id.items():
            self._samples.setdefault(number, []).append((done.stage.frame, self._box(done.stage, at)))
        self._final = max(done.stage.frame, -1 if self._final is None else self._final)
        if self._settings.closed_world or self._people is None or self._lifecycle is None:
            return
        self._people.remove(self._lifecycle.find_departed(done, self._settings.stage_s))
        for at in self._lifecycle.find_new(self._people, done):
            self._last_id += 1
            self._people.add(self._last_id, at)
            self._samples[self._last_id] = [(done.stage.frame, self._box(done.stage, at))]

    def _box(self, stage: Stage, at: int) -> Floats | None:
        """Return a blob's box in pixels of the camera's image; `None` for absence."""
        return None if at == stage.absent else stage.blobs[at].box * self._scale

    def _result(self) -> WindowResult:
        """Return the result for all frames that were not published as final."""
        assert self._first is not None  # noqa: S101 — there was a frame
        assert self._last is not None  # noqa: S101
        first, last = self._first, self._last
        frames = range(first, last + 1)
        # Without any decision, all frames are final: later ones cannot change them.
        final = last if self._final is None else max(min(self._final, last), first - 1)
        detections = [self._detections.get(frame, Detections.empty(self._bins)) for frame in frames]
        tracks = build_window_tracks(self._all_samples(), self._blob_history, detections, first, final)
        result = WindowResult(first, last, final, tracks, self._report())
        self._drop_final(final)
        return result

    def _all_samples(self) -> SampledBoxes:
        """Return everyone's boxes at samples: the decided ones, then the current best path."""
        if self._people is None or self._people.path is None:
            return self._samples
        samples = {number: list(boxes) for number, boxes in self._samples.items()}
        for stage, chosen in zip(self._people.pending, self._people.path.blobs.tolist(), strict=True):
            for person, at in zip(self._people.people, chosen, strict=True):
                samples.setdefault(person.id, []).append((stage.frame, self._box(stage, at)))
        return samples

    def _drop_final(self, final: int) -> None:
        """Drop final frames, except each person's last sample."""
        self._first = final + 1
        self._detections = {
            frame: detections for frame, detections in self._detections.items() if frame > final
        }
        self._blob_history.drop_through(final)
        present = set() if self._people is None else {person.id for person in self._people.people}
        self._samples = {number: boxes[-1:] for number, boxes in self._samples.items() if number in present}

    def _report(self) -> SolveReport:
        path = None if self._people is None else self._people.path
        cost, exact = (path.cost, path.exact) if path is not None else (0.0, True)
        bound = cost if exact else 0.0
        return SolveReport("temporal", cost, bound, integral=exact, conflicts=0, rounds=0)

    def _blobs_of(self, image: Image) -> BlobDetector:
        if self._blobs is None:
            size = (int(image.shape[1]), int(image.shape[0]))
            self._blobs = BlobDetector(
                size, self._settings.room_m, self._settings.blobs, self._settings.stage_s
            )
            self._scale = size[0] / self._blobs.size[0]
        return self._blobs


_MIN_IOU = 0.3
"""Least overlap (IoU) of a blob and its matched detection."""


def build_window_tracks(
    samples: SampledBoxes,
    history: BlobBoxHistory,
    detections: Sequence[Detections],
    first: int,
    final: int,
) -> tuple[WindowTrack, ...]:
    """Return the tracks of the frames from `first` on, by ascending id.

    `detections` are those of each of these frames; `final` is the last frame that cannot change any more.
    """
    tracks, states = [], []
    for number, boxes_at_samples in sorted(samples.items()):
        boxes = history.trajectory(boxes_at_samples, first, first + len(detections) - 1)
        if np.isnan(boxes).all():
            continue
        matched = _matched_detections(boxes, detections)
        histograms = [
            found.histograms[index]
            for found, index in zip(detections, matched, strict=True)
            if index != OCCLUDED
        ]
        bins = detections[0].histograms.shape[1]
        histogram = mean_histogram(np.stack(histograms)) if histograms else uniform_histogram(bins)
        score = float(np.mean(~np.isnan(boxes[:, 0])))
        tracks.append(WindowTrack(number, boxes, boxes, histogram, score))
        states.append(matched)
    return add_appearance_histograms(tracks, states, first, detections[: final - first + 1])


def _matched_detections(boxes: Floats, detections: Sequence[Detections]) -> NDArray[np.int64]:
    """Return the detection that matches a track in each frame, `(F,)`, -1 for none."""
    states = np.full(len(detections), OCCLUDED, dtype=np.int64)
    for row, found in enumerate(detections):
        if len(found) and not np.isnan(boxes[row, 0]):
            overlaps = iou(boxes[row][None], found.boxes)
            best = int(overlaps.argmax())
            states[row] = best if overlaps[best] >= _MIN_IOU else OCCLUDED
    return states
