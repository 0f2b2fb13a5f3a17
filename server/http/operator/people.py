"""What the operator says of people: their names, that two are one, that one is somebody new."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.grants import OPERATING
from server.http.api.handlers import answer, asked_for, no_camera, no_object, problem
from server.http.app_keys import SERVICE
from server.http.operator.schema import PeopleByHand
from server.messaging.identity_snapshot import NAME_LENGTH_MAX
from server.service.identity.people import PersonTracker
from server.service.service import BestViewService

routes = web.RouteTableDef()


class Said(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One thing that is said of somebody."""

    object: int
    name: str | None = None
    merge: int | None = None
    """The number that is theirs, too."""
    part: list[str] | None = None
    """Cameras that show somebody else as them; none: all do."""


@routes.get(f"{OPERATING}/people")
async def get_people(request: web.Request) -> web.Response:
    """Tell what was said of people by hand."""
    return answer(_told(request.app[SERVICE]))


@routes.post(f"{OPERATING}/people")
async def post_people(request: web.Request) -> web.Response:
    """Say something of people: a name, that two are one, that one is somebody new."""
    service = request.app[SERVICE]
    people = service.decider.people
    said = await asked_for(request, Said)
    if _cannot(service):
        return problem(409, _cannot(service))
    number = people.roll.whose(said.object)  # also of a merge that nobody was told of yet
    if number not in people.known:
        return no_object(service, said.object)
    given = [it for it in ("name", "merge", "part") if getattr(said, it) is not None]
    if len(given) != 1:
        return problem(400, "say one thing at a time: name, merge or part")
    if said.name is not None:
        return _call(service, number, said.name)
    if said.merge is not None:
        return _merge(service, people, number, said.merge)
    return _part(service, people, number, said.part or [])


def _call(service: BestViewService, number: int, name: str) -> web.Response:
    name = " ".join(name.split())
    if len(name) > NAME_LENGTH_MAX or not name.isprintable():
        return problem(400, f"name: at most {NAME_LENGTH_MAX} letters that can be read")
    service.decider.people.roll.call(number, name)
    return answer(_told(service))


def _merge(service: BestViewService, people: PersonTracker, number: int, other: int) -> web.Response:
    lost = people.roll.whose(other)
    if lost not in people.known:
        return no_object(service, other)
    if lost == number:
        return problem(400, f"object {other} is object {number} already")
    people.merge(number, lost)
    return answer(_told(service))


def _part(service: BestViewService, people: PersonTracker, number: int, cameras: list[str]) -> web.Response:
    unknown = [it for it in cameras if it not in service.frame_buffers]
    if unknown:
        return no_camera(service, unknown[0])
    parted = people.part(number, cameras or list(service.frame_buffers))
    if parted is None:
        return problem(409, f"no such camera shows object {number} now")
    return answer(_told(service, parted))


def _cannot(service: BestViewService) -> str:
    if service.config.view.share.of > 1:
        return "several services share this site (view.share): they must agree who is who, by themselves"
    return ""


def _told(service: BestViewService, parted: int | None = None) -> PeopleByHand:
    people = service.decider.people
    return PeopleByHand(
        names=dict(sorted(people.roll.names.items())),
        merged=people.merged_by_hand,
        parted=parted,
        cannot=_cannot(service),
    )
