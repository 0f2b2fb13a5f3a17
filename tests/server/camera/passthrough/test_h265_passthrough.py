"""A camera's own H.265 is passed through byte for byte at a site of H.265, or refused if it does not fit."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from fakes.media.camera_video import passed_units, write_units
from fakes.media.h265 import sets_of, x265_units
from fakes.media.rtsp_camera import RtspCamera
from fakes.programs import needs_ffmpeg
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH, encoded, small_config
from fakes.timeouts import PATIENCE
from server.camera.encoder import AccessUnit
from server.camera.passthrough.access_units import parse_packing
from server.camera.passthrough.stream_source import PassthroughStream
from server.camera.pipeline import CameraPipeline
from server.config.site_config import Config
from server.media.containers.mpegts import ContinuityCounters, pack
from server.media.h265.codec import H265
from server.media.h265.nal import NAL_AUD, nal_type
from server.media.nal_units import join_units, nal_units
from server.media.picture import Codec
from server.media.stream_format import PerCameraStreamFormat, StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer
from server.system.errors import UserError

FRAMES = 20


def site(source: Path | str, passthrough: str = "pass", **changes: Any) -> Config:
    camera = {"id": "c0", "source": str(source), "passthrough": passthrough, **changes.pop("camera", {})}
    encode = {"codec": "h265", **changes.pop("encode", {})}
    return small_config(cameras=[camera, {"id": "c1", "source": "scene:room"}], encode=encode, **changes)


def h265_units(seed: int = 0, frames: int = FRAMES) -> tuple[AccessUnit, ...]:
    return encoded(seed, 40, codec="h265")[:frames]


def write_h265(folder: Path, form: str, seed: int = 0) -> Path:
    """Write a video with the encoding of this site's cameras into a container."""
    units = h265_units(seed)
    sets = b"".join(b"\x00\x00\x00\x01" + unit for unit in H265.select_sets(nal_units(units[0].data)))
    quiet = {"x265-params": "log-level=none"}
    return write_units(units, folder / f"own.{form}", H265, "libx265", sets, quiet)


def nals(data: bytes) -> list[bytes]:
    return [unit for unit in nal_units(data) if nal_type(unit) != NAL_AUD]


@pytest.mark.parametrize("form", ["h265", "ts", "mp4", "mkv"])
def test_access_units_are_passed_through_unchanged(tmp_path: Path, form: str) -> None:
    pipeline = CameraPipeline(site(write_h265(tmp_path, form)), "c0")
    assert pipeline.is_passthrough
    sent = passed_units(pipeline, range(FRAMES))
    pipeline.close()
    for unit, original in zip(sent, h265_units(), strict=True):
        assert (unit.pulse, unit.key, nals(unit.data)) == (original.pulse, original.key, nals(original.data))


def test_passthrough_can_be_spliced_with_encoded_video(tmp_path: Path) -> None:
    pipeline = CameraPipeline(site(write_h265(tmp_path, "mp4")), "c0")
    stream_format = StreamFormat(H265)
    frame_buffers = [FrameBuffer(FPS, FRAMES, stream_format) for _ in range(2)]
    sent = passed_units(pipeline, range(FRAMES)), h265_units(1)
    pipeline.close()
    for frame_buffer, units in zip(frame_buffers, sent, strict=True):
        for unit in units:
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)


@pytest.fixture
def rtsp() -> Iterator[RtspCamera]:
    units = encoded(0, 200, codec="h265")
    gops = [units[first : first + GOP] for first in range(0, 200, GOP)]
    camera = RtspCamera(gops, FPS, codec="h265", live=True)
    yield camera
    camera.close()


@pytest.mark.parametrize("substream", [False, True])
def test_a_network_cameras_video_is_passed_through_in_whole_gops(
    rtsp: RtspCamera, *, substream: bool
) -> None:
    """Also where it is not decoded, since people are tracked in a substream."""
    camera = {"substream": f"{rtsp.url}/sub"} if substream else {}
    pipeline = CameraPipeline(site(rtsp.url, camera=camera), "c0")
    assert pipeline.is_passthrough
    known = {tuple(nals(unit.data)): unit.pulse for unit in encoded(0, 200, codec="h265")}
    sent: list[AccessUnit] = []
    pulse = 0
    while len(sent) < 4 * GOP:
        rtsp.stop.wait(1 / FPS)
        sent += passed_units(pipeline, range(pulse, pulse + 1))
        pulse += 1
        assert pulse < 60 * FPS
    pipeline.close()
    for unit in sent:
        place = known[tuple(nals(unit.data))]
        assert unit.key == (place % GOP == 0)
        assert unit.pulse % GOP == place % GOP


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_what_depends_on_a_lost_picture_is_not_sent(codec: Codec) -> None:
    """FFmpeg conceals that an H.264 picture is missing."""
    units = encoded(0, 200, codec=codec)
    gops = [units[first : first + GOP] for first in range(0, 200, GOP)]
    damaged = [gop[:2] + gop[3:] if place > 4 and place % 3 == 0 else gop for place, gop in enumerate(gops)]
    camera = RtspCamera(damaged, FPS, codec=codec)
    pipeline = CameraPipeline(site(camera.url, encode={"codec": codec}), "c0")
    known = {tuple(nals(unit.data)): unit.pulse for unit in units}
    source, queued, deadline = pipeline.source, list[int](), time.monotonic() + PATIENCE
    assert isinstance(source, PassthroughStream)
    try:
        while len(queued) < 60:
            with source._waiting_lock:
                queued += [known[tuple(nals(unit.data))] for unit in source._waiting._units]
                source._waiting._units.clear()
            assert time.monotonic() < deadline
            time.sleep(0.002)
    finally:
        camera.close()
        pipeline.close()
    lost = {pulse for pulse in queued if pulse // GOP > 4 and pulse // GOP % 3 == 0 and pulse % GOP >= 2}
    assert any(pulse // GOP > 4 and pulse // GOP % 3 == 0 for pulse in queued), "GOPs with a loss came"
    assert lost == set()


@pytest.mark.parametrize(
    ("encode", "reason"),
    [
        ({"codec": "h264"}, r"it is H\.265, not H\.264 \(encode\.codec\)"),
        (
            {"crf": 30, "preset": "medium"},
            "frame 0 has other parameter sets .* than those",
        ),
        ({"gop_s": 4 / FPS}, "frame 4 does not begin a GOP: they begin every 4 frames"),
    ],
)
def test_a_camera_that_does_not_fit_is_refused(tmp_path: Path, encode: dict[str, Any], reason: str) -> None:
    path = write_h265(tmp_path, "mp4")
    with pytest.raises(UserError, match=f"camera c0: passthrough: pass: {reason}"):
        CameraPipeline(site(path, encode=encode), "c0")


def test_h264_is_encoded_anew(tmp_path: Path) -> None:
    path = tmp_path / "own.h264"
    path.write_bytes(b"".join(unit.data for unit in encoded(0)[:FRAMES]))
    pipeline = CameraPipeline(site(path, "auto"), "c0")
    assert pipeline.why_encoded == "it is H.264, not H.265 (encode.codec)"
    sent = passed_units(pipeline, range(GOP))
    pipeline.close()
    assert H265.parameter_sets(nal_units(sent[0].data)) is not None


@pytest.mark.parametrize(
    ("pixels", "passes"), [("yuv420p10le", True), ("yuv422p", False), ("yuv444p", False)]
)
def test_parameter_sets_whose_pictures_cannot_be_repeated_are_refused(
    tmp_path: Path, pixels: str, *, passes: bool
) -> None:
    path = tmp_path / "own.h265"
    gop = b"".join(x265_units((WIDTH, HEIGHT), GOP, pixels=pixels))
    path.write_bytes(gop * 4)
    pipeline = CameraPipeline(site(path, "auto", encode={"parameters": "own"}), "c0")
    assert pipeline.is_passthrough == passes
    reason = "" if passes else "its parameter sets are not supported: neither Main nor Main 10 profile"
    assert pipeline.why_encoded == reason
    frame = pipeline.take(0)
    assert frame is not None
    assert frame.image is not None
    assert (frame.image.shape, frame.image.dtype) == ((HEIGHT, WIDTH, 3), np.uint8)
    pipeline.close()


def test_a_camera_whose_gops_begin_with_other_pictures_than_idr_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.h265"
    units = x265_units((WIDTH, HEIGHT), GOP)
    irap, cra = bytes([20 << 1, 1]), bytes([21 << 1, 1])
    others = [unit.replace(b"\x00\x00\x01" + irap, b"\x00\x00\x01" + cra) for unit in units]
    assert others != units
    path.write_bytes(b"".join(units + others) * 3)
    with pytest.raises(UserError, match=f"frame {GOP} does not begin a GOP"):
        CameraPipeline(site(path, encode={"parameters": "own"}), "c0")


@needs_ffmpeg
def test_cuts_between_cameras_of_other_encoders_decode_without_errors(tmp_path: Path) -> None:
    """With own parameter sets: a camera at full range of settings beside MyView's encoder."""
    stream_format = PerCameraStreamFormat(H265)
    other = x265_units((WIDTH, HEIGHT), GOP, "wpp=1:ctu=32:ref=3", "medium")
    buffers = [FrameBuffer(FPS, FRAMES, stream_format) for _ in range(2)]
    for unit in h265_units():
        buffers[0].put(unit.pulse, 1, unit.data, key=unit.key)
    for pulse in range(FRAMES):
        buffers[1].put(pulse, 1, other[pulse % GOP], key=pulse % GOP == 0)
    head = stream_format.init_segment((WIDTH, HEIGHT), FPS)
    assert head is not None
    assert stream_format.codec is not None
    assert stream_format.codec.startswith("hev1.1.6.")
    pictures = [picture for gop in range(4) for picture in buffers[gop % 2].pictures(gop * GOP, GOP)]
    gray = stream_format.blank(pictures[-1], FRAMES, GOP, FPS)
    data = {
        "mp4": head + b"".join(picture.fragment for picture in [*pictures, *gray]),
        "ts": pack([*pictures, *gray], FPS, ContinuityCounters()),
    }
    for form, content in data.items():
        path = tmp_path / f"best.{form}"
        path.write_bytes(content)
        command = ["ffmpeg", "-v", "error", "-xerror", "-i", path, "-f", "null", "-"]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert (ended.returncode, ended.stderr) == (0, ""), form
        with av.open(str(path)) as container:
            shown = [frame.to_ndarray(format="yuv420p") for frame in container.decode(video=0)]
        assert len(shown) == FRAMES + GOP
        assert all((picture == 128).all() for picture in shown[FRAMES:])
        np.testing.assert_array_equal(shown[GOP], shown[3 * GOP])


def test_damaged_descriptions_are_refused() -> None:
    sets = sets_of(h265_units()[0].data)
    packing = parse_packing(sets.configuration, H265)
    assert packing.sets == (sets.vps, sets.sps, sets.pps)
    for end in range(24):
        with pytest.raises(ValueError, match="hvcC box is damaged"):
            parse_packing(sets.configuration[: max(1, end)], H265)
    picture = join_units(nal_units(h265_units()[1].data))
    with pytest.raises(ValueError, match="does not fit into its packet"):
        packing.annex_b(picture[:-1])


@pytest.mark.parametrize("form", ["mp4", "mkv", "h265"])
def test_pictures_that_refer_to_later_ones_are_refused(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"own.{form}"
    with av.open(str(path), "w", format={"mkv": "matroska", "h265": "hevc"}.get(form, form)) as container:
        options = {"x265-params": f"keyint={GOP}:bframes=2:b-adapt=0:open-gop=0:scenecut=0:log-level=none"}
        stream = container.add_stream("libx265", rate=FPS, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for number in range(FRAMES):
            image = np.full((HEIGHT, WIDTH, 3), 10 * number, dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    # Matroska has no times of decoding.
    reason = "frame 1 is shown at 0.12 s" if form == "mkv" else "in another order: it has B frames"
    with pytest.raises(UserError, match=reason):
        CameraPipeline(site(path, encode={"parameters": "own"}), "c0")
