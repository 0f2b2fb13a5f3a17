"""Text from elsewhere on its way to a terminal, which would obey some of it."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return a text as one line in which nothing moves the cursor or changes colours."""
    return "".join(it if it.isprintable() else "·" for it in " ".join(text.split()))
