"""All terms of view quality together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats
from bestview.quality.central import central
from bestview.quality.facing import NEUTRAL, facing
from bestview.quality.settings import QualitySettings
from bestview.quality.size import size_quality
from bestview.quality.unhidden import unhidden
from bestview.quality.whole import whole

_SIDES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """The cameras of a site, as far as view quality asks. All pixels are those of the boxes.

    Attributes:
        size: width and height of the picture that viewers are shown, pixels.
        pictures: (C, 4) where each camera's own picture lies in it: left, top, right, bottom.
        homographies: from those pixels to the ground, None where it is not known; C of them.
        fps: frames per second.
    """

    size: tuple[float, float]
    pictures: Floats
    homographies: Sequence[Floats | None]
    fps: float


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """K objects, or tracks of each camera, over a window of N frames in C cameras.

    Attributes:
        boxes: (K, N, C, 4) pixels, NaN where hidden.
        sure: (K, C) in [0, 1], how surely each track is there.
        sharp: (K, C) in [0, 1], how sharp its picture is; NaN where nobody has measured it: counts as 1.
    """

    boxes: Floats
    sure: Floats
    sharp: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Quality:
    """How well each view shows each object.

    Attributes:
        quality: (K, N, C) in [0, 1]; 0 where hidden.
        names: the terms that weigh something.
        terms: (T, K, N, C) in [0, 1], each of them; NaN where hidden.
    """

    quality: Floats
    names: tuple[str, ...]
    terms: Floats


def view_quality(seen: Seen, looks: Looks, settings: QualitySettings) -> Quality:
    """Weigh all terms: the product over the terms *t* of ``1 - weight (1 - t)``.

    A product, since what spoils a view is not made good by anything else: somebody covered is not seen,
    however large. The weight says how far a term can spoil it: at most by the share `weight`.

    Raises:
        ValueError: shapes that do not fit.
    """
    _check(seen, looks)
    there = ~np.isnan(seen.boxes[..., 0])
    rows = _Rows(seen, looks, np.nonzero(there), seen.boxes[there])
    weights = settings.weights
    terms = np.full((len(settings.terms), *there.shape), np.nan)
    quality = np.zeros(there.shape)
    product = np.ones(len(rows.boxes))
    for place, name in enumerate(settings.terms):
        term = _TERMS[name](rows)
        product *= 1.0 - weights[name] * (1.0 - term)
        terms[place][there] = term
    quality[there] = product
    return Quality(quality, settings.terms, terms)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The B boxes that are there; `places` are their (object, frame, camera) indices, (B,) each."""

    seen: Seen
    looks: Looks
    places: tuple[NDArray[np.int64], ...]
    boxes: Floats

    @property
    def pictures(self) -> Floats:
        return self.looks.pictures[self.places[2]]


def _unhidden(rows: _Rows) -> Floats:
    _, frame, camera = rows.places
    return unhidden(rows.boxes, frame * len(rows.looks.pictures) + camera)


def _facing(rows: _Rows) -> Floats:
    objects, _, camera = rows.places
    whole_window = np.full((rows.seen.boxes.shape[0], len(rows.looks.pictures)), NEUTRAL)
    for column, homography in enumerate(rows.looks.homographies):
        if homography is not None:
            whole_window[:, column] = facing(rows.seen.boxes[:, :, column], homography, rows.looks.fps)
    return np.asarray(whole_window[objects, camera])


def _sharp(rows: _Rows) -> Floats:
    objects, _, camera = rows.places
    return np.nan_to_num(rows.seen.sharp[objects, camera], nan=1.0)


def _sure(rows: _Rows) -> Floats:
    objects, _, camera = rows.places
    return np.asarray(rows.seen.sure[objects, camera])


_TERMS: dict[str, Callable[[_Rows], Floats]] = {
    "size": lambda rows: size_quality(rows.boxes, *rows.looks.size),
    "whole": lambda rows: whole(rows.boxes, rows.pictures),
    "unhidden": _unhidden,
    "central": lambda rows: central(rows.boxes, rows.pictures),
    "sharp": _sharp,
    "facing": _facing,
    "sure": _sure,
}


def _check(seen: Seen, looks: Looks) -> None:
    shape, cameras = seen.boxes.shape, len(looks.pictures)
    if len(shape) != 4 or shape[2:] != (cameras, _SIDES):  # noqa: PLR2004 — objects, frames, cameras, sides
        raise ValueError(f"boxes have shape {shape}, not (objects, frames, {cameras}, 4)")
    for name, values in (("sure", seen.sure), ("sharp", seen.sharp)):
        if values.shape != (shape[0], cameras):
            raise ValueError(f"{name} has shape {values.shape}, not ({shape[0]}, {cameras})")
    if len(looks.homographies) != cameras:
        raise ValueError(f"there are {len(looks.homographies)} homographies for {cameras} cameras")
