"""Access control of the bus: what each zenoh user may publish and subscribe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from server.config.password_file import read_users
from server.config.pulse_access import bestview_client_name
from server.config.sections import is_site_user
from server.config.site_config import Config
from server.messaging.messages import ZenohKeys

SETTING = "zenoh.users"
_SEND = ["put", "delete", "liveliness_token"]
_WATCH = ["declare_liveliness_subscriber", "liveliness_query"]
_SUBSCRIBE = ["declare_subscriber", *_WATCH]
_EXCHANGE = ["query", "reply", "declare_queryable"]
_FORWARD = [*_SEND, "declare_subscriber"]
"""What the router forwards: messages, liveliness tokens, and subscriptions."""
_COMMANDS = ("position_corrections", "identities", "end_received")
"""Messages of best-view services to a camera, under its key."""
_MAX_SERVICES = 64
"""Best-view services of a site, at most."""


def access_control_of(config: Config) -> dict[str, Any] | None:
    """Return the access rules of a site's bus; None: without users, every client may do everything.

    Raises:
        UserError: the password file cannot be read.
    """
    if config.zenoh.users is None:
        return None
    users = list(read_users(config.zenoh.users, SETTING))
    return build_access_control(config.site.name, config.site_camera_ids, config.audio_sender, users)


def build_access_control(
    site: str, cameras: Sequence[str], audio_sender: str | None, users: Sequence[str]
) -> dict[str, Any]:
    """Build zenoh's ``access_control``; everything not allowed is denied.

    A camera publishes under its own key, and the site's audio if it is the audio camera. It receives the
    other cameras' detections, and the best-view services' messages to it, but not their choices, which tell
    where everybody is. Other best-view services may do everything. A user `site-NAME` is another site, and
    receives what it is told about people. Any other user may subscribe to everything and send nothing.
    """
    keys = ZenohKeys(site)
    everything = f"myview/{site}/**"
    detections = [keys.camera("*", "detections")]
    alive = [keys.camera("*", "peer_listener"), keys.bestview("**")]
    rules = [
        _rule("services", "both", [*_SEND, *_SUBSCRIBE, *_EXCHANGE], [everything]),
        _rule("may subscribe to all", "ingress", _SUBSCRIBE, [everything]),
        _rule("receives all", "egress", _FORWARD, [everything]),
        _rule("may subscribe to peers", "ingress", ["declare_subscriber"], detections),
        _rule("receives peers", "egress", ["put", "delete"], detections),
        _rule("may watch peers and services", "ingress", _WATCH, alive),
        _rule("watches peers and services", "egress", ["liveliness_token"], alive),
        _rule("learns subscriptions", "egress", ["declare_subscriber"], [everything]),
        _rule(
            "may not command cameras",
            "ingress",
            ["put", "delete"],
            [keys.camera("*", command) for command in _COMMANDS],
        )
        | {"permission": "deny"},
    ]
    service_names = [bestview_client_name(index) for index in range(_MAX_SERVICES)]
    listeners = [user for user in users if user not in {*cameras, *service_names}]
    sites = [user for user in listeners if is_site_user(user)]
    listeners = [user for user in listeners if user not in sites]
    subjects = [{"id": "services", "usernames": service_names}]
    policies = [{"rules": ["services"], "subjects": ["services"]}]
    if listeners:
        subjects.append({"id": "listeners", "usernames": listeners})
        policies.append({"rules": ["may subscribe to all", "receives all"], "subjects": ["listeners"]})
    if sites:
        people = [keys.bestview("**/people")]
        rules.append(_rule("may subscribe to people", "ingress", ["declare_subscriber"], people))
        rules.append(_rule("receives people", "egress", ["put"], people))
        subjects.append({"id": "sites", "usernames": sites})
        policies.append({"rules": ["may subscribe to people", "receives people"], "subjects": ["sites"]})
    for camera in cameras:
        publish_keys = [keys.camera(camera, "**"), *([keys.sound] if camera == audio_sender else [])]
        rules.append(_rule(f"camera {camera}", "ingress", _SEND, publish_keys))
        commands = [keys.camera(camera, command) for command in _COMMANDS]
        rules.append(
            _rule(f"camera {camera} may subscribe to commands", "ingress", ["declare_subscriber"], commands)
        )
        rules.append(_rule(f"camera {camera} receives commands", "egress", ["put"], commands))
        subjects.append({"id": f"camera {camera}", "usernames": [camera]})
        camera_rules = [
            f"camera {camera}{suffix}" for suffix in ("", " may subscribe to commands", " receives commands")
        ]
        camera_rules += [
            "may not command cameras",
            "may subscribe to peers",
            "receives peers",
            "may watch peers and services",
            "watches peers and services",
            "learns subscriptions",
        ]
        policies.append({"rules": camera_rules, "subjects": [f"camera {camera}"]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rule(
    name: str, direction: str, messages: Sequence[str], keys: Sequence[str], permission: str = "allow"
) -> dict[str, Any]:
    flows = ["ingress", "egress"] if direction == "both" else [direction]
    return {"id": name, "permission": permission, "flows": flows, "messages": messages, "key_exprs": keys}
