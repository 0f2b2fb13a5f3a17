"""The section `access`: tokens, and access without them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from server.config.sections.base import Section

Blur = Literal["others", "everybody"]
"""Whom a viewer sees pixelated: everybody but the person of the stream, or everybody."""


class AccessSettings(Section):
    """Access to the page, the streams and the API."""

    tokens: Path | None = None
    """The token file; none: everyone who reaches `http.host` may watch, only this machine may operate."""
    blur: Blur | None = None
    """Without tokens: whom viewers on other machines see pixelated."""
    open_to_all: bool = False
    """Without tokens, `http.host` may be reached from other machines."""
    hide_after_s: Annotated[float, Field(ge=0.0, le=86_400.0)] = 3.0
    """Seconds unseen by all cameras after which a token for one person shows no live picture of them."""
    trusted_network: bool = False
    """`sync.bind` and `zenoh.listen` may be reached from other machines, without authentication."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.tokens is not None and self.blur is not None:
            raise ValueError("blur: is for sites without access.tokens; with them, each token has its own")
        return self

    @property
    def may_blur(self) -> bool:
        """Whether there may be viewers who see people pixelated."""
        return self.tokens is not None or self.blur is not None
