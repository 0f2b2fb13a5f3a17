"""configs/demo.yaml has every setting with its default, and the other examples are consistent."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import BaseModel

from fakes.paths import CONFIGS
from server.cli.generated_config import DEMO
from server.config.loader import build_config, load_config
from server.config.sections import RuleSettings, WebhookSettings, ZoneSettings
from server.config.site_config import Config
from synthetic import Scene
from tracking import solver_names

REFERENCE = (CONFIGS / "demo.yaml").read_text(encoding="utf-8")
SETTING = re.compile(r"^( *)#(?=\w)", re.MULTILINE)


def uncommented() -> dict[str, Any]:
    """Read the reference with all commented defaults uncommented."""
    content = yaml.safe_load(SETTING.sub(r"\1", REFERENCE))
    assert isinstance(content, dict)
    return content


def keys_of(section: Any) -> list[str]:
    """List a section's settings in the order of the code."""
    if isinstance(section, BaseModel):
        return list(type(section).model_fields)
    return [field.name for field in dataclasses.fields(section)]


def is_section(value: Any) -> bool:
    return isinstance(value, BaseModel) or dataclasses.is_dataclass(value)


def compare(shown: Any, real: Any, place: str) -> list[str]:
    """Return how a section of the reference differs from the code's defaults."""
    wrong = [f"{place}{key}: is not a setting" for key in shown if key not in keys_of(real)]
    for key in keys_of(real):
        value = getattr(real, key)
        if key not in shown:
            wrong.append(f"{place}{key}: is missing; its default is {value!r}")
        elif is_section(value):
            wrong += compare(shown[key], value, f"{place}{key}.")
        elif shown[key] != (list(value) if isinstance(value, tuple) else value):
            wrong.append(f"{place}{key}: shows {shown[key]!r}, but its default is {value!r}")
    return wrong


def test_the_reference_shows_every_setting_with_its_default() -> None:
    shown, real = uncommented(), build_config(DEMO, where="demo", folder=Path())
    first, *_ = shown.pop("cameras")
    wrong = compare({**shown, "cameras": []}, real.model_copy(update={"cameras": []}), "")
    wrong += compare(first, real.cameras[0], "cameras.0.")
    assert not wrong, "configs/demo.yaml: " + "; ".join(wrong)


def test_the_reference_is_valid_with_all_settings_uncommented() -> None:
    assert build_config(uncommented(), where="demo.yaml", folder=CONFIGS) == load_config(
        CONFIGS / "demo.yaml"
    )


def test_every_setting_of_the_reference_is_explained() -> None:
    lines = REFERENCE.splitlines()
    bare = [
        line.strip()
        for above, line in zip(["", *lines], lines, strict=False)
        if SETTING.match(line) and not line.rstrip().endswith(":") and "  # " not in line
        if not above.lstrip().startswith("# ") and line.strip() not in {"#use: true", "#enabled: true"}
    ]
    assert not bare


@pytest.mark.parametrize("item", [ZoneSettings, RuleSettings, WebhookSettings])
def test_the_reference_has_every_setting_of_a_list(item: type[BaseModel]) -> None:
    """Lists are empty by default: their items are described in comments."""
    missing = [
        name
        for name in item.model_fields
        if not re.search(rf"^ *#  ? ?[- ] +{name}: ", REFERENCE, re.MULTILINE)
    ]
    assert missing == []


def test_the_reference_names_every_option_value() -> None:
    (line,) = [line for line in REFERENCE.splitlines() if line.strip().startswith("#solver:")]
    assert sorted(line.partition("  # ")[2].split(", ")) == sorted(solver_names())


@pytest.mark.parametrize("section", [name for name in Config.model_fields if name != "cameras"])
def test_the_reference_has_a_section_for(section: str) -> None:
    assert re.search(rf"^#?{section}:", REFERENCE, re.MULTILINE)


def test_replayed_views_have_the_homographies_of_the_scene() -> None:
    content = json.loads((CONFIGS / "room.ground.json").read_text(encoding="utf-8"))
    site = load_config(CONFIGS / "replay.yaml")
    scene = Scene("room", len(site.cameras), 4, 1, site.site.width, site.site.height, site.site.fps)
    for number, camera in enumerate(site.cameras):
        np.testing.assert_allclose(
            content["homography"][camera.id],
            scene.homography(number),
            atol=1e-7,
            err_msg="the scene has changed: `myview scene room --seconds 1 --out NEW` writes ground.json "
            "in NEW, which is to become configs/room.ground.json",
        )
        assert camera.ground == content["homography"][camera.id]


def test_live_example_has_each_kind_of_camera() -> None:
    sources = [camera.source for camera in load_config(CONFIGS / "rtsp.yaml").cameras]
    assert {source.partition(":")[0] for source in sources} == {"rtsp", "http", "/dev/video0"}
