"""All clients of a pulse server: who is there, and one line for everybody."""

from __future__ import annotations

import logging
from collections.abc import Callable

from camsync.clock import Clock
from camsync.door import Door
from camsync.limits import ServerLimits
from camsync.messages import Hello
from camsync.peer import ClientInfo, Peer
from camsync.protocol import ProtocolError

_log = logging.getLogger(__name__)


class Hub:
    """The connected clients.

    ``door`` lets them in, where the server is closed; ``greet`` gives the lines a new client is met with;
    ``heard`` is told every HELLO that was accepted; ``changed`` is called when somebody came, got a name or
    left.
    """

    def __init__(
        self,
        clock: Clock,
        limits: ServerLimits,
        greet: Callable[[], bytes],
        heard: Callable[[Hello], None],
        changed: Callable[[], None],
        door: Door | None = None,
    ) -> None:
        self._door = door
        self._clock = clock
        self._limits = limits
        self._greet = greet
        self._heard = heard
        self._changed = changed
        self._peers: dict[int, Peer] = {}  # by id(), in the order of joining
        self._closed = False

    def new_peer(self) -> Peer:
        """Make the protocol object of a new connection (asyncio's factory)."""
        return Peer(self, self._clock, self._limits, self._door)

    def clients(self) -> tuple[ClientInfo, ...]:
        """Give all clients in the order in which they joined."""
        return tuple(peer.info() for peer in self._peers.values())

    def names(self) -> frozenset[str]:
        """Give the names of the clients that have said HELLO and are connected."""
        return frozenset(peer.name for peer in self._peers.values() if peer.name is not None)

    def pulse(self, line: bytes) -> None:
        """Send a pulse to everybody, waiting for nobody."""
        for peer in tuple(self._peers.values()):
            peer.pulse(line)

    def tell(self, line: bytes) -> None:
        """Send another line to everybody who keeps up."""
        for peer in tuple(self._peers.values()):
            peer.say(line)

    def close(self) -> None:
        """End all connections, those included that are just being made."""
        self._closed = True
        if self._door is not None:
            self._door.close()
        for peer in tuple(self._peers.values()):
            peer.end("stopped", "the server stops")

    def joined(self, peer: Peer) -> None:
        """Meet a new connection, or refuse it when there are too many."""
        if self._closed:
            peer.end("stopped", "the server stops")
            return
        if len(self._peers) >= self._limits.clients:
            peer.end("full", f"the server has {self._limits.clients} clients already")
            return
        self._peers[id(peer)] = peer
        peer.say(self._greet())

    def left(self, peer: Peer) -> None:
        """Forget a connection."""
        if self._peers.pop(id(peer), None) is not None and peer.name is not None:
            self._changed()

    def hello(self, peer: Peer, hello: Hello) -> None:
        """Name a client; an older client of the same name makes way, so a restart is never locked out."""
        if peer.user not in {None, hello.name}:
            raise ProtocolError("name", f"this connection is for {peer.user} alone")
        if peer.name not in {None, hello.name}:
            raise ProtocolError("malformed", f"this connection is {peer.name} already")
        older = [other for other in self._peers.values() if other.name == hello.name and other is not peer]
        for other in older:
            other.name = None
            other.end("replaced", f"another {hello.name} has come")
        if peer.name is None:  # it may say so again and again
            _log.info("%s is here", hello.name)
        peer.name = hello.name
        self._heard(hello)
        self._changed()
