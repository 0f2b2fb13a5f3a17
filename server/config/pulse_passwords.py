"""Who may follow the pulses: the passwords of the processes of a site, where it has such."""

from __future__ import annotations

from collections.abc import Mapping

from camsync import Login
from server.config.password_file import password_of, read_users
from server.config.site_config import Config
from server.messaging.messages import pulse_client
from server.system.errors import UserError

SETTING = "sync.users"
SHORTEST = 32
"""Characters of a password. Whoever overhears a connection can try as many as they have time for."""


def pulse_clients(config: Config) -> tuple[str, ...]:
    """Give the names of all that follow a site's pulses: its cameras, and its best-view services."""
    return (*config.camera_ids, *map(pulse_client, range(config.view.share.of)))


def pulse_users(config: Config) -> dict[str, str] | None:
    """Give the passwords of all that may follow the pulses; None: whoever comes may.

    Raises:
        UserError: they cannot be read, one is too short, or a process of the site has none.
    """
    path = config.sync.users
    if path is None:
        return None
    users = read_users(path, SETTING)
    _check_long(users, str(path))
    missing = [name for name in pulse_clients(config) if name not in users]
    if missing:
        raise UserError(f"{SETTING}: {path} has no line for {', '.join(missing)}: pulses would wait for it")
    return users


def pulse_login(config: Config, name: str) -> Login | None:
    """Give what a process proves itself to the pulse server by; None: it need not.

    Raises:
        UserError: its password cannot be read, or is too short.
    """
    path = config.sync.users
    if path is None:
        return None
    password = password_of(path, name, SETTING)
    _check_long({name: password}, str(path))
    return Login(name, password)


def _check_long(users: Mapping[str, str], where: str) -> None:
    for name, password in users.items():
        if len(password) < SHORTEST:
            raise UserError(
                f"{SETTING}: {where}: the password of {name!r} has less than {SHORTEST} characters: who "
                "overhears it in use could guess it; `openssl rand -hex 32` makes one"
            )
