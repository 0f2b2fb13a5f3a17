"""The section `access`: tokens, and access without them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from server.config.sections.base import Section


class AccessSettings(Section):
    """Access to the page, the streams and the API."""

    tokens: Path | None = None
    """The token file; none: everyone who reaches `http.host` may watch, only this machine may operate."""
    open_to_all: bool = False
    """Without tokens, `http.host` may be reached from other machines."""
    hide_after_s: Annotated[float, Field(ge=0.0, le=86_400.0)] = 3.0
    """Seconds unseen by all cameras after which a token for one person shows no live picture of them."""
    trusted_network: bool = False
    """`sync.bind` and `zenoh.listen` may be reached from other machines, without authentication."""
