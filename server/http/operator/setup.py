"""``/api/operator/setup``: search for cameras, try them, name them, and write the configuration."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SETUP
from server.http.json_responses import error_response, json_response, read_json
from server.setup.onvif_profiles import INSTALL, is_installed
from server.setup.proposal import SiteProposal
from server.setup.session import SetupSession
from server.setup.stream_pair import propose_pair
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/setup"
Login = Annotated[str, msgspec.Meta(max_length=200)]
Name = Annotated[str, msgspec.Meta(max_length=100)]


class SearchedCamera(msgspec.Struct, frozen=True):
    """A camera that answered the search."""

    host: str
    port: int
    name: str
    hardware: str


class SearchResult(msgspec.Struct, frozen=True):
    """The cameras of the network."""

    cameras: list[SearchedCamera]
    hint: str
    """Why their streams cannot be asked for; empty: they can."""


class StreamsQuery(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A found camera whose streams are asked for."""

    host: Name
    port: Annotated[int, msgspec.Meta(ge=1, le=65_535)]
    user: Login = ""
    password: Login = ""


class OfferedStream(msgspec.Struct, frozen=True):
    """A stream that a camera offers."""

    key: int
    name: str
    codec: str
    width: int
    height: int
    fps: float


class OfferedStreams(msgspec.Struct, frozen=True):
    """The streams of a camera, the largest first."""

    error: str
    needs_password: bool
    streams: list[OfferedStream]
    source: int | None = None
    """Key of the stream that is proposed for viewers."""
    substream: int | None = None
    """Key of the stream that is proposed for tracking; null: the same."""


class CameraTrial(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera to try and add: an offered stream, or an address with a login; and its substream, if any."""

    stream: int | None = None
    substream: int | None = None
    address: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    substream_address: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    user: Login = ""
    password: Login = ""
    name: Name = ""


class CameraName(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera's new name."""

    name: Name


class SiteChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The site's name, rate and picture size."""

    name: Name
    fps: float
    width: int
    height: int


class AddedCamera(msgspec.Struct, frozen=True):
    """A camera that was tried."""

    key: int
    name: str
    address: str
    """Without anything that may be secret."""
    sends: str
    tracked_in: str
    """What its substream sends; empty: it has none."""


class ProposedSite(msgspec.Struct, frozen=True):
    """Proposed settings of the section `site`."""

    fps: float
    width: int
    height: int


class SetupState(msgspec.Struct, frozen=True):
    """What is set up so far."""

    file: str
    exists: bool
    """Whether the file exists, and will be kept under another name."""
    cameras: list[AddedCamera]
    proposal: ProposedSite


class WrittenSite(msgspec.Struct, frozen=True):
    """The written configuration."""

    file: str
    kept: str | None
    """Where the earlier file is; null: there was none."""


Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def _answers_user_errors(handler: Handler) -> Handler:
    """Answer 400 with the line of a UserError."""

    async def answer(request: web.Request) -> web.StreamResponse:
        try:
            return await handler(request)
        except UserError as error:
            return error_response(400, str(error))

    answer.__doc__ = handler.__doc__
    return answer


@routes.get(_PATH)
async def get_setup(request: web.Request) -> web.Response:
    """Return the cameras that were added, and the proposed settings."""
    return json_response(_state(request.app[SETUP]))


@routes.post(f"{_PATH}/search")
@_answers_user_errors
async def post_search(request: web.Request) -> web.StreamResponse:
    """Search the network for cameras."""
    found = await request.app[SETUP].discover()
    cameras = [SearchedCamera(camera.host, camera.port, camera.name, camera.hardware) for camera in found]
    return json_response(SearchResult(cameras, "" if is_installed() else INSTALL))


@routes.post(f"{_PATH}/streams")
@_answers_user_errors
async def post_streams(request: web.Request) -> web.StreamResponse:
    """Ask a found camera for its streams."""
    query = await read_json(request, StreamsQuery)
    answer, keys = await request.app[SETUP].profiles(query.host, query.port, query.user, query.password)
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


@routes.post(f"{_PATH}/cameras")
@_answers_user_errors
async def post_camera(request: web.Request) -> web.StreamResponse:
    """Try a camera, and add it if it sends pictures."""
    session = request.app[SETUP]
    trial = await read_json(request, CameraTrial)
    if trial.stream is not None:
        await session.try_stream(trial.stream, trial.name, trial.substream)
    else:
        login = trial.user, trial.password
        await session.try_address(trial.address, *login, trial.name, trial.substream_address)
    return json_response(_state(session))


@routes.put(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}")
@_answers_user_errors
async def put_camera(request: web.Request) -> web.StreamResponse:
    """Rename a camera that was added."""
    session = request.app[SETUP]
    session.rename(int(request.match_info["key"]), (await read_json(request, CameraName)).name)
    return json_response(_state(session))


@routes.delete(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}")
@_answers_user_errors
async def delete_camera(request: web.Request) -> web.StreamResponse:
    """Remove a camera that was added."""
    session = request.app[SETUP]
    session.remove(int(request.match_info["key"]))
    return json_response(_state(session))


@routes.get(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}/picture.jpg")
@_answers_user_errors
async def get_picture(request: web.Request) -> web.StreamResponse:
    """Return the picture of a camera that was added."""
    camera = request.app[SETUP].camera(int(request.match_info["key"]))
    headers = {"Cache-Control": "no-store"}
    return web.Response(body=camera.trial.picture, content_type="image/jpeg", headers=headers)


@routes.post(f"{_PATH}/site")
@_answers_user_errors
async def post_site(request: web.Request) -> web.StreamResponse:
    """Write the configuration."""
    session = request.app[SETUP]
    choice = await read_json(request, SiteChoice)
    session.write(choice.name, SiteProposal(choice.fps, choice.width, choice.height))
    kept = None if session.kept is None else str(session.kept)
    return json_response(WrittenSite(str(session.path), kept))


def _state(session: SetupSession) -> SetupState:
    proposal = session.proposal
    cameras = [
        AddedCamera(camera.key, camera.name, camera.address.shown, camera.sends, camera.tracked_in)
        for camera in session.cameras
    ]
    return SetupState(
        file=str(session.path),
        exists=session.path.exists(),
        cameras=cameras,
        proposal=ProposedSite(proposal.fps, proposal.width, proposal.height),
    )
