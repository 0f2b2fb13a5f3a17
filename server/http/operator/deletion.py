"""``/api/operator/deletion``: what would be deleted of a person, and their deletion."""

from __future__ import annotations

import re
from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import json_response
from server.messaging.camera_identity_snapshot import PERSON_NUMBER_MAX
from server.service.facade.deletion import DeletePerson, Recordings
from server.service.facade.errors import InvalidCommandError

routes = web.RouteTableDef()

_RUN_MAX = 64
_NUMBER = re.compile(r"[1-9][0-9]{0,8}")
_Number = Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX)]

DELETION_QUERIES = {
    "object": {"type": "integer", "minimum": 1, "maximum": PERSON_NUMBER_MAX},
    "run": {
        "type": "string",
        "maxLength": _RUN_MAX,
        "description": "A recorded session whose numbers are others than today's.",
    },
}


class DeletionRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Whose data are deleted."""

    object: _Number
    recordings: Recordings
    """delete: also the recorded video and sound of the times in which they were visible."""
    run: Annotated[str, msgspec.Meta(max_length=_RUN_MAX)] | None = None
    """A recorded session whose numbers are others than today's."""


@routes.get(f"{OPERATOR_PATH}/deletion")
async def get_deletion(request: web.Request) -> web.Response:
    """Return what would be deleted of a person; nothing is."""
    query = request.query
    number, run = query.get("object", ""), query.get("run")
    if not _NUMBER.fullmatch(number):
        raise InvalidCommandError(
            f"object={number[:60]}: must be a whole number from 1 to {PERSON_NUMBER_MAX}"
        )
    if run is not None and len(run) > _RUN_MAX:
        raise InvalidCommandError(f"run: at most {_RUN_MAX} characters")
    return json_response(await request.app[SERVICE].deletion.plan(int(number), run))


@routes.post(f"{OPERATOR_PATH}/deletion")
@json_body(DeletionRequest)
async def post_deletion(request: web.Request, asked: DeletionRequest) -> web.Response:
    """Delete a person's data, for good."""
    command = DeletePerson(asked.object, asked.recordings, asked.run)
    return json_response(await request.app[SERVICE].deletion.delete(command))
