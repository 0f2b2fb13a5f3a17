"""Safe reading and writing of YAML."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from server.config.duplicate_keys import DuplicateKeyError, check_yaml_keys
from server.system.errors import UserError, reason_of

try:
    from yaml import CSafeDumper as SafeDumper  # libyaml's: five times as fast
    from yaml import CSafeLoader as SafeLoader
except ImportError:  # PyYAML was built without it
    from yaml import SafeDumper, SafeLoader  # type: ignore[assignment]

_SHOWN = 300
"""Characters of a library's message that an error repeats."""
_MAX_MERGED_KEYS = 100_000
"""Most keys that merges (``<<``) may add to mappings: nested merges multiply them."""
_MAX_DEPTH = 200
"""Nesting depth beyond which libyaml's recursive loader could overflow the stack."""

_QUOTED = re.compile(r" '[^'<>]{2,}'")
"""A quoted name from the file in a library's message; not ``'<block end>'`` and ``']'``."""

_WIDTH = 10_000
"""Line width of YAML written for one line."""


class _Loader(SafeLoader):
    """The safe loader with a limit on merged keys."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._merged = 0

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Merge, and count the keys."""
        super().flatten_mapping(node)
        self._merged += len(node.value)
        if self._merged > _MAX_MERGED_KEYS:
            raise yaml.YAMLError("merges (<<) that expand to too many keys")


def read_yaml(path: Path, label: str) -> Any:
    """Read a file's content; ``label`` names it in errors.

    Raises:
        UserError: it cannot be read, or is not valid YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = reason_of(error)
        raise UserError(f"{path}: cannot read {label}: {reason}") from error
    try:
        _check_depth(text)
        return _loaded(text)
    except DuplicateKeyError as error:
        raise UserError(f"{path}: {error}") from error
    except yaml.YAMLError as error:
        raise UserError(f"{path}: is not valid YAML: {_describe(error)[:_SHOWN]}") from None
    except (ValueError, LookupError, TypeError, AttributeError):  # raised by PyYAML for `!!int x`
        raise UserError(f"{path}: is not valid YAML: an invalid date, number or tag") from None


def _loaded(text: str) -> Any:
    """Load a YAML text.

    Raises:
        DuplicateKeyError: a mapping in it has a key twice.
        yaml.YAMLError: it is not valid YAML.
        ValueError, LookupError, TypeError, AttributeError: a value does not fit its tag.
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


def _describe(error: yaml.YAMLError) -> str:
    """Describe a YAML error and its position, without the file's content, which may be a password."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return " ".join(str(error).replace(' in "<unicode string>"', "").split())
    parts = []
    for words, mark in ((error.context, error.context_mark), (error.problem, error.problem_mark)):
        if words is not None:
            place = "" if mark is None else f", line {mark.line + 1}, column {mark.column + 1}"
            parts.append(f"{_QUOTED.sub('', words)}{place}")
    return " ".join(" ".join(parts).split())


def dump_yaml_inline(value: Any) -> str:
    """Dump a value in flow style, for one line after its key, mappings in their own order."""
    written: str = yaml.dump(
        value,
        Dumper=SafeDumper,
        default_flow_style=True,
        width=_WIDTH,
        sort_keys=False,
        allow_unicode=True,
    )
    return written.removesuffix("\n...\n").strip()


def dump_yaml(content: Any) -> str:
    """Dump a mapping in block style, in its own order."""
    written: str = yaml.dump(content, Dumper=SafeDumper, sort_keys=False, allow_unicode=True)
    return written


def _check_depth(text: str) -> None:
    """Check the nesting depth before anything is constructed.

    Raises:
        yaml.YAMLError: it is too deep, or not valid YAML.
    """
    depth = 0
    for event in yaml.parse(text, Loader=SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            raise yaml.YAMLError("brackets nested too deeply")
