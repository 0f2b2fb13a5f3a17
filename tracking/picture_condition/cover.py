"""Finds the part of a picture that something on the lens or close before it hides.

What is so near is out of focus: it has no edges of its own, its outline is soft, and the scene's edges are
gone. People and cars have sharp outlines, fog and darkness leave a share of the scene's edges, and a stream
with few bits, which loses weak edges, leaves the brightness as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.picture_condition.structure import FINE_NOISE, PART_CELLS, Cells, Structure, cell_means, grid_of

# Squared gradient, gray levels per pixel, from which a cell has edges; and how many times the noise's what is
# left of it in this light must be to be missed.
_EDGE, _NOTICED = 1.0, 2.0
# Correlation of gradients from which a cell shows the scene.
_SEEN = 0.4
# Squared gradient below which a cell is plain, as a share of what the scene's is in this light.
_PLAIN = 0.2
# Gray levels, at the scene's contrast, by which a cover differs from what it hides; least contrast believed.
_DIFFERS, _LEAST_CONTRAST = 10.0, 0.2
# Gray levels by which the soft edge of a cover differs.
_VEILED = 5.0
# Shares of the picture: of the least cover, which is larger than what is plain of a person; and of all covers
# together from which they are believed at once.
_LEAST, _MUCH = 0.05, 0.25
# Seconds until less is believed.
_BELIEVED_S = 3.0
# Seconds after which signs that are not believed are the scene's.
_UNDECIDED_S = 6.0
# Seconds without its signs after which a cell is seen again.
_CLEARS_S = 0.5
# Squared fine detail around a sharp outline, as a share of the squared step of the brightness there.
_SHARP = 0.0008
# Least share of the cells of a cover that had edges, and of those outside of it that show the scene.
_HAD_EDGES, _REST_SEEN = 0.3, 0.5
# Fewest cells from which the light is known.
_LIGHT_CELLS = 20


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """What the cells of a picture say, `(R, C)`.

    Attributes:
        seen: they show the scene.
        noticed: its edges would be noticed in them.
        signs: they have the signs of a cover.
        deviation: by how much they are brighter than the scene is in this light.
    """

    seen: Cells
    noticed: Cells
    signs: Cells
    deviation: Floats


class CoverFinder:
    """Finds the covered part in the pictures of one camera."""

    def __init__(self) -> None:
        self._signs_s: Floats = np.zeros((1, 1))
        """`(R, C)` seconds for which each cell has had the signs of a cover."""
        self._clear_s: Floats = np.zeros((1, 1))
        """Seconds since."""
        self.cells: Cells | None = None
        """`(R, C)`, what is covered; None: nothing."""
        self.rest_is_seen = True
        """Whether the rest of the picture shows the scene."""

    def forget(self) -> None:
        """Forget what is covered: the camera shows another scene."""
        self._signs_s, self._clear_s = np.zeros((1, 1)), np.zeros((1, 1))
        self.cells, self.rest_is_seen = None, True

    def observe(self, structure: Structure, reference: Structure, noise: float, elapsed: float) -> None:
        """Look at a picture.

        Args:
            structure: of the picture.
            reference: of the scene.
            noise: mean squared gradient that is noise.
            elapsed: seconds since the picture before.
        """
        evidence = _evidence(structure, reference, noise)
        if evidence is None:
            self.rest_is_seen = False
            return
        self._clear_s = np.where(evidence.signs, 0.0, self._clear_s + elapsed)
        signs_s = self._signs_s + np.where(evidence.signs, elapsed, 0.0)
        self._signs_s = np.where(self._clear_s > _CLEARS_S, 0.0, signs_s)
        before = np.zeros_like(evidence.signs) if self.cells is None else self.cells & (self._signs_s > 0.0)
        parts = _large_parts(before | (self._signs_s >= _BELIEVED_S), evidence)
        now = _large_parts(evidence.signs, evidence)
        if sum(float(part.mean()) for part in now) >= _MUCH:
            parts += now
        found = np.zeros_like(before)
        for part in parts:
            if (part & before).any() or not _is_sharp(part, structure, reference, noise, evidence):
                found |= part
        self._take(found, evidence)

    def _take(self, found: Cells, evidence: _Evidence) -> None:
        # At its edge the cover hides a part of the cells, and veils those beyond.
        edge = _grown(found)
        veiled = _grown(edge) & (np.abs(evidence.deviation) > _VEILED)
        self.cells = edge | veiled if found.any() else None
        rest = evidence.noticed if self.cells is None else evidence.noticed & ~self.cells
        shown = np.count_nonzero(evidence.seen & rest)
        self.rest_is_seen = bool(shown >= max(_REST_SEEN * np.count_nonzero(rest), _LIGHT_CELLS))

    def mask(self, shape: tuple[int, int]) -> Cells:
        """Return where a picture `(h, w)` is covered, or may turn out to be."""
        cells = (self._signs_s > 0.0) & (self._signs_s < _UNDECIDED_S)
        cells = cells if self.cells is None else cells | self.cells
        size = (shape[1], shape[0])
        return np.asarray(cv2.resize(cells.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0)


_LEAST_EDGES = 1e-4


def _evidence(structure: Structure, reference: Structure, noise: float) -> _Evidence | None:
    """Return what the cells of a picture say; None: too few show the scene."""
    grid = grid_of(structure.gray.shape, PART_CELLS)
    expected = cell_means(reference.across**2 + reference.down**2, grid)
    raw = cell_means(structure.across**2 + structure.down**2, grid)
    product = cell_means(structure.across * reference.across + structure.down * reference.down, grid)
    textured = expected > _EDGE
    # Where a drawn picture has no edges and no noise either, nothing agrees.
    seen = textured & (product > _SEEN * np.sqrt(expected * np.maximum(raw, _LEAST_EDGES * expected)))
    if np.count_nonzero(seen) < _LIGHT_CELLS:
        return None
    edges = np.maximum(raw - noise, 0.0)
    left = min(float(np.median(edges[seen] / expected[seen])), 1.0)
    noticed = textured & (left * expected > _NOTICED * noise)
    deviation = _deviation(structure, reference, seen)
    differs = np.abs(deviation) > _DIFFERS * max(np.sqrt(left), _LEAST_CONTRAST)
    plain = edges < _PLAIN * left * np.maximum(expected, _EDGE)
    return _Evidence(seen, noticed, differs & plain & ~seen & (noticed | ~textured), deviation)


def _deviation(structure: Structure, reference: Structure, seen: Cells) -> Floats:
    """Return by how much cells are brighter than the scene is in this light, which may vary by row."""
    now, before = cell_means(structure.gray, seen.shape), cell_means(reference.gray, seen.shape)
    rows = np.broadcast_to(np.linspace(-1.0, 1.0, len(now))[:, None], now.shape)
    terms = np.stack([before, np.ones_like(before), rows, rows * before], axis=-1)
    fit, *_ = np.linalg.lstsq(terms[seen], now[seen], rcond=None)
    return np.asarray(now - terms @ fit)


def _large_parts(cells: Cells, evidence: _Evidence) -> list[Cells]:
    """Return the connected parts of some cells that are large and hide edges of the scene."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA]
    hidden = np.bincount(labels[evidence.noticed], minlength=count)
    chosen = np.flatnonzero((areas >= _LEAST * cells.size) & (hidden >= _HAD_EDGES * areas))
    return [np.asarray(labels == label) for label in chosen.tolist() if label > 0]


def _is_sharp(
    part: Cells, structure: Structure, reference: Structure, noise: float, evidence: _Evidence
) -> bool:
    """Return whether the outline of a part is a sharp edge, which the scene has not."""
    outline = _grown(part) & ~(cv2.erode(part.astype(np.uint8), _AROUND) > 0)
    detail = cell_means(structure.fine**2, part.shape) - FINE_NOISE * noise
    more = np.maximum(detail - cell_means(reference.fine**2, part.shape), 0.0)
    step = float((evidence.deviation[part] ** 2).mean())
    return float(more[outline].mean()) > _SHARP * step


def _grown(cells: Cells) -> Cells:
    return np.asarray(cv2.dilate(cells.astype(np.uint8), _AROUND) > 0)


_AROUND = np.ones((3, 3), dtype=np.uint8)
