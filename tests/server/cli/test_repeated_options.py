"""A flag before several values: `--gt a b` is `--gt a --gt b`, and nothing else changes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.cli.repeated_options import one_value_per_flag
from server.system.errors import UserError

SEVERAL = {"evaluate": ("--gt", "--tracks")}
VALUES = st.lists(st.sampled_from(["a.txt", "b.txt", "c0", "-", "1"]), min_size=1, max_size=4)


@pytest.mark.parametrize(
    ("line", "same_as"),
    [
        ("evaluate --gt a b --tracks c d", "evaluate --gt a --gt b --tracks c --tracks d"),
        ("evaluate --gt a b", "evaluate --gt a --gt b"),
        ("evaluate --gt a b --iou 0.4 --tracks c", "evaluate --gt a --gt b --iou 0.4 --tracks c"),
        ("evaluate --gt a --gt b c", "evaluate --gt a --gt b c"),
        ("evaluate --gt=a b", "evaluate --gt=a b"),
        ("evaluate --gt=a --gt b c", "evaluate --gt=a --gt b c"),
        ("evaluate --gt a b -- c --gt d", "evaluate --gt a --gt b -- c --gt d"),
        ("evaluate -x --gt a -x", "evaluate -x --gt a -x"),
        ("track --gt a b", "track --gt a b"),
        ("--gt a b", "--gt a b"),
        ("", ""),
    ],
)
def test_a_flag_that_is_there_once_takes_all_up_to_the_next_option(line: str, same_as: str) -> None:
    assert one_value_per_flag(line.split(), SEVERAL) == same_as.split()


@pytest.mark.parametrize(
    "line", ["evaluate --gt", "evaluate --gt --tracks c d", "evaluate --gt -- a", "evaluate --gt a --gt"]
)
def test_a_flag_without_a_value_is_refused_before_it_takes_the_next_option_for_one(line: str) -> None:
    with pytest.raises(UserError, match=r"^evaluate: --gt: names no file$"):
        one_value_per_flag(line.split(), SEVERAL)


@given(VALUES, VALUES, st.booleans())
def test_both_ways_to_write_it_mean_the_same(truth: list[str], tracks: list[str], other: bool) -> None:
    between = ["--iou", "0.3"] if other else []
    short = ["evaluate", "--gt", *truth, *between, "--tracks", *tracks]
    long = one_value_per_flag(short, SEVERAL)
    assert long == [
        "evaluate",
        *(word for value in truth for word in ("--gt", value)),
        *between,
        *(word for value in tracks for word in ("--tracks", value)),
    ]
    if len(truth) > 1 and len(tracks) > 1:
        assert one_value_per_flag(long, SEVERAL) == long


@given(st.lists(st.sampled_from(["--gt", "--gt=a", "--tracks", "--iou", "0.5", "a", "b", "--", "-"])))
def test_no_word_is_lost_and_none_but_the_flags_is_added(words: list[str]) -> None:
    flags = ("--gt", "--tracks")
    end = words.index("--") if "--" in words else len(words)
    after = [*words[1:end], "--"]
    if any(it in flags and next_.startswith("--") for it, next_ in zip(words[:end], after, strict=False)):
        with pytest.raises(UserError):
            one_value_per_flag(["evaluate", *words], SEVERAL)
        return
    written = one_value_per_flag(["evaluate", *words], SEVERAL)
    assert [it for it in written if it not in flags] == ["evaluate", *(it for it in words if it not in flags)]
    assert written[len(written) - len(words[end:]) :] == words[end:]
