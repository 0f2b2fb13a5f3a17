"""View quality as the product of all weighted terms, and their weights (`view.quality`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bestview.quality.facing import NEUTRAL, facing_score
from bestview.quality.framing import Floats, centering_score, size_quality, untruncated_share
from bestview.quality.occlusion import occlusion_score

_SIDES = 4


@dataclass(frozen=True, slots=True)
class QualitySettings:
    """Weights of the terms: the largest share by which each can lower a view's quality, 0 to 1.

    0 leaves the term out; with ``size`` 1 and all others 0 the quality is the paper's (as a length).

    Raises:
        ValueError: a weight outside 0 to 1, or all of them 0.
    """

    size: float = 1.0  # how large the person is in the picture
    truncation: float = 1.0  # share of the person inside the picture
    occlusion: float = 0.25  # share of the person that other people do not cover
    centering: float = 0.0  # how near the person is to the middle of the picture
    sharpness: float = 0.0  # detail of the picture inside the box
    facing: float = 0.0  # walking towards the camera; needs a homography
    confidence: float = 0.0  # mean detection score of the track over its window, 0 where hidden
    clarity: float = 0.9  # whether the camera's picture is clear: not covered, turned, blurred, dark, frozen
    relative: bool = True  # cost relative to the best view of the same frame; false: as in the paper

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not 0.0 <= weight <= 1.0:
                raise ValueError(f"the weight {name} is a share between 0 and 1, not {weight}")
        if not any(self.weights.values()):
            raise ValueError("all weights are 0: every view would be as good as any other")

    @property
    def weights(self) -> dict[str, float]:
        """The weights by the terms' names, in the terms' order."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "relative"}

    @property
    def terms(self) -> tuple[str, ...]:
        """The terms with a weight above 0."""
        return tuple(name for name, weight in self.weights.items() if weight > 0)


@dataclass(frozen=True, slots=True, eq=False)
class CameraLayout:
    """The cameras of a site, as far as view quality needs them. All pixels are those of the boxes.

    Attributes:
        site_size: width and height of the picture that viewers are shown, pixels.
        picture_boxes: (C, 4) where each camera's own picture lies in it: left, top, right, bottom.
        homographies: from those pixels to the ground, None: not calibrated; C of them.
        fps: frames per second.
    """

    site_size: tuple[float, float]
    picture_boxes: Floats
    homographies: Sequence[Floats | None]
    fps: float


@dataclass(frozen=True, slots=True, eq=False)
class TrackWindow:
    """T tracks, each of one camera, over a window of N frames.

    Attributes:
        boxes: (T, N, 4) pixels, NaN where hidden.
        camera: (T,) index of each track's camera.
        confidence: (T,) in [0, 1], mean detection score.
        sharpness: (T,) in [0, 1]; NaN: not measured, counts as 1.
        clarity: (T,) 1 where the camera's picture is clear, else 0; None: all are.
    """

    boxes: Floats
    camera: NDArray[np.int64]
    confidence: Floats
    sharpness: Floats
    clarity: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ViewQuality:
    """Quality of each view.

    Attributes:
        quality: (T, N) in [0, 1]; NaN where hidden.
        term_names: the terms with a weight.
        terms: (terms, T, N) in [0, 1], each of them; NaN where hidden.
    """

    quality: Floats
    term_names: tuple[str, ...]
    terms: Floats


def compute_view_quality(tracks: TrackWindow, layout: CameraLayout, settings: QualitySettings) -> ViewQuality:
    """Multiply all terms: the product over the terms *t* of ``1 - weight (1 - t)``.

    A product, since no term compensates for another: an occluded person is not visible, however large. The
    weight is the largest share by which a term can lower the quality.

    Raises:
        ValueError: shapes that do not fit.
    """
    _check(tracks, layout)
    # Sides outermost in memory, then frames: the terms read them in this order.
    sides = np.ascontiguousarray(tracks.boxes.transpose(2, 1, 0))
    inputs = _TermInputs(tracks, layout, sides.transpose(2, 1, 0))
    weights = settings.weights
    terms = np.empty((len(settings.terms), *sides.shape[1:])).transpose(0, 2, 1)
    quality = np.ones(sides.shape[1:]).T
    for index, name in enumerate(settings.terms):
        terms[index] = TERMS[name](inputs)
        quality *= 1.0 - weights[name] * (1.0 - terms[index])
    hidden = np.isnan(inputs.boxes[..., 0])
    if hidden.any():
        quality[hidden] = terms[:, hidden] = np.nan
    return ViewQuality(quality, settings.terms, terms)


@dataclass(frozen=True, slots=True, eq=False)
class _TermInputs:
    """Inputs of the terms; `boxes` are those of `tracks`, reordered in memory."""

    tracks: TrackWindow
    layout: CameraLayout
    boxes: Floats

    @property
    def picture_boxes(self) -> Floats:
        """(T, 1, 4): picture of each track's camera."""
        return self.layout.picture_boxes[self.tracks.camera][:, None]


def _facing(inputs: _TermInputs) -> Floats:
    camera = inputs.tracks.camera
    whole_window = np.full(len(camera), NEUTRAL)
    for column, homography in enumerate(inputs.layout.homographies):
        if homography is not None:
            own_tracks = camera == column
            whole_window[own_tracks] = facing_score(
                inputs.tracks.boxes[own_tracks], homography, inputs.layout.fps
            )
    return whole_window[:, None]


def _clarity(inputs: _TermInputs) -> Floats:
    clarity = inputs.tracks.clarity
    return np.ones((len(inputs.boxes), 1)) if clarity is None else clarity[:, None]


TERMS: dict[str, Callable[[_TermInputs], Floats]] = {
    "size": lambda inputs: size_quality(inputs.boxes, *inputs.layout.site_size),
    "truncation": lambda inputs: untruncated_share(inputs.boxes, inputs.picture_boxes),
    "occlusion": lambda inputs: occlusion_score(inputs.boxes, inputs.tracks.camera),
    "centering": lambda inputs: centering_score(inputs.boxes, inputs.picture_boxes),
    "sharpness": lambda inputs: np.nan_to_num(inputs.tracks.sharpness, nan=1.0)[:, None],
    "facing": _facing,
    "confidence": lambda inputs: inputs.tracks.confidence[:, None],
    "clarity": _clarity,
}
"""The terms by name; each is (T, N), or (T, 1) where all frames are alike; any value where hidden."""


def _check(tracks: TrackWindow, layout: CameraLayout) -> None:
    shape, cameras = tracks.boxes.shape, len(layout.picture_boxes)
    if len(shape) != 3 or shape[2] != _SIDES:  # noqa: PLR2004 — tracks, frames, sides
        raise ValueError(f"boxes have shape {shape}, not (tracks, frames, 4)")
    for name, values in (
        ("camera", tracks.camera),
        ("confidence", tracks.confidence),
        ("sharpness", tracks.sharpness),
        ("clarity", tracks.confidence if tracks.clarity is None else tracks.clarity),
    ):
        if values.shape != shape[:1]:
            raise ValueError(f"{name} has shape {values.shape}, not ({shape[0]},)")
    if shape[0] and not 0 <= tracks.camera.min() <= tracks.camera.max() < cameras:
        raise ValueError(f"a track is of a camera outside 0 .. {cameras - 1}")
    if len(layout.homographies) != cameras:
        raise ValueError(f"there are {len(layout.homographies)} homographies for {cameras} cameras")
