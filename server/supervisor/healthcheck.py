"""Health check of a container that runs one process of a site.

    python -m server.supervisor.healthcheck sync | bestview | rtsp | camera ID

Exit code 0: healthy; 1: unhealthy, with a one-line reason for the container engine. It runs every few seconds
beside each process, so it loads little: no configuration, only environment variables of the compose files.
``MYVIEW_HEALTH_URL`` is the best view's address, or those of the services that replace each other, separated
by commas; ``MYVIEW_HEALTH_CERTIFICATE`` the file of its certificate, and ``MYVIEW_HEALTH_TOKEN`` (a file) or
``MYVIEW_TOKEN`` the token.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import socket
import ssl
import sys
import urllib.parse
import urllib.request
from collections.abc import Sequence
from pathlib import Path

_URL = "http://bestview:8080"
_SYNC_PORT, _RTSP_PORT = "7400", "8554"
_TIMEOUT_S = 4.0
"""Of each service; the container engine waits 10 s."""


class UnhealthyError(Exception):
    """A failed health check; the text is one line."""


def check_pulse_server() -> None:
    """Check whether the pulse server sends its greeting.

    Raises:
        UnhealthyError: it does not.
        OSError: the server does not answer.
    """
    address = "127.0.0.1", int(os.environ.get("MYVIEW_SYNC__PORT", _SYNC_PORT))
    with contextlib.ExitStack() as opened:
        server = opened.enter_context(socket.create_connection(address, timeout=_TIMEOUT_S))
        if authority := os.environ.get("MYVIEW_SYNC__TLS__AUTHORITY"):
            tls = ssl.create_default_context(cafile=authority)
            tls.check_hostname = False  # the certificate names the public host
            server = opened.enter_context(tls.wrap_socket(server))
        if not server.recv(64).startswith((b"MYVIEW-SYNC", b"LOGIN-REQUIRED")):
            raise UnhealthyError("the answer is not a pulse server's")


def check_service() -> None:
    """Check whether the best-view service in this container answers.

    Raises:
        OSError: it does not.
    """
    service = urllib.parse.urlsplit(_services()[0])
    # Not by its name, which Swarm resolves only once the service is healthy.
    port = service.port or (443 if service.scheme == "https" else 80)
    _get(f"{service.scheme}://127.0.0.1:{port}", "/healthz")


def check_gateway() -> None:
    """Check whether the RTSP gateway answers.

    Raises:
        UnhealthyError: the answer is not an RTSP server's.
        OSError: it does not.
    """
    address = "127.0.0.1", int(os.environ.get("MYVIEW_RTSP__PORT", _RTSP_PORT))
    with contextlib.ExitStack() as opened:
        gateway = opened.enter_context(socket.create_connection(address, timeout=_TIMEOUT_S))
        if certificate := os.environ.get("MYVIEW_RTSP__TLS__CERTIFICATE"):
            gateway = opened.enter_context(_trust_exactly(certificate).wrap_socket(gateway))
        gateway.sendall(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n")
        if not gateway.recv(64).startswith(b"RTSP/1.0"):
            raise UnhealthyError("the answer is not an RTSP server's")


def check_camera_frames(camera: str) -> None:
    """Check whether a camera's frames arrive at the best view, at one of its services.

    Raises:
        UnhealthyError: they do not.
        OSError: the best view is unreachable.
    """
    *others, last = _services()
    for service in others:
        with contextlib.suppress(UnhealthyError, OSError, http.client.HTTPException):
            _check_frames_at(service, camera)
            return
    _check_frames_at(last, camera)


def _check_frames_at(service: str, camera: str) -> None:
    answer = json.loads(_get(service, "/api/cameras"))
    known = {camera["camera"]: camera for camera in answer["cameras"]}
    if camera not in known:
        raise UnhealthyError(f"the best view knows no camera {camera}, or the token is for another one")
    if known[camera]["state"] != "live" or not known[camera]["fps"] > 0:
        raise UnhealthyError(
            f"{camera} is {known[camera]['state']}: {known[camera]['message'] or 'no frames'}"
        )


def _services() -> list[str]:
    return [url.strip() for url in (os.environ.get("MYVIEW_HEALTH_URL") or _URL).split(",")]


def _get(url: str, path: str) -> bytes:
    request = urllib.request.Request(url.rstrip("/") + path)  # noqa: S310 — the address is from the compose files
    token = _token()
    if token:
        request.add_header("Authorization", f"Bearer {token}")
    # No proxy, even if the engine sets one for all containers: it cannot resolve the site's host names.
    opener = urllib.request.build_opener(
        urllib.request.ProxyHandler({}), urllib.request.HTTPSHandler(context=_trust())
    )
    with opener.open(request, timeout=_TIMEOUT_S) as response:
        body: bytes = response.read()
    return body


def _token() -> str:
    file = os.environ.get("MYVIEW_HEALTH_TOKEN")
    return Path(file).read_text(encoding="ascii").strip() if file else os.environ.get("MYVIEW_TOKEN", "")


def _trust() -> ssl.SSLContext | None:
    """Trust exactly the service's certificate: it names the public host, not the one used here."""
    file = os.environ.get("MYVIEW_HEALTH_CERTIFICATE")
    return _trust_exactly(file) if file else None


def _trust_exactly(file: str) -> ssl.SSLContext:
    trust = ssl.create_default_context(cafile=file)
    trust.check_hostname = False
    trust.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    return trust


def check(words: Sequence[str]) -> None:
    """Run the check that the arguments name.

    Raises:
        UnhealthyError, OSError, ValueError, KeyError, TypeError, http.client.HTTPException: the check failed.
    """
    match words:
        case ["sync"]:
            check_pulse_server()
        case ["bestview"]:
            check_service()
        case ["rtsp"]:
            check_gateway()
        case ["camera", camera]:
            check_camera_frames(camera)
        case _:
            raise UnhealthyError("name what to check: sync, bestview, rtsp or camera ID")


def main(words: Sequence[str]) -> int:
    """Run the check and return the exit code."""
    try:
        check(words)
    except (UnhealthyError, OSError, ValueError, KeyError, TypeError, http.client.HTTPException) as error:
        print(f"{' '.join(words)}: {' '.join(str(error).split())}")  # noqa: T201 — for the container engine
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
