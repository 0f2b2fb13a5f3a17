"""``/api/operator/people``: the operator renames, merges and splits people."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, json_response, read_json
from server.http.operator.schema import PeopleByHand
from server.service.facade.people import MergePeople, RenamePerson, SplitPerson
from server.service.service import BestViewService

routes = web.RouteTableDef()


class PersonEdit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One correction of one person: exactly one of the optional fields."""

    object: int
    name: str | None = None
    merge: int | None = None
    """The number to merge into this person."""
    split: list[str] | None = None
    """Cameras whose view of this number is another person; empty: all cameras."""


@routes.get(f"{OPERATOR_PATH}/people")
async def get_people(request: web.Request) -> web.Response:
    """Return the manual overrides of people's identities."""
    return json_response(_people(request.app[SERVICE]))


@routes.post(f"{OPERATOR_PATH}/people")
async def post_people(request: web.Request) -> web.Response:
    """Apply a manual override: a name, a merge of two people, or a split."""
    service = request.app[SERVICE]
    people = service.people
    edit = await read_json(request, PersonEdit)
    people.check_editable(edit.object)
    if sum(getattr(edit, it) is not None for it in ("name", "merge", "split")) != 1:
        return error_response(400, "set exactly one of name, merge and split")
    new = None
    if edit.name is not None:
        people.rename_person(RenamePerson(edit.object, edit.name))
    elif edit.merge is not None:
        people.merge_people(MergePeople(edit.object, edit.merge))
    else:
        new = people.split_person(SplitPerson(edit.object, edit.split or []))
    return json_response(_people(service, new))


def _people(service: BestViewService, new_object: int | None = None) -> PeopleByHand:
    overrides = service.people.manual_overrides()
    return PeopleByHand(
        names=overrides.names,
        merged=overrides.merged,
        new_object=new_object,
        unavailable=service.people.editing_blocked,
    )
