"""Unit of the cameras' shared ground plane: any word; m, cm and mm are known lengths."""

from __future__ import annotations

import difflib

UNITS_PER_METER = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""Units per meter."""
_SPELLINGS = {
    "m": ("meter", "meters", "metre", "metres"),
    "cm": ("centimeter", "centimeters", "centimetre", "centimetres"),
    "mm": ("millimeter", "millimeters", "millimetre", "millimetres"),
}
_MAX_SHOWN = 40
"""Characters of an invalid unit that an error repeats."""
_MIN_SIMILARITY = 0.8
"""Similarity (difflib's ratio) from which a word counts as a misspelled unit."""


def check_unit_spelling(unit: object) -> str:
    """Validate a unit; any word is accepted, except a misspelling of a metric unit.

    Raises:
        ValueError: it is not a word, or is a misspelling of m, cm or mm.
    """
    if not isinstance(unit, str) or not unit.strip() or not unit.isprintable():
        raise ValueError(f'{repr(unit)[:_MAX_SHOWN]} is not a unit; it is a word, such as "m"')
    if unit in UNITS_PER_METER:
        return unit
    word = unit.strip(" .").lower()
    names = {name: short for short, names in _SPELLINGS.items() for name in names}
    close = difflib.get_close_matches(word, names, n=1, cutoff=_MIN_SIMILARITY)
    suggestion = word if word in UNITS_PER_METER else names[close[0]] if close else None
    if suggestion is not None:
        raise ValueError(f"{unit!r} is not understood; did you mean {suggestion!r}?")
    return unit
