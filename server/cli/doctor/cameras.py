"""Checks of the cameras and the sound: probes all cameras in parallel and reports on each."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping

from server.camera.audio import open_site_audio
from server.cli.doctor.camera_probe import CameraProbe, probe_camera
from server.cli.doctor.findings import Finding, bad, describe_bug, ok, warning
from server.cli.doctor.substream import substream_findings
from server.config.site_config import Config
from server.config.source_address import SourceKind, is_device_path, source_kind
from server.system.address_redaction import located_reason_of, redact_to_host
from server.system.errors import UserError

_GRACE_S = 3.0
"""Seconds that a busy machine may take beyond a camera's time limit."""
_SAME_SPEED = 0.01
"""Relative difference between a recording's rate and the site's that is not reported: 29.97 for 30."""
_SAME_RATE = 0.1
"""Relative difference between a camera's rate and the site's that is not reported."""


def probe_cameras(config: Config, seconds: float) -> dict[str, CameraProbe]:
    """Probe all cameras in parallel; report those that do not answer in time."""
    probes: dict[str, CameraProbe] = {}

    def run(camera: str) -> None:
        try:
            probes[camera] = probe_camera(config, camera, seconds)
        except OSError as error:
            probes[camera] = CameraProbe(located_reason_of(error))
        except Exception as error:  # noqa: BLE001 — the other cameras are still reported
            probes[camera] = CameraProbe(describe_bug(error))

    # Daemons: a thread that hangs in a driver must not keep the doctor from ending.
    threads = [threading.Thread(target=run, args=(camera,), daemon=True) for camera in config.camera_ids]
    for thread in threads:
        thread.start()
    until = time.monotonic() + 2 * seconds + _GRACE_S
    for thread in threads:
        thread.join(max(0.0, until - time.monotonic()))
    late = CameraProbe(f"no answer within {2 * seconds + _GRACE_S:.0f} s{_while_busy()}")
    return {camera: probes.get(camera, late) for camera in config.camera_ids}


def _while_busy() -> str:
    """Return a remark if the machine is overloaded, which may be the cause; otherwise an empty text."""
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    return f", while the machine is overloaded (load {load:.0f})" if load > 2 * cores else ""


def sound_findings(config: Config) -> list[Finding]:
    """Check that the site's sound can be opened, if it has one."""
    if config.audio_sender is None:
        return []
    try:
        open_site_audio(config, config.audio_sender)
    except UserError as error:
        return [
            bad("sound", str(error).removeprefix("sound: "), "use another file, or a camera that has sound")
        ]
    return [
        ok(
            "sound",
            f"{redact_to_host(str(config.sound.source))}: {config.sound.codec}, {config.sound.kbps} kbit/s",
        )
    ]


def camera_findings(config: Config, probes: Mapping[str, CameraProbe], *, runs: bool) -> list[Finding]:
    """Report on each camera; ``runs``: the site is running and may hold a device exclusively."""
    findings = [
        finding
        for camera, probe in probes.items()
        for finding in _findings_of(config, camera, probe, runs=runs)
    ]
    return findings + _shared_devices(config)


def _shared_devices(config: Config) -> list[Finding]:
    """Report devices that two cameras share."""
    findings, owners = [], dict[str, str]()
    for camera in config.cameras:
        if is_device_path(camera.source):
            # A device has several names, in /dev/v4l for example.
            first = owners.setdefault(os.path.realpath(camera.source), camera.id)
            if first != camera.id:
                text = f"{camera.source} is also used by camera {first}, and only one can open it"
                findings.append(bad(f"camera {camera.id}", text, "give each camera its own device"))
    return findings


def _findings_of(config: Config, camera: str, probe: CameraProbe, *, runs: bool) -> list[Finding]:
    check = f"camera {camera}"
    if probe.problem or probe.size is None:
        if runs:
            remedy = "the site is running and may hold the device: see /api/cameras"
            return [warning(check, probe.problem, remedy)]
        return [bad(check, probe.problem, _remedy(config.camera(camera).source))]
    parts = [f"{_size(probe.size)} pixels"]
    rate = probe.recorded_fps if probe.sent is None else probe.sent.fps
    if rate is not None:
        parts.append(f"{rate:.1f} pictures a second")
    encoding = "its own video passes" if probe.passes else f"{probe.kbps:.0f} kbit/s"
    parts += [encoding, f"{probe.cores:.2f} of a core"]
    small = [] if probe.substream is None else substream_findings(check, probe.substream)
    return [ok(check, ", ".join(parts)), *small, *_quality_findings(config, check, probe)]


def _remedy(source: str) -> str:
    if is_device_path(source):
        return "plug it in, add this user to the group video, end other programs that use it"
    if source_kind(source) is SourceKind.STREAM:
        return "try its source in ffplay; check address, password and cable"
    return "fix its source in the configuration, or make the file readable for this user"


def _quality_findings(config: Config, check: str, probe: CameraProbe) -> list[Finding]:
    site, findings = config.site, []
    width, height = probe.size or (site.width, site.height)
    if width < site.width and height < site.height:
        findings.append(
            warning(
                check,
                f"its pictures ({_size((width, height))}) are smaller than the site's "
                f"({_size((site.width, site.height))}), and are upscaled",
                "lower site.width and site.height, or set the camera to a larger size",
            )
        )
    rate = probe.sent.fps if probe.sent is not None else None
    if rate is not None and rate < (1 - _SAME_RATE) * site.fps:
        findings.append(
            warning(
                check,
                f"it sends {rate:.1f} pictures a second, the site takes {site.fps:g}: some are shown twice",
                "set the camera to that rate, or lower site.fps",
            )
        )
    recorded = probe.recorded_fps
    if recorded is not None and abs(recorded / site.fps - 1) > _SAME_SPEED:
        effect = "left out" if recorded > site.fps else "shown twice"
        findings.append(
            warning(
                check,
                f"was recorded at {recorded:g} pictures a second, the site takes {site.fps:g}: "
                f"some are {effect}",
                "set site.fps to that of most of the recordings",
            )
        )
    if probe.sent is not None and probe.sent.damaged_packets:
        findings.append(
            warning(
                check,
                f"{probe.sent.damaged_packets} packets could not be decoded, "
                f"{probe.sent.pictures} pictures could",
                "options: {rtsp_transport: tcp}, or a better network",
            )
        )
    if probe.why_encoded:
        findings.append(
            warning(
                check,
                f"is re-encoded: {probe.why_encoded}",
                "change the camera's settings, or set passthrough: off",
            )
        )
    return findings


def _size(size: tuple[int, int]) -> str:
    return "x".join(map(str, size))
