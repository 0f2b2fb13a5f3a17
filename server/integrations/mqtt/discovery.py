"""Home Assistant's MQTT discovery: a device for the site, each camera and each named person.

After https://www.home-assistant.io/integrations/mqtt/#discovery-messages: one retained message per device at
``PREFIX/device/OBJECT_ID/config``, with the keys ``device``, ``origin`` and ``components``.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Any, get_args

from server.integrations.mqtt.site_state import PublishedPerson, PublishedRule, SiteState, Topics
from tracking.types import PictureCondition

_CAMERA_STATES = ["starting", "live", "gone", "ended", "refused"]
_CONDITIONS = list(get_args(PictureCondition))
_EVENT_TYPES = ["entered", "left", "inward", "outward"]
_HOME = "https://github.com/myview/myview"

Components = dict[str, dict[str, Any]]


def discovery_messages(
    state: SiteState, topics: Topics, prefix: str, *, url: str | None = None, may_operate: bool = False
) -> dict[str, dict[str, Any]]:
    """Return the discovery messages of a site, or of one of its areas, by topic.

    ``url`` is the page's address, for links; ``may_operate``: recording is a switch, not a sensor.
    """
    site_id = f"myview_{state.site}"
    own_id, own_name = site_id, state.site
    if topics.area is not None:
        own_id, own_name = f"{site_id}_area_{topics.area}", f"{state.site} area {topics.area}"

    def device(key: str, name: str, model: str, components: Components) -> tuple[str, dict[str, Any]]:
        about: dict[str, Any] = {
            "identifiers": [key],
            "name": name,
            "manufacturer": "MyView",
            "model": model,
            "sw_version": version("myview"),
        }
        if key != own_id:
            about["via_device"] = own_id
        if url is not None:
            about["configuration_url"] = url
        for component, settings in components.items():
            settings["unique_id"] = f"{key}_{component}"
        message = {
            "device": about,
            "origin": {"name": "MyView", "sw_version": version("myview"), "support_url": _HOME},
            "availability_topic": topics.status,
            "qos": 1,
            "components": components,
        }
        return _device_topic(prefix, key), message

    model = "Site" if topics.area is None else "Area"
    messages = dict([device(own_id, own_name, model, _site(state, topics, may_operate=may_operate))])
    for camera in state.cameras:
        key, name = f"{site_id}_camera_{camera.camera}", f"{state.site} {camera.camera}"
        topic, message = device(key, name, "Camera", _camera(topics.camera(camera.camera)))
        messages[topic] = message
    for person in state.persons:
        key = _person_id(topics, person.key)
        topic, message = device(key, person.name, "Person", _person(person, topics, state))
        messages[topic] = message
    return messages


def person_discovery(topics: Topics, key: str, prefix: str) -> str:
    """Return the topic of a named person's discovery message."""
    return _device_topic(prefix, _person_id(topics, key))


def _person_id(topics: Topics, key: str) -> str:
    return f"myview_{topics.site}_person_{key}"


def _device_topic(prefix: str, key: str) -> str:
    return f"{prefix}/device/{key}/config"


def _sensor(name: str, topic: str, key: str, **settings: Any) -> dict[str, Any]:
    return {
        "platform": "sensor",
        "name": name,
        "state_topic": topic,
        "value_template": f"{{{{ value_json{key} }}}}",
        **settings,
    }


def _site(state: SiteState, topics: Topics, *, may_operate: bool) -> Components:
    components: Components = {
        "people": _sensor(
            "People", topics.state, ".people", state_class="measurement", icon="mdi:account-group"
        )
    }
    for zone in state.zones:
        components[f"zone_{zone}"] = _sensor(
            f"People in {zone}", topics.state, f"['zones']['{zone}']", state_class="measurement"
        )
    for rule in state.rules:
        components |= _rule(rule, topics)
    if state.recording is not None:
        components["recording"] = {
            "platform": "switch" if may_operate else "binary_sensor",
            "name": "Recording",
            "state_topic": topics.state,
            "value_template": "{{ value_json.recording }}",
            **({"command_topic": topics.recording_command} if may_operate else {"device_class": "running"}),
        }
    return components


def _rule(rule: PublishedRule, topics: Topics) -> Components:
    picture = {
        "platform": "image",
        "name": f"{rule.rule} picture",
        "image_topic": topics.rule_picture(rule.rule),
        "content_type": "image/jpeg",
    }
    if rule.is_momentary:
        told: dict[str, Any] = {
            "platform": "event",
            "name": rule.rule,
            "state_topic": topics.rule_event(rule.rule),
            "event_types": _EVENT_TYPES,
            "device_class": "motion",
        }
    else:
        told = {
            "platform": "binary_sensor",
            "name": rule.rule,
            "state_topic": topics.rule(rule.rule),
            "device_class": "occupancy",
        }
    return {f"rule_{rule.rule}": told, f"rule_{rule.rule}_picture": picture}


def _camera(topic: str) -> Components:
    return {
        "state": _sensor("State", topic, ".state", device_class="enum", options=_CAMERA_STATES),
        "condition": _sensor("Picture", topic, ".condition", device_class="enum", options=_CONDITIONS),
        "problem": {
            "platform": "binary_sensor",
            "name": "Problem",
            "state_topic": topic,
            "value_template": "{{ value_json.problem }}",
            "device_class": "problem",
        },
    }


def _person(person: PublishedPerson, topics: Topics, state: SiteState) -> Components:
    topic = topics.person(person.key)
    components: Components = {
        "presence": {
            "platform": "binary_sensor",
            "name": "Presence",
            "state_topic": topic,
            "value_template": "{{ value_json.presence }}",
            "device_class": "presence",
            "json_attributes_topic": topic,
        },
        "camera": _sensor("Best camera", topic, ".camera", icon="mdi:cctv"),
        "best_view": {"platform": "camera", "name": "Best view", "topic": topics.person_picture(person.key)},
    }
    if state.zones:
        components["zone"] = _sensor("Zone", topic, ".zone", icon="mdi:map-marker")
    return components


def without_removed(before: dict[str, Any] | None, after: dict[str, Any]) -> dict[str, Any] | None:
    """Return the message that removes components that a device no longer has; None: it has all.

    Home Assistant removes a component of which a message has nothing but the platform.
    """
    removed = {} if before is None else before["components"].keys() - after["components"].keys()
    if before is None or not removed:
        return None
    gone = {name: {"platform": before["components"][name]["platform"]} for name in removed}
    return {**after, "components": {**after["components"], **gone}}
