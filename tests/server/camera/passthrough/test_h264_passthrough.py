"""A camera's own H.264 is passed through byte for byte if compatible; otherwise the reason is logged."""

from __future__ import annotations

import http.server
import re
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.camera_video import passed_units, write_units
from fakes.media.rtsp_camera import RtspCamera
from fakes.media.videos import write_video
from fakes.paths import DOCS
from fakes.programs import needs_ffmpeg
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH, encoded, small_config
from fakes.timeouts import PATIENCE
from server.camera.audio import LiveAudioSource
from server.camera.encoder import AccessUnit, Encoder
from server.camera.passthrough.compatibility import required_format
from server.camera.passthrough.encoder import PassthroughUnit
from server.camera.passthrough.gop_alignment_queue import GopAlignmentQueue
from server.camera.passthrough.stream_source import PassthroughStream
from server.camera.pipeline import CameraPipeline
from server.camera.process import CameraProcess
from server.camera.sources import SourceEndedError
from server.config.site_config import Config
from server.media.containers.mpegts import ContinuityCounters, pack
from server.media.h264.annexb import NAL_AUD, nal_type
from server.media.h264.codec import H264
from server.media.nal_units import nal_units
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer
from server.system.errors import UnavailableError, UserError

FRAMES = 20


def site(source: Path | str, passthrough: str = "pass", **changes: Any) -> Config:
    camera = {"id": "c0", "source": str(source), "passthrough": passthrough, **changes.pop("camera", {})}
    other = {"id": "c1", "source": "scene:room"}
    return small_config(cameras=[camera, other], **changes)


def write_h264(folder: Path, form: str, seed: int = 0) -> Path:
    """Write a video with the encoding of this site's cameras into a container."""
    units = encoded(seed)[:FRAMES]
    sets = units[0].data[: units[0].data.index(b"\x00\x00\x01\x06") - 1]
    return write_units(units, folder / f"own.{form}", H264, "h264", sets)


def nals(data: bytes) -> list[bytes]:
    return [unit for unit in nal_units(data) if nal_type(unit) != NAL_AUD]


@pytest.mark.parametrize("form", ["h264", "ts", "mp4", "mkv"])
def test_access_units_are_passed_through_unchanged(tmp_path: Path, form: str) -> None:
    pipeline = CameraPipeline(site(write_h264(tmp_path, form)), "c0")
    assert pipeline.is_passthrough
    sent = passed_units(pipeline, range(FRAMES))
    with pytest.raises(SourceEndedError):
        pipeline.take(FRAMES)
    pipeline.close()
    for unit, original in zip(sent, encoded(0)[:FRAMES], strict=True):
        assert (unit.pulse, unit.key, nals(unit.data)) == (original.pulse, original.key, nals(original.data))
        if form == "h264":
            assert unit.data == original.data, "byte for byte"


def test_the_tracker_receives_the_pictures_that_are_sent(tmp_path: Path) -> None:
    pipeline = CameraPipeline(site(write_h264(tmp_path, "mp4")), "c0")
    decoder = av.VideoCodecContext.create("h264", "r")
    for pulse, unit in enumerate(encoded(0)[:FRAMES]):
        (picture,) = decoder.decode(av.Packet(unit.data))
        frame = pipeline.take(pulse)
        assert frame is not None
        np.testing.assert_array_equal(frame.image, picture.to_ndarray(format="bgr24"))
    pipeline.close()


def test_passthrough_can_be_spliced_with_encoded_video(tmp_path: Path) -> None:
    pipeline = CameraPipeline(site(write_h264(tmp_path, "mp4")), "c0")
    stream_format = StreamFormat()
    frame_buffers = [FrameBuffer(FPS, FRAMES, stream_format) for _ in range(2)]
    for frame_buffer, units in zip(
        frame_buffers, (passed_units(pipeline, range(FRAMES)), encoded(1)), strict=True
    ):
        for unit in units:
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)
    pipeline.close()


def test_passthrough_honors_offset_and_loop(tmp_path: Path) -> None:
    camera = {"offset_s": GOP / FPS, "at_end": "loop"}
    pipeline = CameraPipeline(site(write_h264(tmp_path, "ts"), camera=camera), "c0")
    sent = passed_units(pipeline, range(2 * FRAMES + GOP))
    pipeline.close()
    assert [unit.pulse for unit in sent] == list(range(GOP, 2 * FRAMES + GOP))
    assert [nals(unit.data) for unit in sent] == 2 * [nals(unit.data) for unit in encoded(0)[:FRAMES]]


@needs_ffmpeg
def test_the_documented_camera_settings_are_compatible(tmp_path: Path) -> None:
    """A camera with the settings of docs/how-to/run.md passes through."""
    manual = (DOCS / "how-to" / "run.md").read_text(encoding="utf-8")
    (options,) = re.findall(r"^ffmpeg .* (-c:v libx264 .*?) \S+$", manual, re.MULTILINE)
    gop, path = 10, tmp_path / "documented.mp4"
    test_picture = f"-f lavfi -i testsrc2=size={WIDTH}x{HEIGHT}:rate={FPS} -t 2 -pix_fmt yuv420p"
    subprocess.run(f"ffmpeg -v error {test_picture} {options} {path}".split(), check=True)
    config = site(path, encode={"gop_s": gop / FPS}, view={"lookahead_s": 2 * gop / FPS})
    pipeline = CameraPipeline(config, "c0")
    assert len(passed_units(pipeline, range(2 * FPS))) == 2 * FPS
    pipeline.close()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"encode": {"crf": 30}},
            "frame 0 has other parameter sets .* than those that this site encodes with",
        ),
        (
            {"encode": {"gop_s": 4 / FPS}},
            r"frame 4 does not begin a GOP: they begin every 4 frames \(encode.gop_s\)",
        ),
        ({"site": {"width": 128}}, r"its frames are 64x48, the site's 128x48"),
        ({"site": {"fps": 30}}, r"it has 25 frames a second, the site 30"),
        ({"camera": {"offset_s": 1 / FPS}}, "frame 0 begins a GOP, but none of the site"),
    ],
)
def test_incompatible_video_is_encoded_or_refused_with_the_reason(
    tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    path = write_h264(tmp_path, "mp4")
    with pytest.raises(UserError, match=f"camera c0: passthrough: pass: {reason}") as refused:
        CameraPipeline(site(path, **changes), "c0")
    assert "\n" not in str(refused.value)
    pipeline = CameraPipeline(site(path, "auto", **changes), "c0")
    assert not pipeline.is_passthrough
    assert re.search(reason, pipeline.why_encoded)
    assert passed_units(pipeline, range(GOP))[-1].data
    pipeline.close()


@pytest.mark.parametrize(
    ("codec", "b_frames", "reason"),
    [("mpeg4", 0, "it is mpeg4, not H.264"), ("libx264", 2, "it has B frames")],
)
def test_other_codecs_and_b_frames_are_encoded(
    tmp_path: Path, codec: str, b_frames: int, reason: str
) -> None:
    path = write_video(tmp_path / "other.mp4", 20, codec=codec, b_frames=b_frames)
    pipeline = CameraPipeline(site(path, "auto"), "c0")
    assert reason in pipeline.why_encoded
    pipeline.close()


@pytest.mark.parametrize(
    ("passthrough", "gop", "text"),
    [
        ("auto", GOP, "camera c0: its own video is passed through"),
        ("auto", 4, "camera c0 is re-encoded: its own video: frame 4 does not begin a GOP"),
        ("off", GOP, ""),
    ],
)
def test_the_process_logs_once_whether_video_is_passed_through(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, passthrough: str, gop: int, text: str
) -> None:
    caplog.set_level("INFO", "server.camera.process")
    process = CameraProcess(site(write_h264(tmp_path, "mp4"), passthrough, encode={"gop_s": gop / FPS}), "c0")
    process._pipeline.close()
    assert caplog.text.count("own video") == bool(text)
    assert text in caplog.text


def test_a_looped_recording_must_have_whole_gops(tmp_path: Path) -> None:
    path = tmp_path / "own.h264"
    path.write_bytes(b"".join(unit.data for unit in encoded(0)[: GOP + 2]))
    with pytest.raises(UserError, match="its 7 frames are not whole GOPs"):
        CameraPipeline(site(path, camera={"at_end": "loop"}), "c0")


def test_sites_of_passthrough_cameras_accept_other_parameter_sets(tmp_path: Path) -> None:
    path = write_h264(tmp_path, "mp4")
    camera = {"source": str(path), "passthrough": "pass"}
    config = small_config(cameras=[{"id": "c0", **camera}, {"id": "c1", **camera}], encode={"crf": 30})
    pipeline = CameraPipeline(config, "c0")
    assert pipeline.is_passthrough
    pipeline.close()


def test_with_own_parameters_any_parameter_sets_are_accepted(tmp_path: Path) -> None:
    encode = {"crf": 30, "parameters": "own"}
    pipeline = CameraPipeline(site(write_h264(tmp_path, "mp4"), encode=encode), "c0")
    assert pipeline.is_passthrough
    pipeline.close()


def test_images_are_encoded_and_vp8_sites_have_no_passthrough(tmp_path: Path) -> None:
    pipeline = CameraPipeline(site("scene:room", "auto"), "c0")
    assert "image files contain no video stream" in pipeline.why_encoded
    pipeline.close()
    with pytest.raises(UserError, match=r"c0: passthrough: auto: encode\.codec is vp8"):
        site(tmp_path / "own.mp4", "auto", encode={"codec": "vp8"})


IMAGE = np.zeros((2, 2, 3), dtype=np.uint8)
arrivals = st.lists(st.integers(0, 3) | st.just(40), min_size=1, max_size=120)
"""The number of units that arrive at each pulse, sometimes more than the queue holds."""


@settings(max_examples=200, deadline=None)
@given(arrivals, st.integers(0, 9), st.integers(1, 6), st.sets(st.integers(0, 119), max_size=5))
def test_gops_begin_at_the_sites_and_are_never_incomplete_inside(
    arriving: list[int], phase: int, gop: int, missed: set[int]
) -> None:
    """For any arrivals: units leave once and in order, without gaps inside a GOP."""
    queue, count = GopAlignmentQueue(gop), 0
    taken: list[tuple[int, int]] = []
    for pulse, number in enumerate(arriving):
        for _ in range(number):
            queue.put(PassthroughUnit((count + phase) % gop == 0, count.to_bytes(4, "big"), IMAGE))
            count += 1
        unit = None if pulse in missed else queue.take(pulse)
        if unit is not None:
            taken.append((pulse, int.from_bytes(unit.data, "big")))
            if pulse % gop == 0:
                assert unit.key
    assert all(earlier < later for (_, earlier), (_, later) in pairwise(taken))
    before = dict(taken)
    for pulse, number in taken:
        if pulse % gop:
            assert before.get(pulse - 1) == number - 1, "its reference picture was sent just before it"


@given(st.integers(0, 9), st.integers(3, 10), st.lists(st.integers(-1, 1), min_size=100, max_size=100))
def test_jitter_of_one_frame_loses_nothing(phase: int, gop: int, jitter: list[int]) -> None:
    """A unit that arrives up to one pulse early or late is available when due."""
    queue, taken, count = GopAlignmentQueue(gop), [], 0
    for pulse in range(100):
        while count <= pulse + jitter[pulse]:
            queue.put(PassthroughUnit((count + phase) % gop == 0, count.to_bytes(4, "big"), IMAGE))
            count += 1
        unit = queue.take(pulse)
        taken.append(None if unit is None else int.from_bytes(unit.data, "big"))
    start = next(pulse for pulse, number in enumerate(taken) if number is not None)
    assert start <= 3 * gop
    sent = [number for number in taken[start:] if number is not None]
    assert sent == list(range(sent[0], sent[0] + 100 - start)), "one at every pulse from the first on"
    assert start - sent[0] <= gop + 2, "later than a GOP and the buffer"


class NetworkCamera:
    """Serves a transport stream over HTTP, up to the GOP number ``gop_limit``."""

    def __init__(self, gops: list[bytes]) -> None:
        stop = self._stop = threading.Event()
        camera, self.gop_limit = self, 40

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.end_headers()
                for place, data in enumerate(gops):
                    while place >= camera.gop_limit:
                        if stop.wait(0.002):
                            return
                    try:
                        self.wfile.write(data)
                    except OSError:
                        return

            def log_message(self, *_: object) -> None:
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/live.ts"

    def close(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()


@lru_cache
def numbers() -> Mapping[tuple[bytes, ...], int]:
    """Return the number of each access unit of the camera, by its NAL units."""
    return {tuple(nals(unit.data)): unit.pulse for unit in encoded(0, 1000)}


def wait_for_units(camera: NetworkCamera | RtspCamera, source: PassthroughStream) -> None:
    """Let the camera send GOPs until the queue holds enough for a pulse, at any position in a GOP.

    One GOP at a time: on a slow machine several would arrive together and overflow the queue.
    """
    end = time.monotonic() + PATIENCE
    while True:
        units = source._waiting._units
        arrived = numbers()[tuple(nals(units[-1].data))] // GOP + 1 if units else 0
        if arrived == camera.gop_limit:
            if len(units) >= GOP + 2:
                return
            camera.gop_limit += 1
        assert time.monotonic() < end, "no units arrive"
        time.sleep(0.002)


@pytest.fixture
def rtsp() -> Iterator[RtspCamera]:
    units = encoded(0, 1000)
    camera = RtspCamera([units[first : first + GOP] for first in range(0, 1000, GOP)], FPS)
    yield camera
    camera.close()


@pytest.fixture
def network() -> Iterator[NetworkCamera]:
    units = encoded(0, 1000)
    frame_buffer = FrameBuffer(FPS, 1000, StreamFormat())
    pictures = [frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key) for unit in units]
    gops = [pictures[first : first + GOP] for first in range(0, 1000, GOP)]
    camera = NetworkCamera([pack(gop, FPS, ContinuityCounters()) for gop in gops])
    yield camera
    camera.close()


@pytest.mark.parametrize("kind", ["network", "rtsp"])
def test_a_network_cameras_video_is_passed_through_in_whole_gops(
    kind: str, request: pytest.FixtureRequest
) -> None:
    network = request.getfixturevalue(kind)
    camera = {"options": {"probesize": "20000", "analyzeduration": "200000"}}
    pipeline = CameraPipeline(site(network.url, camera=camera), "c0")
    assert pipeline.is_passthrough
    source = pipeline.source
    assert isinstance(source, PassthroughStream)
    assert pipeline.take(1) is None
    assert not pipeline.away, "it waits for the start of a GOP"
    sent: list[AccessUnit] = []
    for pulse in range(2, 62):
        wait_for_units(network, source)
        frame = pipeline.take(pulse)
        if frame is not None:
            sent.append(pipeline.encode(pulse, frame))
    assert len(sent) > 40
    assert not pipeline.away
    network.close()
    for later in range(62, 62 + 4 * FPS):
        pipeline.take(later)
    assert pipeline.away
    pipeline.close()
    places = [numbers()[tuple(nals(unit.data))] for unit in sent]
    assert places == sorted(set(places)), "unchanged, once and in order"
    for unit, number in zip(sent, places, strict=True):
        assert unit.key == (number % GOP == 0)
        if unit.key:
            assert unit.pulse % GOP == 0
        else:
            assert unit.pulse % GOP == number % GOP


@pytest.mark.parametrize(("lengths", "passes"), [((1,), True), ((3, 2), True), ((2,) * 40, False)])
def test_a_camera_may_begin_a_gop_out_of_turn_for_a_new_client(
    lengths: tuple[int, ...], *, passes: bool
) -> None:
    units = encoded(0, 1000)
    gops = [units[first : first + GOP] for first in range(0, 1000, GOP)]
    short = [gop[:length] for gop, length in zip(gops, lengths, strict=False)]
    camera = RtspCamera([*short, *gops[len(short) :]], FPS)
    try:
        pipeline = CameraPipeline(site(camera.url, "auto"), "c0")
        assert pipeline.is_passthrough == passes
        pipeline.close()
    finally:
        camera.close()


@pytest.mark.parametrize("passthrough", ["pass", "auto"])
def test_a_network_camera_that_stops_during_the_check_is_unavailable(
    network: NetworkCamera, monkeypatch: pytest.MonkeyPatch, passthrough: str
) -> None:
    """Its format is unknown: it is neither refused nor encoded for good."""
    monkeypatch.setattr("server.camera.passthrough.stream_source.READ_S", 0.5)
    network.gop_limit = 2
    camera = {"options": {"probesize": "2000", "analyzeduration": "1000"}}
    with pytest.raises(UnavailableError, match=r"stopped during the check: no answer within 0\.5 s$"):
        CameraPipeline(site(network.url, passthrough, camera=camera), "c0")


def test_audio_is_delayed_as_much_as_the_video(network: NetworkCamera) -> None:
    options = {"probesize": "20000", "analyzeduration": "200000"}
    config = site(network.url, sound={"source": "c0"})
    listener = LiveAudioSource(config.sound, FPS)
    source = PassthroughStream(network.url, options, listener, required_format(config))
    equal_delays, delay = 0, 0
    for pulse in range(300):
        wait_for_units(network, source)
        listener.take(pulse)
        if source.take(pulse) is None or source.current is None:
            continue
        before, delay = delay, pulse - numbers()[tuple(nals(source.current.data))]
        equal_delays = equal_delays + 1 if delay == before else 0
        if equal_delays == 0:
            listener._shifts.clear()  # a GOP was skipped: the delay is measured again
        if equal_delays == 4 * GOP:
            break
    source.close()
    assert equal_delays == 4 * GOP
    assert float(listener._shift or 0) == pytest.approx(delay / FPS, abs=0.02), "to within half a frame"


def refusal_of(source: PassthroughStream) -> str:
    """Wait until a camera is to be opened again, and return why."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            source.take(-1)
        except UnavailableError as error:
            return str(error)
        time.sleep(0.02)
    raise AssertionError("it is not refused")


@needs_ffmpeg
def test_a_network_camera_that_returns_with_wider_pixels_is_to_be_opened_again(tmp_path: Path) -> None:
    config = site("rtsp://camera", encode={"parameters": "own"})
    path, wide = write_h264(tmp_path, "h264"), tmp_path / "wide.h264"
    options = "-c copy -bsf:v h264_metadata=sample_aspect_ratio=2/1"
    subprocess.run(f"ffmpeg -v error -i {path} {options} {wide}".split(), check=True)
    source = PassthroughStream(str(path), {}, None, required_format(config))
    try:
        wide.replace(path)
        refusal = refusal_of(source)
    finally:
        source.close()
    assert refusal.endswith(f": its images are {2 * WIDTH}x{HEIGHT} now, they were {WIDTH}x{HEIGHT}")


def test_a_network_camera_that_returns_with_another_size_is_to_be_opened_again(tmp_path: Path) -> None:
    config = site("rtsp://camera", encode={"parameters": "own"})
    larger = config.site.model_copy(update={"width": 2 * WIDTH, "height": 2 * HEIGHT})
    encoder = Encoder(larger, config.encode)
    blank = np.zeros((2 * HEIGHT, 2 * WIDTH, 3), dtype=np.uint8)
    first_part = write_h264(tmp_path, "h264").read_bytes()
    other = b"".join(encoder.encode(pulse, blank).data for pulse in range(FRAMES))
    path = tmp_path / "own.h264"
    path.write_bytes(first_part + other)  # the size changes while it is read, and when it is reopened
    source = PassthroughStream(str(path), {}, None, required_format(config))
    (tmp_path / "other.h264").write_bytes(other)
    (tmp_path / "other.h264").replace(path)
    refusal, end = refusal_of(source), time.monotonic() + PATIENCE
    (tmp_path / "first.h264").write_bytes(first_part)
    (tmp_path / "first.h264").replace(path)
    while source._misfit:  # until it fits again
        assert time.monotonic() < end
        time.sleep(0.02)
    source.take(-1)
    source.close()
    wanted = f"its frames are {2 * WIDTH}x{2 * HEIGHT}, the site's {WIDTH}x{HEIGHT} (site.width, site.height)"
    assert refusal.endswith(f": its stream does not fit any more: {wanted}")
    units = source._waiting._units
    assert units
    assert {unit.image.shape for unit in units if unit.image is not None} == {(HEIGHT, WIDTH, 3)}
