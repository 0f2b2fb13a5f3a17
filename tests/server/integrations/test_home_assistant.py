"""Discovery messages are as Home Assistant documents them; states are what they refer to."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.integrations.home_assistant import problems_of
from server.integrations.mqtt.discovery import discovery_messages, without_removed
from server.integrations.mqtt.site_state import (
    PublishedCamera,
    PublishedPerson,
    PublishedRule,
    SiteState,
    Topics,
    person_key,
    state_messages,
)

TOPICS = Topics("myview", "hall")
STATE = SiteState(
    site="hall",
    people=3,
    persons=[PublishedPerson("Ann", 3, is_present=True, camera="c1", zones=("till",)), PublishedPerson("Bé")],
    cameras=[PublishedCamera("c0", "live", "clear"), PublishedCamera("c1", "gone", "clear")],
    zones={"till": 2},
    rules=[
        PublishedRule("in", "entered", is_lasting=False),
        PublishedRule("door", "crossed", is_lasting=False),
        PublishedRule("queue", "crowded", is_lasting=True),
    ],
    recording=True,
)


def messages(state: SiteState = STATE, **settings: Any) -> dict[str, dict[str, Any]]:
    return discovery_messages(state, TOPICS, "homeassistant", **settings)


def test_home_assistant_accepts_all_messages() -> None:
    for settings in ({}, {"may_operate": True, "url": "https://hall.example/"}):
        told = messages(**settings)
        assert len(told) == 1 + 2 + 2, "the site, two cameras, two named people"
        assert [problem for topic, message in told.items() for problem in problems_of(topic, message)] == []


def test_ids_are_unique() -> None:
    ids = [part["unique_id"] for message in messages().values() for part in message["components"].values()]
    assert len(ids) == len(set(ids))
    assert all(re.fullmatch(r"[a-zA-Z0-9_-]+", each) for each in ids)


def test_what_is_discovered_is_published() -> None:
    """Every state topic has a retained message, in which the template's key exists."""
    published = state_messages(STATE, TOPICS)
    for message in messages().values():
        for name, part in message["components"].items():
            if part["platform"] in {"event", "image", "camera"}:
                continue
            content = published[part["state_topic"]]
            keys = re.findall(r"\w+", part.get("value_template", "").replace("value_json", ""))
            if not keys:
                assert content in {b"ON", b"OFF"}
                continue
            value = json.loads(content)
            for key in keys:
                assert key in value, name
                value = value[key]


def test_states_of_a_person() -> None:
    published = state_messages(STATE, TOPICS)
    ann, be = (json.loads(published[TOPICS.person(person_key(name))]) for name in ("Ann", "Bé"))
    assert ann == {"presence": "ON", "zone": "till", "camera": "c1", "object": 3}
    assert be == {"presence": "OFF", "zone": None, "camera": None, "object": None}
    assert json.loads(published[TOPICS.camera("c1")])["problem"] == "ON"
    assert published[TOPICS.rule("queue")] == b"ON"
    assert TOPICS.rule("in") not in published


@pytest.mark.parametrize(
    ("camera", "problem"),
    [
        (PublishedCamera("c0", "live", "clear"), "OFF"),
        (PublishedCamera("c0", "live", "blurred"), "ON"),
        (PublishedCamera("c0", "live", "clear", 0.3), "ON"),
    ],
)
def test_a_camera_that_does_not_show_all_has_a_problem(camera: PublishedCamera, problem: str) -> None:
    published = state_messages(replace(STATE, cameras=[camera]), TOPICS)
    assert json.loads(published[TOPICS.camera("c0")])["problem"] == problem


def test_a_site_that_does_not_record_has_no_switch() -> None:
    told = messages(replace(STATE, recording=None), may_operate=True)
    assert "recording" not in told["homeassistant/device/myview_hall/config"]["components"]


def test_only_who_may_operate_gets_a_switch() -> None:
    for may_operate, platform in ((False, "binary_sensor"), (True, "switch")):
        site = messages(may_operate=may_operate)["homeassistant/device/myview_hall/config"]
        assert site["components"]["recording"]["platform"] == platform


def test_removed_components_are_named_with_their_platform_alone() -> None:
    topic = "homeassistant/device/myview_hall/config"
    before, after = messages()[topic], messages(replace(STATE, rules=STATE.rules[:2]))[topic]
    removal = without_removed(before, after)
    assert removal is not None
    assert removal["components"]["rule_queue"] == {"platform": "binary_sensor"}
    assert removal["components"]["rule_in"] == after["components"]["rule_in"]
    assert without_removed(None, after) is None
    assert without_removed(after, after) is None


@given(st.text(min_size=1, max_size=40), st.text(min_size=1, max_size=40))
def test_names_become_levels_of_topics(one: str, other: str) -> None:
    assert re.fullmatch(r"[a-z0-9-]+", person_key(one))
    assert (person_key(one) == person_key(other)) == (one == other)
