"""Access to the pulse server: client names, passwords and TLS."""

from __future__ import annotations

import ssl

from camsync import Credentials
from camsync.protocol import is_password
from server.config.password_file import password_of, read_users
from server.config.site_config import Config
from server.system.errors import UserError, reason_of

SETTING = "sync.users"


def bestview_client_name(index: int) -> str:
    """Return the client name of a best-view service; the pulse server waits for it before pulse 0."""
    return "bestview" if index == 0 else f"bestview-{index}"


def pulse_clients(config: Config) -> tuple[str, ...]:
    """Return the names of all clients of a site's pulse server: its cameras and its best-view services."""
    return (*config.site_camera_ids, *map(bestview_client_name, range(config.view.sharding.services)))


def pulse_users(config: Config) -> dict[str, str] | None:
    """Read the passwords of all clients; None where no login is needed.

    Raises:
        UserError: the file cannot be read, a password cannot be sent, or a process of the site has none.
    """
    path = config.sync.users
    if path is None:
        return None
    users = read_users(path, SETTING)
    for name, password in users.items():
        _check_password(name, password, str(path))
    missing = [name for name in pulse_clients(config) if name not in users]
    if missing:
        raise UserError(f"{SETTING}: {path} has no line for {', '.join(missing)}: pulses would wait for it")
    return users


def pulse_credentials(config: Config, name: str) -> Credentials | None:
    """Read the credentials of one client; None where no login is needed.

    Raises:
        UserError: the file cannot be read, or has no valid password of this client.
    """
    path = config.sync.users
    if path is None:
        return None
    password = password_of(path, name, SETTING)
    _check_password(name, password, str(path))
    return Credentials(name, password)


def pulse_server_tls(config: Config) -> ssl.SSLContext | None:
    """Load the certificate of the pulse server; None where it has none.

    Raises:
        UserError: the certificate or its key cannot be read, or they do not match.
    """
    tls = config.sync.tls
    if tls.certificate is None or tls.key is None:
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(tls.certificate, tls.key, password="")
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = reason_of(error, "they are not a certificate and its key")
        raise UserError(f"sync.tls: cannot use {tls.certificate} and {tls.key}: {reason}") from error
    return context


def pulse_client_tls(config: Config) -> ssl.SSLContext | None:
    """Load the authority that clients of the pulse server trust; None where pulses are not encrypted.

    Raises:
        UserError: it cannot be read.
    """
    authority = config.sync.tls.authority
    if authority is None:
        return None
    try:
        return ssl.create_default_context(cafile=authority)
    except OSError as error:
        reason = reason_of(error, "it holds no certificate")
        raise UserError(f"sync.tls.authority: cannot use {authority}: {reason}") from error


def _check_password(name: str, password: str, where: str) -> None:
    if not is_password(password):
        raise UserError(
            f"{SETTING}: {where}: the password of {name!r} must have 1 to 128 printable ASCII characters and "
            "no space; `openssl rand -hex 32` makes one"
        )
