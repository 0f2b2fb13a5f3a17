"""A site is not exposed to other machines by accident."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from fakes.cli.command_line import RunCommand, input_error
from fakes.http.tokens import token_entry, write_tokens
from fakes.paths import CONFIGS
from fakes.service.scripted_cameras import small_config
from server.cli.generated_config import DEMO
from server.config.loader import load_config
from server.config.sections import AccessSettings
from server.supervisor.exposure_checks import (
    check_bus,
    check_pulses,
    check_rtsp,
    check_viewers,
    is_local_host,
)
from server.system.errors import UserError

OUTSIDE = "0.0.0.0"  # noqa: S104 — what the tests are about


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.3.2.1", True),
        ("::1", True),
        ("localhost", True),
        (OUTSIDE, False),
        ("::", False),
        ("", False),
        ("10.0.0.5", False),
        ("server.example", False),
    ],
)
def test_loopback_hosts_are_recognized(host: str, expected: bool) -> None:
    assert is_local_host(host) == expected


def test_the_defaults_are_reachable_from_this_machine_only() -> None:
    for check in (check_viewers, check_pulses, check_bus):
        check(small_config())


def test_viewers_from_elsewhere_need_tokens_or_open_to_all(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"http\.host: .* access\.tokens .* access\.open_to_all: true"):
        check_viewers(small_config(http={"host": OUTSIDE}))
    check_viewers(small_config(http={"host": OUTSIDE}, access={"open_to_all": True}))
    tokens = tmp_path / "tokens.yaml"
    settings = {"http": {"host": OUTSIDE}, "access": {"tokens": str(tokens)}}
    with pytest.raises(UserError, match="cannot read the tokens"):
        check_viewers(small_config(**settings))
    write_tokens(tokens, token_entry("lead"))
    check_viewers(small_config(**settings))


@pytest.mark.parametrize(
    ("rtsp", "access", "is_refused"),
    [
        ({}, {}, False),
        ({"host": OUTSIDE}, {}, True),
        ({"host": OUTSIDE, "service": "http://127.0.0.1:8080"}, {}, True),
        ({"host": OUTSIDE, "service": "http://bestview:8080"}, {}, False),
        ({"host": OUTSIDE}, {"tokens": "tokens.yaml"}, False),
        ({"host": OUTSIDE}, {"open_to_all": True}, False),
    ],
)
def test_rtsp_clients_from_elsewhere_need_what_viewers_need(
    rtsp: dict[str, Any], access: dict[str, Any], *, is_refused: bool
) -> None:
    config = small_config(rtsp=rtsp, access=access)
    if is_refused:
        with pytest.raises(UserError, match=r"rtsp\.host: .* access\.tokens .* access\.open_to_all: true"):
            check_rtsp(config)
    else:
        check_rtsp(config)


@pytest.mark.parametrize(
    ("check", "section", "setting"),
    [
        (check_pulses, "sync", {"bind": OUTSIDE}),
        (check_bus, "zenoh", {"listen": f"tcp/{OUTSIDE}:7447"}),
        (check_bus, "zenoh", {"listen": "tcp/[::]:7447"}),
        (check_bus, "zenoh", {"listen": "udp/10.0.0.5:7447"}),
    ],
)
def test_bus_and_pulses_without_passwords_need_a_trusted_network(
    check: Any, section: str, setting: Any
) -> None:
    with pytest.raises(UserError, match=rf"{section}\.\w+: .* access\.trusted_network: true"):
        check(small_config(**{section: setting}))
    check(small_config(**{section: setting, "access": {"trusted_network": True}}))
    with pytest.raises(UserError):
        check(small_config(**{section: setting, "access": {"open_to_all": True}}))


@pytest.mark.parametrize(
    ("command", "changes", "setting"),
    [
        ("up", {"http": {"host": OUTSIDE}}, "http.host"),
        ("up", {"sync": {"bind": OUTSIDE}}, "sync.bind"),
        ("up", {"zenoh": {"listen": f"tcp/{OUTSIDE}:7447"}}, "zenoh.listen"),
        ("bestview", {"http": {"host": OUTSIDE}}, "http.host"),
        ("bestview", {"zenoh": {"listen": f"tcp/{OUTSIDE}:7447"}}, "zenoh.listen"),
        ("sync", {"sync": {"bind": OUTSIDE}}, "sync.bind"),
    ],
)
def test_every_command_that_listens_refuses_with_one_line(
    myview: RunCommand, tmp_path: Path, command: str, changes: dict[str, Any], setting: str
) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump({**DEMO, **changes}), encoding="utf-8")
    assert input_error(myview(command, str(path))).startswith(f"myview: {setting}: ")


def test_an_encrypted_bus_with_users_may_be_exposed() -> None:
    listen = f"{OUTSIDE}:7447"
    check_bus(small_config(zenoh={"listen": f"tls/{listen}", "users": "zenoh.users"}))
    for zenoh in ({"listen": f"tcp/{listen}", "users": "zenoh.users"}, {"listen": f"tls/{listen}"}):
        with pytest.raises(UserError, match=r"zenoh\.listen"):
            check_bus(small_config(zenoh=zenoh))


def test_encrypted_pulses_with_users_may_be_exposed() -> None:
    with pytest.raises(UserError, match=r"sync\.bind: .* sync\.users"):
        check_pulses(small_config(sync={"bind": OUTSIDE}))
    with pytest.raises(UserError, match=r"sync\.bind: .* sync\.tls"):
        check_pulses(small_config(sync={"bind": OUTSIDE, "users": "sync.users"}))
    tls = {"certificate": "sync.pem", "key": "sync.key"}
    check_pulses(small_config(sync={"bind": OUTSIDE, "users": "sync.users", "tls": tls}))


def test_the_secure_example_needs_tokens_and_passwords() -> None:
    config = load_config(CONFIGS / "secure.yaml")
    assert not is_local_host(config.http.host)
    assert not config.access.open_to_all
    assert not config.access.trusted_network
    assert config.sync.users == CONFIGS / "secret" / "sync.users"
    assert config.sync.tls.key == CONFIGS / "secret" / "sync.key"
    assert config.access.tokens == CONFIGS / "secret" / "tokens.yaml"
    assert config.http.tls.key == CONFIGS / "secret" / "https.key"
    assert config.zenoh.connect.startswith("tls/")
    assert config.zenoh.tls.authority == CONFIGS / "secret" / "authority.pem"
    check_pulses(config)
    check_bus(config.model_copy(update={"access": AccessSettings()}))
    with pytest.raises(UserError, match="cannot read the tokens"):
        check_viewers(config)
