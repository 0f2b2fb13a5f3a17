"""Tracks whole recordings by the track graph as a Bayesian network (Nillius, Sullivan, Carlsson, CVPR 2006).

Kalman tracks with short gaps are the tracklets. At the end of the recording their interactions become a graph
(`interaction_graph.py`), and one inference decides all identities together (`identity_network.py`): an
appearance that shows only after the third encounter settles the first one, too. The box of a group is
published for its first person only. A recording longer than `recording_s` is decided in parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracking.appearance_histograms import add_appearance_histograms
from tracking.baselines.frame_by_frame import StepwiseSettings
from tracking.baselines.kalman_prediction import KalmanPrediction
from tracking.baselines.stepwise import StepwiseTracker
from tracking.baselines.track_graphs.identity_network import IdentityNetwork
from tracking.baselines.track_graphs.interaction_graph import Tracklet, build_graph
from tracking.baselines.track_graphs.relative_positions import SimilaritySettings, TrackDistance
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.model.object_state import mean_histogram, uniform_histogram
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, WindowTrack


@dataclass(frozen=True, slots=True)
class WholeRecordingSettings:
    """Tracklets, the network, and the longest recording.

    Raises:
        ValueError: a setting is out of range.
    """

    tracklet_gap_s: float = 0.3  # seconds without a detection after which a tracklet ends
    recording_s: float = 600.0  # seconds that are decided together at most
    horizon: int = 3  # variables between two compared tracks at most
    similarity: SimilaritySettings = field(default_factory=SimilaritySettings)

    def __post_init__(self) -> None:
        if self.tracklet_gap_s < 0.0 or self.recording_s <= 0.0 or self.horizon < 1:
            raise ValueError(
                "tracklet_gap_s must be at least 0, recording_s must be above 0, horizon at least 1"
            )


class WholeRecordingTracker:
    """Tracks a recording, and publishes all of it at its end, or after a long gap."""

    def __init__(
        self,
        window: WindowSettings,
        settings: WholeRecordingSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        self._settings, self._fps = settings or WholeRecordingSettings(), fps
        self._forget_after = window.resolve(fps).forget_after
        stepwise = StepwiseSettings(max_missed_s=self._settings.tracklet_gap_s)
        self._steps = StepwiseTracker(KalmanPrediction(), window, stepwise, fps)
        self._results: list[WindowResult] = []
        self._detections: dict[int, Detections] = {}
        self._last_id = 0

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Add a frame; return a result if a recording ended before it.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        ended = None
        if self._detections:
            first, last = next(iter(self._detections)), next(reversed(self._detections))
            if last < frame and (
                frame - last > self._forget_after or frame - first >= self._settings.recording_s * self._fps
            ):
                ended = self.flush()
        result = self._steps.push(frame, detections, image)
        self._detections[frame] = detections
        self._results += [result] if result else []
        return ended

    def flush(self) -> WindowResult | None:
        """End the recording: decide all identities; return them, or `None` without any new frame."""
        result = self._steps.flush()
        self._results += [result] if result else []
        if not self._detections:
            return None
        first, last = next(iter(self._detections)), next(reversed(self._detections))
        tracks = self._decided(first, last)
        report = SolveReport("track-network", 0.0, 0.0, integral=True, conflicts=0, rounds=0)
        self._results, self._detections = [], {}
        return WindowResult(first, last, last, tracks, report)

    def _decided(self, first: int, last: int) -> tuple[WindowTrack, ...]:
        """Return the tracks of all people in the frames `first`..`last`."""
        tracklets = tracklets_of(self._results, first)
        graph = build_graph(tracklets)
        network = IdentityNetwork(graph)
        distance = TrackDistance(graph, tracklets, self._settings.similarity, self._fps)
        _, states = network.solve(distance, self._settings.horizon)
        boxes: dict[int, Floats] = {}
        for node, persons in zip(graph.nodes, network.people_of(states), strict=True):
            own = boxes.setdefault(persons[0], np.full((last - first + 1, BOX_SIDES), np.nan))
            tracklet = tracklets[node.tracklet]
            begin = node.first - tracklet.first
            own[node.first : node.last + 1] = tracklet.boxes[begin : begin + node.last - node.first + 1]
        rows = [boxes[person] for person in sorted(boxes)]
        tracks, states_of = [], []
        frames = [self._detections.get(frame) for frame in range(first, last + 1)]
        bins = next(iter(self._detections.values())).histograms.shape[1]
        for row in rows:
            self._last_id += 1
            states_row = np.array(
                [_nearest(frame, box) for frame, box in zip(frames, row, strict=True)], dtype=np.int64
            )
            track = _window_track(self._last_id, row, states_row, frames, bins)
            tracks.append(track)
            states_of.append(states_row)
        known = [frame if frame is not None else Detections.empty(bins) for frame in frames]
        return add_appearance_histograms(tracks, states_of, first, known)


def tracklets_of(results: Sequence[WindowResult], origin: int) -> list[Tracklet]:
    """Return the tracklets of a frame-by-frame tracker's results; frames count from `origin`."""
    found: dict[int, Tracklet] = {}
    for result in results:
        for track in result.tracks:
            seen = np.flatnonzero(~np.isnan(track.boxes[:, 0]))
            if not len(seen):
                continue
            first, end = result.first - origin + int(seen[0]), result.first - origin + int(seen[-1])
            tracklet = found.setdefault(track.id, Tracklet(first, []))
            missing = first - tracklet.first - len(tracklet.boxes)
            tracklet.boxes += [np.full(BOX_SIDES, np.nan)] * missing
            tracklet.boxes += list(track.boxes[seen[0] : seen[-1] + 1])
            tracklet.histograms.append((end, track.histogram))
    return [found[number] for number in sorted(found)]


def _nearest(detections: Detections | None, box: Floats) -> int:
    """Return the detection nearest to a box, or `OCCLUDED` without a box."""
    if detections is None or np.isnan(box[0]) or not len(detections):
        return OCCLUDED
    return int(np.abs(detections.boxes - box).sum(axis=1).argmin())


def _window_track(
    number: int, boxes: Floats, states: NDArray[np.int64], frames: Sequence[Detections | None], bins: int
) -> WindowTrack:
    histograms, score = [], 0.0
    for frame, state in zip(frames, states.tolist(), strict=True):
        if frame is not None and state != OCCLUDED:
            histograms.append(frame.histograms[state])
            score += float(frame.scores[state])
    histogram = mean_histogram(np.stack(histograms)) if histograms else uniform_histogram(bins)
    return WindowTrack(number, boxes, boxes, histogram, score / len(boxes))
