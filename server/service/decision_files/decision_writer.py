"""Writes decisions to files: tracks per camera, camera choices, corrections, and late frames."""

from __future__ import annotations

import contextlib
import os
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from io import FileIO
from pathlib import Path

import numpy as np

from bestview import Merge, Split
from server.media.letterbox import Letterbox
from server.messaging.messages import NumberedBox
from server.service.decision_files.row_removal import rows_without
from server.service.rules.engine import SiteEvent
from server.service.view_selection.decider import GopDecision
from server.service.view_selection.delay_modes import DelayMode, ModeDecision
from server.system.private_files import make_private_folder, open_private
from tracking.motchallenge import MotRow, format_row

CHOICES_HEADER = "frame,object,camera\n"
CORRECTIONS_HEADER = "frame,correction,object,other,camera\n"
LATE_HEADER = "frame,camera,reason\n"
EVENTS_HEADER = "frame,rule,kind,phase,zone,objects,direction\n"


class DecisionWriter:
    """Writes decisions: ``tracks/<camera>.txt``, ``choices.csv``, ``events.csv`` and so on.

    ``choices-live.csv`` and ``choices-smooth.csv`` are the choices for viewers with these delays.

    ``letterboxes`` may grow: a camera is added with its first window. A choice is the camera that a
    person's stream shows, even if no camera sees the person.

    Frames count from 1 in all of them, as in MOTChallenge files: frame 1 is pulse 0. Boxes are in pixels of
    the camera's image. If ``late.csv`` is empty, `myview render` writes identical files for the same
    recordings.
    """

    def __init__(
        self,
        folder: Path,
        cameras: Sequence[str],
        letterboxes: Mapping[str, Letterbox],
        *,
        private: bool = False,
    ) -> None:
        """Create the files in a folder, which may exist; ``private``: readable by this user alone.

        Raises:
            OSError: a file cannot be written.
        """
        self._letterboxes = letterboxes
        if private:
            make_private_folder(folder / "tracks")
        else:
            (folder / "tracks").mkdir(parents=True, exist_ok=True)
        self._tracks = {camera: folder / "tracks" / f"{camera}.txt" for camera in cameras}
        self._choices = folder / "choices.csv"
        self._mode_choices = {
            mode: folder / f"choices-{mode}.csv" for mode in (DelayMode.LIVE, DelayMode.SMOOTH)
        }
        self._corrections = folder / "corrections.csv"
        self._events = folder / "events.csv"
        self._late = folder / "late.csv"
        headers = {
            self._choices: CHOICES_HEADER,
            **dict.fromkeys(self._mode_choices.values(), CHOICES_HEADER),
            self._corrections: CORRECTIONS_HEADER,
            self._events: EVENTS_HEADER,
            self._late: LATE_HEADER,
        }
        self._files = AtomicFiles(dict.fromkeys(self._tracks.values(), "") | headers, private=private)

    def write(
        self, decision: GopDecision, events: Sequence[SiteEvent] = (), late: Sequence[str] = ()
    ) -> None:
        """Write a decision, the events that it has led to, and rows of ``late.csv``.

        Raises:
            OSError: the disk is full or fails; the files are unchanged.
        """
        texts: dict[Path, list[str]] = defaultdict(list)
        for camera, frames in decision.boxes.items():
            for index, boxes in enumerate(frames):
                if boxes:
                    texts[self._tracks[camera]] += self._rows(camera, decision.first + index + 1, boxes)
        for index in range(decision.frames):
            texts[self._choices] += (
                f"{decision.first + index + 1},{choice.number},{choice.camera}\n"
                for choice in decision.choices
                if choice.camera is not None
            )
        texts[self._corrections] += (
            f"{decision.first + 1},{_line(correction)}\n" for correction in decision.corrections
        )
        texts[self._events] += (_event_line(event) for event in events)
        texts[self._late] += late
        self._files.append({path: "".join(rows) for path, rows in texts.items() if rows})

    def write_views(self, decision: ModeDecision) -> None:
        """Write the choices for viewers with another delay.

        Raises:
            OSError: as :meth:`write`.
        """
        rows = [
            f"{pulse + 1},{number},{camera}\n"
            for pulse in range(decision.first, decision.first + decision.frames)
            for number, camera in decision.cameras.items()
            if camera is not None
        ]
        self._files.append({self._mode_choices[decision.mode]: "".join(rows)} if rows else {})

    def write_late(self, rows: Sequence[str]) -> None:
        """Write rows of ``late.csv`` alone.

        Raises:
            OSError: as :meth:`write`.
        """
        self._files.append({self._late: "".join(rows)})

    @property
    def sizes(self) -> dict[Path, int]:
        """The files, and how many bytes have been written to each: whole rows."""
        return self._files.sizes

    def replace(self, path: Path, draft: Path, size: int, numbers: Collection[int]) -> None:
        """Replace a file by a draft that stands for its first `size` bytes, and the rest without some people.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        self._files.replace(path, draft, size, lambda rest: rows_without(path.name, rest, numbers))

    def close(self) -> None:
        """Close the files."""
        self._files.close()

    def _rows(self, camera: str, frame: int, boxes: Sequence[NumberedBox]) -> Iterator[str]:
        camera_boxes = self._letterboxes[camera].boxes_site_to_camera(
            np.array([box for _, *box in boxes], dtype=np.float64)
        )
        for (number, *_), box in zip(boxes, camera_boxes.tolist(), strict=True):
            yield format_row(MotRow.of_box(frame, number, box)) + "\n"


def _line(correction: Merge | Split) -> str:
    if isinstance(correction, Merge):
        return f"merged,{correction.kept},{correction.lost},"
    return f"split,{correction.published_id},{correction.corrected_id},{correction.camera}"


def _event_line(event: SiteEvent) -> str:
    objects = " ".join(map(str, event.objects))
    words = (event.rule, event.kind, event.phase, event.zone or "", objects, event.direction or "")
    return f"{event.pulse + 1},{','.join(words)}\n"


class AtomicFiles:
    """Text files that are appended to atomically: to all files of one call, or to none."""

    def __init__(self, headers: Mapping[Path, str], *, private: bool = False) -> None:
        """Create the files with their headers, ASCII; ``private``: readable by this user alone.

        Raises:
            OSError: a file cannot be written.
        """
        with contextlib.ExitStack() as opened:
            opener = open_private if private else None
            self._files = {path: opened.enter_context(FileIO(path, "w", opener=opener)) for path in headers}
            self.append(headers)
            self._opened = opened.pop_all()

    def append(self, texts: Mapping[Path, str]) -> None:
        """Append ASCII texts, unbuffered.

        Raises:
            OSError: the disk is full or fails; the files are unchanged.
        """
        lengths = {path: self._files[path].tell() for path in texts}
        try:
            for path, text in texts.items():
                _write(self._files[path], text.encode("ascii"))
        except OSError:
            for path, length in lengths.items():
                with contextlib.suppress(OSError):  # the first error is raised
                    self._files[path].truncate(length)
                    self._files[path].seek(length)
            raise

    @property
    def sizes(self) -> dict[Path, int]:
        """The length of each file, bytes."""
        return {path: file.tell() for path, file in self._files.items()}

    def replace(self, path: Path, draft: Path, size: int, change: Callable[[bytes], bytes]) -> None:
        """Replace a file by a draft that stands for its first `size` bytes, and the changed rest.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        with path.open("rb") as file:
            file.seek(size)
            rest = change(file.read())
        with contextlib.ExitStack() as on_error:
            new = on_error.enter_context(FileIO(draft, "r+"))
            new.seek(0, os.SEEK_END)
            _write(new, rest)
            draft.replace(path)
            on_error.pop_all()
        self._files[path].close()
        self._files[path] = self._opened.enter_context(new)

    def close(self) -> None:
        """Close all files."""
        self._opened.close()


def _write(file: FileIO, data: bytes) -> None:
    """Write all of the data: a nearly full disk first takes a part, and fails on the next write."""
    while data:
        data = data[file.write(data) :]
