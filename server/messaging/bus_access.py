"""Access control of the bus: what each zenoh user may publish and subscribe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from server.config.password_file import read_users
from server.config.pulse_access import bestview_client_name
from server.config.site_config import Config
from server.messaging.messages import ZenohKeys

SETTING = "zenoh.users"
_SENDS = ["put", "delete", "liveliness_token"]
_ASKS = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
_PASSES = [*_SENDS, "declare_subscriber"]
"""What the router tells others: messages, who is there, and what somebody wants to hear."""
_TOLD = ("position_corrections", "identities")
"""What best-view services say to a camera, under its key."""
_SERVICES = 64
"""Best-view services that a site may have, beside the first."""


def access_control_of(config: Config) -> dict[str, Any] | None:
    """Return what each user of a site's bus may; None: whoever reaches it may everything.

    Raises:
        UserError: the users cannot be read.
    """
    if config.zenoh.users is None:
        return None
    users = list(read_users(config.zenoh.users, SETTING))
    return build_access_control(config.site.name, config.camera_ids, config.sounding, users)


def build_access_control(
    site: str, cameras: Sequence[str], sounding: str | None, users: Sequence[str]
) -> dict[str, Any]:
    """Return what each user may, as zenoh's ``access_control``: what is not said is denied.

    A camera sends under its own key, and the site's sound if it is the one. It hears what the others found,
    and what the best-view services alone say to it: where the operator points, and what to remember.
    Further best-view services may everything. Any other user may hear everything, and send nothing.
    """
    keys = ZenohKeys(site)
    everything = f"myview/{site}/**"
    found, hears, services = (
        keys.camera("*", "detections"),
        keys.camera("*", "peer_listener"),
        keys.bestview("**"),
    )
    rules = [
        _rule("services", "both", [*_SENDS, *_ASKS], [everything]),
        _rule("all is asked for", "ingress", _ASKS, [everything]),
        _rule("all is told", "egress", _PASSES, [everything]),
        _rule("others are asked for", "ingress", _ASKS, [found, hears, services]),
        _rule("others are told", "egress", _SENDS, [found, hears, services]),
        _rule("is asked for", "egress", ["declare_subscriber"], [everything]),
        _rule("tells cameras", "ingress", ["put", "delete"], [keys.camera("*", it) for it in _TOLD])
        | {"permission": "deny"},
    ]
    further = [bestview_client_name(index) for index in range(1, _SERVICES)]
    listeners = [it for it in users if it not in {*cameras, *further, bestview_client_name(0)}]
    subjects = [{"id": "services", "usernames": further}]
    policies = [{"rules": ["services"], "subjects": ["services"]}]
    if listeners:
        subjects.append({"id": "listeners", "usernames": listeners})
        policies.append({"rules": ["all is asked for", "all is told"], "subjects": ["listeners"]})
    for camera in cameras:
        own = [keys.camera(camera, "**"), *([keys.sound] if camera == sounding else [])]
        rules.append(_rule(f"camera {camera}", "ingress", _SENDS, own))
        told = [keys.camera(camera, it) for it in _TOLD]
        rules.append(_rule(f"camera {camera} asks", "ingress", ["declare_subscriber"], told))
        rules.append(_rule(f"camera {camera} is told", "egress", ["put"], told))
        subjects.append({"id": f"camera {camera}", "usernames": [camera]})
        theirs = [f"camera {camera}{what}" for what in ("", " asks", " is told")]
        theirs += ["tells cameras", "others are asked for", "others are told", "is asked for"]
        policies.append({"rules": theirs, "subjects": [f"camera {camera}"]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rule(
    name: str, way: str, messages: Sequence[str], keys: Sequence[str], permission: str = "allow"
) -> dict[str, Any]:
    flows = ["ingress", "egress"] if way == "both" else [way]
    return {"id": name, "permission": permission, "flows": flows, "messages": messages, "key_exprs": keys}
