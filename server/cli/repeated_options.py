"""Options that take several values after one flag: `--gt a.txt b.txt`, as shells write `gt/*.txt`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from server.system.errors import UserError


def one_value_per_flag(words: Sequence[str], several: Mapping[str, Collection[str]]) -> list[str]:
    """Rewrite a command line so that each of its flags has one value, which is all that the parser knows.

    A flag that is there once takes all words up to the next option, or up to `--`. A flag that is repeated,
    or that is written `--gt=a.txt`, takes one value each time. Words behind `--` are never options.

    Args:
        words: the command line, the command first.
        several: which options take several values, by command.

    Returns:
        The same words, with such a flag in front of each of its values.

    Raises:
        UserError: a flag has no value; the parser would take the next option for one.
    """
    if not words:
        return []
    flags = several.get(words[0], ())
    end = words.index("--") if "--" in words else len(words)
    alone = {flag for flag in flags if sum(_is(word, flag) for word in words[:end]) == 1}
    written: list[str] = []
    taking: str | None = None
    for word, following in zip(words[:end], [*words[1:end], "--"], strict=True):
        if _is_option(word):
            if word in flags and _is_option(following):
                raise UserError(f"{words[0]}: {word}: names no file")
            taking = word if word in alone else None
            if taking is None:
                written.append(word)
        elif taking is not None:
            written += [taking, word]
        else:
            written.append(word)
    return written + list(words[end:])


def _is(word: str, flag: str) -> bool:
    return word == flag or word.startswith(f"{flag}=")


def _is_option(word: str) -> bool:
    """Tell whether a word is an option; a dash alone is a name that usually means standard input."""
    return word.startswith("-") and word != "-"
