"""The streaming benchmark: its counts match what was sent."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from socket import create_server

import pytest

from benchmarks.common.report import Report
from benchmarks.streaming.bare_sockets import measure_bare_sends
from benchmarks.streaming.delay_drift import drift, timestamps
from benchmarks.streaming.ffmpeg_and_nginx import ffmpeg_switching
from benchmarks.streaming.frame_correctness import FrameCorrectness
from benchmarks.streaming.hls_latency import hls_delays
from benchmarks.streaming.simulated_cameras import draw_room, load, save
from benchmarks.streaming.splice_cost import splice, transcode
from benchmarks.streaming.stalled_viewers import (
    ReadingRound,
    StallComparison,
    compare_stalled,
    open_stalled_viewers,
)
from benchmarks.streaming.stream_site import running, viewers
from benchmarks.streaming.tables import StreamMeasurements, describe, per_core, plot
from benchmarks.streaming.timed_service import SendTimes, read
from benchmarks.streaming.viewer_crowd import CrowdReading, ViewerCrowd
from benchmarks.streaming.viewing_cost import (
    ViewerStep,
    end_of_first_fragment,
    first_pictures,
    send_delays,
    watch_objects,
)
from server.camera.encoder import AccessUnit
from server.media.containers.fmp4 import FragmentSample, fragment, ticks
from server.media.containers.mpegts import ContinuityCounters
from server.media.picture import EncodedPicture
from server.service.streaming.media_chunk import MediaChunk

GOP = 10
Films = Sequence[Sequence[AccessUnit]]


@pytest.fixture(scope="module")
def films() -> Films:
    return draw_room(2 * GOP)


def test_saved_films_are_loaded_unchanged(films: Films, tmp_path: Path) -> None:
    save([list(film) for film in films], tmp_path / "films")
    assert load(tmp_path / "films") == films


def test_a_splice_is_much_cheaper_than_encoding_and_cheaper_still_for_many(films: Films) -> None:
    one, many = (asyncio.run(splice(films, objects, 30)) for objects in (1, 50))
    transcoded = transcode(films[0], 3)
    assert 0 < many.spliced < one.spliced < transcoded.total / 20
    assert many.buffered_share == pytest.approx(4 * many.buffered / 50)
    assert many.spliced < transcoded.total / 300


@pytest.mark.slow
def test_with_parts_hls_shows_a_frame_seconds_sooner(films: Films) -> None:
    segments, parts = asyncio.run(hls_delays(films, 5))
    assert parts.shown < segments.shown - 1
    assert parts.shown > 3 * GOP / 25 - GOP / 25, "a player keeps the hold-back distance"
    assert parts.fetched < segments.fetched


def test_the_delay_is_constant_and_timestamps_are_those_of_the_pulses(films: Films) -> None:
    found = asyncio.run(drift(films, 300))
    assert found.min_delay == found.max_delay == 24, "look-ahead, less the pulse that begins the GOP"
    assert found.max_time_error == 0
    assert found.gops == (300 - 24 - 1) // GOP + 1
    assert len(found.costs) == 10


@pytest.mark.parametrize("pulse", [0, 12_345, 2**31])
def test_the_timestamps_of_a_chunk_are_read_from_both_containers(pulse: int) -> None:
    data = fragment([FragmentSample(b"\x00\x00\x17\x70" + b"\x65" * 6000, key=True)], pulse, 25)
    expected = ticks(pulse, 25)
    chunk = MediaChunk([EncodedPicture(pulse, key=True, fragment=data, boot=1)], 25, ContinuityCounters())
    assert timestamps(chunk) == (expected, expected % 2**33)


def test_the_first_fragment_ends_after_its_mdat_box() -> None:
    complete = fragment([FragmentSample(b"abc", key=True)], 7, 25)
    head = b"\x00\x00\x00\x10ftypiso5\x00\x00\x00\x00"
    assert [
        end_of_first_fragment((head + complete)[:size]) for size in (0, 20, len(head + complete) - 1)
    ] == [
        0,
        0,
        0,
    ]
    assert end_of_first_fragment(head + complete + complete) == len(head + complete)


def test_a_send_delay_ends_with_the_last_frame_of_a_gop() -> None:
    reading = CrowdReading(1.0, 1.0, 0.1, 0, [ticks(19, 25), ticks(14, 25), ticks(39, 25)], [5.25, 5.1, 6.0])
    assert send_delays(reading, {10: 5.0, 20: 5.4}).tolist() == [250.0]


def test_send_times_are_read_up_to_an_incomplete_line(tmp_path: Path) -> None:
    (tmp_path / "sent").write_text("10 5.0 5.25\n20 5.4 5.5\n30 5.8", encoding="ascii")
    assert read(tmp_path / "sent") == {10: SendTimes(5.0, 5.25), 20: SendTimes(5.4, 5.5)}


def test_a_bare_loop_sends_whole_gops_to_all(films: Films) -> None:
    bare = measure_bare_sends(films[0], 20, 1.0)
    assert bare.viewers == 20
    assert 0 < bare.microseconds < 1000
    assert 0 < bare.sent_ms < 1000
    assert 0 < bare.delays[0] <= bare.delays[1] <= bare.delays[2]


@contextmanager
def serving_bytes(data: bytes) -> Iterator[int]:
    """Send the same bytes to three connections, and close each."""
    with create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            for _ in range(3):
                connection, _ = server.accept()
                with connection:
                    connection.recv(1000)
                    connection.sendall(data)

        thread = threading.Thread(target=serve)
        thread.start()
        yield server.getsockname()[1]
        thread.join()


def test_a_crowd_counts_received_bytes_and_closed_connections() -> None:
    data = fragment([FragmentSample(b"abc" * 100, key=True)], 9, 25)
    with serving_bytes(data) as port:
        crowd, began = ViewerCrowd(port), time.monotonic()
        crowd.watch(["/"] * 3)
        readings = [crowd.read(0.1)]
        while readings[-1].disconnected < 3:
            readings.append(crowd.read(0.1))
        crowd.leave()
    assert sum(reading.megabytes for reading in readings) == pytest.approx(3 * len(data) / 1e6)
    assert [tick for reading in readings for tick in reading.ticks] == [ticks(9, 25)] * 3
    assert all(began < at < time.monotonic() for reading in readings for at in reading.arrivals)


def step(count: int, cores: float, p99: float) -> ViewerStep:
    return ViewerStep(count, cores, 0.1, 500.0, 1.0, (1.0, 2.0, p99), 3.0, 1.0)


def test_viewers_per_core_follow_from_a_line_fit_with_idle_cores() -> None:
    idle, count = per_core([step(1000, 0.3, 1.0), step(2000, 0.5, 1.0), step(3000, 0.7, 1.0)])
    assert idle == pytest.approx(0.1)
    assert count == pytest.approx(4500)


def test_the_table_has_correct_frames_and_viewers_served_in_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = StreamMeasurements(
        steps=[step(500, 0.2, 39.0), step(1000, 0.3, 41.0)], correctness=FrameCorrectness(100, 5, 100, 98, 0)
    )
    describe(Report(), found)
    printed = capsys.readouterr().out
    assert "98 of 100" in printed
    assert any("p99 below" in line and " 500 " in line for line in printed.splitlines())
    plot(found, tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 1000


@pytest.mark.slow
def test_a_real_site_with_viewers_is_measured(films: Films, tmp_path: Path) -> None:
    switched = ffmpeg_switching(films, 100, tmp_path)
    assert switched is None or switched > 50
    with running(films, tmp_path / "site") as site, viewers(site.http) as crowd:
        numbers = site.objects(20)[:20]
        watched = watch_objects(site, crowd, numbers, films[0], 2.0, 1)
        assert 0 < watched.one < 2
        assert watched.objects == 20
        assert watched.encoding_ratio > 1
        milliseconds = first_pictures(site, numbers, 5)
        assert (milliseconds > 0).all()
        assert (milliseconds < 5000).all()


def test_the_stall_ratio_is_that_of_medians_over_rounds() -> None:
    without = [ReadingRound(10.0, p99, 1.0, 0.3) for p99 in (50.0, 400.0, 52.0)]
    with_stalled = [ReadingRound(10.0, p99, 1.0, 0.3) for p99 in (54.0, 56.0, 900.0)]
    assert StallComparison(900, 100, without, with_stalled).ratio == pytest.approx(56.0 / 52.0)


def test_a_stalled_viewer_requests_a_stream_and_never_reads() -> None:
    with (
        create_server(("127.0.0.1", 0)) as server,
        open_stalled_viewers(server.getsockname()[1], ["/a", "/b"]) as stalled,
    ):
        connection, _ = server.accept()
        with connection:
            assert connection.recv(100).startswith(b"GET /a ")
            connection.settimeout(0.2)
            with pytest.raises(TimeoutError):  # all buffers are full
                connection.sendall(bytes(64_000_000))
        assert len(stalled) == 2


@pytest.mark.slow
def test_the_other_viewers_of_a_real_site_receive_everything_while_a_tenth_stalls(
    films: Films, tmp_path: Path
) -> None:
    with running(films, tmp_path / "site") as site, viewers(site.http) as crowd:
        found = compare_stalled(site, crowd, site.objects(20)[:20], 50, 4.0, 2)
        assert (found.readers, found.stalled) == (45, 5)
        assert all(reading_round.arrived > 0.9 for reading_round in found.with_stalled)
