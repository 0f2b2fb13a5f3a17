"""Transport streams: valid packets, any GOP after any other, the cameras' own pixels at the pulses' times."""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.ffprobe import probed
from fakes.media.mpegts import check_counters, parse_packets
from fakes.programs import needs_ffprobe
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, encoded
from server.media.containers.fmp4 import FragmentSample, fragment, ticks
from server.media.containers.mpegts import ContinuityCounters, count_packets, pack
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer

CLOCK = 1 << 33


def picture(
    pulse: int, size: int, *, key: bool = False, duration: int = 1, fps: float = FPS
) -> EncodedPicture:
    data = (size + 1).to_bytes(4, "big") + bytes([0x65 if key else 0x41]) + b"\x80" * size
    return EncodedPicture(
        pulse, key, fragment([FragmentSample(data, key, duration)], pulse, fps), 1, duration
    )


sizes = st.lists(st.one_of(st.integers(1, 600), st.integers(1, 70_000)), min_size=1, max_size=12)


@settings(max_examples=60, deadline=None)
@given(st.lists(sizes, min_size=1, max_size=4), st.integers(0, 10**8), st.booleans())
def test_packets_are_valid_and_contain_exactly_what_was_packed(
    gops: list[list[int]], pulse: int, live: bool
) -> None:
    data, sent, tables, video = b"", [], 0, 0
    for gop in gops:
        pictures = [picture(pulse + n, size, key=n == 0) for n, size in enumerate(gop)]
        counters = ContinuityCounters(tables, video, aligned=not live)
        data += pack(pictures, FPS, counters)
        pulse, tables = pulse + len(gop), tables + 1
        video += sum(count_packets(picture) for picture in pictures) if live else 0
        sent += pictures
    packets = parse_packets(data)
    check_counters(packets)
    assert {packet.pid for packet in packets[:2]} == {0, 0x1000}, "tables first"
    contents: list[bytes] = []
    for packet in [packet for packet in packets if packet.pid == 0x100]:
        contents[len(contents) :] = [b""] if packet.begins else []
        contents[-1] += packet.payload
    assert len(contents) == len(sent)
    for content, chunk in zip(contents, sent, strict=True):
        assert content[:4] == b"\x00\x00\x01\xe0"
        assert int.from_bytes(content[4:6], "big") in (len(content) - 6, 0)
        stamp = content[9:14]
        pts = (
            (stamp[0] >> 1 & 7) << 30 | (stamp[1] << 7 | stamp[2] >> 1) << 15 | stamp[3] << 7 | stamp[4] >> 1
        )
        assert pts == ticks(chunk.pulse, FPS) % CLOCK
        assert stamp[0] & 1 == stamp[2] & 1 == stamp[4] & 1 == 1, "marker bits"
        assert content[14:20] == b"\x00\x00\x00\x01\x09\xf0"
        assert content[20:] == b"\x00\x00\x00\x01" + chunk.sample[4:]
    for packet in packets:
        assert not packet.key or packet.begins


@given(st.integers(0, 2**34 // 3600), st.sampled_from([4, 7.5, 25, 59.94]))
def test_clock_references_are_frequent_and_precede_their_pictures(pulse: int, fps: float) -> None:
    pictures = [picture(pulse, 50, key=True, fps=fps), picture(pulse + 1, 30, duration=40, fps=fps)]
    packets = parse_packets(pack(pictures, fps, ContinuityCounters()))
    times = [packet.pcr // 300 for packet in packets if packet.pcr is not None]
    assert all(0 < (later - earlier) % CLOCK <= 9000 for earlier, later in pairwise(times))
    assert 0 < (ticks(pulse, fps) - times[0]) % CLOCK <= 90_000
    check_counters(packets)


def spliced(cameras: list[int]) -> tuple[bytes, list[tuple[int, int]]]:
    """Return a stream of GOPs of these cameras, and which camera and pulse each picture is."""
    stream_format, data, frames = StreamFormat(), b"", []
    frame_buffers = [FrameBuffer(FPS, 40, stream_format) for _ in CAMERAS]
    for seed, frame_buffer in enumerate(frame_buffers):
        for unit in encoded(seed):
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)
    for place, camera in enumerate(cameras):
        data += pack(frame_buffers[camera].pictures(place * GOP, GOP), FPS, ContinuityCounters(place))
        frames += [(camera, pulse) for pulse in range(place * GOP, (place + 1) * GOP)]
    return data, frames


def own_pictures(camera: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    decoder = av.CodecContext.create("h264", "r")
    count_packets = [*(av.Packet(unit.data) for unit in encoded(camera)), None]
    return [
        frame.to_ndarray(format="yuv420p") for packet in count_packets for frame in decoder.decode(packet)
    ]


def test_a_decoder_shows_the_cameras_own_pixels_across_cuts() -> None:
    data, frames = spliced([0, 1, 1, 0, 1, 0, 0, 1])
    own = [own_pictures(camera) for camera in range(2)]
    with av.open(io.BytesIO(data), format="mpegts") as container:
        pictures = list(container.decode(video=0))
    assert [round(float(picture.time or 0) * FPS) for picture in pictures] == [pulse for _, pulse in frames]
    for picture, (camera, pulse) in zip(pictures, frames, strict=True):
        np.testing.assert_array_equal(picture.to_ndarray(format="yuv420p"), own[camera][pulse])


@needs_ffprobe
def test_ffprobe_reports_no_errors(tmp_path: Path) -> None:
    (tmp_path / "best.ts").write_bytes(spliced([0, 1, 1, 0])[0])
    assert probed(tmp_path / "best.ts", "nb_read_frames,r_frame_rate") == [["25/1", f"{4 * GOP}"]]
