"""zenoh for asyncio: publish, subscribe and liveliness, with bounded queues."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable, Mapping
from typing import Any, Self

import zenoh

from server.config.password_file import password_of
from server.config.sections import ZenohSettings
from server.messaging.bus_access import SETTING
from server.messaging.inbox import Inbox, Message
from server.messaging.messages import camera_of_key
from server.system.address_redaction import redact_zenoh_endpoint
from server.system.errors import UserError

_DROP_AFTER_US = 20_000
"""How long a message waits at a full queue; zenoh's default of 1 ms is too short for a keyframe."""

_FEW_THREADS = 8
"""Threads for receiving in a process with connections to a few others."""
_SESSIONS_OF_CAMERA = 2
_OPEN_WITHIN_MS = 5_000
_MESSAGE_MAX = 1 << 25
"""Bytes of one message; a 4K keyframe has some millions."""
_MAX_PUBLISHERS = 64
"""Declared publishers kept; beyond, the least recently used is undeclared."""


class Bus:
    """One zenoh session. It must be closed, or the process never exits: zenoh's threads are not daemons."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._publishers: dict[str, zenoh.Publisher] = {}
        """By key, the most recently used last."""
        self._undeclare: list[Callable[[], None]] = []

    @classmethod
    def router(
        cls, settings: ZenohSettings, access: Mapping[str, Any] | None = None, cameras: int = 0
    ) -> Self:
        """Open the session of a best-view service, to which cameras connect.

        Routers do not forward to each other: a camera sends to all of them, so each message comes once, and a
        router that stops takes nothing from the other services.

        ``access`` is zenoh's access control for the users in ``settings.users``; ``cameras`` is their number.

        Raises:
            UserError: the address cannot be listened on.
        """
        threads = _FEW_THREADS + _SESSIONS_OF_CAMERA * cameras
        config = _config(settings, "router", None, threads)
        if settings.users is not None:
            config.insert_json5("transport/auth/usrpwd/dictionary_file", json.dumps(str(settings.users)))
        for key, file in (("certificate", settings.tls.certificate), ("private_key", settings.tls.key)):
            if file is not None:
                config.insert_json5(f"transport/link/tls/listen_{key}", json.dumps(str(file)))
        if access is not None:
            config.insert_json5("access_control", json.dumps(access))
        try:
            config.insert_json5("listen/endpoints", json.dumps([settings.listen]))
            return cls(zenoh.open(config))
        except zenoh.ZError as error:
            raise UserError(
                f"zenoh.listen: cannot listen on {redact_zenoh_endpoint(settings.listen)}; "
                "is the port in use?"
                + (" Are zenoh.tls.certificate and key a pair?" if settings.tls.key is not None else "")
            ) from error

    @classmethod
    def client(cls, settings: ZenohSettings, user: str | None = None) -> Self:
        """Open a session to all of the site's routers; it connects and reconnects in the background.

        It exchanges messages with the routers' processes, the best-view services, not with other clients.
        ``user`` is its user name, where the routers require one.

        Raises:
            UserError: zenoh does not support the address, or there is no such user.
        """
        # A peer, not a client: a client session has one router, and cannot be opened while that is down.
        config = _config(settings, "peer", user)
        config.insert_json5("connect/timeout_ms", "-1")  # keep trying in the background
        config.insert_json5("connect/exit_on_failure", "false")
        config.insert_json5("listen/endpoints", "[]")
        config.insert_json5(
            "connect/retry", '{"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2}'
        )
        try:
            config.insert_json5("connect/endpoints", json.dumps(settings.routers))
            return cls(zenoh.open(config))
        except zenoh.ZError:
            raise UserError(
                f"zenoh.connect: cannot use {redact_endpoints(settings)}: does zenoh support "
                "this protocol, and are the options after the port valid?"
            ) from None

    @classmethod
    def peer_listener(cls, settings: ZenohSettings, user: str | None = None) -> Self:
        """Open a session that also receives the messages of the router's other clients.

        It connects to one router, the first that answers. One must be running; later the session reconnects.
        Blocks for some seconds at most.

        Raises:
            UserError: the router cannot be reached.
        """
        config = _config(settings, "client", user)
        try:
            config.insert_json5("connect/timeout_ms", str(_OPEN_WITHIN_MS))
            config.insert_json5("connect/endpoints", json.dumps(settings.routers))
            return cls(zenoh.open(config))
        except zenoh.ZError as error:
            refusal = "" if settings.users is None else ", or it refuses this user"
            raise UserError(
                f"zenoh.connect: no router responds at {redact_endpoints(settings)}{refusal}"
            ) from error

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a message; it is dropped for receivers that are too slow."""
        publisher = self._publishers.pop(key, None)
        if publisher is None:
            if len(self._publishers) >= _MAX_PUBLISHERS:
                self._publishers.pop(next(iter(self._publishers))).undeclare()  # type: ignore[no-untyped-call]
            publisher = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA,  # one priority for all: a camera's messages stay in order
            )
        self._publishers[key] = publisher
        publisher.put(payload, attachment=attachment)

    def subscribe(self, key: str, handler: Callable[[Message], None]) -> Inbox[Message]:
        """Call ``handler`` on the event loop for every message under ``key`` (a key expression)."""
        inbox = Inbox(handler, sender_of=_sender, size=_size)

        def receive(sample: zenoh.Sample) -> None:
            attachment = sample.attachment.to_bytes() if sample.attachment is not None else b""
            inbox.put(Message(str(sample.key_expr), sample.payload.to_bytes(), attachment))

        self._undeclare.append(self._session.declare_subscriber(key, receive).undeclare)
        return inbox

    def subscribe_temporarily(self, key: str, handler: Callable[[Message], None]) -> Callable[[], None]:
        """Subscribe as :meth:`subscribe` does; the returned function ends the subscription."""
        self.subscribe(key, handler)
        undeclare = self._undeclare[-1]

        def end() -> None:
            if undeclare in self._undeclare:
                self._undeclare.remove(undeclare)
                undeclare()

        return end

    def declare_alive(self, key: str) -> None:
        """Declare a liveliness token, which lasts until this process closes its session or dies."""
        self._undeclare.append(self._session.liveliness().declare_token(key).undeclare)

    def watch_alive(self, key: str, handler: Callable[[str, bool], None]) -> None:
        """Call ``handler(key, is_present)`` on the event loop for tokens that are present, come or go."""

        def unpack(message: Message) -> None:
            handler(message.key, message.payload == b"1")

        inbox = Inbox(unpack, sender_of=_sender, size=_size)

        def receive(sample: zenoh.Sample) -> None:
            is_present = sample.kind == zenoh.SampleKind.PUT
            inbox.put(Message(str(sample.key_expr), b"1" if is_present else b"0", b""))

        subscriber = self._session.liveliness().declare_subscriber(key, receive, history=True)
        self._undeclare.append(subscriber.undeclare)

    def answer(self, key: str, respond: Callable[[], bytes]) -> None:
        """Answer queries of a key by what ``respond``, called on the event loop, returns."""
        loop = asyncio.get_running_loop()

        def reply(query: zenoh.Query) -> None:
            with query:
                query.reply(key, respond())

        def receive(query: zenoh.Query) -> None:
            loop.call_soon_threadsafe(reply, query)

        self._undeclare.append(self._session.declare_queryable(key, receive).undeclare)

    def query(self, key: str, timeout_s: float) -> list[bytes]:
        """Return the answers to a query of a key expression; blocks, at most until the timeout."""
        replies = self._session.get(key, timeout=timeout_s, target=zenoh.QueryTarget.ALL)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def close(self) -> None:
        """Undeclare everything and close the session."""
        for undeclare in reversed(self._undeclare):
            undeclare()
        self._undeclare.clear()
        self._publishers.clear()
        self._session.close()  # type: ignore[no-untyped-call]


def redact_endpoints(settings: ZenohSettings) -> str:
    """Return where clients connect, without options, which may contain keys."""
    return ", ".join(map(redact_zenoh_endpoint, settings.routers))


def _sender(message: Message) -> str:
    """Return the camera that sent a message."""
    return camera_of_key(message.key)


def _size(message: Message) -> int:
    return len(message.payload) + len(message.attachment)


def _set_receiving_threads(threads: int) -> None:
    """Set how many threads this process receives with, before its first session.

    zenoh sets SO_LINGER, so that closing a connection to a host that is cut off blocks a thread for ten
    seconds (github.com/eclipse-zenoh/zenoh/issues/2350). Of two threads, zenoh's default, none would be left
    to receive from other hosts.
    """
    os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {threads}), net: (worker_threads: 4))")


def _config(
    settings: ZenohSettings, mode: str, user: str | None, threads: int = _FEW_THREADS
) -> zenoh.Config:
    _set_receiving_threads(threads)
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "scouting/multicast/enabled": False,  # only configured processes belong to a site
        "scouting/gossip/enabled": False,  # all traffic goes through the router
        "transport/link/tx/lease": int(settings.lease_s * 1000),
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": _DROP_AFTER_US,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/rx/max_message_size": _MESSAGE_MAX,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    if settings.users is not None and user is not None:
        password = password_of(settings.users, user, SETTING)
        config.insert_json5("transport/auth/usrpwd/user", json.dumps(user))
        config.insert_json5("transport/auth/usrpwd/password", json.dumps(password))
    if settings.tls.authority is not None:
        config.insert_json5("transport/link/tls/root_ca_certificate", json.dumps(str(settings.tls.authority)))
    return config
