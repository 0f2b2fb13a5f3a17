"""The sections of the configuration, one idea per file."""

from server.config.sections.access import Access
from server.config.sections.audio import Sound
from server.config.sections.base import Endpoint, Name, Polygon, Port, Section, Side
from server.config.sections.camera import Camera, Track
from server.config.sections.encode import Encode
from server.config.sections.output import Http, Record, Tls
from server.config.sections.site import Site, Sync, Zenoh, ZenohTls
from server.config.sections.view import TUNED, Flags, Share, View

__all__ = [
    "TUNED",
    "Access",
    "Camera",
    "Encode",
    "Endpoint",
    "Flags",
    "Http",
    "Name",
    "Polygon",
    "Port",
    "Record",
    "Section",
    "Share",
    "Side",
    "Site",
    "Sound",
    "Sync",
    "Tls",
    "Track",
    "View",
    "Zenoh",
    "ZenohTls",
]
