"""A configuration is valid, or refused with a one-line error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from fakes.paths import ROOT
from server.cli.generated_config import DEMO
from server.config.loader import build_config, load_config
from server.system.errors import UserError


def site(**changes: Any) -> dict[str, Any]:
    return {"cameras": [{"id": "c0", "source": "c0.mp4"}, {"id": "c1", "source": "c1.mp4"}], **changes}


def error_of(content: dict[str, Any], folder: Path = Path()) -> str:
    with pytest.raises(UserError) as caught:
        build_config(content, where="site.yaml", folder=folder)
    text = str(caught.value)
    assert "\n" not in text, "an error is one line"
    assert text.startswith("site.yaml: ")
    return text


def test_an_unknown_key_is_refused_with_a_suggestion() -> None:
    assert "cameras.0.sourc: unknown key; did you mean 'source'?" in error_of(
        {"cameras": [{"id": "c0", "source": "x", "sourc": "y"}]}
    )
    assert "http.prt: unknown key; did you mean 'port'?" in error_of(site(http={"prt": 1}))


def test_an_unknown_key_in_nested_settings_is_refused() -> None:
    assert "did you mean 'stride_s'?" in error_of(site(track={"window": {"strid": 5}}))
    assert "unknown key" in error_of(site(detect={"median": {"no_such": 5}}))


@pytest.mark.parametrize(
    ("detect", "expected"),
    [
        ({"prescan_every_s": 0}, "detect: prescan_every_s must be above 0, not 0"),
        ({"prescan_s": -1}, "detect: prescan_s is at least 0, not -1"),
    ],
)
def test_impossible_times_of_the_prescan_are_refused(detect: dict[str, Any], expected: str) -> None:
    assert expected in error_of(site(detect=detect))


@pytest.mark.parametrize(
    ("detect", "reason"),
    [
        ({"gray_bins": 0}, "gray_bins must be 1 to 256, not 0"),
        ({"work_width": 0}, "work_width must be at least 1, not 0"),
        ({"median": {"samples": 0}}, "samples must be at least 1, not 0"),
        ({"median": {"learn_every_s": 0}}, "learn_every_s must be above 0, not 0"),
        ({"median": {"bootstrap_s": 0}}, "bootstrap_s must be above 0, not 0"),
        ({"static_foreground": {"check_every_s": 0}}, "check_every_s must be above 0, not 0"),
    ],
)
def test_counts_of_zero_are_refused(detect: dict[str, Any], reason: str) -> None:
    assert reason in error_of(site(detect=detect))


def test_duplicate_camera_ids_are_refused() -> None:
    cameras = [{"id": "c0", "source": "a"}, {"id": "c0", "source": "b"}]
    assert "two cameras are called 'c0'" in error_of({"cameras": cameras})


def test_homography_that_is_not_invertible_is_refused_with_its_camera() -> None:
    flat = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 0.0, 1.0]]
    text = error_of({"cameras": [{"id": "door", "source": "a", "ground": flat}]})
    assert "camera door" in text
    assert "not invertible" in text


def test_homographies_of_a_ground_file_are_validated(tmp_path: Path) -> None:
    (tmp_path / "ground.json").write_text('{"homography": {"c0": [[1, 0], [0, 1]]}}')
    assert "camera c0" in error_of(site(ground="ground.json"), tmp_path)
    (tmp_path / "ground.json").write_text("not json")
    assert "is not JSON" in error_of(site(ground="ground.json"), tmp_path)
    assert "No such file" in error_of(site(ground="absent.json"), tmp_path)


@pytest.mark.parametrize(
    ("unit", "suggestion"),
    [("M", "m"), ("metres", "m"), ("meteres", "m"), ("Cm", "cm"), ("millimeter", "mm")],
)
def test_a_misspelled_metric_unit_is_refused_with_a_suggestion(
    unit: str, suggestion: str, tmp_path: Path
) -> None:
    reason = f"{unit!r} is not understood; did you mean {suggestion!r}?"
    cameras = [{"id": "c0", "source": "a", "ground_unit": unit}]
    assert f"cameras.0.ground_unit: {reason}" in error_of({"cameras": cameras})
    (tmp_path / "ground.json").write_text(json.dumps({"unit": unit, "homography": {}}))
    assert f"unit: {reason}" in error_of(site(ground="ground.json"), tmp_path)


@pytest.mark.parametrize("unit", [1, "", ["m"]])
def test_an_invalid_unit_is_refused(unit: Any, tmp_path: Path) -> None:
    (tmp_path / "ground.json").write_text(json.dumps({"unit": unit, "homography": {}}))
    assert f"unit: {unit!r} is not a unit" in error_of(site(ground="ground.json"), tmp_path)


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "ft", "grid (of 358 x 360)", "person"])
def test_any_other_word_is_a_unit(unit: str) -> None:
    cameras = [{"id": "c0", "source": "a", "ground_unit": unit}]
    assert build_config({"cameras": cameras}, where="", folder=Path()).cameras[0].ground_unit == unit


def test_a_mirrored_homography_is_refused_with_its_camera() -> None:
    level = [[3.0, 0.0, -960.0], [0.0, 0.0, 1200.0], [0.0, 1.0, -240.0]]
    down = [[0.02, 0.0, 0.0], [0.0, -0.02, 0.0], [0.0, 0.0, 1.0]]
    past = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 900.0]]
    grounds_by_camera = {"c0": level, "c1": down, "c2": [[-value for value in row] for row in level]}

    def cameras(grounds: dict[str, Any]) -> dict[str, Any]:
        return {"cameras": [{"id": camera, "source": "a", "ground": of} for camera, of in grounds.items()]}

    build_config(cameras(grounds_by_camera), where="", folder=Path())
    assert "ground: camera c9 has the floor mirrored against camera c0: " in error_of(
        cameras(grounds_by_camera | {"c9": past})
    )


def test_the_lookahead_must_cover_the_stages_of_temporal_consistency() -> None:
    track = {"tracker": "temporal", "temporal": {"window_stages": 2, "stage_s": 0.4}}
    wrong = error_of(site(view={"lookahead_s": 1.12}, track=track))
    assert "must be at least 1.16 (encode.gop_s + all stages of track.temporal, less a frame)" in wrong
    enough = build_config(site(view={"lookahead_s": 1.16}, track=track), where="", folder=Path())
    assert enough.track.final_lag(25.0) == 19


def test_too_many_stages_are_refused_before_their_frames_are_counted() -> None:
    track = {"tracker": "temporal", "temporal": {"stage_s": float("inf")}}
    assert "track.temporal: window_stages must be 1 to 1000, and stage_s" in error_of(site(track=track))


def test_a_lookahead_below_the_trackers_lag_is_refused_with_the_minimum() -> None:
    assert "must be at least 0.8" in error_of(site(view={"lookahead_s": 0.76}))


def test_a_person_must_be_published_before_they_are_settled() -> None:
    identity = {"publish_after_s": 0.28, "clustering_interval_s": 0.16, "settle_after_s": 0.56}
    assert "view.identity.settle_after_s: is 0.56 seconds but must be at least 0.6" in error_of(
        site(view={"identity": identity})
    )
    config = build_config(
        site(view={"identity": identity | {"settle_after_s": 0.6}}), where="site.yaml", folder=Path()
    )
    assert config.view.identity.settle_after_s == 0.6


@pytest.mark.parametrize(
    ("section", "value"),
    [
        ("site", {"fps": 0}),
        ("site", {"width": 333}),
        ("encode", {"gop_s": 0.0}),
        ("http", {"port": 70000}),
        ("view", {"min_shot_s": 1e9}),
        ("view", {"extrapolate_s": float("inf")}),
    ],
)
def test_values_out_of_range_are_refused(section: str, value: dict[str, Any]) -> None:
    assert f"{section}.{next(iter(value))}" in error_of(site(**{section: value}))


def test_a_tracker_that_needs_the_whole_recording_is_refused_for_cameras() -> None:
    assert "myview track --tracker track-network" in error_of(site(track={"tracker": "track-network"}))
    assert "joint-particles" in error_of(site(track={"tracker": "oracle"}))


def test_unknown_solver_is_refused_with_the_known_ones() -> None:
    assert "columns" in error_of(site(track={"solver": "oracle"}))


def test_the_environment_overrides_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_HTTP__PORT", "9999")
    config = build_config(site(http={"port": 1234}), where="site.yaml", folder=Path())
    assert config.http.port == 9999
    assert config.http.host == "127.0.0.1"


def test_environment_for_an_unknown_section_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_HTP__PORT", "9999")
    assert "MYVIEW_HTP__PORT" in error_of(site())


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("MYVIEW_VIEW__SHARE__INDEX", "0", "view.share: unknown key; did you mean 'sharding'?"),
        ("MYVIEW_HTTP__PORT", "x", "http.port: Input should be a valid integer"),
        ("MYVIEW_VIEW__SHARDING__INDEX", "3", "view.sharding: index is 3, but of 1 services"),
        ("MYVIEW_VIEW", '{"share": {"index": 0}}', "view.share: unknown key"),
    ],
)
def test_an_error_says_which_variable_of_the_environment_sets_it(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str, error: str
) -> None:
    monkeypatch.setenv(name, value)
    monkeypatch.setenv("MYVIEW_SITE__FPS", "10")
    text = error_of(site())
    assert error in text
    assert text.endswith(f" (the environment sets {name})")


def test_an_error_of_the_file_does_not_blame_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_HTTP__PORT", "9999")
    assert "environment" not in error_of(site(view={"share": {"index": 0}}))


@pytest.mark.parametrize("name", ["Käse", "the hall", "", 33 * "a", "-a", "a\n"])
def test_a_name_that_is_refused_is_told_what_a_name_has(name: str) -> None:
    text = error_of(site(site={"name": name}))
    assert "a name has letters from a to z, digits, - and _" in text or "more than one line" in text


def test_addresses_that_are_refused_are_told_an_example() -> None:
    hint = "is not an address such as http://127.0.0.1:8081/"
    assert f"http.public_url: {hint}" in error_of(site(http={"public_url": "hall"}))
    assert f"view.sharding.servers.0: {hint}" in error_of(site(view={"sharding": {"servers": ["hall"]}}))


def test_a_list_from_the_environment_must_be_json(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MYVIEW_VIEW__FLAGS__REASONS", '["optimality_gap"]')
    assert build_config(site(), where="", folder=Path()).view.flags.reasons == ["optimality_gap"]
    monkeypatch.setenv("MYVIEW_VIEW__FLAGS__REASONS", "optimality_gap")
    assert "a list, or a whole section, must be JSON" in error_of(site())


def test_a_ground_file_that_is_not_json_is_said_to_be_so(tmp_path: Path) -> None:
    (tmp_path / "hall.mp4").write_text("hello\n")
    assert "ground: " in (text := error_of(site(ground="hall.mp4"), folder=tmp_path))
    assert text.endswith("hall.mp4 is not JSON: Expecting value, line 1, column 1")


def test_paths_are_relative_to_the_configuration(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump(site()))
    config = load_config(path)
    assert config.camera("c0").source == str(tmp_path / "c0.mp4")


@pytest.mark.parametrize("content", ["[1, 2]", "a: [", "", "\x00"])
def test_a_file_that_is_not_a_mapping_of_sections_is_refused(content: str, tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(content)
    with pytest.raises(UserError, match=r"site\.yaml") as caught:
        load_config(path)
    assert "\n" not in str(caught.value)
    assert "<unicode string>" not in str(caught.value)


def test_every_example_configuration_loads() -> None:
    examples = sorted((ROOT / "configs").glob("*.yaml"))
    assert examples
    for example in examples:
        load_config(example)


def test_the_demo_configuration_is_that_of_the_demo_command() -> None:
    example = load_config(ROOT / "configs" / "demo.yaml")
    embedded = build_config(DEMO, where="demo", folder=Path())
    assert example == embedded


@pytest.mark.parametrize("word", ["off", "'off'", "auto", "pass"])
def test_passthrough_may_be_off_without_quotes(word: str, tmp_path: Path) -> None:
    """YAML reads a bare off as a boolean."""
    path = tmp_path / "site.yaml"
    path.write_text(f"cameras: [{{id: c0, source: c0.mp4, passthrough: {word}}}]")
    assert load_config(path).camera("c0").passthrough == word.strip("'")
