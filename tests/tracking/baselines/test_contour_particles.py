"""CONDENSATION: splines, edges on normals, the exact posterior on a grid, and light that changes."""

from __future__ import annotations

from math import exp, floor
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from fakes.tracking.crossings import BLUE, RED, Crossing, EnterAndLeave
from tracking.baselines.particles.contour import (
    Outline,
    contour_cost,
    edge_distances,
    find_edges,
    spline_basis,
)
from tracking.baselines.particles.contour_particles import ContourParticles, ContourSettings
from tracking.baselines.particles.particle_filter import (
    ParticleFilters,
    resample_if_degenerate,
    reweight,
)
from tracking.baselines.stepwise import PredictionMethod
from tracking.boxes import iou
from tracking.detectors.base import Image


@pytest.mark.parametrize("derivative", [False, True])
def test_the_basis_is_that_of_a_closed_cubic_spline(derivative: bool) -> None:
    controls, samples = 7, 40
    points = np.random.default_rng(2).normal(size=(controls, 2))
    # A closed spline repeats its first control points; ours begins at the second knot.
    wrapped = points[(np.arange(controls + 3) - 1) % controls]
    spline = BSpline(np.arange(-3, controls + 4), wrapped, 3)
    place = np.arange(samples) * controls / samples
    expected = spline.derivative()(place) if derivative else spline(place)
    assert spline_basis(controls, samples, derivative=derivative) @ points == pytest.approx(expected)


def test_normals_point_out_of_the_body_and_the_outline_fills_its_box() -> None:
    outline = Outline.of_body(0.4, 64)
    outside = outline.points + 0.01 * outline.normals
    area = cv2.contourArea(outline.points.astype(np.float32))
    assert cv2.contourArea(outside.astype(np.float32)) > area
    assert outline.points.min(axis=0) == pytest.approx([-0.2, -0.5], abs=0.03)
    assert outline.points.max(axis=0) == pytest.approx([0.2, 0.5], abs=0.03)
    assert np.hypot(*outline.normals.T) == pytest.approx(1.0)


@given(st.integers(0, 2000))
@settings(deadline=None, max_examples=30)
def test_the_nearest_edge_on_each_normal_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges = rng.random((40, 50)) < 0.1
    outline, reach, steps = Outline.of_body(0.4, 9), 0.2, 5
    centers, heights = rng.uniform(-5, 50, (4, 2)), rng.uniform(10, 40, 4)
    found = edge_distances(edges, outline, centers, heights, reach, steps)
    for particle, row in enumerate(found):
        for point, normal, distance in zip(outline.points, outline.normals, row, strict=True):
            hits = []
            for step in range(-steps, steps + 1):
                offset = step * reach / steps
                x, y = centers[particle] + heights[particle] * (point + offset * normal)
                column, line = floor(x), floor(y)
                if 0 <= column < 50 and 0 <= line < 40 and edges[line, column]:
                    hits.append(abs(offset))
            assert abs(distance) == pytest.approx(min(hits, default=np.inf))


def test_the_cost_is_the_truncated_mean_square() -> None:
    assert float(contour_cost(np.array([0.0, 0.04, -0.08, np.inf]), 0.08)) == pytest.approx((0.25 + 2.0) / 4)


def _ellipse(x: float) -> Image:
    """Return a picture of a light body on a dark, cluttered ground."""
    image = np.random.default_rng(3).integers(40, 90, (90, 120, 3)).astype(np.uint8)
    points = (Outline.of_body(0.4, 60).points * 50 + [x, 45]).astype(np.int32)
    cv2.fillPoly(image, [points], (220, 220, 220))
    return image


def test_the_particles_have_the_exact_posterior_on_a_grid() -> None:
    """Columns 20 to 100, steps of -3 to 3 pixels: the filter against the forward sum over all columns."""
    rng, columns, reach = np.random.default_rng(4), np.arange(20, 101), 0.08
    outline, sharpness = Outline.of_body(0.4, 32), 6.0
    exact = (np.abs(columns - 50) < 8).astype(float)
    exact /= exact.sum()
    states = rng.choice(columns, 6000, p=exact).astype(float)
    weights = np.full(len(states), 1.0 / len(states))
    for frame in range(4):
        edges = find_edges(_ellipse(52.0 + 2 * frame))

        def costs(places: np.ndarray, seen: np.ndarray = edges) -> np.ndarray:
            centers = np.stack([places, np.full(len(places), 45.0)], axis=1)
            return contour_cost(
                edge_distances(seen, outline, centers, np.full(len(places), 50.0), reach, 8), reach
            )

        likelihood = [exp(-sharpness * cost) for cost in costs(columns.astype(float))]
        moved = np.zeros_like(exact)
        for step in range(-3, 4):
            np.add.at(moved, np.clip(np.arange(len(columns)) + step, 0, len(columns) - 1), exact / 7)
        exact = moved * likelihood
        exact /= exact.sum()
        resampled, weights = resample_if_degenerate(rng, states[:, None], weights)
        states = np.clip(resampled[:, 0] + rng.integers(-3, 4, len(states)), 20, 100)
        weights = reweight(weights, costs(states), sharpness)
    found = np.bincount(states.astype(int) - 20, weights, minlength=len(columns))
    assert np.abs(found - exact).sum() / 2 < 0.06
    assert columns[exact.argmax()] == pytest.approx(58, abs=2)


def _follow(method: PredictionMethod[Any], dim: float) -> bool:
    """Track a person while the light falls to a share of its brightness; return whether they are found."""
    scene = EnterAndLeave((RED, BLUE))
    target = method.initialize(scene.picture(0), scene.where(0, 0))
    for frame in range(1, 35):
        light = 1.0 - (1.0 - dim) * min(frame / 10, 1.0)
        method.predict((scene.picture(frame) * light).astype(np.uint8), [target])
    return float(iou(target.box, scene.where(0, 34))) > 0.5


def test_an_outline_is_followed_while_the_light_changes_where_colors_fail() -> None:
    assert _follow(ContourParticles(), 0.35)
    assert not _follow(ParticleFilters(), 0.35)


def test_a_target_without_edges_is_lost() -> None:
    scene, method = Crossing((RED,)), ContourParticles()
    target = method.initialize(scene.picture(0), scene.where(0, 0))
    assert not np.isnan(method.predict(scene.picture(1), [target])).any()
    flat = np.full_like(scene.picture(0), 100)
    assert np.isnan(method.predict(flat, [target])).all()


@pytest.mark.parametrize("wrong", [{"particles": 0}, {"normals": 0}, {"reach": 0.0}, {"deviation": 0.0}])
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        ContourSettings(**wrong)  # type: ignore[arg-type]
