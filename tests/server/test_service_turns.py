"""However much there is to decide, others have their turn; what is decided is the same."""

from __future__ import annotations

import asyncio

from cameras_by_hand import (
    CAMERAS,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    encoded,
    small_config,
    tracks,
    video,
    word,
)

from server.view.choice.decide import GopDecision
from server.wire.epochs import end_of_epoch

EPOCHS = 8


def behind() -> FedService:
    """Give a service that has heard all cameras, and decided nothing."""
    service = FedService(small_config())
    service.come(*CAMERAS)
    for epoch in range(EPOCHS):
        for seed, camera in enumerate(CAMERAS):
            for unit in encoded(seed)[epoch * STRIDE : (epoch + 1) * STRIDE]:
                service.intake.video(video(camera, unit))
            boxes = {1: LARGE if (epoch + seed) % 4 < 2 else SMALL}
            service.intake.tracks(tracks(word(camera, epoch, boxes)))
    service.pulse = end_of_epoch(EPOCHS - 1, STRIDE)
    return service


def noted(service: FedService) -> list[GopDecision]:
    """Collect what a service decides."""
    decided: list[GopDecision] = []
    publish = service._publish

    def note(decision: GopDecision) -> None:
        decided.append(decision)
        publish(decision)

    service._publish = note  # type: ignore[method-assign]
    return decided


async def test_between_two_epochs_others_have_their_turn() -> None:
    service, turns = behind(), list[int]()
    deciding = asyncio.create_task(service.decide_by_turns())
    while not deciding.done():
        turns.append(service.aligner._next or 0)
        await asyncio.sleep(0)
    assert turns[: EPOCHS + 1] == list(range(EPOCHS + 1))
    service.close()


async def test_who_is_told_to_end_does_not_finish_first() -> None:
    service = behind()
    deciding = asyncio.create_task(service.decide_by_turns())
    await asyncio.sleep(0)
    deciding.cancel()
    await asyncio.gather(deciding, return_exceptions=True)
    assert deciding.cancelled()
    assert service.aligner._next == 1
    service.close()


async def test_by_turns_or_at_once_the_same_is_decided() -> None:
    one, other = behind(), behind()
    at_once, by_turns = noted(one), noted(other)
    one.decide()
    await other.decide_by_turns()
    assert [it.choices for it in at_once] == [it.choices for it in by_turns]
    assert len(at_once) > 1
    one.close()
    other.close()
