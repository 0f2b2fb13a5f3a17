"""``/api/operator/setup``: the cameras that were tried and are named; and writing the configuration."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SETUP
from server.http.json_requests import json_body
from server.http.json_responses import json_response
from server.http.operator.camera_search import CameraTrial, Name, answers_user_errors
from server.http.operator.trials import follow
from server.setup.proposal import SiteProposal
from server.setup.session import SetupSession

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/setup"


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


@routes.get(_PATH)
async def get_setup(request: web.Request) -> web.Response:
    """Return the cameras that were added, and the proposed settings."""
    return json_response(_state(request.app[SETUP]))


@routes.post(f"{_PATH}/cameras")
@json_body(CameraTrial)
async def post_camera(request: web.Request, trial: CameraTrial) -> web.StreamResponse:
    """Try a camera, and add it if it sends pictures."""
    return await follow(request, _add(request.app[SETUP], trial))


@routes.put(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}")
@answers_user_errors
@json_body(CameraName)
async def put_camera(request: web.Request, wanted: CameraName) -> web.StreamResponse:
    """Rename a camera that was added."""
    session = request.app[SETUP]
    session.rename(int(request.match_info["key"]), wanted.name)
    return json_response(_state(session))


@routes.delete(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}")
@answers_user_errors
async def delete_camera(request: web.Request) -> web.StreamResponse:
    """Remove a camera that was added."""
    session = request.app[SETUP]
    session.remove(int(request.match_info["key"]))
    return json_response(_state(session))


@routes.get(f"{_PATH}/cameras/{{key:[0-9]{{1,9}}}}/picture.jpg")
@answers_user_errors
async def get_picture(request: web.Request) -> web.StreamResponse:
    """Return the picture of a camera that was added."""
    camera = request.app[SETUP].camera(int(request.match_info["key"]))
    headers = {"Cache-Control": "no-store"}
    return web.Response(body=camera.trial.picture, content_type="image/jpeg", headers=headers)


@routes.post(f"{_PATH}/site")
@answers_user_errors
@json_body(SiteChoice)
async def post_site(request: web.Request, choice: SiteChoice) -> web.StreamResponse:
    """Write the configuration."""
    session = request.app[SETUP]
    session.write(choice.name, SiteProposal(choice.fps, choice.width, choice.height))
    kept = None if session.kept is None else str(session.kept)
    return json_response(WrittenSite(str(session.path), kept))


async def _add(session: SetupSession, trial: CameraTrial) -> web.Response:
    await session.add(trial.addresses(session), trial.name)
    return json_response(_state(session))


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
