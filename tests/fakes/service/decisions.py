"""Decisions of a best-view service: constructed ones, and those that a service makes."""

from __future__ import annotations

from bestview import Merge, Split
from fakes.service.running_service import send_epoch
from fakes.service.scripted_cameras import (
    CAMERAS,
    GOP,
    LARGE,
    NO_REASON,
    SMALL,
    STRIDE,
    FedService,
    small_config,
)
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import NumberedBox
from server.service.view_selection.decider import GopDecision, ObjectChoice

EPOCHS = 8


def service_with_backlog() -> FedService:
    """Return a service that has received all epochs, and decided none."""
    service = FedService(small_config())
    service.connect_cameras(*CAMERAS)
    for epoch in range(EPOCHS):
        boxes = {camera: LARGE if (epoch + seed) % 4 < 2 else SMALL for seed, camera in enumerate(CAMERAS)}
        send_epoch(service, epoch, *CAMERAS, boxes=boxes)
    service.pulses.newest = end_of_epoch(EPOCHS - 1, STRIDE)
    return service


def collect_decisions(service: FedService) -> list[GopDecision]:
    """Return a list that collects the decisions of a service."""
    decisions: list[GopDecision] = []
    publish = service._publish

    def note(decision: GopDecision) -> None:
        decisions.append(decision)
        publish(decision)

    service._publish = note  # type: ignore[method-assign]
    return decisions


def decision(
    gop: int,
    *choices: ObjectChoice,
    frames: int = GOP,
    corrections: tuple[Merge | Split, ...] = (),
    **boxes: list[list[NumberedBox]],
) -> GopDecision:
    empty: list[list[NumberedBox]] = [[]] * frames
    boxes_of_camera = {camera: boxes.get(camera, empty) for camera in CAMERAS}
    return GopDecision(gop * GOP, frames, choices, boxes_of_camera, {}, corrections, NO_REASON)


def choice(number: int, camera: str | None, before: str | None = None, *, away: bool = False) -> ObjectChoice:
    return ObjectChoice(number, camera, before, away)
