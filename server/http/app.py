"""The HTTP application: middlewares, routes, shared state, background tasks, and the server."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

from aiohttp import web

from logthrottle import LogThrottle
from server.config.running_config import ConfigFileState
from server.config.sections import HttpSettings
from server.config.site_config import Config
from server.http import static_files
from server.http.access import session_routes
from server.http.access.authentication import Authenticator
from server.http.access.authorization import ACCESS, AccessControl, authorize, forbid_shared_caching
from server.http.access.cors import answer_preflight
from server.http.access.csrf import remove_cors_header
from server.http.api import openapi, past_search, recordings
from server.http.api import routes as api
from server.http.api.events import EVENTS, Events
from server.http.api.shard_redirect import redirect_to_shard
from server.http.app_keys import CONTROL, ON_DISK, SERVICE, SETUP, SiteControl
from server.http.connections.connection_limit import FOR_OPERATORS, connection_limit
from server.http.connections.connection_limiter import ConnectionLimiter, ConnectionLimits
from server.http.connections.listener import Listener
from server.http.connections.malformed_requests import AIOHTTP_LOG, refuse_expectations
from server.http.connections.overload import guard_reserved_connections
from server.http.error_responses import FAILURES, answer_errors, note_begun
from server.http.hls import routes as hls
from server.http.metrics import http_collector
from server.http.metrics.http_collector import register_metrics
from server.http.operator import routes as operator
from server.http.operator.trials import add_trials
from server.http.streams import jpeg, video, whep
from server.http.streams.request_validation import check_container, validate_query
from server.http.streams.whep_sessions import WHEP_SESSIONS, WhepSessions
from server.http.tls import Certificate
from server.http.viewers.fair_share import FairShare
from server.http.viewers.hls_sessions import HLS_SESSIONS, HlsSessions
from server.http.viewers.traffic import TRAFFIC, Traffic
from server.http.viewers.viewer_limits import EVENT_SLOTS, RENDER_SLOTS, SEARCH_SLOTS, VIEWER_SLOTS
from server.service.service import BestViewService
from server.setup.session import SetupSession
from server.system.descriptors import descriptor_limit
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)

_BODY_MAX_BYTES = 65_536
"""Limit of a request's body, which is JSON; larger bodies would let clients fill the memory."""
_SHUTDOWN_TIMEOUT_S = 1.0
"""How long the server waits at shutdown until viewers have received what was sent."""
_ROUTES = (
    api,
    session_routes,
    recordings,
    past_search,
    http_collector,
    video,
    hls,
    jpeg,
    whep,
    openapi,
    static_files,
    operator,
)


def make_app(
    service: BestViewService,
    on_disk: Callable[[], ConfigFileState] = lambda: ConfigFileState("", ()),
    control: SiteControl | None = None,
) -> web.Application:
    """Build the application on top of a service; ``on_disk`` returns how the configuration file differs.

    Raises:
        UserError: the token file cannot be read or is invalid.
    """
    app = web.Application(
        middlewares=[
            answer_errors,
            guard_reserved_connections,
            authorize,
            answer_preflight,
            validate_query,
            check_container,
            redirect_to_shard,
        ],
        client_max_size=_BODY_MAX_BYTES,
    )
    app[SERVICE], app[ON_DISK], app[FAILURES] = service, on_disk, LogThrottle()
    app[CONTROL] = control = control or SiteControl()
    app[SETUP] = SetupSession(control.path or Path())
    add_trials(app)
    app[EVENTS], app[TRAFFIC] = Events(service), Traffic()
    for slots in (VIEWER_SLOTS, EVENT_SLOTS, SEARCH_SLOTS, RENDER_SLOTS):
        app[slots] = FairShare()
    app[HLS_SESSIONS] = HlsSessions(service.streams.segment_plan.target_s, app[VIEWER_SLOTS])
    app[WHEP_SESSIONS] = WhepSessions(service.config.site.fps, app[TRAFFIC])
    app[openapi.DESCRIPTION] = openapi.ApiDescription(app)
    config = service.config
    authenticator = Authenticator(
        config.access.tokens,
        f"{config.site.name}_{config.view.sharding.index}",
        numbered_since=service.people.numbered_since,
    )
    app[ACCESS] = AccessControl(authenticator, service.people.current_number, config.access.blur)
    is_open = config.access.tokens is None and config.access.open_to_all
    service.sites.accept_tokens(lambda: None if is_open else authenticator.tokens_of_viewers())
    register_metrics(app)
    for module in _ROUTES:
        app.add_routes(module.routes)
    app.on_response_prepare.extend(
        (app[TRAFFIC].count_body, remove_cors_header, forbid_shared_caching, note_begun)
    )
    app.cleanup_ctx.append(_background_tasks)
    app.on_shutdown.append(_end_streams)
    return app


@asynccontextmanager
async def serving(app: web.Application, settings: HttpSettings) -> AsyncIterator[int]:
    """Serve the application; yield the port.

    Raises:
        UserError: the port cannot be listened on, or the certificate cannot be read.
    """
    certificate = Certificate.of(settings.tls)
    handling = {
        "access_log": None,
        "logger": AIOHTTP_LOG,
        "keepalive_timeout": settings.keepalive_timeout_s,
    }
    # Bodies are not decompressed: a small body that expands to a huge one would block all streams.
    runner = web.AppRunner(app, shutdown_timeout=_SHUTDOWN_TIMEOUT_S, handler_cancellation=True)
    await runner.setup()
    assert runner.server is not None  # noqa: S101 — setup() has created it
    runner.server.request_handler = refuse_expectations(runner.server.request_handler)
    context = None if certificate is None else certificate.context
    limits = _limits(app[SERVICE].config.model_copy(update={"http": settings}))
    listener = Listener(runner.server, ConnectionLimiter(limits), context, auto_decompress=False, **handling)
    certificate_task = (
        None if certificate is None else asyncio.create_task(certificate.run(), name="certificate")
    )
    try:
        async with AsyncExitStack() as stack:
            try:
                port = await stack.enter_async_context(listener.listening(settings.host, settings.port))
            except OSError as error:
                reason = reason_of(error)
                raise UserError(
                    f"http.port: cannot listen on {settings.host}:{settings.port}: {reason}"
                ) from error
            yield port
    finally:
        if certificate_task is not None:
            certificate_task.cancel()
        await runner.cleanup()


def _limits(config: Config) -> ConnectionLimits:
    """Return the configured connection limits, lowered to fit the limit of open files."""
    http, descriptors = config.http, descriptor_limit()
    most = connection_limit(config, descriptors)
    if most < http.connections:
        log.warning(
            "%d files may be open (ulimit -n): %d connections are accepted, not %d (http.connections_max)",
            descriptors,
            most,
            http.connections,
        )
    return ConnectionLimits(
        most=most,
        per_address=min(most, http.connections_per_address or math.ceil(most / 2)),
        for_operators=FOR_OPERATORS,
        request_s=http.request_timeout_s,
        keepalive_s=http.keepalive_timeout_s,
    )


async def _background_tasks(app: web.Application) -> AsyncIterator[None]:
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
    app[SERVICE].streams.close()
    await app[WHEP_SESSIONS].close()
    await app[SERVICE].rendering.close()
    await app[SERVICE].calibration.close()
