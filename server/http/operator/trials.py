"""``/api/operator/setup/trials``: trials of cameras, which may wait for others; no request waits for long.

The request that starts one answers with its result if that comes at once, else with 202 and its place in the
queue; further requests ask for more.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import secrets
from collections.abc import Coroutine
from typing import Any

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SETUP
from server.http.json_responses import error_response, json_response
from server.http.operator.schema import TrialProgress
from server.system.errors import UserError

log = logging.getLogger(__name__)

routes = web.RouteTableDef()

_ANSWER_S = 1.0
"""Time in which a request answers."""
_KEPT = 64
"""The latest trials, whose results are kept; an earlier one is kept until another starts after its end."""
_FIRST_KEYS = 900_000_000
"""Keys begin anywhere below, so that a page that asks after a restart gets no other trial's result."""
_GONE = "this trial is not known any more: look whether the camera is there, else try it again"


class CameraTrials:
    """The latest trials by key."""

    def __init__(self) -> None:
        self._tasks: dict[int, asyncio.Task[web.Response]] = {}
        self._keys = itertools.count(secrets.randbelow(_FIRST_KEYS))

    def start(self, work: Coroutine[Any, Any, web.Response]) -> int:
        """Start a trial, whose work returns what is answered in the end; return its key."""
        key = next(self._keys)
        self._tasks[key] = asyncio.create_task(_answer_errors(work), name="trial")
        for old in list(self._tasks)[:-_KEPT]:
            if self._tasks[old].done():
                del self._tasks[old]
        return key

    async def answer(self, key: int, request: web.Request) -> web.Response:
        """Return the result, or after a moment how far the trial is."""
        task = self._tasks.get(key)
        if task is None:
            return error_response(404, _GONE)
        await asyncio.wait({task}, timeout=_ANSWER_S)
        if not task.done():
            return json_response(TrialProgress(key, request.app[SETUP].trials_ahead(task)), 202)
        result = task.result()
        return web.Response(body=result.body, status=result.status, headers=result.headers)

    def end(self) -> None:
        """Cancel what runs."""
        for task in self._tasks.values():
            task.cancel()


TRIALS = web.AppKey("trials", CameraTrials)


def add_trials(app: web.Application) -> None:
    """Let an application run trials until it shuts down."""
    app[TRIALS] = CameraTrials()

    async def end(_: web.Application) -> None:
        app[TRIALS].end()

    app.on_shutdown.append(end)


async def follow(request: web.Request, work: Coroutine[Any, Any, web.Response]) -> web.Response:
    """Start a trial, and answer as :meth:`CameraTrials.answer`. It goes on if the client leaves."""
    trials = request.app[TRIALS]
    return await trials.answer(trials.start(work), request)


@routes.get(f"{OPERATOR_PATH}/setup/trials/{{key:[0-9]{{1,9}}}}")
async def get_trial(request: web.Request) -> web.StreamResponse:
    """Return the result of a trial, or how far it is."""
    return await request.app[TRIALS].answer(int(request.match_info["key"]), request)


async def _answer_errors(work: Coroutine[Any, Any, web.Response]) -> web.Response:
    try:
        return await work
    except UserError as error:
        return error_response(400, str(error))
    except Exception:
        log.exception("a trial of a camera failed")
        return error_response(409, "the trial failed: see the service's log")  # pages ask again after a 500
