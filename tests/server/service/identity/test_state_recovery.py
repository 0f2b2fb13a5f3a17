"""A restarted service recovers person numbers from the snapshots that the cameras retain."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Mapping

import msgspec
import pytest
from aiohttp.test_utils import TestClient, TestServer
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    camera_tracks,
    small_config,
    tracks,
)
from server.camera.retained_identity_snapshot import RetainedIdentitySnapshot
from server.http.app import make_app
from server.messaging.camera_identity_snapshot import (
    PERSON_NUMBER_MAX,
    SNAPSHOT_BYTES_MAX,
    CameraIdentitySnapshot,
    PersonSnapshot,
)
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import Box, ZenohKeys
from server.service.deletion.memory_removal import forget_people
from server.service.identity.state_recovery import (
    MAX_DOWNTIME_S,
    SINGLE_CAMERA_NUMBER_MAX,
    StateRecovery,
    trusted_first_free,
)
from server.service.identity.state_replication import SNAPSHOT_WAIT_S, StateReplication
from server.service.service import BestViewService

A, B = CAMERAS
KEYS = ZenohKeys("hall")
Seen = Mapping[str, Mapping[int, Box]]
ALL: Seen = {A: {1: SMALL, 2: LARGE}, B: {3: LARGE}}
"""The visible tracks by camera."""


class Site:
    """Cameras that keep running while the service is restarted."""

    def __init__(self, **changes: object) -> None:
        self._changes = changes
        self.cameras = {
            camera: RetainedIdentitySnapshot(lambda snapshot, name=camera: self._receive(name, snapshot))
            for camera in CAMERAS
        }
        self.service = FedService(small_config())

    def start(self, *, without_snapshot: str | None = None) -> FedService:
        """Restart the service; all cameras but one notice it and send their snapshots."""
        self.service = service = FedService(small_config(**self._changes))
        service.state_replication._send = self._send_identities
        for camera in CAMERAS:
            for part in (service.ingest, service.state_replication):
                part.set_present(KEYS.camera(camera, "alive"), is_present=True)
            if camera != without_snapshot:
                self.cameras[camera].on_service(is_present=True)
        return service

    def track_epochs(self, epochs: Iterable[int], seen: Seen = ALL, boot: int = 1) -> None:
        """Push epochs with these tracks, without pictures."""
        for epoch in epochs:
            for camera in CAMERAS:
                self.service.ingest.receive_tracks(
                    tracks(camera_tracks(camera, epoch, seen[camera], boot=boot))
                )
            self.service.pulses.newest = end_of_epoch(epoch, STRIDE)
            self.service.decide()

    def person_of(self, camera: str, track: int, epoch: int, boot: int = 1) -> int:
        """Return the person number of a track."""
        number = self.service.decider.people.person_of(camera, boot, track, end_of_epoch(epoch, STRIDE))
        assert number is not None
        return number

    def _send_identities(self, camera: str, payload: bytes) -> None:
        self.cameras[camera].replace(Message(KEYS.camera(camera, "identities"), payload, b""))

    def _receive(self, camera: str, payload: bytes) -> None:
        self.service._retained_identities(Message(KEYS.camera(camera, "retained_identities"), payload, b""))


def tracked_site(*, merge: bool = False, **changes: object) -> Site:
    """Run a service in which camera A's track 2 is Ann; ``merge``: its track 1 is merged into her."""
    site = Site(**changes)
    site.start()
    site.track_epochs(range(4))
    people = site.service.decider.people
    people.registry.set_name(site.person_of(A, 2, 3), "Ann")
    if merge:
        people.merge(site.person_of(A, 2, 3), site.person_of(A, 1, 3))
    site.track_epochs(range(4, 6))
    return site


AFTER_RESTART: Seen = {A: {9: SMALL, 2: LARGE}, B: {3: LARGE}}
"""A's track 1 has ended, and a new one comes first."""


def test_a_person_tracked_through_a_restart_keeps_number_and_name() -> None:
    site = tracked_site()
    before = [site.person_of(A, 1, 5), site.person_of(A, 2, 5), site.person_of(B, 3, 5)]
    site.start()
    site.track_epochs(range(7, 9), AFTER_RESTART)
    assert [site.person_of(A, 2, 8), site.person_of(B, 3, 8)] == before[1:]
    assert site.person_of(A, 9, 8) > max(before), "no number is used twice"
    assert site.service.decider.people.registry.names == {before[1]: "Ann"}
    assert site.service.decider.people.overrides.merged == {}


@pytest.mark.parametrize("cut_off", [False, True])
def test_a_deleted_person_is_restored_from_no_camera(cut_off: bool) -> None:
    site = tracked_site()
    ann, other = site.person_of(A, 2, 5), site.person_of(A, 1, 5)
    stale = site.cameras[A]
    if cut_off:  # camera A does not hear of it, and keeps Ann
        site.cameras[A] = RetainedIdentitySnapshot(lambda _: None)
    forget_people(site.service, [ann])
    site.track_epochs(range(6, 8))
    site.cameras[A] = stale
    site.start()
    site.track_epochs(range(9, 12))
    people = site.service.decider.people
    assert people.registry.names == {}
    assert ann not in people.known
    assert {site.person_of(A, 2, 11), site.person_of(B, 3, 11)}.isdisjoint({ann})
    assert site.person_of(A, 1, 11) == other
    assert site.service.state_replication.forgotten == [ann]


def test_a_person_who_is_deleted_before_their_track_reappears_stays_deleted() -> None:
    site = tracked_site()
    ann = site.person_of(A, 2, 5)
    site.start()
    site.track_epochs(range(7, 8), {A: {1: SMALL}, B: {}})
    forget_people(site.service, [ann])
    site.track_epochs(range(8, 11))
    assert site.service.decider.people.registry.names == {}
    assert site.person_of(A, 2, 10) != ann


def test_numbers_survive_any_number_of_restarts() -> None:
    site = tracked_site()
    before = [site.person_of(A, 1, 5), site.person_of(A, 2, 5), site.person_of(B, 3, 5)]
    for run in range(1, 4):
        site.start()
        site.track_epochs(range(6 * run, 6 * run + 5))
        last = 6 * run + 4
        assert [site.person_of(A, 1, last), site.person_of(A, 2, last), site.person_of(B, 3, last)] == before


def test_manual_merges_survive_a_restart() -> None:
    site = tracked_site(merge=True)
    kept, (old,) = site.person_of(A, 2, 5), site.service.decider.people.registry.merged
    site.start()
    site.track_epochs(range(7, 8), {A: {2: LARGE}, B: {}})
    site.track_epochs(range(8, 12))  # the other track reappears later
    people = site.service.decider.people
    assert site.person_of(A, 1, 11) == site.person_of(A, 2, 11) == kept
    assert people.registry.merged[old] == kept, "links with the old number stay valid"
    assert people.registry.names == {kept: "Ann"}


def test_a_camera_whose_last_window_was_late_is_recovered() -> None:
    site = tracked_site()
    before = site.person_of(B, 3, 5)
    site.track_epochs(range(6, 7), {A: {1: SMALL, 2: LARGE}, B: {}})
    site.start()
    site.track_epochs(range(7, 9))
    assert site.person_of(B, 3, 8) == before


def test_tracks_of_a_restarted_camera_are_not_recovered_as_earlier_ones() -> None:
    site = tracked_site()
    site.track_epochs(range(6, 7), {A: {2: SMALL}, B: {}}, boot=2)
    before, used = site.person_of(A, 2, 6, boot=2), site.service.decider.people.identity.next_id
    site.start()
    site.track_epochs(range(7, 9), {A: {1: SMALL, 2: LARGE}, B: {}}, boot=2)
    assert site.person_of(A, 2, 8, boot=2) == before
    assert site.person_of(A, 1, 8, boot=2) >= used


def test_a_number_too_large_to_retain_does_not_affect_others() -> None:
    site = tracked_site()
    ann = site.person_of(A, 2, 5)
    site.service.decider.people.registry.add_aliases(ann, [PERSON_NUMBER_MAX + 1])
    site.track_epochs(range(6, 7))
    site.start()
    site.track_epochs(range(7, 9))
    assert site.person_of(A, 2, 8) == ann
    assert site.service.decider.people.registry.names == {ann: "Ann"}


def test_numbering_begins_with_the_first_number_however_late_a_camera_connects() -> None:
    site = Site()
    service = site.service = FedService(small_config())  # no camera has connected
    assert service.state_replication.numbers_since == 0, "no number was assigned"
    before = time.time() - 60
    site.track_epochs(range(4))
    assert site.person_of(A, 1, 3)
    assert service.state_replication.numbers_since > before, "an older token may be for another person"


def test_without_a_cameras_snapshot_only_its_tracks_get_new_numbers() -> None:
    site = tracked_site()
    ann, other = site.person_of(A, 2, 5), site.person_of(B, 3, 5)
    site.cameras[B] = RetainedIdentitySnapshot(
        lambda snapshot: site._receive(B, snapshot)
    )  # restarted as well
    site.start()
    site.track_epochs(range(7, 9))
    assert site.person_of(A, 2, 8) == ann
    assert site.person_of(B, 3, 8) not in {ann, other}, "it is unknown, so it has a new number"


LONG_AFTER = 6 + int(MAX_DOWNTIME_S * FPS / STRIDE)


@pytest.mark.parametrize(
    ("epochs", "boot"),
    [
        (range(7, 9), 2),  # the camera restarted: its tracks are other people
        (range(LONG_AFTER, LONG_AFTER + 2), 1),  # after a long downtime
        (range(2), 1),  # pulses restarted
    ],
)
def test_no_number_or_name_is_assigned_that_may_be_another_persons(epochs: range, boot: int) -> None:
    site = tracked_site()
    used = max(site.service.decider.people.registry.all_numbers)
    site.start()
    site.track_epochs(epochs, boot=boot)
    people = site.service.decider.people
    assert people.known
    assert min(people.known) > used
    assert people.registry.names == {}


def test_a_late_snapshot_prevents_numbers_from_being_used_twice() -> None:
    site = tracked_site()
    used = max(site.service.decider.people.registry.all_numbers)
    site.cameras[A] = RetainedIdentitySnapshot(lambda snapshot: site._receive(A, snapshot))
    site.start(without_snapshot=B)
    site.track_epochs(range(7, 8), {A: {}, B: {}})
    site.cameras[B].on_service(is_present=True)
    site.track_epochs(range(8, 10))
    assert min(site.service.decider.people.known) > used


def test_a_late_snapshot_is_used() -> None:
    site = tracked_site()
    ann, b = site.person_of(A, 2, 5), site.person_of(B, 3, 5)
    site.start(without_snapshot=B)
    site.track_epochs(range(7, 8), {A: {2: LARGE}, B: {}})
    assert site.service.state_replication.is_known_or_recoverable(b), "camera B may still connect"
    site.cameras[B].on_service(is_present=True)
    site.track_epochs(range(8, 12), {A: {2: LARGE, 9: SMALL}, B: {3: LARGE}})
    assert [site.person_of(A, 2, 11), site.person_of(B, 3, 11)] == [ann, b]


def test_numbers_of_a_late_snapshot_that_may_be_reassigned_are_ignored() -> None:
    site = tracked_site()
    before = [site.person_of(A, 1, 5), site.person_of(A, 2, 5), site.person_of(B, 3, 5)]
    site.cameras[A] = RetainedIdentitySnapshot(lambda snapshot: site._receive(A, snapshot))
    site.start(without_snapshot=B)
    site.track_epochs(range(7, 8), {A: {1: SMALL, 2: LARGE}, B: {}})
    assert site.person_of(A, 1, 7) in before, "no snapshot listed it as used"
    site.cameras[B].on_service(is_present=True)
    site.track_epochs(range(8, 12))
    assert site.person_of(B, 3, 11) > max(before)
    assert site.service.decider.people.registry.names == {}


def test_a_late_track_gets_the_current_number_of_its_merged_person() -> None:
    site = Site()
    site.start()
    site.track_epochs(range(4))
    site.service.decider.people.merge(site.person_of(A, 1, 3), site.person_of(B, 3, 3))
    site.track_epochs(range(4, 6))
    one, ann = site.person_of(A, 1, 5), site.person_of(A, 2, 5)
    site.start()
    site.track_epochs(range(7, 9), {A: {1: SMALL, 2: LARGE}, B: {}})
    site.track_epochs(range(9, 11), {A: {2: LARGE}, B: {}})
    site.service.decider.people.merge(ann, one)
    site.track_epochs(range(11, 14), {A: {2: LARGE}, B: {3: LARGE}})
    assert site.person_of(B, 3, 13) == ann


def test_names_set_or_removed_meanwhile_are_not_overwritten_by_recovery() -> None:
    site = tracked_site()
    site.start()
    site.track_epochs(range(7, 9))
    people = site.service.decider.people
    people.registry.set_name(site.person_of(A, 2, 8), "")
    people.registry.set_name(site.person_of(A, 1, 8), "Bob")
    site.track_epochs(range(9, 10))
    site.start()
    site.track_epochs(range(10, 12))
    assert site.service.decider.people.registry.names == {site.person_of(A, 1, 11): "Bob"}


def test_a_service_that_does_not_lead_sends_no_snapshots_and_all_services_recover() -> None:
    site = Site(view={"sharding": {"of": 2, "index": 1}})
    sent = dict(site.cameras)
    site.start().state_replication._sends = lambda: False
    site.track_epochs(range(6))
    assert site.service.decider.people.known
    assert {camera: retained._snapshot for camera, retained in sent.items()} == dict.fromkeys(CAMERAS, b"")
    first = tracked_site()
    first._changes = {"view": {"sharding": {"of": 2, "index": 1}}}
    ann = first.person_of(A, 2, 5)
    first.start()
    first.track_epochs(range(7, 9))
    assert first.person_of(A, 2, 8) == ann


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_decisions_wait_for_the_snapshots_of_connected_cameras() -> None:
    clock, service = Clock(), FedService(small_config())
    replication = StateReplication(service.decider.people, CAMERAS, FPS, lambda *_: None, clock=clock)
    replication.begin(4)
    assert not replication.is_waiting, "no camera is connected"
    replication.set_present(KEYS.camera(A, "alive"), is_present=True)
    replication.set_present(KEYS.camera("cellar", "alive"), is_present=True)
    replication.set_present(KEYS.camera(B, "alive"), is_present=True)
    assert replication.is_waiting
    replication.receive_snapshot(Message(KEYS.camera(A, "retained_identities"), b"", b""))
    assert replication.is_waiting
    replication.set_present(KEYS.camera(A, "alive"), is_present=True)
    replication.set_present(KEYS.camera(B, "alive"), is_present=False)
    assert not replication.is_waiting, "a snapshot may arrive before the liveliness token"
    replication.set_present(KEYS.camera(B, "alive"), is_present=True)
    clock.now += SNAPSHOT_WAIT_S
    assert not replication.is_waiting, "a frozen camera is waited for only so long"
    replication.begin(9)
    replication.set_present(KEYS.camera(A, "alive"), is_present=True)
    assert not replication.is_waiting, "only at the start"


async def test_a_number_that_may_be_recovered_is_not_reported_as_unknown() -> None:
    site = tracked_site()
    number = site.person_of(A, 1, 5)
    service = site.start()
    async with TestClient(TestServer(make_app(BestViewService(service)))) as client:
        path = f"/objects/{number}/best.mp4"
        for url in (path, f"/objects/{number}/hls/index.m3u8", f"/api/objects/{number}/choice"):
            answer = await client.get(url)
            assert answer.status == 503, url
            assert int(answer.headers["Retry-After"]) > 0
        site.track_epochs(range(7, 8), {A: {2: LARGE}, B: {}})
        assert (await client.get(path)).status == 503
        assert (await client.get("/objects/77/best.mp4")).status == 404
        site.track_epochs([LONG_AFTER], {A: {2: LARGE}, B: {}})
        assert (await client.get(path)).status == 404, "recovery has ended"


NESTED = b'{"more": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"


@pytest.mark.parametrize("damage", [b"\xff", b"[]", b'{"pulse": 1}', b"{" * 100_000, NESTED])
def test_an_invalid_snapshot_is_counted(damage: bytes, caplog: pytest.LogCaptureFixture) -> None:
    site = tracked_site()
    site.cameras[B].replace(Message("", damage, b""))
    with caplog.at_level(logging.ERROR):
        service = site.start()
    assert service.ingest.states[B].bad_messages == 1
    assert caplog.messages == []
    site.track_epochs(range(7, 9))
    assert site.service.decider.people.registry.names == {site.person_of(A, 2, 8): "Ann"}


def test_a_snapshot_is_limited_in_size() -> None:
    snapshot: list[bytes] = []
    retained = RetainedIdentitySnapshot(snapshot.append)
    retained.replace(Message("", b"one", b""))
    retained.replace(Message("", b"2" * (SNAPSHOT_BYTES_MAX + 1), b""))
    retained.on_service(is_present=False)
    retained.on_service(is_present=True)
    assert snapshot == [b"one"]


numbers = st.integers(1, 8)
person_snapshots = st.builds(
    PersonSnapshot,
    number=numbers,
    tracks=st.lists(st.integers(0, 4), max_size=3),
    aliases=st.lists(numbers, max_size=3),
    name=st.sampled_from(["", "Ann", "Bob"]),
    manual=st.booleans(),
)
identity_snapshots = st.builds(
    CameraIdentitySnapshot,
    pulse=st.integers(0, 60),
    boot=st.integers(1, 2),
    next_number=st.integers(1, 12),
    numbered_since=st.floats(0, 1e12),
    people=st.lists(person_snapshots, max_size=4),
)


@settings(max_examples=40)
@given(identity_snapshots, identity_snapshots)
def test_two_simultaneous_tracks_are_two_people_despite_snapshots(
    one: CameraIdentitySnapshot, other: CameraIdentitySnapshot
) -> None:
    site = Site()
    for camera, retained in zip(CAMERAS, (one, other), strict=True):
        people = [msgspec.structs.replace(person, manual=False) for person in retained.people]
        snapshot = msgspec.msgpack.encode(msgspec.structs.replace(retained, people=people))
        site.cameras[camera].replace(Message("", snapshot, b""))
    site.start()
    site.track_epochs(range(7, 12), {A: {1: SMALL, 2: LARGE}, B: {3: LARGE}})
    assert site.person_of(A, 1, 11) != site.person_of(A, 2, 11)


@settings(max_examples=40)
@given(identity_snapshots, identity_snapshots)
def test_arbitrary_snapshots_do_not_stop_the_service(
    one: CameraIdentitySnapshot, other: CameraIdentitySnapshot
) -> None:
    site = Site()
    for camera, retained in zip(CAMERAS, (one, other), strict=True):
        site.cameras[camera].replace(Message("", msgspec.msgpack.encode(retained), b""))
    site.start()
    site.track_epochs(range(7, 10))
    people = site.service.decider.people
    assert people.known
    assert set(people.registry.merged).isdisjoint(people.registry.all_numbers)


def falsify_snapshot(site: Site, camera: str, **changes: object) -> None:
    """Change the snapshot that a camera retains."""
    snapshot = msgspec.msgpack.decode(site.cameras[camera]._snapshot, type=CameraIdentitySnapshot)
    site.cameras[camera].replace(
        Message("", msgspec.msgpack.encode(msgspec.structs.replace(snapshot, **changes)), b"")
    )


@pytest.mark.parametrize(
    "lie",
    [
        {"next_number": PERSON_NUMBER_MAX + 1},
        {"people": [PersonSnapshot(number=PERSON_NUMBER_MAX, tracks=[3])]},
        {"people": [PersonSnapshot(number=5, tracks=[3], aliases=[PERSON_NUMBER_MAX])]},
    ],
)
@pytest.mark.parametrize("after_restart", [False, True])
def test_no_single_camera_can_raise_the_next_number_far(lie: dict[str, object], after_restart: bool) -> None:
    site = tracked_site()
    ann = site.person_of(A, 2, 5)
    if not after_restart:
        falsify_snapshot(site, B, **lie)
    site.start()
    site.track_epochs(range(7, 9))
    falsify_snapshot(site, B, **lie)
    for _ in range(3):
        site.cameras[B].on_service(is_present=True)
    site.track_epochs(range(9, 12), {A: {1: SMALL, 2: LARGE, 9: SMALL}, B: {3: LARGE}})
    people = site.service.decider.people
    assert people.identity.next_id <= SINGLE_CAMERA_NUMBER_MAX + 10
    assert site.person_of(A, 2, 11) == ann
    assert people.registry.names == {ann: "Ann"}


def test_large_numbers_confirmed_by_two_cameras_continue() -> None:
    site = tracked_site()
    for camera in CAMERAS:
        falsify_snapshot(site, camera, next_number=50_000_000 + len(camera))
    site.start()
    site.track_epochs(range(7, 9))
    assert site.service.decider.people.identity.next_id >= 50_000_000


@given(st.lists(st.integers(1, PERSON_NUMBER_MAX), max_size=6), st.integers(1, PERSON_NUMBER_MAX))
def test_a_single_cameras_first_free_number_is_bounded_by_the_others(
    other_numbers: list[int], lie: int
) -> None:
    most = max([trusted_first_free(other_numbers), SINGLE_CAMERA_NUMBER_MAX])
    assert trusted_first_free([*other_numbers, lie]) <= max(most, max(other_numbers, default=0) + 10_000)


def snapshot_since(since: float, pulse: int = 90) -> CameraIdentitySnapshot:
    return CameraIdentitySnapshot(pulse=pulse, boot=1, next_number=5, numbered_since=since, people=[])


@pytest.mark.parametrize("lie", [0.0, 1e12])
def test_no_single_camera_determines_when_numbering_began(lie: float) -> None:
    snapshot = {"c0": snapshot_since(lie), "c1": snapshot_since(1000.0), "c2": snapshot_since(1000.0)}
    assert StateRecovery(snapshot, 100, 50).numbered_since == 1000.0


def test_of_two_numbering_times_the_later_counts() -> None:
    assert (
        StateRecovery({"c0": snapshot_since(900.0), "c1": snapshot_since(1000.0)}, 100, 50).numbered_since
        == 1000.0
    )
    old_snapshots = {"c0": snapshot_since(900.0, pulse=1), "c1": snapshot_since(900.0, pulse=1)}
    assert StateRecovery({**old_snapshots, "c2": snapshot_since(1000.0)}, 100, 50).numbered_since == 1000.0
    assert StateRecovery(old_snapshots, 100, 50).numbered_since == 900.0
    assert StateRecovery({}, 100, 50).numbered_since == float("inf")


def test_a_flapping_camera_without_a_snapshot_is_waited_for_once() -> None:
    clock, service = Clock(), FedService(small_config())
    replication = StateReplication(service.decider.people, CAMERAS, FPS, lambda *_: None, clock=clock)
    for _ in range(4):
        replication.set_present(KEYS.camera(B, "alive"), is_present=False)
        replication.set_present(KEYS.camera(B, "alive"), is_present=True)
        clock.now += SNAPSHOT_WAIT_S / 2
    assert not replication.is_waiting
