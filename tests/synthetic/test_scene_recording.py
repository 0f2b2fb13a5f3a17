"""A scene on disk: videos, ground truth and homographies that belong together."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest

from synthetic import Scene, write_recording

FRAMES = 30


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene("room", 2, 3, 5, 320, 180, 25.0)


@pytest.fixture(scope="module")
def recording(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recordings") / "room"
    write_recording(scene, out, FRAMES / scene.fps)
    return out


def decode(path: Path) -> list[av.VideoFrame]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


def test_every_file_is_there_and_nothing_else(recording: Path) -> None:
    files = {str(path.relative_to(recording)) for path in recording.rglob("*") if path.is_file()}
    assert files == {"c0.mp4", "c1.mp4", "gt/c0.txt", "gt/c1.txt", "ground.json"}
    assert [path.name for path in recording.parent.iterdir()] == ["room"]


def test_a_video_shows_the_scenes_frames_at_its_rate(scene: Scene, recording: Path) -> None:
    for camera in range(2):
        frames = decode(recording / f"c{camera}.mp4")
        assert len(frames) == FRAMES
        assert [round(float(frame.time) * scene.fps, 3) for frame in frames] == list(range(FRAMES))
        for index in (0, 11, FRAMES - 1):
            shown = frames[index].to_ndarray(format="bgr24").astype(float)
            errors = [
                np.square(shown - scene.image(camera, index + shift)).mean()
                for shift in (-1, 0, 1)
                if index + shift >= 0
            ]
            own_error = np.square(shown - scene.image(camera, index)).mean()
            assert own_error == min(errors)
            assert own_error < 40  # a mean error of about six gray levels, from compression


def test_the_rows_are_the_truth_of_their_frames(scene: Scene, recording: Path) -> None:
    for camera in range(2):
        rows = np.loadtxt(recording / "gt" / f"c{camera}.txt", delimiter=",", ndmin=2)
        assert rows.shape[1] == 9
        assert rows[:, 0].min() >= 1
        for frame in range(FRAMES):
            truth = scene.truth(frame)[camera]
            frame_rows = rows[rows[:, 0] == frame + 1]
            assert frame_rows[:, 1].tolist() == truth.ids.tolist()
            assert np.allclose(frame_rows[:, 2:4] + frame_rows[:, 4:6], truth.boxes[:, 2:])
            assert np.allclose(frame_rows[:, 8], truth.visibility, atol=1e-3)
            assert (frame_rows[:, 6:8] == 1).all()


def test_the_homographies_are_those_of_the_scene(scene: Scene, recording: Path) -> None:
    ground = json.loads((recording / "ground.json").read_text())
    assert ground["unit"] == "m"
    assert list(ground["homography"]) == ["c0", "c1"]
    assert np.allclose(ground["homography"]["c1"], scene.homography(1))


def test_the_same_scene_gives_the_same_bytes(scene: Scene, recording: Path, tmp_path: Path) -> None:
    write_recording(scene, tmp_path / "again", FRAMES / scene.fps)
    for path in recording.rglob("*"):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / "again" / path.relative_to(recording)).read_bytes()


def test_progress_is_reported_frame_by_frame(scene: Scene, tmp_path: Path) -> None:
    progress: list[tuple[int, int]] = []
    (tmp_path / "empty").mkdir()
    write_recording(scene, tmp_path / "empty", 0.2, lambda done, whole: progress.append((done, whole)))
    assert progress == [(n, 5) for n in range(1, 6)]


def test_a_folder_that_is_not_empty_is_refused_and_unchanged(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(FileExistsError, match="not an empty folder") as caught:
        write_recording(scene, tmp_path, 1)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    with pytest.raises(FileExistsError):
        write_recording(scene, tmp_path / "mine.txt", 1)
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_no_frames_are_refused(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one frame"):
        write_recording(scene, tmp_path / "none", 0)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_with_an_odd_side_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="even, not 321 x 180"):
        write_recording(Scene("room", 1, 1, 0, 321, 180), tmp_path / "odd", 1)
    assert list(tmp_path.iterdir()) == []
