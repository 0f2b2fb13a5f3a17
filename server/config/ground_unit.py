"""The unit of the floor that cameras share: any word; m, cm and mm are understood as lengths."""

from __future__ import annotations

import difflib

UNITS_PER_METER = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""How many of each are a meter."""
_MEANT = {
    "m": ("meter", "meters", "metre", "metres"),
    "cm": ("centimeter", "centimeters", "centimetre", "centimetres"),
    "mm": ("millimeter", "millimeters", "millimetre", "millimetres"),
}
_SHOWN = 40
"""Characters of an invalid unit that an error repeats."""
_CLOSE = 0.8
"""Similarity (difflib's ratio) from which a word counts as a misspelled unit."""


def check_unit(unit: object) -> str:
    """Return the unit; any word is accepted, except a misspelling of a metric one.

    Raises:
        ValueError: it is not a word, or a misspelling of m, cm or mm; one line.
    """
    if not isinstance(unit, str) or not unit.strip() or not unit.isprintable():
        raise ValueError(f'{repr(unit)[:_SHOWN]} is not a unit; it is a word, such as "m"')
    if unit in UNITS_PER_METER:
        return unit
    word = unit.strip(" .").lower()
    names = {name: short for short, names in _MEANT.items() for name in names}
    close = difflib.get_close_matches(word, names, n=1, cutoff=_CLOSE)
    meant = word if word in UNITS_PER_METER else names[close[0]] if close else None
    if meant is not None:
        raise ValueError(f"{unit!r} is not understood; did you mean {meant!r}?")
    return unit
