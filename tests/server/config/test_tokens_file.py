"""The token file, and the command that generates tokens."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fakes.cli.command_line import RunCommand, input_error
from fakes.http.tokens import IN_FUTURE, token_entry, write_tokens
from server.config.tokens_file import read_tokens, secret_digest
from server.system.errors import UserError

SUM = secret_digest("x")


def test_tokens_are_read_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = write_tokens(tmp_path / "tokens.yaml", *map(token_entry, ("lead", "desk", "family", "door")))
    tokens = read_tokens(path)
    assert [token.name for token in tokens] == ["lead", "desk", "family", "door"]
    assert [(token.role, token.object, token.camera) for token in tokens] == [
        ("operate", None, None),
        ("watch", None, None),
        ("watch", 1, None),
        ("watch", None, "c0"),
    ]


def test_a_file_without_tokens_permits_no_access(tmp_path: Path) -> None:
    assert read_tokens(write_tokens(tmp_path / "tokens.yaml")) == ()


@pytest.mark.parametrize(
    ("lines", "error"),
    [
        (
            [{"name": "a", "sha256": "short", "role": "watch"}],
            "tokens.0.sha256: is not the sum that `myview token` prints",
        ),
        (
            [{"name": "a", "sha256": SUM, "role": "own"}],
            "tokens.0.role: Input should be 'watch' or 'operate'",
        ),
        ([{"name": "a", "sha256": SUM}], "tokens.0.role: Field required"),
        ([{"name": "a", "sha256": SUM, "role": "watch", "view": "c0"}], "tokens.0.view: unknown key"),
        (
            [{"name": "a", "sha256": SUM, "role": "watch", 9000 * "9": 1}],
            f"tokens.0.{40 * '9'}…: unknown key",
        ),
        ([{"name": "a", "sha256": SUM, "role": "watch", "object": 3}], "tokens.0: made: is missing"),
        (
            [{"name": "a", "sha256": SUM, "role": "operate", "camera": "c0"}],
            "tokens.0: role: an operator sees",
        ),
        (
            [{"name": "a", "sha256": SUM, "role": "watch", "object": 3, "camera": "c0", "made": IN_FUTURE}],
            "tokens.0: object, camera: a token is limited to one",
        ),
        ([{"name": "a", "sha256": SUM, "role": "watch"}] * 2, "tokens.0 and tokens.1: have the same name, a"),
        (["a"], "tokens.0: Input should be a valid dictionary"),
        (
            [{"name": "a", "sha256": SUM, "role": "watch", "made": "2026-11-22"}],
            "tokens.0.made: Input should",
        ),
        ([{"name": "a\tb", "sha256": SUM, "role": "watch"}], "tokens.0.name: has 1 to 64 characters"),
        ([{"name": "a\nb", "sha256": SUM, "role": "watch"}], "tokens.0.name: has more than one line"),
    ],
)
def test_an_invalid_token_is_reported_in_one_line(tmp_path: Path, lines: list[Any], error: str) -> None:
    path = write_tokens(tmp_path / "tokens.yaml", *lines)
    with pytest.raises(UserError) as raised:
        read_tokens(path)
    assert str(raised.value).startswith(f"{path}: {error}")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "tokens: 3",
        "{tokens: [], more: 1}",
        "a: {",
        "\x00",
        "2026-99-99",
        "[" * 5000,
        "tokens: &a [*a]",
        "tokens: !!int x",
        "tokens: [{1: 2}]",
    ],
)
def test_an_invalid_token_file_is_reported_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "tokens.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as raised:
        read_tokens(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)


def test_a_missing_token_file_is_reported_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"none\.yaml: cannot read the tokens: No such file or directory"):
        read_tokens(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("options", "limits"),
    [
        ([], ("watch", None, None)),
        (["--operate"], ("operate", None, None)),
        (["--object", "3"], ("watch", 3, None)),
        (["--camera", "door"], ("watch", None, "door")),
    ],
)
def test_a_new_token_is_printed_with_its_line_for_the_file(
    myview: RunCommand, tmp_path: Path, options: list[str], limits: tuple[Any, ...]
) -> None:
    result = myview("token", "Ann's parents", *options)
    assert result.code == 0
    lines = result.out.splitlines()
    token, line = lines[1].strip(), lines[-1]
    assert len(token) == 43
    assert token not in line
    path = tmp_path / "tokens.yaml"
    path.write_text(f"tokens:\n{line}\n", encoding="utf-8")
    [read] = read_tokens(path)
    assert (read.name, read.sha256) == ("Ann's parents", secret_digest(token))
    assert (read.role, read.object, read.camera) == limits
    assert myview("token", "a").out.splitlines()[1].strip() != token


@pytest.mark.parametrize("options", [["--object", "3", "--camera", "c0"], ["--operate", "--object", "3"]])
def test_contradictory_options_are_refused(myview: RunCommand, options: list[str]) -> None:
    assert "token: " in input_error(myview("token", "a", *options))
