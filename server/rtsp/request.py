"""RTSP requests: which stream of the service they mean, and with which token."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass, field

_STREAM_PATH = re.compile(
    r"/(?:objects/(?P<object>[0-9]{1,9})|cameras/(?P<camera>[A-Za-z0-9][A-Za-z0-9_-]{0,31}))"
)
_CONTROL = re.compile(r"/stream=[0-9]{1,3}$")
"""What SETUP adds to the path of a stream."""
_MAX_BYTES = 2048


@dataclass(frozen=True, slots=True)
class StreamAddress:
    """A stream of the service, and the token with which it is asked for."""

    path: str
    """Path on the service, such as ``/cameras/c1/live.mp4``."""
    token: str | None = field(default=None, repr=False)

    @property
    def is_paced(self) -> bool:
        """Whether samples come earlier than they are due: best views come in whole GOPs."""
        return self.path.startswith("/objects/")


def mount_of(path: str) -> str:
    """Return the place of a request's stream in the server: its path without a track's control."""
    return _CONTROL.sub("", path.rstrip("/"))


def stream_address(mount: str, authorization: str | None) -> StreamAddress | None:
    """Return which stream a request wants, with its token; None: there is none.

    The token is the password of Basic authentication (RFC 7826, 19.1), whatever the name; or the name
    without a password. Not ``?token=``: clients and server disagree where it stands in later requests.
    """
    match = _STREAM_PATH.fullmatch(mount)
    if match is None:
        return None
    camera, token = match["camera"], _basic_token(authorization)
    return StreamAddress(
        f"/objects/{match['object']}/best.mp4" if camera is None else f"/cameras/{camera}/live.mp4", token
    )


def _basic_token(authorization: str | None) -> str | None:
    kind, _, encoded = (authorization or "").partition(" ")
    if kind.lower() != "basic" or len(encoded) > _MAX_BYTES:
        return None
    try:
        name, _, password = base64.b64decode(encoded, validate=True).decode().partition(":")
    except ValueError:
        return None
    return password or name or None
