"""`myview doctor`: a check that fails itself is a finding; cameras can reach their server."""

from __future__ import annotations

import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest

from fakes.cli.command_line import RunCommand
from fakes.cli.doctor_configs import load_site, write_site
from fakes.programs import needs_openssl
from fakes.system.ports import free_port
from server.cli.doctor import command, files, ports
from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.cameras import camera_findings
from server.cli.doctor.files import file_findings
from server.cli.doctor.findings import Finding, Level
from server.cli.doctor.ports import port_findings
from server.cli.doctor.reachability import reachability_findings


def findings_of(findings: list[Finding], check: str) -> list[tuple[Level, str]]:
    return [(finding.level, finding.text) for finding in findings if finding.check == check]


def refuse_access(*_: object, **__: object) -> Any:
    raise PermissionError(13, "Permission denied", "/closed/door")


BROKEN = [(Level.BAD, "/closed/door: Permission denied")]


@pytest.mark.parametrize(
    ("check", "lost"),
    [
        ("port_findings", {"http.port", "sync.port", "zenoh.listen"}),
        ("reachability_findings", {"sync.host", "zenoh.connect"}),
        ("clock_findings", {"clock", "pulse server"}),
        ("probe_cameras", set[str]()),
        ("camera_findings", {"camera c0"}),
        ("sound_findings", set[str]()),
        ("disk_findings", {"record"}),
        ("machine_findings", {"processor", "memory"}),
    ],
)
async def test_a_failed_check_does_not_lose_others_findings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, check: str, lost: set[str]
) -> None:
    site_config = load_site(tmp_path)
    before = {finding.check async for finding in command.run_checks(site_config, 1.0)}
    assert before >= {"http.port", "sync.host", "ground", "clock", "camera c0", "record", "memory"}
    monkeypatch.setattr(command, check, refuse_access)
    found = [finding async for finding in command.run_checks(site_config, 1.0)]
    (failed,) = [finding for finding in found if (finding.level, finding.text) == BROKEN[0]]
    assert {finding.check for finding in found if finding is not failed} == before - lost


async def test_a_failed_check_of_one_port_or_file_does_not_lose_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site_config = load_site(tmp_path)
    monkeypatch.setattr(ports, "_is_this_site", refuse_access)
    with socket.create_server(("127.0.0.1", site_config.http.port)):
        found, _ = await port_findings(site_config)
    assert findings_of(found, "http.port") == BROKEN
    assert findings_of(found, "zenoh.listen")[0][0] is Level.OK
    monkeypatch.setattr(files, "_exposed", refuse_access)
    assert findings_of(file_findings(site_config), "access") == BROKEN
    assert findings_of(file_findings(site_config), "ground")[0][0] is Level.OK


async def test_a_bug_is_reported_without_a_password(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*_: object) -> None:
        raise RuntimeError("cannot be: rtsp://me:hunter2@door/live")

    monkeypatch.setattr(command, "sound_findings", wrong)
    found = [finding async for finding in command.run_checks(load_site(tmp_path), 1.0)]
    text = "a bug in MyView: RuntimeError: cannot be: ..."
    assert findings_of(found, "sound") == [(Level.BAD, text)]
    assert findings_of(found, "memory")


async def test_findings_are_printed_as_they_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = []

    def probe_all(*_: object) -> dict[str, CameraProbe]:
        outputs.append(capsys.readouterr().out)
        return {"c0": CameraProbe("away")}

    monkeypatch.setattr(command, "probe_cameras", probe_all)
    await command._check_and_report(write_site(tmp_path), 1.0, as_json=False)
    (before,) = outputs
    after = capsys.readouterr().out
    assert " http.port " in before
    assert " pulse server " in before
    assert " camera c0 " in after
    assert " http.port " not in after
    assert after.splitlines()[-1].endswith(" bad")


async def test_an_unresolvable_server_is_bad(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ends = {"connect": "tcp/bus:7447", "listen": "tcp/127.0.0.1:7447"}
    site_config = load_site(tmp_path, sync={"host": "pulses", "port": 7400}, zenoh=ends)

    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    found = await reachability_findings(site_config)
    assert findings_of(found, "sync.host") == [
        (Level.BAD, "pulses:7400 cannot be resolved: Name or service not known")
    ]
    assert findings_of(found, "zenoh.connect")[0][0] is Level.BAD


async def test_an_address_of_this_machine_must_lead_to_a_listener(tmp_path: Path) -> None:
    port, other = free_port(), free_port()
    fine = load_site(tmp_path, zenoh={"connect": f"tcp/127.0.0.1:{port}", "listen": f"tcp/0.0.0.0:{port}"})
    assert {finding.level for finding in await reachability_findings(fine)} == {Level.OK}
    astray = load_site(
        tmp_path, zenoh={"connect": f"tcp/127.0.0.1:{other}", "listen": f"tcp/127.0.0.1:{port}"}
    )
    text = f"nothing listens at 127.0.0.1:{other}, where cameras connect; zenoh.listen is 127.0.0.1:{port}"
    assert findings_of(await reachability_findings(astray), "zenoh.connect") == [(Level.BAD, text)]
    with socket.create_server(("127.0.0.1", other)):
        answered = [(Level.OK, f"127.0.0.1:{other} answers")]  # a proxy may forward it
        assert findings_of(await reachability_findings(astray), "zenoh.connect") == answered
    narrow = load_site(tmp_path, sync={"host": "127.0.0.2", "port": other})
    assert findings_of(await reachability_findings(narrow), "sync.host")[0][0] is Level.BAD


async def test_two_services_on_one_port_are_bad(tmp_path: Path) -> None:
    port = free_port()
    found, _ = await port_findings(load_site(tmp_path, http={"port": port}, sync={"port": port}))
    assert findings_of(found, "sync.port") == [
        (Level.BAD, f"127.0.0.1:{port} is also the address of http.port")
    ]
    assert findings_of(found, "zenoh.listen")[0][0] is Level.OK


def test_a_device_shared_by_two_cameras_is_bad(tmp_path: Path) -> None:
    sources = {"c0": "/dev/video9", "c1": "/dev/video9", "c2": "c.mp4", "c3": "c.mp4"}
    site_config = load_site(
        tmp_path, cameras=[{"id": camera, "source": source} for camera, source in sources.items()]
    )
    found = camera_findings(site_config, {}, runs=False)
    text = "/dev/video9 is also used by camera c0, and only one can open it"
    assert [(finding.check, finding.level, finding.text) for finding in found] == [
        ("camera c1", Level.BAD, text)
    ]


def test_an_invalid_configuration_is_reported_with_a_remedy(myview: RunCommand, tmp_path: Path) -> None:
    path = write_site(tmp_path, ground="none.json")
    result = myview("doctor", path)
    assert (result.code, result.err) == (1, "")
    line = result.out.splitlines()[0]
    reason = f"{path}: ground: cannot read {tmp_path / 'none.json'}: No such file or directory"
    assert f"{reason} → fix the configuration" in line


def test_a_missing_token_file_is_reported_once(tmp_path: Path) -> None:
    found = file_findings(load_site(tmp_path, access={"tokens": "none.yaml"}))
    (failed,) = [finding for finding in found if finding.level is Level.BAD]
    assert (failed.check, failed.remedy) == ("access.tokens", "`myview token NAME` prints a line for it")


@needs_openssl
def test_the_routers_certificate_must_be_for_the_host_of_zenoh_connect(tmp_path: Path) -> None:
    made = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"
    for line in (
        f"req -x509 {made} -days 100 -subj /CN=authority -out a.pem -keyout a.key",
        f"req {made} -subj /CN=router -addext subjectAltName=DNS:elsewhere -out r.csr -keyout r.key",
        "x509 -req -in r.csr -CA a.pem -CAkey a.key -days 100 -copy_extensions copy -out r.pem",
    ):
        subprocess.run(["openssl", *line.split()], cwd=tmp_path, check=True, capture_output=True)

    def bad(host: str, **files: str) -> list[str]:
        tls = {"authority": "a.pem", "certificate": "r.pem", "key": "r.key", **files}
        ends = {"connect": f"tls/{host}:7447", "listen": "tls/127.0.0.1:7447"}
        found = file_findings(load_site(tmp_path, zenoh={**ends, "tls": tls}))
        return [
            finding.text for finding in found if finding.check == "zenoh.tls" and finding.level is Level.BAD
        ]

    assert bad("elsewhere") == []
    (other,) = bad("10.0.0.5")
    assert "clients that connect to 10.0.0.5 and" in other
    assert "certificate is not valid for '10.0.0.5'" in other
    assert bad("elsewhere", authority="none.pem") == [
        f"{tmp_path / 'none.pem'}: cannot be read: No such file or directory"
    ]
    assert bad("elsewhere", key="none.key") == [
        f"{tmp_path / 'none.key'}: cannot be read: No such file or directory"
    ]
