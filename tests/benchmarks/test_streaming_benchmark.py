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
from benchmarks.streaming.bare_sockets import bare_sends
from benchmarks.streaming.delay_drift import drift, times
from benchmarks.streaming.ffmpeg_and_nginx import ffmpeg_switching
from benchmarks.streaming.frame_correctness import FrameCorrectness
from benchmarks.streaming.hls_latency import hls_delays
from benchmarks.streaming.simulated_cameras import draw_room, load, save
from benchmarks.streaming.splice_cost import encode_again, splice
from benchmarks.streaming.stalled_viewers import ReadingRound, StallComparison, beside_stalled, stalling
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
from server.camera.encoding.encoder import AccessUnit
from server.media.containers.fmp4 import FragmentSample, fragment, ticks
from server.media.containers.mpegts import ContinuityCounters
from server.media.picture import EncodedPicture
from server.service.streaming.media_chunk import MediaChunk

GOP = 10
Films = Sequence[Sequence[AccessUnit]]


@pytest.fixture(scope="module")
def films() -> Films:
    return draw_room(2 * GOP)


def test_films_are_kept_as_they_are(films: Films, tmp_path: Path) -> None:
    save([list(film) for film in films], tmp_path / "films")
    assert load(tmp_path / "films") == films


def test_a_splice_is_much_cheaper_than_encoding_and_cheaper_still_for_many(films: Films) -> None:
    one, many = (asyncio.run(splice(films, objects, 30)) for objects in (1, 50))
    again = encode_again(films[0], 3)
    assert 0 < many.spliced < one.spliced < again.whole / 20
    assert many.shelved_share == pytest.approx(4 * many.shelved / 50)
    assert many.spliced < again.whole / 300


@pytest.mark.slow
def test_with_parts_hls_shows_a_frame_seconds_sooner(films: Films) -> None:
    segments, parts = asyncio.run(hls_delays(films, 5))
    assert parts.shown < segments.shown - 1
    assert parts.shown > 3 * GOP / 25 - GOP / 25, "no player shows what it may not"
    assert parts.fetched < segments.fetched


def test_the_delay_is_the_same_to_the_end_and_the_times_are_the_pulses(films: Films) -> None:
    found = asyncio.run(drift(films, 300))
    assert found.least == found.most == 24, "look-ahead, less the pulse that begins the GOP"
    assert found.off == 0
    assert found.gops == (300 - 24 - 1) // GOP + 1
    assert len(found.costs) == 10


@pytest.mark.parametrize("pulse", [0, 12_345, 2**31])
def test_the_times_of_a_piece_are_read_from_both_forms(pulse: int) -> None:
    made = fragment([FragmentSample(b"\x00\x00\x17\x70" + b"\x65" * 6000, key=True)], pulse, 25)
    at = ticks(pulse, 25)
    piece = MediaChunk([EncodedPicture(pulse, key=True, fragment=made, boot=1)], 25, ContinuityCounters())
    assert times(piece) == (at, at % 2**33)


def test_the_first_fragment_ends_where_its_pictures_do() -> None:
    whole = fragment([FragmentSample(b"abc", key=True)], 7, 25)
    head = b"\x00\x00\x00\x10ftypiso5\x00\x00\x00\x00"
    assert [end_of_first_fragment((head + whole)[:size]) for size in (0, 20, len(head + whole) - 1)] == [
        0,
        0,
        0,
    ]
    assert end_of_first_fragment(head + whole + whole) == len(head + whole)


def test_a_send_delay_ends_with_the_last_frame_of_a_gop() -> None:
    heard = CrowdReading(1.0, 1.0, 0.1, 0, [ticks(19, 25), ticks(14, 25), ticks(39, 25)], [5.25, 5.1, 6.0])
    assert send_delays(heard, {10: 5.0, 20: 5.4}).tolist() == [250.0]


def test_when_gops_were_given_out_is_read_up_to_the_line_that_is_being_written(tmp_path: Path) -> None:
    (tmp_path / "sent").write_text("10 5.0 5.25\n20 5.4 5.5\n30 5.8", encoding="ascii")
    assert read(tmp_path / "sent") == {10: SendTimes(5.0, 5.25), 20: SendTimes(5.4, 5.5)}


def test_a_bare_loop_sends_whole_gops_to_all(films: Films) -> None:
    bare = bare_sends(films[0], 20, 1.0)
    assert bare.viewers == 20
    assert 0 < bare.each < 1000
    assert 0 < bare.given < 1000
    assert 0 < bare.delays[0] <= bare.delays[1] <= bare.delays[2]


@contextmanager
def shouting(data: bytes) -> Iterator[int]:
    """Serve whoever comes with the same bytes, and hang up."""
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


def test_a_crowd_hears_all_that_is_sent_and_notices_who_hangs_up() -> None:
    data = fragment([FragmentSample(b"abc" * 100, key=True)], 9, 25)
    with shouting(data) as port:
        crowd, began = ViewerCrowd(port), time.monotonic()
        crowd.watch(["/"] * 3)
        heard = [crowd.read(0.1)]
        while heard[-1].gone < 3:
            heard.append(crowd.read(0.1))
        crowd.leave()
    assert sum(reading.megabytes for reading in heard) == pytest.approx(3 * len(data) / 1e6)
    assert [tick for reading in heard for tick in reading.ticks] == [ticks(9, 25)] * 3
    assert all(began < at < time.monotonic() for reading in heard for at in reading.at)


def step(count: int, cores: float, late: float) -> ViewerStep:
    return ViewerStep(count, cores, 0.1, 500.0, 1.0, (1.0, 2.0, late), 3.0, 1.0)


def test_viewers_of_a_core_are_on_a_line_beside_what_the_service_uses_anyway() -> None:
    alone, count = per_core([step(1000, 0.3, 1.0), step(2000, 0.5, 1.0), step(3000, 0.7, 1.0)])
    assert alone == pytest.approx(0.1)
    assert count == pytest.approx(4500)


def test_the_table_says_how_many_frames_were_wrong_and_who_was_served_in_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = StreamMeasurements(
        steps=[step(500, 0.2, 39.0), step(1000, 0.3, 41.0)], right=FrameCorrectness(100, 5, 100, 98, 0)
    )
    describe(Report(), found)
    said = capsys.readouterr().out
    assert "98 of 100" in said
    assert any("p99 below" in line and " 500 " in line for line in said.splitlines())
    plot(found, tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 1000


@pytest.mark.slow
def test_a_real_site_is_watched(films: Films, tmp_path: Path) -> None:
    switched = ffmpeg_switching(films, 100, tmp_path)
    assert switched is None or switched > 50
    with running(films, tmp_path / "site") as site, viewers(site.http) as crowd:
        numbers = site.objects(20)[:20]
        watched = watch_objects(site, crowd, numbers, films[0], 2.0, 1)
        assert 0 < watched.one < 2
        assert watched.objects == 20
        assert watched.against_encoding > 1
        late = first_pictures(site, numbers, 5)
        assert (late > 0).all()
        assert (late < 5000).all()


def test_stalled_viewers_are_judged_by_the_medians_of_the_rounds() -> None:
    alone = [ReadingRound(10.0, p99, 1.0, 0.3) for p99 in (50.0, 400.0, 52.0)]
    beside = [ReadingRound(10.0, p99, 1.0, 0.3) for p99 in (54.0, 56.0, 900.0)]
    assert StallComparison(900, 100, alone, beside).ratio == pytest.approx(56.0 / 52.0)


def test_who_stalls_asks_and_never_reads() -> None:
    with create_server(("127.0.0.1", 0)) as server, stalling(server.getsockname()[1], ["/a", "/b"]) as there:
        connection, _ = server.accept()
        with connection:
            assert connection.recv(100).startswith(b"GET /a ")
            connection.settimeout(0.2)
            with pytest.raises(TimeoutError):  # soon nothing more fits anywhere
                connection.sendall(bytes(64_000_000))
        assert len(there) == 2


@pytest.mark.slow
def test_a_tenth_of_a_real_site_stalls_and_the_others_are_sent_everything(
    films: Films, tmp_path: Path
) -> None:
    with running(films, tmp_path / "site") as site, viewers(site.http) as crowd:
        found = beside_stalled(site, crowd, site.objects(20)[:20], 50, 4.0, 2)
        assert (found.good, found.stalled) == (45, 5)
        assert all(reading_round.arrived > 0.9 for reading_round in found.beside)
