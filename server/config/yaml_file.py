"""Safe reading and writing of YAML."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from server.config.duplicate_keys import DuplicateKeyError, check_yaml_keys
from server.system.errors import UserError

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

_QUOTED = re.compile(r" '[^'<>]{2,}'")
"""A name from the file in a library's words, such as a tag's; ``'<block end>'`` and ``']'`` are none."""

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
        return _loaded(text)
    except DuplicateKeyError as error:
        raise UserError(f"{path}: {error}") from error
    except yaml.YAMLError as error:
        raise UserError(f"{path}: is not valid YAML: {_words(error)[:_SHOWN]}") from None
    except (ValueError, LookupError, TypeError, AttributeError):  # how PyYAML says `!!int x` is none
        raise UserError(f"{path}: is not valid YAML: a date, a number or a tag that cannot be one") from None


def _loaded(text: str) -> Any:
    """Return what a text stands for.

    Raises:
        DuplicateKeyError: a mapping in it has a key twice.
        yaml.YAMLError: it is no YAML.
        ValueError, LookupError, TypeError, AttributeError: a value is not of the kind that it says it is.
    """
    loader = _Loader(text)
    try:
        root = loader.get_single_node()
        if root is None:
            return None
        check_yaml_keys(root, loader.construct_object)
        return loader.construct_document(root)
    finally:
        loader.dispose()


def _words(error: yaml.YAMLError) -> str:
    """Describe a YAML error with its position, without content of the file, which may be a password."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return " ".join(str(error).replace(' in "<unicode string>"', "").split())
    parts = []
    for words, mark in ((error.context, error.context_mark), (error.problem, error.problem_mark)):
        if words is not None:
            place = "" if mark is None else f", line {mark.line + 1}, column {mark.column + 1}"
            parts.append(f"{_QUOTED.sub('', words)}{place}")
    return " ".join(" ".join(parts).split())


def dump_yaml_inline(value: Any) -> str:
    """Write a value as it may stand behind its key."""
    written: str = yaml.dump(value, Dumper=SafeDumper, default_flow_style=True, width=_WIDTH)
    return written.removesuffix("\n...\n").strip()


def dump_yaml(content: Any) -> str:
    """Write what a file holds, a line each, in its own order."""
    written: str = yaml.dump(content, Dumper=SafeDumper, sort_keys=False)
    return written


def _check_depth(text: str) -> None:
    """Check that lists in lists end somewhere, before anything is made of them.

    Raises:
        yaml.YAMLError: they do not, or the text is no YAML.
    """
    depth = 0
    for event in yaml.parse(text, Loader=SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise yaml.YAMLError("brackets within brackets without end")
