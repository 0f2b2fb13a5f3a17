"""Detection of duplicate keys in YAML and JSON, of which parsers silently keep the last one.

A second ``access:`` section, pasted from a document, would drop the tokens and open the site.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Hashable
from typing import Any

import yaml

from server.config.values import redact_and_abbreviate

_NO_VALUES = frozenset({"tag:yaml.org,2002:merge", "tag:yaml.org,2002:value"})
"""Tags of the keys ``<<`` and ``=``, which have no value."""
_JSON_TOKEN = re.compile(r'("(?:[^"\\]|\\.)*")(\s*:)?|[{}]', re.DOTALL)
"""Matches whole strings and braces of valid JSON; group 2 is set for keys."""


class DuplicateKeyError(ValueError):
    """A mapping has a key twice; the text names the key and both lines."""

    def __init__(self, key: str, first: int, second: int) -> None:
        lines = f"lines {first} and {second}" if first != second else f"line {first}"
        super().__init__(
            f"{redact_and_abbreviate(key)!a} occurs twice, in {lines}; only the last would count: merge them"
        )


def check_yaml_keys(root: yaml.Node, value_of: Callable[[yaml.Node], Any]) -> None:
    """Check that no mapping has a key twice; keys from merges (``<<``) may be overridden.

    Keys are equal if their texts or values are: ``1``, ``"1"`` and ``0x1``. ``value_of`` returns the value of
    a scalar.

    Raises:
        DuplicateKeyError: a mapping has a key twice.
    """
    left, seen = [root], set[int]()
    while left:
        node = left.pop()
        if id(node) in seen:  # an alias
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            left += reversed(node.value)
        elif isinstance(node, yaml.MappingNode):
            _check_yaml_mapping(node, value_of)
            left += [child for pair in reversed(node.value) for child in reversed(pair)]


def _check_yaml_mapping(node: yaml.MappingNode, value_of: Callable[[yaml.Node], Any]) -> None:
    lines: dict[Hashable, int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue  # the loader refuses such a key
        value = key.value if key.tag in _NO_VALUES else value_of(key)
        line = key.start_mark.line + 1
        forms: set[Hashable] = {key.value, str(value), value}
        for form in forms & lines.keys():
            raise DuplicateKeyError(key.value, lines[form], line)
        lines |= dict.fromkeys(forms, line)


def parse_json(text: str) -> Any:
    """Parse JSON in which no object has a key twice.

    Raises:
        DuplicateKeyError: an object has a key twice.
        ValueError, RecursionError: it is not valid JSON; from :func:`json.loads`.
    """
    content = json.loads(text)
    open_objects: list[dict[str, int]] = []
    line, end = 1, 0
    for token in _JSON_TOKEN.finditer(text):
        line, end = line + text.count("\n", end, token.start()), token.start()
        if token[0] == "{":
            open_objects.append({})
        elif token[0] == "}":
            open_objects.pop()
        elif token[2] is not None:
            key, lines = json.loads(token[1]), open_objects[-1]
            if key in lines:
                raise DuplicateKeyError(key, lines[key], line)
            lines[key] = line
    return content
