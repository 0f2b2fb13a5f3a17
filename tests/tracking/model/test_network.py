"""The network of a window: the cost table of paper section II.B, cell by cell, and refused inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracking.appearance import appearance_distance_matrix
from tracking.model.network import Template, build_network, build_network_per_object
from tracking.model.settings import PAPER_COSTS
from tracking.types import Detections

SETTINGS = replace(PAPER_COSTS, appearance=0.5, displacement=0.01, change=0.3, occlusion=0.5)
LEFT, RIGHT = np.array([0.0, 0.0, 20.0, 50.0]), np.array([100.0, 0.0, 120.0, 50.0])
DARK, LIGHT = np.array([0.9, 0.1]), np.array([0.2, 0.8])
HIDDEN = -1


def seen(*boxes: np.ndarray, appearance: tuple[np.ndarray, ...] = ()) -> Detections:
    histograms = np.array(appearance) if appearance else np.tile(DARK, (len(boxes), 1))
    return Detections(np.array(boxes).reshape(-1, 4), np.ones(len(boxes)), histograms.reshape(len(boxes), 2))


def g(first: np.ndarray, second: np.ndarray) -> float:
    return float(appearance_distance_matrix(first[None], second[None])[0, 0])


def test_an_arc_between_observations_costs_appearance_change_and_displacement() -> None:
    frames = [seen(LEFT), seen(LEFT, RIGHT, appearance=(DARK, LIGHT))]
    network = build_network([Template(1, DARK, LEFT)], frames, SETTINGS)
    arc = network.pair[0, 0, 0, 1] + network.node[0, 1, 1]
    assert arc == pytest.approx(g(DARK, LIGHT) + 0.5 * g(DARK, LIGHT) + 0.01 * 100.0)


def test_an_arc_out_of_occlusion_costs_appearance_and_a_constant() -> None:
    network = build_network(
        [Template(1, DARK, LEFT)], [seen(LEFT), seen(RIGHT, appearance=(LIGHT,))], SETTINGS
    )
    assert network.pair[0, 0, HIDDEN, 0] + network.node[0, 1, 0] == pytest.approx(0.3 + g(DARK, LIGHT))


def test_arcs_into_occlusion_and_sink_cost_both_constants() -> None:
    network = build_network([Template(1, DARK, LEFT)], [seen(LEFT), seen(LEFT)], SETTINGS)
    into_occlusion = network.pair[0, 0, :, HIDDEN] + network.node[0, 1, HIDDEN]
    np.testing.assert_allclose(into_occlusion, 0.3 + 0.5)
    np.testing.assert_allclose(network.sink, 0.3 + 0.5)


def test_the_source_is_an_observation_or_an_occlusion() -> None:
    here, away = Template(1, DARK, LEFT), Template(2, DARK, None)
    network = build_network([here, away], [seen(RIGHT, appearance=(LIGHT,))], SETTINGS)
    first = network.source + network.node[:, 0]
    likeness = g(DARK, LIGHT)
    np.testing.assert_allclose(first[0], [likeness + 0.5 * likeness + 1.0, 0.8])
    np.testing.assert_allclose(first[1], [0.3 + likeness, 0.8])


def test_gated_arcs_do_not_exist_and_occlusion_is_never_gated() -> None:
    frames = [seen(LEFT), seen(LEFT, RIGHT)]
    network = build_network([Template(1, DARK, RIGHT)], frames, replace(SETTINGS, gate=50.0))
    assert np.isinf(network.pair[0, 0, 0, 1])
    assert np.isinf(network.source[0, 0])
    assert np.isfinite(network.pair[0, 0, :, HIDDEN]).all()
    assert np.isfinite(network.pair[0, 0, HIDDEN]).all()


def test_displacement_can_be_measured_in_box_heights() -> None:
    settings = replace(SETTINGS, displacement=1.0, displacement_unit="heights")
    small = build_network([Template(1, DARK, LEFT)], [seen(RIGHT)], settings)
    large = build_network([Template(1, DARK, 3 * LEFT)], [seen(3 * RIGHT)], settings)
    np.testing.assert_allclose(small.source, large.source)
    assert small.source[0, 0] == pytest.approx(100.0 / 50.0)


def test_low_confidence_costs_if_enabled() -> None:
    doubtful = Detections(LEFT[None], np.array([0.25]), DARK[None])
    network = build_network([Template(1, DARK, LEFT)], [doubtful], replace(SETTINGS, confidence=0.4))
    assert network.node[0, 0, 0] == pytest.approx(0.4 * 0.75)


def test_padding_is_not_selectable() -> None:
    network = build_network([Template(1, DARK, LEFT)], [seen(), seen(LEFT, RIGHT)], SETTINGS)
    assert np.isinf(network.node[0, 0, :2]).all()
    assert not network.conflicts[0].any()
    assert network.rows(0).size == 0


def test_unknown_appearance_costs_nothing() -> None:
    unknown = Template(1, np.empty(0), LEFT)
    network = build_network([unknown, Template(2, LIGHT, LEFT)], [seen(LEFT)], SETTINGS)
    assert network.node[0, 0, 0] == 0.0
    assert network.node[1, 0, 0] == pytest.approx(g(LIGHT, DARK))


def test_observations_per_object_belong_to_their_object() -> None:
    templates = [Template(1, DARK, LEFT), Template(2, DARK, RIGHT)]
    network = build_network_per_object(templates, [[seen(LEFT)], [seen(RIGHT)]], SETTINGS)
    np.testing.assert_allclose(network.source[:, 0], 0.0, atol=1e-7)
    assert not network.shared


def test_selected_objects_form_a_network() -> None:
    templates = [Template(n, DARK, LEFT + n) for n in range(3)]
    own = [[seen(LEFT + n), seen(LEFT + n, RIGHT)] for n in range(3)]
    part = build_network_per_object(templates, own, SETTINGS).select([2, 0])
    alone = build_network_per_object([templates[2], templates[0]], [own[2], own[0]], SETTINGS)
    for name in ("boxes", "source", "node", "pair", "sink", "conflicts", "locations"):
        np.testing.assert_array_equal(getattr(part, name), getattr(alone, name))


@pytest.mark.parametrize(
    ("templates", "frames", "message"),
    [
        ([], [], "at least one frame"),
        ([Template(1, np.ones(3) / 3, None)], [seen(LEFT)], "histograms of 2 bins"),
        ([], [seen(LEFT), Detections(LEFT[None], np.ones(1), np.ones((1, 1)))], "same number of bins"),
    ],
)
def test_inconsistent_inputs_are_refused(
    templates: list[Template], frames: list[Detections], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        build_network(templates, frames, SETTINGS)


def test_the_numbers_of_objects_and_observations_must_agree() -> None:
    with pytest.raises(ValueError, match="1 templates need as many"):
        build_network_per_object([Template(1, DARK, LEFT)], [], SETTINGS)


@pytest.mark.parametrize("name", ["appearance", "displacement", "change", "occlusion", "layout"])
def test_negative_costs_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        replace(PAPER_COSTS, **{name: -0.1})


@pytest.mark.parametrize("name", ["gate", "conflict_distance", "conflict_overlap"])
def test_empty_gates_and_thresholds_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        replace(PAPER_COSTS, **{name: 0.0})


def test_shapes_of_detections_and_templates_are_checked() -> None:
    with pytest.raises(ValueError, match="boxes of shape"):
        Detections(np.zeros((2, 4)), np.zeros(1), np.zeros((1, 0)))
    with pytest.raises(ValueError, match="histograms of shape"):
        Detections(np.zeros((1, 4)), np.zeros(1), np.zeros((2, 0)))
    with pytest.raises(ValueError, match="shape"):
        Template(1, np.zeros((1, 2)), None)
    with pytest.raises(ValueError, match="shape"):
        Template(1, np.zeros(2), np.zeros(3))
    assert len(Detections.empty(8)) == 0


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["boxes", "scores", "histograms"])
def test_numbers_that_are_not_finite_are_refused_with_the_detection_that_has_them(
    field: str, wrong: float
) -> None:
    numbers = {"boxes": np.zeros((3, 4)), "scores": np.ones(3), "histograms": np.ones((3, 1))}
    numbers[field].reshape(3, -1)[1, -1] = wrong
    with pytest.raises(ValueError, match=f"{field} are finite numbers: detection 1 "):
        Detections(**numbers)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_templates_that_are_not_finite_are_refused(wrong: float) -> None:
    box = np.array([0.0, 0.0, 10.0, wrong])
    with pytest.raises(ValueError, match="object 7"):
        Template(7, np.ones(1), box)
    with pytest.raises(ValueError, match="object 7"):
        Template(7, np.array([wrong]), None)
