"""Permissions: what each route requires, and what a token grants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from aiohttp import web

from server.config.sections.access import Blur
from server.config.tokens_file import Token

OPERATOR_PATH = "/api/operator"
SESSION_PATH = "/api/session"


class Permission(Enum):
    """What a route requires of a request's token."""

    PUBLIC = auto()
    """No token: the answer shows nothing of the site."""
    ANY_TOKEN = auto()
    """Any token: the answer is limited to the token's scope."""
    OBJECT = auto()
    """Permission to watch the person whose number is in the path."""
    CAMERA = auto()
    """Permission to watch the camera that is named in the path."""
    SITE = auto()
    """Permission to watch everything."""
    OPERATE = auto()
    """Permission to operate."""


_BY_ROUTE = {
    "/": Permission.PUBLIC,
    "/operator": Permission.PUBLIC,
    "/page/{file}": Permission.PUBLIC,
    "/api": Permission.PUBLIC,
    "/api/openapi.json": Permission.PUBLIC,
    "/healthz": Permission.PUBLIC,
    "/readyz": Permission.PUBLIC,
    SESSION_PATH: Permission.ANY_TOKEN,
    "/api/site": Permission.ANY_TOKEN,
    "/api/delays": Permission.ANY_TOKEN,
    "/api/objects": Permission.ANY_TOKEN,
    "/api/cameras": Permission.ANY_TOKEN,
    "/api/events": Permission.ANY_TOKEN,
    "/api/flags": Permission.ANY_TOKEN,
    "/api/past": Permission.ANY_TOKEN,
    "/api/past/search": Permission.ANY_TOKEN,
    "/api/rules": Permission.SITE,
    "/api/events/{event}/picture.jpg": Permission.SITE,
    "/metrics": Permission.SITE,
}
_BY_PREFIX = {
    "/objects/{object}/": Permission.OBJECT,
    "/api/objects/{object}/": Permission.OBJECT,
    "/cameras/{camera}/": Permission.CAMERA,
    "/api/cameras/{camera}/": Permission.CAMERA,
    f"{OPERATOR_PATH}/": Permission.OPERATE,
}


def permission_for(method: str, route_pattern: str) -> Permission | None:
    """Return the permission that a route pattern requires; None: no rule covers it, so it is refused."""
    if route_pattern == SESSION_PATH and method not in {"GET", "HEAD"}:
        return Permission.PUBLIC  # signing in and out
    by_prefix = (permission for prefix, permission in _BY_PREFIX.items() if route_pattern.startswith(prefix))
    return _BY_ROUTE.get(route_pattern) or next(by_prefix, None)


@dataclass(frozen=True, slots=True)
class Scope:
    """The visible part of a site: everything, one person, or one camera."""

    object: int | None = None
    """Only this person's views, also after their number was merged."""
    camera: str | None = None
    """Only this camera."""
    blur: Blur | None = None
    """Whom the viewer sees pixelated."""

    @property
    def is_everywhere(self) -> bool:
        """Whether all people and all cameras may be seen, pixelated or not."""
        return self.object is None and self.camera is None

    @property
    def is_all(self) -> bool:
        """Whether everything may be seen."""
        return self.is_everywhere and self.blur is None


ALL = Scope()


@dataclass(frozen=True, slots=True)
class ClientIdentity:
    """The client whose share of slots a request counts towards."""

    key: str
    """The token, or the network where there are no tokens."""
    is_operator: bool = False


@dataclass(frozen=True, slots=True)
class Grant:
    """What a request may see, and whether it may operate."""

    scope: Scope = ALL
    is_operator: bool = False
    name: str | None = None
    """The token's name; None: there are no tokens."""

    @classmethod
    def of(cls, token: Token) -> Grant:
        """Return the grant of a token."""
        return cls(Scope(token.object, token.camera, token.blur), token.role == "operate", token.name)

    def allows(self, permission: Permission, request: web.Request, resolve: Callable[[int], int]) -> bool:
        """Return whether a permission is granted; ``resolve`` maps merged numbers to current ones."""
        scope, names = self.scope, request.match_info
        match permission:
            case Permission.PUBLIC | Permission.ANY_TOKEN:
                return True
            case Permission.OBJECT:
                return scope.is_everywhere or (
                    scope.object is not None
                    and resolve(scope.object) == resolve(int(names["object"]))
                    and "camera" not in request.query  # a fixed camera shows more than the person
                )
            case Permission.CAMERA:
                return scope.is_everywhere or scope.camera == names["camera"]
            case Permission.SITE:
                return scope.is_all
            case Permission.OPERATE:
                return self.is_operator

    def __str__(self) -> str:
        """Return the grant in words, for errors."""
        if self.is_operator:
            return "operating"
        blurred = "" if self.scope.blur is None else f", with {self.scope.blur} blurred"
        if self.scope.object is not None:
            return f"watching object {self.scope.object}{blurred}"
        return f"watching{'' if self.scope.camera is None else f' camera {self.scope.camera}'}{blurred}"
