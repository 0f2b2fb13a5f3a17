"""docker-compose.yml matches the configuration that it runs; needs no Docker Engine."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
import yaml

from fakes.paths import ROOT
from server.config.loader import load_config
from server.supervisor.exposure_checks import check_rtsp
from server.supervisor.rtsp_process import gateway_settings


@pytest.fixture(scope="module")
def services() -> dict[str, dict[str, Any]]:
    content = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
    found = content["services"]
    assert isinstance(found, dict)
    return found


def test_there_is_one_service_per_process_of_the_demo(services: dict[str, Any]) -> None:
    cameras = load_config(ROOT / "configs" / "demo.yaml").camera_ids
    assert set(services) == {"sync", "bestview", *cameras}
    for name, service in services.items():
        kind, path, *camera = service["command"]
        assert (kind, camera) == (("camera", [name]) if name in cameras else (name, []))
        assert path == "configs/${MYVIEW_CONFIG:-demo.yaml}"


def test_the_image_is_built_once_and_never_pulled(services: dict[str, Any]) -> None:
    assert [name for name, service in services.items() if "build" in service] == ["sync"]
    assert {service["pull_policy"] for service in services.values()} == {"build", "never"}
    assert len({service["image"] for service in services.values()}) == 1


def test_only_the_best_view_is_published_and_only_to_this_host(services: dict[str, Any]) -> None:
    assert [name for name, service in services.items() if "ports" in service] == ["bestview"]
    assert services["bestview"]["ports"] == ["${MYVIEW_PUBLISH:-127.0.0.1:8080}:8080"]


def test_every_service_has_a_health_check_a_restart_policy_and_a_read_only_configuration(
    services: dict[str, Any],
) -> None:
    for service in services.values():
        kind, _, *camera = service["command"]
        assert service["healthcheck"]["test"][4:] == [kind, *camera]
        assert service["restart"] == "${MYVIEW_RESTART:-unless-stopped}"
        assert service["volumes"] == ["./configs:/site/configs:ro"]
        assert service["read_only"] is True


def test_the_services_find_each_other(services: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    for service in services.values():
        for key, value in service["environment"].items():
            if "__" in key:
                monkeypatch.setenv(key, str(value))
        config = load_config(ROOT / "configs" / "demo.yaml")
        assert config.sync.host in services
        assert config.zenoh.connect == "tcp/bestview:7447"
        assert {config.sync.bind, config.http.host} == {"0.0.0.0"}  # noqa: S104 — all addresses of a container
        assert config.http.port == 8080
        assert service["environment"]["MYVIEW_SYNC__PORT"] == 7400, "overrides the configuration"


def test_the_image_is_built_from_all_packages() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = {name.rstrip("*") for name in project["tool"]["setuptools"]["packages"]["find"]["include"]}
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    sent = {line.removeprefix("!") for line in lines if line.startswith("!")}
    # Beside the packages: the locked versions and what makes the list of licenses.
    assert {name for name in sent if (ROOT / name).is_dir()} == packages | {"requirements"}


def test_the_gateway_asks_the_best_view_service_and_is_published_to_this_host_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    content = yaml.safe_load((ROOT / "docker-compose.rtsp.yml").read_text(encoding="utf-8"))
    (gateway,) = content["services"].values()
    assert gateway["command"] == ["rtsp", "configs/${MYVIEW_CONFIG:-demo.yaml}"]
    assert gateway["ports"] == ["${MYVIEW_PUBLISH_RTSP:-127.0.0.1:8554}:8554"]
    assert f"FROM site AS {gateway['build']['target']}" in (ROOT / "Dockerfile").read_text(encoding="utf-8")
    for key, value in gateway["environment"].items():
        if "__" in key:
            monkeypatch.setenv(key, str(value))
    config = load_config(ROOT / "configs" / "demo.yaml")
    check_rtsp(config)
    settings = gateway_settings(config)
    assert (settings["service"], settings["port"], settings["udp"]) == ("http://bestview:8080", 8554, False)
