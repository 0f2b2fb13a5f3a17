"""Duplicate keys in files are refused with both lines: parsers would keep only the last."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.duplicate_keys import DuplicateKeyError, parse_json
from server.config.loader import build_config, load_config
from server.config.tokens_file import read_tokens
from server.config.yaml_file import read_yaml
from server.service.calibration.points_file import read_points
from server.system.errors import UserError

SITE = """\
cameras:
  - {id: c0, source: c0.mp4}
access:
  tokens: tokens.yaml
"""
SUM = "0" * 64


def refusal(folder: Path, text: str) -> str:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=r"site\.yaml: ") as refused:
        read_yaml(path, "the configuration")
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_a_duplicate_section_does_not_silently_drop_the_tokens(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(f"{SITE}http:\n  host: 0.0.0.0\naccess:\n  open_to_all: true\n")
    with pytest.raises(UserError, match=r"site\.yaml: 'access' occurs twice, in lines 3 and 7") as refused:
        load_config(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a:\n  b: 1\n  c: 2\n  b: 3\n", "'b' occurs twice, in lines 2 and 4"),
        ("a: [{b: 1, b: 2}]\n", "'b' occurs twice, in line 1"),
        ("- {a: {b: {c: 1,\n  d: 2,\n  c: 3}}}\n", "'c' occurs twice, in lines 1 and 3"),
        ('1: a\n"1": b\n', "'1' occurs twice, in lines 1 and 2"),
        ("16: a\n0x10: b\n", "'0x10' occurs twice, in lines 1 and 2"),
        ("yes: a\ntrue: b\n", "'true' occurs twice, in lines 1 and 2"),
        ("1: a\n1.0: b\n", "'1.0' occurs twice, in lines 1 and 2"),
        ("~: a\nnull: b\n", "'null' occurs twice, in lines 1 and 2"),
        ("a: 1\n'a': 2\n", "'a' occurs twice, in lines 1 and 2"),
        ("a: 1\n? a\n: 2\n", "'a' occurs twice, in lines 1 and 2"),
        ("x: &x {a: 1}\ny: &y {a: 2}\nz:\n  <<: *x\n  <<: *y\n", "'<<' occurs twice, in lines 4 and 5"),
        ("x: &x {a: 1, a: 2}\ny: {<<: *x}\n", "'a' occurs twice, in line 1"),
        ("!!set {a, b, a}\n", "'a' occurs twice, in line 1"),
    ],
)
def test_a_duplicate_key_is_refused_with_its_lines(tmp_path: Path, text: str, reason: str) -> None:
    assert reason in refusal(tmp_path, text)


def test_merged_keys_may_be_overridden(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(
        "usual: &usual {fps: 25, at_end: loop}\n"
        "other: &other {fps: 30}\n"
        "a: {<<: *usual, fps: 5}\n"
        "b: {fps: 6, <<: [*other, *usual]}\n"
        "c: &c {<<: *usual, at_end: stop}\n"
        "d: {<<: *c}\n"
        "again: [*c, *c]\n"
    )
    read: Mapping[str, Any] = read_yaml(path, "it")
    assert read["a"] == {"fps": 5, "at_end": "loop"}
    assert read["b"] == {"fps": 6, "at_end": "loop"}
    assert read["c"] == read["d"] == {"fps": 25, "at_end": "stop"}
    assert read["again"] == [read["c"], read["c"]]


KEYS = st.dictionaries(st.text('abc\u00e4"\\\n{}:', max_size=4), st.integers(), max_size=4)
NESTED = st.recursive(KEYS, lambda inner: st.dictionaries(st.text("abc", max_size=2), inner, max_size=3))


@given(NESTED, st.sampled_from([None, 1]))
def test_json_without_duplicates_is_read_unchanged(content: Any, indent: int | None) -> None:
    assert parse_json(json.dumps(content, indent=indent)) == content


@given(NESTED, KEYS.filter(bool), st.data())
def test_a_duplicate_json_key_is_found_at_any_depth(content: Any, inner: Any, data: st.DataObject) -> None:
    key = data.draw(st.sampled_from(sorted(inner)))
    twice = json.dumps(inner)[:-1] + f", {json.dumps(key)}: 0}}"
    text = '{\n"around": ' + json.dumps([content]) + ',\n"here":\n' + twice + "\n}"
    assert json.loads(text)["here"] == {**inner, key: 0}
    with pytest.raises(DuplicateKeyError, match="occurs twice, in line 4"):
        parse_json(text)


def test_a_duplicate_camera_in_a_ground_file_is_refused_with_both_lines(tmp_path: Path) -> None:
    matrix = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    text = f'{{"homography": {{\n"c0": {matrix},\n"c1": {matrix},\n"c\\u0030": {matrix}}}}}'
    (tmp_path / "ground.json").write_text(text)
    content = {"cameras": [{"id": "c0", "source": "c0.mp4"}], "ground": "ground.json"}
    with pytest.raises(UserError, match=r"ground: .*ground\.json: 'c0' occurs twice, in lines 2 and 4"):
        build_config(content, where="site.yaml", folder=tmp_path)


def test_a_duplicate_camera_in_a_points_file_is_refused_with_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "points.json"
    path.write_text('{"cameras": {\n"c0": [{"image": [1, 2], "floor": [3, 4]}],\n"c0": []}}')
    with pytest.raises(UserError, match=r"points\.json: 'c0' occurs twice, in lines 2 and 3"):
        read_points(path)


def test_a_duplicate_column_in_a_points_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("camera,image_x,image_y,floor_x,floor_y,image_x\nc0,1,2,3,4,5\n")
    with pytest.raises(UserError, match=r"points\.csv:1: has two columns 'image_x'"):
        read_points(path)


def test_a_duplicate_key_in_a_token_is_refused_with_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "tokens.yaml"
    path.write_text(f"tokens:\n- name: a\n  sha256: '{SUM}'\n  role: watch\n  role: operate\n")
    with pytest.raises(UserError, match=r"tokens\.yaml: 'role' occurs twice, in lines 4 and 5"):
        read_tokens(path)


def test_a_duplicate_list_of_tokens_is_refused_with_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "tokens.yaml"
    path.write_text(f"tokens:\n- {{name: a, sha256: '{SUM}', role: watch}}\ntokens: []\n")
    with pytest.raises(UserError, match=r"tokens\.yaml: 'tokens' occurs twice, in lines 1 and 3"):
        read_tokens(path)


@pytest.mark.parametrize(
    ("variables", "reason"),
    [
        (
            {"MYVIEW_ACCESS__TOKENS": "a.yaml", "MYVIEW_access__tokens": ""},
            "MYVIEW_ACCESS__TOKENS and MYVIEW_access__tokens both set access.tokens",
        ),
        (
            {"MYVIEW_ACCESS__TOKENS": "a.yaml", "myview_Access__Tokens": "b.yaml"},
            "MYVIEW_ACCESS__TOKENS and myview_Access__Tokens both set access.tokens",
        ),
        (
            {"MYVIEW_ACCESS": '{"tokens": null}', "MYVIEW_ACCESS__TOKENS": "a.yaml"},
            "MYVIEW_ACCESS and MYVIEW_ACCESS__TOKENS both set access.tokens",
        ),
        (
            {"MYVIEW_VIEW": '{"flags": {"risk": 1}}', "MYVIEW_VIEW__FLAGS__RISK": "0"},
            "MYVIEW_VIEW and MYVIEW_VIEW__FLAGS__RISK both set view.flags.risk",
        ),
        ({"MYVIEW_GROUND": "a", "MYVIEW_ground": "b"}, "MYVIEW_GROUND and MYVIEW_ground both set ground"),
        ({"MYVIEW_ACCESS": '{"tokens": "a", "tokens": null}'}, "MYVIEW_ACCESS: 'tokens' occurs twice"),
        ({"myview_htp__port": "1"}, "myview_htp__port: there is no section 'htp'"),
    ],
)
def test_a_setting_twice_in_the_environment_is_refused(
    variables: dict[str, str], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(UserError, match=r"site\.yaml: environment: ") as refused:
        build_config({"cameras": [{"id": "c0", "source": "a"}]}, where="site.yaml", folder=Path())
    assert reason in str(refused.value)


def test_parts_of_a_section_may_come_from_several_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_HTTP", '{"host": "127.0.0.2"}')
    monkeypatch.setenv("myview_http__port", "9999")
    monkeypatch.setenv("MYVIEW_LOG", "DEBUG")
    config = build_config({"cameras": [{"id": "c0", "source": "a"}]}, where="site.yaml", folder=Path())
    assert (config.http.host, config.http.port) == ("127.0.0.2", 9999)
