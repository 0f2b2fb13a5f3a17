"""Reading YAML, whatever is in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from server.wire.errors import UserError

_SHOWN = 300
"""Characters of what a library says that a line of ours repeats."""
_MOST_MERGED = 100_000
"""Keys that merges (``<<``) bring into mappings; each may refer to all of one before."""


class _Loader(yaml.SafeLoader):
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
        return yaml.load(text, Loader=_Loader)  # noqa: S506 — the safe loader, made safer
    except yaml.YAMLError as error:
        # It names the file as it knows it, which is a string in memory.
        words = " ".join(str(error).split()).replace(' in "<unicode string>",', ",")
        raise UserError(f"{path}: is not valid YAML: {words[:_SHOWN]}") from error
    except RecursionError as error:
        raise UserError(f"{path}: is not valid YAML: brackets within brackets without end") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:  # how PyYAML says `!!int x` is none
        raise UserError(f"{path}: is not valid YAML: a date, a number or a tag that cannot be one") from error
