"""WebRTC by WHEP (draft-ietf-wish-whep): a best view or a camera for an SDP offer, ended by DELETE."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from aiohttp import web

from server.http.access.authorization import ACCESS, is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, unavailable
from server.http.streams.request_validation import refuse_live_if_scoped, requested_delay
from server.http.streams.whep_sessions import (
    HOW_TO_INSTALL,
    WHEP_SESSIONS,
    NoWebRtcError,
    WhepSession,
    reveal_viewer,
)
from server.http.viewers.fair_share import Slot
from server.http.viewers.viewer_limits import (
    VIEWER_SLOTS,
    evict_or_refuse_viewer,
    live_camera_slot_name,
    person_slot_name,
)
from server.service.facade.streams import Broadcaster
from server.system.errors import UserError

routes = web.RouteTableDef()

_SDP = "application/sdp"
_HEADERS = {"Cache-Control": "no-store", "Access-Control-Allow-Origin": "*"}
_SESSION = "{session:[A-Za-z0-9_-]{22}}"


@routes.post("/objects/{object:[0-9]{1,9}}/whep")
async def post_best(request: web.Request) -> web.Response:
    """Send the best view of a person by WebRTC."""
    service = request.app[SERVICE]
    if (refused := refuse_live_if_scoped(request)) is not None:
        return refused
    person = service.people.current_number(int(request.match_info["object"]))
    scoped, delay = is_scoped_to_person(request), requested_delay(request)
    channel = service.streams.of_person(person, scoped_to_person=scoped, delay=delay)
    if channel is None:
        raise service.people.unknown(person)
    others = service.streams.connected_viewers_of_person(person) - channel.viewers
    return await _begin(request, channel, person_slot_name(person), others)


@routes.post("/cameras/{camera}/whep")
async def post_camera(request: web.Request) -> web.Response:
    """Send one camera by WebRTC."""
    service, camera = request.app[SERVICE], request.match_info["camera"]
    service.cameras.require(camera)
    return await _begin(request, service.streams.of_camera(camera), live_camera_slot_name(camera))


@routes.delete("/objects/{object:[0-9]{1,9}}/whep/" + _SESSION)
async def delete_best(request: web.Request) -> web.Response:
    """End a WebRTC session."""
    return _end(request)


@routes.delete("/cameras/{camera}/whep/" + _SESSION)
async def delete_camera(request: web.Request) -> web.Response:
    """End a WebRTC session."""
    return _end(request)


async def _begin(
    request: web.Request, channel: Broadcaster, slot_name: str, other_viewers: int = 0
) -> web.Response:
    """Begin a session if the request has an SDP offer and a viewer slot is free."""
    refused = _refused(request) or evict_or_refuse_viewer(
        request, channel.viewers + other_viewers, (slot_name,)
    )
    if refused is not None:
        return refused
    access, slots = request.app[ACCESS], request.app[VIEWER_SLOTS]
    client, permitted = access.client_of(request), access.follow(request)

    @contextlib.contextmanager
    def holding(session: WhepSession) -> Iterator[None]:
        slot = slots.take(Slot(client, slot_name, session.end))
        try:
            with permitted(session.end):
                yield
        finally:
            slots.release(slot)

    offer = (await request.read()).decode("utf-8", "replace")
    try:
        session, answer = await request.app[WHEP_SESSIONS].answer(
            reveal_viewer(offer, request.remote or ""), channel, request.path, holding
        )
    except NoWebRtcError:
        return error_response(501, HOW_TO_INSTALL)
    except UserError as error:
        return error_response(400, str(error))
    headers = {"Location": session.path, "Access-Control-Expose-Headers": "Location", **_HEADERS}
    return web.Response(status=201, text=answer, content_type=_SDP, headers=headers)


def _refused(request: web.Request) -> web.Response | None:
    """Return why there can be no session for any offer; None: there can."""
    streams = request.app[SERVICE].streams
    if request.content_type != _SDP:
        return error_response(415, f"send the SDP offer as {_SDP}")
    if streams.codec is None:
        return unavailable("no camera has delivered a picture yet")
    codec = request.app[SERVICE].config.encode.codec
    if codec != "h264":
        name = {"vp8": "VP8", "h265": "H.265"}[codec]
        return error_response(404, f"these streams are {name} (encode.codec): WebRTC hands on H.264 only")
    return None


def _end(request: web.Request) -> web.Response:
    session = request.app[WHEP_SESSIONS].find(request.match_info["session"], request.path)
    if session is None:
        return error_response(404, "there is no such session any more")
    session.end()
    return web.Response(headers=_HEADERS)
