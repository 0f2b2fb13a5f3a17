"""The person tracker: assigns one number per person to the tracks of all cameras."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bestview import SINGLE_SITE, IdentityRegistry, IdentitySettings, IdSeries, Merge, Split, TrackKey
from server.media.letterbox import Letterbox
from server.messaging.messages import NumberedBox
from server.service.identity.association import AssociationThread, EpochAssociation, Run, run_here
from server.service.identity.camera_window import CameraWindow, WindowReader
from server.service.identity.common_ground import CommonGround
from server.service.identity.expected_tracks import ExpectedTracks
from server.service.identity.id_switch_repair import IdSwitchRepair
from server.service.identity.local_numbers import TrackName
from server.service.identity.manual_overrides import ManualOverrides, numbers_of_correction
from server.service.identity.numbered_boxes import numbered_boxes
from server.service.identity.person_registry import PersonRegistry
from server.service.identity.published_tracks import PublishedTracks
from server.service.identity.sharding import SINGLE_SHARD, Sharding, TracksOfPeople
from server.service.identity.track_parts import (
    UNCONFIRMED,
    UNKNOWN,
    Parts,
    TrackPart,
    person_numbers,
    replace_numbers,
    unconfirm,
    update_parts,
)
from server.service.identity.undetected_frames import UndetectedFrames
from server.service.ingest.epoch_aligner import Epoch
from server.service.ingest.window_history import HistorySpan, WindowHistory
from tracking.frame_rate import frames_in

_COMPARED_S = 1.0
"""Seconds of each camera's final tracks that are kept, to find the identity switches of its next revision."""
_RECENT_S = 4.0
"""Seconds in which a camera must have run detection to count; at least those of an epoch."""


class PersonTracker:
    """Associates the cameras' tracks epoch by epoch, and keeps recent boxes.

    ``homographies`` map each camera's image to the ground; None where there is none. ``sharding`` says
    which people are this service's; identities are computed for all people in the cameras' views. Tracks are
    final ``lag`` frames before an epoch's end, and are associated up to there. ``overhead`` are the
    cameras that look straight down, ``joint_cameras`` those that are tracked jointly where they overlap;
    ``fps`` are the site's frames a second, ``ids`` the numbers to assign, of several sites.
    """

    def __init__(
        self,
        settings: IdentitySettings,
        cameras: Sequence[str],
        homographies: Mapping[str, NDArray[np.float64] | None],
        site_size: tuple[int, int],
        lag: int,
        sharding: Sharding = SINGLE_SHARD,
        overhead: Collection[str] = (),
        fps: float = 25.0,
        joint_cameras: Sequence[str] = (),
        ids: IdSeries = SINGLE_SITE,
    ) -> None:
        self._reader = WindowReader(site_size)
        self._ground = CommonGround(joint_cameras, self._reader.local_numbers)
        ground = self._ground.homographies(homographies)
        self._registry = IdentityRegistry(settings, ground, overhead, fps, ids)
        self.ids = ids
        self.forget_after = settings.resolve(fps).forget_after
        """Frames unseen after which people are forgotten."""
        self.registry = PersonRegistry(settings.maximum_departed_people)
        """All people, those of other shards included."""
        self.sharding = sharding
        """Which of the people are this service's."""
        self._histories = {camera: WindowHistory[CameraWindow]() for camera in cameras}
        self._lag, self._recent, self._compared = lag, frames_in(_RECENT_S, fps), frames_in(_COMPARED_S, fps)
        self._id_switch_repair = IdSwitchRepair(self._registry, self._reader)
        self.undetected = UndetectedFrames()
        """Frames without detection, by camera."""
        self.published = PublishedTracks()
        """The tracks behind the boxes of published GOPs."""
        self._parts: Parts = {}
        self._last_reported: dict[TrackKey, int] = {}
        self._needed_from = 0
        """The first frame that is still needed."""
        self._corrections: list[Merge | Split] = []
        self.overrides = ManualOverrides()
        self.expected = ExpectedTracks()
        self.newest = -1
        """The last frame of the newest epoch; -1: none."""
        self._thread = AssociationThread()
        self._association: EpochAssociation | None = None
        """The newest association, whether or not it has ended."""

    def update(self, epoch: Epoch) -> Sequence[CameraWindow]:
        """Associate an epoch's tracks, unless that was done; return its windows, late revisions first."""
        newest = self._association
        if newest is None or newest.last != epoch.last:
            newest = self._begin(epoch, run_here)
        self.finish_association()
        return [*newest.late, *newest.windows]

    async def associate(self, epoch: Epoch) -> None:
        """Associate an epoch's tracks in a thread, for which changes wait; `update` returns the result."""
        await self._begin(epoch, self._thread.run).wait()

    def _begin(self, epoch: Epoch, run: Run) -> EpochAssociation:
        """Take an epoch's windows, and begin to associate their tracks."""
        self.finish_association()
        late = [self._store(window) for window in self._reader.read_late(epoch)]
        windows = [self._store(window) for window in self._reader.read(epoch)]
        own = [window for window in windows if not epoch.is_joint(window.message.camera)]
        joint = [window for window in windows if epoch.is_joint(window.message.camera)]
        self._recall(own, joint, epoch)
        tracks = [track for window in own for track in window.fresh_tracks()]
        if epoch.joint is not None:
            tracks += self._ground.updates(epoch.joint.tracks, [window.message for window in joint])
        since = max(self.newest + 1, epoch.last + 1 - self._recent)  # epochs may have been skipped
        image_sizes = self.undetected.detecting_cameras(windows, since - self._lag, epoch.last - self._lag)
        associate = partial(self._registry.update, tracks, epoch.last - self._lag, image_sizes)
        self._association = EpochAssociation(epoch.last, late, windows, run(associate))
        return self._association

    def finish_association(self) -> None:
        """Wait for the end of a running association, and take its result."""
        newest = self._association
        if newest is None or newest.is_taken:
            return
        newest.is_taken, self.newest = True, newest.last
        update = self.overrides.apply(newest.numbers.result())
        update_parts(self._parts, update.person_ids, self._needed_from)
        self._id_switch_repair.overlay(self._parts)
        self._record_visible(newest.windows, self.newest)
        self.registry.update_presence(update.departed, update.returned)
        for merge in update.merged:
            self._merge(merge.kept, merge.lost)
        self._corrections += [*update.merged, *update.split]
        self._forget(self.newest)

    @property
    def letterboxes(self) -> Mapping[str, Letterbox]:
        """Each camera's letterbox, known from its first message on."""
        return self._reader.letterboxes

    @property
    def known(self) -> list[int]:
        """The numbers of this shard's people, in order; departed ones included."""
        return self.sharding.own(self.registry.all_numbers, self.registry.merged)

    @property
    def of_other_shards(self) -> list[int]:
        """The numbers of the other shards' people, in order."""
        return self.sharding.others(self.registry.all_numbers, self.registry.merged)

    def expect(self, tracks: Mapping[TrackName, int], last_pulse: int) -> None:
        """Expect tracks that belonged to these people in an earlier run, which ended with `last_pulse`."""
        new = {track: number for track, number in tracks.items() if not self.is_known(track)}
        self.expected.add(new, last_pulse)

    def merge(self, kept: int, lost: int) -> None:
        """Merge two people on the operator's command, permanently and regardless of the evidence."""
        self.finish_association()
        is_present = not {kept, lost} <= self.registry.departed
        self.overrides.merge(kept, lost, self.registry.departed)
        self._merge(kept, lost)
        if is_present:
            self.registry.departed.discard(kept)
        self._corrections.append(Merge(kept, lost))

    def split_off(self, number: int, cameras: Collection[str]) -> int | None:
        """Split the tracks of these cameras off a person as a new person, on the operator's command.

        Returns the new number; None: none of the cameras shows the person now.
        """
        self.finish_association()
        shown_by = self._ground.seen_as(cameras)
        tracks = [
            key
            for key, parts in self._parts.items()
            if key.camera in shown_by
            and parts[-1].number == number
            and self._last_reported.get(key) == self.newest
        ]
        new = self.identity.split_off(tracks, self.overrides.automatic_numbers(number))
        if new is None:
            return None
        for key in tracks:  # the registry does not report settled tracks again
            since = max(self._needed_from, self._parts[key][-1].first)
            self._parts[key] = [*self._parts[key], TrackPart(since, new)]
            self.registry.record_visible([TrackPart(since, new)], since, max(since, self.newest))
        from_cameras = sorted({track.camera for track in tracks})
        self._corrections += [Split(number, new, camera) for camera in from_cameras]
        return new

    def forget(self, numbers: Collection[int]) -> set[TrackName]:
        """Forget people whole; return the tracks that have shown them.

        Who is visible is confirmed anew under another number, by tracks without a past.
        """
        self.identity.forget({raw for number in numbers for raw in self.overrides.automatic_numbers(number)})
        unconfirmed = unconfirm(self._parts, numbers)
        shown = {track for key in unconfirmed for track in self._ground.own_tracks(key)}
        self.overrides.forget(numbers)
        self._id_switch_repair.forget(numbers)
        self.published.forget(numbers)
        self.registry.forget(numbers)
        self.expected.forget(numbers)
        self._corrections = [
            each for each in self._corrections if not (set(numbers_of_correction(each)) & set(numbers))
        ]
        return shown

    @property
    def identity(self) -> IdentityRegistry:
        """What is known about each person, by automatic number; waits for an association that runs."""
        self.finish_association()
        return self._registry

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Replace people's numbers by those of another service, one to one.

        A number that nobody has any more counts as merged, so that its viewers stay with the person.
        """
        self.identity.renumber(numbers)
        self.registry.renumber(numbers)
        self.overrides.renumber(numbers)
        self._replace(numbers)
        gone = [old for old in numbers if old not in numbers.values()]
        self._corrections += [Merge(numbers[old], old) for old in gone]

    def number(self, camera: str, local: int, pulse: int) -> int | None:
        """Return the person of a camera's local track in a frame; None while it is not confirmed."""
        number = int(self.numbers([TrackKey(camera, local)], pulse, 1)[0, 0])
        return None if number == UNCONFIRMED else number

    def boxes(self, camera: str, first: int, frames: int) -> list[list[NumberedBox]]:
        """Return the numbered boxes of each of a camera's frames from `first` on, by rising number."""
        spans = self._histories[camera].over(first, first + frames - 1)
        return numbered_boxes(spans, self.numbers, first, frames)

    def windows(self, camera: str, first: int, last: int) -> list[HistorySpan[CameraWindow]]:
        """Return a camera's newest windows of the frames from `first` to `last`; frames may be missing."""
        return self._histories[camera].over(first, last)

    def person_of(self, camera: str, boot: int, track: int, pulse: int) -> int | None:
        """Return the person of a tracker's track in a frame; None: unknown or not confirmed."""
        key = self._ground.key(TrackName(camera, boot, track))
        return None if key is None else self.number(key.camera, key.local_id, pulse)

    def is_known(self, track: TrackName) -> bool:
        """Return whether a camera has reported this track recently."""
        return self._ground.key(track) is not None

    def tracks_of(self, numbers: Collection[int], since: int) -> dict[int, list[TrackName]]:
        """Return these people's tracks that were reported since a pulse; people without any are omitted."""
        tracks: dict[int, list[TrackName]] = {}
        selected = set(numbers)
        for key, parts in self._parts.items():
            if parts[-1].number in selected and self._last_reported.get(key, -1) >= since:
                tracks.setdefault(parts[-1].number, []).extend(self._ground.own_tracks(key))
        return dict(sorted(tracks.items()))

    def numbers(self, keys: Sequence[TrackKey], first: int, frames: int) -> NDArray[np.int64]:
        """Return the persons' numbers behind T tracks, frame by frame, (T, frames); -1: not confirmed."""
        return person_numbers([self._parts.get(key, UNKNOWN) for key in keys], first, frames)

    def take_corrections(self) -> tuple[Merge | Split, ...]:
        """Return the merges and splits since the last call, in order."""
        corrections, self._corrections = self._ground.in_cameras(self._corrections), []
        return corrections

    def forget_before(self, pulse: int) -> None:
        """Forget the boxes and person numbers before a pulse; record the tracks published until then."""
        histories = self._histories.values() if self.published.frames else ()
        spans = [span for history in histories for span in history.over(self._needed_from, pulse - 1)]
        for span in sorted(spans, key=lambda span: span.last):
            self.published.record(span, self.numbers(span.window.keys, span.last, 1)[:, 0])
        self._needed_from = max(self._needed_from, pulse)
        self.undetected.forget_before(pulse)
        self._id_switch_repair.keep_only(self._parts, self._needed_from)
        for camera, history in self._histories.items():
            history.forget_before(min(pulse, self._reader.final_to(camera) + 1 - self._compared))

    def _store(self, window: CameraWindow) -> CameraWindow:
        """Store a window, after repairing identity switches where it revises the past."""
        self.undetected.add(window.message)
        history = self._histories[window.message.camera]
        if window.message.revised_from is not None:
            before = history.over(window.first, window.fresh - 1)
            window, splits = self._id_switch_repair.repair(window, before, self._parts, self._needed_from)
            self._corrections += self.overrides.map_splits(splits)
        history.put(window, window.first, window.message.last)
        return window

    def _record_visible(self, windows: Iterable[CameraWindow], now: int) -> None:
        """Record when people were visible in the windows of an epoch, and in which cameras."""
        seen = []
        for window in windows:
            numbers: list[int | None] = []
            for key, (first, last) in zip(window.keys, window.visible_spans(), strict=True):
                self._last_reported[key] = now
                parts = self._parts.get(key, ())
                self.registry.record_visible(parts, first, last)
                is_known = bool(parts) and first <= last and parts[-1].number != UNCONFIRMED
                numbers.append(parts[-1].number if is_known else None)
            seen.append(TracksOfPeople(window.message, numbers))
        self.sharding.update(seen, now)

    def _recall(self, own: Sequence[CameraWindow], joint: Sequence[CameraWindow], epoch: Epoch) -> None:
        """Assign expected tracks to their people of an earlier run when they first appear."""
        linked = {} if epoch.joint is None else self._ground.link(epoch.joint, epoch.tracks, joint)
        origin = self._reader.local_numbers.origin
        appeared = {origin(key): key for window in own for key in window.keys}
        appeared |= {name: key for name, key in linked.items() if key not in self._parts}
        for name, key in appeared.items():
            if (expected := self.expected.take(name)) is not None:
                number, pulse = expected
                self.identity.recall(key, self.registry.current(number), pulse)

    def _merge(self, kept: int, lost: int) -> None:
        self.registry.merge(kept, lost)
        self._replace({lost: kept})

    def _replace(self, numbers: Mapping[int, int]) -> None:
        """Replace numbers in the tracks."""
        self.sharding.renumber(numbers)
        self._id_switch_repair.merge(numbers)
        replace_numbers(self._parts, numbers)

    def _forget(self, now: int) -> None:
        """Forget tracks and people not seen for ``forget_after`` frames, as the registry does."""
        for key in [key for key, last in self._last_reported.items() if last < now - self.forget_after]:
            del self._last_reported[key]
            self._parts.pop(key, None)
            self._reader.local_numbers.forget(key)
        self._ground.keep_only(self._last_reported)
        self.registry.forget_unseen_since(now - self.forget_after)
        self.sharding.keep_only(self.registry.first_seen.keys())
