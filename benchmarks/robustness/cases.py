"""One disturbance of one scene: the run, its scores, and how they compare with the undisturbed run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.forked import in_copy
from benchmarks.robustness.disturbances.base import Disturbance, Effect
from benchmarks.robustness.disturbed_views import Disturbed, DisturbedSource
from benchmarks.scene_runs.pipeline_run import SceneRun, SceneRunner, open_frames
from benchmarks.scene_runs.scores import Rows, SceneScores, rolling_f1, score_run, within
from server.config.site_config import Config

WINDOW_S = 2.0
TOLERANCE = 0.1
"""A camera has recovered when the F1 score of its tracks' boxes over a window stays this close."""
FIRST_SEED, SEED_S = 1, 0.2
"""The first seed, and the seconds by which a disturbance begins later with the next."""
LATER_S = 10.0
"""Seconds after the beginning from which all should be as before."""


@dataclass(frozen=True)
class Undisturbed(Disturbance):
    """Leaves all pictures as they are."""

    def begin(self) -> Effect:
        """Return the identity."""
        return lambda image, _moment: image


@dataclass(frozen=True, slots=True, eq=False)
class CaseScores:
    """Scores of a run with a disturbance.

    Attributes:
        whole: of the whole recording.
        since: from the beginning of the disturbance on.
        later: from `LATER_S` after that on; None: the recording is too short.
        rolling_f1: F1 score of the tracks' boxes over the windows that begin with each frame.
    """

    whole: SceneScores
    since: SceneScores
    later: SceneScores | None
    rolling_f1: NDArray[np.float64]

    @property
    def joint(self) -> float:
        """The joint IDF1, percent."""
        return 100.0 * self.whole.tracks.joint.idf1

    @property
    def later_joint(self) -> float:
        """The joint IDF1 of what follows later, percent; NaN: nothing does."""
        return float("nan") if self.later is None else 100.0 * self.later.tracks.joint.idf1


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A disturbance of a scene.

    Attributes:
        disturbed: scores of the disturbed run.
        undisturbed: scores of the undisturbed run on the people who count in the disturbed one.
        recovery_s: how long after its beginning the disturbance costs something; infinite: to the end.
    """

    disturbed: CaseScores
    undisturbed: CaseScores
    recovery_s: float

    @property
    def cost(self) -> float:
        """The loss of joint IDF1, in points."""
        return self.undisturbed.joint - self.disturbed.joint

    @property
    def later_cost(self) -> float:
        """The loss of joint IDF1 of what follows later, in points; NaN: nothing does."""
        return self.undisturbed.later_joint - self.disturbed.later_joint


class DisturbedScene:
    """A scene that is disturbed from a frame on. All runs have the frames before in common.

    With each seed a disturbance begins a little later, so that also those without random numbers vary.

    Args:
        scene: recordings and truth; without truth, the tracks of the undisturbed run stand for it.
        config: of the site.
        start: the first disturbed frame, from 0, with the first seed.
        frames: number of frames.
    """

    def __init__(self, scene: BenchmarkScene, config: Config, start: int, frames: int) -> None:
        self._scene, self._config, self._start, self._frames = scene, config, start, frames
        undisturbed = self._disturbed(Undisturbed(), FIRST_SEED)
        self._sources = {
            camera: DisturbedSource(partial(open_frames, config, camera, frames), undisturbed[camera])
            for camera in config.camera_ids
        }
        self._runner = SceneRunner(config, self._sources)
        self._runner.run_before(start)
        self._undisturbed = self.run(Undisturbed(), FIRST_SEED)
        truth: Rows = scene.gt or self._undisturbed.rendering.tracks
        self._truth = {camera: within(rows, range(1, frames + 1)) for camera, rows in truth.items()}
        self.undisturbed = self._score(self._undisturbed, self._truth)
        """The scores of the undisturbed run."""

    def measure(self, disturbance: Disturbance, seed: int) -> Case:
        """Run and score a disturbance."""
        disturbed = self._disturbed(disturbance, seed)
        seen = {
            camera: disturbed[camera].truth(rows, self._config.site.size)
            for camera, rows in self._truth.items()
        }
        counted = {
            camera: [
                replace(row, confidence=other.confidence)
                for row, other in zip(rows, seen[camera], strict=True)
            ]
            for camera, rows in self._truth.items()
        }
        scores = self._score(self.run(disturbance, seed), seen)
        undisturbed = self.undisturbed if counted == self._truth else self._score(self._undisturbed, counted)
        after, before = (found.rolling_f1[self._start :] for found in (scores, undisturbed))
        return Case(scores, undisturbed, recovery_s(after, before, self._config.site.fps))

    def run(self, disturbance: Disturbance, seed: int) -> SceneRun:
        """Run the cameras on the disturbed pictures."""
        disturbed = self._disturbed(disturbance, seed)

        def run() -> SceneRun:
            for camera, source in self._sources.items():
                source.change(disturbed[camera])
            return self._runner.finish()

        return in_copy(run)

    def _score(self, run: SceneRun, truth: Rows) -> CaseScores:
        later = self._start + round(LATER_S * self._config.site.fps)
        window = round(WINDOW_S * self._config.site.fps)

        def score(first: int) -> SceneScores:
            frames = range(first + 1, self._frames + 1)
            return score_run(self._config, truth, run, frames, self._scene.min_visible)

        return CaseScores(
            score(0),
            score(self._start),
            score(later) if later + window < self._frames else None,
            rolling_f1(truth, run.rendering.tracks, self._frames, window),
        )

    def _disturbed(self, disturbance: Disturbance, seed: int) -> dict[str, Disturbed]:
        fps = self._config.site.fps
        start = self._start + round(SEED_S * fps * (seed - FIRST_SEED))
        return {
            camera: Disturbed(disturbance, start, fps, seed, index)
            for index, camera in enumerate(self._config.camera_ids)
        }


def recovery_s(disturbed: NDArray[np.float64], undisturbed: NDArray[np.float64], fps: float) -> float:
    """Return after how many seconds a rolling score stays within `TOLERANCE` of the undisturbed one.

    Args:
        disturbed: (N,) score by frame, from the beginning of the disturbance on.
        undisturbed: (N,) likewise.
        fps: frames a second.
    """
    worse = np.flatnonzero(disturbed < undisturbed - TOLERANCE)
    if not len(worse):
        return 0.0
    return float("inf") if worse[-1] == len(disturbed) - 1 else float(worse[-1] + 1) / fps
