"""Permissions: what each route requires, and what a token grants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from aiohttp import web

from server.config.tokens_file import Token

OPERATOR_PATH = "/api/operator"
SESSION_PATH = "/api/session"


class Permission(Enum):
    """What a route requires of whoever requests it."""

    PUBLIC = auto()
    """Nothing: the answer shows nothing of the site."""
    ANY_TOKEN = auto()
    """Any token: the answer shows what that token may see, and no more."""
    OBJECT = auto()
    """To watch the person whose number is in the path."""
    CAMERA = auto()
    """To watch the camera that is named in the path."""
    SITE = auto()
    """To watch everything."""
    OPERATE = auto()
    """To operate."""


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
    "/api/objects": Permission.ANY_TOKEN,
    "/api/cameras": Permission.ANY_TOKEN,
    "/api/events": Permission.ANY_TOKEN,
    "/api/flags": Permission.ANY_TOKEN,
    "/api/past": Permission.ANY_TOKEN,
    "/metrics": Permission.SITE,
}
_BY_PREFIX = {
    "/objects/{object}/": Permission.OBJECT,
    "/api/objects/{object}/": Permission.OBJECT,
    "/cameras/{camera}/": Permission.CAMERA,
    "/api/cameras/{camera}/": Permission.CAMERA,
    f"{OPERATOR_PATH}/": Permission.OPERATE,
}


def permission_for(method: str, path: str) -> Permission | None:
    """Return what a route requires, by its pattern; None: no rule covers it, and so it is refused."""
    if path == SESSION_PATH and method not in {"GET", "HEAD"}:
        return Permission.PUBLIC  # signing in and out
    by_prefix = (permission for prefix, permission in _BY_PREFIX.items() if path.startswith(prefix))
    return _BY_ROUTE.get(path) or next(by_prefix, None)


@dataclass(frozen=True, slots=True)
class Scope:
    """What may be seen of a site: everything, or one person, or one camera."""

    object: int | None = None
    """This person's views alone, whatever number they go by now."""
    camera: str | None = None
    """This camera alone."""

    @property
    def is_all(self) -> bool:
        """Whether everything may be seen."""
        return self.object is None and self.camera is None


ALL = Scope()


@dataclass(frozen=True, slots=True)
class ClientIdentity:
    """Whom a request counts for where slots are shared out."""

    key: str
    """A token, or an address where there are no tokens."""
    is_operator: bool = False


@dataclass(frozen=True, slots=True)
class Grant:
    """What a request may see and do."""

    scope: Scope = ALL
    is_operator: bool = False
    name: str | None = None
    """The token's name; None: there are no tokens."""

    @classmethod
    def of(cls, token: Token) -> Grant:
        """Return what a token grants."""
        return cls(Scope(token.object, token.camera), token.role == "operate", token.name)

    def allows(self, permission: Permission, request: web.Request, resolve: Callable[[int], int]) -> bool:
        """Return whether this permission suffices; ``resolve`` maps merged person numbers to current ones."""
        scope, names = self.scope, request.match_info
        match permission:
            case Permission.PUBLIC | Permission.ANY_TOKEN:
                return True
            case Permission.OBJECT:
                return scope.is_all or (
                    scope.object is not None
                    and resolve(scope.object) == resolve(int(names["object"]))
                    and "camera" not in request.query  # a fixed camera shows more than the person
                )
            case Permission.CAMERA:
                return scope.is_all or scope.camera == names["camera"]
            case Permission.SITE:
                return scope.is_all
            case Permission.OPERATE:
                return self.is_operator

    def __str__(self) -> str:
        """Return it in words."""
        if self.is_operator:
            return "operating"
        if self.scope.object is not None:
            return f"watching object {self.scope.object}"
        return "watching" if self.scope.camera is None else f"watching camera {self.scope.camera}"
