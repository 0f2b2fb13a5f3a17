"""Checks of certificates: validity and hosts, by a TLS handshake within this process."""

from __future__ import annotations

import ssl
import time
from pathlib import Path
from typing import Any

from server.cli.doctor.findings import Finding, bad, ok, warning
from server.system.errors import reason_of

_SOON_DAYS = 14
_DAY_S = 86_400
_RENEW = "renew it; the running site loads it without a restart"
_READABLE = "name another file, or let this user read it"


def certificate_finding(check: str, certificate: Path, key: Path) -> Finding:
    """Check that a certificate matches its key; report its days left and its hosts."""
    for path in (certificate, key):
        if unreadable := _unreadable(path):
            return bad(check, f"{path}: cannot be read: {unreadable}", _READABLE)
    try:
        accepted = handshake(certificate, key, certificate)
    except ssl.SSLCertVerificationError as error:
        return bad(check, f"{certificate}: {error.verify_message}", _RENEW)
    except (ssl.SSLError, OSError, ValueError) as error:
        reason = getattr(error, "reason", None) or str(error)
        return bad(
            check,
            f"{certificate} and {key} are not a certificate and its key: {reason}",
            "both must be PEM files",
        )
    days = (ssl.cert_time_to_seconds(str(accepted.get("notAfter"))) - time.time()) / _DAY_S
    names = ", ".join(name for _, name in accepted.get("subjectAltName", ()))
    text = f"{certificate} is valid for {days:.0f} days, for {names or 'no host: it has no subjectAltName'}"
    return ok(check, text) if days >= _SOON_DAYS and names else warning(check, text, _RENEW)


def router_finding(check: str, certificate: Path, key: Path, authority: Path, host: str) -> Finding | None:
    """Report why clients would refuse a host's certificate; None: they would accept it."""
    try:
        handshake(certificate, key, authority, host)
    except ssl.SSLCertVerificationError as error:
        reason = error.verify_message
        text = f"{certificate}: clients that connect to {host} and trust {authority} refuse it: {reason}"
        return bad(check, text, "use one that this authority has signed for this host: docs/how-to/secure.md")
    except (ssl.SSLError, OSError, ValueError):
        pass  # reported by the check of the files
    return None


def authority_finding(check: str, authority: Path) -> Finding:
    """Check that the file of a certificate authority can be used."""
    if unreadable := _unreadable(authority):
        return bad(check, f"{authority}: cannot be read: {unreadable}", _READABLE)
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(authority)
    except (ssl.SSLError, OSError) as error:
        reason = getattr(error, "reason", None) or error
        return bad(check, f"{authority}: is not a certificate: {reason}", "it must be a PEM file")
    return ok(check, f"{authority} can be read")


def handshake(certificate: Path, key: Path, trusted: Path, host: str | None = None) -> dict[str, Any]:
    """Perform a TLS handshake with a client that trusts ``trusted`` and expects ``host``.

    Returns:
        The server's certificate, as a dictionary of ``getpeercert()``.

    Raises:
        ssl.SSLCertVerificationError: the client refuses the certificate.
        ssl.SSLError, OSError, ValueError: the files are not a certificate and its key.
    """
    server = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    server.load_cert_chain(certificate, key, password=_no_password)
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname = host is not None
    client.load_verify_locations(trusted)
    client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    client_side = client.wrap_bio(to_client, to_server, server_side=False, server_hostname=host)
    server_side = server.wrap_bio(to_server, to_client, server_side=True)
    for side in (client_side, server_side, client_side, server_side):
        try:
            side.do_handshake()
        except ssl.SSLWantReadError:
            continue
    return dict(client_side.getpeercert() or {})


def _unreadable(path: Path) -> str:
    try:
        with path.open("rb"):
            return ""
    except OSError as error:
        return reason_of(error)


def _no_password() -> str:
    raise ValueError("the key has a password; save it without one")
