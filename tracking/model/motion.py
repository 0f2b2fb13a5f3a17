"""Motion model: an object's predicted position since its last detection, with damped velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats, distance_in_heights
from tracking.frame_rate import DEFAULT_FPS

# Seconds after which the velocity of an occluded object has decayed to 1/e: people turn and stop.
_VELOCITY_DECAY_S = 0.8
# Sum of squared times, s², at which detections weigh as much as the prior of no motion: slightly more than
# that of three consecutive detections at 25 frames per second, whose boxes jitter by more than a step.
_VELOCITY_REGULARIZATION = 0.0048


@dataclass(frozen=True, slots=True, eq=False)
class MotionModel:
    """An object's motion before the window.

    Attributes:
        box: (4,) pixels, its last detection.
        velocity: (2,) pixels per second, right and down.
        elapsed: frames from its last detection to the window's first frame, at least 1.
        fps: frames per second.
    """

    box: Floats
    velocity: Floats
    elapsed: int
    fps: float = DEFAULT_FPS

    @classmethod
    def of(cls, frames: Sequence[int], boxes: Floats, first: int, fps: float = DEFAULT_FPS) -> MotionModel:
        """Return the motion of an object with `boxes` (F, 4) in `frames` (F,), for a window from `first` on.

        The velocity is the slope of the least-squares line through the centers, shrunk by V / (V + R), where
        V is the sum of the squared times, and R a constant: a ridge regression.
        """
        times = np.asarray(frames, dtype=np.float64) / fps
        times -= times.mean()
        centers = boxes.reshape(-1, 2, 2).mean(axis=1)
        velocity = times @ centers / (times @ times + _VELOCITY_REGULARIZATION)
        return cls(boxes[-1], velocity, first - frames[-1], fps)

    def damped_elapsed(self, frames: int) -> Floats:
        """Return the effective seconds of motion up to each of the window's frames, (M,), at most 0.8.

        Each frame counts less than the one before, since people turn and stop: 0.8 (1 - exp(-t / 0.8)).
        """
        elapsed = (self.elapsed + np.arange(frames, dtype=np.float64)) / self.fps
        return np.asarray(_VELOCITY_DECAY_S * (1.0 - np.exp(-elapsed / _VELOCITY_DECAY_S)))

    def predict(self, frames: int) -> Floats:
        """Return the predicted boxes in the window's frames, (M, 4)."""
        return np.asarray(self.box + self.damped_elapsed(frames)[:, None] * np.tile(self.velocity, 2))

    def deviations_in_heights(self, boxes: Floats) -> Floats:
        """Return the distances of boxes (M, K, 4) from the predicted ones, in heights, (M, K)."""
        return distance_in_heights(self.predict(len(boxes))[:, None], boxes)
