"""``/api/operator/setup/search`` and ``/streams``: cameras in the network, and what they offer."""

from __future__ import annotations

import functools
from collections.abc import Awaitable, Callable
from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SETUP
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.schema import OfferedStream, OfferedStreams, SearchedCamera, SearchResult
from server.http.operator.trials import follow
from server.setup.camera_address import CameraAddresses, parse_addresses
from server.setup.onvif_profiles import INSTALL, is_installed
from server.setup.session import SetupSession
from server.setup.stream_pair import propose_pair
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/setup"
Login = Annotated[str, msgspec.Meta(max_length=200)]
Name = Annotated[str, msgspec.Meta(max_length=100)]


class StreamsQuery(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A found camera whose streams are asked for."""

    host: Name
    port: Annotated[int, msgspec.Meta(ge=1, le=65_535)]
    user: Login = ""
    password: Login = ""


class CameraTrial(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera to try and add: an offered stream, or an address with a login; and its substream, if any."""

    stream: int | None = None
    substream: int | None = None
    address: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    substream_address: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    user: Login = ""
    password: Login = ""
    name: Name = ""

    def addresses(self, session: SetupSession) -> CameraAddresses:
        """Return where its streams are.

        Raises:
            UserError: a stream was not offered, or an address is invalid.
        """
        if self.stream is not None:
            return session.offered(self.stream, self.substream)
        return parse_addresses(self.address, self.user, self.password, self.substream_address)


Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def answers_user_errors(handler: Handler) -> Handler:
    """Answer 400 with the line of a UserError."""

    @functools.wraps(handler)
    async def answer(request: web.Request) -> web.StreamResponse:
        try:
            return await handler(request)
        except UserError as error:
            return error_response(400, str(error))

    return answer


@routes.post(f"{_PATH}/search")
@answers_user_errors
async def post_search(request: web.Request) -> web.StreamResponse:
    """Search the network for cameras."""
    found = await request.app[SETUP].discover()
    cameras = [SearchedCamera(camera.host, camera.port, camera.name, camera.hardware) for camera in found]
    return json_response(SearchResult(cameras, "" if is_installed() else INSTALL))


@routes.post(f"{_PATH}/streams")
@json_body(StreamsQuery)
async def post_streams(request: web.Request, query: StreamsQuery) -> web.StreamResponse:
    """Ask a found camera for its streams."""
    return await follow(request, _streams(request.app[SETUP], query))


async def _streams(session: SetupSession, query: StreamsQuery) -> web.Response:
    answer, keys = await session.profiles(query.host, query.port, query.user, query.password)
    streams = [
        OfferedStream(key, one.name, one.codec, one.width, one.height, one.fps)
        for key, one in zip(keys, answer.profiles, strict=True)
    ]
    if not streams:
        return json_response(OfferedStreams(answer.error, answer.needs_password, []))
    pair = propose_pair(answer.profiles)
    substream = None if pair.substream is None else keys[pair.substream]
    return json_response(
        OfferedStreams(answer.error, answer.needs_password, streams, keys[pair.source], substream)
    )
