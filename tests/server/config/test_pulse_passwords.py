"""Pulse server with users: every process logs in over TLS, and errors are one line."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
import yaml

from camsync import Credentials, PulseClient, query_clients
from fakes.cli.command_line import RunCommand, input_error
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.loader import load_config
from server.config.pulse_access import pulse_client_tls, pulse_clients, pulse_credentials, pulse_users
from server.config.running_config import ActiveConfig
from server.config.site_config import Config
from server.supervisor.sync_process import sync_process
from server.system.errors import UserError

LONG = "0123456789abcdef" * 2
RIGHT = f"c0:{LONG}\nbestview:{LONG}!\nauditor:{LONG}?\n"


def site(folder: Path, users: str | None = RIGHT, **changes: Any) -> Path:
    """Write a site's configuration, and its file of passwords."""
    if users is not None:
        (folder / "sync.users").write_text(users, encoding="utf-8")
    path = folder / "site.yaml"
    content = {
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "sync": {"port": free_port(), "users": "sync.users"},
        **changes,
    }
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def test_the_server_reads_all_passwords_and_a_client_its_own(tmp_path: Path) -> None:
    config = load_config(site(tmp_path))
    assert pulse_users(config) == {"c0": LONG, "bestview": LONG + "!", "auditor": LONG + "?"}
    assert pulse_credentials(config, "c0") == Credentials("c0", LONG)
    assert LONG not in repr(pulse_credentials(config, "c0")), "nor is it in any log"


def test_without_a_file_no_login_is_needed(tmp_path: Path) -> None:
    config = load_config(site(tmp_path, sync={"port": 7400}))
    assert (pulse_users(config), pulse_credentials(config, "c0")) == (None, None)


def test_a_client_needs_only_its_own_line(tmp_path: Path) -> None:
    config = load_config(site(tmp_path, f"c0:{LONG}\n"))
    assert pulse_credentials(config, "c0") == Credentials("c0", LONG)
    with pytest.raises(UserError, match="has no line for 'bestview', the name of this process"):
        pulse_credentials(config, "bestview")


def test_every_service_of_a_site_needs_a_line(tmp_path: Path) -> None:
    config = load_config(site(tmp_path, view={"sharding": {"of": 3}}))
    assert pulse_clients(config) == ("c0", "bestview", "bestview-1", "bestview-2")
    with pytest.raises(UserError, match="has no line for bestview-1, bestview-2: pulses would wait"):
        pulse_users(config)


@pytest.mark.parametrize(
    ("users", "error"),
    [
        (None, r"sync\.users: cannot read .*sync\.users: No such file"),
        ("c0\n", "line 1 is not name:password"),
        (f"c0:{LONG}\nc0:{LONG}\n", "lines 1 and 2 are for the same name"),
        (f"c0:{LONG}\nbestview:secret word\n", "the password of 'bestview' must have 1 to 128 printable"),
        (f"c0:{LONG}\n", "has no line for bestview"),
    ],
)
def test_a_server_with_missing_or_invalid_passwords_fails_with_one_line(
    myview: RunCommand, tmp_path: Path, users: str | None, error: str
) -> None:
    path = site(tmp_path, users)
    with pytest.raises(UserError, match=error) as caught:
        pulse_users(load_config(path))
    line = input_error(myview("sync", path))
    assert line == f"myview: {caught.value}"
    assert "secret" not in line


async def test_the_pulse_server_admits_clients_with_a_password(tmp_path: Path) -> None:
    running = ActiveConfig(site(tmp_path))
    serving = asyncio.create_task(sync_process(running))
    try:
        async with asyncio.timeout(PATIENCE):
            await _receive_pulses(running.now)
            sync = running.now.sync
            auditor = pulse_credentials(running.now, "auditor")
            assert await query_clients(sync.host, sync.port, PATIENCE, credentials=auditor) == ()
    finally:
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)


async def _receive_pulses(config: Config) -> None:
    """Connect as all clients that the server waits for."""
    sync = config.sync

    async def first(name: str) -> None:
        client = PulseClient(
            sync.host,
            sync.port,
            name,
            credentials=pulse_credentials(config, name),
            tls=pulse_client_tls(config),
        )
        async with client:
            assert not (await anext(client)).local

    await asyncio.gather(*(first(name) for name in pulse_clients(config)))
