"""A stream of the best-view service over HTTP, as bytes, with the token of the RTSP client that asked.

Who is in another area or site is redirected there (307), and the gateway follows by itself: it is not known
which RTSP gateway another service has, and players follow an RTSP redirect (RFC 2326, 11.3) at the beginning
alone, so that a walk would end their stream.
"""

from __future__ import annotations

import contextlib
import http.client
import re
import socket
import ssl
import threading
import time
import urllib.parse
from collections.abc import Iterator
from dataclasses import dataclass, field

_CONNECT_S = 4.0
"""Seconds for the connection and the answer's head: an RTSP client waits meanwhile."""
_OPEN_S = 8.0
"""Seconds for all redirects together."""
_LATE = "its answer is not complete after {:g} s"
_SILENT_S = 10.0
"""Seconds without a byte after which the service counts as gone: streams have no gaps."""
_READ_BYTES = 65_536
_OK = 200
_UNAUTHORIZED = {401, 403}
_REDIRECTS = {301, 302, 307, 308}
_REDIRECTS_MAX = 4
"""In a row: two services may each believe for a moment that the other one has somebody."""


class StreamRefusedError(Exception):
    """The service does not give the stream: its HTTP status."""

    def __init__(self, status: int) -> None:
        super().__init__(f"the service answers {status}")
        self.status = status


class ServiceAwayError(Exception):
    """The service does not answer, or its stream has broken off."""


@dataclass(frozen=True, slots=True)
class Service:
    """Where the best-view service is."""

    url: str
    certificate: str | None = None
    """PEM file: trust exactly this certificate, whatever host it names; None: the system's authorities."""

    def open(self, path: str, token: str | None) -> ServiceStream:
        """Open a stream, wherever the service redirects to.

        Raises:
            StreamRefusedError: the service refuses it; 401: it needs a token, or another one.
            ServiceAwayError: it does not answer, or redirects to where nothing can be had.
        """
        # In the query, so that a redirect has the token where the other service or site may know it.
        query = "" if token is None else f"?token={urllib.parse.quote(token, safe='')}"
        url, until = urllib.parse.urljoin(self.url, path) + query, time.monotonic() + _OPEN_S
        for number in range(_REDIRECTS_MAX + 1):
            try:
                found = self._request(url, until, is_own=not number)
            except StreamRefusedError as error:
                if number and error.status in _UNAUTHORIZED:
                    raise ServiceAwayError("it redirects to a service that refuses the token") from None
                raise
            if isinstance(found, ServiceStream):
                return found
            url = _redirected(url, found, path)
        raise ServiceAwayError("it redirects too often")

    def _request(self, url: str, until: float, *, is_own: bool) -> ServiceStream | str:
        """Return a stream, or the address to which the server redirects; end at a monotonic time."""
        address = urllib.parse.urlsplit(url)
        is_encrypted = address.scheme == "https"
        # Via: the server's own machine may operate, but what is sent on to other machines may not.
        headers = {"Via": "1.1 myview-rtsp", "User-Agent": "myview-rtsp"}
        connection: http.client.HTTPConnection
        try:
            host, port = address.hostname or "127.0.0.1", address.port
            if is_encrypted:
                trust = self._trust() if is_own else self._trust_of_others()
                connection = http.client.HTTPSConnection(host, port, timeout=_CONNECT_S, context=trust)
            else:
                connection = http.client.HTTPConnection(host, port, timeout=_CONNECT_S)
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise ServiceAwayError(str(error)) from error
        is_late = threading.Event()
        try:
            connection.connect()
            connected = connection.sock  # an answer without keep-alive takes it away
            left_s = max(0.0, until - time.monotonic())
            timer = threading.Timer(left_s, _give_up, [connected, is_late])
            timer.start()
            try:
                target = urllib.parse.urlunsplit(("", "", *address[2:4], ""))
                connection.request("GET", target, headers=headers)
                response = connection.getresponse()
                connected.settimeout(_SILENT_S)
            finally:
                timer.cancel()
        except (OSError, http.client.HTTPException, ValueError) as error:
            connection.close()
            if is_late.is_set():
                raise ServiceAwayError(_LATE.format(_OPEN_S)) from None
            if isinstance(error, OSError):
                raise ServiceAwayError(str(error) or type(error).__name__) from error
            # the text may have the address, with the token
            raise ServiceAwayError(f"it does not answer by HTTP ({type(error).__name__})") from None
        if is_late.is_set():  # a head that is cut off looks complete
            response.close()
            connection.close()
            raise ServiceAwayError(_LATE.format(_OPEN_S))
        if response.status != _OK:
            location = response.getheader("Location")
            response.close()
            connection.close()
            if response.status in _REDIRECTS and location:
                return location
            raise StreamRefusedError(response.status)
        return ServiceStream(response, connected)

    def _trust(self) -> ssl.SSLContext:
        trust = ssl.create_default_context(cafile=self.certificate)
        if self.certificate is not None:
            trust.check_hostname = False  # it names the public host, not the one used here
            trust.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        return trust

    def _trust_of_others(self) -> ssl.SSLContext:
        """Return the context for other services, which are named by their public host."""
        trust = ssl.create_default_context()
        if self.certificate is not None:
            trust.load_verify_locations(self.certificate)
            trust.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        return trust


def _redirected(url: str, location: str, path: str) -> str:
    """Return the address of a redirect, to the stream that was asked for; a person may have another number.

    Raises:
        ServiceAwayError: it leads elsewhere: a foreign site must not make the gateway ask anybody else.
    """
    try:
        found = urllib.parse.urljoin(url, location)
        before, after = urllib.parse.urlsplit(url), urllib.parse.urlsplit(found)
        host, is_valid = after.hostname, after.port != 0 and all("!" <= each <= "~" for each in found)
    except ValueError:
        host, is_valid = None, False
    if not is_valid:
        raise ServiceAwayError("it redirects to an invalid address")
    pattern = re.sub(r"(?<=/objects/)\d+", r"\\d+", re.escape(path))
    if after.scheme not in {"http", "https"} or not host or not re.search(f"{pattern}$", after.path):
        raise ServiceAwayError("it redirects to what is not this stream")
    if before.scheme == "https" and after.scheme == "http":
        raise ServiceAwayError(f"it redirects to {host}, which does not encrypt")
    return found


def _give_up(connected: socket.socket, is_late: threading.Event) -> None:
    is_late.set()
    _shut_down(connected)


def _shut_down(connected: socket.socket) -> None:
    with contextlib.suppress(OSError):
        connected.shutdown(socket.SHUT_RDWR)


@dataclass(frozen=True, slots=True)
class ServiceStream:
    """An open stream."""

    _response: http.client.HTTPResponse = field(repr=False)
    _socket: socket.socket = field(repr=False)

    def blocks(self) -> Iterator[bytes]:
        """Yield the bytes as they come, until the service ends the stream.

        Raises:
            ServiceAwayError: it breaks off, or nothing comes for ten seconds.
        """
        try:
            while block := self._response.read1(_READ_BYTES):
                yield block
        except (
            OSError,
            http.client.HTTPException,
            ValueError,
            AttributeError,
        ) as error:  # the latter two: closed
            raise ServiceAwayError(str(error) or type(error).__name__) from error
        finally:
            self._response.close()

    def close(self) -> None:
        """End it, from any thread."""
        _shut_down(self._socket)
