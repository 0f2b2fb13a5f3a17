"""A site for Kubernetes: prints the manifests of a configuration.

    kubernetes.py site.yaml --image registry.example/myview:1 > manifests.yaml
    MYVIEW_TOKEN=… kubernetes.py site.yaml --secrets | kubectl apply -f -
    kubectl apply -f manifests.yaml

Run it by the Python that has MyView (.venv/bin/python configs/kubernetes.py). The manifests contain no
secret: `--secrets` prints the Secrets alone, from the files that the configuration names, with the
configuration itself if that has addresses of cameras or webhooks. The volume of the claim `files` holds
recordings and networks as their nearest common folder does. It needs Kubernetes 1.28 or newer, and a network
plugin that enforces NetworkPolicies. docs/how-to/scale.md, "Kubernetes".
"""

from __future__ import annotations

import argparse
import base64
import ipaddress
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from kubernetes_files import (
    BUS_PORT,
    HTTP_PORT,
    RTSP_PORT,
    SYNC_PORT,
    ContainerSite,
    read_site,
)
from kubernetes_pods import (
    Manifest,
    bestview,
    camera,
    camera_name,
    claim_of,
    dump,
    gateway,
    labels_of,
    object_of,
    sync,
)

from server.config.site_config import PREFIX, Config
from server.system.errors import UserError

_GATEWAYS_MAX = 8
_BYTES_MAX = 1_000_000
"""Of a ConfigMap or Secret: etcd takes 1 MiB."""


def manifests_of(site: ContainerSite, namespace: str, image: str, urls: list[str]) -> list[Manifest]:
    """Return all objects but the Secrets."""
    made = [_namespace(namespace), *_configuration(site), *_services(site), *_policies(site), *_budgets(site)]
    made += [sync(site, image), bestview(site, image)]
    # A Deployment for each camera: its Secret is its own, and a camera that is removed renames no other, as
    # ordinals would. A StatefulSet would wait for a machine that is gone.
    made += [camera(site, image, camera_id) for camera_id in site.config.camera_ids]
    made += [gateway(site, image), _autoscaler()] if site.config.rtsp.enabled else []
    made += _ingress(site, urls)
    return [_placed(manifest, namespace) for manifest in made]


def secrets_of(site: ContainerSite, namespace: str) -> list[Manifest]:
    """Return the Secrets.

    Raises:
        UserError: a file cannot be read.
    """
    values = {"sync": site.secret_values("sync"), "bestview": site.secret_values("bestview")}
    values |= {camera_name(name): site.secret_values("camera", name) for name in site.config.camera_ids}
    if site.config.rtsp.enabled:
        values["rtsp"] = site.secret_values("rtsp")
    if site.is_private:
        values["site"] = {name: text.encode() for name, text in _config_files(site).items()}
    made = [
        object_of("v1", "Secret", name, data=_encoded(files, name)) for name, files in values.items() if files
    ]
    return [_namespace(namespace), *(_placed(manifest, namespace) for manifest in made)] if made else []


def _encoded(files: dict[str, bytes], name: str) -> dict[str, str]:
    _check_size(files.values(), f"Secret {name}")
    return {file: base64.b64encode(value).decode() for file, value in files.items()}


def _check_size(files: Iterable[bytes], name: str) -> None:
    """Check that files fit into a ConfigMap or Secret.

    Raises:
        UserError: they do not.
    """
    if sum(map(len, files)) > _BYTES_MAX:
        raise UserError(
            f"{name}: the files have more than {_BYTES_MAX} bytes, which a cluster does not store"
        )


def _placed(manifest: Manifest, namespace: str) -> Manifest:
    if manifest["kind"] != "Namespace":
        manifest["metadata"]["namespace"] = namespace
    return manifest


def _namespace(name: str) -> Manifest:
    made = object_of("v1", "Namespace", name)
    made["metadata"]["labels"]["pod-security.kubernetes.io/enforce"] = "restricted"
    return made


def _config_files(site: ContainerSite) -> dict[str, str]:
    return {"site.yaml": dump([site.content]), **site.texts}


def _configuration(site: ContainerSite) -> list[Manifest]:
    files = _config_files(site)
    _check_size((text.encode() for text in files.values()), "site.yaml")
    made = [] if site.is_private else [object_of("v1", "ConfigMap", "site", data=files)]
    if site.needs_files:
        made.append(object_of("v1", "PersistentVolumeClaim", "files", spec=claim_of("ReadWriteMany", "10Gi")))
    return made


def _services(site: ContainerSite) -> list[Manifest]:
    """Return names for the processes, ready or not, because they wait for each other; and one for viewers."""

    def service(name: str, selector: dict[str, str], ports: dict[str, int], **spec: Any) -> Manifest:
        listed = [{"name": port, "port": number, "targetPort": port} for port, number in ports.items()]
        return object_of("v1", "Service", name, spec={"selector": selector, "ports": listed, **spec})

    headless = {"clusterIP": "None", "publishNotReadyAddresses": True}
    viewers = {"sessionAffinity": "ClientIP"}  # another's newest HLS segment may come some milliseconds later
    bestview = labels_of(process="bestview")
    made = [
        service("sync", labels_of(process="sync"), {"pulses": SYNC_PORT}, **headless),
        service("bestview", bestview, {"http": HTTP_PORT, "bus": BUS_PORT}, **headless),
        service("myview", bestview, {"http": HTTP_PORT}, **viewers),
    ]
    if site.config.rtsp.enabled:
        made.append(service("rtsp", labels_of(process="rtsp"), {"rtsp": RTSP_PORT}))
    for index in range(site.services if site.services > 1 else 0):
        selector = bestview | {"statefulset.kubernetes.io/pod-name": f"bestview-{index}"}
        made.append(service(f"myview-{index}", selector, {"http": HTTP_PORT}))
    return made


def _policies(site: ContainerSite) -> list[Manifest]:
    """Return who reaches whom: the site's pods each other; others the page, where that is open."""

    def policy(name: str, selector: dict[str, str], rule: Manifest) -> Manifest:
        spec = {"podSelector": {"matchLabels": selector}, "policyTypes": ["Ingress"], "ingress": [rule]}
        return object_of("networking.k8s.io/v1", "NetworkPolicy", name, spec=spec)

    made = [policy("site", labels_of(), {"from": [{"podSelector": {"matchLabels": labels_of()}}]})]
    open_ports = {"bestview": "http", **({"rtsp": "rtsp"} if site.config.rtsp.enabled else {})}
    if site.is_open:
        made += [
            policy(name, labels_of(process=name), {"ports": [{"port": port}]})
            for name, port in open_ports.items()
        ]
    return made


def _budgets(site: ContainerSite) -> list[Manifest]:
    """Return how many may be away while machines are emptied; the only one of its kind may."""
    away: dict[str, int | str] = {"camera": "25%"}
    if site.services > 1:
        away["bestview"] = 1
    if site.config.rtsp.enabled:
        away["rtsp"] = 1
    return [
        object_of(
            "policy/v1",
            "PodDisruptionBudget",
            process,
            spec={
                "maxUnavailable": most,
                "selector": {"matchLabels": labels_of(process=process)},
                "unhealthyPodEvictionPolicy": "AlwaysAllow",
            },
        )
        for process, most in away.items()
    ]


def _autoscaler() -> Manifest:
    # Not of the best view: the number of services is in every process's configuration, and one more would
    # compute all identities again.
    cpu = {"name": "cpu", "target": {"type": "Utilization", "averageUtilization": 150}}
    slowly = {
        "stabilizationWindowSeconds": 900,
        "policies": [{"type": "Pods", "value": 1, "periodSeconds": 300}],
    }
    spec = {
        "scaleTargetRef": {"apiVersion": "apps/v1", "kind": "Deployment", "name": "rtsp"},
        "minReplicas": 2,
        "maxReplicas": _GATEWAYS_MAX,
        "metrics": [{"type": "Resource", "resource": cpu}],
        "behavior": {"scaleDown": slowly},  # it ends streams
    }
    return object_of("autoscaling/v2", "HorizontalPodAutoscaler", "rtsp", spec=spec)


def _ingress(site: ContainerSite, urls: list[str]) -> list[Manifest]:
    """Return the Ingress of viewers' host names; with HTTPS of its own the best view has none."""
    rules, hosts = [], []
    for index, url in enumerate(urls if site.scheme == "http" else ()):
        parts, service = urlsplit(url), f"myview-{index}" if len(urls) > 1 else "myview"
        if parts.port is not None or _is_ip_address(parts.hostname or ""):
            continue  # published otherwise
        backend = {"service": {"name": service, "port": {"name": "http"}}}
        path = {"path": "/", "pathType": "Prefix", "backend": backend}
        rules.append({"host": parts.hostname, "http": {"paths": [path]}})
        hosts += [parts.hostname] if parts.scheme == "https" else []
    tls = {"tls": [{"hosts": hosts}]} if hosts else {}
    spec = {"rules": rules, **tls}
    return [object_of("networking.k8s.io/v1", "Ingress", "myview", spec=spec)] if rules else []


def _is_ip_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _drop_overrides() -> None:
    """Forget the settings in this machine's environment; containers read the file alone."""
    for name in list(os.environ):
        section = name.upper().removeprefix(PREFIX).partition("__")[0].lower()
        if name.upper().startswith(PREFIX) and section in Config.model_fields:
            del os.environ[name]


def main() -> int:
    """Print the manifests of the configuration that the command line names."""
    words = argparse.ArgumentParser(description="Print a site's Kubernetes manifests.")
    words.add_argument("config", type=Path)
    words.add_argument("--namespace", default="myview", help="of its own (myview)")
    words.add_argument(
        "--image", default="myview", help="(myview); the RTSP gateway's has -rtsp after the name"
    )
    words.add_argument("--services", type=int, help="best-view services; by default as view.sharding says")
    words.add_argument(
        "--url", action="append", default=[], help="where viewers reach the services, or each of them"
    )
    words.add_argument("--secrets", action="store_true", help="print the Secrets alone")
    options = words.parse_args()
    _drop_overrides()
    try:
        site = read_site(options.config, options.url, options.services)
        if options.secrets:
            made = secrets_of(site, options.namespace)
        else:
            made = manifests_of(site, options.namespace, options.image, options.url)
    except UserError as error:
        print(error, file=sys.stderr)
        return error.code
    sys.stdout.write(dump(made))
    return 0


if __name__ == "__main__":
    sys.exit(main())
