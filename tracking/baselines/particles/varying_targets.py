"""One filter for a varying number of targets by reversible jumps (Khan, Balch, Dellaert, PAMI 2005).

A sample says who is present and where. Targets enter at detections and may leave at any time: their presence
is a two-state Markov chain, and the posterior of each image (`reversible_jumps.py`) decides it together with
all positions. A state's odds are those of the presence, times `exp(λ (d0² - d²))` for the color distance d
to the target's reference, times the evidence of the detection that overlaps it most, or of its absence. A
detection competes with the known targets for its place through the penalty of overlaps.

The presence that the samples agree on is a target's probability of being there. It is published from .5 on.
Confirmation and the numbers of frames without a detection are those of all frame-by-frame trackers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracking.assignment import assign_pairs
from tracking.baselines.frame_by_frame import FrameByFrameTracker, StepwiseSettings, StepwiseTrack
from tracking.baselines.integral_histograms import (
    ColorIntegralCache,
    ColorIntegralImage,
    color_distance,
    upper_and_lower_halves,
)
from tracking.baselines.particles.particle_filter import initial_state, particle_boxes, propagate
from tracking.baselines.particles.reversible_jumps import (
    ABSENT,
    CandidatePools,
    ChainLength,
    sample_targets,
)
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import WindowSettings

_PRESENT = 0.5
"""Probability of presence from which a target is published."""
_ENTRY_NOISE = 0.03
"""Standard deviation of an entering target's position around its detection, in heights."""


@dataclass(frozen=True, slots=True)
class JumpSettings:
    """The model of presence and evidence, and the chain.

    Raises:
        ValueError: a setting is out of range.
    """

    states: int = 40  # states in a candidate's pool
    chain: ChainLength = field(default_factory=ChainLength)
    mean_presence_s: float = 20.0  # seconds for which a target is present on average
    mean_absence_s: float = 1.0  # seconds for which a known target is absent on average
    entry_probability: float = 0.1  # that an unexplained detection is a new target, before its evidence
    sharpness: float = 20.0  # λ of the color distance
    neutral_distance: float = 0.3  # d0²: squared color distance that speaks neither for nor against presence
    detection_log_odds: float = 4.0  # evidence of a detection that covers the box exactly
    miss_log_odds: float = 1.0  # evidence against presence where no detection overlaps the box
    overlap_weight: float = 8.0  # penalty of a pair of equal boxes
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if self.states < 1:
            raise ValueError(f"states must be at least 1, not {self.states}")
        if min(self.mean_presence_s, self.mean_absence_s, self.sharpness) <= 0.0:
            raise ValueError("mean_presence_s, mean_absence_s and sharpness must be above 0")
        if not 0.0 < self.entry_probability < 1.0:
            raise ValueError("entry_probability must be between 0 and 1")


@dataclass(slots=True)
class JumpTarget:
    """State of one target.

    Attributes:
        colors: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`, its samples: center, height and velocity, in pixels.
        presence: probability that it is present.
    """

    colors: Floats
    aspect: float
    states: Floats
    presence: float


class VaryingTargetsTracker(FrameByFrameTracker[JumpTarget]):
    """Tracks a varying number of targets by one Markov chain over their joint state."""

    def __init__(
        self,
        window: WindowSettings,
        settings: StepwiseSettings | None = None,
        jumps: JumpSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        super().__init__("rjmcmc", window, settings, fps)
        self._jumps = jumps or JumpSettings()
        self._fps = fps
        self._rng = np.random.default_rng(self._jumps.seed)
        self._colors = ColorIntegralCache()

    @property
    def expected_targets(self) -> float:
        """The expected number of targets present in the last image."""
        return sum(item.target.presence for item in self._objects)

    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        if image is None:
            return
        integral = self._colors.get(image)
        sure = np.flatnonzero(detections.scores >= self._settings.min_birth_score)
        known = [self._predicted(item.target, integral, detections) for item in self._objects]
        entering = [self._entering(detections.boxes[row], detections) for row in sure.tolist()]
        states = [*(states for states, _, _ in known), *(states for states, _, _ in entering)]
        if states:
            pools = CandidatePools(
                np.stack([boxes for _, boxes, _ in (*known, *entering)]),
                np.stack([odds for _, _, odds in (*known, *entering)]),
                np.arange(len(states)) >= len(known),
            )
            samples = sample_targets(self._rng, pools, self._jumps.overlap_weight, self._jumps.chain)
            self._take_samples(frame, detections, np.stack(states), samples[:, : len(known)])
            self._enter(frame, detections, integral, sure, np.stack(states), samples, len(known))
        self._end_lost_tracks()

    def _predicted(
        self, target: JumpTarget, integral: ColorIntegralImage, detections: Detections
    ) -> tuple[Floats, Floats, Floats]:
        """Return a known target's pool: states `(M, 5)`, boxes `(M, 4)`, log odds `(M,)`."""
        settings = self._jumps
        states = propagate(
            self._rng, target.states[self._rng.integers(len(target.states), size=settings.states)]
        )
        boxes = particle_boxes(states, target.aspect)
        prior = next_presence(
            target.presence, settings.mean_presence_s * self._fps, settings.mean_absence_s * self._fps
        )
        distances = color_distance(integral, boxes, target.colors)
        return states, boxes, presence_log_odds(prior, boxes, detections, settings, distances)

    def _entering(self, box: Floats, detections: Detections) -> tuple[Floats, Floats, Floats]:
        """Return the pool of a target that may enter at a detection."""
        settings, (start, aspect) = self._jumps, initial_state(box)
        states = np.tile(start, (settings.states, 1))
        states[:, :3] += _ENTRY_NOISE * start[2] * self._rng.standard_normal((settings.states, 3))
        boxes = particle_boxes(states, aspect)
        return states, boxes, presence_log_odds(settings.entry_probability, boxes, detections, settings)

    def _take_samples(
        self, frame: int, detections: Detections, states: Floats, samples: NDArray[np.int64]
    ) -> None:
        """Update the known targets: `samples` is `(S, K)`, `states` `(K or more, M, 5)`."""
        for n, item in enumerate(self._objects):
            chosen = samples[samples[:, n] != ABSENT, n]
            item.target.presence = len(chosen) / len(samples)
            # A target that is absent in all samples goes on as predicted.
            item.target.states = states[n, chosen] if len(chosen) else states[n]
            item.box = particle_boxes(item.target.states.mean(axis=0), item.target.aspect)
        present = [item for item in self._objects if item.target.presence >= _PRESENT]
        indices = _assigned([item.box for item in present], detections, self._settings.min_match_iou)
        for item, index in zip(present, indices, strict=True):
            if index != OCCLUDED:
                item.matches, item.missed_frames = item.matches + 1, 0
                item.observations[frame] = (item.box, index)
        for item in self._objects:
            if frame in item.observations:
                continue
            item.missed_frames += 1
            if item.matches < self._settings.confirm_frames:
                item.missed_frames = self._max_missed
            elif item.target.presence >= _PRESENT and item.missed_frames <= self._max_unmatched:
                item.observations[frame] = (item.box, OCCLUDED)

    def _enter(
        self,
        frame: int,
        detections: Detections,
        integral: ColorIntegralImage,
        sure: NDArray[np.intp],
        states: Floats,
        samples: NDArray[np.int64],
        known: int,
    ) -> None:
        """Start the targets that entered in most samples."""
        for number, index in enumerate(sure.tolist(), known):
            chosen = samples[samples[:, number] != ABSENT, number]
            if len(chosen) < _PRESENT * len(samples):
                continue
            box = detections.boxes[index]
            colors = integral.histograms(upper_and_lower_halves(box))
            _, aspect = initial_state(box)
            self._last_serial += 1
            target = JumpTarget(colors, aspect, states[number, chosen], len(chosen) / len(samples))
            item = StepwiseTrack(0, target, box, self._last_serial)
            item.observations[frame] = (box, index)
            self._objects.append(item)


def next_presence(presence: float, mean_presence: float, mean_absence: float) -> float:
    """Return the probability of presence one frame later; both means are in frames."""
    leaves, returns = 1.0 / max(mean_presence, 1.0), 1.0 / max(mean_absence, 1.0)
    return presence * (1.0 - leaves) + (1.0 - presence) * returns


def presence_log_odds(
    prior: float,
    boxes: Floats,
    detections: Detections,
    settings: JumpSettings,
    distances: Floats | None = None,
) -> Floats:
    """Return the log odds `(M,)` of being present in boxes `(M, 4)` to being absent.

    `distances`, `(M,)`: squared color distances, for a target whose colors are known.
    """
    covered = np.zeros(len(boxes))
    if len(detections):
        covered = iou(boxes[:, None], detections.boxes[None]).max(axis=1)
    evidence = settings.detection_log_odds * covered - settings.miss_log_odds * (covered == 0.0)
    if distances is not None:
        evidence += settings.sharpness * (settings.neutral_distance - distances)
    prior = float(np.clip(prior, 1e-9, 1.0 - 1e-9))
    return np.asarray(np.log(prior / (1.0 - prior)) + evidence)


def _assigned(boxes: Sequence[Floats], detections: Detections, min_iou: float) -> list[int]:
    """Return for each box the index of its detection, or `OCCLUDED`."""
    found = [OCCLUDED] * len(boxes)
    if boxes and len(detections):
        overlaps = iou(np.stack(boxes)[:, None], detections.boxes[None])
        for row, column in zip(*assign_pairs(overlaps, max(min_iou, 1e-9)), strict=True):
            found[int(row)] = int(column)
    return found
