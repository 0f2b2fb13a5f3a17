"""The catalog of clothing that distinguishes people."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from synthetic.room.room import Color


def _rgb(code: int) -> Color:
    return ((code >> 16) / 255, (code >> 8 & 255) / 255, (code & 255) / 255)


@dataclass(frozen=True, slots=True)
class Outfit:
    """Clothes and build of a person. Colors are red, green, blue in 0..1; the height is in meters."""

    upper: Color
    lower: Color
    hair: Color
    skin: Color
    shoes: Color
    height: float
    build: float = 1.0  # girth, a factor
    hair_cut: Literal["short", "long", "bun"] = "short"
    sleeves: Literal["long", "short"] = "long"
    legs: Literal["trousers", "shorts", "skirt"] = "trousers"
    backpack: Color | None = None


_PALE, _TAN, _BROWN, _DARK = _rgb(0xE9BF9F), _rgb(0xCF9A70), _rgb(0x9A6643), _rgb(0x6B442D)
_BLACK, _BRUNETTE, _GINGER, _BLOND, _GRAY = (
    _rgb(0x1D1917),
    _rgb(0x3A2619),
    _rgb(0x8E4A22),
    _rgb(0xC9A25E),
    _rgb(0xA9A7A4),
)
_INK, _SNOW, _LEATHER = _rgb(0x1E2027), _rgb(0xE6E4DF), _rgb(0x4A2E1E)

_SHIRTS = ((_rgb(0xD8342B), _rgb(0xF0EDE6)), (_rgb(0x2450B4), _rgb(0x1B2440)))
_ALIKE = 0.3  # share of the seeds with two people in nearly the same clothes

# The first eight differ in every piece: no two uppers and no two lowers are less than 30 apart in CIE L*a*b*.
_WARDROBE = (
    Outfit(_rgb(0xC8322D), _rgb(0x15161B), _BRUNETTE, _PALE, _SNOW, 1.82),
    Outfit(_rgb(0xF2BC2E), _rgb(0x2B55B4), _BLACK, _BROWN, _SNOW, 1.66, 0.94, "long", "short"),
    Outfit(_rgb(0x2458B8), _rgb(0xEEE8DA), _BLOND, _PALE, _LEATHER, 1.75, 1.02, backpack=_rgb(0x2B2D33)),
    Outfit(_rgb(0x2E8F57), _rgb(0xB5562A), _BLACK, _DARK, _INK, 1.88, 1.06),
    Outfit(_rgb(0xECE9E4), _rgb(0x9A1C50), _GINGER, _PALE, _INK, 1.63, 0.93, "bun", "short", "skirt"),
    Outfit(_rgb(0x9C3FAE), _rgb(0x86BCF0), _GRAY, _TAN, _SNOW, 1.70, 1.08),
    Outfit(_rgb(0x30B4BE), _rgb(0x17603A), _BRUNETTE, _TAN, _LEATHER, 1.78, 0.98, "short", "short", "shorts"),
    Outfit(_rgb(0x1B1C21), _rgb(0xD6A22C), _BLOND, _PALE, _INK, 1.69, 0.95, "long", backpack=_rgb(0xB53A34)),
    Outfit(_rgb(0xE8762C), _rgb(0x45307A), _BLACK, _BROWN, _SNOW, 1.73, 1.0, "bun"),
    Outfit(_rgb(0xE58AA8), _rgb(0x20304F), _BRUNETTE, _TAN, _SNOW, 1.61, 0.92, "long", "short"),
    Outfit(_rgb(0x99B83C), _rgb(0x5B2D1D), _GRAY, _PALE, _LEATHER, 1.80, 1.1),
    Outfit(_rgb(0x7A1F35), _rgb(0xC4C6CA), _BLACK, _DARK, _LEATHER, 1.77, 1.0, backpack=_rgb(0x3F6A4C)),
)


def choose_distinct_outfit(walker: int, seed: int) -> Outfit:
    """Return the outfit of walker 0, 1, …; the first twelve are from the catalog, and all of them differ."""
    if walker < len(_WARDROBE):
        return _WARDROBE[walker]
    rng = np.random.default_rng([seed, 0x0C10, walker])
    base = _WARDROBE[int(rng.integers(len(_WARDROBE)))]
    return Outfit(
        upper=_dye(rng),
        lower=_dye(rng, vivid=0.45),
        hair=base.hair,
        skin=base.skin,
        shoes=base.shoes,
        height=float(rng.uniform(1.58, 1.92)),
        build=float(rng.uniform(0.92, 1.1)),
        hair_cut=base.hair_cut,
        sleeves=base.sleeves,
        legs=base.legs,
    )


def choose_outfit_with_lookalikes(walker: int, seed: int) -> Outfit:
    """Return a catalog outfit for walker 0, 1, …; with some seeds two people have nearly the same clothes."""
    rng = np.random.default_rng([seed, 0xCA50])
    order = rng.permutation(len(_WARDROBE)).tolist()
    alike = rng.random() < _ALIKE
    outfit = _WARDROBE[order[walker % len(order)]]
    if walker == 1 and alike:
        first = _WARDROBE[order[0]]
        return replace(outfit, upper=_faded(first.upper), lower=first.lower, legs=first.legs)
    return outfit


def choose_team_outfit(player: int, team: int) -> Outfit:
    """Return a player's outfit in the team's colors: its players differ only in hair, skin and height."""
    base = _WARDROBE[(player * 5 + team * 3) % len(_WARDROBE)]
    upper, lower = _SHIRTS[team]
    return Outfit(
        upper, lower, base.hair, base.skin, _SNOW, base.height + 0.08, 0.96, "short", "short", "shorts"
    )


def _faded(color: Color) -> Color:
    """Return nearly the same color, slightly faded."""
    red, green, blue = (0.9 * part + 0.05 for part in color)
    return (red, green, blue)


def _dye(rng: np.random.Generator, vivid: float = 0.75) -> Color:
    """Mix a color far from the room's browns and grays: saturated, and either light or dark."""
    hue = rng.uniform(0, 2 * np.pi)
    light = rng.choice([0.24, 0.62])
    wave = 0.5 + 0.5 * np.cos(hue - np.array([0.0, 2.094, 4.189]))
    mixed = light * (1 - vivid) + vivid * wave * (light + 0.2)
    red, green, blue = np.clip(mixed, 0.04, 0.95).tolist()
    return (red, green, blue)
