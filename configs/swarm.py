"""A site for Docker Swarm, from the compose files, which Swarm does not read as they are.

    docker compose -f docker-compose.yml -f docker-compose.standby.yml config --format json |
        python3 configs/swarm.py | docker stack deploy --resolve-image never -c - myview

It needs nothing but Python. Limits and restart policy are moved to where Swarm looks for them, networks span
machines, and what Swarm does not know is left out. Processes start in any order and wait for each other.
Ports are those of the machine that a service runs on, and names lead to containers without Swarm's balancer,
which would hide viewers' addresses and break connections that last.
docs/how-to/scale.md, "Several services".
"""

from __future__ import annotations

import json
import sys
from typing import Any

Section = dict[str, Any]

_DROPPED = ("build", "depends_on", "devices", "entrypoint", "pull_policy", "security_opt")
_LIMITS = {"cpus": "cpus", "mem_limit": "memory", "pids_limit": "pids"}
"""Where a service's limits are found, and what Swarm calls them."""
_COMPOSE_ONLY = ("cpu_shares", "memswap_limit", "restart", "tmpfs", *_LIMITS)
_CONDITIONS = {"unless-stopped": "any", "always": "any", "on-failure": "on-failure", "no": "none"}
_UNHEALTHY_AFTER = 6
"""Failed health checks after which Swarm ends a container."""
_DELAY = "1s"
"""Before a container is started again."""


class CannotConvertError(Exception):
    """The site would not be in Swarm what it is in Compose; the text says why, and what to do."""


def stack_of(project: Section) -> Section:
    """Return the stack of a project, as `docker compose config` prints it.

    Raises:
        CannotConvertError: Swarm cannot run it so.
    """
    networks = {
        name: {"driver": "overlay", **({"internal": True} if (network or {}).get("internal") else {})}
        for name, network in project["networks"].items()
    }
    services = {name: _service(name, service) for name, service in project["services"].items()}
    secrets = {name: {"file": secret["file"]} for name, secret in project.get("secrets", {}).items()}
    return {
        "version": "3.13",
        "services": services,
        "networks": networks,
        **({"secrets": secrets} if secrets else {}),
    }


def _service(name: str, service: Section) -> Section:
    kept = {
        key: value
        for key, value in service.items()
        if key not in {*_DROPPED, *_COMPOSE_ONLY} and value is not None
    }
    limits = {of: str(service[key]) for key, of in _LIMITS.items() if key in service}
    if "pids" in limits:
        limits["pids"] = int(service["pids_limit"])
    kept["deploy"] = {
        "endpoint_mode": "dnsrr",
        "resources": {"limits": limits},
        "restart_policy": {"condition": _CONDITIONS[service.get("restart", "no")], "delay": _DELAY},
    }
    kept["networks"] = list(service["networks"])
    kept["volumes"] = [*map(_mount, service.get("volumes", ())), *map(_memory, service.get("tmpfs", ()))]
    if "healthcheck" in service:
        kept["healthcheck"] = _health(service)
    if "ports" in service:
        kept["ports"] = [_port(name, port) for port in service["ports"]]
    return kept


def _health(service: Section) -> Section:
    """Swarm ends what is unhealthy, which Compose only reports.

    A camera is unhealthy without its source or best view. To end it would help neither, and lose the numbers
    of people, which cameras keep while the best view is away. Others may be slow on a busy machine.
    """
    if service["command"][0] == "camera":
        return {"disable": True}
    return {**service["healthcheck"], "timeout": "30s", "retries": _UNHEALTHY_AFTER}


def _mount(volume: Section) -> Section:
    return {key: value for key, value in volume.items() if key in {"type", "source", "target", "read_only"}}


def _memory(tmpfs: str) -> Section:
    """Convert ``/tmp:size=256m``."""
    target, _, options = tmpfs.partition(":")
    size = options.removeprefix("size=")
    unit = {"k": 1 << 10, "m": 1 << 20, "g": 1 << 30}
    size_bytes = int(size[:-1]) * unit[size[-1]] if size[-1:] in unit else int(size or 0)
    return {"type": "tmpfs", "target": target, "tmpfs": {"size": size_bytes}}


def _port(name: str, port: Section) -> Section:
    if port.get("host_ip", "0.0.0.0") != "0.0.0.0":  # noqa: S104 — compared, not listened on
        raise CannotConvertError(
            f"{name}: Swarm publishes a port on every address of a machine, not on {port['host_ip']} alone; "
            "where that is wanted, set MYVIEW_PUBLISH=8080 and MYVIEW_PUBLISH_1=8081"
        )
    return {"target": port["target"], "published": int(port["published"]), "mode": "host"}


def main() -> int:
    """Convert standard input to standard output."""
    try:
        json.dump(stack_of(json.load(sys.stdin)), sys.stdout, indent=1)
    except CannotConvertError as error:
        print(error, file=sys.stderr)
        return 2
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        print(f"this is not what docker compose config --format json prints: {error!r}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
