"""The `Tracker` protocol and the registry of trackers by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any, Protocol, runtime_checkable

from tracking.baselines.stepwise import PredictionMethod, StepwiseTracker
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.interactive import CorrectableTracker, InteractiveSettings
from tracking.model.settings import CostSettings
from tracking.solvers.base import Solver
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings

DEFAULT_TRACKER = "lp"
"""Multi-object tracking as one linear program in a moving window: MyView's tracker."""

TEMPORAL_TRACKER = "temporal"
"""Person-to-blob matching over a window of samples, with `TemporalSettings`."""

# Imported on demand: a camera with the default tracker loads none of them.
PREDICTION_METHODS = {
    "contour-particles": ("tracking.baselines.particles.contour_particles", "ContourParticles"),
    "joint-particles": ("tracking.baselines.particles.joint_particles", "JointParticles"),
    "kalman": ("tracking.baselines.kalman_prediction", "KalmanPrediction"),
    "klt": ("tracking.baselines.optical_flow", "OpticalFlow"),
    "mcmc": ("tracking.baselines.particles.mcmc", "McmcFilter"),
    "mean-shift": ("tracking.baselines.mean_shift", "MeanShift"),
    "separated-particles": ("tracking.baselines.particles.separated_particles", "SeparatedParticles"),
    "occlusion-cues": ("tracking.baselines.particles.occlusion_cues", "OcclusionCueTracker"),
    "particle": ("tracking.baselines.particles.particle_filter", "ParticleFilters"),
}
"""Module and class of each frame-by-frame tracker's prediction method, by the tracker's name."""

SELF_CONTAINED = {
    "flag-states": ("tracking.baselines.flag_states.tracker", "FlagStatesTracker", False),
    "rjmcmc": ("tracking.baselines.particles.varying_targets", "VaryingTargetsTracker", True),
    "track-graph": ("tracking.baselines.track_graphs.track_graph", "TrackGraph", False),
    "track-network": ("tracking.baselines.track_graphs.whole_recording", "WholeRecordingTracker", False),
}
"""Module, class and need for images of the trackers that decide more than a prediction, by name."""

OFFLINE_TRACKERS = frozenset({"track-network"})
"""Trackers that publish nothing before the end of a recording."""


class Tracker(Protocol):
    """Tracks the objects of one camera. Deterministic, and bounded in memory."""

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Add a frame's detections and, if there is one, its image; return a result where windows end.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        ...

    def flush(self) -> WindowResult | None:
        """End the recording: all frames become final. Return `None` if they were final already."""
        ...


@runtime_checkable
class PrescanTracker(Protocol):
    """A tracker that learns the background from a recording before its first frame."""

    def prepare(self, images: Iterable[Image]) -> None:
        """Learn the background from some images; without any, learn it live."""
        ...


def tracker_names() -> tuple[str, ...]:
    """Return the names of all trackers."""
    return (DEFAULT_TRACKER, *sorted((*PREDICTION_METHODS, TEMPORAL_TRACKER, *SELF_CONTAINED)))


def needs_images(name: str) -> bool:
    """Return whether a tracker needs images, not only detections.

    Raises:
        ValueError: no tracker has that name.
    """
    if name in SELF_CONTAINED:
        return SELF_CONTAINED[name][2]
    return name == TEMPORAL_TRACKER or (name != DEFAULT_TRACKER and bool(_method_of(name).uses_image))


def create_tracker(
    name: str,
    window: WindowSettings,
    costs: CostSettings,
    solver: Callable[[], Solver],
    temporal: TemporalSettings | None = None,
    fps: float = DEFAULT_FPS,
    assist: InteractiveSettings | None = None,
    center: tuple[float, float] | None = None,
) -> Tracker:
    """Create a tracker for `fps` frames per second, and images with this `center` in pixels.

    `costs`, `solver`, `assist` and `center` apply to the default tracker only, which is a
    `CorrectableTracker` if `assist` is enabled; `temporal` applies to temporal consistency only.

    Raises:
        ValueError: no tracker has that name.
    """
    if name == DEFAULT_TRACKER:
        if assist is not None and assist.enabled:
            return CorrectableTracker(window, costs, solver(), assist, fps, center)
        return OnlineTracker(window, costs, solver(), fps, center)
    if name == TEMPORAL_TRACKER:
        tracker: Tracker = import_module(
            "tracking.baselines.temporal_consistency.tracker"
        ).TemporalBlobTracker(window, temporal, fps)
        return tracker
    if name in SELF_CONTAINED:
        module, class_name, _ = SELF_CONTAINED[name]
        found: Tracker = getattr(import_module(module), class_name)(window, fps=fps)
        return found
    return StepwiseTracker(_method_of(name)(), window, fps=fps)


def _method_of(name: str) -> type[PredictionMethod[Any]]:
    if name not in PREDICTION_METHODS:
        raise ValueError(f"no tracker is called {name!r}; there are {', '.join(tracker_names())}")
    module, method = PREDICTION_METHODS[name]
    found: type[PredictionMethod[Any]] = getattr(import_module(module), method)
    return found
