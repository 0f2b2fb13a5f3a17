"""Segments: whole GOPs, numbered by their pulses, each decodable by itself, with and without gaps."""

from __future__ import annotations

import io
from itertools import pairwise

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, HEIGHT, NO_REASON, WIDTH, encoded, small_config
from server.media.containers.fmp4 import init_segment
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.hls_segmenter import HlsSegment, HlsSegmenter, segment_layout
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import GopDecision, ObjectChoice

GOPS = 40


class Site:
    """A splicer whose decisions a test makes; cameras have all frames but those of the GOPs in ``silent``."""

    def __init__(self, silent: frozenset[int] = frozenset(), begin: int = 0) -> None:
        self.stream_format = StreamFormat()
        self.frame_buffers = {camera: FrameBuffer(FPS, GOPS * GOP, self.stream_format) for camera in CAMERAS}
        self.splicer = Splicer(
            self.frame_buffers, self.stream_format, small_config(http={"hls_segment_s": 0.41})
        )
        for seed, camera in enumerate(CAMERAS):
            for unit in encoded(seed, GOPS * GOP):
                if unit.pulse // GOP not in silent and unit.pulse // GOP >= begin:
                    self.frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)

    def show(self, gop: int, camera: str | None) -> None:
        choice = ObjectChoice(1, camera, None, departed=False)
        self.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))

    @property
    def segmenter(self) -> HlsSegmenter:
        segmenter = self.splicer.segmenter_of_person(1)
        assert segmenter is not None
        return segmenter

    def decoded(self, segments: list[HlsSegment]) -> list[tuple[float, float, NDArray[np.uint8]]]:
        """Return when each picture is shown and until when, in pulses, and the picture."""
        assert self.stream_format.parameters is not None
        head = init_segment(self.stream_format.parameters, WIDTH, HEIGHT)
        with av.open(io.BytesIO(head + b"".join(segment.data for segment in segments))) as container:
            return [
                (
                    float(frame.time or 0) * FPS,
                    float(frame.time or 0) * FPS + (frame.duration or 0) * FPS / 90_000,
                    frame.to_ndarray(format="yuv420p"),
                )
                for frame in container.decode(video=0)
            ]


def decoded_alone(camera: int) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("h264", "r")
    packets = [*(av.Packet(unit.data) for unit in encoded(camera, GOPS * GOP)), None]
    return [frame.to_ndarray(format="yuv420p") for packet in packets for frame in decoder.decode(packet)]


@pytest.mark.parametrize(
    ("fps", "gop", "segment_s", "frames", "target"),
    [
        (25, 10, 1.0, 20, 1),
        (25, 10, 2.0, 50, 2),
        (25, 25, 1.0, 25, 1),
        (25, 50, 1.0, 50, 2),
        (30, 1, 0.5, 15, 1),
    ],
)
def test_a_segment_has_as_many_whole_gops_as_fit(
    fps: float, gop: int, segment_s: float, frames: int, target: int
) -> None:
    found = segment_layout(fps, gop, segment_s, 6.0)
    assert (found.segment_frames, found.target_s) == (frames, target)
    assert found.playlist_length >= 3, "RFC 8216, 6.2.2: a live playlist has three target durations"
    assert round(frames / fps + 1e-9) <= target


def test_segments_are_numbered_by_their_pulses_and_listed_when_complete() -> None:
    site = Site()
    for gop in range(9):
        site.show(gop, CAMERAS[gop % 2])
    assert [segment.number for segment in site.segmenter.playlist_segments] == [0, 1, 2, 3]
    assert [segment.until - segment.first for segment in site.segmenter.playlist_segments] == [2 * GOP] * 4
    assert site.segmenter.listed_segment(4) is None, "it is incomplete"
    site.splicer.close()
    assert [segment.number for segment in site.segmenter.playlist_segments] == [0, 1, 2, 3, 4]
    assert site.segmenter.playlist_segments[-1].until - site.segmenter.playlist_segments[-1].first == GOP


def test_a_service_that_starts_later_makes_the_same_segments() -> None:
    early, late = Site(), Site(begin=7)
    for gop in range(20):
        early.show(gop, CAMERAS[gop % 3 % 2])
        if gop >= 7:
            late.show(gop, CAMERAS[gop % 3 % 2])
    assert [segment.number for segment in late.segmenter.playlist_segments] == list(range(3, 10))
    for segment in late.segmenter.playlist_segments[1:]:
        other = early.segmenter.listed_segment(segment.number)
        assert other is not None
        assert segment.data == other.data


def test_a_segment_stays_available_for_a_playlists_duration_after_it_left() -> None:
    site = Site()
    listed = site.splicer.layout.playlist_length
    for gop in range(1000):
        site.show(gop, CAMERAS[0])
        numbers = [segment.number for segment in site.segmenter.playlist_segments]
        assert len(site.segmenter._segments) <= 2 * listed + 1
        if numbers and numbers[0] >= listed:
            assert site.segmenter.listed_segment(numbers[0] - listed) is not None
            assert site.segmenter.listed_segment(numbers[0] - listed - 2) is None


def test_people_shown_by_one_camera_share_the_bytes_with_each_other_and_the_camera() -> None:
    site = Site()
    choices = tuple(ObjectChoice(number, CAMERAS[0], None, departed=False) for number in (1, 2))
    site.splicer.publish_decision(GopDecision(0, GOP, choices, {}, {}, (), NO_REASON))
    segmenters = [
        site.splicer.segmenter_of_person(1),
        site.splicer.segmenter_of_person(2),
        site.splicer.segmenter_of_camera(CAMERAS[0]),
    ]
    chunks = {id(segmenter._segments[0]._chunks[0]) for segmenter in segmenters if segmenter}
    assert len(chunks) == 1


@settings(max_examples=20, deadline=None)
@given(st.frozensets(st.integers(1, 15)), st.lists(st.sampled_from(CAMERAS), min_size=16, max_size=16))
def test_every_segment_decodes_by_itself_and_together_they_have_no_gap(
    silent: frozenset[int], cameras: list[str]
) -> None:
    site, alone = Site(silent), [decoded_alone(camera) for camera in range(2)]
    last = None
    shown: list[NDArray[np.uint8]] = []
    for gop, camera in enumerate(cameras):
        site.show(gop, None if gop in silent else camera)
        if gop not in silent:
            last = CAMERAS.index(camera)
        assert last is not None
        for pulse in range(gop * GOP, (gop + 1) * GOP):
            shown.append(shown[-1] if gop in silent else alone[last][pulse])
    for segment in site.segmenter.playlist_segments:
        check_pictures(site.decoded([segment]), shown, segment.first)
    check_pictures(
        site.decoded(list(site.segmenter.playlist_segments)), shown, site.segmenter.playlist_segments[0].first
    )


def check_pictures(
    pictures: list[tuple[float, float, NDArray[np.uint8]]], shown: list[NDArray[np.uint8]], first: int
) -> None:
    """Compare the shown pictures with the expected ones; pictures of one or two ticks are ignored."""
    assert pictures[0][0] == pytest.approx(first)
    for (_, until, _), (begin, _, _) in pairwise(pictures):
        assert until == pytest.approx(begin), "no gap"
    for begin, until, picture in pictures:
        if until - begin > 0.01:
            for pulse in range(round(begin), round(until)):
                np.testing.assert_array_equal(picture, shown[pulse])


def test_the_last_segments_of_a_forgotten_person_stay_available_for_a_while() -> None:
    site = Site()
    for gop in range(5):
        site.show(gop, CAMERAS[0])
    site.splicer.forget([], [])
    segmenter = site.segmenter
    assert segmenter.has_ended
    assert [segment.number for segment in segmenter.playlist_segments] == [0, 1, 2]
    for gop in range(5, 200):
        site.splicer.publish_decision(GopDecision(gop * GOP, GOP, (), {}, {}, (), NO_REASON))
    assert site.splicer.segmenter_of_person(1) is None


@pytest.mark.parametrize("absent", [1, 4, 20, 100_000])
def test_segment_numbers_are_consecutive_despite_missing_decisions(absent: int) -> None:
    site = Site()
    for gop in [*range(7), *range(7 + absent, 9 + absent)]:
        site.show(gop, CAMERAS[0])
    for gop in range(9 + absent, 20 + absent):
        site.show(gop, CAMERAS[0])
        numbers = [segment.number for segment in site.segmenter.playlist_segments]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        assert all(
            segment.until - segment.first <= site.splicer.layout.segment_frames
            for segment in site.segmenter.playlist_segments
        )
