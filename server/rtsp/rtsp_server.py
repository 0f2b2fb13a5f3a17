"""The RTSP server: GStreamer's, whose media are made of feeds as clients ask for them.

Access is decided by the service alone: a client's token opens the stream there, or does not. Clients that ask
for the same stream with the same token share one feed.
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
_PAYLOADERS = {"h264": "rtph264pay config-interval=0", "aac": "rtpmp4gpay", "opus": "rtpopuspay"}
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
    """Makes the media of the feed that the request being answered has opened."""

    def __init__(self, gateway: Gateway) -> None:
        super().__init__()
        self._gateway = gateway
        self.set_shared(True)
        self.set_stop_on_disconnect(True)
        protocols = GstRtsp.RTSPLowerTrans.TCP
        if gateway.settings.udp:
            protocols |= GstRtsp.RTSPLowerTrans.UDP
        self.set_protocols(protocols)

    def do_gen_key(self, _: Any) -> str:
        # By feed: the media of one that has just ended may still be there.
        return self._gateway.feed_of_request().media_key()

    def do_create_element(self, _: Any) -> Gst.Element:
        feed = self._gateway.feed_of_request()
        parts = (
            f"appsrc name={source_name(track)} is-live=true format=time leaky-type=downstream"
            f" ! {_PAYLOADERS[track.codec]} name=pay{number} pt={96 + number}"
            for number, track in enumerate(feed.tracks)
        )
        element = Gst.parse_launch(f"( {' '.join(parts)} )")
        feed.connect(element)
        return element

    def do_configure(self, media: Any) -> None:
        self._gateway.feed_of_request().set_media(media)


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


@dataclass(frozen=True, slots=True)
class _Request:
    """How a request is answered, and the feed that it has opened."""

    status: Any
    feed: Feed | None = None


class Gateway:
    """The server, its feeds, and who has opened them."""

    def __init__(self, settings: GatewaySettings) -> None:
        self.settings = settings
        self._requests: dict[int, _Request] = {}
        """The request that each thread is answering; Python forgets what is local to GLib's threads."""
        self._lock = threading.RLock()
        self._feeds: dict[StreamAddress, Feed] = {}
        self._mounts: dict[str, set[StreamAddress]] = {}
        self._opened: dict[Any, set[StreamAddress]] = {}
        """By client, what it has opened."""
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
            return len(self._opened) < self.settings.clients_max + _IDLE_CONNECTIONS

    def feed_of_request(self) -> Feed:
        """Return the feed of the request that this thread is answering."""
        feed = self._requests[threading.get_ident()].feed
        assert feed is not None  # noqa: S101 — refused requests come no further
        return feed

    def open_for(self, context: Any) -> Any:
        """Open the stream of a request; return an RTSP status, which is kept for :meth:`_answer`, too."""
        self._requests[threading.get_ident()] = request = self._open(context)
        return request.status

    def _open(self, context: Any) -> _Request:
        uri, client = context.uri, context.client
        _, authorization = context.request.get_header(GstRtsp.RTSPHeaderField.AUTHORIZATION, 0)
        mount = mount_of(uri.abspath)
        address = None if uri.query else stream_address(mount, authorization)
        if address is None:
            return _Request(_Status.NOT_FOUND)
        with self._lock:
            opened = self._opened.setdefault(client, set())
            watching = sum(
                bool(addresses) for other, addresses in self._opened.items() if other is not client
            )
            if not opened and watching >= self.settings.clients_max:
                return _Request(_Status.SERVICE_UNAVAILABLE)
            feed = self._feeds.get(address)
            if feed is not None and not feed.has_ended:
                return _Request(_Status.OK, self._mount(feed, mount, client))
        opened_feed = self._open_feed(address, context.conn.get_ip())
        if isinstance(opened_feed, Feed):
            return _Request(_Status.OK, self._mount(opened_feed, mount, client))
        return _Request(opened_feed)

    def _open_feed(self, address: StreamAddress, ip: str) -> Feed | Any:
        """Open a feed, or return the RTSP status of why not; an address that sends wrong tokens has to wait.

        Tokens that were right do not: one wrong setting must not stop the others of that address.
        """
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
        return feed

    def _mount(self, feed: Feed, mount: str, client: Any) -> Feed:
        """Add a feed to the server; return the one that another thread has added meanwhile."""
        with self._lock:
            current = self._feeds.get(feed.address)
            if current is not None and current is not feed and not current.has_ended:
                feed.stop()
                feed = current
            self._feeds[feed.address] = feed
            if mount not in self._mounts:
                self._server.get_mount_points().add_factory(mount, _Factory(self))
            self._mounts.setdefault(mount, set()).add(feed.address)
            if client in self._opened:
                self._opened[client].add(feed.address)
        return feed

    def _answer(self, _: Any, __: Any) -> Any:
        return self._requests[threading.get_ident()].status

    def _on_client(self, _: Any, client: Any) -> None:
        with self._lock:
            self._opened.setdefault(client, set())
        client.connect("pre-describe-request", self._answer)
        client.connect("pre-setup-request", self._answer)
        client.connect("closed", self._on_closed)

    def _on_closed(self, client: Any) -> None:
        with self._lock:
            left = self._opened.pop(client, set())
            watched = {address for opened in self._opened.values() for address in opened}
            unwatched = [self._feeds[address] for address in left - watched if address in self._feeds]
        for feed in unwatched:
            feed.stop()

    def _on_end(self, feed: Feed) -> None:
        """Forget a feed; end the connections of its clients, which no longer get anything."""
        with self._lock:
            if self._feeds.get(feed.address) is not feed:
                return
            del self._feeds[feed.address]
            for mount, addresses in list(self._mounts.items()):
                addresses.discard(feed.address)
                if not addresses:
                    del self._mounts[mount]
                    self._server.get_mount_points().remove_factory(mount)
            clients = [client for client, opened in self._opened.items() if feed.address in opened]
        GLib.timeout_add(_CLOSE_AFTER_MS, _close, clients)

    def _clean_up(self) -> bool:
        self._server.get_session_pool().cleanup()
        return True


def _close(clients: list[Any]) -> bool:
    for client in clients:
        client.close()
    return False
