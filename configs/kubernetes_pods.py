"""The pods of a site in Kubernetes: one process each, with its probes, limits, files and variables."""

from __future__ import annotations

import hashlib
import math
import re
from typing import Any

import yaml
from kubernetes_files import (
    BUS_PORT,
    CONFIG_FOLDER,
    FILES_FOLDER,
    HEALTH_TOKEN,
    HTTP_PORT,
    RECORDINGS_FOLDER,
    RTSP_PORT,
    SECRETS_FOLDER,
    SYNC_PORT,
    ContainerSite,
)

Manifest = dict[str, Any]

_USER = 10001
"""The image's."""
_CHECK = ["python", "-m", "server.supervisor.healthcheck"]
_RESOURCES = {
    # requests and limits: cores, memory; limits as in docker-compose.yml
    "sync": (("50m", "64Mi"), ("1", "256Mi")),
    "bestview": (("1", "512Mi"), ("2", "2Gi")),
    "camera": (("500m", "384Mi"), ("2", "1Gi")),
    "rtsp": (("250m", "128Mi"), ("1", "512Mi")),
}
_LOST_AFTER_S = 15
"""Seconds after which a process of a machine that does not answer is started on another one; not 300."""
_SAFE_ID = re.compile(r"[a-z0-9]([a-z0-9-]*[a-z0-9])?")


def camera_name(camera_id: str) -> str:
    """Return the name of a camera's objects: a DNS label, different for every id.

    Other ids are written in small letters, followed by a bit for each changed character.
    """
    if _SAFE_ID.fullmatch(camera_id):
        return f"camera-{camera_id}"
    changed = sum(1 << place for place, char in enumerate(camera_id) if char.isupper() or char == "_")
    return f"camera--{camera_id.lower().replace('_', '-')}-{changed:x}"


def object_of(version: str, kind: str, name: str, **content: Any) -> Manifest:
    """Return an object of the site."""
    labels = {"app.kubernetes.io/name": "myview"}
    return {"apiVersion": version, "kind": kind, "metadata": {"name": name, "labels": labels}, **content}


def labels_of(*, process: str = "", **more: str) -> dict[str, str]:
    """Return the labels of a process's pods, or of all."""
    component = {"app.kubernetes.io/component": process} if process else {}
    return {"app.kubernetes.io/name": "myview", **component, **more}


def _pod(
    site: ContainerSite, process: str, name: str, words: list[str], secrets: list[str], **container: Any
) -> Manifest:
    """Return the template of a pod with one container."""
    configuration = {"secret": {"secretName": "site"}} if site.is_private else {"configMap": {"name": "site"}}
    volumes = [
        {"name": "site", **configuration},
        {"name": "memory", "emptyDir": {"medium": "Memory", "sizeLimit": "256Mi"}},
    ]
    mounts = [
        {"name": "site", "mountPath": CONFIG_FOLDER, "readOnly": True},
        {"name": "memory", "mountPath": "/tmp"},  # noqa: S108 — in the container
    ]
    if secrets:
        volumes.append({"name": "secrets", "secret": {"secretName": name}})
        mounts.append({"name": "secrets", "mountPath": SECRETS_FOLDER, "readOnly": True})
    if site.needs_files and process == "camera":
        volumes.append({"name": "files", "persistentVolumeClaim": {"claimName": "files", "readOnly": True}})
        mounts.append({"name": "files", "mountPath": FILES_FOLDER, "readOnly": True})
    if process == "bestview" and site.config.record.folder:
        mounts.append({"name": "recordings", "mountPath": RECORDINGS_FOLDER})
    requests, limits = ({"cpu": cpu, "memory": memory} for cpu, memory in _RESOURCES[process])
    closed = {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    pod = {
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,  # its variables MYVIEW_… could be taken for settings
        "shareProcessNamespace": True,  # process 1 would lose signals during Python's start
        "securityContext": {
            "runAsNonRoot": True,
            "runAsUser": _USER,
            "fsGroup": _USER,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
        "containers": [
            {
                "name": "myview",
                "args": [words[0], f"{CONFIG_FOLDER}/site.yaml", *words[1:]],
                "resources": {"requests": requests, "limits": limits},
                "securityContext": closed,
                "volumeMounts": mounts,
                **container,
            }
        ],
        "volumes": volumes,
    }
    labels = labels_of(process=process) | {"app.kubernetes.io/instance": name}
    metadata: Manifest = {"labels": labels}
    if not site.is_private:
        # A changed configuration starts pods anew. The checksum of a Secret would tell something about it.
        checksum = hashlib.sha256(dump([site.content, site.texts]).encode()).hexdigest()
        metadata["annotations"] = {"myview/configuration": checksum[:16]}
    return {"metadata": metadata, "spec": pod}


def _deployment(process: str, name: str, template: Manifest, **spec: Any) -> Manifest:
    gone = ("node.kubernetes.io/unreachable", "node.kubernetes.io/not-ready")
    template["spec"]["tolerations"] = [
        {"key": key, "operator": "Exists", "effect": "NoExecute", "tolerationSeconds": _LOST_AFTER_S}
        for key in gone
    ]
    selector = {"matchLabels": labels_of(process=process) | {"app.kubernetes.io/instance": name}}
    return object_of("apps/v1", "Deployment", name, spec={"selector": selector, "template": template, **spec})


def _variables(**variables: str) -> list[Manifest]:
    return [
        {"name": name, "value": value} for name, value in {"MYVIEW_LOG_FORMAT": "json", **variables}.items()
    ]


def _checked(*words: str, period_s: int = 10, timeout_s: int = 10, failures: int = 6) -> Manifest:
    command = {"exec": {"command": [*_CHECK, *words]}}
    return {**command, "periodSeconds": period_s, "timeoutSeconds": timeout_s, "failureThreshold": failures}


def claim_of(mode: str, size: str) -> Manifest:
    """Return the specification of a claim to a volume."""
    return {"accessModes": [mode], "resources": {"requests": {"storage": size}}}


def sync(site: ContainerSite, image: str) -> Manifest:
    """Return the pulse server: at another start it goes on from its clients' counts."""
    secrets = site.secret_names("sync")
    authority = site.content["sync"].get("tls", {}).get("authority")
    template = _pod(
        site,
        "sync",
        "sync",
        ["sync"],
        secrets,
        image=image,
        env=_variables(**({"MYVIEW_SYNC__TLS__AUTHORITY": authority} if authority else {})),
        ports=[{"name": "pulses", "containerPort": SYNC_PORT}],
        startupProbe=_checked("sync", period_s=3, failures=60),
        readinessProbe=_checked("sync"),
        livenessProbe=_checked("sync"),
    )
    return _deployment("sync", "sync", template, replicas=1, strategy={"type": "Recreate"})


def camera(site: ContainerSite, image: str, camera_id: str) -> Manifest:
    """Return a camera's deployment: nothing but its process's end restarts it.

    A camera is not ready without its source or best view. To end it would help neither, and lose the numbers
    of people, which cameras keep while the best view is away.
    """
    name, secrets = camera_name(camera_id), site.secret_names("camera", camera_id)
    health = {"MYVIEW_HEALTH_URL": ",".join(site.addresses)}
    if site.config.http.tls.certificate:
        health["MYVIEW_HEALTH_CERTIFICATE"] = f"{SECRETS_FOLDER}/http.tls.certificate"
    if HEALTH_TOKEN in secrets:
        health["MYVIEW_HEALTH_TOKEN"] = f"{SECRETS_FOLDER}/{HEALTH_TOKEN}"
    template = _pod(
        site,
        "camera",
        name,
        ["camera", camera_id],
        secrets,
        image=image,
        env=_variables(**health),
        readinessProbe=_checked("camera", camera_id, timeout_s=4 + 4 * site.services, failures=3),
    )
    return _deployment("camera", name, template, replicas=1, strategy={"type": "Recreate"})


def bestview(site: ContainerSite, image: str) -> Manifest:
    """Return the best-view services: ordinals are indices, and each keeps its name and its recordings."""

    def get(path: str, **probe: int) -> Manifest:
        return {"httpGet": {"path": path, "port": "http", "scheme": site.scheme.upper()}, **probe}

    index = {"fieldRef": {"fieldPath": "metadata.labels['apps.kubernetes.io/pod-index']"}}
    template = _pod(
        site,
        "bestview",
        "bestview",
        ["bestview"],
        site.secret_names("bestview"),
        image=image,
        env=[*_variables(), {"name": "MYVIEW_VIEW__SHARDING__INDEX", "valueFrom": index}],
        ports=[{"name": "http", "containerPort": HTTP_PORT}, {"name": "bus", "containerPort": BUS_PORT}],
        startupProbe=get("/healthz", periodSeconds=2, timeoutSeconds=5, failureThreshold=90),
        readinessProbe=get("/readyz", periodSeconds=2, timeoutSeconds=2, failureThreshold=2),
        livenessProbe=get("/healthz", periodSeconds=5, timeoutSeconds=10, failureThreshold=6),
    )
    apart = {
        "topologyKey": "kubernetes.io/hostname",
        "labelSelector": {"matchLabels": labels_of(process="bestview")},
    }
    preferred = [{"weight": 100, "podAffinityTerm": apart}]
    template["spec"]["affinity"] = {
        "podAntiAffinity": {"preferredDuringSchedulingIgnoredDuringExecution": preferred}
    }
    spec: Manifest = {
        "serviceName": "bestview",
        "replicas": site.services,
        "podManagementPolicy": "Parallel",
        "selector": {"matchLabels": labels_of(process="bestview")},
        "template": template,
    }
    if site.config.record.folder:
        size = f"{math.ceil(1.1 * site.config.record.max_mb)}Mi"
        claim = {"metadata": {"name": "recordings"}, "spec": claim_of("ReadWriteOnce", size)}
        spec["volumeClaimTemplates"] = [claim]
    return object_of("apps/v1", "StatefulSet", "bestview", spec=spec)


def gateway(site: ContainerSite, image: str) -> Manifest:
    """Return the RTSP gateways, which know nothing of each other: the autoscaler sets their number."""
    certificate = site.content["rtsp"].get("tls", {}).get("certificate")
    template = _pod(
        site,
        "rtsp",
        "rtsp",
        ["rtsp"],
        site.secret_names("rtsp"),
        image=gateway_image(image),
        env=_variables(**({"MYVIEW_RTSP__TLS__CERTIFICATE": certificate} if certificate else {})),
        ports=[{"name": "rtsp", "containerPort": RTSP_PORT}],
        startupProbe=_checked("rtsp", period_s=3, failures=60),
        readinessProbe=_checked("rtsp", failures=2),
        livenessProbe=_checked("rtsp"),
    )
    return _deployment("rtsp", "rtsp", template)


def gateway_image(image: str) -> str:
    """Return the image with GStreamer, of the same tag: `registry/myview-rtsp:1` of `registry/myview:1`."""
    path, slash, last = image.rpartition("/")
    name, colon, tag = last.partition(":")
    return f"{path}{slash}{name}-rtsp{colon}{tag}"


class _Dumper(yaml.SafeDumper):
    """Without aliases, and with the lines of files as they are."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write what two places share twice."""
        del data
        return True


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="|" if "\n" in text else None)


_Dumper.add_representer(str, _text)


def dump(documents: list[Any]) -> str:
    """Write YAML documents."""
    written: str = yaml.dump_all(documents, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)
    return written
