"""All of the operator's addresses."""

from __future__ import annotations

from server.web.operator import cameras, past, people, pointing, session, settings, walk

routes = [
    *session.routes,
    *cameras.routes,
    *settings.routes,
    *people.routes,
    *pointing.routes,
    *past.routes,
    *walk.routes,
]
