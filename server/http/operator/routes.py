"""All of the operator's addresses."""

from __future__ import annotations

from server.http.operator import cameras, downloads, page, people, pointing, settings, walk

routes = [
    *page.routes,
    *cameras.routes,
    *settings.routes,
    *people.routes,
    *pointing.routes,
    *downloads.routes,
    *walk.routes,
]
