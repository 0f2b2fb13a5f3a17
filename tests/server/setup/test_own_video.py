"""Set-up proposes to pass a camera's own video through where it fits, and says what is missing elsewhere."""

from __future__ import annotations

import math
import re
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from fakes.media.h264 import encoded
from fakes.media.rtsp_camera import RtspCamera
from server.camera.passthrough.compatibility import required_format
from server.camera.passthrough.stream_source import check_stream
from server.config.loader import load_config
from server.setup.camera_address import parse_address, parse_addresses
from server.setup.own_video import NOT_COMPARED, OwnVideo, compare_own_video
from server.setup.proposal import SiteProposal
from server.setup.session import SetupSession, TriedCamera, TriedStream
from server.setup.stream_trial import run_trial
from server.setup.trial_messages import StreamRequest, StreamTrial
from server.system.errors import UserError

SITE = SiteProposal(25.0, 1280, 720)
FITTING = StreamTrial(width=1280, height=720, fps=25.0, codec="h264", gop=10)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, OwnVideo(fits=True)),
        ({"fps": 25.1}, OwnVideo(fits=True)),
        ({"gop": 50}, OwnVideo(wanted="a fixed GOP (I-frame interval) of 10 frames, not 50")),
        ({"gop": 0}, OwnVideo(wanted="a fixed GOP (I-frame interval) of 10 frames")),
        (
            {"width": 1920, "height": 1080, "fps": 12.5, "reorders": True},
            OwnVideo(wanted="1280x720 pixels; 25 frames a second; no B frames"),
        ),
        ({"codec": "hevc"}, OwnVideo(wanted="H.264")),
        ({"codec": "mjpeg"}, NOT_COMPARED),
        ({"is_upright": False}, NOT_COMPARED),
    ],
)
def test_what_a_camera_must_be_set_to_is_named(change: dict[str, object], expected: OwnVideo) -> None:
    assert compare_own_video(msgspec.structs.replace(FITTING, **change), SITE) == expected


@pytest.mark.parametrize(("gop", "fits"), [(10, True), (12, False)])
async def test_a_camera_whose_video_fits_passes_through_the_site_that_is_written(
    tmp_path: Path, gop: int, *, fits: bool
) -> None:
    session = SetupSession(tmp_path / "site.yaml")
    units = encoded((64, 48), "superfast", 120, gop=gop)
    gops = [units[at : at + gop] for at in range(0, 120, gop)]
    with closing(RtspCamera(gops, 25.0, live=True)) as stream:
        await session.add(parse_addresses(stream.url), "door")
        session.write("hall", session.proposal)
        config, text = load_config(session.path), session.path.read_text()
        assert (config.camera("door").passthrough == "auto") is fits
        assert ("#passthrough: auto" in text) is not fits
        if fits:
            check_stream(stream.url, config.camera("door").options, required_format(config))
        else:
            assert "of 10 frames, not 12\n" in text
    session.path.write_text(re.sub(r"^( *)#(?=\w)", r"\1", text, flags=re.MULTILINE))
    config = load_config(session.path)
    assert (config.camera("door").passthrough, config.encode.parameters) == ("auto", "own")


def test_a_first_gop_cut_short_for_a_new_client_tells_nothing_of_the_others() -> None:
    units = encoded((64, 48), "superfast", 100, gop=50)
    with closing(RtspCamera([units[:30], units[50:70]], 25.0)) as stream:
        stream.gop_limit = 2
        trial = run_trial(StreamRequest(stream.url, {}))
    assert (trial.codec, trial.gop) == ("h264", 0)


@pytest.mark.parametrize("fps", [0.0, -25.0, math.inf, math.nan])
def test_a_rate_that_no_site_can_have_is_one_line(tmp_path: Path, fps: float) -> None:
    stream = TriedStream(parse_address("rtsp://10.0.0.1/"), FITTING)
    session = SetupSession(tmp_path / "site.yaml", cameras=[TriedCamera(1, "door", stream)])
    with pytest.raises(UserError, match=r"^site: fps: [^\n]*$"):
        session.write("hall", SiteProposal(fps, 1280, 720))
    assert list(tmp_path.iterdir()) == []
