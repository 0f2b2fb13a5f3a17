"""The files that a configuration names: who may come, by which certificates, and where cameras stand."""

from __future__ import annotations

import stat
from collections.abc import Sequence
from pathlib import Path

from server.run.doctor_certificate import certificate_finding
from server.run.doctor_findings import Finding, bad, ok, warning
from server.run.exposed import check_bus, check_pulses, check_viewers
from server.wire.config import Config
from server.wire.errors import UserError
from server.wire.pulse_users import SETTING, SHORTEST, pulse_clients
from server.wire.tokens import read_tokens
from server.wire.users import read_users


def file_findings(config: Config) -> list[Finding]:
    """Say of each file whether it can be used, and who else may read or write it."""
    found = [*_exposed(config), *_tokens(config), _ground(config)]
    for check, tls in (("http.tls", config.http.tls), ("zenoh.tls", config.zenoh.tls)):
        if tls.certificate is not None and tls.key is not None:
            found.append(certificate_finding(check, tls.certificate, tls.key))
            found += _private(f"{check}.key", tls.key)
    for check, users, names in (
        (SETTING, config.sync.users, pulse_clients(config)),
        ("zenoh.users", config.zenoh.users, config.camera_ids),
    ):
        if users is not None:
            found += _users(check, users, names)
    for camera in config.cameras:
        if camera.password is not None:
            found += _private(f"camera {camera.id}", camera.password)
    return found


def _exposed(config: Config) -> list[Finding]:
    found = []
    for check in (check_viewers, check_pulses, check_bus):
        try:
            check(config)
        except UserError as error:
            found.append(bad("access", str(error)))
    return found or [ok("access", "nobody is let in by accident")]


def _tokens(config: Config) -> list[Finding]:
    path = config.access.tokens
    if path is None:
        return []
    try:
        tokens = read_tokens(path)
    except UserError as error:
        return [bad("access.tokens", str(error))]
    operators = sum(it.role == "operate" for it in tokens)
    found = [ok("access.tokens", f"{path}: {len(tokens)} tokens, {operators} of them operate")]
    if not tokens:
        found = [warning("access.tokens", f"{path} lets nobody in", "`myview token NAME` makes one")]
    if path.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        found.append(
            warning("access.tokens", f"others may write {path}: let themselves in", f"chmod 644 {path}")
        )
    return found


def _users(check: str, path: Path, names: Sequence[str]) -> list[Finding]:
    try:
        users = read_users(path, check)
    except UserError as error:
        return [bad(check, str(error).removeprefix(f"{check}: "))]
    missing = [it for it in names if it not in users]
    short = [name for name, password in users.items() if len(password) < SHORTEST]
    found = [ok(check, f"{path}: {len(users)} users")]
    if missing:
        do = "a line for each, where the server runs; a camera's machine needs its own alone"
        found = [warning(check, f"{path} has no line for {', '.join(missing)}", do)]
    if short and check == SETTING:
        text = f"{path}: less than {SHORTEST} characters are the passwords of {', '.join(short)}"
        found = [bad(check, text, "`openssl rand -hex 32` makes one")]
    return found + _private(check, path)


def _private(check: str, path: Path) -> list[Finding]:
    try:
        open_to_others = path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    except OSError:
        return []  # that it cannot be read is said already
    if not open_to_others:
        return []
    return [warning(check, f"others may read {path}, which is secret", f"chmod 600 {path}")]


def _ground(config: Config) -> Finding:
    without = [it.id for it in config.cameras if it.ground is None]
    if not without:
        return ok("ground", "all cameras know where they stand")
    if len(without) == len(config.cameras):
        return ok("ground", "no camera knows where it stands: people are told apart by looks alone")
    do = "`myview calibrate`, or the operator's page"
    return warning("ground", f"{', '.join(without)}: not in the file: known by looks alone", do)
