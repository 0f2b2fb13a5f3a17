"""`myview doctor` reports problems of a configuration, with remedies."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from camsync import Credentials, PulseClient, PulseServer
from fakes.cli.command_line import RunCommand
from fakes.cli.doctor_configs import SIZE, load_site, write_site
from fakes.media.rtsp_camera import RtspCamera
from fakes.media.videos import write_video
from fakes.programs import needs_openssl
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import FPS, HEIGHT, WIDTH, encoded
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.cli.doctor import machine
from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.cameras import camera_findings, probe_cameras, sound_findings
from server.cli.doctor.certificates import certificate_finding
from server.cli.doctor.command import run_checks
from server.cli.doctor.disk import disk_findings, needed_mb
from server.cli.doctor.files import file_findings
from server.cli.doctor.findings import Finding, Level
from server.cli.doctor.machine import clock_findings, machine_findings
from server.cli.doctor.ports import port_findings
from server.cli.doctor.stream_probe import StreamStats


class Reported(NamedTuple):
    level: Level
    text: str


def findings_of(findings: list[Finding], check: str) -> list[Reported]:
    return [Reported(finding.level, finding.text) for finding in findings if finding.check == check]


def finding_of(findings: list[Finding], check: str) -> Reported:
    (reported,) = findings_of(findings, check)
    return reported


def test_a_working_site_is_ok_and_nothing_is_left_behind(myview: RunCommand, tmp_path: Path) -> None:
    write_video(tmp_path / "c0.mp4", 12)
    path = write_site(tmp_path, record={"folder": "kept"})
    before = sorted(tmp_path.iterdir())
    result = myview("doctor", path, "--json", "--seconds", 20)
    reported = json.loads(result.out)
    assert (result.code, result.err, reported["ok"]) == (0, "", True)
    (camera,) = [finding for finding in reported["findings"] if finding["check"] == "camera c0"]
    assert camera["level"] == "ok"
    assert camera["text"].startswith("64x48 pixels, 25.0 pictures a second, ")
    assert {finding["check"] for finding in reported["findings"]} >= {
        "configuration", "http.port", "sync.port", "zenoh.listen", "clock", "disk", "processor", "memory"
    }  # fmt: skip
    assert sorted(tmp_path.iterdir()) == before


async def test_an_unknown_scene_is_reported_by_its_camera_only(tmp_path: Path) -> None:
    site_config = load_site(tmp_path, cameras=[{"id": "c0", "source": "scene:nowhere"}])
    found = [finding async for finding in run_checks(site_config, 1.0)]
    assert finding_of(found, "camera c0").level is Level.BAD
    assert "there is no scene 'nowhere'" in finding_of(found, "camera c0").text
    assert {finding.check for finding in found if finding.level is Level.BAD} == {"camera c0"}


def test_a_missing_camera_is_one_line_with_a_remedy_and_an_exit_code(
    myview: RunCommand, tmp_path: Path
) -> None:
    result = myview("doctor", write_site(tmp_path))
    assert (result.code, result.err) == (1, "")
    (line,) = [line for line in result.out.splitlines() if "camera c0" in line]
    assert line.startswith("bad ")
    assert "c0.mp4: no such file or folder" in line
    assert "→ fix its source in the configuration, or make the file readable" in line
    assert result.out.splitlines()[-1].endswith("1 bad")


def test_an_invalid_configuration_is_the_only_finding(myview: RunCommand, tmp_path: Path) -> None:
    result = myview("doctor", write_site(tmp_path, htp={"port": 1}), "--json")
    reported = json.loads(result.out)
    assert (result.code, reported["ok"]) == (1, False)
    (finding,) = reported["findings"]
    assert (finding["check"], finding["level"]) == ("configuration", "bad")
    assert "did you mean 'http'?" in finding["text"]


@pytest.fixture
def used_port() -> Iterator[int]:
    """Yield a port with a listener that never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield int(server.getsockname()[1])


async def test_a_port_used_by_another_program_is_bad(tmp_path: Path, used_port: int) -> None:
    found, runs = await port_findings(load_site(tmp_path, sync={"port": used_port}))
    assert not runs
    assert finding_of(found, "sync.port") == (Level.BAD, f"127.0.0.1:{used_port} is used by another program")
    assert {finding_of(found, check).level for check in ("http.port", "zenoh.listen")} == {Level.OK}


async def test_an_address_of_another_machine_is_bad(tmp_path: Path) -> None:
    found, _ = await port_findings(load_site(tmp_path, sync={"bind": "192.0.2.7", "port": 7}))
    assert finding_of(found, "sync.port").level is Level.BAD
    assert "192.0.2.7:7" in finding_of(found, "sync.port").text


async def test_ports_used_by_this_site_are_ok(served: ServedSite, tmp_path: Path, used_port: int) -> None:
    cameras = [{"id": name, "source": "scene:room"} for name in served.service.config.camera_ids]
    changes: Any = {
        "http": {"port": served.port},
        "cameras": cameras,
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{used_port}"),
    }
    found, runs = await port_findings(load_site(tmp_path, **changes))
    assert runs
    assert finding_of(found, "http.port").text.endswith("by this site, which is running")
    assert finding_of(found, "zenoh.listen").level is Level.OK
    found, runs = await port_findings(load_site(tmp_path, **changes, site={"name": "another", **SIZE}))
    assert (runs, finding_of(found, "http.port").level) == (False, Level.BAD)
    assert finding_of(found, "zenoh.listen").level is Level.BAD


async def test_the_clock_of_a_running_pulse_server_is_compared(tmp_path: Path) -> None:
    site_config = load_site(tmp_path)
    assert "is not running" in finding_of(await clock_findings(site_config), "pulse server").text
    async with PulseServer(FPS, port=site_config.sync.port):
        found = finding_of(await clock_findings(site_config), "pulse server")
    assert found.level is Level.OK
    assert "ms off this machine's" in found.text


async def test_a_pulse_server_that_accepts_a_password_of_this_site_is_its_own(
    tmp_path: Path,
) -> None:
    users = {"c0": "0" * 32, "bestview": "1" * 32}
    (tmp_path / "users").write_text(f"c0:{users['c0']}\n")  # a camera's machine has only its own line
    site_config = load_site(tmp_path, sync={"port": free_port(), "users": "users"})
    credentials = Credentials("bestview", users["bestview"])
    async with (
        PulseServer(FPS, port=site_config.sync.port, users=users) as server,
        PulseClient("127.0.0.1", server.port, "bestview", credentials=credentials) as service,
    ):
        await anext(aiter(service))
        assert "ms off this machine's" in finding_of(await clock_findings(site_config), "pulse server").text
        found, _ = await port_findings(site_config)
        assert finding_of(found, "sync.port").level is Level.OK
        (tmp_path / "users").write_text(f"c0:{'2' * 32}\n")
        found, _ = await port_findings(site_config)
        assert finding_of(found, "sync.port").level is Level.BAD
        assert server.clients()[0].name == "bestview", "the query takes no camera's place"


async def test_a_server_of_another_protocol_is_not_a_pulse_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "_ANSWER_S", PATIENCE)
    site_config, left = load_site(tmp_path), asyncio.Event()

    async def endless(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"a" * 100_000)  # more than any connection
        with contextlib.suppress(ConnectionError):
            await reader.read()
        writer.close()
        left.set()

    async with await asyncio.start_server(endless, "127.0.0.1", site_config.sync.port):
        assert "is not running" in finding_of(await clock_findings(site_config), "pulse server").text
        async with asyncio.timeout(PATIENCE):
            await left.wait()


def test_a_network_camera_is_measured_against_the_site(tmp_path: Path) -> None:
    units = encoded(0, 40)
    camera = RtspCamera([units[at : at + 5] for at in range(0, 40, 5)], 12.5)
    cameras = [{"id": "door", "source": camera.url, "options": {"rtsp_transport": "tcp"}}]
    site_of = load_site(tmp_path, cameras=cameras, site={"name": "hall", "width": 128, "height": 96})
    try:
        camera.gop_limit = 1000
        found = camera_findings(site_of, probe_cameras(site_of, 4.0), runs=False)
    finally:
        camera.close()
    first, *doubts = findings_of(found, "camera door")
    assert first.level is Level.OK, first
    assert first.text.startswith("64x48 pixels, ")
    assert any("are smaller than the site's (128x96)" in finding.text for finding in doubts)
    assert all(finding.level is Level.WARNING for finding in doubts)


def test_cameras_are_probed_in_parallel_and_a_dead_one_delays_none(tmp_path: Path, used_port: int) -> None:
    write_video(tmp_path / "c0.mp4", 12)
    silent = {"id": "gate", "source": f"rtsp://127.0.0.1:{used_port}/live"}
    both = load_site(tmp_path, cameras=[silent, {"id": "c0", "source": "c0.mp4"}])
    probes = probe_cameras(both, 1.5)
    assert probes["gate"].problem
    found = camera_findings(both, probes, runs=False)
    assert finding_of(found, "camera gate").level is Level.BAD
    assert finding_of(camera_findings(both, probes, runs=True), "camera gate").level is Level.WARNING


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            CameraProbe(size=(640, 360), sent=StreamStats((640, 360), 12.5, 25, 0, 0.0)),
            "it sends 12.5 pictures a second",
        ),
        (
            CameraProbe(size=(640, 360), sent=StreamStats((640, 360), 25.0, 25, 3, 0.0)),
            "3 packets could not be decoded",
        ),
        (CameraProbe(size=(640, 360), why_encoded="it has B frames"), "is re-encoded: it has B frames"),
        (CameraProbe(size=(640, 360), recorded_fps=30.0), "was recorded at 30 pictures a second"),
        (CameraProbe(size=(320, 180)), "are smaller than the site's"),
    ],
)
def test_a_camera_that_does_not_fit_the_site_is_a_warning(
    tmp_path: Path, found: CameraProbe, words: str
) -> None:
    small = load_site(tmp_path, site={"width": 640, "height": 360})
    assert (
        len(
            findings_of(camera_findings(small, {"c0": CameraProbe(size=(640, 360))}, runs=False), "camera c0")
        )
        == 1
    )
    fine, doubt = findings_of(camera_findings(small, {"c0": found}, runs=False), "camera c0")
    assert (fine.level, doubt.level) == (Level.OK, Level.WARNING)
    assert words in doubt.text


def test_a_password_file_is_used_and_should_be_private(folder_of_all: Path, used_port: int) -> None:
    tmp_path = folder_of_all
    cameras = [
        {"id": "gate", "source": f"rtsp://me:{{password}}@127.0.0.1:{used_port}/live", "password": "secret"}
    ]
    site_config = load_site(tmp_path, cameras=cameras)
    missing = finding_of(
        camera_findings(site_config, probe_cameras(site_config, 1.0), runs=False), "camera gate"
    ).text
    assert "the file cannot be read: No such file or directory" in missing
    (tmp_path / "secret").write_text("open sesame\n")
    (tmp_path / "secret").chmod(0o644)
    assert "others may read" in finding_of(file_findings(site_config), "camera gate").text
    shown = finding_of(
        camera_findings(site_config, probe_cameras(site_config, 1.0), runs=False), "camera gate"
    ).text
    assert f"rtsp://127.0.0.1:{used_port}/..." in shown


def test_sound_that_cannot_be_opened_is_bad(tmp_path: Path) -> None:
    assert sound_findings(load_site(tmp_path)) == []
    write_video(tmp_path / "silent.mp4", 3)
    for source, words in (("none.wav", "none.wav: is neither"), ("silent.mp4", "sound")):
        found = finding_of(sound_findings(load_site(tmp_path, sound={"source": source})), "sound")
        assert found.level is Level.BAD
        assert words in found.text


def test_the_password_of_a_sound_source_is_not_shown(tmp_path: Path) -> None:
    site_config = load_site(tmp_path, sound={"source": "http://viewer:hunter2@127.0.0.1:9/sound.aac"})
    reported = finding_of(sound_findings(site_config), "sound").text
    assert "127.0.0.1" in reported
    assert "hunter2" not in reported


def test_a_cameras_password_is_not_shown(tmp_path: Path, used_port: int) -> None:
    source = f"rtsp://me:pa@ss:w@127.0.0.1:{used_port}/live?x=a:b@c"
    site_config = load_site(tmp_path, cameras=[{"id": "gate", "source": source}])
    shown = finding_of(
        camera_findings(site_config, probe_cameras(site_config, 1.0), runs=False), "camera gate"
    ).text
    assert "rtsp://...: cannot open" in shown


def test_the_size_of_the_recording_is_compared_with_the_disk(tmp_path: Path) -> None:
    record: dict[str, Any] = {"folder": "kept", "keep_s": 3600.0, "max_mb": 1e6}
    probes = {"c0": CameraProbe(size=(WIDTH, HEIGHT), kbps=1000.0)}
    small = load_site(tmp_path, record=record)
    assert needed_mb(small, probes) == pytest.approx((1000 + 8 * 100 * 25 / 1000) * 3600 / 8000)
    assert finding_of(disk_findings(small, probes), "disk").level is Level.OK
    assert not (tmp_path / "kept").exists()
    huge = {"c0": CameraProbe(size=(WIDTH, HEIGHT), kbps=1e12)}
    assert (
        finding_of(disk_findings(load_site(tmp_path, record={**record, "max_mb": 1e12}), huge), "disk").level
        is Level.BAD
    )
    capped = load_site(tmp_path, record=record, encode={"max_kbps": 500})
    assert needed_mb(capped, huge) == pytest.approx((500 + 20) * 3600 / 8000)
    less = disk_findings(load_site(tmp_path, record={**record, "max_mb": 46.0}), probes)
    assert "about 6 minutes are kept" in finding_of(less, "record.max_mb").text


def test_files_removed_by_a_running_site_are_not_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kept").mkdir()
    for name in ("old", "new"):
        (tmp_path / "kept" / name).write_bytes(bytes(3_000_000))
    walk = os.walk

    def walked(folder: Path) -> Iterator[Any]:
        for found in walk(folder):
            (tmp_path / "kept" / "old").unlink()
            yield found

    monkeypatch.setattr(os, "walk", walked)
    findings = disk_findings(load_site(tmp_path, record={"folder": "kept"}), {})
    assert "and 3 MB are recorded already" in finding_of(findings, "disk").text


def test_a_folder_that_cannot_be_written_is_bad(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("a file")
    assert (
        finding_of(disk_findings(load_site(tmp_path, record={"folder": "kept"}), {}), "record.folder").level
        is Level.BAD
    )


@pytest.fixture
def folder_of_all() -> Iterator[Path]:
    """A folder that other users may enter, unlike those of pytest."""
    with tempfile.TemporaryDirectory(prefix="myview-doctor-", dir="/tmp") as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


def test_secret_files_in_a_folder_that_others_may_not_enter_are_private(folder_of_all: Path) -> None:
    inner = folder_of_all / "secrets" / "web"
    inner.mkdir(parents=True)
    (inner / "tokens.yaml").write_text("tokens: []\n")
    (inner / "tokens.yaml").chmod(0o666)
    site_config = load_site(folder_of_all, access={"tokens": str(inner / "tokens.yaml")})
    for folder in (inner, inner.parent):
        folder.chmod(0o755)
    assert "others may write" in " ".join(finding.text for finding in file_findings(site_config))
    for folder in (inner, inner.parent):
        folder.chmod(0o700)
        assert "others may" not in " ".join(finding.text for finding in file_findings(site_config))
        folder.chmod(0o755)


def test_files_that_others_can_read_or_write_are_reported(folder_of_all: Path) -> None:
    tmp_path = folder_of_all
    tokens, users = tmp_path / "tokens.yaml", tmp_path / "users"
    tokens.write_text("tokens: []\n")
    users.write_text("bestview:secret word\n")
    tokens.chmod(0o666)
    users.chmod(0o644)
    changes: Any = {"access": {"tokens": "tokens.yaml"}}
    bus = {**dict.fromkeys(("connect", "listen"), "tcp/127.0.0.1:7447"), "users": "users"}
    found = file_findings(load_site(tmp_path, **changes, zenoh=bus))
    words = " ".join(finding.text for finding in found if finding.level is Level.WARNING)
    assert "lets no one in" in words
    assert f"others may write {tokens}" in words
    assert f"others may read {users}" in words
    assert "no line for c0" in words
    pulses = file_findings(load_site(tmp_path, **changes, sync={"port": 7400, "users": "users"}))
    assert [finding.level for finding in findings_of(pulses, "sync.users")] == [Level.BAD, Level.WARNING]
    assert "passwords of bestview" in findings_of(pulses, "sync.users")[0].text
    users.write_text("bestview:" + "b" * 32 + "\n")
    pulses = file_findings(load_site(tmp_path, **changes, sync={"port": 7400, "users": "users"}))
    assert "no line for c0" in findings_of(pulses, "sync.users")[0].text
    tokens.write_text("tokens: nonsense\n")
    assert findings_of(file_findings(load_site(tmp_path, **changes)), "access.tokens")[0].level is Level.BAD


def test_a_site_exposed_by_accident_is_bad(tmp_path: Path) -> None:
    found = finding_of(file_findings(load_site(tmp_path, http={"host": "0.0.0.0"})), "access")  # noqa: S104
    assert found.level is Level.BAD
    assert "http.host" in found.text


def test_a_camera_without_a_homography_among_calibrated_ones_is_a_warning(tmp_path: Path) -> None:
    ground = [[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]
    cameras = [{"id": "c0", "source": "x", "ground": ground}, {"id": "c1", "source": "y"}]
    reported = finding_of(file_findings(load_site(tmp_path, cameras=cameras)), "ground")
    assert reported == (Level.WARNING, "c1: no homography: people are matched by appearance alone there")


def test_the_available_processors_are_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "available_processors", lambda: 0.5)
    reported = finding_of(machine_findings(load_site(tmp_path), {"c0": CameraProbe(cores=0.2)}), "processor")
    assert (reported.level, reported.text.endswith("of 0.5 cores")) == (Level.WARNING, True)


def test_a_machine_that_is_too_small_is_a_warning(tmp_path: Path) -> None:
    small = load_site(tmp_path)
    fine, busy = ({"c0": CameraProbe(size=(WIDTH, HEIGHT), cores=cores)} for cores in (0.0, 1000.0))
    assert finding_of(machine_findings(small, fine), "processor").level is Level.OK
    assert finding_of(machine_findings(small, busy), "processor").level is Level.WARNING
    large = load_site(tmp_path, track={"backlog_s": 1e7})
    assert finding_of(machine_findings(large, fine), "memory").level is Level.WARNING


def expired_certificate(folder: Path) -> tuple[Path, Path]:
    """Create an expired certificate, signed by an authority, since only that can set its start."""
    certificate, key, request, settings = (
        folder / name for name in ("over.pem", "over.key", "asked", "settings")
    )
    (folder / "known").touch()
    (folder / "serial").write_text("01\n")
    settings.write_text(
        "[ca]\ndefault_ca = here\n[here]\ndefault_md = sha256\npolicy = any\n"
        f"database = {folder}/known\nserial = {folder}/serial\nnew_certs_dir = {folder}\n"
        "[any]\ncommonName = supplied\n"
    )
    made = ["openssl", "req", "-new", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
    made += ["-subj", "/CN=hall", "-out", str(request), "-keyout", str(key)]
    signed = ["openssl", "ca", "-batch", "-notext", "-config", str(settings), "-selfsign"]
    signed += ["-keyfile", str(key), "-in", str(request), "-out", str(certificate)]
    signed += ["-startdate", "20200101000000Z", "-enddate", "20200201000000Z"]
    for command in (made, signed):
        subprocess.run(command, check=True, capture_output=True)
    return certificate, key


@needs_openssl
def test_a_certificate_is_ok_until_shortly_before_it_expires(tmp_path: Path) -> None:
    def made(name: str, *until: str) -> tuple[Path, Path]:
        certificate, key = tmp_path / f"{name}.pem", tmp_path / f"{name}.key"
        request = [
            "openssl",
            "req",
            "-x509",
            "-newkey",
            "ec",
            "-pkeyopt",
            "ec_paramgen_curve:P-256",
            "-nodes",
        ]
        request += [
            *until,
            "-subj",
            "/CN=hall",
            "-addext",
            "subjectAltName=DNS:hall",
            "-out",
            str(certificate),
            "-keyout",
            str(key),
        ]
        subprocess.run(request, check=True, capture_output=True)
        return certificate, key

    (certificate, key), (other, _) = made("long", "-days", "100"), made("short", "-days", "3")
    good = certificate_finding("http.tls", certificate, key)
    assert (good.level, good.text) == (Level.OK, f"{certificate} is valid for 100 days, for hall")
    assert certificate_finding("http.tls", *made("soon", "-days", "3")).level is Level.WARNING
    over = certificate_finding("http.tls", *expired_certificate(tmp_path))
    assert (over.level, over.text) == (Level.BAD, f"{tmp_path / 'over.pem'}: certificate has expired")
    wrong = certificate_finding("http.tls", other, key)
    assert wrong.level is Level.BAD
    assert "not a certificate and its key" in wrong.text
    assert certificate_finding("http.tls", tmp_path / "none.pem", key).level is Level.BAD
