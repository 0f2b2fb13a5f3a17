"""The sections of the configuration, one idea per file."""

from server.wire.sections.access import Access
from server.wire.sections.base import Endpoint, Name, Polygon, Port, Section, Side
from server.wire.sections.camera import Camera, Track
from server.wire.sections.encode import Encode
from server.wire.sections.serve import Http, Record, Tls
from server.wire.sections.site import Site, Sync, Zenoh, ZenohTls
from server.wire.sections.sound import Sound
from server.wire.sections.view import TUNED, Flags, Share, View

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
