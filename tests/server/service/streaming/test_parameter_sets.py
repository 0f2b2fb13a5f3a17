"""Cameras with different parameter sets: cuts between them and filled gaps are correct."""

from __future__ import annotations

import asyncio
import io
import subprocess
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from fakes.media.browser_playback import READ_JS, play_in_chromium
from fakes.programs import needs_chromium, needs_ffmpeg
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.parameter_sets import (
    ENCODINGS,
    GOPS,
    OWN_PARAMETERS,
    decision,
    expected_pictures,
    put_frames,
    sent_units,
)
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH, small_config
from server.config.site_config import Config
from server.media.codec import stream_format_for
from server.media.h264.annexb import parameter_sets
from server.media.nal_units import nal_units
from server.media.stream_format import ParameterMismatchError
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.splicer import Splicer
from server.service.streaming.subscriber_queue import Chunk


async def spliced(config: Config) -> tuple[bytes, bytes]:
    """Return a stream that changes camera at every GOP, as MP4 and as MPEG-TS."""
    stream_format = stream_format_for(
        config.encode.codec, config.site.size, per_camera_parameters=config.encode.parameters == "own"
    )
    frame_buffers = {camera: FrameBuffer(FPS, GOPS * GOP, stream_format) for camera in ENCODINGS}
    put_frames(frame_buffers)
    splicer, pieces, viewer = Splicer(frame_buffers, stream_format, config), list[Chunk](), None
    for gop in range(GOPS):
        splicer.publish_decision(decision(gop))
        viewer = viewer or splicer.persons[1].subscribe()
    splicer.close()
    assert viewer is not None
    pieces = [piece async for piece in viewer.chunks()]
    head = stream_format.init_segment(config.site.size, config.site.fps)
    assert head is not None
    ts = b"".join(piece.mpegts for piece in pieces if isinstance(piece, MediaChunk))
    return head + b"".join(piece.data for piece in pieces), ts


def config(**changes: Any) -> Config:
    return small_config(**OWN_PARAMETERS, http={"viewer_queue_gops": 100}, **changes)


def test_the_cameras_have_different_parameter_sets() -> None:
    one, other = (parameter_sets(nal_units(sent_units(camera)[0].data)) for camera in ENCODINGS)
    assert one is not None
    assert other is not None
    assert one.sps != other.sps
    assert one.pps != other.pps


@pytest.mark.parametrize("form", ["mp4", "mpegts"])
async def test_every_frame_is_the_chosen_cameras_and_gaps_repeat_the_last_picture(form: str) -> None:
    mp4, ts = await spliced(config())
    with av.open(io.BytesIO(mp4 if form == "mp4" else ts), format=form) as container:
        shown_frames = [
            (frame.time, frame.to_ndarray(format="yuv420p")) for frame in container.decode(video=0)
        ]
    assert [round(time * FPS) for time, _ in shown_frames] == list(range(GOPS * GOP))
    for pulse, ((_, picture), right) in enumerate(zip(shown_frames, expected_pictures(), strict=True)):
        np.testing.assert_array_equal(picture, right, f"pulse {pulse}")


@needs_ffmpeg
async def test_ffmpeg_plays_the_stream_without_a_warning(tmp_path: Path) -> None:
    for name, data in zip(("own.mp4", "own.ts"), await spliced(config()), strict=True):
        (tmp_path / name).write_bytes(data)
        as_pictures = "-f rawvideo -pix_fmt yuv420p -fps_mode passthrough -"
        command = f"ffmpeg -nostdin -v warning -i {tmp_path / name} {as_pictures}".split()
        played = await asyncio.to_thread(subprocess.run, command, capture_output=True, check=True)
        assert played.stderr == b"", name
        pictures = np.frombuffer(played.stdout, np.uint8).reshape(-1, HEIGHT * 3 // 2, WIDTH)
        np.testing.assert_array_equal(pictures, expected_pictures(), name)


async def test_a_second_camera_with_other_parameter_sets_is_refused_if_they_must_be_equal() -> None:
    with pytest.raises(ParameterMismatchError, match="differ from the other cameras'"):
        await spliced(small_config())


LOOK = (
    "async ([url, type, width, height]) => {"
    + READ_JS
    + """
  const canvas = new OffscreenCanvas(width, height).getContext('2d');
  const greens = [];
  for (let pulse = 0; pulse < buffer.buffered.end(0) * 25 - 0.5; pulse += 3) {
    video.currentTime = (pulse + 0.5) / 25;
    for (let is = -1; is !== pulse;) {  // a picture says when it is shown; that it was sought says less
      await new Promise(requestAnimationFrame);
      if (video.seeking || video.readyState < video.HAVE_CURRENT_DATA) continue;
      const image = new VideoFrame(video);
      is = Math.round(image.timestamp * 25 / 1e6);
      canvas.drawImage(image, 0, 0);
      image.close();
    }
    const { data } = canvas.getImageData(0, 0, width, height);
    const blocks = [];
    for (let y = 4; y < height; y += 8) {
      for (let x = 4; x < width; x += 8) blocks.push(data[4 * (y * width + x) + 1]);
    }
    greens.push(blocks);
  }
  return { ranges: buffer.buffered.length, greens, error: video.error?.message ?? '' };
}"""
)


@needs_chromium
async def test_chromium_shows_the_chosen_cameras_pictures() -> None:
    async for served in serve_site(patience=60, **OWN_PARAMETERS, http={"viewer_queue_gops": 100}):
        shown_frames = await _played(served)
    assert (shown_frames["error"], shown_frames["ranges"]) == ("", 1)
    rgb = [
        av.VideoFrame.from_ndarray(picture, format="yuv420p").to_ndarray(format="rgb24")
        for picture in expected_pictures()
    ]
    right = np.array([picture[4::8, 4::8, 1].ravel() for picture in rgb], dtype=float)[::3]
    found = np.array(shown_frames["greens"], dtype=float)
    assert len(found) == GOPS * GOP / 3
    # Colors are converted in two ways; pictures of other pulses or cameras differ by several times as much.
    assert np.abs(found - right).mean(axis=1).max() < 20
    assert np.abs(found[1:] - right[:-1]).mean(axis=1)[:4].min() > 40


async def _played(served: ServedSite) -> dict[str, Any]:
    splicer, stream_format = served.service.splicer, served.service.stream_format
    put_frames(served.service.frame_buffers)
    splicer.publish_decision(decision(0))
    assert stream_format.codec is not None
    assert stream_format.codec.startswith("avc3.")
    return await play_in_chromium(
        *(served.port, splicer, GOPS, lambda gop: splicer.publish_decision(decision(gop))),
        *(LOOK, "/objects/1/best.mp4", f'video/mp4; codecs="{stream_format.codec}"', WIDTH, HEIGHT),
    )
