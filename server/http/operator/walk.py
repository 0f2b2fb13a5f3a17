"""The calibration walk: the operator begins, watches and ends it. Nothing is changed by what comes of it."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from aiohttp import web

from server.http.access.grants import OPERATING
from server.http.api.handlers import answer, asked_for, problem
from server.http.app_keys import SERVICE
from server.http.operator.schema import OperatorWalk, WalkCamera, WalkPair
from server.service.calibration.calibration_report import coverage_gaps
from server.service.calibration.walk_session import MAX_WALK_S, WalkState
from server.service.calibration.worker import CalibrationResult
from server.service.service import BestViewService

routes = web.RouteTableDef()

_LINES = "ground: ground.json\n"


class Step(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is to be done with the walk."""

    do: Literal["start", "go_on", "finish"]
    person: Annotated[float, msgspec.Meta(ge=0.1, le=1000)] = 1.75
    """To finish: how tall people are, metres."""


@routes.get(f"{OPERATING}/walk")
async def get_walk(request: web.Request) -> web.Response:
    """Say what was covered of the walk so far, and what has come of it."""
    return answer(_told(request.app[SERVICE]))


@routes.post(f"{OPERATING}/walk")
async def post_walk(request: web.Request) -> web.Response:
    """Start a walk, go on with it, or finish it: then it is calibrated from."""
    service = request.app[SERVICE]
    step = await asked_for(request, Step)
    walking = service.walking
    if step.do == "start":
        walking.start()
    elif walking.state is WalkState.NONE:
        return problem(409, "nobody walks: start the walk first")
    elif step.do == "go_on":
        if walking.state is not WalkState.WALKING:
            walking.go_on()
    elif walking.state is not WalkState.WORKING:
        walking.finish(step.person)
    return answer(_told(service))


@routes.delete(f"{OPERATING}/walk")
async def delete_walk(request: web.Request) -> web.Response:
    """Forget the walk and what came of it."""
    service = request.app[SERVICE]
    service.walking.stop()
    return answer(_told(service))


@routes.get(f"{OPERATING}/walk/ground.json")
async def get_ground(request: web.Request) -> web.Response:
    """Give the ground file that has come of the walk."""
    done = request.app[SERVICE].walking.done
    if done is None or not done.ground:
        return _nothing()
    return _file(done.ground.encode(), "application/octet-stream", "ground.json")


@routes.get(f"{OPERATING}/walk/plan.png")
async def get_plan(request: web.Request) -> web.Response:
    """Give the floor plan that has come of the walk."""
    done = request.app[SERVICE].walking.done
    return _file(done.plan, "image/png", "ground.png") if done is not None and done.plan else _nothing()


def _nothing() -> web.Response:
    return problem(404, "nothing has come of a walk yet")


def _file(body: bytes, content_type: str, name: str) -> web.Response:
    disposition = f'{"inline" if content_type == "image/png" else "attachment"}; filename="{name}"'
    headers = {"Content-Disposition": disposition, "Cache-Control": "no-store"}
    return web.Response(body=body, content_type=content_type, headers=headers)


def _told(service: BestViewService) -> OperatorWalk:
    walking = service.walking
    done = walking.done or CalibrationResult()
    covered = walking.coverage()
    lacking = [
        it.words
        for seen in covered.cameras
        for it in coverage_gaps(seen.camera, seen.thirds, seen.deep or float("inf"))
    ]
    return OperatorWalk(
        state=walking.state.value,
        seconds=walking.seconds,
        most=MAX_WALK_S,
        cameras=[WalkCamera(it.camera, it.feet, list(it.thirds), it.deep) for it in covered.cameras],
        pairs=[WalkPair(it.one, it.other, it.seconds) for it in covered.pairs],
        lacking=lacking,
        error=done.error,
        lines=done.lines,
        too_little=done.too_little,
        configuration=_LINES + done.offsets if done.ground else "",
    )
