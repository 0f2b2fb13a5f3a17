"""Reading YAML, whatever is in the file; and writing a value of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from server.wire.errors import UserError

try:
    from yaml import CSafeDumper as SafeDumper  # libyaml's: five times as fast
    from yaml import CSafeLoader as SafeLoader
except ImportError:  # PyYAML was built without it
    from yaml import SafeDumper, SafeLoader  # type: ignore[assignment]

_SHOWN = 300
"""Characters of what a library says that a line of ours repeats."""
_MOST_MERGED = 100_000
"""Keys that merges (``<<``) bring into mappings; each may refer to all of one before."""
_DEEPEST = 200
"""Lists in lists: libyaml's loader calls itself for each, and with many the process would die."""

_WIDTH = 1000
"""Characters after which what is written is folded."""


class _Loader(SafeLoader):
    """The safe loader, in which a few lines cannot stand for keys without end."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._merged = 0

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Merge, and count."""
        super().flatten_mapping(node)
        self._merged += len(node.value)
        if self._merged > _MOST_MERGED:
            raise yaml.YAMLError("merges (<<) that stand for more keys than any file of ours has")


def read_yaml(path: Path, what: str) -> Any:
    """Read a file's content; ``what`` names it for people.

    Raises:
        UserError: it cannot be read, or is no YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise UserError(f"{path}: cannot read {what}: {reason}") from error
    try:
        _check_depth(text)
        return yaml.load(text, Loader=_Loader)  # noqa: S506 — the safe loader, made safer
    except yaml.YAMLError as error:
        # It names the file as it knows it, which is a string in memory.
        words = " ".join(str(error).split()).replace(' in "<unicode string>",', ",")
        raise UserError(f"{path}: is not valid YAML: {words[:_SHOWN]}") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:  # how PyYAML says `!!int x` is none
        raise UserError(f"{path}: is not valid YAML: a date, a number or a tag that cannot be one") from error


def one_line(value: Any) -> str:
    """Write a value as it may stand behind its key."""
    written: str = yaml.dump(value, Dumper=SafeDumper, default_flow_style=True, width=_WIDTH)
    return written.removesuffix("...\n").strip()


def as_lines(content: Any) -> str:
    """Write what a file holds, a line each, in its own order."""
    written: str = yaml.dump(content, Dumper=SafeDumper, sort_keys=False)
    return written


def _check_depth(text: str) -> None:
    """Look that lists in lists end somewhere, before anything is made of them.

    Raises:
        YAMLError: they do not, or the text is no YAML.
    """
    depth = 0
    for event in yaml.parse(text, Loader=SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise yaml.YAMLError("brackets within brackets without end")
