"""All of the operator's addresses."""

from __future__ import annotations

from server.web import (
    operator_cameras,
    operator_past,
    operator_people,
    operator_pointing,
    operator_session,
    operator_settings,
    operator_walk,
)

routes = [
    *operator_session.routes,
    *operator_cameras.routes,
    *operator_settings.routes,
    *operator_people.routes,
    *operator_pointing.routes,
    *operator_past.routes,
    *operator_walk.routes,
]
