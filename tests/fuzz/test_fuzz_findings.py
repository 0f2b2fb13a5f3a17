"""Findings of fuzzing: the input is refused with a one-line error, or counted and dropped."""

from __future__ import annotations

import asyncio
import itertools
import json
import logging
from pathlib import Path
from typing import Any

import av
import pytest

from benchmarks.fuzz.engine.fed_site import KEYS, STRIDE, FedService, pictures, site, video
from bestview import validate_homography
from client.media_stream import MediaStreamError
from client.remux import remux
from client.webm import ElementReader, cluster_time
from server.camera.peers.detection_exchange import PeerDetectionExchange
from server.config.loader import build_config, change_view_settings, load_config
from server.config.sections import ViewSettings
from server.config.tokens_file import read_tokens
from server.http.app import make_app, serving
from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import audio_fragment
from server.media.h264.annexb import H264ParameterSets, parameter_sets
from server.media.h264.repeat_picture import parse_repeatable
from server.media.nal_units import nal_units
from server.media.parameter_sets import UnsupportedParametersError
from server.media.stream_format import StreamFormat
from server.messaging.inbox import Message
from server.service.calibration.points_file import read_points
from server.service.recording.playlist_file import RecordingPlaylist
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments, RecordingSessionInfo
from server.service.service import BestViewService
from server.service.time_shift.playback_audio import read_audio_frames
from server.system.errors import UserError

CAMERA = {"id": "c0", "source": "scene:room"}


@pytest.mark.parametrize(
    "text",
    [
        "[" * 1200,
        "- " * 100_000,
        "cameras: &a [*a]",
        "cameras: !!int ''",
        "cameras: !!bool x",
        "cameras: !!timestamp x",
        "cameras: 0b_",
        "site: {name: 2001-99-99}",
        'http: {host: "\\ud800"}\ncameras: [{id: c0, source: x}]',
        "a: &a {x: 1}\n"
        + "\n".join(
            f"{b}: &{b} {{<<: [{', '.join([f'*{a}'] * 9)}]}}" for a, b in itertools.pairwise("abcdefghij")
        ),
        "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
        + "\n".join(
            f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in zip("abcdefg", "bcdefgh", strict=True)
        ),
    ],
)
def test_an_invalid_configuration_is_refused_with_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(text)
    with pytest.raises(UserError) as refused:
        load_config(path)
    assert len(str(refused.value).splitlines()) == 1
    assert len(str(refused.value)) < 1000


def test_a_key_with_line_breaks_is_named_in_one_line(tmp_path: Path) -> None:
    content = {"cameras": [CAMERA], "site": {"name\u2028hall": 1, "a\nb": 2}}
    with pytest.raises(UserError) as refused:
        build_config(content, where="x", folder=tmp_path)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("end", ["\n", "\nb", "\x85b", "\u2028"])
def test_text_with_line_breaks_is_refused(tmp_path: Path, end: str) -> None:
    content = {"cameras": [{**CAMERA, "source": f"hall.mp4{end}"}]}
    with pytest.raises(UserError, match=r"cameras\.0\.source: has more than one line") as refused:
        build_config(content, where="x", folder=tmp_path)
    assert len(str(refused.value).splitlines()) == 1
    path = tmp_path / "tokens.yaml"
    path.write_text(json.dumps({"tokens": [{"name": f"hall{end}", "sha256": 64 * "a", "role": "watch"}] * 2}))
    with pytest.raises(UserError) as refused:
        read_tokens(path)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("place", ["site", "track.window"])
def test_a_very_long_key_is_named_by_its_beginning(tmp_path: Path, place: str) -> None:
    inner: dict[str, Any] = {"stride" + 5000 * "9": 1}
    for name in reversed(place.split(".")):
        inner = {name: inner}
    with pytest.raises(UserError, match="stride99") as refused:
        build_config({"cameras": [CAMERA], **inner}, where="x", folder=tmp_path)
    assert len(str(refused.value)) < 1000


@pytest.mark.parametrize(
    "value", [float("inf"), 1e300, 10**400, 10**5000], ids=["inf", "1e300", "long", "longer"]
)
def test_an_excessive_number_is_refused_with_its_key(tmp_path: Path, value: float) -> None:
    content: dict[str, Any] = {"cameras": [CAMERA], "http": {"hls_segment_s": value}}
    with pytest.raises(UserError, match=r"http\.hls_segment_s") as refused:
        build_config(content, where="x", folder=tmp_path)
    assert len(str(refused.value)) < 200


def test_an_excessive_number_in_the_environment_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_HTTP__HLS_SEGMENT_S", "Infinity")
    with pytest.raises(UserError, match=r"http\.hls_segment_s"):
        build_config({"cameras": [CAMERA]}, where="x", folder=tmp_path)


def test_trial_settings_must_be_valid_text() -> None:
    with pytest.raises(UserError, match="has invalid characters"):
        change_view_settings(ViewSettings(), {"\ud800": 1}, "to try out")


@pytest.mark.parametrize(
    "content",
    [
        '{"homography": {"c0": [[1' + "0" * 400 + "]]}}",
        "[" * 100_000,
        '{"homography": {"c0\\nc1": [[0]]}}',
        '{"homography": {"\\u2028": [[0]]}}',
        '{"homography": {"' + "c" * 5000 + '": [[0]]}}',
        '{"homography": ["ab"]}',
        '{"homography": {}, "unit": "m\\nm"}',
        '{"homography": {}, "unit": [' + "1," * 5000 + "1]}",
    ],
    ids=range(8),
)
def test_an_invalid_ground_file_is_refused_with_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "ground.json").write_text(content)
    with pytest.raises(UserError, match="ground") as refused:
        build_config({"cameras": [CAMERA], "ground": "ground.json"}, where="site", folder=tmp_path)
    assert len(str(refused.value).splitlines()) == 1
    assert len(str(refused.value)) < 300 + len(str(tmp_path))


def test_a_homography_with_excessive_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match="not a 3x3 matrix of numbers"):
        validate_homography([[10**400] * 3] * 3, "c0")


@pytest.mark.parametrize("name", ["$x$\n", "\ud800", "c" * 65, ""])
def test_points_of_a_camera_with_an_unprintable_name_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "points.json"
    path.write_text(json.dumps({"cameras": {name: []}}))
    with pytest.raises(UserError, match="not a printable name"):
        read_points(path)


def test_a_number_of_many_digits_is_truncated_in_the_error(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("camera,image_x,image_y,floor_x,floor_y\nc0,1,2,3," + "9" * 5000 + "\n")
    with pytest.raises(UserError) as refused:
        read_points(path)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("damaged", [b"", b"\x00\x00\x01", b"\x00\x00\x01\x41", b"\x00\x00\x01\x09\xf0"])
async def test_an_access_unit_without_a_picture_is_counted_and_dropped(damaged: bytes) -> None:
    service, units = FedService(site()), pictures(0, STRIDE)
    service.handle(video("c0", units[0]))
    right = video("c0", units[1])
    service.handle(Message(right.key, damaged, right.attachment))
    service.handle(video("c0", units[2]))
    assert service.ingest.states["c0"].bad_messages == 1
    assert not service.frame_buffers["c0"].has(1)
    assert service.frame_buffers["c0"].has(2)


def test_parameter_sets_beyond_all_levels_are_unsupported() -> None:
    found = parameter_sets(nal_units(pictures(0, 1)[0].data))
    assert found is not None
    parse_repeatable(found)
    huge = found.sps[:4] + b"\xf6\x00\x00\x00\x80\x00\x00\x00\x80" + b"\xff" * 20
    with pytest.raises(UnsupportedParametersError):
        parse_repeatable(H264ParameterSets(huge, found.pps))


def test_parameter_sets_too_large_for_mp4_are_ignored() -> None:
    assert parameter_sets([b"\x67" + bytes([1]) * 70_000, b"\x68\x01"]) is None


def test_a_playlist_entry_with_an_impossible_offset_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "c0.m3u8"
    path.write_text(f"#EXTINF:1,p0+5\n#EXT-X-BYTERANGE:4@{'9' * 30}\n../cameras/c0/0.mp4\n")
    playlist = RecordingPlaylist(path, "", "", 25.0, None, 60.0)
    playlist.read()
    assert playlist.index.all == ()


@pytest.mark.parametrize("camera", ["../../../precious", "/precious", "a\0b", "c" * 300, "", "..", "c0\n"])
def test_a_recording_session_with_invalid_camera_names_is_not_touched(tmp_path: Path, camera: str) -> None:
    precious = tmp_path / "precious" / "000000000000.mp4"
    precious.parent.mkdir()
    precious.write_bytes(b"nobody's")
    head = RecordingSessionInfo(
        site="hall", fps=25.0, width=64, height=48, codec="avc1", cameras=["c0"], started=0.0, pulse0=0.0
    )
    run = tmp_path / "kept" / "20260101T000000Z"
    run.parent.mkdir()
    RecordingSession.create(run, head, InitSegments(b""), 60.0)
    (run / "index" / "000000000000.jsonl").write_bytes(b"")
    info = json.loads((run / "session.json").read_bytes())
    (run / "session.json").write_text(json.dumps({**info, "cameras": ["c0", camera]}))
    store = RecordingFolder(tmp_path / "kept", RetentionLimits(-1e9, 1.0, 60.0))
    store.open()
    store.close()
    assert store.earlier == []
    assert precious.exists()


@pytest.mark.parametrize("camera", ["c\0", "c" * 300, ".."])
def test_a_playlist_entry_with_an_invalid_camera_is_skipped(tmp_path: Path, camera: str) -> None:
    path = tmp_path / "1.m3u8"
    path.write_text(f"#EXTINF:1,p0+5\n#EXT-X-BYTERANGE:4@0\n../cameras/{camera}/000000000000.mp4\n")
    playlist = RecordingPlaylist(path, "", "", 25.0, None, 60.0)
    playlist.read()
    assert playlist.index.all == ()


def test_a_playlist_with_an_impossible_date_is_written_without_it(tmp_path: Path) -> None:
    path = tmp_path / "1.m3u8"
    path.write_text(f"#EXTINF:1,p{'9' * 15}+5\n#EXT-X-BYTERANGE:4@0\n../cameras/c0/000000000000.mp4\n")
    playlist = RecordingPlaylist(path, "../cameras/", "", 0.001, 1.7e9, 60.0)
    playlist.read()
    playlist.rewrite()
    assert f"p{'9' * 15}+5" in path.read_text()
    assert "DATE-TIME" not in path.read_text()


def test_a_recording_with_excessive_timestamps_is_remuxed_from_time_0(tmp_path: Path) -> None:
    stream_format, (unit, *_) = StreamFormat(), pictures(0, 1)
    stream_format.accept(unit.data)
    head = stream_format.init_segment(site().site.size, site().site.fps, AudioFormat(48_000, 2)) or b""
    form = AudioFormat(48_000, 2)
    sound = audio_fragment(form, [form.silence] * 3, 0)
    picture = bytearray(stream_format.pack(unit.data, 0, 25.0, key=True))
    at = picture.index(b"tfdt") + 8
    picture[at : at + 8] = (1 << 60).to_bytes(8, "big")
    part = tmp_path / "film.part"
    part.write_bytes(head + sound + picture)
    remux(part, tmp_path / "film.mp4", "mp4")
    with av.open(str(tmp_path / "film.mp4")) as film:
        assert [frame.time for frame in film.decode(video=0)] == [0.0]


def test_recorded_audio_longer_than_its_file_is_skipped(tmp_path: Path) -> None:
    form, path = AudioFormat(48_000, 2), tmp_path / "0.mp4"
    right = audio_fragment(form, [form.silence] * 3, 0)
    path.write_bytes(right)
    assert len(read_audio_frames(path, 0, len(right), 0, 9, form)) == 3
    at = right.index(b"trun") + 16
    path.write_bytes(right[:at] + b"\xff" * 4 + right[at + 4 :])
    assert read_audio_frames(path, 0, len(right), 0, 9, form) == {}


def test_a_cluster_with_an_invalid_time_is_refused() -> None:
    (cluster,) = ElementReader().feed(b"\x1f\x43\xb6\x75\x8c\xe7\x8a" + b"\x01" * 10)
    with pytest.raises(MediaStreamError, match="without a time"):
        cluster_time(cluster)


def test_deeply_nested_messages_are_counted_and_dropped() -> None:
    exchange = PeerDetectionExchange(site(), "c0", None, 50)
    payload = b'{"x":' * 100_000
    exchange._decode(Message(KEYS.camera("c1", "detections"), payload, b""))
    service = FedService(site())
    service.handle(Message(KEYS.camera("c0", "status"), payload, b""))
    assert exchange.bad_messages == service.ingest.states["c0"].bad_messages == 1


BAD_REQUESTS: list[bytes] = [
    b"GET /\x00 HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
    b"POST /api/operator/people HTTP/1.1\r\nContent-Encoding: gzip\r\nContent-Length: 4\r\n\r\nnone",
    b"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"GET / HTTP/1.1\r\nHost: x\r\nExpect: \xff\r\nConnection: close\r\n\r\n",
    b"GET /nowhere HTTP/1.1\r\nHost: x\r\nExpect: \xff\r\nConnection: close\r\n\r\n",
]


@pytest.mark.parametrize("request_bytes", BAD_REQUESTS)
async def test_a_malformed_request_leaves_no_traceback_in_the_log(
    request_bytes: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    service = FedService(site())
    settings: Any = service.config.http.model_copy(update={"port": 0})
    with caplog.at_level(logging.DEBUG):
        async with serving(make_app(BestViewService(service)), settings) as port:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(request_bytes)
            writer.write_eof()
            answer = await reader.read()
            writer.close()
    assert not answer or answer.startswith(b"HTTP/1.1 4")
    assert b"Traceback" not in answer
    assert not [record for record in caplog.records if record.exc_info and record.levelno >= logging.INFO]
