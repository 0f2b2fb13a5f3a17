"""Who may watch and operate, and how far the site is open without that."""

from __future__ import annotations

from pathlib import Path

from server.wire.sections.base import Section


class Access(Section):
    """Who may what."""

    tokens: Path | None = None
    """The file of tokens; none: whoever reaches `http.host` may watch, and only this machine may operate."""
    open_to_all: bool = False
    """Without tokens, `http.host` may be reached from other machines."""
    trusted_network: bool = False
    """`sync.bind` and `zenoh.listen` may be reached from other machines: whoever does is believed."""
