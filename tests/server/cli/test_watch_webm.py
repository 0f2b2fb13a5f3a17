"""`watch --out x.webm` writes a complete, seekable file from time 0."""

from __future__ import annotations

import asyncio
import subprocess
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import client
from client.media_stream import FormatChangedError, MediaStreamError
from client.recording import Recording
from client.remux import remux
from client.webm import ElementReader
from fakes.programs import needs_ffmpeg
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, STRIDE, WIDTH, encoded
from fakes.service.vp8_site import EPOCHS, decoded_alone, feed
from server.media.containers.webm import cluster, header


async def test_a_recording_spans_cuts_and_has_sidecar_files_with_boxes(
    vp8_site: ServedSite, tmp_path: Path
) -> None:
    out, seconds = tmp_path / "one.webm", 3 * GOP / FPS
    watching = asyncio.create_task(client.watch(f"http://127.0.0.1:{vp8_site.port}", 1, out, seconds))
    while not vp8_site.service.splicer.viewers:  # noqa: ASYNC110 — it comes when it comes
        await asyncio.sleep(0.01)
    for epoch in range(3, EPOCHS):
        feed(vp8_site, epoch)
        await asyncio.sleep(0.02)
    vp8_site.service.splicer.close()
    result = await watching
    assert (result.complete, result.fragments) == (True, 3 * GOP)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.ass", "one.vtt", "one.webm"]
    with av.open(str(out)) as film:
        assert film.duration == round(seconds * av.time_base)
        shown = [(frame.time, frame.to_ndarray(format="yuv420p")) for frame in film.decode(video=0)]
    assert [time for time, _ in shown] == pytest.approx([n / FPS for n in range(3 * GOP)])
    alone = [decoded_alone(camera) for camera in range(2)]
    firsts = range(0, EPOCHS * STRIDE, GOP)
    (start,) = [n for n in firsts if any(np.array_equal(shown[0][1], camera[n]) for camera in alone)]
    for n, (_, picture) in enumerate(shown):
        assert any(np.array_equal(picture, camera[start + n]) for camera in alone), f"frame {n}"


async def test_a_file_name_of_another_container_is_refused_with_one_line(
    vp8_site: ServedSite, site_with_people: ServedSite, tmp_path: Path
) -> None:
    with pytest.raises(client.NotFoundError, match=r"these streams are VP8 .* there is best\.webm"):
        await client.watch(f"http://127.0.0.1:{vp8_site.port}", 1, tmp_path / "one.mp4", 1.0)
    with pytest.raises(client.NotFoundError, match=r"these streams are H\.264 .* there is best\.mp4"):
        await client.watch(f"http://127.0.0.1:{site_with_people.port}", 1, tmp_path / "one.webm", 1.0)
    assert not list(tmp_path.iterdir())


async def test_watching_without_a_file_uses_the_sites_container(vp8_site: ServedSite) -> None:
    watching = asyncio.create_task(client.watch(f"http://127.0.0.1:{vp8_site.port}", 1, None, GOP / FPS))
    while not vp8_site.service.splicer.viewers:  # noqa: ASYNC110 — it comes when it comes
        await asyncio.sleep(0.01)
    for epoch in range(3, EPOCHS):
        feed(vp8_site, epoch)
        await asyncio.sleep(0.01)
    assert (await watching).fragments == GOP


START = 1000
HEAD = header(WIDTH, HEIGHT, FPS)


def stream(first: int, until: int) -> bytes:
    units = encoded(0, codec="vp8")
    return HEAD + b"".join(
        cluster(units[n].data, START + n, FPS, key=units[n].key) for n in range(first, until)
    )


def take(record: Recording, data: bytes, step: int) -> bool:
    """Take a connection's bytes, as the network cuts them."""
    write = record.new_connection_writer()
    return all(more for at in range(0, len(data), step) for more in write(data[at : at + step]))


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_interruptions_do_not_change_the_recording(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("film")
    part, out = folder / "part", folder / "film.webm"
    cuts = sorted(data.draw(st.sets(st.integers(0, 29), max_size=3)))
    with part.open("wb") as file:
        record = Recording(file, 30 / FPS, "webm")
        for first, last in zip([0, *cuts], [*cuts, 40], strict=True):
            whole = stream(max(0, first // GOP - 1) * GOP, last)  # some of it again
            torn = data.draw(st.integers(0, 20)) if last < 40 else 0
            more = take(record, whole[: len(whole) - torn], data.draw(st.integers(50, 5000)))
        assert not more, "the buffer is full"
    remux(part, out, "webm")
    keys = [n for n in range(30) if n % GOP == 0]
    with av.open(str(out)) as film:
        frames = [(frame.time, frame.key_frame) for frame in film.decode(video=0)]
        assert [time for time, _ in frames] == pytest.approx([n / FPS for n in range(30)])
        assert [round(time * FPS) for time, key in frames if key] == keys
        assert film.duration == round(30 / FPS * av.time_base)
        for number in keys:  # by the index
            film.seek(round((number + 2) / FPS * av.time_base))
            assert next(film.decode(video=0)).time == pytest.approx(number / FPS)


@needs_ffmpeg
def test_ffmpeg_plays_the_recording_without_a_warning(tmp_path: Path) -> None:
    part, out = tmp_path / "part", tmp_path / "film.webm"
    with part.open("wb") as file:
        assert take(Recording(file, None, "webm"), stream(0, 40), 1000)
    for film in (part, out):  # while it is recorded, too
        if film is out:
            remux(part, out, "webm")
        command = ["ffmpeg", "-nostdin", "-v", "warning", "-i", str(film), "-f", "null", "-"]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stderr == ""


def test_a_changed_format_ends_the_recording_and_damage_is_reported() -> None:
    record = Recording(None, None, "webm")
    assert take(record, stream(0, 5), 100)
    with pytest.raises(FormatChangedError):
        take(record, header(2 * WIDTH, HEIGHT, FPS) + stream(5, 10)[len(HEAD) :], 100)
    with pytest.raises(MediaStreamError):
        list(ElementReader().feed(b"\x00\x00\x00\x18ftyp"))
