"""The configuration on the operator's page, and trial settings of view selection."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

import numpy as np
import pytest
import yaml

from bestview.quality import QualitySettings
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import (
    CAMERAS,
    LARGE,
    SMALL,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    small_config,
)
from server.config.sections import ViewSettings
from server.config.site_config import Config
from server.http.access.csrf import CSRF_HEADER
from server.http.operator.settings import settings_of
from server.service.view_selection.decider import ViewDecider

CHOOSING = "/api/operator/view_selection"
MINE = {CSRF_HEADER: "1"}
WIDE = {"site": {"width": 128, "height": 96}}


async def put(served: ServedSite, json: Any) -> tuple[int, Any]:
    async with served.session.put(CHOOSING, headers=MINE, json=json) as answer:
        return answer.status, await answer.json()


def decided(config: Config, tuned: ViewSettings | None = None, after: int = 0) -> list[Any]:
    """Return the decisions for two people who are larger in alternating cameras."""
    decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
    decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    decisions = []
    for number in range(12):
        if tuned is not None and number == after:
            decider.apply_live_view_settings(tuned)
        one, other = (SMALL, LARGE) if number // 3 % 2 else (LARGE, SMALL)
        messages = [
            camera_tracks(A, number, {1: one, 2: SMALL}),
            camera_tracks(B, number, {1: other, 2: one}),
        ]
        decisions += decider.step(epoch_of(number, *messages))
    return decisions


TRIED = small_config(view={"switch_cost_s": 3.0, "quality": {"centering": 0.7, "size": 0.0}}).view


def test_settings_tuned_before_the_start_equal_configured_ones() -> None:
    config = small_config()
    so = config.model_copy(update={"view": TRIED.model_copy(update={"identity": config.view.identity})})
    assert decided(config, TRIED) == decided(so)
    assert decided(config, TRIED) != decided(config)


def test_settings_tuned_while_running_apply_from_the_next_gop_on_to_buffered_views_too() -> None:
    config = small_config()
    tuned, before = decided(config, TRIED, after=6), decided(config)
    settled = sum(decision.first < 5 * 5 for decision in tuned)
    assert tuned[: settled - 1] == before[: settled - 1]
    so = config.model_copy(update={"view": TRIED.model_copy(update={"identity": config.view.identity})})
    for actual, expected in zip(tuned[settled:], decided(so)[settled:], strict=True):
        for person in (1, 2):
            actual_reasons, expected_reasons = actual.reasons.of(person), expected.reasons.of(person)
            assert actual_reasons.weights == expected_reasons.weights
            assert actual_reasons.switch_cost == expected_reasons.switch_cost
            for camera in CAMERAS:
                assert actual_reasons.views[camera].quality == pytest.approx(
                    expected_reasons.views[camera].quality
                )
                assert actual_reasons.views[camera].terms == pytest.approx(
                    expected_reasons.views[camera].terms
                )


def test_settings_can_be_tuned_back() -> None:
    config = small_config()
    decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
    decider.apply_live_view_settings(TRIED)
    assert decider.view.lookahead_s == config.view.lookahead_s
    assert decider.view.identity == config.view.identity
    decider.apply_live_view_settings(config.view)
    assert decider.view == config.view
    assert np.isclose(decider.switch_cost, 1.0)


async def test_trial_settings_are_in_force_at_once_with_configuration_lines(
    site_with_people: ServedSite,
) -> None:
    at_first = await site_with_people.get_json(CHOOSING)
    assert at_first["values"] == at_first["file"]
    status, tried = await put(
        site_with_people, {"switch_cost_s": 2, "quality.facing": 0.5, "quality.relative": False}
    )
    assert status == 200
    assert tried == await site_with_people.get_json(CHOOSING)
    assert tried["file"] == at_first["file"]
    assert site_with_people.service.decider.switch_cost == 50.0
    assert yaml.safe_load(tried["lines"]) == {
        "view": {"lookahead_s": 0.4, "switch_cost_s": 2.0, "quality": {"facing": 0.5, "relative": False}}
    }
    small_config(view=yaml.safe_load(tried["lines"])["view"])  # they are lines of a configuration
    site_with_people.service.feed(3, {A: {1: SMALL}, B: {1: LARGE}})
    assert (await site_with_people.get_json("/api/objects/1/choice"))["switch_cost_s"] == 2.0
    async with site_with_people.session.delete(CHOOSING, headers=MINE) as answer:
        assert await answer.json() == at_first


@pytest.mark.parametrize(
    ("json", "error"),
    [
        ({"switch_cost_s": -1}, "to try out: view.switch_cost_s: "),
        ({"switch_cost_s": 1e308}, "to try out: view.switch_cost_s: Input should be less than or equal to"),
        ({"min_shot_s": 1e6}, "to try out: view.min_shot_s: Input should be less than or equal to 600"),
        ({"quality.size": 2}, "to try out: view.quality: the weight size"),
        ({"buffer_s": 30}, "view.buffer_s: cannot be changed here; these can: lookahead_s, switch_cost_s, "),
        ({"switch_cost": 1}, "view.switch_cost: cannot be changed here"),
        ({"switch_cost_s": "1"}, "the request's JSON: "),
        ([], "the request's JSON: "),
    ],
)
async def test_invalid_trial_settings_change_nothing(
    site_with_people: ServedSite, json: Any, error: str
) -> None:
    status, response = await put(site_with_people, json)
    assert status == 400
    assert response["error"].startswith(error)
    assert "\n" not in response["error"]
    assert site_with_people.service.decider.view == site_with_people.service.config.view


@pytest.fixture
async def open_hall() -> AsyncIterator[ServedSite]:
    cameras = [
        {
            "id": A,
            "source": "rtsp://user:pa@ss@10.0.0.1/live?token=abc&size=1",
            "options": {
                "headers": "Cookie: 1",
                "http_proxy": "http://me:hush@proxy",
                "rtsp_transport": "tcp",
            },
        },
        B,
    ]
    async with aclosing(serve_site(cameras=cameras)) as sites:
        yield await anext(sites)


async def test_the_configuration_shows_differences_and_no_secrets(open_hall: ServedSite) -> None:
    settings = {
        setting["key"]: setting for setting in (await open_hall.get_json("/api/operator/config"))["settings"]
    }
    assert settings["encode.gop_s"] == {
        "key": "encode.gop_s",
        "value": "0.2",
        "default": "0.4",
        "differs": True,
    }
    assert settings["view.quality.truncation"]["differs"] is False
    assert settings["view.quality.truncation"]["value"] == str(QualitySettings().truncation)
    source, options = settings[f"cameras.{A}.source"], settings[f"cameras.{A}.options"]
    assert source["value"] == "rtsp://10.0.0.1/..."
    assert (source["default"], source["differs"]) == (None, False)
    names = ("headers", "http_proxy", "rtsp_transport")
    assert options["value"] == f"{{{', '.join(f'{name}: (not shown)' for name in names)}}}"


def test_letters_of_any_language_are_shown_as_they_are() -> None:
    config = small_config(cameras=[{"id": A, "source": "Straße/über.mp4"}])
    [shown] = [setting.value for setting in settings_of(config) if setting.key == f"cameras.{A}.source"]
    assert shown.endswith("/Straße/über.mp4")


@pytest.mark.parametrize(
    "source",
    [
        "rtsp://10.0.0.1/live?usr=admin&pwd=hush&size=1",
        "http://10.0.0.1/video.cgi?loginuse=admin&loginpas=hush",
        "rtsp://10.0.0.1:554/user=admin_password=hush_channel=1.sdp?real_stream",
    ],
)
def test_a_password_is_hidden_wherever_a_source_has_it(source: str) -> None:
    config = small_config(cameras=[{"id": A, "source": source}])
    [shown] = [setting.value for setting in settings_of(config) if setting.key == f"cameras.{A}.source"]
    assert shown.strip("'") in {"rtsp://10.0.0.1/...", "http://10.0.0.1/...", "rtsp://10.0.0.1:554/..."}
