"""Tokens in playlists: segments are named with the token that the playlist was requested with."""

from __future__ import annotations

import re
from http import HTTPStatus
from urllib.parse import quote

from aiohttp import web

_URI = re.compile(r'(?<=URI=")[^"]*')


def with_token(request: web.Request, response: web.Response) -> web.Response:
    """Append the token in the request's query, if any, to every address in a playlist: players add none."""
    token = request.query.get("token")
    if token is not None and response.status == HTTPStatus.OK and response.text is not None:
        query = f"token={quote(token, safe='')}"
        lines = response.text.split("\n")  # thousands, and in most there is no address
        response.text = "\n".join(
            [it if it.startswith("#EXTINF") else _with_query(it, query) for it in lines]
        )
    return response


def _with_query(line: str, query: str) -> str:
    if line.startswith("#"):
        return _URI.sub(lambda uri: _append(uri[0], query), line)
    return _append(line, query) if line else line


def _append(address: str, query: str) -> str:
    return f"{address}{'&' if '?' in address else '?'}{query}"
