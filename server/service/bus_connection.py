"""The best-view service's connection to the bus: receives the cameras' messages, sends commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from server.config.password_file import password_of
from server.config.pulse_access import bestview_client_name
from server.config.sections import LinkSettings, site_user
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.bus_access import access_control_of
from server.messaging.inbox import Inbox, Message
from server.messaging.messages import EndReceived, GopChoices, ZenohKeys

MessageHandler = Callable[[Message], None]


class BusConnection:
    """Opens the bus, and sends and receives the service's messages; before :meth:`open` nothing is sent."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._index = config.view.sharding.index
        self._keys = ZenohKeys(config.site.name)
        self._bus: Bus | None = None
        self._others: Bus | None = None
        """A session to all routers, for what services say to each other."""
        self._other_sites: list[Bus] = []
        """A session to each other site's routers."""
        self.other_services: set[int] = set()
        """The indices of the other services that are present."""
        self.inboxes: list[Inbox[Message]] = []
        """The queues of received messages."""

    def open(
        self,
        camera_handlers: Mapping[str, MessageHandler],
        on_audio: MessageHandler | None,
        on_alive: Callable[[str, bool], None],
    ) -> None:
        """Open the bus: this service is one of its routers.

        Args:
            camera_handlers: by the last part of a camera's key.
            on_audio: handles the site's audio; None if the site has none.
            on_alive: called with a camera's key when its liveliness token appears (True) or disappears
                (False).

        Raises:
            UserError: the address is in use, or a password file cannot be read.
        """
        self._bus = bus = Bus.router(
            self._config.zenoh, access_control_of(self._config), len(self._config.site_camera_ids)
        )
        taken = self._config.view.sharding.cameras
        # One subscription for all cameras, but nothing from those of other areas.
        cameras = ["*"] if taken is None else sorted(taken)
        for camera in cameras:
            for topic, handler in camera_handlers.items():
                self.inboxes.append(bus.subscribe(self._keys.camera(camera, topic), handler))
        if on_audio is not None:
            self.inboxes.append(bus.subscribe(self._keys.sound, on_audio))
        for camera in cameras:
            bus.watch_alive(self._keys.camera(camera, "alive"), on_alive)
        bus.declare_alive(self._keys.bestview("alive", self._index))

    def exchange_records(
        self, on_record: MessageHandler, state: Callable[[], bytes], on_service: Callable[[], None]
    ) -> None:
        """Receive the other services' records, tell them this one's state, and watch their presence.

        Args:
            on_record: called with each record, this service's own included.
            state: returns this service's encoded state.
            on_service: called when `other_services` has changed.
        """
        if self._bus is None:
            return
        others = self._others = Bus.client(self._config.zenoh, bestview_client_name(self._index))
        alive = {
            self._keys.bestview("alive", index): index
            for index in range(self._config.view.sharding.services)
            if index != self._index
        }

        def on_alive(key: str, is_present: bool) -> None:
            if key in alive:
                (self.other_services.add if is_present else self.other_services.discard)(alive[key])
                on_service()

        self._bus.answer(self._keys.bestview("state", self._index), state)
        others.subscribe(self._keys.bestview("**/record"), on_record)
        others.watch_alive(self._keys.bestview("**/alive"), on_alive)

    def query_states(self, timeout_s: float) -> list[bytes]:
        """Return the states of the services that answer; blocks, at most until the timeout."""
        return [] if self._others is None else self._others.query(self._keys.bestview("**/state"), timeout_s)

    def publish_record(self, payload: bytes) -> None:
        """Publish this service's record."""
        if self._bus is not None:
            self._bus.publish(self._keys.bestview("record", self._index), payload)

    def link_site(self, name: str, link: LinkSettings, on_people: MessageHandler) -> None:
        """Receive what another site tells about people.

        Raises:
            UserError: the password file cannot be read, or the address is not supported.
        """
        user = None if link.users is None else site_user(self._config.site.name)
        if link.users is not None and user is not None:
            password_of(link.users, user, f"sites.link.{name}.users")  # named so in an error
        bus = Bus.client(link.bus(self._config.zenoh.lease_s), user)
        self._other_sites.append(bus)
        self.inboxes.append(bus.subscribe(ZenohKeys(name).bestview("**/people"), on_people))

    def publish_people(self, payload: bytes) -> None:
        """Publish what other sites are told about people."""
        if self._bus is not None:
            self._bus.publish(self._keys.bestview("people", self._index), payload)

    @property
    def has_waiting_messages(self) -> bool:
        """Whether a message waits in any inbox."""
        return any(inbox.waiting for inbox in self.inboxes)

    def send_to_camera(self, topic: str, camera: str, payload: bytes) -> None:
        """Send a camera a message under the key that ends with ``topic``."""
        if self._bus is not None:
            self._bus.publish(self._keys.camera(camera, topic), payload)

    def confirm_end(self, camera: str, boot: int) -> None:
        """Confirm to a camera that the last tracks of its recording have been received."""
        received = EndReceived(service=self._keys.bestview("alive", self._index), boot=boot)
        self.send_to_camera("end_received", camera, msgspec.msgpack.encode(received))

    def publish_choices(self, choices: GopChoices) -> None:
        """Publish the choices of a GOP."""
        if self._bus is not None:
            self._bus.publish(self._keys.bestview("choices", self._index), msgspec.json.encode(choices))

    def close(self) -> None:
        """Close the bus."""
        for bus in (*self._other_sites, self._others, self._bus):
            if bus is not None:
                bus.close()
