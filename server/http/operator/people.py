"""``/api/operator/people``: rename, merge and split people."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.schema import IdentityOverrides
from server.service.facade.people import MergePeople, RenamePerson, SplitPerson
from server.service.service import BestViewService

routes = web.RouteTableDef()


class PersonEdit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An identity override; exactly one of the optional fields is set."""

    object: int
    name: str | None = None
    merge: int | None = None
    """The number to merge into this person."""
    split: list[str] | None = None
    """Cameras that show another person under this number; empty: all cameras."""


@routes.get(f"{OPERATOR_PATH}/people")
async def get_overrides(request: web.Request) -> web.Response:
    """Return the manual overrides of people's identities."""
    return json_response(_overrides(request.app[SERVICE]))


@routes.post(f"{OPERATOR_PATH}/people")
@json_body(PersonEdit)
async def post_overrides(request: web.Request, edit: PersonEdit) -> web.Response:
    """Apply a manual override: rename a person, merge two people, or split one."""
    service = request.app[SERVICE]
    people = service.people
    people.check_editable(edit.object)
    if sum(getattr(edit, field) is not None for field in ("name", "merge", "split")) != 1:
        return error_response(400, "set exactly one of name, merge and split")
    new = None
    if edit.name is not None:
        people.rename_person(RenamePerson(edit.object, edit.name))
    elif edit.merge is not None:
        people.merge_people(MergePeople(edit.object, edit.merge))
    else:
        new = people.split_person(SplitPerson(edit.object, edit.split or []))
    return json_response(_overrides(service, new))


def _overrides(service: BestViewService, new_object: int | None = None) -> IdentityOverrides:
    overrides = service.people.manual_overrides()
    return IdentityOverrides(
        names=overrides.names,
        merged=overrides.merged,
        new_object=new_object,
        unavailable=service.people.editing_blocked,
    )
