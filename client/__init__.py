"""The viewer: MyView over HTTP from Python, and (in ``page/``) from a browser."""

from client.api import cameras, choice, objects, past, site, spans
from client.events import events
from client.http import (
    AwayError,
    ClientError,
    ContractError,
    HttpSettings,
    NotFoundError,
    RefusedError,
)
from client.model import Box, Camera, Cameras, Choice, Cut, Event, Gop, Objects, SeenObject, Site, Span
from client.player import Watched, record, watch
from client.session import Progress

__all__ = [
    "AwayError",
    "Box",
    "Camera",
    "Cameras",
    "Choice",
    "ClientError",
    "ContractError",
    "Cut",
    "Event",
    "Gop",
    "HttpSettings",
    "NotFoundError",
    "Objects",
    "Progress",
    "RefusedError",
    "SeenObject",
    "Site",
    "Span",
    "Watched",
    "cameras",
    "choice",
    "events",
    "objects",
    "past",
    "record",
    "site",
    "spans",
    "watch",
]
