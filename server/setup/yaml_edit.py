"""Change of one section of a configuration's text; comments in the rest stay."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path
from typing import Any

import yaml

from server.config.loader import read_content
from server.config.yaml_file import dump_yaml

_INSIDE = re.compile(r"[ \t-]|$")
"""The start of a line that belongs to the section above: indented, or an entry of a list; or empty."""


def changed_text(path: Path, section: str, value: Any) -> str:
    """Return the text of a configuration file with another value of one section.

    Where the section cannot be told from the rest, such as in flow style, the whole file is written anew,
    without its comments.

    Raises:
        UserError: the file cannot be read, or is not valid YAML.
    """
    content = read_content(path)
    wanted = {**content, section: value}
    text = _replaced(path.read_text(encoding="utf-8"), section, dump_yaml({section: value}))
    with contextlib.suppress(yaml.YAMLError):
        if yaml.safe_load(text) == wanted:
            return text
    return f"# The earlier file, beside this one, has the comments.\n{dump_yaml(wanted)}"


def _replaced(text: str, section: str, lines: str) -> str:
    """Return a text with new lines for a section; they are appended if it has none."""
    old = text.splitlines(keepends=True)
    starts = [number for number, line in enumerate(old) if re.match(rf"{section}[ \t]*:", line)]
    if len(starts) != 1:
        return f"{text.rstrip()}\n\n{lines}" if not starts else ""
    first = end = starts[0]
    for number in range(first + 1, len(old)):
        if not old[number].startswith("#") and not _INSIDE.match(old[number]):
            break
        if old[number].strip() and not old[number].lstrip().startswith("#"):
            end = number
    return "".join([*old[:first], lines, *old[end + 1 :]])
