"""Discovery: cameras that answer a probe are listed; nothing else that arrives does harm."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.setup.onvif_camera import OnvifCamera, onvif_cameras
from server.setup.discovery import FoundCamera, discover, parse_probe_matches, probe_message
from server.system.errors import UserError

MATCH = b"""<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"
 xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing"
 xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"><s:Header><a:RelatesTo>uuid:7</a:RelatesTo></s:Header>
<s:Body><d:ProbeMatches><d:ProbeMatch><a:EndpointReference><a:Address>urn:uuid:1</a:Address></a:EndpointReference>
<d:Scopes>onvif://www.onvif.org/name/Front%20door onvif://www.onvif.org/hardware/X1</d:Scopes>
<d:XAddrs>http://[fe80::1]/onvif http://10.0.0.11:8000/onvif/device_service</d:XAddrs></d:ProbeMatch>
</d:ProbeMatches></s:Body></s:Envelope>"""
DOOR = FoundCamera("urn:uuid:1", "10.0.0.11", 8000, name="Front door", hardware="X1")


async def test_cameras_that_answer_are_found_once_each(monkeypatch: pytest.MonkeyPatch) -> None:
    with onvif_cameras(OnvifCamera("door", []), OnvifCamera("hall", [])) as targets:
        monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
        found = await discover(1.0)
    assert sorted(camera.name for camera in found) == ["door", "hall"]
    assert {camera.host for camera in found} == {"127.0.0.1"}


async def test_a_probe_is_sent_to_the_multicast_group_of_every_interface() -> None:
    group = "239.255.77.77"
    received: list[bytes] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as member:
        member.bind(("", 0))
        membership = socket.inet_aton(group) + struct.pack("4si", bytes(4), socket.if_nametoindex("lo"))
        try:
            member.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError:
            pytest.skip("needs multicast")
        thread = threading.Thread(target=lambda: received.append(member.recv(65_536)), daemon=True)
        thread.start()
        await discover(0.6, [(group, member.getsockname()[1])])
        await asyncio.to_thread(thread.join, 10.0)
    assert b"NetworkVideoTransmitter" in received[0]


def test_name_model_and_the_service_at_the_senders_address_are_read() -> None:
    assert parse_probe_matches(MATCH, "10.0.0.11", "7") == [DOOR]


def test_a_service_at_another_address_and_an_answer_to_another_probe_are_ignored() -> None:
    assert parse_probe_matches(MATCH, "10.0.0.12", "7") == []
    assert parse_probe_matches(MATCH, "10.0.0.11", "8") == []


def test_entities_are_refused() -> None:
    bomb = b'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>' + MATCH.replace(b"X1", b"&b;")
    assert parse_probe_matches(bomb, "10.0.0.11") == []
    assert parse_probe_matches(bomb.decode().encode("utf-16"), "10.0.0.11") == []


def test_control_characters_do_not_reach_a_terminal() -> None:
    (camera,) = parse_probe_matches(MATCH.replace(b"%20", b"%1b[2J%0a"), "10.0.0.11")
    assert camera.name.isprintable()


@given(st.binary(max_size=300))
def test_no_datagram_breaks_the_search(datagram: bytes) -> None:
    assert parse_probe_matches(datagram, "10.0.0.11") == []


@given(st.integers(0, len(MATCH) - 1), st.binary(min_size=0, max_size=6), st.integers(0, 40))
def test_no_damaged_answer_breaks_the_search(place: int, put: bytes, removed: int) -> None:
    for camera in parse_probe_matches(MATCH[:place] + put + MATCH[place + removed :], "10.0.0.11"):
        assert camera.host == "10.0.0.11"
        assert 0 <= camera.port < 1 << 16
        assert (camera.name + camera.hardware + camera.device).isprintable()


@pytest.mark.parametrize("address", ["10.0.0.1:x", "10.0.0.1:99999", ":3702", "no such host"])
async def test_an_address_to_ask_that_is_none_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    monkeypatch.setenv("MYVIEW_DISCOVERY", f"127.0.0.1, {address}")
    with pytest.raises(UserError, match=r"MYVIEW_DISCOVERY: .* is not an address to ask"):
        await discover(0.1)


async def test_a_flood_of_answers_is_bounded() -> None:
    answers = b"".join(
        b'<d:ProbeMatch xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"><d:XAddrs>http://127.0.0.1:%d/'
        b"</d:XAddrs></d:ProbeMatch>" % port
        for port in range(1000, 1400)
    )
    flood = b"<x>" + answers + b"</x>"
    assert len(parse_probe_matches(flood, "127.0.0.1")) == 400
    assert probe_message("7").startswith(b"<?xml")
