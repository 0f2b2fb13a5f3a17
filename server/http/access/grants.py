"""What somebody may, and what each address asks of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from aiohttp import web

from server.config.tokens_file import Token

OPERATING = "/api/operator"
SESSION = "/api/session"


class Need(Enum):
    """What an address asks of whoever wants its answer."""

    NOTHING = auto()
    """Nothing of the site is in it."""
    TOKEN = auto()
    """Any token: the answer has in it what that token may see, and no more."""
    OBJECT = auto()
    """To watch the person whose number is in the address."""
    CAMERA = auto()
    """To watch the camera that is named in the address."""
    ALL = auto()
    """To watch everything."""
    OPERATOR = auto()


_NEEDS = {
    "/": Need.NOTHING,
    "/operator": Need.NOTHING,
    "/page/{file}": Need.NOTHING,
    "/api": Need.NOTHING,
    "/api/openapi.json": Need.NOTHING,
    "/healthz": Need.NOTHING,
    "/readyz": Need.NOTHING,
    SESSION: Need.TOKEN,
    "/api/site": Need.TOKEN,
    "/api/objects": Need.TOKEN,
    "/api/cameras": Need.TOKEN,
    "/api/events": Need.TOKEN,
    "/api/flags": Need.TOKEN,
    "/api/past": Need.TOKEN,
    "/metrics": Need.ALL,
}
_BELOW = {
    "/objects/{object}/": Need.OBJECT,
    "/api/objects/{object}/": Need.OBJECT,
    "/cameras/{camera}/": Need.CAMERA,
    "/api/cameras/{camera}/": Need.CAMERA,
    f"{OPERATING}/": Need.OPERATOR,
}


def need_of(method: str, path: str) -> Need | None:
    """Say what an address asks for, by its pattern; None: nobody has decided, and so nobody may."""
    if path == SESSION and method not in {"GET", "HEAD"}:
        return Need.NOTHING  # signing in and out
    below = (need for begin, need in _BELOW.items() if path.startswith(begin))
    return _NEEDS.get(path) or next(below, None)


@dataclass(frozen=True, slots=True)
class Scope:
    """What somebody may see of a site: everything, or one person, or one camera."""

    object: int | None = None
    """Nobody but this person's views, whatever number they have become."""
    camera: str | None = None
    """Nothing but this camera."""

    @property
    def is_all(self) -> bool:
        """Whether everything may be seen."""
        return self.object is None and self.camera is None


ALL = Scope()


@dataclass(frozen=True, slots=True)
class ShareHolder:
    """In whose name somebody comes: what there is of places is shared out among those."""

    key: str
    """By it they are told apart: a token, or an address."""
    operates: bool = False


@dataclass(frozen=True, slots=True)
class Grant:
    """What somebody may."""

    sees: Scope = ALL
    operates: bool = False
    name: str | None = None
    """Of the token; None: there are no tokens."""

    @classmethod
    def of(cls, token: Token) -> Grant:
        """Give what a token lets do."""
        return cls(Scope(token.object, token.camera), token.role == "operate", token.name)

    def allows(self, need: Need, request: web.Request, resolve: Callable[[int], int]) -> bool:
        """Say whether this is enough; ``resolve`` gives the number that a merged one goes by now."""
        sees, names = self.sees, request.match_info
        match need:
            case Need.NOTHING | Need.TOKEN:
                return True
            case Need.OBJECT:
                return sees.is_all or (
                    sees.object is not None
                    and resolve(sees.object) == resolve(int(names["object"]))
                    and "camera" not in request.query  # a view that is held shows the camera, not the person
                )
            case Need.CAMERA:
                return sees.is_all or sees.camera == names["camera"]
            case Need.ALL:
                return sees.is_all
            case Need.OPERATOR:
                return self.operates

    def __str__(self) -> str:
        """Say it in words."""
        if self.operates:
            return "operating"
        if self.sees.object is not None:
            return f"watching object {self.sees.object}"
        return "watching" if self.sees.camera is None else f"watching camera {self.sees.camera}"
