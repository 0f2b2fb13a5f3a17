"""All clients of a pulse server: who is there, and one line for everybody."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Collection

from camsync.client_eviction import who_makes_room
from camsync.clock import Clock
from camsync.door import Door
from camsync.limits import ServerLimits
from camsync.log_throttle import Spell
from camsync.messages import Hello
from camsync.peer import ClientInfo, Peer
from camsync.protocol import ProtocolError

_log = logging.getLogger(__name__)


class Hub:
    """The connected clients.

    A place is kept for each name of ``kept``. All other connections share ``limits.clients`` places, those of
    one login no more than ``limits.login_places`` of them.

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
        kept: Collection[str] = (),
    ) -> None:
        self._door = door
        self._kept = frozenset(kept)
        self._clock = clock
        self._limits = limits
        self._greet = greet
        self._heard = heard
        self._changed = changed
        self._peers: dict[int, Peer] = {}  # by id(), in the order of joining
        self._closed = False
        self._arrivals: dict[str, Spell] = defaultdict(lambda: Spell(clock))  # of the names that are kept
        self._others, self._crowds = Spell(clock), Spell(clock)

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
        """Meet a new connection; when there are too many, others of the same origin make room for it."""
        if self._closed:
            peer.end("stopped", "the server stops")
            return
        self._make_room(peer)
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
        self._tell_of(peer, hello.name)
        older = [other for other in self._peers.values() if other.name == hello.name and other is not peer]
        for other in older:
            other.name = None
            other.end("replaced", f"another {hello.name} has come")
        peer.name = hello.name
        self._heard(hello)
        self._changed()

    def _make_room(self, newcomer: Peer) -> None:
        guests = [it for it in self._peers.values() if it.name not in self._kept]
        theirs = [it for it in guests if it.origin == newcomer.origin]
        if newcomer.user is not None and len(theirs) >= self._limits.login_places:
            guests = theirs
        elif len(guests) < self._limits.clients:
            return
        crowded_out = who_makes_room(guests)
        if (more := self._crowds.happened(crowded_out.origin)) is not None:
            told = "%s has %d connections: the oldest makes room%s"
            count = sum(it.origin == crowded_out.origin for it in guests)
            _log.warning(told, crowded_out.origin, count, more)
        self.left(crowded_out)
        crowded_out.end("full", f"more connections of {crowded_out.origin} have come than there are places")

    def _tell_of(self, peer: Peer, name: str) -> None:
        """Tell the log who has come; two of one name may make way for each other for ever."""
        if peer.name is not None:  # it may say so again and again
            return
        before = next((it for it in self._peers.values() if it.name == name), None)
        what = "replaced" if before is not None else ""
        seldom, why = (self._arrivals[name], what) if name in self._kept else (self._others, name)
        more = seldom.happened(why)
        if more is None:
            return
        if before is None:
            _log.info("%s is here%s", name, more)
        else:
            _log.warning("another %s is here, from %s: the one before makes way%s", name, peer.address, more)
