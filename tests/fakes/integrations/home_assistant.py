"""What Home Assistant accepts as an MQTT discovery message of a device.

After its documentation (https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery and the pages of each
platform): the keys that are required, and all that are known.
"""

from __future__ import annotations

import re
from typing import Any

_ENTITY = {
    "platform",
    "name",
    "unique_id",
    "icon",
    "device_class",
    "entity_category",
    "json_attributes_topic",
    "json_attributes_template",
    "value_template",
    "enabled_by_default",
    "qos",
}
_PLATFORMS: dict[str, tuple[set[str], set[str]]] = {
    "sensor": ({"state_topic"}, {"state_class", "unit_of_measurement", "options", "expire_after"}),
    "binary_sensor": ({"state_topic"}, {"payload_on", "payload_off", "off_delay", "expire_after"}),
    "switch": ({"command_topic"}, {"state_topic", "payload_on", "payload_off", "state_on", "state_off"}),
    "event": ({"state_topic", "event_types"}, set()),
    "image": ({"image_topic"}, {"content_type", "image_encoding"}),
    "camera": ({"topic"}, {"image_encoding"}),
}
"""By platform: the keys that it needs, and further ones that it knows."""
_CLASSES = {
    "sensor": {"enum"},
    "binary_sensor": {"presence", "problem", "occupancy", "running", "motion"},
    "event": {"motion", "button", "doorbell"},
}
_DEVICE = {"identifiers", "name", "manufacturer", "model", "sw_version", "via_device", "configuration_url"}
_TOPIC = re.compile(r"homeassistant/device/[a-zA-Z0-9_-]+/config")


def problems_of(topic: str, message: dict[str, Any]) -> list[str]:
    """Return what Home Assistant would refuse, or ignore, in a discovery message."""
    found = [] if _TOPIC.fullmatch(topic) else [f"{topic}: not a discovery topic of a device"]
    found += [f"{key} is missing" for key in ("device", "origin", "components") if key not in message]
    known = {"device", "origin", "components", "availability_topic", "state_topic", "command_topic", "qos"}
    found += [f"{key}: unknown" for key in message.keys() - known]
    device = message.get("device", {})
    found += [f"device.{key}: unknown" for key in device.keys() - _DEVICE]
    if not device.get("identifiers"):
        found.append("device.identifiers is missing")
    if not message.get("origin", {}).get("name"):
        found.append("origin.name is missing")
    for name, component in message.get("components", {}).items():
        found += [f"{name}: {problem}" for problem in _problems_of_component(component)]
    return found


def _problems_of_component(component: dict[str, Any]) -> list[str]:
    platform = component.get("platform", "")
    if platform not in _PLATFORMS:
        return [f"platform {platform!r} is unknown"]
    needed, known = _PLATFORMS[platform]
    found = [f"{key} is missing" for key in sorted((needed | {"unique_id", "name"}) - component.keys())]
    found += [f"{key}: unknown" for key in component.keys() - _ENTITY - needed - known]
    device_class = component.get("device_class")
    if device_class is not None and device_class not in _CLASSES.get(platform, set()):
        found.append(f"device_class {device_class!r} is unknown")
    if (device_class == "enum") != ("options" in component):
        found.append("options are for enum alone")
    if any(
        "+" in str(value) or "#" in str(value) for key, value in component.items() if key.endswith("topic")
    ):
        found.append("a topic has a wildcard")
    if platform == "event" and "value_template" in component:
        found.append("an event is JSON with event_type")
    return found
