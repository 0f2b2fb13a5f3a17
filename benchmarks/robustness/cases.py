"""One disturbance of one scene: the run, its scores, and how they compare with the undisturbed run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.robustness.disturbances.base import Disturbance, Effect
from benchmarks.robustness.disturbed_views import Disturbed, DisturbedSource
from benchmarks.scene_runs.pipeline_run import SceneRun, open_sources, run_scene
from benchmarks.scene_runs.scores import Rows, SceneScores, rolling_f1, score_run
from server.config.site_config import Config

WINDOW_S = 2.0
TOLERANCE = 0.1
"""A camera has recovered when the F1 score of its tracks' boxes over a window stays this close."""
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


@dataclass(frozen=True, slots=True, eq=False)
class DisturbedScene:
    """A scene that is disturbed from a frame on.

    Attributes:
        scene: recordings and truth; without truth, the tracks of the undisturbed run stand for it.
        config: of the site.
        start: the first disturbed frame, from 0.
        frames: number of frames.
    """

    scene: BenchmarkScene
    config: Config
    start: int
    frames: int

    def run(self, disturbance: Disturbance, seed: int) -> SceneRun:
        """Run the cameras on the disturbed pictures."""
        sources = open_sources(self.config, self.frames)
        disturbed = self._disturbed(disturbance, seed)
        return run_scene(
            self.config,
            {camera: DisturbedSource(source, disturbed[camera]) for camera, source in sources.items()},
        )

    def score(self, run: SceneRun, truth: Rows, disturbance: Disturbance, seed: int) -> CaseScores:
        """Score a run against the truth of the undisturbed pictures."""
        disturbed, size = self._disturbed(disturbance, seed), self.config.site.size
        seen = {
            camera: disturbed[camera].truth([row for row in rows if row.frame <= self.frames], size)
            for camera, rows in truth.items()
        }
        later = self.start + round(LATER_S * self.config.site.fps)

        def score(first: int) -> SceneScores:
            return score_run(
                self.config, seen, run, range(first + 1, self.frames + 1), self.scene.min_visible
            )

        window = round(WINDOW_S * self.config.site.fps)
        return CaseScores(
            score(0),
            score(self.start),
            score(later) if later + window < self.frames else None,
            rolling_f1(seen, run.rendering.tracks, self.frames, window),
        )

    def recovery_s(self, disturbed: CaseScores, undisturbed: CaseScores) -> float:
        """Return how long after its beginning a disturbance still costs something; infinite: to the end."""
        return recovery_s(
            disturbed.rolling_f1[self.start :], undisturbed.rolling_f1[self.start :], self.config.site.fps
        )

    def _disturbed(self, disturbance: Disturbance, seed: int) -> dict[str, Disturbed]:
        fps = self.config.site.fps
        return {
            camera: Disturbed(disturbance, self.start, fps, seed, index)
            for index, camera in enumerate(self.config.camera_ids)
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
