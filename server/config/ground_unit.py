"""The unit of the floor that cameras share: a word, of which three say how long something is."""

from __future__ import annotations

import difflib

UNITS_PER_METER = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""So many of each are a metre."""
_MEANT = {
    "m": ("meter", "meters", "metre", "metres"),
    "cm": ("centimeter", "centimeters", "centimetre", "centimetres"),
    "mm": ("millimeter", "millimeters", "millimetre", "millimetres"),
}
_SHOWN = 40
"""Characters of what is no unit that an error repeats."""
_CLOSE = 0.8
"""How like one of these a word is that was meant for it (difflib's ratio)."""


def check_unit(unit: object) -> str:
    """Return the unit; any word is accepted, except a misspelling of a metric one.

    Raises:
        ValueError: in one line: it is no word, or another way to write m, cm or mm.
    """
    if not isinstance(unit, str) or not unit.strip() or not unit.isprintable():
        raise ValueError(f'{repr(unit)[:_SHOWN]} is no unit; it is a word, such as "m"')
    if unit in UNITS_PER_METER:
        return unit
    word = unit.strip(" .").lower()
    names = {name: short for short, names in _MEANT.items() for name in names}
    close = difflib.get_close_matches(word, names, n=1, cutoff=_CLOSE)
    meant = word if word in UNITS_PER_METER else names[close[0]] if close else None
    if meant is not None:
        raise ValueError(f"{unit!r} is not understood; did you mean {meant!r}?")
    return unit
