"""Which codec the streams of a site are of."""

from __future__ import annotations

from server.view.media.agreement import Agreement, OwnParameters
from server.view.media.vp8 import Vp8Agreement
from server.wire.config import Config


def agreement_for(config: Config) -> Agreement:
    """Give what all streams of a site are made of, before any picture has come."""
    if config.encode.codec == "vp8":
        return Vp8Agreement(config.site.width, config.site.height)
    return OwnParameters() if config.encode.parameters == "own" else Agreement()
