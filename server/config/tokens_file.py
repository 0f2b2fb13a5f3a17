"""The token file: access rights of viewers and operators, with the SHA-256 of each token.

A token is 256 random bits, so it needs no slow hash; every request is checked, so a slow one would let
clients overload the server.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, Field, ValidationError, model_validator

from server.config.sections.access import Blur
from server.config.sections.base import Identifier, Section, matching
from server.config.values import check_depth_and_texts, redact_and_abbreviate
from server.config.yaml_file import read_yaml
from server.system.errors import UserError

Role = Literal["watch", "operate"]


class Token(Section):
    """One token and its access rights."""

    name: Annotated[
        str,
        matching(r"[^\x00-\x1f\x7f]{1,64}", "has 1 to 64 characters that print"),
    ]
    """The owner's name, which is not secret."""
    sha256: Annotated[str, matching(r"[0-9a-f]{64}", "is not the sum that `myview token` prints")]
    role: Role
    object: Annotated[int, Field(ge=1, le=999_999_999)] | None = None
    """Limits the token to this person's views."""
    camera: Identifier | None = None
    """Limits the token to this camera."""
    blur: Blur | None = None
    """Whom its viewers see pixelated."""
    made: AwareDatetime | None = None
    """When it was made. If person numbers have restarted since, a token for an object is void."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.object is not None and self.camera is not None:
            raise ValueError("object, camera: a token is limited to one of them; make two tokens")
        if self.role == "operate" and (self.object is not None or self.camera is not None):
            raise ValueError("role: an operator sees everything: remove object and camera, or set watch")
        if self.role == "operate" and self.blur is not None:
            raise ValueError("role: an operator sees everybody: remove blur, or set watch")
        if self.object is not None and self.made is None:
            raise ValueError(
                "made: is missing, and object numbers hold for one run of the service; "
                "`myview token` writes it"
            )
        return self


def secret_digest(secret: str) -> str:
    """Return the SHA-256 of a token, in hex as in the file, or of a session identifier."""
    # HTTP headers may hold any bytes.
    return hashlib.sha256(secret.encode(errors="surrogatepass")).hexdigest()


def read_tokens(path: Path) -> tuple[Token, ...]:
    """Read a token file.

    Raises:
        UserError: it cannot be read or is invalid.
    """
    content = read_yaml(path, "the tokens")
    check_depth_and_texts(content, str(path))
    listed = content.get("tokens") if isinstance(content, dict) and len(content) == 1 else None
    if not isinstance(listed, list):
        raise UserError(f"{path}: is not a list of tokens: it begins with 'tokens:', one token per line")
    tokens = tuple(_token(path, number, entry) for number, entry in enumerate(listed))
    for field in ("name", "sha256"):
        counts = Counter(getattr(token, field) for token in tokens)
        duplicate = next((value for value, count in counts.items() if count > 1), None)
        if duplicate is not None:
            numbers = [number for number, token in enumerate(tokens) if getattr(token, field) == duplicate]
            places = " and ".join(f"tokens.{number}" for number in numbers[:2])
            raise UserError(f"{path}: {places}: have the same {field}, {duplicate}; each needs its own")
    return tokens


def _token(path: Path, number: int, content: Any) -> Token:
    try:
        return Token.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(
            ["tokens", str(number), *(redact_and_abbreviate(str(part)) for part in first["loc"])]
        )
        reason = "unknown key" if first["type"] == "extra_forbidden" else first["msg"]
        line = f"{path}: {place}: {reason.removeprefix('Value error, ')}"
        raise UserError(" ".join(line.split())) from None
