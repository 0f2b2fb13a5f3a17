"""Files of a rendering: tracks and choices byte for byte, and a film per person."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import av
import numpy as np
import pytest

from bestview import Merge, Split
from fakes.media.audio import (
    BEEP_TIMES,
    MAX_AV_OFFSET_S,
    access_units,
    beeps,
    decode_audio,
    flashes,
    write_flashes,
)
from fakes.media.audio import FRAMES as SOUNDING
from fakes.media.decoding import video_decoder
from fakes.service.decisions import choice, decision
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    HEIGHT,
    LARGE,
    SMALL,
    WIDTH,
    encoded,
    small_config,
)
from server.cli.render.films import FilmWriter
from server.cli.render.soundtrack import Soundtrack
from server.config.sections import SiteSettings
from server.media.codec import stream_format_for
from server.media.letterbox import Letterbox
from server.media.picture import Codec
from server.messaging.messages import NumberedBox
from server.service.decision_files.decision_writer import DecisionWriter
from server.service.rules.engine import SiteEvent
from server.service.streaming.frame_buffer import FrameBuffer

A, B = CAMERAS
SITE = SiteSettings(width=WIDTH, height=HEIGHT, fps=FPS)


def test_decision_files_have_these_bytes(tmp_path: Path) -> None:
    fits = {
        A: Letterbox((2 * WIDTH, 2 * HEIGHT), (WIDTH, HEIGHT)),
        B: Letterbox((WIDTH, HEIGHT), (WIDTH, HEIGHT)),
    }
    recorder = DecisionWriter(tmp_path / "out", CAMERAS, fits)
    boxes: list[list[NumberedBox]] = [[(1, *SMALL)], [(1, *SMALL), (2, *LARGE)]]
    events = [
        SiteEvent("busy", "crowded", "began", "till", [1, 2], [None, "Ann"], None, 0, None, 4, A),
        SiteEvent("in", "crossed", "once", "door", [1], [None], "inward", 1, None, 3, A),
    ]
    recorder.write(decision(0, choice(1, A), choice(2, None), frames=2, c0=boxes), events)
    turned_out = (Merge(kept=1, lost=3), Split(published_id=1, corrected_id=2, camera=B))
    recorder.write(
        decision(
            1, choice(1, B), choice(2, A, away=True), frames=1, corrections=turned_out, c1=[[(2, *LARGE)]]
        )
    )
    recorder.write_late([f"{frame},{B},tracks late\n" for frame in (4, 5)])
    recorder.close()
    files = {str(path.relative_to(tmp_path / "out")): path.read_bytes() for path in tmp_path.rglob("*.*")}
    assert files == {
        "tracks/c0.txt": b"1,1,20.00,20.00,12.00,36.00,1.00,-1,-1,-1\n"
        b"2,1,20.00,20.00,12.00,36.00,1.00,-1,-1,-1\n"
        b"2,2,40.00,8.00,32.00,80.00,1.00,-1,-1,-1\n",
        "tracks/c1.txt": b"6,2,20.00,4.00,16.00,40.00,1.00,-1,-1,-1\n",
        "choices.csv": b"frame,object,camera\n1,1,c0\n2,1,c0\n6,1,c1\n6,2,c0\n",
        "choices-live.csv": b"frame,object,camera\n",
        "choices-smooth.csv": b"frame,object,camera\n",
        "corrections.csv": b"frame,correction,object,other,camera\n6,merged,1,3,\n6,split,1,2,c1\n",
        "events.csv": b"frame,rule,kind,phase,zone,objects,direction\n"
        b"1,busy,crowded,began,till,1 2,\n2,in,crossed,once,door,1,inward\n",
        "late.csv": b"frame,camera,reason\n4,c1,tracks late\n5,c1,tracks late\n",
    }


def films(folder: Path, codec: Codec = "h264") -> tuple[FilmWriter, dict[str, FrameBuffer]]:
    stream_format = stream_format_for(codec, (WIDTH, HEIGHT))
    frame_buffers = {camera: FrameBuffer(FPS, 40, stream_format) for camera in CAMERAS}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed, codec=codec):
            frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
    return FilmWriter(folder, frame_buffers, stream_format, SITE), frame_buffers


def own_pictures(seed: int, codec: Codec) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    decoder = video_decoder(codec)
    units = encoded(seed, codec=codec)
    decoded = [picture for unit in units for picture in decoder.decode(av.Packet(unit.data))]
    decoded += decoder.decode(None)
    return [np.asarray(picture.to_ndarray(format="yuv420p"), dtype=np.uint8) for picture in decoded]


@pytest.mark.parametrize(("codec", "container"), [("h264", "mp4"), ("h265", "mp4"), ("vp8", "webm")])
def test_a_film_begins_at_time_0_and_shows_the_chosen_cameras_pixels(
    tmp_path: Path, codec: Codec, container: str
) -> None:
    writer, _ = films(tmp_path / "best", codec)
    for gop, camera in [(2, A), (3, B), (4, A)]:
        writer.write(decision(gop, choice(7, camera)))
    writer.close()
    assert writer.numbers == [7]
    with av.open(str(tmp_path / "best" / f"object-7.{container}"), "r") as film:
        assert film.duration == 3 * GOP / FPS * av.time_base
        pictures = list(film.decode(video=0))
    assert [picture.time for picture in pictures] == [number / FPS for number in range(3 * GOP)]
    alone = [own_pictures(seed, codec) for seed in range(2)]
    for number, picture in enumerate(pictures):
        seed = 1 if GOP <= number < 2 * GOP else 0
        np.testing.assert_array_equal(picture.to_ndarray(format="yuv420p"), alone[seed][2 * GOP + number])


def test_a_film_ends_with_the_last_gop_of_the_person(tmp_path: Path) -> None:
    writer, _ = films(tmp_path / "best")
    story = [(0, False), (1, True), (2, False), (3, True), (4, True)]
    for gop, away in story:
        writer.write(decision(gop, choice(1, A, away=away)))
    writer.close()
    with av.open(str(tmp_path / "best" / "object-1.mp4"), "r") as film:
        assert len(list(film.decode(video=0))) == 3 * GOP, "a person who returns is shown to the end"


@pytest.mark.parametrize(
    "corrections",
    [
        (Merge(kept=1, lost=5),),
        (Split(published_id=5, corrected_id=1, camera=B),),
        (Split(published_id=5, corrected_id=6, camera=B), Merge(kept=1, lost=6)),
    ],
)
def test_who_turned_out_to_be_another_person_has_no_film_if_the_others_film_has_all(
    tmp_path: Path, corrections: tuple[Merge | Split, ...]
) -> None:
    writer, _ = films(tmp_path / "best")
    writer.write(decision(0, choice(1, A), choice(5, B), c0=[[(1, *SMALL)]], c1=[[(5, *SMALL)]]))
    writer.write(decision(1, choice(1, A), choice(5, B), c1=[[(1, *SMALL)]], corrections=corrections))
    writer.close()
    assert (writer.numbers, writer.corrected[5]) == ([1], 1)
    assert [path.name for path in (tmp_path / "best").iterdir()] == ["object-1.mp4"]


@pytest.mark.parametrize(
    ("before", "after", "corrections"),
    [
        pytest.param(((), (5,)), ((1,), ()), (Merge(kept=1, lost=5),), id="seen when 1 was not"),
        pytest.param(((1,), (5,)), ((1,), (5,)), (Split(5, 1, A),), id="split in another camera only"),
        pytest.param(((1, 5), (5,)), ((1,), ()), (Split(5, 1, B),), id="seen by a camera without a split"),
    ],
)
def test_a_number_with_sightings_of_its_own_keeps_its_film(
    tmp_path: Path,
    before: tuple[tuple[int, ...], ...],
    after: tuple[tuple[int, ...], ...],
    corrections: tuple[Merge | Split, ...],
) -> None:
    writer, _ = films(tmp_path / "best")
    for gop, numbers in enumerate((before, after)):
        in_a, in_b = ([[(number, *SMALL) for number in of_camera]] for of_camera in numbers)
        turned_out = corrections if gop else ()
        writer.write(decision(gop, choice(1, A), choice(5, B), c0=in_a, c1=in_b, corrections=turned_out))
    writer.close()
    assert (writer.numbers, writer.corrected) == ([1, 5], {})
    assert len(list((tmp_path / "best").iterdir())) == 2


@pytest.mark.parametrize(("codec", "container"), [("h264", "mp4"), ("h265", "mp4"), ("vp8", "webm")])
def test_gaps_in_films_are_filled_as_in_live_streams(tmp_path: Path, codec: Codec, container: str) -> None:
    writer, frame_buffers = films(tmp_path / "best", codec)
    for pulse in (3 * GOP + 2, *range(5 * GOP, 6 * GOP)):
        del frame_buffers[A]._pictures[pulse]
    shown: list[str | None] = [A, None, B, A, B, A, B]
    for gop, camera in enumerate(shown):
        if camera is None:
            for frame_buffer in frame_buffers.values():
                for pulse in range(gop * GOP, (gop + 1) * GOP):
                    del frame_buffer._pictures[pulse]
        writer.write(decision(gop, choice(1, camera)))
    writer.close()
    with av.open(str(tmp_path / "best" / f"object-1.{container}"), "r") as film:
        pictures = list(film.decode(video=0))
    assert [round(float(picture.time or 0) * FPS) for picture in pictures] == list(range(7 * GOP))
    alone = {A: own_pictures(0, codec), B: own_pictures(1, codec)}
    last = pictures[0].to_ndarray(format="yuv420p")
    for pulse, picture in enumerate(pictures):
        camera = shown[pulse // GOP]
        if camera is not None and frame_buffers[camera].has(pulse) and not 3 * GOP + 2 < pulse < 4 * GOP:
            last = alone[camera][pulse]
        np.testing.assert_array_equal(picture.to_ndarray(format="yuv420p"), last, str(pulse))


@pytest.mark.parametrize("codec", ["aac", "opus"])
def test_a_film_has_the_sites_audio_in_sync(tmp_path: Path, codec: Literal["aac", "opus"]) -> None:
    recording = write_flashes(tmp_path / "flashes.mkv", SOUNDING)
    config = small_config(sound={"source": str(recording), "codec": codec})
    stream_format, track = stream_format_for(config.encode.codec, config.site.size), Soundtrack(config)
    frame_buffers = {camera: FrameBuffer(FPS, SOUNDING, stream_format) for camera in CAMERAS}
    for unit in access_units(recording):
        for frame_buffer in frame_buffers.values():
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)
    writer = FilmWriter(tmp_path / "best", frame_buffers, stream_format, config.site, track.audio_buffer)
    begin = 3
    for gop in range(begin, SOUNDING // GOP):
        track.read(gop * GOP, (gop + 1) * GOP)
        writer.write(decision(gop, choice(1, CAMERAS[gop % 2])))
    writer.close()
    data = (tmp_path / "best" / "object-1.mp4").read_bytes()
    expected = [at - begin * GOP / FPS for at in BEEP_TIMES]
    assert flashes(data) == pytest.approx(expected, abs=0.001)
    assert beeps(data) == pytest.approx(expected, abs=MAX_AV_OFFSET_S)
    times, _ = decode_audio(data)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    assert 0 <= times[0] < 0.022
    assert times[-1] == pytest.approx((SOUNDING - begin * GOP) / FPS, abs=0.03)
