"""The codec benchmark on a real camera pipeline: passthrough is lossless and needs no encoding."""

from __future__ import annotations

from pathlib import Path

from benchmarks.codecs import VARIANTS, StreamCost, measure, median_cost, record
from server.config.sections import SiteSettings

SITE = SiteSettings(width=160, height=96)
FRAMES = 20


def test_passthrough_is_lossless_and_costs_no_encoding(tmp_path: Path) -> None:
    recording = record(tmp_path / "room.h264", SITE, FRAMES)
    costs = {variant.name: measure(variant, recording, SITE, FRAMES) for variant in VARIANTS}
    passthrough = costs.pop("H.264, passed through")
    assert passthrough.quality == float("inf")
    assert passthrough.kbps == recording.stat().st_size * 8 * SITE.fps / FRAMES / 1000
    for cost in costs.values():
        assert 25 < cost.quality < 60
        assert passthrough.encode_ms < cost.encode_ms / 5
    assert costs["VP8, quantizer 24"].kbps < costs["VP8 (quantizer 16, speed 10)"].kbps


def test_each_time_is_its_median_over_rounds() -> None:
    rounds = [StreamCost(1, 6, 2, 9, 40), StreamCost(3, 4, 1, 9, 40), StreamCost(2, 5, 3, 9, 40)]
    assert median_cost(rounds) == StreamCost(2, 5, 2, 9, 40)
    assert median_cost(rounds).total_ms == 9
