"""Token files with known tokens."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

import yaml

from fakes.service.fed_site import ServedSite, serve_site
from server.config.tokens_file import secret_digest

IN_FUTURE = "2100-01-01T00:00:00Z"
"""Creation time of a token that is newer than any service of a test."""
TOKEN_ENTRIES: dict[str, dict[str, Any]] = {
    "lead": {"role": "operate"},
    "desk": {"role": "watch"},
    "family": {"role": "watch", "object": 1, "made": IN_FUTURE},
    "door": {"role": "watch", "camera": "c0"},
    "guest": {"role": "watch", "blur": "others"},
    "carer": {"role": "watch", "object": 1, "blur": "others", "made": IN_FUTURE},
    "yard": {"role": "watch", "camera": "c0", "blur": "everybody"},
}


def token_of(name: str) -> str:
    return f"token-of-{name}"


def bearer(name: str) -> dict[str, str]:
    """Return the HTTP header with a token."""
    return {"Authorization": f"Bearer {token_of(name)}"}


def token_entry(name: str, **fields: Any) -> dict[str, Any]:
    """Return an entry of the token file."""
    return {"name": name, "sha256": secret_digest(token_of(name)), **(fields or TOKEN_ENTRIES[name])}


def write_tokens(path: Path, *lines: dict[str, Any]) -> Path:
    path.write_text(yaml.safe_dump({"tokens": list(lines)}), encoding="utf-8")
    return path


@asynccontextmanager
async def serve_with_tokens(folder: Path, *names: str, **changes: Any) -> AsyncIterator[ServedSite]:
    """Serve a site that requires tokens; they are in `tokens.yaml` in the folder."""
    path = write_tokens(folder / "tokens.yaml", *map(token_entry, names or TOKEN_ENTRIES))
    access = {"tokens": str(path), **changes.pop("access", {})}
    async with aclosing(serve_site(access=access, **changes)) as sites:
        yield await anext(sites)
