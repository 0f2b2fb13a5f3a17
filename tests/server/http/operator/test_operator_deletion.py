"""Deletion of a person's data through the API: a plan first, then nothing of them is left."""

from __future__ import annotations

import asyncio
import gc
import json
import threading
from collections.abc import AsyncIterator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fakes.http.tokens import TOKEN_ENTRIES, bearer
from fakes.service.fed_site import ServedSite
from fakes.service.recorded_people import EPOCHS, FEET, serve_recorded_people, show
from fakes.service.scripted_cameras import CAMERAS, FPS
from server.http.access.csrf import CSRF_HEADER
from server.service.deletion import decision_rows, recording_deletion
from server.service.deletion.journal import JOURNAL_FILE, Deletion, DeletionJournal
from server.service.deletion.recorded_traces import RecordedTraces, find_traces
from server.service.facade import deletion, past_search
from server.service.past_search.search import search
from server.service.past_search.worker import SearchTask, StaySearchResult
from server.service.recording.recording_session import RecordingSession
from server.service.recording.segment_index import IndexEntry, SegmentIndex

DELETION = "/api/operator/deletion"
A, B = CAMERAS


async def search_here(task: SearchTask) -> StaySearchResult:
    return search(task)


@pytest.fixture
async def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[ServedSite]:
    monkeypatch.setattr(past_search, "run_search", search_here)
    async with serve_recorded_people(tmp_path) as served:
        yield served


async def plan(site: ServedSite, query: str, token: str = "lead") -> tuple[int, Any]:  # noqa: S107
    async with site.session.get(f"{DELETION}?{query}", headers=bearer(token)) as answer:
        return answer.status, await answer.json()


async def delete(site: ServedSite, token: str = "lead", **content: Any) -> tuple[int, Any]:  # noqa: S107
    headers = {CSRF_HEADER: "1", **bearer(token)}
    async with site.session.post(DELETION, headers=headers, json=content) as answer:
        return answer.status, await answer.json()


async def get(site: ServedSite, path: str) -> tuple[int, Any]:
    async with site.session.get(path, headers=bearer("lead")) as answer:
        return answer.status, await answer.json()


def texts(folder: Path) -> Iterator[str]:
    """Yield the decisions, playlists and files of decisions in a folder."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in {".jsonl", ".m3u8", ".csv", ".txt"}:
            yield path.read_text(encoding="utf-8")


def mentioned(folder: Path) -> list[int]:
    """Return all people in the decisions of a recording."""
    lines = [json.loads(line) for path in folder.rglob("*.jsonl") for line in path.read_text().splitlines()]
    boxes = [box[0] for gop in lines for frames in gop["boxes"].values() for frame in frames for box in frame]
    return sorted({*boxes, *(int(number) for gop in lines for number in gop["choices"])})


async def test_the_plan_says_what_goes_and_changes_nothing(site: ServedSite, tmp_path: Path) -> None:
    before = list(texts(tmp_path))
    status, planned = await plan(site, "object=1")
    assert status == 200
    assert (planned["state"], planned["objects"], planned["name"], planned["visible"]) == (
        "planned",
        [1],
        "Ann",
        False,
    )
    assert planned["events"] >= 1
    assert planned["decisions"] >= 8
    lost = {camera["camera"]: camera for camera in planned["cameras"]}
    assert lost.keys() == {A, B}
    assert all(0 < each["seen_s"] <= each["deleted_s"] for each in lost.values())
    assert [each["object"] for each in planned["others"]] == [2]
    assert 0 < planned["others"][0]["deleted_s"] <= lost[B]["deleted_s"]
    assert planned["mentions"] == [
        "rules: ann names them",
        "access.tokens: the token 'family' is for object 1",
        "access.tokens: the token 'carer' is for object 1",
    ]
    assert list(texts(tmp_path)) == before


async def test_nothing_of_a_person_is_left_and_others_are_whole(site: ServedSite, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    status, done = await delete(site, object=1, recordings="keep")
    assert (status, done["state"], done["recordings"]) == (200, "done", "keep")
    assert mentioned(kept) == [2]
    assert sorted(path.stem for path in kept.glob("*/objects/*")) == ["2"]
    assert not any("Ann" in text or "1.m3u8" in text for text in texts(tmp_path))
    rows = (tmp_path / "out" / "tracks" / f"{B}.txt").read_text().splitlines()
    assert {row.split(",")[1] for row in rows} == {"2"}
    assert (await get(site, "/api/objects/1/choice"))[0] == 404
    assert (await get(site, "/api/operator/people"))[1]["names"] == {}
    _, found = await get(site, "/api/past/search?from=p0")
    assert {stay["object"] for stay in found["stays"]} == {2}
    assert all(1 not in event["objects"] for event in (await get(site, "/api/rules"))[1]["events"])
    _, past = await get(site, "/api/cameras/c1/past")
    assert len(past["spans"]) == 1, "no picture is deleted"
    assert (await delete(site, object=1, recordings="keep"))[0] == 404
    assert (await plan(site, "object=1"))[0] == 404


async def test_with_the_recordings_go_the_files_of_the_cameras_that_saw_them(
    site: ServedSite, tmp_path: Path
) -> None:
    _, planned = await plan(site, "object=1")
    files = set((tmp_path / "kept").rglob("cameras/*/*.mp4"))
    status, done = await delete(site, object=1, recordings="delete")
    assert (status, done["cameras"]) == (200, planned["cameras"])
    left = set((tmp_path / "kept").rglob("cameras/*/*.mp4"))
    assert left < files
    gone = range(8 * 5 + FPS + 10)  # a second after they left, and two segments' ends
    for camera in (A, B):
        firsts = [int(path.stem) for path in sorted(left) if path.parent.name == camera]
        assert firsts[0] >= 8 * 5
        assert firsts[0] in gone
        lines = [path.read_text() for path in (tmp_path / "kept").glob(f"*/cameras/{camera}.m3u8")]
        assert f"{camera}/{firsts[0]:012}.mp4" in lines[0]
        assert f"{camera}/{0:012}.mp4" not in lines[0]


async def test_who_is_visible_goes_on_with_another_number_that_nothing_links(
    site: ServedSite, tmp_path: Path
) -> None:
    decisions: list[Any] = []
    show(site, EPOCHS, ann=FEET)
    show(site, EPOCHS + 1, ann=FEET)
    show(site, EPOCHS + 2, ann=FEET)
    assert (await plan(site, "object=1"))[1]["visible"]
    site.service.on_decision.append(decisions.append)
    assert (await delete(site, object=1, recordings="keep"))[0] == 200
    for epoch in range(EPOCHS + 3, EPOCHS + 8):
        show(site, epoch, ann=FEET)
    numbers = {
        box[0] for gop in decisions for frames in gop.boxes.values() for frame in frames for box in frame
    }
    assert numbers == {2, 101}
    assert not any(gop.merged or gop.split or gop.cuts for gop in decisions)
    assert [person["name"] for person in (await get(site, "/api/objects"))[1]["objects"]] == [None, None]
    site.service.recorder.close()
    assert mentioned(tmp_path / "kept") == [2, 101]


async def test_an_earlier_session_has_people_of_its_own(site: ServedSite, tmp_path: Path) -> None:
    recorder = site.service.recorder
    assert recorder.folder is not None
    (session,) = recorder.folder.sessions
    session.set_person_numbers_since(1000.0)
    run = session.folder.name
    assert (await plan(site, f"object=9&run={run}"))[0] == 404
    status, planned = await plan(site, f"object=2&run={run}")
    assert (status, planned["run"], planned["name"], planned["visible"]) == (200, run, None, False)
    assert (await delete(site, object=2, recordings="keep", run=run))[0] == 200
    assert mentioned(tmp_path / "kept") == [1]
    assert 2 in [person["object"] for person in (await get(site, "/api/objects"))[1]["objects"]]


async def test_recording_goes_on_while_somebody_is_deleted(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find, epochs = recording_deletion.RecordingDeletion.find, iter(range(EPOCHS, EPOCHS + 16))

    async def find_late(
        deletion: recording_deletion.RecordingDeletion, sessions: list[RecordingSession], numbers: set[int]
    ) -> RecordedTraces:
        for _ in range(4):
            show(site, next(epochs), ann=FEET)
        writer = site.service.recorder.writer
        assert writer is not None
        await asyncio.wrap_future(writer.run(lambda: None))
        return await find(deletion, sessions, numbers)

    monkeypatch.setattr(recording_deletion.RecordingDeletion, "find", find_late)
    folder = site.service.recorder.folder
    assert folder is not None
    monkeypatch.setattr(folder, "_limits", replace(folder._limits, segment_s=60.0))  # none ends by itself
    assert (await delete(site, object=1, recordings="delete"))[0] == 200
    for epoch in epochs:
        show(site, epoch, ann=FEET)
    site.service.recorder.close()
    assert len(list((tmp_path / "kept").glob("*/session.json"))) == 1
    assert site.service.recorder.writer is not None
    assert site.service.recorder.writer.lost == 0
    assert mentioned(tmp_path / "kept") == [2, 101]


async def test_merged_numbers_are_one_person(site: ServedSite, tmp_path: Path) -> None:
    site.service.decider.people.merge(2, 1)
    for epoch in range(EPOCHS, EPOCHS + 4):
        show(site, epoch, ann=None)
    site.service.decider.people.registry.merged.clear()  # it keeps the newest only
    status, done = await delete(site, object=1, recordings="keep")
    assert (status, done["objects"]) == (200, [1, 2])
    assert mentioned(tmp_path / "kept") == []


async def test_who_is_merged_while_the_disk_is_waited_for_is_deleted_everywhere(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin, people = recording_deletion.RecordingDeletion.begin, site.service.decider.people

    async def merge_and_begin(
        deletion: recording_deletion.RecordingDeletion, begun: Deletion, before: Deletion | None = None
    ) -> None:
        if 2 not in people.registry.merged:
            people.merge(1, 2)
        await begin(deletion, begun, before)

    monkeypatch.setattr(recording_deletion.RecordingDeletion, "begin", merge_and_begin)
    status, done = await delete(site, object=2, recordings="keep")
    told = site.service.replication._deletions
    assert (status, done["objects"], [each.numbers for each in told]) == (200, [1, 2], [[1, 2]])
    assert not {1, 2} & {*people.registry.all_numbers, *people.registry.merged}
    assert mentioned(tmp_path / "kept") == []
    assert len(json.loads((tmp_path / "kept" / JOURNAL_FILE).read_text())) == 1


@pytest.mark.parametrize("step", ["find_traces", "remove_rows", "remove_from_session"])
async def test_a_deletion_that_was_interrupted_is_completed_at_the_next_start(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    calls = 0

    def fail(*arguments: object) -> RecordedTraces:
        nonlocal calls
        calls += 1
        if step == "find_traces" and calls == 1:  # before anything is deleted, to say what there is
            return find_traces(*arguments)  # type: ignore[arg-type]
        raise OSError(5, "Input/output error", "disk")

    with monkeypatch.context() as broken:
        broken.setattr(recording_deletion, step, fail)
        status, error = await delete(site, object=1, recordings="delete")
    assert status == 503
    assert error["error"] == "object 1: disk: Input/output error; the rest is deleted at the next start"
    kept = tmp_path / "kept"
    files = set(kept.rglob("cameras/*/*.mp4"))
    later = recording_deletion.RecordingDeletion(site.service.recorder)  # as after a start
    assert [each.numbers for each in await later.read_journal()] == [[1]]
    await later.complete_interrupted()
    assert mentioned(kept) == [2]
    assert set(kept.rglob("cameras/*/*.mp4")) < files
    assert later.forgotten(site.service.state_replication.numbers_since) == {1}
    assert '"files":' not in (kept / JOURNAL_FILE).read_text()
    again = recording_deletion.RecordingDeletion(site.service.recorder)
    assert [each.numbers for each in await again.read_journal()] == [[1]], "others may not have heard of it"
    await again.complete_interrupted()
    assert mentioned(kept) == [2]


async def test_what_cannot_be_written_down_is_not_begun(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(DeletionJournal, "put", fail)
    before = list(texts(tmp_path))
    assert await delete(site, object=1, recordings="delete") == (
        503,
        {"error": "object 1: nothing is deleted: No space left on device"},
    )
    assert list(texts(tmp_path)) == before
    assert (await get(site, "/api/operator/people"))[1]["names"] == {"1": "Ann"}


async def test_a_damaged_journal_is_one_line_and_nothing_is_deleted_until_it_is_mended(
    site: ServedSite, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    journal = tmp_path / "kept" / JOURNAL_FILE
    journal.write_text("[{]")
    assert await site.service.recording_deletion.read_journal() == []
    assert "interrupted deletions cannot be completed: " in caplog.text
    assert "Traceback" not in caplog.text
    before = list(texts(tmp_path))
    status, error = await delete(site, object=1, recordings="keep")
    assert status == 503
    assert error["error"].startswith(f"object 1: nothing is deleted: {journal}: cannot be read (")
    assert error["error"].endswith("): repair it, or move it away and delete again")
    assert journal.read_text() == "[{]"
    assert list(texts(tmp_path)) == before
    journal.rename(tmp_path / "moved")
    assert (await delete(site, object=1, recordings="keep"))[0] == 200


async def test_a_disk_that_is_gone_completes_no_deletion(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remove = decision_rows.remove_rows
    (folder,) = [path.parent for path in (tmp_path / "kept").glob("*/session.json")]
    away = tmp_path / "away"

    def unmount(path: Path, numbers: frozenset[int]) -> None:
        if folder.exists():
            folder.rename(away)
        remove(path, numbers)

    with monkeypatch.context() as unmounted:
        unmounted.setattr(recording_deletion, "remove_rows", unmount)
        status, error = await delete(site, object=1, recordings="keep")
    text = f"object 1: {folder}: not there any more: mount its disk, or restart without it"
    assert (status, error["error"]) == (503, f"{text}; the rest is deleted at the next start")
    assert (await plan(site, "object=2"))[0] == 503
    away.rename(folder)
    later = recording_deletion.RecordingDeletion(site.service.recorder)
    assert [each.numbers for each in await later.read_journal()] == [[1]]
    await later.complete_interrupted()
    assert mentioned(tmp_path / "kept") == [2]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (OSError(5, "Input/output error", "disk"), "disk: Input/output error"),
        (KeyError("c9"), "KeyError('c9')"),
    ],
)
async def test_a_deletion_that_fails_after_its_answer_is_one_line_in_the_log(
    site: ServedSite,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
    text: str,
) -> None:
    answered = asyncio.Event()

    async def fail(*_: object) -> None:
        await answered.wait()
        raise error

    monkeypatch.setattr(deletion, "_WAIT_S", 0.0)
    monkeypatch.setattr(recording_deletion.RecordingDeletion, "execute", fail)
    status, running = await delete(site, object=1, recordings="keep")
    assert (status, running["state"]) == (200, "running")
    (task,) = [each for each in asyncio.all_tasks() if each.get_name() == "deletion"]
    answered.set()
    await asyncio.wait({task})
    del task
    gc.collect()  # else an error that nobody has retrieved is not logged yet
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == [
        f"deletion of a person: {text}; completed at the next start"
    ]
    assert "Traceback" not in caplog.text


async def test_nothing_is_deleted_while_interrupted_deletions_are_completed(
    site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    execute, begun, may_end = recording_deletion.RecordingDeletion.execute, asyncio.Event(), asyncio.Event()

    async def execute_late(
        within: recording_deletion.RecordingDeletion, interrupted: Deletion
    ) -> RecordedTraces | None:
        begun.set()
        await may_end.wait()
        return await execute(within, interrupted)

    monkeypatch.setattr(recording_deletion.RecordingDeletion, "execute", execute_late)
    interrupted = site.service.recording_deletion
    await interrupted.begin(Deletion(numbers=[9], numbers_since=1000.0, deletes_media=False))
    completing = asyncio.create_task(interrupted.complete_interrupted())
    await begun.wait()
    assert await delete(site, object=1, recordings="keep") == (
        409,
        {"error": "another deletion is not complete yet: try again later"},
    )
    assert (await plan(site, "object=1"))[0] == 200
    may_end.set()
    await completing
    assert (await delete(site, object=1, recordings="keep"))[0] == 200


async def test_decisions_that_cannot_be_read_are_one_clear_error(
    site: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = next((tmp_path / "kept").glob("*/index/*.jsonl"))
    read = Path.read_bytes

    def fail(file: Path) -> bytes:
        if file == path:
            raise OSError(5, "Input/output error", str(file))
        return read(file)

    monkeypatch.setattr(Path, "read_bytes", fail)
    error = {"error": f"object 1: nothing is deleted: {path}: Input/output error"}
    assert await plan(site, "object=1") == (503, error)
    assert await delete(site, object=1, recordings="keep") == (503, error)
    assert not (tmp_path / "kept" / JOURNAL_FILE).exists()


async def test_a_plan_reads_the_index_in_a_reader_thread(
    site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads: set[str] = set()
    between = SegmentIndex.between

    def noted(index: SegmentIndex, start: int, end: int) -> list[IndexEntry]:
        threads.add(threading.current_thread().name.partition("_")[0])
        return between(index, start, end)

    monkeypatch.setattr(SegmentIndex, "between", noted)
    assert (await plan(site, "object=1"))[0] == 200
    assert threads == {"recording-reader"}


async def test_two_deletions_at_once_are_one(site: ServedSite) -> None:
    answers = await asyncio.gather(
        delete(site, object=1, recordings="keep"), delete(site, object=1, recordings="keep")
    )
    assert sorted(status for status, _ in answers) in ([200, 404], [200, 409])


INVALID: list[tuple[dict[str, Any], int, str]] = [
    ({"object": 9, "recordings": "keep"}, 404, "there is no object 9"),
    ({"object": 1}, 400, "the request's JSON: Object missing required field `recordings`"),
    ({"object": 1, "recordings": "blur"}, 400, "the request's JSON: Invalid enum value 'blur'"),
    ({"object": 0, "recordings": "keep"}, 400, "the request's JSON: Expected `int` >= 1"),
    ({"object": 1, "recordings": "keep", "run": "x"}, 400, "run: there is no recorded session 'x'"),
]


async def test_what_is_invalid_or_not_an_operators_deletes_nothing(site: ServedSite, tmp_path: Path) -> None:
    before = list(texts(tmp_path))
    for content, status, error in INVALID:
        code, answer = await delete(site, **content)
        assert (code, answer["error"][: len(error)]) == (status, error)
    for query in ("", "object=x", "object=0", "object=1&run=" + 65 * "x"):
        assert (await plan(site, query))[0] == 400
    for viewer in sorted(TOKEN_ENTRIES.keys() - {"lead"}):
        assert (await plan(site, "object=1", viewer))[0] == 403
        assert (await delete(site, viewer, object=1, recordings="keep"))[0] == 403
    async with site.session.post(DELETION, headers=bearer("lead"), json={}) as answer:
        assert answer.status == 403, "without the header that other sites cannot send"
    assert list(texts(tmp_path)) == before
