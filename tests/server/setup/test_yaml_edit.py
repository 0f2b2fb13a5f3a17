"""Sections of a configuration are changed; the rest of the text stays as it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from fakes.paths import CONFIGS
from server.config.loader import load_config
from server.setup.ground import apply_ground
from server.setup.yaml_edit import changed_text, changed_values_text
from server.system.errors import UserError

GROUND = json.dumps({"unit": "m", "homography": {"c0": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}})
TEXT = """\
# a site
site: {name: hall}

cameras:
- id: c0
  source: scene:room  # a comment
# between
- {id: c1, source: scene:room}

# after
view:
  switch_cost_s: 1.0
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("section", "value"),
    [
        ("site", {"name": "yard"}),
        ("cameras", [{"id": "c9", "source": "scene:room"}]),
        ("view", {"switch_cost_s": 2.0}),
        ("ground", "ground.json"),
    ],
)
def test_a_section_is_replaced_or_added_and_the_comments_of_others_stay(
    tmp_path: Path, section: str, value: Any
) -> None:
    text = changed_text(write(tmp_path, TEXT), section, value)
    assert yaml.safe_load(text) == {**yaml.safe_load(TEXT), section: value}
    assert "# a site" in text
    assert ("# after" in text) == (section != "nothing")


def test_flow_style_is_written_anew(tmp_path: Path) -> None:
    text = changed_text(
        write(tmp_path, "{site: {name: x}, cameras: [{id: c0, source: 'scene:room'}]}"), "site", {}
    )
    assert yaml.safe_load(text)["site"] == {}


@pytest.mark.parametrize("name", ["demo", "replay", "rtsp", "secure"])
def test_the_examples_keep_their_comments(tmp_path: Path, name: str) -> None:
    example = (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")
    text = changed_text(write(tmp_path, example), "ground", "new.json")
    assert yaml.safe_load(text) == {**yaml.safe_load(example), "ground": "new.json"}
    assert text.count("#") >= example.count("#") - 2


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"a # b"   # the name', "'x # y'   # the name"),
        ("'a: \"b\"'  # the name", "'x # y'  # the name"),
        ("hall  # the name: a # b", "'x # y'  # the name: a # b"),
        ("hall#1", "'x # y'"),
        ("   # the name", "'x # y'    # the name"),
    ],
)
def test_a_value_is_replaced_whole_and_its_comment_stays(tmp_path: Path, before: str, after: str) -> None:
    text = "site:\n  width: 640\n  name: {}\n  # other\nrules: [{{name: a}}]\n"
    path = write(tmp_path, text.format(before))
    assert changed_values_text(path, {"site": {"name": "x # y"}}) == text.format(after)


@pytest.mark.parametrize(
    "site",
    ["name: |\n    hall\n    b\n", "name: &n hall\n  other: *n\n", "name:\n    - a  # first\n", "other: 1\n"],
)
def test_a_value_in_any_style_is_replaced(tmp_path: Path, site: str) -> None:
    text = f"# mine\nsite:\n  {site}view: {{name: b}}\n"
    changed = changed_values_text(write(tmp_path, text), {"site": {"name": "x # y"}})
    content = yaml.safe_load(text)
    assert yaml.safe_load(changed) == {**content, "site": {**content["site"], "name": "x # y"}}


KEYS = st.sampled_from(["site", "cameras", "view", "ground"])
VALUES = st.recursive(
    st.one_of(st.integers(), st.text(max_size=8), st.booleans()),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(min_size=1, max_size=4), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(st.dictionaries(KEYS, VALUES, min_size=1), KEYS, VALUES, st.booleans())
def test_any_change_means_what_was_wanted(
    tmp_path_factory: pytest.TempPathFactory, content: dict[str, Any], section: str, value: Any, flow: bool
) -> None:
    path = write(tmp_path_factory.mktemp("edit"), yaml.safe_dump(content, default_flow_style=flow))
    assert yaml.safe_load(changed_text(path, section, value)) == {**content, section: value}


def test_a_calibration_is_named_by_the_configuration_and_earlier_files_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path, TEXT)
    applied = apply_ground(path, GROUND)
    assert applied.kept is not None
    assert applied.kept.read_text() == TEXT
    assert load_config(path).camera("c0").ground is not None
    again = apply_ground(path, GROUND.replace("1", "2"))
    assert (again.ground, again.kept) == (applied.ground, None)
    assert len(list(tmp_path.glob("site.ground*.json"))) == 2


def test_a_calibration_that_would_have_no_effect_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, TEXT.replace("  source", "  ground: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n  source"))
    with pytest.raises(UserError, match=r"cameras\.c0\.ground would take precedence"):
        apply_ground(path, GROUND)
    assert [file.name for file in tmp_path.iterdir()] == ["site.yaml"]
