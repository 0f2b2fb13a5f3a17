"""Change of sections of a configuration's text; comments in the rest stay."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from server.config.loader import read_content
from server.config.yaml_file import dump_yaml, dump_yaml_inline

_INSIDE = re.compile(r"[ \t-]|$")
"""The start of a line that belongs to the section above: indented, or an entry of a list; or empty."""


def changed_text(path: Path, section: str, value: Any) -> str:
    """Return the text of a configuration file with another value of one section.

    Where the section cannot be told from the rest, such as in flow style, the whole file is written anew,
    without its comments.

    Raises:
        UserError: the file cannot be read, or is not valid YAML.
    """
    wanted = {**read_content(path), section: value}
    text = path.read_text(encoding="utf-8")
    return _checked(_replaced(text, section, dump_yaml({section: value})), wanted)


def changed_lists_text(path: Path, lists: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return the text of a configuration file with other entries in some lists, each entry with an id.

    Entries keep their text and comments, except the values that change. One in flow style, or that cannot be
    changed in its place, becomes one line. Otherwise as :func:`changed_text`.

    Raises:
        UserError: the file cannot be read, or is not valid YAML.
    """
    content = read_content(path)
    text = path.read_text(encoding="utf-8")
    for section, entries in lists.items():
        if entries != (content.get(section) or []):
            text = _with_entries(text, section, content.get(section) or [], entries)
    return _checked(text, {**content, **{section: list(entries) for section, entries in lists.items()}})


def changed_entry_text(text: str, section: str, name: str, change: Callable[[str], str]) -> str:
    """Return a text in which a function has changed the comments in one entry, with an id, of a list.

    An entry in flow style, or whose content would change, stays as it is.
    """
    content = yaml.safe_load(text)
    lines = text.splitlines(keepends=True)
    span = _list_span(lines, section) or range(0)
    begin = span.start
    for each in _entry_texts(text, section, lines, span, content.get(section) or []):
        begin = text.index(each.above + each.lines, begin)
        if each.content.get("id") == name:
            begin += len(each.above)
            changed = f"{text[:begin]}{change(each.lines)}{text[begin + len(each.lines) :]}"
            return changed if yaml.safe_load(changed) == content else text
    return text


def changed_values_text(path: Path, sections: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the text of a configuration file with other values of some settings, by section.

    Values may be sections themselves. Lines of a section in block style keep their comments. Otherwise as
    :func:`changed_text`.

    Raises:
        UserError: the file cannot be read, or is not valid YAML.
    """
    content, text = dict(read_content(path)), path.read_text(encoding="utf-8")
    for section, values in sections.items():
        content[section] = _merged(content.get(section) or {}, values)
        text = _with_values(text, section, values, content)
    return text


def plain_numbers(value: Any) -> Any:
    """Return a value as people write it: whole numbers without a fraction, lists of lists."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return [plain_numbers(item) for item in value] if isinstance(value, list | tuple) else value


def _with_values(text: str, section: str, values: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    with contextlib.suppress(yaml.YAMLError):
        changed = text
        for place, value in _leaves(values, (section,)):
            changed = _with_value(changed, place, value)
        if yaml.safe_load(changed) == wanted:
            return changed
    return _checked(_replaced(text, section, dump_yaml({section: wanted[section]})), wanted)


def _with_value(text: str, place: Sequence[str], value: Any) -> str:
    """Return a text with another value of a setting that stands in it, in its place."""
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    for name in place:
        pairs = node.value if isinstance(node, yaml.MappingNode) else []
        node = next((inner for key, inner in pairs if key.value == name), None)
    if node is None:
        return text
    return _with_node(text, node, value)


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section with new values of some of its settings."""
    inner = {
        key: _merged(old.get(key) or {}, value) if isinstance(value, Mapping) else value
        for key, value in new.items()
    }
    return {**old, **inner}


def _leaves(values: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the settings that are no sections, each with the names that lead to it."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, (*place, key))
        else:
            yield (*place, key), value


def _checked(text: str, wanted: Mapping[str, Any]) -> str:
    """Return a text if it means what is wanted, else another one that does."""
    with contextlib.suppress(yaml.YAMLError):
        if _without_empty(yaml.safe_load(text)) == _without_empty(wanted):
            return text
    return f"# The earlier file, beside this one, has the comments.\n{dump_yaml(dict(wanted))}"


def _without_empty(content: Any) -> Any:
    """Return a configuration without its empty lists: a section that is empty may as well be absent."""
    return (
        {name: value for name, value in content.items() if value != []}
        if isinstance(content, Mapping)
        else content
    )


def _replaced(text: str, section: str, lines: str) -> str:
    """Return a text with new lines for a section; they are appended if it has none."""
    old = text.splitlines(keepends=True)
    span = _span(old, section)
    if span is None:
        return f"{text.rstrip()}\n\n{lines}"
    return "".join([*old[: span.start], lines, *old[span.stop :]]) if span else ""


def _span(lines: Sequence[str], section: str) -> range | None:
    """Return the lines of a section without comments after it; None: there is none; empty: there are two."""
    starts = [number for number, line in enumerate(lines) if re.match(rf"{section}[ \t]*:", line)]
    if len(starts) != 1:
        return range(0) if starts else None
    end = starts[0]
    for number in range(starts[0] + 1, len(lines)):
        if not lines[number].startswith("#") and not _INSIDE.match(lines[number]):
            break
        if _is_content(lines[number]):
            end = number
    return range(starts[0], end + 1)


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


@dataclass(frozen=True, slots=True)
class _EntryText:
    """An entry of a list in block style: the comments above it, and its own lines."""

    above: str
    lines: str
    content: Mapping[str, Any]


def _with_entries(
    text: str, section: str, old: Sequence[Mapping[str, Any]], entries: Sequence[Mapping[str, Any]]
) -> str:
    """Return a text with new entries of a list."""
    lines = text.splitlines(keepends=True)
    span = _list_span(lines, section)
    if not span:
        return _replaced(text, section, _list_text(text, section, range(0), old, entries))
    new = _list_text(text, section, span, old, entries)
    return "".join([*lines[: span.start], new, *lines[span.stop :]])


def _list_span(lines: Sequence[str], section: str) -> range | None:
    """Return the lines of a list, as :func:`_span`, with the comments that end its last entry."""
    span = _span(lines, section)
    if not span:
        return span
    dash = next((_column(line) for line in lines[span.start :] if line.lstrip(" ").startswith("-")), None)
    stop = span.stop
    while dash is not None and stop < len(lines) and _is_comment_inside(lines[stop], dash):
        stop += 1
    return range(span.start, stop)


def _column(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _is_comment_inside(line: str, dash: int) -> bool:
    """Return whether a line is a comment that is indented as what an entry, with its dash there, contains."""
    return line.lstrip(" ").startswith("#") and _column(line) > dash


def _list_text(
    text: str,
    section: str,
    span: range,
    old: Sequence[Mapping[str, Any]],
    entries: Sequence[Mapping[str, Any]],
) -> str:
    """Return the lines of a section with new entries."""
    if not entries:
        return f"{section}: []\n"
    lines = text.splitlines(keepends=True)
    known = _entry_texts(text, section, lines, span, old)
    names = {entry.get("id") for entry in entries}
    written = {each.content.get("id"): each for each in known}
    replaced = [
        each for each in known if each.content.get("id") not in names
    ]  # a renamed one keeps its comments
    first = known[0].lines if known else "  -"
    indent = " " * _column(first)
    head = lines[span.start] if known else f"{section}:\n"
    parts = [head]
    for entry in entries:
        found = written.get(entry.get("id"))
        if found is None and len(old) == len(entries) and replaced:
            found = replaced.pop(0)
        above = "" if found is None else found.above
        lines_of_entry = None if found is None else _entry_lines(found, entry)
        parts.append(above + (lines_of_entry or f"{indent}- {dump_yaml_inline(entry)}\n"))
    return "".join(parts)


def _entry_lines(found: _EntryText, wanted: Mapping[str, Any]) -> str | None:
    """Return the lines of an entry with other values in their places; None: they cannot be told apart."""
    if found.content == wanted:
        return found.lines
    with contextlib.suppress(yaml.YAMLError):
        root = yaml.compose(found.lines, Loader=yaml.SafeLoader)
        if isinstance(root, yaml.SequenceNode) and isinstance(root.value[0], yaml.MappingNode):
            changed = _with_pairs(found, root.value[0], wanted)
            if yaml.safe_load(changed) == [wanted]:
                return changed
    return None


def _with_pairs(found: _EntryText, node: yaml.MappingNode, wanted: Mapping[str, Any]) -> str:
    text = found.lines
    if node.flow_style:
        return _with_node(text, node, wanted)
    pairs = {key.value: (key, value) for key, value in node.value}
    for name, (key, value) in reversed(pairs.items()):
        if name not in wanted:
            after = text.find("\n", _content_end(text, value)) + 1
            text = text[: key.start_mark.index - key.start_mark.column] + text[after:]
        elif wanted[name] != found.content[name]:
            text = _with_node(text, value, wanted[name])
    indent = " " * node.start_mark.column
    new = (
        f"{indent}{name}: {dump_yaml_inline(value)}\n" for name, value in wanted.items() if name not in pairs
    )
    lines = text.splitlines(keepends=True)
    end = max(number for number, line in enumerate(lines) if _is_content(line)) + 1
    return "".join([*lines[:end], *new, *lines[end:]])


def _with_node(text: str, node: yaml.Node, value: Any) -> str:
    start, end = node.start_mark.index, _content_end(text, node)
    space = " " if start == end else ""  # there is no value
    return f"{text[:start]}{space}{dump_yaml_inline(value)}{text[end:]}"


def _content_end(text: str, node: yaml.Node) -> int:
    """Return where a node's text ends; one in block style takes in the lines until the next key."""
    start = node.start_mark.index
    lines = text[start : node.end_mark.index].splitlines(keepends=True)
    while lines and not _is_content(lines[-1]):
        lines.pop()
    return start + len("".join(lines).rstrip())


def _entry_texts(
    text: str, section: str, lines: Sequence[str], span: range, old: Sequence[Mapping[str, Any]]
) -> list[_EntryText]:
    """Return the entries of a section in block style; none if it is in another one."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    pairs = root.value if isinstance(root, yaml.MappingNode) else []
    node = next((value for key, value in pairs if key.value == section), None)
    if not isinstance(node, yaml.SequenceNode) or node.flow_style or len(node.value) != len(old):
        return []
    starts = [item.start_mark.line for item in node.value]
    begins = list[int]()
    for start in starts:
        begin = start
        while begin - 1 > span.start and not _is_content(lines[begin - 1]):
            if begins and _is_comment_inside(lines[begin - 1], _column(lines[start])):
                break  # it belongs to the entry before
            begin -= 1
        begins.append(begin)
    ends = [*begins[1:], span.stop]
    return [
        _EntryText("".join(lines[begin:start]), "".join(lines[start:end]), content)
        for begin, start, end, content in zip(begins, starts, ends, old, strict=True)
    ]
