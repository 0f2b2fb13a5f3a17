"""Types that all sections of the configuration share."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

Polygon = Annotated[list[tuple[float, float]], Field(min_length=3)]
"""Corners in pixels of the camera's own picture."""


def matching(pattern: str, otherwise: str) -> AfterValidator:
    """Return a validator of texts that match a pattern as a whole; it says ``otherwise`` of others."""

    def check(value: str) -> str:
        if not re.fullmatch(pattern, value):
            raise ValueError(otherwise)
        return value

    return AfterValidator(check)


IDENTIFIER = r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}"
IDENTIFIER_RULE = (
    "a name has letters from a to z, digits, - and _, at most 32, and begins with a letter or digit"
)

Identifier = Annotated[str, matching(IDENTIFIER, IDENTIFIER_RULE)]
"""A name that fits into a zenoh key, a URL and a file name."""

PageUrl = Annotated[
    str, matching(r"https?://[^\s/?#]+(/[^\s?#]*)?", "is not an address such as http://127.0.0.1:8081/")
]
"""Base URL of a best-view service."""


def _even(value: int) -> int:
    if value % 2:
        raise ValueError("must be even: H.264 stores color at half the size")
    return value


def _endpoint(value: str) -> str:
    match = _ENDPOINT.fullmatch(value)
    if match is None or not 0 < int(match["port"]) <= _PORT_MOST:
        raise ValueError("is not an address such as tcp/127.0.0.1:7447")
    return value


_ENDPOINT = re.compile(r"[a-z]+/[^\s/]+:(?P<port>[0-9]{1,5})([?#]\S*)?")
_PORT_MOST = 65535

Endpoint = Annotated[str, AfterValidator(_endpoint)]
"""Where zenoh listens: protocol/host:port."""


def _joined(value: object) -> object:
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else value


def _endpoints(value: str) -> str:
    return ",".join(map(_endpoint, value.split(",")))


Endpoints = Annotated[str, BeforeValidator(_joined), AfterValidator(_endpoints)]
"""Where zenoh connects to: endpoints separated by commas; a list is joined."""

PictureSide = Annotated[int, Field(ge=16, le=8192), AfterValidator(_even)]
"""Width or height of a picture in pixels; x264 cannot encode much smaller or larger ones."""

Port = Annotated[int, Field(ge=1, le=_PORT_MOST)]

OffsetSeconds = Annotated[float, Field(ge=-86_400, le=86_400)]
"""Seconds by which a recording begins later than the others; below 0 earlier."""


class Section(BaseModel):
    """A section of the configuration; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)
