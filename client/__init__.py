"""The Python client of MyView's HTTP interface; ``page/`` is the browser's."""

from client.api import cameras, choice, delays, elsewhere, objects, past, site, spans
from client.deletion import PersonDeletion, delete_person, plan_deletion
from client.events import events
from client.http import (
    AwayError,
    ClientError,
    ContractError,
    HttpSettings,
    NotFoundError,
    RefusedError,
    ServerError,
)
from client.model import (
    Box,
    Camera,
    Cameras,
    Choice,
    Cut,
    Delay,
    Event,
    Flag,
    Gop,
    Objects,
    PersonElsewhere,
    SeenObject,
    Site,
    Span,
)
from client.player import WatchResult, record, watch
from client.session import Progress
from client.status.model import CameraNow, PersonNow, ServiceNow, SiteNow
from client.status.query import status

__all__ = [
    "AwayError",
    "Box",
    "Camera",
    "CameraNow",
    "Cameras",
    "Choice",
    "ClientError",
    "ContractError",
    "Cut",
    "Delay",
    "Event",
    "Flag",
    "Gop",
    "HttpSettings",
    "NotFoundError",
    "Objects",
    "PersonDeletion",
    "PersonElsewhere",
    "PersonNow",
    "Progress",
    "RefusedError",
    "SeenObject",
    "ServerError",
    "ServiceNow",
    "Site",
    "SiteNow",
    "Span",
    "WatchResult",
    "cameras",
    "choice",
    "delays",
    "delete_person",
    "elsewhere",
    "events",
    "objects",
    "past",
    "plan_deletion",
    "record",
    "site",
    "spans",
    "status",
    "watch",
]
