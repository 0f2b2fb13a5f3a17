"""The manifests for Kubernetes: valid for its API, whole in themselves, and without the site's secrets."""

from __future__ import annotations

import base64
import functools
import importlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.paths import CONFIGS, ROOT
from server.config.loader import load_config
from server.config.site_config import Config
from server.system.errors import UserError

OLD_VERSION = "1.28"
SECRET = "hush-"  # noqa: S105 — every secret of the tests contains it
Manifest = dict[str, Any]


def scripts() -> tuple[Any, Any, Any]:
    sys.path.insert(0, str(CONFIGS))
    try:
        return tuple(map(importlib.import_module, ("kubernetes", "kubernetes_files", "kubernetes_pods")))
    finally:
        sys.path.remove(str(CONFIGS))


MAIN, FILES, PODS = scripts()


@pytest.fixture(scope="module")
def kubernetes_validate() -> Iterator[Any]:
    """Import the validator, which takes seconds; keep the schemas, which it reads anew for every object."""
    validator = importlib.import_module("kubernetes_validate")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validator.utils, "schema_contents", functools.cache(validator.utils.schema_contents))
        yield validator


def print_manifests(*words: str | Path, token: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MYVIEW_")}
    environment |= {"MYVIEW_TOKEN": token} if token else {}
    command = [sys.executable, str(CONFIGS / "kubernetes.py"), *map(str, words)]
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


def render(path: Path, urls: list[str] | None = None, services: int | None = None) -> list[Manifest]:
    site = FILES.read_site(path, urls or [], services)
    return list(
        yaml.safe_load_all(PODS.dump(MAIN.manifests_of(site, "hall", "registry/myview:1", urls or [])))
    )


def render_secrets(path: Path, services: int | None = None) -> list[Manifest]:
    return list(yaml.safe_load_all(PODS.dump(MAIN.secrets_of(FILES.read_site(path, [], services), "hall"))))


def of_kind(manifests: list[Manifest], kind: str) -> dict[str, Manifest]:
    return {made["metadata"]["name"]: made for made in manifests if made["kind"] == kind}


def workloads(manifests: list[Manifest]) -> dict[str, Manifest]:
    return of_kind(manifests, "Deployment") | of_kind(manifests, "StatefulSet")


def container_of(workload: Manifest) -> Manifest:
    (container,) = workload["spec"]["template"]["spec"]["containers"]
    return container


def contains(labels: dict[str, str], selector: dict[str, str]) -> bool:
    return selector.items() <= labels.items()


def check_manifests(manifests: list[Manifest], secrets: list[Manifest]) -> None:
    """Check what the API's schema does not: names, and that what is referred to is there."""
    for made in [*manifests, *secrets]:
        name = made["metadata"]["name"]
        assert len(name) <= 63
        assert name.strip("-") == name
        assert set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789-")
        assert made["kind"] == "Namespace" or made["metadata"]["namespace"] == "hall"
    names = [(made["kind"], made["metadata"]["name"]) for made in manifests]
    assert len(names) == len(set(names))
    pods = [workload["spec"]["template"] for workload in workloads(manifests).values()]
    for workload in workloads(manifests).values():
        template = workload["spec"]["template"]
        assert contains(template["metadata"]["labels"], workload["spec"]["selector"]["matchLabels"])
        others = [pod for pod in pods if pod is not template]
        assert not any(
            contains(pod["metadata"]["labels"], workload["spec"]["selector"]["matchLabels"]) for pod in others
        )
        check_pod(template["spec"], workload["spec"], manifests, secrets)
    for service in of_kind(manifests, "Service").values():
        selector = dict(service["spec"]["selector"])
        pod_name = selector.pop("statefulset.kubernetes.io/pod-name", "bestview-0")
        stateful = of_kind(manifests, "StatefulSet")["bestview"]
        assert pod_name in {f"bestview-{index}" for index in range(stateful["spec"]["replicas"])}
        chosen = [pod for pod in pods if contains(pod["metadata"]["labels"], selector)]
        assert chosen
        for pod in chosen:
            ports = {port["name"]: port["containerPort"] for port in pod["spec"]["containers"][0]["ports"]}
            assert all(ports[port["targetPort"]] == port["port"] for port in service["spec"]["ports"])
    for budget in of_kind(manifests, "PodDisruptionBudget").values():
        selector = budget["spec"]["selector"]["matchLabels"]
        assert any(contains(pod["metadata"]["labels"], selector) for pod in pods)
    for policy in of_kind(manifests, "NetworkPolicy").values():
        selector = policy["spec"]["podSelector"]["matchLabels"]
        assert any(contains(pod["metadata"]["labels"], selector) for pod in pods)
    for scaler in of_kind(manifests, "HorizontalPodAutoscaler").values():
        target = of_kind(manifests, "Deployment")[scaler["spec"]["scaleTargetRef"]["name"]]
        assert "replicas" not in target["spec"], "they would be set back at each apply"
    for ingress in of_kind(manifests, "Ingress").values():
        for rule in ingress["spec"]["rules"]:
            backend = rule["http"]["paths"][0]["backend"]["service"]
            service = of_kind(manifests, "Service")[backend["name"]]
            assert backend["port"]["name"] in {port["name"] for port in service["spec"]["ports"]}


def check_pod(pod: Manifest, spec: Manifest, manifests: list[Manifest], secrets: list[Manifest]) -> None:
    (container,) = pod["containers"]
    claims = {claim["metadata"]["name"] for claim in spec.get("volumeClaimTemplates", [])}
    for volume in pod["volumes"]:
        if "configMap" in volume:
            assert volume["configMap"]["name"] in of_kind(manifests, "ConfigMap")
        if "secret" in volume:
            assert volume["secret"]["secretName"] in of_kind(secrets, "Secret")
        if "persistentVolumeClaim" in volume:
            assert volume["persistentVolumeClaim"]["claimName"] in of_kind(manifests, "PersistentVolumeClaim")
    volumes = {volume["name"] for volume in pod["volumes"]}
    mounted = {mount["name"] for mount in container["volumeMounts"]}
    assert mounted == volumes | claims
    ports = {port["name"] for port in container.get("ports", [])}
    for kind in ("startupProbe", "readinessProbe", "livenessProbe"):
        probe = container.get(kind, {})
        assert kind != "readinessProbe" or probe
        assert "httpGet" not in probe or probe["httpGet"]["port"] in ports
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["enableServiceLinks"] is False
    assert container["securityContext"]["readOnlyRootFilesystem"] is True
    assert container["resources"]["requests"].keys() == {"cpu", "memory"}


def loaded_in_containers(manifests: list[Manifest], secrets: list[Manifest]) -> Config:
    """Load the configuration as the containers' processes do."""
    config_maps = of_kind(manifests, "ConfigMap")
    if "site" in config_maps:
        files = {name: text.encode() for name, text in config_maps["site"]["data"].items()}
    else:
        data = of_kind(secrets, "Secret")["site"]["data"]
        files = {name: base64.b64decode(text) for name, text in data.items()}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_bytes(text)
        return load_config(Path(folder) / "site.yaml")


IDS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}", fullmatch=True).filter(
    lambda name: not name.startswith("bestview")
)
SOURCES = st.sampled_from(
    [
        "scene:room?camera=0&cameras=1&objects=2&seed=1",
        "recordings/one.mp4",
        "../shared/two.mp4",
        f"rtsp://viewer:{SECRET}1@192.0.2.1/live",
        f"rtsp://192.0.2.1/user=admin_password={SECRET}2.sdp",
        "rtsp://viewer:{password}@192.0.2.1/live",
    ]
)


@st.composite
def sites(draw: st.DrawFn) -> Manifest:
    """Draw the content of a configuration; paths are those of `site_folder`."""
    cameras = []
    for name in draw(st.lists(IDS, min_size=1, max_size=5, unique=True)):
        camera: Manifest = {"id": name, "source": draw(SOURCES)}
        if "{password}" in camera["source"]:
            camera["password"] = "camera.password"  # noqa: S105 — a file
        if draw(st.booleans()) and not camera["source"].startswith("scene:"):
            is_address = "://" in camera["source"]
            small = f"rtsp://viewer:{SECRET}8@192.0.2.1/small" if is_address else "recordings/small.mp4"
            camera["substream"] = small
        if draw(st.booleans()):
            camera["options"] = {"headers": f"Authorization: {SECRET}3"}
        cameras.append(camera)
    content: Manifest = {"cameras": cameras}
    tls = {"certificate": "file.pem", "key": "file.pem"}
    optional: Manifest = {
        "access": {"tokens": "tokens.yaml"},
        "http": {"tls": tls},
        "sync": {"users": "users", "tls": {**tls, "authority": "file.pem"}},
        "zenoh": {"listen": "tls/127.0.0.1:7447", "users": "users", "tls": {**tls, "authority": "file.pem"}},
        "webhooks": [{"url": f"https://example.org/{SECRET}4", "secret": "file.pem"}],
        "mqtt": {"host": "broker", "username": "site", "password": "file.pem"},
        "rtsp": {"enabled": True, "tls": tls},
        "record": {"folder": "recorded", "max_mb": draw(st.floats(1, 1e6))},
        "view": {"sharding": {"of": draw(st.integers(1, 3))}},
        "sound": {"source": f"rtsp://viewer:{SECRET}5@192.0.2.9/"},
    }
    for section in draw(st.lists(st.sampled_from(list(optional)), unique=True)):
        content[section] = optional[section]
    return content


def write_site(folder: Path, content: Manifest) -> Path:
    for name in ("file.pem", "camera.password"):
        (folder / name).write_text(f"{SECRET}{name}\n")
    names = [camera["id"] for camera in content["cameras"]] + [
        "bestview",
        *(f"bestview-{index}" for index in range(1, 9)),
    ]
    (folder / "users").write_text("".join(f"{name}:{SECRET}of-{name}\n" for name in names))
    (folder / "tokens.yaml").write_text(f"tokens: []  # {SECRET}6\n")
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content) + f"# {SECRET}7\n")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("site")


@pytest.fixture(autouse=True)
def token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_TOKEN", f"{SECRET}token")


class TestOfAnySite:
    @settings(max_examples=20, deadline=None)
    @given(content=sites(), services=st.integers(1, 2))
    def test_manifests_are_valid_whole_and_without_secrets(
        self, folder: Path, kubernetes_validate: Any, content: Manifest, services: int
    ) -> None:
        path = write_site(folder, content)
        count = services * content.get("view", {}).get("sharding", {}).get("of", 1)
        manifests, secrets = render(path, services=count), render_secrets(path, services=count)
        for made in [*manifests, *secrets]:
            kubernetes_validate.validate(made, kubernetes_validate.latest_version(), strict=True)
        check_manifests(manifests, secrets)
        assert SECRET not in yaml.safe_dump(manifests)
        config = loaded_in_containers(manifests, secrets)
        assert config.view.sharding.services == count
        assert config.camera_ids == load_config(path).camera_ids
        assert of_kind(manifests, "StatefulSet")["bestview"]["spec"]["replicas"] == count

    @given(ids=st.sets(IDS, min_size=2, max_size=50))
    def test_cameras_have_different_names(self, ids: set[str]) -> None:
        close = ids | {name.lower() for name in ids} | {name.replace("_", "-") for name in ids}
        names = {PODS.camera_name(name) for name in close}
        assert len(names) == len(close)


def site_with(tmp_path: Path, **sections: Any) -> Path:
    return write_site(tmp_path, {"cameras": [{"id": "c0", "source": "scene:room?camera=0"}], **sections})


def test_a_camera_keeps_its_name_where_that_is_allowed() -> None:
    assert PODS.camera_name("front-door") == "camera-front-door"
    assert PODS.camera_name("Front_door") == "camera--front-door-21"
    assert PODS.camera_name("front-door-21") == "camera-front-door-21"
    assert PODS.camera_name("a-") == "camera--a--0"


def test_each_process_gets_its_own_secrets_alone(tmp_path: Path) -> None:
    users, tls = "users", {"certificate": "file.pem", "key": "file.pem", "authority": "file.pem"}
    cameras = [
        {"id": name, "source": "rtsp://u:{password}@h/", "password": "file.pem"} for name in ("A", "b")
    ]
    path = write_site(
        tmp_path,
        {
            "cameras": cameras,
            "access": {"tokens": "tokens.yaml"},
            "sync": {"users": users, "tls": tls},
            "zenoh": {"listen": "tls/127.0.0.1:7447", "users": users, "tls": tls},
        },
    )
    made = of_kind(render_secrets(path, services=2), "Secret")
    values = {
        name: {key: base64.b64decode(text).decode() for key, text in secret["data"].items()}
        for name, secret in made.items()
    }
    assert values["camera-b"]["sync.users"] == values["camera-b"]["zenoh.users"] == f"b:{SECRET}of-b\n"
    assert values["camera-b"]["health.token"] == f"{SECRET}token"
    assert set(values["camera-b"]) == {
        "camera.password",
        "health.token",
        "sync.users",
        "sync.tls.authority",
        "zenoh.users",
        "zenoh.tls.authority",
    }
    assert values["bestview"]["sync.users"].splitlines() == [
        f"bestview:{SECRET}of-bestview",
        f"bestview-1:{SECRET}of-bestview-1",
    ]
    assert f"A:{SECRET}of-A" in values["bestview"]["zenoh.users"]
    assert set(values["sync"]) == {"sync.users", "sync.tls.authority", "sync.tls.certificate", "sync.tls.key"}
    assert f"A:{SECRET}of-A" in values["sync"]["sync.users"]


def test_files_of_other_sites_are_secrets_of_the_best_view(tmp_path: Path) -> None:
    link = {"connect": "tls/yard:7447", "url": "https://yard/", "users": "users", "authority": "file.pem"}
    linked = {"of": 2, "link": {"yard": link}}
    path = site_with(tmp_path, sites=linked, access={"tokens": "tokens.yaml"})
    manifests, secrets = render(path), render_secrets(path)
    check_manifests(manifests, secrets)
    assert {"sites.link.yard.users", "sites.link.yard.authority"} <= set(
        of_kind(secrets, "Secret")["bestview"]["data"]
    )
    config = loaded_in_containers(manifests, secrets)
    assert str(config.sites.link["yard"].users).endswith("/sites.link.yard.users")
    with pytest.raises(UserError, match=r"^sites\.link: in a cluster a site without tokens"):
        render(site_with(tmp_path, sites=linked))


def test_without_tokens_only_the_namespace_reaches_the_page(tmp_path: Path) -> None:
    closed = of_kind(render(site_with(tmp_path)), "NetworkPolicy")
    assert list(closed) == ["site"]
    opened = of_kind(render(site_with(tmp_path, access={"tokens": "tokens.yaml"})), "NetworkPolicy")
    assert opened["bestview"]["spec"]["ingress"] == [{"ports": [{"port": "http"}]}]
    with pytest.raises(UserError, match=r"access\.tokens"):
        render(site_with(tmp_path), ["https://cameras.example"])


def test_a_trusted_network_is_assumed_only_without_users_and_tls(tmp_path: Path) -> None:
    tls = {"certificate": "file.pem", "key": "file.pem"}
    plain, secure = site_with(tmp_path), {"users": "users", "tls": tls}
    assert loaded_in_containers(render(plain), []).access.trusted_network
    path = site_with(tmp_path, sync=secure, zenoh={**secure, "listen": "tls/127.0.0.1:7447"})
    assert not loaded_in_containers(render(path), []).access.trusted_network


def test_services_replace_each_other_at_one_address_or_at_several(tmp_path: Path) -> None:
    path = site_with(tmp_path, access={"tokens": "tokens.yaml"})
    one = render(path, ["https://cameras.example"], services=2)
    (rule,) = of_kind(one, "Ingress")["myview"]["spec"]["rules"]
    assert rule["http"]["paths"][0]["backend"]["service"]["name"] == "myview"
    assert of_kind(one, "Ingress")["myview"]["spec"]["tls"] == [{"hosts": ["cameras.example"]}]
    assert loaded_in_containers(one, []).view.sharding.servers == ["https://cameras.example"] * 2
    urls = ["http://a.example/", "http://b.example/"]
    several = render(path, urls, services=2)
    check_manifests(several, render_secrets(path, services=2))
    rules = of_kind(several, "Ingress")["myview"]["spec"]["rules"]
    backends = [rule["http"]["paths"][0]["backend"]["service"]["name"] for rule in rules]
    assert backends == ["myview-0", "myview-1"]
    config = loaded_in_containers(several, [])
    assert config.view.sharding.servers == urls
    assert config.zenoh.routers == ("tcp/bestview-0.bestview:7447", "tcp/bestview-1.bestview:7447")
    (kubernetes_index,) = (
        variable
        for variable in container_of(of_kind(several, "StatefulSet")["bestview"])["env"]
        if variable["name"] == "MYVIEW_VIEW__SHARDING__INDEX"
    )
    assert "pod-index" in kubernetes_index["valueFrom"]["fieldRef"]["fieldPath"]


def test_only_what_knows_of_no_other_is_scaled(tmp_path: Path) -> None:
    manifests = render(site_with(tmp_path, rtsp={"enabled": True}))
    assert list(of_kind(manifests, "HorizontalPodAutoscaler")) == ["rtsp"]
    assert container_of(of_kind(manifests, "Deployment")["rtsp"])["image"] == "registry/myview-rtsp:1"
    assert not of_kind(render(site_with(tmp_path)), "HorizontalPodAutoscaler")


def test_a_camera_is_not_ended_while_its_source_or_the_best_view_is_away(tmp_path: Path) -> None:
    camera = container_of(of_kind(render(site_with(tmp_path)), "Deployment")["camera-c0"])
    assert "livenessProbe" not in camera
    assert "startupProbe" not in camera
    assert camera["readinessProbe"]["exec"]["command"][2:] == [
        "server.supervisor.healthcheck",
        "camera",
        "c0",
    ]


@pytest.mark.parametrize(
    ("sections", "words", "said"),
    [
        ({"cameras": [{"id": "c0", "source": "/dev/video0"}]}, (), "device of one machine"),
        ({"cameras": []}, (), "cameras"),
        ({"view": {"sharding": {"of": 2}}}, ("--services", "3"), "shards"),
        ({}, ("--url", "https://cameras.example/path"), "--url"),
        ({"access": {"tokens": "none.yaml"}}, ("--secrets",), "none.yaml"),
    ],
)
def test_what_cannot_run_is_refused_in_one_line(
    tmp_path: Path, sections: Manifest, words: tuple[str, ...], said: str
) -> None:
    done = print_manifests(site_with(tmp_path, **sections), *words, token="token")  # noqa: S106
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert said in done.stderr


def test_probes_of_a_site_with_tokens_need_one(tmp_path: Path) -> None:
    done = print_manifests(site_with(tmp_path, access={"tokens": "tokens.yaml"}), "--secrets")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "MYVIEW_TOKEN" in done.stderr


@pytest.mark.parametrize("name", ["demo.yaml", "replay.yaml", "secure.yaml"])
def test_the_example_configurations_have_valid_manifests(kubernetes_validate: Any, name: str) -> None:
    done = print_manifests(CONFIGS / name, "--namespace", "hall")
    assert (done.returncode, done.stderr) == (0, "")
    for made in yaml.safe_load_all(done.stdout):
        kubernetes_validate.validate(made, OLD_VERSION, strict=True)
