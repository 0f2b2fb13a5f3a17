"""The encoder: positions of keyframes, reproducible bytes, and the bit rate limit."""

from __future__ import annotations

from functools import cache

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.media.decoding import video_decoder
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.codec import nal_codec
from server.media.nal_units import nal_units
from server.media.picture import Codec

SITE = SiteSettings(width=160, height=96, fps=25)
FRAMES = 100
SECOND = 25
CAP = 400
NOISY = range(33, 78)
"""Pictures of pure noise, which begins and ends inside GOPs."""


@cache
def picture(pulse: int) -> NDArray[np.uint8]:
    if pulse not in NOISY:
        return np.full((SITE.height, SITE.width, 3), 100, dtype=np.uint8)
    return np.random.default_rng(pulse).integers(0, 256, (SITE.height, SITE.width, 3), dtype=np.uint8)


def encoded(settings: EncodeSettings) -> list[AccessUnit]:
    encoder = Encoder(SITE, settings)
    return [encoder.encode(pulse, picture(pulse)) for pulse in range(FRAMES)]


def peak_kbps(units: list[AccessUnit]) -> float:
    """Return the most kilobits in any second."""
    kilobits = np.array([len(unit.data) * 8 / 1000 for unit in units])
    return float(np.convolve(kilobits, np.ones(SECOND), "valid").max())


@pytest.mark.parametrize("codec", ["h264", "h265"])
@pytest.mark.parametrize("preset", ["ultrafast", pytest.param("medium", marks=pytest.mark.slow)])
@pytest.mark.parametrize("gop", [1, 10, 50])
def test_no_second_of_a_noisy_scene_takes_more_than_the_cap(gop: int, preset: str, codec: str) -> None:
    content = {"gop_s": gop / SITE.fps, "preset": preset, "codec": codec}
    settings = EncodeSettings.model_validate({**content, "max_kbps": CAP})
    least = CAP / 2 if codec == "h264" else CAP / 4  # x265 is more careful with single pictures
    assert least < peak_kbps(encoded(settings)) <= CAP
    uncapped = EncodeSettings.model_validate(content)
    assert peak_kbps(encoded(uncapped)) > 2 * CAP, "the cap has an effect"


@pytest.mark.parametrize(
    "settings",
    [
        EncodeSettings(gop_s=10 / SITE.fps, max_kbps=CAP),
        EncodeSettings(gop_s=10 / SITE.fps, codec="h265"),
        EncodeSettings(gop_s=10 / SITE.fps, codec="vp8"),
    ],
)
def test_keyframes_are_at_gop_starts_and_bytes_are_reproducible(settings: EncodeSettings) -> None:
    units = encoded(settings)
    parser = video_decoder(settings.codec)
    keys = [frame.key_frame for unit in units for frame in parser.decode(av.Packet(unit.data))]
    assert keys == [unit.key for unit in units], "no further ones where noise begins or ends"
    assert [unit.pulse for unit in units if unit.key] == list(range(0, FRAMES, 10))
    assert units == encoded(settings)


def test_vp8_has_a_frame_for_every_pulse_and_a_higher_quantizer_is_smaller() -> None:
    fine, coarse = (
        encoded(EncodeSettings(codec="vp8", quantizer=8)),
        encoded(EncodeSettings(codec="vp8", quantizer=40)),
    )
    assert [unit.pulse for unit in fine] == [unit.pulse for unit in coarse] == list(range(FRAMES))
    assert all(unit.data for unit in [*fine, *coarse])
    assert peak_kbps(fine) > 1.5 * peak_kbps(coarse)


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_parameter_sets_do_not_depend_on_the_images(codec: Codec) -> None:
    settings = EncodeSettings(gop_s=10 / SITE.fps, max_kbps=CAP, codec=codec)
    parameter_sets = nal_codec(codec).parameter_sets
    sets = {parameter_sets(nal_units(unit.data)) for unit in encoded(settings) if unit.key}
    assert len(sets) == 1
    assert None not in sets
