"""For how long a certificate is good, as TLS itself sees it: by a handshake that stays in this process."""

from __future__ import annotations

import ssl
import time
from pathlib import Path

from server.run.doctor_findings import Finding, bad, ok, warning

_SOON_DAYS = 14
_DAY_S = 86_400
_NEW_ONE = "have a new one made; the running site takes it without a restart"


def certificate_finding(check: str, certificate: Path, key: Path) -> Finding:
    """Say whether a certificate goes with its key, and how long it is good."""
    try:
        days = days_left(certificate, key)
    except ssl.SSLCertVerificationError as error:
        return bad(check, f"{certificate}: {error.verify_message}", _NEW_ONE)
    except (ssl.SSLError, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or getattr(error, "reason", None) or str(error)
        return bad(check, f"{certificate} and {key} are no certificate and its key: {reason}", "both as PEM")
    text = f"{certificate} is good for {days:.0f} days"
    return warning(check, text, _NEW_ONE) if days < _SOON_DAYS else ok(check, text)


def days_left(certificate: Path, key: Path) -> float:
    """Give the days until a certificate ends.

    Raises:
        ssl.SSLCertVerificationError: it has ended, or has not begun.
        ssl.SSLError, OSError, ValueError: the files are no certificate and its key.
    """
    server = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    server.load_cert_chain(certificate, key, password=_no_password)
    trusting = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trusting.check_hostname = False  # whose it is is not asked, only until when
    trusting.load_verify_locations(certificate)
    trusting.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    one = trusting.wrap_bio(back, there, server_side=False)
    other = server.wrap_bio(there, back, server_side=True)
    for side in (one, other, one, other):
        try:
            side.do_handshake()
        except ssl.SSLWantReadError:
            continue
    until = str((one.getpeercert() or {}).get("notAfter"))
    return (ssl.cert_time_to_seconds(until) - time.time()) / _DAY_S


def _no_password() -> str:
    raise ValueError("the key has a password; write it without one")
