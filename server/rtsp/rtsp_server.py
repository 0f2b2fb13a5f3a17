"""The RTSP server: GStreamer's, whose media are made of feeds as clients ask for them.

Access is decided by the service alone: a client's token opens the stream there, or does not. Nothing is
shared: each client has a feed and a media of its own, so that none depends on how another comes and leaves.
"""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import gi

for _name in ("Gst", "GstRtsp", "GstRtspServer"):
    gi.require_version(_name, "1.0")
from gi.repository import Gio, GLib, Gst, GstRtsp, GstRtspServer  # noqa: E402

from server.http.access.wrong_token_rate_limit import WrongTokenRateLimit  # noqa: E402
from server.rtsp.feed import Feed, source_name  # noqa: E402
from server.rtsp.request import StreamAddress, mount_of, stream_address  # noqa: E402
from server.rtsp.service_stream import Service, ServiceAwayError, StreamRefusedError  # noqa: E402

log = logging.getLogger(__name__)

_Status = GstRtsp.RTSPStatusCode
_STATUS: Mapping[int, Any] = {401: _Status.UNAUTHORIZED, 403: _Status.FORBIDDEN, 404: _Status.NOT_FOUND}
"""The RTSP status of the service's; others are 503."""
_PAYLOADERS = {
    "h264": "rtph264pay config-interval=0",
    "h265": "rtph265pay config-interval=0",
    "aac": "rtpmp4gpay",
    "opus": "rtpopuspay",
}
_OPENING = GstRtsp.RTSPMethod.DESCRIBE | GstRtsp.RTSPMethod.SETUP
"""Requests that name a stream; others need a session."""
_IDLE_CONNECTIONS = 64
"""Connections beyond `clients_max` that have no stream yet; silent ones are closed after a minute."""
_VALID_KEPT = 1024
_THREADS = 8
"""Threads of clients: opening a stream waits for the service."""
_CLEANUP_S = 5
_CLOSE_AFTER_MS = 500
"""From the end of a stream, which clients are told, to the end of their connections."""
_ACCESS_CHECK = "auth.check.media.factory.access"


@dataclass(frozen=True, slots=True)
class GatewaySettings:
    """The gateway's settings: the section `rtsp`, and where the service is."""

    service: Service
    host: str
    port: int
    clients_max: int
    udp: bool
    certificate: str | None = None
    """PEM file; None: no TLS."""
    key: str | None = None
    """PEM file: its private key."""


class _Factory(GstRtspServer.RTSPMediaFactory):  # type: ignore[misc]
    """Makes the media of the client whose request is being answered."""

    def __init__(self, gateway: Gateway) -> None:
        super().__init__()
        self._gateway = gateway
        protocols = GstRtsp.RTSPLowerTrans.TCP
        if gateway.settings.udp:
            protocols |= GstRtsp.RTSPLowerTrans.UDP
        self.set_protocols(protocols)

    def do_create_element(self, _: Any) -> Gst.Element | None:
        feed = self._gateway.feed_for_media()
        if feed is None:
            return None  # 503
        parts = (
            f"appsrc name={source_name(track)} is-live=true format=time leaky-type=downstream"
            f" ! {_PAYLOADERS[track.codec]} name=pay{number} pt={96 + number}"
            for number, track in enumerate(feed.tracks)
        )
        element = Gst.parse_launch(f"( {' '.join(parts)} )")
        feed.connect(element)
        return element


class _Access(GstRtspServer.RTSPAuth):  # type: ignore[misc]
    """Asks the gateway whether a client may open a stream."""

    def __init__(self, gateway: Gateway) -> None:
        super().__init__()
        self._gateway = gateway
        self.set_supported_methods(GstRtsp.RTSPAuthMethod.BASIC)
        self.set_realm("MyView")

    def do_check(self, context: Any, check: str) -> bool:
        parent = GstRtspServer.RTSPAuth.do_check
        match check:
            case "auth.check.connect":
                return self._gateway.may_connect() and bool(parent(self, context, check))
            case "auth.check.url" if context.method & _OPENING:
                if self._gateway.open_for(context) != _Status.UNAUTHORIZED:
                    return True  # other refusals are answered before the request
                # Without a token this answers 401 and how to authenticate.
                return bool(parent(self, context, _ACCESS_CHECK))
            case "auth.check.transport.client-settings":
                return False  # a client may not let the server send elsewhere
            case _:
                return True


@dataclass(slots=True)
class _Connection:
    """A client's connection: how its last request is answered, and its stream."""

    ip: str
    status: Any = _Status.OK
    feed: Feed | None = None
    is_closed: bool = False


class Gateway:
    """The server and its clients."""

    def __init__(self, settings: GatewaySettings) -> None:
        self.settings = settings
        self._answered: dict[int, _Connection] = {}
        """Whose request each thread is answering; Python forgets what is local to GLib's threads."""
        self._lock = threading.RLock()
        self._connections: dict[Any, _Connection] = {}
        """By client."""
        self._mounts: set[str] = set()
        """Streams that were watched once: the server has a place for each."""
        self._wrong_tokens = WrongTokenRateLimit(time.monotonic)
        self._valid: dict[tuple[str, bytes], None] = {}
        """Addresses and digests of tokens that were right, the oldest first."""
        self._server = GstRtspServer.RTSPServer()
        self._server.set_address(settings.host)
        self._server.set_service(str(settings.port))
        self._server.get_session_pool().set_max_sessions(2 * settings.clients_max)
        access = _Access(self)
        if settings.certificate is not None:
            access.set_tls_certificate(Gio.TlsCertificate.new_from_files(settings.certificate, settings.key))
        self._server.set_auth(access)
        self._factory = _Factory(self)
        self._threads = GstRtspServer.RTSPThreadPool()
        self._threads.set_max_threads(_THREADS)
        self._server.set_thread_pool(self._threads)
        self._server.connect("client-connected", self._on_client)

    @property
    def port(self) -> int:
        """The port that is listened on."""
        return int(self._server.get_bound_port())

    def listen(self) -> bool:
        """Begin to serve; return whether the port could be listened on."""
        if not self._server.attach(None):
            return False
        GLib.timeout_add_seconds(_CLEANUP_S, self._clean_up)
        return True

    def may_connect(self) -> bool:
        """Return whether there is a place for another connection."""
        with self._lock:
            return len(self._connections) < self.settings.clients_max + _IDLE_CONNECTIONS

    def feed_for_media(self) -> Feed | None:
        """Return a feed for a new media of the client that this thread is answering; None: it has none.

        A client that has torn down its media and asks again gets another feed.
        """
        connection = self._answered[threading.get_ident()]
        feed = connection.feed
        if feed is not None and feed.is_connected:
            connection.status = self._open_feed(connection, feed.address)
            feed = connection.feed if connection.status == _Status.OK else None
        return feed

    def open_for(self, context: Any) -> Any:
        """Open the stream of a request; return an RTSP status, which is kept for :meth:`_answer`, too."""
        connection = self._connections.get(context.client, _Connection("", is_closed=True))
        self._answered[threading.get_ident()] = connection
        connection.status = self._open(context, connection)
        return connection.status

    def _open(self, context: Any, connection: _Connection) -> Any:
        uri = context.uri
        _, authorization = context.request.get_header(GstRtsp.RTSPHeaderField.AUTHORIZATION, 0)
        mount = mount_of(uri.abspath)
        address = None if uri.query else stream_address(mount, authorization)
        if address is None:
            return _Status.NOT_FOUND
        feed = connection.feed
        if feed is not None and feed.address == address and not feed.has_ended:
            return _Status.OK
        status = self._open_feed(connection, address)
        with self._lock:
            if status == _Status.OK and mount not in self._mounts:
                self._server.get_mount_points().add_factory(mount, self._factory)
                self._mounts.add(mount)
        return status

    def _has_place(self, connection: _Connection) -> bool:
        watching = sum(one.feed is not None for one in self._connections.values())
        return not connection.is_closed and (
            connection.feed is not None or watching < self.settings.clients_max
        )

    def _open_feed(self, connection: _Connection, address: StreamAddress) -> Any:
        """Open a feed instead of the client's former one; return an RTSP status.

        An address that sends wrong tokens has to wait. Tokens that were right do not: one wrong setting must
        not stop the others of that address.
        """
        with self._lock:
            if not self._has_place(connection):
                return _Status.SERVICE_UNAVAILABLE
        ip = connection.ip
        seen = ip, hashlib.sha256((address.token or "").encode()).digest()
        if address.token is not None and seen not in self._valid and self._wrong_tokens.wait(ip) > 0:
            return _Status.SERVICE_UNAVAILABLE
        try:
            feed = Feed(self.settings.service, address, self._on_end)
        except StreamRefusedError as error:
            if error.status == HTTPStatus.UNAUTHORIZED and address.token is not None:
                self._valid.pop(seen, None)
                self._wrong_tokens.add(ip)
            return _STATUS.get(error.status, _Status.SERVICE_UNAVAILABLE)
        except ServiceAwayError as error:
            log.warning("%s: the service is away: %s", address.path, error)
            return _Status.SERVICE_UNAVAILABLE
        self._valid[seen] = None
        if len(self._valid) > _VALID_KEPT:
            self._valid.pop(next(iter(self._valid)))
        with self._lock:
            has_place = self._has_place(connection)  # it may be another's by now
            unused = connection.feed if has_place else feed
            if has_place:
                connection.feed = feed
        if unused is not None:
            unused.stop()
        return _Status.OK if has_place else _Status.SERVICE_UNAVAILABLE

    def _answer(self, _: Any, __: Any) -> Any:
        return self._answered[threading.get_ident()].status

    def _on_client(self, _: Any, client: Any) -> None:
        with self._lock:
            self._connections[client] = _Connection(client.get_connection().get_ip())
        client.connect("pre-describe-request", self._answer)
        client.connect("pre-setup-request", self._answer)
        client.connect("pause-request", self._on_pause)
        client.connect("play-request", self._on_play)
        client.connect("closed", self._on_closed)

    def _on_pause(self, client: Any, _: Any) -> None:
        if (feed := self._feed_of(client)) is not None:
            feed.pause()

    def _on_play(self, client: Any, _: Any) -> None:
        if (feed := self._feed_of(client)) is not None:
            feed.resume()

    def _feed_of(self, client: Any) -> Feed | None:
        with self._lock:
            connection = self._connections.get(client)
        return None if connection is None else connection.feed

    def _on_closed(self, client: Any) -> None:
        with self._lock:
            connection = self._connections.pop(client)
            connection.is_closed = True
        if connection.feed is not None:
            connection.feed.stop()

    def _on_end(self, feed: Feed) -> None:
        """End the connection of a feed's client, which no longer gets anything."""
        with self._lock:
            clients = [client for client, one in self._connections.items() if one.feed is feed]
        GLib.timeout_add(_CLOSE_AFTER_MS, _close, clients)

    def _clean_up(self) -> bool:
        self._server.get_session_pool().cleanup()
        return True


def _close(clients: list[Any]) -> bool:
    for client in clients:
        client.close()
    return False
