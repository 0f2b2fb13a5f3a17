"""Discovery of ONVIF cameras by WS-Discovery (OASIS 1.1; ONVIF Core, 7.3): one datagram asks, all answer.

Not by a library: WSDiscovery 2.1 never reads the answers to a unicast probe, by which cameras beyond the
local network are found, and occupies the port of the protocol.
"""

from __future__ import annotations

import asyncio
import ipaddress
import os
import re
import socket
import struct
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree as ET

from server.system.errors import UserError
from server.system.printable import printable

TARGETS_VARIABLE = "MYVIEW_DISCOVERY"
"""Environment variable with the addresses to ask, separated by commas, instead of the multicast group."""
_GROUP, _PORT = "239.255.255.250", 3702
_REPEATS_S = (0.0, 0.25)
"""When a probe is sent: twice, since datagrams may be lost."""
MAX_CAMERAS = 256
"""Most cameras that are listed; a network may be full of them, or hostile."""
_MAX_DATAGRAM = 65_536
_MAX_DATAGRAMS = 4096
_MAX_TEXT = 60
_DISCOVERY = "{http://schemas.xmlsoap.org/ws/2005/04/discovery}"
_ADDRESSING = "{http://schemas.xmlsoap.org/ws/2004/08/addressing}"
_SCOPE = re.compile(r"onvif://www\.onvif\.org/(?P<kind>name|hardware)/(?P<text>.*)", re.IGNORECASE)
_PROBE = """<?xml version="1.0" encoding="utf-8"?>
<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"
 xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing"
 xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"
 xmlns:dn="http://www.onvif.org/ver10/network/wsdl"><s:Header>
<a:Action s:mustUnderstand="1">http://schemas.xmlsoap.org/ws/2005/04/discovery/Probe</a:Action>
<a:MessageID>urn:uuid:{message}</a:MessageID>
<a:To s:mustUnderstand="1">urn:schemas-xmlsoap-org:ws:2005:04:discovery</a:To></s:Header>
<s:Body><d:Probe><d:Types>dn:NetworkVideoTransmitter</d:Types></d:Probe></s:Body></s:Envelope>"""


@dataclass(frozen=True, slots=True)
class FoundCamera:
    """A camera that answered a probe.

    Attributes:
        device: its endpoint reference, usually ``urn:uuid:…``, the same at each of its addresses.
        host: its address.
        port: port of its ONVIF service.
        encrypted: whether that is HTTPS.
        name: what it calls itself; may be empty.
        hardware: its model; may be empty.
    """

    device: str
    host: str
    port: int
    encrypted: bool = False
    name: str = ""
    hardware: str = ""


async def discover(seconds: float, targets: Sequence[tuple[str, int]] | None = None) -> list[FoundCamera]:
    """Ask for cameras, and return those that answer within ``seconds``, by address.

    ``targets`` are the addresses to ask; by default those of :data:`TARGETS_VARIABLE`, or the multicast
    group on every interface.

    Raises:
        UserError: an address of the variable is invalid, or there is no network.
    """
    wanted = _configured_targets() if targets is None else tuple(targets)
    is_multicast = any(ipaddress.ip_address(host).is_multicast for host, _ in wanted)
    sockets = _open_sockets(is_multicast=is_multicast)
    loop = asyncio.get_running_loop()
    found: dict[tuple[str, int], FoundCamera] = {}
    identifier = str(uuid.uuid4())
    budget = _MAX_DATAGRAMS

    def receive(opened: socket.socket) -> None:
        nonlocal budget
        try:
            datagram, sender = opened.recvfrom(_MAX_DATAGRAM)
        except OSError:
            return  # such as a port that is closed at a target
        budget -= 1
        if budget <= 0:
            loop.remove_reader(opened)
            return
        for camera in parse_probe_matches(datagram, sender[0], identifier):
            if len(found) < MAX_CAMERAS:
                found.setdefault((camera.host, camera.port), camera)

    try:
        for opened in sockets:
            loop.add_reader(opened, receive, opened)
        probe = probe_message(identifier)
        until = loop.time() + seconds
        for delay in _REPEATS_S:
            await asyncio.sleep(delay)
            if not _send(sockets, probe, wanted):
                raise UserError("cameras cannot be searched: this machine has no network")
        await asyncio.sleep(max(0.0, until - loop.time()))
    finally:
        for opened in sockets:
            loop.remove_reader(opened)
            opened.close()
    return sorted(found.values(), key=lambda camera: (_address_order(camera.host), camera.port))


def probe_message(identifier: str) -> bytes:
    """Return a probe for video transmitters with this UUID as its message id."""
    return _PROBE.format(message=identifier).encode()


def parse_probe_matches(datagram: bytes, sender: str, identifier: str | None = None) -> list[FoundCamera]:
    """Return the cameras in an answer; none in anything else.

    Only services at the sender's own address count, so that no device can direct passwords to another.
    ``identifier`` is the UUID of the probe that it must answer; None: any.
    """
    root = _parse(datagram)
    if root is None:
        return []
    if identifier is not None and not _text(root, f".//{_ADDRESSING}RelatesTo").endswith(identifier):
        return []
    return [camera for match in root.iter(f"{_DISCOVERY}ProbeMatch") for camera in _cameras_of(match, sender)]


def _parse(datagram: bytes) -> ET.Element | None:
    """Parse a datagram; None: it is not XML in UTF-8, or defines entities, which SOAP forbids."""
    try:
        text = datagram.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            return None
        return ET.fromstring(text)  # noqa: S314 — without a document type there are no entities
    except (UnicodeDecodeError, ET.ParseError, ValueError):
        return None


def _cameras_of(match: ET.Element, sender: str) -> Iterator[FoundCamera]:
    device = printable(_text(match, f"{_ADDRESSING}EndpointReference/{_ADDRESSING}Address"))[:_MAX_TEXT]
    scopes = {"name": "", "hardware": ""}
    for scope in _text(match, f"{_DISCOVERY}Scopes").split():
        if (described := _SCOPE.match(scope)) is not None:
            scopes[described["kind"].lower()] = printable(unquote(described["text"]))[:_MAX_TEXT]
    for address in _text(match, f"{_DISCOVERY}XAddrs").split():
        try:
            parts = urlsplit(address)
            host, port = parts.hostname, parts.port
        except ValueError:
            continue
        if host == sender and parts.scheme in {"http", "https"}:
            encrypted = parts.scheme == "https"
            port = port or (443 if encrypted else 80)
            yield FoundCamera(device, host, port, encrypted, scopes["name"], scopes["hardware"])
            return


def _text(element: ET.Element, path: str) -> str:
    found = element.find(path)
    return "" if found is None or found.text is None else found.text.strip()


def _configured_targets() -> tuple[tuple[str, int], ...]:
    """Return the addresses of the environment variable, or the multicast group.

    Raises:
        UserError: one is invalid.
    """
    text = os.environ.get(TARGETS_VARIABLE, "")
    addresses = [part.strip() for part in text.split(",") if part.strip()]
    return tuple(map(_target, addresses)) or ((_GROUP, _PORT),)


def _target(address: str) -> tuple[str, int]:
    host, _, port = address.partition(":")
    try:
        resolved = socket.gethostbyname(host) if host else ""
    except (OSError, UnicodeError):
        resolved = ""
    number = int(port) if re.fullmatch("[0-9]{1,5}", port) else _PORT if not port else 0
    if not resolved or not 0 < number < 1 << 16:
        raise UserError(
            f"{TARGETS_VARIABLE}: {address!a} is not an address to ask, such as 10.0.5.20 or 10.0.5.20:3702"
        )
    return resolved, number


def _open_sockets(*, is_multicast: bool) -> list[socket.socket]:
    """Open a socket for every interface, or a single one to ask single addresses."""
    if not is_multicast:
        return [_open_socket()]
    sockets = []
    for index, _ in socket.if_nameindex():
        opened = _open_socket()
        try:
            request = struct.pack("4s4si", bytes(4), bytes(4), index)  # ip_mreqn, ip(7)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, request)
        except OSError:
            opened.close()
        else:
            sockets.append(opened)
    return sockets


def _open_socket() -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)  # noqa: FBT003 — it has no name
    return opened


def _send(sockets: Sequence[socket.socket], probe: bytes, targets: Sequence[tuple[str, int]]) -> bool:
    """Send a probe from all sockets; return whether any could send it."""
    sent = False
    for opened in sockets:
        for target in targets:
            try:
                opened.sendto(probe, target)
                sent = True
            except OSError:
                continue  # an interface that is down, or has no multicast
    return sent


def _address_order(host: str) -> tuple[int, ...]:
    try:
        return tuple(socket.inet_aton(host))
    except OSError:
        return (256,)
