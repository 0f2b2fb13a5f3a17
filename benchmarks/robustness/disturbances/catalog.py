"""All disturbances by name, weak, middle and strong."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.robustness.disturbances.base import Disturbance
from benchmarks.robustness.disturbances.lens import Covered, LensDrops, OutOfFocus, Sprayed
from benchmarks.robustness.disturbances.light import (
    ExposureJump,
    Gain,
    Gamma,
    LampFlicker,
    Night,
    Noise,
    Sun,
    WhiteBalance,
)
from benchmarks.robustness.disturbances.motion import Knock, Sway, TurnedAway
from benchmarks.robustness.disturbances.transmission import (
    DoubledFrames,
    DroppedFrames,
    Frozen,
    Jpeg,
    LowRateH264,
)
from benchmarks.robustness.disturbances.weather import Fog, MovingScreen, MovingTree, Rain

STRENGTHS = ("weak", "middle", "strong")

_GRADES: dict[str, tuple[Disturbance, Disturbance, Disturbance]] = {
    "gamma": (Gamma(exponent=0.8), Gamma(exponent=0.65), Gamma(exponent=0.5)),
    "darker": (Gain(factor=0.75), Gain(factor=0.55), Gain(factor=0.35)),
    "brighter": (Gain(factor=1.2), Gain(factor=1.4), Gain(factor=1.7)),
    "gain-6s": (
        Gain(factor=1.2, lasts_s=6.0),
        Gain(factor=1.35, lasts_s=6.0),
        Gain(factor=1.6, lasts_s=6.0),
    ),
    "exposure": (ExposureJump(factor=1.3), ExposureJump(factor=1.7), ExposureJump(factor=2.4)),
    "white-balance": (WhiteBalance(blue=1.1), WhiteBalance(blue=1.25), WhiteBalance(blue=1.5)),
    "sun": (Sun(factor=1.25), Sun(factor=1.5), Sun(factor=2.0)),
    "flicker": (LampFlicker(depth=0.04), LampFlicker(depth=0.1), LampFlicker(depth=0.2)),
    "noise": (Noise(levels=7.0), Noise(levels=14.0), Noise(levels=24.0)),
    "night": (Night(light=0.5, levels=5.0), Night(light=0.3, levels=8.0), Night(light=0.18, levels=11.0)),
    "knock": (
        Knock(shift=0.008, degrees=0.5),
        Knock(shift=0.0167, degrees=1.0),
        Knock(shift=0.06, degrees=3.0),
    ),
    "sway": (Sway(amplitude=0.002), Sway(amplitude=0.0042), Sway(amplitude=0.01)),
    "fog": (Fog(density=0.3), Fog(density=0.55), Fog(density=0.8)),
    "rain": (Rain(streaks=80), Rain(streaks=250), Rain(streaks=600)),
    "tree": (MovingTree(extent=0.1), MovingTree(extent=0.2), MovingTree(extent=0.35)),
    "screen": (MovingScreen(extent=0.1), MovingScreen(extent=0.2), MovingScreen(extent=0.3)),
    "blur": (OutOfFocus(sigma=0.003), OutOfFocus(sigma=0.007), OutOfFocus(sigma=0.015)),
    "lens-drops": (LensDrops(drops=6), LensDrops(drops=14), LensDrops(drops=30)),
    "jpeg": (Jpeg(quality=30), Jpeg(quality=12), Jpeg(quality=5)),
    "h264": (LowRateH264(crf=34), LowRateH264(crf=40), LowRateH264(crf=47)),
    "dropped": (DroppedFrames(share=0.1), DroppedFrames(share=0.3), DroppedFrames(share=0.6)),
    "doubled": (DoubledFrames(share=0.15), DoubledFrames(share=0.4), DoubledFrames(share=0.7)),
    "frozen": (
        Frozen(lasts_s=1.0, one_camera=True),
        Frozen(lasts_s=5.0, one_camera=True),
        Frozen(one_camera=True),
    ),
    "covered": (
        Covered(share=1.5, lasts_s=1.0, one_camera=True),
        Covered(share=1.5, lasts_s=5.0, one_camera=True),
        Covered(share=1.5, one_camera=True),
    ),
    "sprayed": (
        Sprayed(share=0.2, one_camera=True),
        Sprayed(share=0.5, one_camera=True),
        Sprayed(share=0.8, one_camera=True),
    ),
    "turned-away": (
        TurnedAway(shift=0.15, one_camera=True),
        TurnedAway(shift=0.4, one_camera=True),
        TurnedAway(shift=0.9, one_camera=True),
    ),
}

CATALOG: Mapping[str, Mapping[str, Disturbance]] = {
    name: dict(zip(STRENGTHS, grades, strict=True)) for name, grades in _GRADES.items()
}
"""By name and strength. The middle ones of light and motion are those of the first measurements."""
