"""Which codec the streams of a site are of."""

from __future__ import annotations

from server.config.site_config import Config
from server.media.stream_format import Agreement, OwnParameters
from server.media.vp8.stream_format import Vp8Agreement


def agreement_for(config: Config) -> Agreement:
    """Give what all streams of a site are made of, before any picture has come."""
    if config.encode.codec == "vp8":
        return Vp8Agreement(config.site.width, config.site.height)
    return OwnParameters() if config.encode.parameters == "own" else Agreement()
