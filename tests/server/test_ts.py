"""Transport streams: legal packets, any GOP after any other, the cameras' own pixels at the pulses' times."""

from __future__ import annotations

import io
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
from cameras_by_hand import CAMERAS, FPS, GOP, encoded
from ffprobe_by_hand import probed
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import needs_ffprobe

from server.media.containers.fmp4 import Sample, fragment, ticks
from server.media.containers.mpegts import COUNTERS, PACKET_BYTES, Counters, pack, packets
from server.media.picture import Picture
from server.media.stream_format import Agreement
from server.service.streaming.frame_buffer import FrameBuffer

CLOCK = 1 << 33


@dataclass(frozen=True)
class Packet:
    """A packet taken apart by the standard's own words (2.4.3.2)."""

    pid: int
    begins: bool
    counter: int
    payload: bytes
    pcr: int | None
    key: bool


def taken_apart(data: bytes) -> list[Packet]:
    assert len(data) % PACKET_BYTES == 0
    return [one(data[at : at + PACKET_BYTES]) for at in range(0, len(data), PACKET_BYTES)]


def one(packet: bytes) -> Packet:
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


def check_counters(found: list[Packet]) -> None:
    """Check that nothing is missing anywhere: what a receiver does."""
    last: dict[int, int] = {}
    for packet in found:
        if packet.pid in last:
            assert packet.counter == (last[packet.pid] + bool(packet.payload)) % COUNTERS, packet.pid
        last[packet.pid] = packet.counter


def picture(pulse: int, size: int, *, key: bool = False, lasts: int = 1, fps: float = FPS) -> Picture:
    data = (size + 1).to_bytes(4, "big") + bytes([0x65 if key else 0x41]) + b"\x80" * size
    return Picture(pulse, key, fragment([Sample(data, key, lasts)], pulse, fps), 1, lasts)


sizes = st.lists(st.one_of(st.integers(1, 600), st.integers(1, 70_000)), min_size=1, max_size=12)


@settings(max_examples=60, deadline=None)
@given(st.lists(sizes, min_size=1, max_size=4), st.integers(0, 10**8), st.booleans())
def test_packets_are_legal_and_hold_just_what_was_packed(
    gops: list[list[int]], pulse: int, live: bool
) -> None:
    data, sent, tables, video = b"", [], 0, 0
    for gop in gops:
        pictures = [picture(pulse + n, size, key=n == 0) for n, size in enumerate(gop)]
        counters = Counters(tables, video, whole=not live)
        data += pack(pictures, FPS, counters)
        pulse, tables = pulse + len(gop), tables + 1
        video += sum(packets(it) for it in pictures) if live else 0
        sent += pictures
    found = taken_apart(data)
    check_counters(found)
    assert {packet.pid for packet in found[:2]} == {0, 0x1000}, "tables first"
    contents: list[bytes] = []
    for packet in [it for it in found if it.pid == 0x100]:
        contents[len(contents) :] = [b""] if packet.begins else []
        contents[-1] += packet.payload
    assert len(contents) == len(sent)
    for content, it in zip(contents, sent, strict=True):
        assert content[:4] == b"\x00\x00\x01\xe0"
        assert int.from_bytes(content[4:6], "big") in (len(content) - 6, 0)
        stamp = content[9:14]
        pts = (
            (stamp[0] >> 1 & 7) << 30 | (stamp[1] << 7 | stamp[2] >> 1) << 15 | stamp[3] << 7 | stamp[4] >> 1
        )
        assert pts == ticks(it.pulse, FPS) % CLOCK
        assert stamp[0] & 1 == stamp[2] & 1 == stamp[4] & 1 == 1, "marker bits"
        assert content[14:20] == b"\x00\x00\x00\x01\x09\xf0"
        assert content[20:] == b"\x00\x00\x00\x01" + it.sample[4:]
    for packet in found:
        assert not packet.key or packet.begins


@given(st.integers(0, 2**34 // 3600), st.sampled_from([4, 7.5, 25, 59.94]))
def test_the_time_reference_comes_often_and_before_its_picture(pulse: int, fps: float) -> None:
    pictures = [picture(pulse, 50, key=True, fps=fps), picture(pulse + 1, 30, lasts=40, fps=fps)]
    found = taken_apart(pack(pictures, fps, Counters()))
    times = [it.pcr // 300 for it in found if it.pcr is not None]
    assert all(0 < (later - earlier) % CLOCK <= 9000 for earlier, later in pairwise(times))
    assert 0 < (ticks(pulse, fps) - times[0]) % CLOCK <= 90_000
    check_counters(found)


def spliced(cameras: list[int]) -> tuple[bytes, list[tuple[int, int]]]:
    """Give a stream of GOPs of these cameras, and which camera and pulse each picture is."""
    agreement, data, frames = Agreement(), b"", []
    shelves = [FrameBuffer(FPS, 40, agreement) for _ in CAMERAS]
    for seed, shelf in enumerate(shelves):
        for unit in encoded(seed):
            shelf.put(unit.pulse, 1, unit.data, key=unit.key)
    for place, camera in enumerate(cameras):
        data += pack(shelves[camera].pictures(place * GOP, GOP), FPS, Counters(place))
        frames += [(camera, pulse) for pulse in range(place * GOP, (place + 1) * GOP)]
    return data, frames


def own_pictures(camera: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    decoder = av.CodecContext.create("h264", "r")
    packets = [*(av.Packet(unit.data) for unit in encoded(camera)), None]
    return [it.to_ndarray(format="yuv420p") for packet in packets for it in decoder.decode(packet)]


def test_a_decoder_shows_the_cameras_own_pixels_across_cuts() -> None:
    data, frames = spliced([0, 1, 1, 0, 1, 0, 0, 1])
    own = [own_pictures(camera) for camera in range(2)]
    with av.open(io.BytesIO(data), format="mpegts") as container:
        pictures = list(container.decode(video=0))
    assert [round(float(it.time or 0) * FPS) for it in pictures] == [pulse for _, pulse in frames]
    for it, (camera, pulse) in zip(pictures, frames, strict=True):
        np.testing.assert_array_equal(it.to_ndarray(format="yuv420p"), own[camera][pulse])


@needs_ffprobe
def test_ffprobe_has_nothing_to_say(tmp_path: Path) -> None:
    (tmp_path / "best.ts").write_bytes(spliced([0, 1, 1, 0])[0])
    assert probed(tmp_path / "best.ts", "nb_read_frames,r_frame_rate") == [["25/1", f"{4 * GOP}"]]
