"""Periodic tasks survive errors, which are logged."""

from __future__ import annotations

import asyncio
import ssl
from pathlib import Path

import pytest

from fakes.http.tokens import token_entry, write_tokens
from fakes.service.scripted_cameras import FedService, small_config
from server.http.access.authentication import Authenticator
from server.http.access.authorization import AccessControl
from server.http.access.permissions import ALL
from server.http.api.events import Audience, Events
from server.http.periodic import run_periodically
from server.http.tls import Certificate
from server.service.service import BestViewService


class Failing:
    """A step that fails some times before it succeeds; counts its calls."""

    def __init__(self, *errors: Exception) -> None:
        self._errors, self.times = list(errors), 0
        self.done = asyncio.Event()

    def __call__(self, *_: object) -> None:
        self.times += 1
        if self._errors:
            raise self._errors.pop(0)
        self.done.set()


async def test_a_failing_step_is_logged_once_and_retried(caplog: pytest.LogCaptureFixture) -> None:
    failing = Failing(ValueError("one"), ValueError("one"), KeyError("other"))

    async def turn() -> None:
        failing()

    task = asyncio.create_task(run_periodically(0.0, turn, "counting"))
    await failing.done.wait()
    task.cancel()
    assert failing.times >= 4
    assert [str(record.exc_info and record.exc_info[1]) for record in caplog.records] == ["one", "'other'"]
    assert caplog.messages[0].startswith("counting failed")


async def is_retried(task: asyncio.Task[None], failing: Failing) -> bool:
    """Return whether a failed step is retried."""
    await asyncio.wait([task, asyncio.create_task(failing.done.wait())], return_when="FIRST_COMPLETED")
    is_done = task.done()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    return not is_done and failing.times > 1


async def test_lists_are_published_after_a_failed_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.http.api.events._LISTS_EVERY_S", 0.001)
    service, failing = FedService(small_config()), Failing(RuntimeError("unexpected error"))
    events = Events(BestViewService(service))
    events.join(Audience(ALL))
    monkeypatch.setattr(events, "_publish_changed", failing)
    assert await is_retried(asyncio.create_task(events.run()), failing)
    service.close()


async def test_tokens_are_checked_after_a_failed_reload_and_expired_requests_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.http.access.authorization._CHECK_EVERY_S", 0.001)
    failing, over = Failing(RuntimeError("unexpected error")), Failing()
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("desk"))
    access = AccessControl(Authenticator(tokens, "hall"), lambda number: number)
    monkeypatch.setattr(access.authenticator.file, "reload_if_changed", failing)
    monkeypatch.setattr(access, "end_expired", over)
    assert await is_retried(asyncio.create_task(access.run()), failing)
    assert over.times >= failing.times > 1


async def test_the_certificate_is_checked_after_a_failed_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.http.tls._CHECK_EVERY_S", 0.001)
    certificate, failing = Certificate.__new__(Certificate), Failing(RuntimeError("not thought of"))
    monkeypatch.setattr(certificate, "reload_if_changed", failing)
    assert await is_retried(asyncio.create_task(certificate.run()), failing)


def test_a_half_done_renewal_is_loaded_when_it_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Context:
        """A reload that accepts any file."""

        sni_callback: object = None

        def load_cert_chain(self, certificate: Path, key: Path, password: object) -> None:
            del key, password
            if outcomes:
                raise FileNotFoundError(2, "No such file or directory", str(certificate))

    outcomes: list[bool] = []
    monkeypatch.setattr(ssl, "create_default_context", lambda _: Context())
    files = [tmp_path / "c.pem", tmp_path / "k.pem"]
    for file in files:
        file.write_text("old", encoding="utf-8")
    certificate = Certificate(*files)
    before = certificate._newest
    files[0].write_text("newer", encoding="utf-8")
    outcomes.append(True)  # after it was read, before it was loaded
    certificate.reload_if_changed()
    certificate.reload_if_changed()
    assert certificate._newest is before
    assert [message for message in caplog.messages if "stays in force" in message] == caplog.messages[:1]
    assert "No such file or directory" in caplog.messages[0]
    outcomes.clear()
    certificate.reload_if_changed()
    assert certificate._newest is not before, "although the file is unchanged"
