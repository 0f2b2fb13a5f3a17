"""Addresses as they may be shown: what a camera wants to hear from us is nobody else's business."""

from __future__ import annotations

import re

HIDDEN = "(not shown)"
SECRET_WORDS = "pas|pwd|psw|token|secret|key|auth"  # noqa: S105 — parts of names
"""What a name has in it whose value is a password or as good as one."""
_LOGIN = re.compile(r"(?<=://)[^/\s]+@")
_QUERY = re.compile(rf"((?:(?:{SECRET_WORDS})[^=&?/#\s]*|(?<![a-z])pw)=)[^&#\s]*", re.IGNORECASE)
"""Some cameras have their password in the path, as ``user=…_password=…_channel=1``."""


def shown(text: str) -> str:
    """Take passwords out of an address, or of a text in which there is one."""
    return _QUERY.sub(rf"\1{HIDDEN}", _LOGIN.sub(f"{HIDDEN}@", text)) if "://" in text else text
