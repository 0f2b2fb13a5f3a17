"""``/api/operator/restart``: start all processes of the site again, with the file as it is now."""

from __future__ import annotations

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import CONTROL, ON_DISK
from server.http.json_responses import error_response, json_response
from server.http.operator.schema import RestartStatus

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/restart"
_BY_HAND = "nothing supervises this process: restart all processes of the site where they were started"


@routes.get(_PATH)
async def get_restart(request: web.Request) -> web.Response:
    """Return whether the site can be restarted, and what that would bring into force."""
    return json_response(_status(request))


@routes.post(_PATH)
async def post_restart(request: web.Request) -> web.Response:
    """Start all processes of the site again; streams end for some seconds."""
    restart = request.app[CONTROL].restart
    if restart is None:
        return error_response(409, _BY_HAND)
    status = _status(request)
    if status.error:
        return error_response(409, status.error)
    restart.set()
    return json_response(status)


def _status(request: web.Request) -> RestartStatus:
    on_disk = request.app[ON_DISK]()
    control = request.app[CONTROL]
    possible = control.restart is not None
    return RestartStatus(possible, on_disk.error, list(on_disk.changed_keys), control.refused)
