"""One disturbance of one scene: the run, its scores, and how they compare with the undisturbed run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.forked import in_copy
from benchmarks.robustness.disturbances.base import Disturbance, Effect
from benchmarks.robustness.disturbed_views import Disturbed, DisturbedSource
from benchmarks.scene_runs.pipeline_run import SceneRun, SceneRunner, open_frames
from benchmarks.scene_runs.scores import Rows, SceneScores, rolling_f1, score_run
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


class DisturbedScene:
    """A scene that is disturbed from a frame on. All runs have the frames before in common.

    With each seed a disturbance begins a little later, so that also those without random numbers vary.

    Args:
        scene: recordings and truth.
        config: of the site.
        start: the first disturbed frame, from 0, with the first seed.
        frames: number of frames.
    """

    def __init__(self, scene: BenchmarkScene, config: Config, start: int, frames: int) -> None:
        self.scene, self.config, self.start, self.frames = scene, config, start, frames
        undisturbed = self._disturbed(Undisturbed(), FIRST_SEED)
        self._sources = {
            camera: DisturbedSource(partial(open_frames, config, camera, frames), undisturbed[camera])
            for camera in config.camera_ids
        }
        self._runner = SceneRunner(config, self._sources)
        self._runner.run_before(start)

    def run(self, disturbance: Disturbance, seed: int) -> SceneRun:
        """Run the cameras on the disturbed pictures."""
        disturbed = self._disturbed(disturbance, seed)

        def run() -> SceneRun:
            for camera, source in self._sources.items():
                source.change(disturbed[camera])
            return self._runner.finish()

        return in_copy(run)

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
        start = self.start + round(SEED_S * fps * (seed - FIRST_SEED))
        return {
            camera: Disturbed(disturbance, start, fps, seed, index)
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
