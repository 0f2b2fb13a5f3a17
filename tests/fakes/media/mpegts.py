"""Packets and counters of MPEG transport streams."""

from __future__ import annotations

from dataclasses import dataclass

from server.media.containers.mpegts import COUNTERS, PACKET_BYTES


@dataclass(frozen=True)
class Packet:
    """A parsed transport stream packet (ISO/IEC 13818-1, 2.4.3.2)."""

    pid: int
    begins: bool
    counter: int
    payload: bytes
    pcr: int | None
    key: bool


def parse_packets(data: bytes) -> list[Packet]:
    assert len(data) % PACKET_BYTES == 0
    return [parse_packet(data[at : at + PACKET_BYTES]) for at in range(0, len(data), PACKET_BYTES)]


def parse_packet(packet: bytes) -> Packet:
    assert packet[0] == 0x47
    assert not packet[1] & 0x80, "no error"
    assert not packet[3] & 0xC0, "not scrambled"
    at, pcr, key = 4, None, False
    if packet[3] & 0x20:
        length, at = packet[4], 5 + packet[4]
        assert length <= 183
        assert length == 183 or packet[3] & 0x10
        if length:
            key = bool(packet[5] & 0x40)
            assert not packet[5] & 0x80, "no discontinuity"
            used = 1
            if packet[5] & 0x10:
                field = int.from_bytes(packet[6:12], "big")
                pcr, used = (field >> 15) * 300 + (field & 0x1FF), 7
                assert field >> 9 & 0x3F == 0x3F, "reserved bits"
            assert set(packet[5 + used : at]) <= {0xFF}, "stuffing"
    payload = packet[at:] if packet[3] & 0x10 else b""
    assert bool(payload) == bool(packet[3] & 0x10)
    pid = (packet[1] & 0x1F) << 8 | packet[2]
    return Packet(pid, bool(packet[1] & 0x40), packet[3] & 0x0F, payload, pcr, key)


def check_counters(packets: list[Packet]) -> None:
    """Check the continuity counters, as a receiver does."""
    last: dict[int, int] = {}
    for packet in packets:
        if packet.pid in last:
            assert packet.counter == (last[packet.pid] + bool(packet.payload)) % COUNTERS, packet.pid
        last[packet.pid] = packet.counter
