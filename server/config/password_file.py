"""Password files (``name:password`` lines) of the bus and the pulse server."""

from __future__ import annotations

from pathlib import Path

from server.system.errors import UserError, reason_of


def read_users(path: Path, setting: str) -> dict[str, str]:
    """Read the users' passwords by name; ``setting`` is the key that names the file.

    Raises:
        UserError: it cannot be read, or a line is not name:password.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = reason_of(error, "it is not text")
        raise UserError(f"{setting}: cannot read {path}: {reason}") from error
    users: dict[str, str] = {}
    numbers: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        name, colon, password = line.partition(":")
        if not (name and colon and password) or line != line.strip():
            raise UserError(f"{setting}: {path}: line {number} is not name:password")
        if name in users:
            raise UserError(
                f"{setting}: {path}: lines {numbers[name]} and {number} are for the same name: keep one"
            )
        users[name], numbers[name] = password, number
    return users


def password_of(path: Path, name: str, setting: str) -> str:
    """Return a user's password.

    Raises:
        UserError: the file cannot be read, or has no line for this user.
    """
    password = read_users(path, setting).get(name)
    if password is None:
        raise UserError(f"{setting}: {path} has no line for {name!r}, the name of this process")
    return password
