"""Access control of the bus: what each zenoh user may publish and subscribe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class _Subject:
    """Some users, the rules that hold for them alone, and the names of further ones that hold for them."""

    name: str
    users: Sequence[str]
    own_rules: Sequence[Mapping[str, Any]] = ()
    shared_rules: Sequence[str] = ()


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
    services = [bestview_client_name(index) for index in range(_MAX_SERVICES)]
    others = [user for user in users if user not in {*cameras, *services}]
    sites = [user for user in others if is_site_user(user)]
    listeners = [user for user in others if user not in sites]
    shared = _rules_of_all_cameras(keys)
    camera_subjects = [
        _camera(
            keys, camera, sends_audio=camera == audio_sender, shared_rules=[rule["id"] for rule in shared]
        )
        for camera in cameras
    ]
    subjects = [
        _services(keys, services),
        *([_listeners(keys, listeners)] if listeners else []),
        *([_sites(keys, sites)] if sites else []),
        *camera_subjects,
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*shared, *(rule for subject in subjects for rule in subject.own_rules)],
        "subjects": [{"id": subject.name, "usernames": subject.users} for subject in subjects],
        "policies": [
            {
                "rules": [*(rule["id"] for rule in subject.own_rules), *subject.shared_rules],
                "subjects": [subject.name],
            }
            for subject in subjects
        ],
    }


def _services(keys: ZenohKeys, users: Sequence[str]) -> _Subject:
    rule = _rule("services", "both", [*_SEND, *_SUBSCRIBE, *_EXCHANGE], [keys.everything])
    return _Subject("services", users, [rule])


def _listeners(keys: ZenohKeys, users: Sequence[str]) -> _Subject:
    rules = [
        _rule("may subscribe to all", "ingress", _SUBSCRIBE, [keys.everything]),
        _rule("receives all", "egress", _FORWARD, [keys.everything]),
    ]
    return _Subject("listeners", users, rules)


def _sites(keys: ZenohKeys, users: Sequence[str]) -> _Subject:
    people = [keys.bestview("**/people")]
    rules = [
        _rule("may subscribe to people", "ingress", ["declare_subscriber"], people),
        _rule("receives people", "egress", ["put"], people),
    ]
    return _Subject("sites", users, rules)


def _camera(keys: ZenohKeys, camera: str, *, sends_audio: bool, shared_rules: Sequence[str]) -> _Subject:
    name = f"camera {camera}"
    commands = [keys.camera(camera, command) for command in _COMMANDS]
    rules = [
        _rule(name, "ingress", _SEND, [keys.camera(camera, "**"), *([keys.sound] if sends_audio else [])]),
        _rule(f"{name} may subscribe to commands", "ingress", ["declare_subscriber"], commands),
        _rule(f"{name} receives commands", "egress", ["put"], commands),
    ]
    return _Subject(name, [camera], rules, shared_rules)


def _rules_of_all_cameras(keys: ZenohKeys) -> list[dict[str, Any]]:
    detections = [keys.camera("*", "detections")]
    alive = [keys.camera("*", "peer_listener"), keys.bestview("**")]
    commands = [keys.camera("*", command) for command in _COMMANDS]
    return [
        _rule("may not command cameras", "ingress", ["put", "delete"], commands, "deny"),
        _rule("may subscribe to peers", "ingress", ["declare_subscriber"], detections),
        _rule("receives peers", "egress", ["put", "delete"], detections),
        _rule("may watch peers and services", "ingress", _WATCH, alive),
        _rule("watches peers and services", "egress", ["liveliness_token"], alive),
        _rule("learns subscriptions", "egress", ["declare_subscriber"], [keys.everything]),
    ]


def _rule(
    name: str, direction: str, messages: Sequence[str], keys: Sequence[str], permission: str = "allow"
) -> dict[str, Any]:
    flows = ["ingress", "egress"] if direction == "both" else [direction]
    return {"id": name, "permission": permission, "flows": flows, "messages": messages, "key_exprs": keys}
