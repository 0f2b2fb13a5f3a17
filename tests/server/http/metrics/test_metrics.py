"""/metrics of every stage, and /readyz."""

from __future__ import annotations

import asyncio
import time

import msgspec
import pytest
from prometheus_client.parser import text_string_to_metric_families

from fakes.prometheus.monitoring_files import ALERTS
from fakes.prometheus.promql_series import selectors
from fakes.service.fed_site import A, B, ServedSite, show_people
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    camera_tracks,
    encoded,
    status,
    tracks,
)
from server.http.metrics.event_loop_lag import LoopLag
from server.http.viewers.traffic import Traffic
from server.messaging.inbox import Message
from server.messaging.messages import FrameHeader, SolverReport, ZenohKeys
from server.service.readiness import max_normal_delay
from server.service.streaming.subscriber_queue import BytesChunk, Subscriber


async def samples(served: ServedSite) -> dict[tuple[str, ...], float]:
    """Return all samples of /metrics, by their name and the values of their labels, the bound last."""
    async with served.session.get("/metrics") as answer:
        text = await answer.text()
    found = {}
    for sample in (sample for family in text_string_to_metric_families(text) for sample in family.samples):
        labels = sorted(sample.labels.items(), key=lambda label: (label[0] == "le", label[0]))
        found[sample.name, *(value for _, value in labels)] = sample.value
    return found


async def test_a_cameras_stages_are_measured_by_its_reported_times(served: ServedSite) -> None:
    show_people(served)
    unit = encoded(0)[15]
    head = FrameHeader(pulse=unit.pulse, key=unit.key, boot=1, due=100.0, captured_at=100.03, encoded=100.04)
    served.service.ingest.receive_video(
        Message(ZenohKeys("hall").camera(A, "video"), unit.data, msgspec.msgpack.encode(head))
    )
    solve = SolverReport(objective=-4.0, bound=-4.2, gap=0.2, integral=False, rounds=3, limit="work")
    message = camera_tracks(A, 3, {1: SMALL}, solve=solve, detection_s=0.02, solve_s=0.2, solved_at=100.5)
    served.service.ingest.receive_tracks(
        tracks(msgspec.structs.replace(message, first=11, last=15, final_to=15))
    )
    served.service.ingest.receive_tracks(tracks(message))
    metrics = await samples(served)
    assert metrics["myview_stage_seconds_bucket", A, "take", "0.05"] == 16
    assert metrics["myview_stage_seconds_bucket", A, "take", "0.025"] == 15  # test data takes no time
    assert metrics["myview_stage_seconds_sum", A, "encode"] == pytest.approx(0.01)
    assert metrics["myview_stage_seconds_count", A, "search"] == 1
    assert metrics["myview_stage_seconds_sum", A, "solve"] == pytest.approx(0.2)
    assert metrics["myview_stage_seconds_count", B, "solve"] == 0
    assert metrics["myview_camera_windows_total", A] == 1
    assert metrics["myview_camera_optimal_windows_total", A] == 0
    assert metrics["myview_camera_gap_total", A] == pytest.approx(0.2)
    assert metrics["myview_camera_limited_windows_total", A, "work"] == 1
    assert metrics["myview_camera_limited_windows_total", A, "time"] == 0


async def test_metrics_of_a_cameras_status_appear_once_it_was_received(site_with_people: ServedSite) -> None:
    before = await samples(site_with_people)
    assert ("myview_camera_waiting_frames", A) not in before
    site_with_people.service.ingest.receive_status(status(A, waiting=7, fps=12.5, synchronized=False))
    metrics = await samples(site_with_people)
    assert metrics["myview_camera_waiting_frames", A] == 7
    assert metrics["myview_camera_fps", A] == 12.5
    assert metrics["myview_camera_synchronized", A] == 0


async def test_invalid_messages_are_counted_at_every_receiver(served: ServedSite) -> None:
    served.service.ingest.receive_tracks(Message(ZenohKeys("hall").camera(A, "tracks"), b"{", b""))
    served.service.ingest.receive_status(status(B, bad_messages=3))
    metrics = {key[1:]: value for key, value in (await samples(served)).items() if key[0] == _BAD}
    assert metrics == {(A, "sent"): 1, (B, "sent"): 0, (B, "received"): 3}


def test_the_alert_covers_invalid_messages_at_both_receivers() -> None:
    [alert] = [alert for alert in ALERTS if alert["alert"] == "MyViewInvalidMessages"]
    assert [selector.name for selector in selectors(alert["expr"])] == [_BAD]
    assert "way" not in alert["expr"]


_BAD = "myview_camera_bad_messages_total"


async def test_decisions_are_counted_by_epoch_and_sending_by_gop(site_with_people: ServedSite) -> None:
    metrics = await samples(site_with_people)
    assert metrics["myview_decide_seconds_count",] == 3
    assert metrics["myview_send_seconds_count",] == site_with_people.service.decision_state.end // GOP == 2
    assert metrics["myview_delay_seconds_count",] == 0  # unknown when pulses were due
    site_with_people.service.pulses.pulse0 = time.time() - 100.0
    site_with_people.service.feed(3, {A: {1: SMALL}, B: {1: LARGE}})
    metrics = await samples(site_with_people)
    assert metrics["myview_delay_seconds_count",] == 1
    assert metrics["myview_delay_seconds_sum",] == pytest.approx(100.0 - 2 * GOP / FPS, abs=5.0)
    assert metrics["myview_decided_pulse",] == 3 * GOP


async def test_missing_pictures_are_counted(served: ServedSite) -> None:
    served.service.connect_cameras(*CAMERAS)
    frame_buffer = served.service.frame_buffers[A]
    for epoch in range(2):
        served.service.feed(epoch, {A: {1: SMALL}, B: {1: LARGE}})
    del frame_buffer._pictures[7]
    served.service.feed(2, {A: {1: SMALL}, B: {1: LARGE}})
    metrics = await samples(served)
    assert metrics["myview_camera_lost_frames_total", A] == 1
    assert metrics["myview_camera_lost_frames_total", B] == 0


async def test_viewers_are_counted_by_kind_and_sent_bytes_are_counted(site_with_people: ServedSite) -> None:
    before = await samples(site_with_people)
    async with (
        site_with_people.session.get("/objects/1/best.mp4") as best,
        site_with_people.session.get("/cameras/c0/live.mp4") as live,
        site_with_people.session.get("/api/events") as events,
    ):
        received = len(await best.content.readany())
        received += len(await live.content.readany()) + len(await events.content.readany())
        metrics = await samples(site_with_people)
        kinds = {
            kind: metrics["myview_viewers_by_kind", kind] for kind in ("object", "camera", "events", "past")
        }
        assert kinds == {"object": 1, "camera": 1, "events": 1, "past": 0}
        assert metrics["myview_sent_bytes_total", "streams"] >= received > 0
    size = len(await (await site_with_people.session.get("/api/site")).read())
    after = await samples(site_with_people)
    answers = after["myview_sent_bytes_total", "answers"] - before["myview_sent_bytes_total", "answers"]
    assert answers >= size


async def test_gops_lost_by_slow_viewers_stay_counted_after_they_leave() -> None:
    sent, slow = Traffic(), Subscriber([], max_gops=2)
    sent.join(slow)
    for number in range(4):
        slow.put(BytesChunk(b"gop", random_access=True))
        assert sent.longest_queue == (number % 2) + 1
    assert sent.lost_gops == 2
    sent.leave(slow)
    assert (sent.lost_gops, sent.longest_queue) == (2, 0)


def measured(lag: LoopLag, name_end: str) -> float:
    """Return a sample of the histogram of a loop's lag."""
    [family] = lag.histogram.collect()
    return next(sample.value for sample in family.samples if sample.name.endswith(name_end))


async def test_a_blocked_event_loop_is_measured_as_late() -> None:
    lag = LoopLag(every_s=0.001)
    task = asyncio.create_task(lag.run())
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    time.sleep(0.06)  # noqa: ASYNC251 — what is measured
    while not measured(lag, "_count"):  # noqa: ASYNC110 — it is due
        await asyncio.sleep(0)
    task.cancel()
    assert measured(lag, "_sum") >= 0.05


async def ready(served: ServedSite) -> tuple[int, str]:
    async with served.session.get("/readyz") as answer:
        text = await answer.text()
    assert text.endswith("\n")
    assert text.count("\n") == 1
    return answer.status, text.strip()


async def test_a_site_is_ready_when_pulses_and_frames_arrive_and_decisions_keep_up(
    served: ServedSite,
) -> None:
    code, text = await ready(served)
    assert code == 503
    assert text.split("; ") == [
        "no pulse received from the pulse server",
        "no camera delivers frames",
        "nothing has been decided yet",
    ]
    show_people(served)
    assert await ready(served) == (200, "2 of 2 cameras")
    assert (await samples(served))["myview_ready",] == 1


async def test_a_site_whose_decisions_fall_behind_is_not_ready(site_with_people: ServedSite) -> None:
    allowed = max_normal_delay(site_with_people.service)
    site_with_people.service.pulses.newest = site_with_people.service.decision_state.end - 1 + allowed
    assert (await ready(site_with_people))[0] == 200
    site_with_people.service.pulses.newest += 1
    code, text = await ready(site_with_people)
    assert (code, text) == (503, f"decisions are {(allowed + 1) / FPS:.1f} s behind the pulses")
    assert (await samples(site_with_people))["myview_ready",] == 0


async def test_a_site_without_pulses_or_live_cameras_is_not_ready(site_with_people: ServedSite) -> None:
    site_with_people.service.pulses.received_at = time.monotonic() - 60.0
    assert await ready(site_with_people) == (503, "no pulse received for 60 s")
    site_with_people.service.pulses.received_at = time.monotonic()
    for camera in CAMERAS:
        site_with_people.service.ingest.set_present(
            ZenohKeys("hall").camera(camera, "alive"), is_present=False
        )
    assert await ready(site_with_people) == (503, "no camera delivers frames")
