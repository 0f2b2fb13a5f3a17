"""No stream has a gap in its time: in place of a missing picture, a decoder shows the last one again."""

from __future__ import annotations

import asyncio
import io
from dataclasses import dataclass
from functools import cache

import av
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fakes.media.decoding import video_decoder
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, HEIGHT, NO_REASON, WIDTH, small_config
from fakes.timeouts import PATIENCE
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.codec import stream_format_for
from server.media.containers.fmp4 import init_segment
from server.media.picture import Codec
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.streaming.subscriber_queue import Subscriber
from server.service.view_selection.decider import GopDecision, ObjectChoice

FRAMES = 6 * GOP


@dataclass(frozen=True)
class ShownPicture:
    """A decoded picture, its pulse and its duration in pulses."""

    pulse: int
    duration: int
    picture: NDArray[np.uint8]


@cache
def captured_units(
    seed: int, missed: frozenset[int], preset: str, codec: Codec = "h264"
) -> tuple[AccessUnit, ...]:
    """Encode a camera's pictures except at missed pulses."""
    encoder = Encoder(
        SiteSettings(width=WIDTH, height=HEIGHT, fps=FPS),
        EncodeSettings.model_validate({"gop_s": GOP / FPS, "preset": preset, "codec": codec}),
    )
    noise = np.random.default_rng(seed).integers(0, 255, (FRAMES, HEIGHT, WIDTH, 3), dtype=np.uint8)
    return tuple(encoder.encode(pulse, noise[pulse]) for pulse in range(FRAMES) if pulse not in missed)


def decoded_alone(units: tuple[AccessUnit, ...], codec: Codec = "h264") -> dict[int, NDArray[np.uint8]]:
    """Decode a camera's own stream."""
    decoder = video_decoder(codec)
    frames = [
        frame for data in [*units, None] for frame in decoder.decode(av.Packet(data.data) if data else None)
    ]
    return {unit.pulse: frame.to_ndarray(format="yuv420p") for unit, frame in zip(units, frames, strict=True)}


def shown(splicer_head: bytes, pieces: list[bytes]) -> list[ShownPicture]:
    with av.open(io.BytesIO(splicer_head + b"".join(pieces))) as container:
        found = []
        for frame in container.decode(video=0):
            pulse = round(float(frame.time or 0) * FPS)
            duration = round((frame.duration or 0) * FPS / 90_000)
            found.append(ShownPicture(pulse, duration, frame.to_ndarray(format="yuv420p")))
        return found


async def read_all(viewer: Subscriber) -> list[bytes]:
    viewer.close()
    async with asyncio.timeout(PATIENCE):
        return [data async for data in viewer]


pulses = st.frozensets(st.integers(0, FRAMES - 1), max_size=8)


@settings(max_examples=40, deadline=None)
@given(
    missed=pulses,
    lost=st.tuples(pulses, pulses),
    selected_cameras=st.lists(st.sampled_from([*CAMERAS, None]), min_size=6, max_size=6),
    preset=st.sampled_from(["ultrafast", "superfast"]),
    codec=st.sampled_from(["h264", "h265"]),
)
def test_every_pulse_shows_a_cameras_own_picture_of_it_or_the_picture_before(
    missed: frozenset[int],
    lost: tuple[frozenset[int], frozenset[int]],
    selected_cameras: list[str | None],
    preset: str,
    codec: Codec,
) -> None:
    stream_format = stream_format_for(codec, (WIDTH, HEIGHT))
    frame_buffers = {camera: FrameBuffer(FPS, FRAMES, stream_format) for camera in CAMERAS}
    splicer = Splicer(frame_buffers, stream_format, small_config())
    sent = {camera: captured_units(seed, missed, preset, codec) for seed, camera in enumerate(CAMERAS)}
    own = {camera: decoded_alone(units, codec) for camera, units in sent.items()}
    live = {camera: splicer.cameras[camera].subscribe() for camera in CAMERAS}
    for camera, lost_frames in zip(CAMERAS, lost, strict=True):
        for unit in sent[camera]:
            if unit.pulse not in lost_frames:
                splicer.publish_frame(
                    camera, frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
                )
    best = None
    for number, selected in enumerate(selected_cameras):
        whole = selected and all(
            frame_buffers[selected].has(pulse) for pulse in range(number * GOP, (number + 1) * GOP)
        )
        choice = ObjectChoice(1, selected if whole else None, None, departed=False)
        splicer.publish_decision(GopDecision(number * GOP, GOP, (choice,), {}, {}, (), NO_REASON))
        best = best or splicer.persons[1].subscribe()
    assert best is not None
    if stream_format.parameters is None:
        return
    head = init_segment(stream_format.parameters, WIDTH, HEIGHT)
    for viewer, cameras in [(best, CAMERAS), *((live[camera], (camera,)) for camera in CAMERAS)]:
        pieces = asyncio.run(read_all(viewer))
        if not pieces:
            continue
        pictures = shown(head, pieces)
        assert [picture.pulse for picture in pictures[1:]] == [
            picture.pulse + picture.duration for picture in pictures[:-1]
        ], "no gap"
        before: NDArray[np.uint8] | None = None
        for picture in pictures:
            possible = [own[camera][picture.pulse] for camera in cameras if picture.pulse in own[camera]]
            possible += [] if before is None else [before]
            assert any(np.array_equal(picture.picture, other) for other in possible), picture.pulse
            before = picture.picture
        if viewer is best:
            assert pictures[-1].pulse + pictures[-1].duration == FRAMES


def make_splicer() -> tuple[Splicer, dict[str, FrameBuffer], bytes]:
    stream_format = StreamFormat()
    frame_buffers = {camera: FrameBuffer(FPS, 40, stream_format) for camera in CAMERAS}
    splicer = Splicer(frame_buffers, stream_format, small_config())
    for unit in captured_units(0, frozenset(), "ultrafast"):
        frame_buffers["c0"].put(unit.pulse, 1, unit.data, key=unit.key)
    assert stream_format.parameters is not None
    return splicer, frame_buffers, init_segment(stream_format.parameters, WIDTH, HEIGHT)


def decide(splicer: Splicer, gop: int, camera: str | None) -> None:
    choice = ObjectChoice(1, camera, None, departed=False)
    splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def test_a_skipped_frame_affects_no_other_picture() -> None:
    splicer, frame_buffers, head = make_splicer()
    units = captured_units(1, frozenset({7, 8}), "ultrafast")
    for unit in units:
        frame_buffers["c1"].put(unit.pulse, 1, unit.data, key=unit.key)
    decide(splicer, 0, "c1")
    viewer = splicer.persons[1].subscribe()
    decide(splicer, 1, None)
    pictures = shown(head, await read_all(viewer))
    assert [(picture.pulse, picture.duration) for picture in pictures[GOP:]] == [
        (5, 1),
        (6, 1),
        (7, 2),
        (9, 1),
    ]
    own = decoded_alone(units)
    for picture, pulse in zip(pictures[GOP:], [5, 6, 6, 9], strict=True):
        np.testing.assert_array_equal(picture.picture, own[pulse])


async def test_the_last_picture_of_a_silent_camera_stays_until_it_returns() -> None:
    splicer, _, head = make_splicer()
    viewer = splicer.cameras["c0"].subscribe()
    units = captured_units(0, frozenset(), "ultrafast")
    frame_buffer = FrameBuffer(FPS, 10, StreamFormat())
    for unit in units[: GOP + 2]:
        splicer.publish_frame("c0", frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key))
    for gop in range(2, 14):
        decide(splicer, gop, None)
    for unit in units[GOP + 2 : GOP + 4]:
        splicer.publish_frame("c0", frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key))
    splicer.close()
    pictures = shown(head, await read_all(viewer))
    assert [picture.pulse for picture in pictures] == list(range(13 * GOP - 2 * FPS)), (
        "late pictures are not shown"
    )
    for picture in pictures[GOP + 2 :]:
        np.testing.assert_array_equal(picture.picture, decoded_alone(units)[GOP + 1])


async def test_a_viewer_who_joins_in_a_long_gap_waits_and_no_queue_grows() -> None:
    splicer, _, _ = make_splicer()
    decide(splicer, 0, "c0")
    slow = splicer.persons[1].subscribe()
    for gop in range(8, 2000):
        decide(splicer, gop, None)
    assert len(slow._queue) < 20
    late = splicer.persons[1].subscribe()
    assert not late._queue


async def test_a_stream_continues_after_hours_without_a_picture() -> None:
    splicer, frame_buffers, _ = make_splicer()
    decide(splicer, 0, "c0")
    viewer = splicer.persons[1].subscribe()
    day = 86_400 * FPS
    for unit in captured_units(0, frozenset(), "ultrafast")[:GOP]:
        frame_buffers["c0"].put(day + unit.pulse, 1, unit.data, key=unit.key)
    decide(splicer, day // GOP, "c0")
    assert len(await read_all(viewer)) == 2


async def test_restarted_pulses_restart_the_stream() -> None:
    splicer, frame_buffers, _ = make_splicer()
    units = captured_units(0, frozenset(), "ultrafast")
    for unit in units[:GOP]:
        splicer.publish_frame("c0", frame_buffers["c0"].put(100_000 + unit.pulse, 1, unit.data, key=unit.key))
    viewer = splicer.cameras["c0"].subscribe()
    for unit in units[:GOP]:
        splicer.publish_frame("c0", frame_buffers["c0"].put(unit.pulse, 2, unit.data, key=unit.key))
    assert len(await read_all(viewer)) == 2 * GOP
