"""A camera waits until every present best-view service has confirmed the end of its recording."""

from __future__ import annotations

import asyncio

import msgspec
import pytest

from fakes.timeouts import PATIENCE
from server.camera.end_confirmation import EndConfirmation
from server.messaging.inbox import Message
from server.messaging.messages import EndReceived

BOOT = 7
FIRST, SECOND = "myview/hall/bestview/alive", "myview/hall/bestview/1/alive"


def confirmation(service: str, boot: int = BOOT) -> Message:
    return Message("key", msgspec.msgpack.encode(EndReceived(service=service, boot=boot)), b"")


@pytest.fixture
def end() -> EndConfirmation:
    end = EndConfirmation("c0", BOOT)
    for service in (FIRST, SECOND):
        end.on_service(service, is_present=True)
    return end


async def test_all_present_services_must_confirm(end: EndConfirmation) -> None:
    waiting = asyncio.create_task(end.wait(PATIENCE))
    end.receive(confirmation(FIRST))
    await asyncio.sleep(0)
    assert not waiting.done()
    end.receive(confirmation(SECOND))
    assert await waiting


async def test_a_service_that_disappears_is_not_waited_for(end: EndConfirmation) -> None:
    waiting = asyncio.create_task(end.wait(PATIENCE))
    end.receive(confirmation(SECOND))
    await asyncio.sleep(0)
    assert not waiting.done()
    end.on_service(FIRST, is_present=False)
    assert await waiting


async def test_without_services_nothing_is_waited_for() -> None:
    assert await EndConfirmation("c0", BOOT).wait(PATIENCE)


@pytest.mark.parametrize(
    "message",
    [
        confirmation(SECOND, boot=BOOT - 1),
        Message("key", b"", b""),
        Message("key", b"\xff{", b""),
        Message("key", b"[1]", b""),
    ],
    ids=["earlier run", "empty", "damaged", "other"],
)
async def test_other_messages_confirm_nothing(end: EndConfirmation, message: Message) -> None:
    end.receive(confirmation(FIRST))
    end.receive(message)
    assert not await end.wait(0.0)
