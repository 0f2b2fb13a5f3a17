"""Addresses of cameras: which are accepted, and the separation of a password from the rest."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from urllib.parse import quote, unquote, urlsplit, urlunsplit

from server.config.camera_password import PLACEHOLDER
from server.config.sections.base import IDENTIFIER, IDENTIFIER_RULE
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

_SCHEMES = ("rtsp", "rtsps", "http", "https")
_RTSP = ("rtsp", "rtsps")
_DEVICE = re.compile(r"/dev/(video[0-9]{1,3}|v4l/by-(id|path)/[\w.:+-]{1,200})")
_MAX_ADDRESS = 1000
_MAX_LOGIN = 200
_HELP = "enter an address such as rtsp://10.0.0.11/stream1, http://10.0.0.14/video.mjpeg or /dev/video0"
_LOGIN = "its password has a character that ends the login: enter user and password in their own fields"
_BRACKETS = "an IPv6 address stands in brackets: rtsp://[fe80::1]/stream1"
_NAME_BREAKS = re.compile(r"[^A-Za-z0-9_-]+")
_SERVICE = re.compile(r"bestview(-\d+)?")
_MAX_NAME = 32


@dataclass(frozen=True, slots=True)
class CameraAddress:
    """Where a camera is, with its password apart.

    Attributes:
        source: the configuration's source; if there is a password, with a placeholder for it.
        password: None: there is none.
        options: for FFmpeg's opener.
    """

    source: str
    password: str | None = field(default=None, repr=False)
    options: dict[str, str] = field(default_factory=dict)

    @property
    def with_password(self) -> str:
        """The source to open."""
        password = "" if self.password is None else quote(self.password, safe="")
        return self.source.replace(PLACEHOLDER, password)

    @property
    def shown(self) -> str:
        """The source without anything that may be secret."""
        return redact_to_host(self.source)


@dataclass(frozen=True, slots=True)
class CameraAddresses:
    """Where a camera's streams are: that of its viewers, and that in which people are tracked, if another.

    Raises:
        UserError: both are one, or have different passwords.
    """

    source: CameraAddress
    substream: CameraAddress | None = None

    def __post_init__(self) -> None:
        if self.substream is None:
            return
        if self.substream.source == self.source.source:
            raise UserError("the substream is the stream that viewers get: leave it out")
        if self.substream.password not in {None, self.source.password}:
            raise UserError("the substream's password must be that of the camera")


def parse_addresses(text: str, user: str = "", password: str = "", substream: str = "") -> CameraAddresses:
    """Parse the address of a camera, and that of its substream, if any, with one login.

    Raises:
        UserError: one is not the address of a camera, or they do not go together.
    """
    source = parse_address(text, user, password)
    small = parse_address(substream, user, password) if substream.strip() else None
    return CameraAddresses(source, small)


def parse_address(text: str, user: str = "", password: str = "") -> CameraAddress:
    """Parse an address that a user entered; a login beside it takes precedence over one in it.

    Raises:
        UserError: it is not the address of a camera.
    """
    address = text.strip()
    if max(len(user), len(password)) > _MAX_LOGIN or not (user + password).isprintable():
        raise UserError(f"user and password have at most {_MAX_LOGIN} printable characters")
    if _DEVICE.fullmatch(address):
        return CameraAddress(address)
    if not address or len(address) > _MAX_ADDRESS:
        raise UserError(_HELP)
    _check_login(address)
    if not address.isprintable() or " " in address:
        raise UserError(f"it has a space or an invisible character: write %20 for a space, or {_HELP}")
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise UserError(_HELP if _bare_ipv6(address) is None else _BRACKETS) from None
    if parts.scheme not in _SCHEMES or not host:
        raise UserError(_HELP)
    user = user or unquote(parts.username or "")
    password = password or unquote(parts.password or "")
    place = f"[{host}]" if ":" in host else host
    place = place if port is None else f"{place}:{port}"
    login = (
        f"{quote(user, safe='')}:{PLACEHOLDER}@" if password else f"{quote(user, safe='')}@" if user else ""
    )
    path = parts.path.replace(PLACEHOLDER, quote(PLACEHOLDER))
    source = urlunsplit((parts.scheme, f"{login}{place}", path, parts.query.replace(PLACEHOLDER, ""), ""))
    options = {"rtsp_transport": "tcp"} if parts.scheme in _RTSP else {}
    return CameraAddress(source, password or None, options)


def _check_login(address: str) -> None:
    """Check that a login in an address ends where it seems to.

    Raises:
        UserError: a character of its password ends it earlier: the rest would be shown, as host and path.
    """
    _, scheme_end, rest = address.partition("://")
    place = re.split(r"[/?#\s]", rest, maxsplit=1)[0]
    host, colon, port = place.rpartition("@")[2].partition(":")
    is_login = colon and ("." not in host or not port.isdecimal()) and not host.startswith("[")
    if scheme_end and "@" in rest[len(place) :] and (is_login or "#" in rest):
        raise UserError(_LOGIN)


def _bare_ipv6(address: str) -> re.Match[str] | None:
    return re.match(r"\w+://(?:[^@/]*@)?[0-9A-Fa-f]*:[0-9A-Fa-f]*:[0-9A-Fa-f:.%]*(?:/|$)", address)


def check_name(name: str) -> None:
    """Check a camera's id.

    Raises:
        UserError: it is invalid.
    """
    if not re.fullmatch(IDENTIFIER, name):
        raise UserError(IDENTIFIER_RULE)
    if _SERVICE.fullmatch(name):
        raise UserError(f"a camera is not called {name}, as services are")


def free_name(wanted: str, taken: set[str]) -> str:
    """Return a camera's id that is not taken, made from any text; ``camera-1`` if it has no letters."""
    name = _NAME_BREAKS.sub("-", wanted).strip("-_")[: _MAX_NAME - 3].strip("-_")
    if name and name not in taken and not _SERVICE.fullmatch(name):
        return name
    base = "camera" if not name or _SERVICE.fullmatch(name) else name
    return next(
        candidate
        for candidate in (f"{base}-{number}" for number in range(1, len(taken) + 2))
        if candidate not in taken
    )
