"""TLS certificates made by openssl."""

from __future__ import annotations

import subprocess
from pathlib import Path

from server.config.sections import TlsSettings


def make_certificate(folder: Path, name: str) -> TlsSettings:
    """Create a self-signed certificate for a host name, and its key."""
    folder.mkdir(exist_ok=True)
    tls = TlsSettings(certificate=folder / "certificate.pem", key=folder / "key.pem")
    request = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
    request += ["-days", "2", "-subj", f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1"]
    request += ["-out", str(tls.certificate), "-keyout", str(tls.key)]
    subprocess.run(request, check=True, capture_output=True)
    return tls
