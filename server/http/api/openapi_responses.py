"""The answers of each documented path, and the errors it may answer with, in the API description."""

from __future__ import annotations

import re
from typing import Any

import msgspec

from server.http.access.permissions import SESSION_PATH, Permission, permission_for
from server.http.access.session_routes import SessionInfo
from server.http.api.schema import Cameras, Delays, FlagList, Objects, Past, SiteInfo
from server.http.json_responses import Problem
from server.http.operator.schema import OPERATOR, OPERATOR_FILES, OPERATOR_RESULTS, TrialProgress
from server.http.streams.request_validation import CAMERA_QUERY, DELAY, OVERLAY, TIME_SHIFT
from server.service.facade.past_search import PastSearchResult
from server.service.facade.rules import Rules
from server.service.facade.view_selection import ViewSelection

SEARCH = "/api/past/search"
RECORDED_SPANS = {"/api/objects/{object}/past", "/api/cameras/{camera}/past"}
DELETION = "/api/operator/deletion"
_CORRECTIONS = "/api/operator/position_corrections"
_PEOPLE = "/api/operator/people"

JSON_ANSWERS: dict[str, type[msgspec.Struct]] = {
    "/api/site": SiteInfo,
    SESSION_PATH: SessionInfo,
    "/api/delays": Delays,
    "/api/objects": Objects,
    "/api/cameras": Cameras,
    "/api/flags": FlagList,
    "/api/rules": Rules,
    SEARCH: PastSearchResult,
    "/api/objects/{object}/choice": ViewSelection,
    "/api/objects/{object}/past": Past,
    "/api/cameras/{camera}/past": Past,
    **OPERATOR,
}
MEDIA_TYPES = {
    "/objects/{object}/best.mp4": "video/mp4",
    "/cameras/{camera}/live.mp4": "video/mp4",
    "/objects/{object}/best.webm": "video/webm",
    "/cameras/{camera}/live.webm": "video/webm",
    "/objects/{object}/best.ts": "video/mp2t",
    "/cameras/{camera}/live.ts": "video/mp2t",
    "/objects/{object}/hls/index.m3u8": "application/vnd.apple.mpegurl",
    "/objects/{object}/hls/init.mp4": "video/mp4",
    "/objects/{object}/hls/{segment}.m4s": "video/mp4",
    "/objects/{object}/hls/{segment}.{part}.m4s": "video/mp4",
    "/cameras/{camera}/hls/index.m3u8": "application/vnd.apple.mpegurl",
    "/cameras/{camera}/hls/init.mp4": "video/mp4",
    "/cameras/{camera}/hls/{segment}.m4s": "video/mp4",
    "/cameras/{camera}/hls/{segment}.{part}.m4s": "video/mp4",
    "/objects/{object}/best.mjpeg": "multipart/x-mixed-replace",
    "/cameras/{camera}/live.mjpeg": "multipart/x-mixed-replace",
    "/objects/{object}/best.jpg": "image/jpeg",
    "/cameras/{camera}/live.jpg": "image/jpeg",
    "/objects/{object}/thumb.jpg": "image/jpeg",
    "/objects/{object}/whep": "application/sdp",
    "/cameras/{camera}/whep": "application/sdp",
    "/objects/{object}/whep/{session}": "application/sdp",
    "/cameras/{camera}/whep/{session}": "application/sdp",
    "/api/events": "text/event-stream",
    "/api/events/{event}/picture.jpg": "image/jpeg",
    "/api/past": "application/x-ndjson",
    "/healthz": "text/plain",
    "/readyz": "text/plain",
    "/metrics": "text/plain",
    **OPERATOR_FILES,
    **OPERATOR_RESULTS,
}
_UNAVAILABLE = {
    "/objects/{object}/best.mp4",
    "/cameras/{camera}/live.mp4",
    "/readyz",
    "/api/events",
    "/api/past",
    SEARCH,
    _PEOPLE,
    _CORRECTIONS,
    DELETION,
    *RECORDED_SPANS,
} | {
    path for path in MEDIA_TYPES if path.endswith((".webm", ".ts", ".m3u8", ".mjpeg", "best.jpg", "live.jpg"))
}
_NOT_FOUND = {SEARCH, DELETION, _CORRECTIONS, _PEOPLE, *OPERATOR_RESULTS}
"""Paths whose query or body names a person, a camera or a zone, or whose file may not exist."""
_VALIDATED = {SEARCH, *OPERATOR, *OPERATOR_FILES, *OPERATOR_RESULTS} | (
    OVERLAY | TIME_SHIFT | CAMERA_QUERY | DELAY | RECORDED_SPANS
)
"""Paths whose query or body may be invalid."""
_NO_FILE = "The site has no configuration file, or refuses the change."
_CONFLICTS = {
    "/api/operator/site_cameras": _NO_FILE,
    "/api/operator/site_settings": _NO_FILE,
    "/api/operator/marked_points": _NO_FILE,
    "/api/operator/zones": _NO_FILE,
    "/api/operator/restart": "Nothing would start the processes again, or the configuration is invalid.",
    "/api/operator/walk": "There is no walk, or no result yet, or the configuration cannot be changed.",
    _PEOPLE: "People cannot be edited here, or no such camera shows the person.",
    _CORRECTIONS: "Corrections are not accepted here, or the camera did not show the person then.",
    DELETION: "Another deletion is not complete yet.",
    SEARCH: "The zone is on the floor, and no camera is calibrated.",
}
_TRIES = {("POST", "/api/operator/site_cameras"), ("POST", "/api/operator/setup/streams")}
"""Operations that speak to a camera, for as long as that takes."""
_REFERENCE = "#/components/schemas/{name}"


def components_of(kinds: list[Any]) -> dict[str, Any]:
    """Return the schemas of all answers, and of these types, by name."""
    all_kinds = [*JSON_ANSWERS.values(), Problem, *kinds]
    _, components = msgspec.json.schema_components(all_kinds, ref_template=_REFERENCE)
    return components


def json_content(kind: Any) -> dict[str, Any]:
    """Return the content of a JSON body of this type."""
    (schema,), _ = msgspec.json.schema_components([kind], ref_template=_REFERENCE)
    return {"application/json": {"schema": schema}}


def responses_of(path: str, method: str, *, has_json_body: bool) -> dict[str, Any]:
    """Return the documented responses of an operation by status."""
    responses = _success(path, method)
    error = json_content(Problem)
    if (method, path) in _TRIES:
        description = "It takes longer: ask /api/operator/setup/trials/{key} for the result."
        responses["202"] = {"description": description, "content": json_content(TrialProgress)}
    names = re.findall(r"\{(\w+)\}", path)
    if names or path in _NOT_FOUND:
        responses["404"] = {"description": "No object, camera or file of this name.", "content": error}
    if path in _VALIDATED or path.endswith("/choice") or has_json_body:
        responses["400"] = {"description": "Invalid request.", "content": error}
    if has_json_body:
        responses["413"] = {"description": "The body is too large.", "content": error}
    if permission_for("GET", path) is not Permission.PUBLIC:
        responses["401"] = {
            "description": "No valid token, where the site has tokens.",
            "content": error,
        }
        responses["403"] = {"description": "Outside the token's scope.", "content": error}
        responses["429"] = {"description": "Too many wrong tokens; try again later.", "content": error}
    if path in _CONFLICTS:
        responses["409"] = {"description": _CONFLICTS[path], "content": error}
    if path in TIME_SHIFT | OPERATOR_FILES.keys():
        responses["416"] = {"description": "That time is not recorded.", "content": error}
    if path in _UNAVAILABLE or "object" in names:
        responses["503"] = {"description": "Temporarily unavailable; try again later."}
    return responses


def _success(path: str, method: str) -> dict[str, Any]:
    """Return the responses to a valid request, and WHEP's errors."""
    error = json_content(Problem)
    content = json_content(JSON_ANSWERS[path]) if path in JSON_ANSWERS else {MEDIA_TYPES[path]: {}}
    if (method, path) == ("DELETE", SESSION_PATH):
        return {"204": {"description": "Signed out."}}
    if path.endswith("/trials/{key}"):
        return {
            "200": {"description": "What the request that began it answers.", "content": {}},
            "202": {"description": "It has no result yet.", "content": content},
        }
    if not path.endswith("/whep"):
        return {"200": {"description": "OK", "content": content}}
    return {
        "201": {"description": "The SDP answer; Location is the session's address.", "content": content},
        "400": {
            "description": "The SDP offer is invalid, or has no H.264.",
            "content": error,
        },
        "415": {"description": "Not application/sdp.", "content": error},
        "501": {"description": "The extra webrtc is not installed.", "content": error},
        "503": {"description": "Temporarily unavailable; try again later."},
    }
