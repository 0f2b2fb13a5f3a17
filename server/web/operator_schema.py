"""What the operator's addresses answer. ``/api/openapi.json`` is made from these, too."""

from __future__ import annotations

import msgspec


class OperatorSession(msgspec.Struct, frozen=True):
    """That somebody may operate."""

    by_token: bool
    """By a token; else because they are at the server's own machine."""


OPERATOR: dict[str, type[msgspec.Struct]] = {
    "/api/operator/session": OperatorSession,
}
"""What GET of each address answers; what changes something answers with the same, as it is then."""
