"""Target for operator requests: nearly valid bodies to every address that takes one."""

from __future__ import annotations

from random import Random
from typing import Any

from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes, mutate_value
from benchmarks.fuzz.http.served_site import OpenSiteTarget
from server.http.access.csrf import CSRF_HEADER

_PAIR = {"image": [1, 2.5], "floor": [3, 4], "name": "pillar"}
_REQUESTS: tuple[tuple[str, str, Any], ...] = (
    ("POST", "/api/operator/people", {"object": 1, "name": "Ada"}),
    ("POST", "/api/operator/people", {"object": 1, "merge": 2}),
    ("POST", "/api/operator/people", {"object": 1, "split": ["c0", "c1"]}),
    (
        "POST",
        "/api/operator/position_corrections",
        {"object": 1, "camera": "c0", "corrections": [{"pulse": 12, "x": 9.5, "y": 20.0, "tolerance": 3.0}]},
    ),
    ("PUT", "/api/operator/view_selection", {"switch_cost_s": 0.2, "extrapolate_s": 0.5, "lookahead_s": 0.4}),
    (
        "PUT",
        "/api/operator/view_selection",
        {"presence_decay_s": 1.0, "undetected_weight": 0.5, "quality": {"relative": 1.0}},
    ),
    ("DELETE", "/api/operator/view_selection", None),
    ("POST", "/api/operator/walk", {"action": "start"}),
    ("POST", "/api/operator/walk", {"action": "resume", "person": 1.75}),
    ("POST", "/api/operator/walk", {"action": "apply"}),
    ("DELETE", "/api/operator/walk", None),
    (
        "POST",
        "/api/operator/marked_points",
        {"action": "apply", "points": {"unit": "m", "cameras": {"c0": [_PAIR] * 4}}, "digest": ""},
    ),
    ("POST", "/api/operator/restart", {}),
    (
        "PUT",
        "/api/operator/zones",
        {
            "zone": "door",
            "camera": "c0",
            "line": [[1, 2], [8.5, 2]],
            "inner": [4, 9],
            "rules": [{"rule": "in", "kind": "crossed", "direction": "inward"}],
            "replaces": "door",
        },
    ),
    ("PUT", "/api/operator/zones", {"zone": "till", "area": [[0, 0], [9, 0], [9, 9]], "rules": []}),
    ("DELETE", "/api/operator/zones", {"zone": "till"}),
    ("POST", "/api/session", {"token": "secret"}),
    ("GET", "/api/operator/people", None),
    ("GET", "/api/operator/walk", None),
    ("GET", "/api/operator/view_selection", None),
    ("GET", "/api/operator/zones", None),
)
"""Without finishing a walk, which starts a process; other tests cover it."""


class OperatorRequests(OpenSiteTarget):
    """One request of an authorized operator; the effects of previous ones stay."""

    name = "http-operator"

    def make(self, rng: Random) -> bytes:
        """Return the bytes of a request."""
        method, path, content = rng.choice(_REQUESTS)
        body = b""
        if content is not None:
            body = as_json(mutate_value(rng, content) if rng.random() < 0.85 else content)
        if rng.random() < 0.15:
            body = mutate_bytes(rng, body)
        head = (
            f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n{CSRF_HEADER}: 1\r\nConnection: close\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        return head.encode() + body
