"""A playlist names its segments with the token that it was asked for with: players add none."""

from __future__ import annotations

import re
from http import HTTPStatus
from urllib.parse import quote

from aiohttp import web

_URI = re.compile(r'(?<=URI=")[^"]*')


def with_token(request: web.Request, answer: web.Response) -> web.Response:
    """Write the request's token, where it has one in its address, behind every address in a playlist."""
    token = request.query.get("token")
    if token is not None and answer.status == HTTPStatus.OK and answer.text is not None:
        told = f"token={quote(token, safe='')}"
        lines = answer.text.split("\n")  # thousands, and in most there is no address
        answer.text = "\n".join([it if it.startswith("#EXTINF") else _told(it, told) for it in lines])
    return answer


def _told(line: str, token: str) -> str:
    if line.startswith("#"):
        return _URI.sub(lambda found: _and(found[0], token), line)
    return _and(line, token) if line else line


def _and(address: str, token: str) -> str:
    return f"{address}{'&' if '?' in address else '?'}{token}"
