"""The HTTP application, and serving it."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager

from aiohttp import web

from logthrottle import LogThrottle
from server.config.running_config import ConfigFileState
from server.config.sections import HttpSettings
from server.config.site_config import Config
from server.http import static_files
from server.http.access import sign_in
from server.http.access.access_control import ACCESS, Access, keep_no_copies, only_who_may
from server.http.access.cors import preflight
from server.http.access.csrf import tell_no_other_origin
from server.http.api import handlers, openapi, site_handlers
from server.http.api.events import Events
from server.http.api.handlers import problem
from server.http.api.query_validation import refuse_what_is_not_there
from server.http.api.shard_redirect import to_the_right_service
from server.http.app_keys import EVENTS, METRICS, ON_DISK, PICTURES, READERS, SERVICE
from server.http.connections.connection_limit import FOR_OPERATORS, connection_limit
from server.http.connections.connection_pool import Bounds, Places
from server.http.connections.fair_shares import Shares
from server.http.connections.listener import Listener
from server.http.connections.malformed_requests import REQUESTS
from server.http.connections.overload_responses import keep_places
from server.http.connections.viewer_limits import LISTENING, WATCHING
from server.http.hls import routes as hls
from server.http.hls.sessions import Readers
from server.http.metrics.service_collector import registry
from server.http.metrics.stage_collector import measure
from server.http.operator import routes as operator
from server.http.streams import jpeg, time_shift, video
from server.http.streams.container_check import refuse_other_containers
from server.http.streams.sending import break_off
from server.http.tls import Certificate
from server.service.rendering.render_pool import RenderPool
from server.service.service import BestViewService
from server.system.descriptors import descriptor_limit
from server.system.errors import UserError

log = logging.getLogger(__name__)

_MISTAKES = web.AppKey("mistakes", LogThrottle)
_BEGUN = web.RequestKey("begun", web.StreamResponse)
"""The answer to a request, once its head has been sent."""
_ASKED_BYTES = 65_536
"""What may follow the head of a request: JSON, of which strangers could else have much kept in memory."""
_CLOSE_S = 1.0
"""How long viewers have to take what was sent before the server ends."""


@web.middleware
async def one_line_errors(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer every error with one line of JSON; a traceback is for the log."""
    try:
        return await handler(request)
    except web.HTTPMethodNotAllowed as error:
        answer = problem(error.status, f"{request.method} is not possible here")
        answer.headers["Allow"] = error.headers["Allow"]
        return answer
    except web.HTTPNotFound as error:
        return problem(error.status, f"there is nothing at {request.path}")
    except web.HTTPException as error:
        if error.status < web.HTTPBadRequest.status_code:
            raise
        return problem(error.status, error.reason)
    except (ConnectionError, asyncio.CancelledError):
        raise
    except Exception as error:
        if (more := request.app[_MISTAKES].record(repr(error))) is not None:
            log.exception("answering %s %s failed%s", request.method, request.path, more)
        begun: web.StreamResponse | None = request.get(_BEGUN)
        if begun is None:
            return problem(500, "the server made a mistake; its log says more")
        break_off(request)
        return begun


async def _has_begun(request: web.Request, response: web.StreamResponse) -> None:
    request[_BEGUN] = response


def make_app(
    service: BestViewService, on_disk: Callable[[], ConfigFileState] = lambda: ConfigFileState("", ())
) -> web.Application:
    """Give the application on top of a service; `on_disk` says how the configuration's file differs.

    Raises:
        UserError: the file of tokens cannot be read, or something in it is wrong.
    """
    app = web.Application(
        middlewares=[
            one_line_errors,
            keep_places,
            only_who_may,
            preflight,
            refuse_what_is_not_there,
            refuse_other_containers,
            to_the_right_service,
        ],
        client_max_size=_ASKED_BYTES,
    )
    app[SERVICE], app[EVENTS], app[PICTURES] = service, Events(service), RenderPool(service)
    app[ON_DISK], app[_MISTAKES] = on_disk, LogThrottle()
    app[openapi.DESCRIBED] = openapi.Described(app)
    app[WATCHING], app[LISTENING] = Shares(), Shares()
    app[READERS] = Readers(service.splicer.layout.target_s, app[WATCHING])
    what = f"{service.config.site.name}_{service.config.view.share.index}"
    app[ACCESS] = Access(
        service.config.access.tokens,
        service.board.resolve,
        what,
        since=lambda: service.remembering.numbers_since,
    )
    app[METRICS] = registry(service, app[PICTURES], app[READERS], app[ACCESS], on_disk)
    measure(app)
    for module in (
        handlers,
        sign_in,
        site_handlers,
        video,
        time_shift,
        hls,
        jpeg,
        openapi,
        static_files,
        operator,
    ):
        app.add_routes(module.routes)
    app.on_response_prepare.extend((tell_no_other_origin, keep_no_copies, _has_begun))
    app.cleanup_ctx.append(_telling)
    app.on_shutdown.append(_end_streams)
    return app


@asynccontextmanager
async def serving(app: web.Application, settings: HttpSettings) -> AsyncIterator[int]:
    """Serve the application; give the port.

    Raises:
        UserError: the port cannot be listened on, or the certificate cannot be read.
    """
    certificate = Certificate.of(settings.tls)
    handling = {"access_log": None, "logger": REQUESTS, "keepalive_timeout": settings.keepalive_timeout_s}
    # What is packed is not unpacked: a little that unpacks to much would keep all streams waiting.
    runner = web.AppRunner(app, shutdown_timeout=_CLOSE_S, handler_cancellation=True)
    await runner.setup()
    assert runner.server is not None  # noqa: S101 — tells mypy that it was made
    context = None if certificate is None else certificate.context
    bounds = _bounds(app[SERVICE].config.model_copy(update={"http": settings}))
    listener = Listener(runner.server, Places(bounds), context, auto_decompress=False, **handling)
    looking = None if certificate is None else asyncio.create_task(certificate.run(), name="certificate")
    try:
        async with AsyncExitStack() as stack:
            try:
                port = await stack.enter_async_context(listener.listening(settings.host, settings.port))
            except OSError as error:
                reason = error.strerror or error
                raise UserError(
                    f"http.port: cannot listen on {settings.host}:{settings.port}: {reason}"
                ) from error
            yield port
    finally:
        if looking is not None:
            looking.cancel()
        await runner.cleanup()


def _bounds(config: Config) -> Bounds:
    """Return how many connections are taken: as many as are wanted, where that many files may be open."""
    http, descriptors = config.http, descriptor_limit()
    most = connection_limit(config, descriptors)
    if most < http.connections:
        log.warning(
            "%d files may be open (ulimit -n): %d connections are taken, not %d (http.connections_max)",
            descriptors,
            most,
            http.connections,
        )
    return Bounds(
        most=most,
        per_address=min(most, http.connections_per_address or math.ceil(most / 2)),
        for_operators=FOR_OPERATORS,
        request_s=http.request_timeout_s,
        keepalive_s=http.keepalive_timeout_s,
    )


async def _telling(app: web.Application) -> AsyncIterator[None]:
    tasks = [
        asyncio.create_task(app[EVENTS].run(), name="events"),
        asyncio.create_task(app[ACCESS].run(), name="access"),
    ]
    yield
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _end_streams(app: web.Application) -> None:
    app[EVENTS].close()
    app[SERVICE].splicer.close()
    await app[PICTURES].close()
