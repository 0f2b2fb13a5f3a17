"""The viewer: MyView over HTTP from Python, and (in ``page/``) from a browser."""

from client.api import cameras, choice, objects, site
from client.events import events
from client.http import (
    AwayError,
    ClientError,
    ContractError,
    HttpSettings,
    NotFoundError,
    RefusedError,
)
from client.model import Box, Camera, Cameras, Choice, Cut, Event, Gop, Objects, SeenObject, Site
from client.player import Progress, Watched, record, watch

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
    "Watched",
    "cameras",
    "choice",
    "events",
    "objects",
    "record",
    "site",
    "watch",
]
