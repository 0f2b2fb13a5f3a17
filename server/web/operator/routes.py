"""All of the operator's addresses."""

from __future__ import annotations

from server.web.operator import cameras, page, past, people, pointing, settings, walk

routes = [
    *page.routes,
    *cameras.routes,
    *settings.routes,
    *people.routes,
    *pointing.routes,
    *past.routes,
    *walk.routes,
]
