"""Online tracking of everybody on a ground plane by all cameras at once, with a fixed lag, in keyframes.

Each keyframe's detections become hypotheses of places, the network program over the last frames chooses among
them, and the oldest frame becomes final. Who arrives is decided in the same program: a person is known from
their first final place on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.frame_rate import frames_in
from tracking.ground_plane.camera import BoxSizes, GroundCamera
from tracking.ground_plane.candidates import Candidates
from tracking.ground_plane.exchanges import ExchangeMonitor, PersonInFrame, clear_sightings
from tracking.ground_plane.motion import MotionState
from tracking.ground_plane.motion_scale import MotionScale
from tracking.ground_plane.person import GroundPerson
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import PERSON_M, estimate_units_per_meter, measure
from tracking.ground_plane.places.place_errors import PlaceErrors
from tracking.ground_plane.predicted_boxes import predict_boxes, usual_boxes
from tracking.ground_plane.program.costs import program_costs
from tracking.ground_plane.program.solution import solve_program
from tracking.ground_plane.program.useful_arcs import GONE
from tracking.ground_plane.settings import GroundSettings
from tracking.ground_plane.tracks import GroundBox, GroundFrame, GroundTrack
from tracking.ground_plane.window import WindowFrame, known_people, missed_costs, predict_places
from tracking.solvers.base import PartsSolver, SolveReport
from tracking.types import Detections


class KeyframeTracker:
    """Tracks people in frames that are far enough apart to tell something new.

    Deterministic; memory bounded by the window.
    """

    def __init__(
        self,
        cameras: Mapping[str, GroundCamera],
        settings: GroundSettings,
        solver: PartsSolver,
        fps: float,
        units_per_meter: float | None = None,
    ) -> None:
        """Create a tracker of frames that are 1 / `fps` seconds apart.

        `units_per_meter`: of the plane; None: estimated from the heights of the first boxes.
        """
        self._names = tuple(cameras)
        self._given = tuple(cameras.values())
        self._motion = MotionScale(settings)
        self._solver = solver
        self._seconds = 1.0 / fps
        self._lag = frames_in(settings.lag_s, fps)
        self._stride = frames_in(settings.stride_s, fps)
        self._units_per_meter = units_per_meter
        self._errors = PlaceErrors(len(cameras))
        self._cameras = self._corrected()
        self._sizes = [BoxSizes() for _ in cameras]
        self._first_detected: int | None = None
        self._candidates = Candidates(self._seconds)
        self._people: list[GroundPerson] = []
        self._exchanges = ExchangeMonitor(self._seconds)
        self._next_id = 1
        self._window: deque[WindowFrame] = deque()
        self._states = np.zeros((0, 0), dtype=np.int64)
        self._report: SolveReport | None = None

    def push(self, number: int, detections: Mapping[str, Detections]) -> list[GroundFrame]:
        """Add the detections of a frame by camera; return the frames that become final, in order.

        Numbers are successive, except after `flush`. Cameras that are left out have not searched the frame.
        """
        found = [detections.get(name) for name in self._names]
        if self._units_per_meter is None:
            self._units_per_meter = estimate_units_per_meter(
                self._given, {k: part.boxes for k, part in enumerate(found) if part is not None}
            )
            if self._units_per_meter is None:
                return [GroundFrame(number, (), None)]
            self._cameras = self._corrected()
        for sizes, part in zip(self._sizes, found, strict=True):
            if part is not None:
                sizes.update(part.boxes)
        measurements = measure(self._cameras, found, self._errors.noise, self._settings)
        predictions = predict_places(
            self._people, self._states.tolist(), self._window, self._seconds, self._settings
        )
        places = find_places(
            measurements, predictions, self._cameras, self._sizes, self._settings, self._seconds
        )
        if self._first_detected is None and len(measurements):
            self._first_detected = number
        self._window.append(WindowFrame(number, places))
        if (number + 1) % self._stride or len(self._window) <= self._lag:
            return []
        self._solve()
        return [self._finish_oldest() for _ in range(len(self._window) - self._lag)]

    def set_camera(self, name: str, camera: GroundCamera) -> None:
        """Replace a camera's calibration from the next frame on.

        Raises:
            KeyError: no camera has this name.
        """
        index = dict(zip(self._names, range(len(self._names)), strict=True))[name]
        self._given = (*self._given[:index], camera, *self._given[index + 1 :])
        self._cameras = self._corrected()

    def _corrected(self) -> tuple[GroundCamera, ...]:
        """Return the cameras over a plane in meters, without what is known of their offsets.

        There are none while the unit of the plane is not known.
        """
        units = self._units_per_meter
        if units is None:
            return ()
        return tuple(
            camera.scaled(units).shifted(-offset)
            for camera, offset in zip(self._given, self._errors.offsets, strict=True)
        )

    @property
    def _settings(self) -> GroundSettings:
        """The settings, with what has been learned about how people move."""
        return self._motion.settings

    @property
    def person_height(self) -> float | None:
        """How tall people are, in the unit of the plane; None before the first detections."""
        return None if self._units_per_meter is None else PERSON_M * self._units_per_meter

    @property
    def offsets(self) -> dict[str, float]:
        """By camera, meters by which it disagrees with the others about where people stand."""
        lengths = np.linalg.norm(self._errors.offsets, axis=1)
        return dict(zip(self._names, lengths.tolist(), strict=True))

    def provisional(self) -> list[GroundFrame]:
        """Return the frames that are not final yet, as the last solution has them.

        Frames since that solution are left out, and so is who has arrived since the last final frame, since
        they have no number yet.
        """
        return [
            GroundFrame(frame.number, self._provisional_tracks(frame, m), self._report)
            for m, frame in enumerate(self._window)
            if m < self._states.shape[1]
        ]

    def _provisional_tracks(self, frame: WindowFrame, m: int) -> tuple[GroundTrack, ...]:
        found = []
        for person, row in zip(self._people, self._states, strict=False):
            if row[m] >= 0:
                places = frame.places
                place, covariance = places.means[row[m]], places.covariances[row[m]]
            elif (row[m:] >= 0).any():
                ahead = person.ahead(frame.number, self._settings)
                place, covariance = ahead.place, ahead.place_covariance
            else:
                continue
            found.append(_Located(person, int(row[m]), place, covariance))
        return self._tracks(found, frame)

    def flush(self) -> list[GroundFrame]:
        """End the recording: return the remaining frames; everybody is forgotten."""
        final = []
        if self._window:
            self._solve()
            final = [self._finish_oldest() for _ in range(len(self._window))]
        self._candidates.clear()
        self._exchanges.clear()
        self._first_detected = None
        self._people, self._states = [], np.zeros((0, 0), dtype=np.int64)
        return final

    def _solve(self) -> None:
        """Solve the window's program."""
        frames = [frame.places for frame in self._window]
        people = known_people(
            self._people, self._window, self._cameras, self._sizes, self._seconds, self._settings
        )
        rate = self._settings.arrival_rate * self._seconds
        if self._is_beginning(self._window[0].number):
            rate = self._settings.people_density
        arrival_cost = -float(np.log(rate))
        first = arrival_cost - np.minimum(self._candidates.discounts(frames[0], self._settings), arrival_cost)
        costs = program_costs(people, frames, self._seconds, arrival_cost, first, self._settings)
        solution = solve_program(costs, frames, self._solver)
        self._states, self._report = solution.states, solution.report

    def _is_beginning(self, number: int) -> bool:
        """Return whether people whom nobody has found yet may have been there from the first detection on."""
        if self._first_detected is None:
            return True
        return self._seconds * (number - self._first_detected) < self._settings.beginning_s

    def _finish_oldest(self) -> GroundFrame:
        """Make the oldest frame final: people move, arrive and leave."""
        frame = self._window.popleft()
        people, rows, arriving, found = [], [], [], []
        self._move_people(frame)
        usual = usual_boxes(frame.places.measurements, self._sizes)
        for n, row in enumerate(self._states):
            state = int(row[0])
            if n < len(self._people):
                person = self._people[n]
                if state == GONE or person.has_left(frame.number, self._settings):
                    continue
            elif state >= 0:
                person = self._arrive(frame, state)
            else:
                arriving.append(n)
                continue
            people.append(person)
            rows.append(n)
            if state >= 0:
                person.learn(frame.places, state, usual)
            if state >= 0 or (row[1:] >= 0).any():
                ahead = person.ahead(frame.number, self._settings)
                found.append(_Located(person, state, ahead.place, ahead.place_covariance))
        chosen = [int(state) for state in self._states[:, 0] if state >= 0] if len(self._states) else []
        self._errors.update(frame.places, chosen)
        self._cameras = self._corrected()
        missed = missed_costs(
            self._candidates.places, frame.places.measurements, self._cameras, self._sizes, self._settings
        )
        missed *= self._settings.detection_weight(self._seconds)
        self._candidates.update(frame.places, chosen, missed, self._settings)
        self._people = people
        self._states = self._states[rows + arriving, 1:]
        exchanged = self._exchange(frame.places, found)
        return GroundFrame(frame.number, self._tracks(found, frame), self._report, exchanged)

    def _exchange(self, places: Places, found: Sequence[_Located]) -> dict[int, int]:
        """Exchange the ids of people who were taken for each other; return the former id by id."""
        seen = [
            PersonInFrame(each.person.id, each.place, clear_sightings(places, each.state)) for each in found
        ]
        people = {each.person.id: each.person for each in found}
        former: dict[int, int] = {}
        for one, two in self._exchanges.update(seen, [person.id for person in self._people]):
            people[one].id, people[two].id = two, one
            former |= {one: two, two: one}
        return former

    def _move_people(self, frame: WindowFrame) -> None:
        """Move the people known to their places in a frame."""
        places = frame.places
        moved = [
            (person, int(row[0]))
            for person, row in zip(self._people, self._states, strict=False)
            if row[0] >= 0
        ]
        if not moved:
            return
        states = [state for _, state in moved]
        costs = self._motion.move_costs(
            MotionState.stack([person.state for person, _ in moved]),
            np.array([person.seconds_unseen(frame.number) for person, _ in moved]),
            places.means[states],
            places.covariances[states],
        )
        for (person, state), row in zip(moved, costs, strict=True):
            self._motion.learn(row)
            person.move(frame.number, places, state, self._settings)

    def _arrive(self, frame: WindowFrame, state: int) -> GroundPerson:
        number, self._next_id = self._next_id, self._next_id + 1
        return GroundPerson(number, frame.number, frame.places, state, self._seconds, self._settings)

    def _tracks(self, found: Sequence[_Located], frame: WindowFrame) -> tuple[GroundTrack, ...]:
        """Return people's places and boxes, by id: detections, and predicted boxes in the other cameras."""
        places = np.array([each.place for each in found]).reshape(-1, 2)
        predicted = predict_boxes([each.person.boxes for each in found], places, self._cameras, self._sizes)
        known = np.asarray(np.isfinite(predicted).all(axis=2))
        units, measurements = self._units_per_meter or 1.0, frame.places.measurements
        tracks = []
        for n, each in enumerate(found):
            boxes = {}
            for k in frame.places.groups[each.state] if each.state >= 0 else ():
                camera = int(measurements.camera[k])
                boxes[self._names[camera]] = GroundBox(measurements.boxes[k], int(measurements.index[k]))
            for camera in np.flatnonzero(known[n]).tolist():
                if self._names[camera] not in boxes:
                    boxes[self._names[camera]] = GroundBox(predicted[n, camera], None)
            tracks.append(GroundTrack(each.person.id, units * each.place, units**2 * each.covariance, boxes))
        return tuple(sorted(tracks, key=lambda track: track.id))


@dataclass(frozen=True, slots=True, eq=False)
class _Located:
    """A person in a frame: the state, below 0 where they are not seen, the place and its covariance."""

    person: GroundPerson
    state: int
    place: Floats
    covariance: Floats
