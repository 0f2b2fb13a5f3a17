"""Sanitizing of external text for a terminal, which would execute control characters."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return a text as one line without control characters."""
    return "".join(char if char.isprintable() else "·" for char in " ".join(text.split()))
