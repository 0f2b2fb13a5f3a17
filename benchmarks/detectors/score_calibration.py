"""Fits the constants by which scores of the installed networks become probabilities.

    OMP_NUM_THREADS=1 python -m benchmarks.detectors.score_calibration --data ../shared/data

A score's logit times *slope* plus *offset* is the logit of the probability that the box is right: that it
overlaps a person (IoU of one half) whom no better box overlaps (Platt, Probabilistic outputs for support
vector machines, 1999). `server/models/person_networks.py` has the constants. The errors are expected
calibration errors: with the constants there, with those fitted on the scenes of the title, and for each scene
with those fitted on the others.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit

from benchmarks.common.detection_scores import ScoredBoxes
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.detectors.compared_detectors import rows_of
from benchmarks.detectors.scored_views import ScoredView, views_of
from server.models.catalog import MODELS, InstallableModel
from server.models.installed import is_installed
from server.models.person_networks import CENTERNET_CALIBRATION, NANODET_CALIBRATION, SSD_CALIBRATION

Floats = NDArray[np.float64]
FITTED, HELD_OUT = ("terrace", "pets09"), ("terrace2",)
"""Scenes of the fit, and scenes on which its error is measured."""
_IN_USE = {"ssd": SSD_CALIBRATION, "nanodet": NANODET_CALIBRATION, "centernet": CENTERNET_CALIBRATION}
_MIN_PROBABILITY = 0.05
"""Boxes below it are not detected, as by default."""
_EVERY = 10
"""Frames from one used frame to the next: neighbors say the same."""


@dataclass(frozen=True, slots=True)
class Platt:
    """A calibration of scores."""

    slope: float
    offset: float

    def probabilities(self, logits: Floats) -> Floats:
        """Return the probabilities that belong to logits of raw scores."""
        return np.asarray(expit(self.slope * logits + self.offset))

    def logits(self, probabilities: Floats) -> Floats:
        """Return the logits of the raw scores that belong to probabilities."""
        return np.asarray((logit(np.clip(probabilities, 1e-6, 1.0 - 1e-6)) - self.offset) / self.slope)


def fit_platt(logits: Floats, right: NDArray[np.bool_]) -> Platt:
    """Return the calibration of the largest likelihood.

    Args:
        logits: (N,) of the raw scores.
        right: (N,) whether the boxes are right.
    """

    def loss(parameters: Floats) -> float:
        values = parameters[0] * logits + parameters[1]
        return float(np.logaddexp(0.0, np.where(right, -values, values)).mean())

    slope, offset = minimize(loss, np.array([1.0, 0.0]), method="Nelder-Mead").x.tolist()
    return Platt(slope, offset)


def fit(in_use: Platt, recordings: Sequence[ScoredBoxes]) -> Platt:
    """Return the calibration fitted to the boxes of some recordings, detected with the one in use."""
    joined = ScoredBoxes.joined(recordings)
    return fit_platt(in_use.logits(joined.scores), joined.right)


def error_of(calibration: Platt, in_use: Platt, boxes: ScoredBoxes) -> float:
    """Return the calibration error of boxes, detected with the calibration in use, with another one."""
    probabilities = calibration.probabilities(in_use.logits(boxes.scores))
    return replace(boxes, scores=probabilities).calibration_error


def detect(model: InstallableModel, view: ScoredView, every: int) -> ScoredBoxes:
    """Run a network on every n-th frame of a view."""
    height, width = next(view.images(1)).shape[:2]
    onnx = {"model": model.name, "min_score": _MIN_PROBABILITY}
    detector = view.make_detector({"kind": "onnx", "onnx": onnx}, (width, height))
    people = [row for row in view.people(None) if (row.frame - 1) % every == 0]
    boxes = [
        row
        for index, image in enumerate(view.images(every=every))
        for row in rows_of(index * every, detector.detect(image))
    ]
    return ScoredBoxes.of(people, boxes)


def measure(options: argparse.Namespace) -> None:
    """Fit all installed networks; print and save the table.

    Raises:
        CannotRunError: no network is installed, or recordings are missing.
    """
    models = [model for model in MODELS if is_installed(model)]
    if not models:
        raise CannotRunError("needs networks: myview models install " + " ".join(m.name for m in MODELS))
    scenes = {
        name: [view for view in views_of(options.data, name) if view.truth] for name in (*FITTED, *HELD_OUT)
    }
    report = Report()
    rows = []
    for model in models:
        in_use = Platt(*_IN_USE[model.kind])
        found = {
            name: ScoredBoxes.joined([detect(model, view, options.every) for view in views])
            for name, views in scenes.items()
        }
        fitted = fit(in_use, [found[name] for name in FITTED])
        for title, calibration in (("in use", in_use), ("fitted", fitted)):
            constants = (f"{calibration.slope:.2f}", f"{calibration.offset:.2f}")
            errors = [error_of(calibration, in_use, boxes) for boxes in found.values()]
            rows.append([model.name, title, *constants, *(f"{error:.3f}" for error in errors)])
        without = {
            name: fit(in_use, [boxes for other, boxes in found.items() if other != name]) for name in found
        }
        errors = [error_of(without[name], in_use, boxes) for name, boxes in found.items()]
        rows.append([model.name, "cross-validated", "", "", *(f"{error:.3f}" for error in errors)])
    fitted_on = ", ".join(FITTED)
    report.table(
        f"Calibration of scores, fitted on {fitted_on}; every {options.every}th frame",
        ["network", "constants", "slope", "offset", *(f"error on {name}" for name in scenes)],
        rows,
    )
    report.save(options.out / "score_calibration.txt")


def main() -> None:
    """Run the fit."""
    options = parser(__doc__, "detectors.score_calibration")
    options.add_argument("--every", type=int, default=_EVERY, help="use every n-th frame")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "detectors.score_calibration")


if __name__ == "__main__":
    main()
