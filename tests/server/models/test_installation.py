"""`myview models` installs, lists, checks and times networks; a configuration names an installed one."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pytest

from fakes.cli.command_line import RunCommand
from fakes.models.graph_models import centernet_model
from server.config.loader import load_config
from server.models.catalog import MODELS, NpmPackage
from server.models.installed import check_installed, models_folder, network_path
from server.system.errors import UserError

pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")
pytest.importorskip("onnx", reason="needs onnx: pip install 'myview[neural]'")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let networks be installed in a folder of the test."""
    monkeypatch.setenv("MYVIEW_MODELS", str(tmp_path / "models"))
    return tmp_path / "models"


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a random network be what the package holds."""
    model = centernet_model()
    files = {"models/centernet.json": model.topology(), "models/centernet.bin": model.binary()}

    def fetch(_: NpmPackage, names: Collection[str]) -> dict[str, bytes]:
        return {name: files[name] for name in names}

    monkeypatch.setattr("server.models.installation.fetch_files", fetch)
    monkeypatch.setattr(
        "server.models.installation._run", lambda *_: None
    )  # random: it finds people anywhere


@pytest.mark.usefixtures("package")
def test_a_network_is_installed_checked_and_timed(myview: RunCommand, folder: Path) -> None:
    assert "centernet      not installed" in myview("models", "list").out
    installed = myview("models", "install", "centernet")
    assert installed.code == 0
    assert "no license" in installed.out
    assert "centernet      installed" in myview("models", "list").out
    assert sorted(path.name for path in folder.iterdir()) == ["centernet.onnx", "centernet.sha256"]
    assert myview("models", "check").out == "centernet: runs\n"
    assert myview("models", "time", "centernet", "--size", "64x48").out.endswith("ms an image of 64x48\n")
    (folder / "centernet.onnx").write_bytes(b"another")
    changed = myview("models", "check", "centernet")
    assert (changed.code, changed.out) == (1, "centernet: the file has changed since it was installed\n")


def test_a_network_that_finds_people_in_an_empty_image_is_not_installed(
    myview: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = centernet_model()
    model.weights["heat_weights"] = model.weights["heat_weights"] + 0.01
    contents = {"models/centernet.json": model.topology(), "models/centernet.bin": model.binary()}
    monkeypatch.setattr("server.models.installation.fetch_files", lambda *_: contents)
    refused = myview("models", "install", "centernet")
    assert refused.code == UserError.code
    assert "people in an empty image" in refused.err
    assert list(folder.iterdir()) == []


def test_mistakes_are_one_line(myview: RunCommand, monkeypatch: pytest.MonkeyPatch) -> None:
    unknown = myview("models", "install", "yolo")
    assert (unknown.code, unknown.err) == (
        UserError.code,
        "myview: models: there is no 'yolo', only ssd-mobilenet, nanodet, centernet\n",
    )
    assert "no network is installed" in myview("models", "check").err
    monkeypatch.setattr(
        "server.models.installation.fetch_files",
        lambda *_: {"models/nanodet.json": b"{", "models/nanodet.bin": b""},
    )
    damaged = myview("models", "install", "nanodet")
    assert damaged.code == UserError.code
    assert "nanodet: cannot be converted: not a TensorFlow.js graph model" in damaged.err
    assert len(damaged.err.splitlines()) == 1


def test_a_configuration_names_an_installed_network(tmp_path: Path) -> None:
    (tmp_path / "site.yaml").write_text(
        "cameras: [{id: c0, source: a.mp4}]\ndetect: {kind: onnx, onnx: {model: ssd-mobilenet}}\n",
        encoding="utf-8",
    )
    onnx = load_config(tmp_path / "site.yaml").detect.onnx
    assert (onnx.model, onnx.resize) == (models_folder() / "ssd-mobilenet.onnx", "stretch")
    assert onnx.min_score == 0.05
    with pytest.raises(
        UserError, match="ssd-mobilenet is not installed: run `myview models install ssd-mobilenet`"
    ):
        check_installed(network_path(MODELS[0]))
    (tmp_path / "site.yaml").write_text(
        "cameras: [{id: c0, source: a.mp4}]\ndetect: {kind: onnx, onnx: {model: own.onnx}}\n",
        encoding="utf-8",
    )
    assert load_config(tmp_path / "site.yaml").detect.onnx.model == tmp_path / "own.onnx"
