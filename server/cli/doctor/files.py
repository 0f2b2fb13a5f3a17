"""Checks of the files that a configuration names: tokens, passwords, certificates and homographies."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from camsync.protocol import is_password
from server.cli.doctor.certificates import authority_finding, certificate_finding, router_finding
from server.cli.doctor.findings import Finding, bad, ok, report_failure, warning
from server.cli.doctor.reachability import host_and_port
from server.config.password_file import read_users
from server.config.pulse_access import SETTING, pulse_clients
from server.config.sections import ProcessTlsSettings
from server.config.site_config import Config
from server.config.tokens_file import read_tokens
from server.supervisor.exposure_checks import check_bus, check_pulses, check_viewers
from server.system.errors import UserError
from server.system.private_files import rights_of_others

_LINES = "write name:password, one a line, in a file that this user can read: docs/how-to/secure.md"


def file_findings(config: Config) -> list[Finding]:
    """Check that each file can be used, and that other users cannot read secrets or write access files."""
    findings: list[Finding] = []
    for check, find in _checks(config):
        with report_failure(check, findings):
            findings += find()
    return findings


def _checks(config: Config) -> Iterator[tuple[str, Callable[[], list[Finding]]]]:
    yield "access", lambda: _exposed(config)
    yield "access.tokens", lambda: _tokens(config)
    yield "ground", lambda: [_ground(config)]
    yield "http.tls", lambda: _pair("http.tls", config.http.tls.certificate, config.http.tls.key)
    yield "sync.tls", lambda: _process_tls("sync.tls", config.sync.tls, config.sync.host)
    router = host_and_port(config.zenoh.routers[0])
    yield "zenoh.tls", lambda: _process_tls("zenoh.tls", config.zenoh.tls, router and router[0])
    if config.sync.users is not None:
        yield SETTING, partial(_users, SETTING, config.sync.users, pulse_clients(config))
    if config.zenoh.users is not None:
        yield "zenoh.users", partial(_users, "zenoh.users", config.zenoh.users, config.camera_ids)
    for camera in config.cameras:
        if camera.password is not None:
            yield f"camera {camera.id}", partial(_private, f"camera {camera.id}", camera.password)


def _pair(check: str, certificate: Path | None, key: Path | None) -> list[Finding]:
    if certificate is None or key is None:
        return []
    return [certificate_finding(check, certificate, key), *_private(f"{check}.key", key)]


def _process_tls(check: str, tls: ProcessTlsSettings, host: str | None) -> list[Finding]:
    findings = _pair(check, tls.certificate, tls.key)
    if tls.authority is None:
        return findings
    findings.append(authority_finding(check, tls.authority))
    if tls.certificate is not None and tls.key is not None and host is not None:
        refused = router_finding(check, tls.certificate, tls.key, tls.authority, host)
        findings += [] if refused is None else [refused]
    return findings


def _exposed(config: Config) -> list[Finding]:
    findings: list[Finding] = []
    checks = [check_pulses, check_bus]
    if config.access.tokens is None:  # otherwise the check of the token file reports it
        checks.insert(0, check_viewers)
    for check in checks:
        try:
            check(config)
        except UserError as error:
            findings.append(bad("access", str(error)))
    return findings or [ok("access", "not open by accident")]


def _tokens(config: Config) -> list[Finding]:
    path = config.access.tokens
    if path is None:
        return []
    try:
        tokens = read_tokens(path)
    except UserError as error:
        return [bad("access.tokens", str(error), "`myview token NAME` prints a line for it")]
    operators = sum(token.role == "operate" for token in tokens)
    findings = [ok("access.tokens", f"{path}: {len(tokens)} tokens, {operators} of them for operators")]
    if not tokens:
        findings = [warning("access.tokens", f"{path} lets no one in", "`myview token NAME` makes one")]
    if rights_of_others(path) & (stat.S_IWGRP | stat.S_IWOTH):
        findings.append(
            warning(
                "access.tokens", f"others may write {path} and give themselves access", f"chmod 644 {path}"
            )
        )
    return findings


def _users(check: str, path: Path, names: Sequence[str]) -> list[Finding]:
    try:
        users = read_users(path, check)
    except UserError as error:
        return [bad(check, str(error).removeprefix(f"{check}: "), _LINES)]
    missing = [name for name in names if name not in users]
    findings = [ok(check, f"{path}: {len(users)} users")]
    if missing:
        remedy = "add a line for each on the server's machine; a camera's machine needs only its own"
        findings = [warning(check, f"{path} has no line for {', '.join(missing)}", remedy)]
    wrong = [name for name, password in users.items() if check == SETTING and not is_password(password)]
    if wrong:
        text = f"{path}: the passwords of {', '.join(wrong)} have spaces, or more than 128 characters"
        findings = [bad(check, text, "`openssl rand -hex 32` makes one")]
    return findings + _private(check, path)


def _private(check: str, path: Path) -> list[Finding]:
    try:
        open_to_others = rights_of_others(path)
    except OSError:
        return []  # reported already
    if not open_to_others:
        return []
    return [warning(check, f"others may read {path}, which is secret", f"chmod 600 {path}")]


def _ground(config: Config) -> Finding:
    without = [camera.id for camera in config.cameras if camera.ground is None]
    if not without:
        return ok("ground", "all cameras have a homography")
    if len(without) == len(config.cameras):
        return ok("ground", "no camera has a homography: people are matched by appearance alone")
    remedy = "`myview calibrate`, or the operator's page"
    return warning(
        "ground", f"{', '.join(without)}: no homography: people are matched by appearance alone there", remedy
    )
