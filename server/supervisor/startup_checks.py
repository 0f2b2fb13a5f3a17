"""Startup checks: ports are free and recordings can be opened, before any process starts."""

from __future__ import annotations

import socket

from server.camera.audio import open_site_audio
from server.camera.pipeline import CameraPipeline
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UserError, reason_of


def check_port_free(host: str, port: int, label: str) -> None:
    """Check that a port can be listened on.

    Raises:
        UserError: it cannot.
    """
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UserError(f"{label}: cannot listen on {host}:{port}: {reason_of(error)}") from error


def check_ports(config: Config) -> None:
    """Check that all ports of a site are free.

    Raises:
        UserError: a port is in use.
    """
    check_port_free(config.http.host, config.http.port, "http.port")
    check_port_free(config.sync.bind, config.sync.port, "sync.port")
    if config.rtsp.enabled:
        check_port_free(config.rtsp.host, config.rtsp.port, "rtsp.port")
    protocol, _, address = config.zenoh.listen.partition("/")
    host, _, port = address.rpartition(":")
    if protocol == "tcp" and port.isdecimal():
        check_port_free(host.strip("[]"), int(port), "zenoh.listen")


def check_sources_open(config: Config) -> None:
    """Check that recordings, scenes, detections and the sound can be opened; live cameras are not checked.

    Raises:
        UserError: a recording, a scene, a file of detections or the sound cannot be opened.
    """
    if config.audio_sender is not None:
        open_site_audio(config, config.audio_sender)
    for camera in config.camera_ids:
        check_source_opens(config, camera)


def check_source_opens(config: Config, camera: str) -> None:
    """Check that a camera's recording or scene, and its detections, can be opened.

    Raises:
        UserError: one of them cannot be opened.
    """
    if source_kind(config.camera(camera).source) is not SourceKind.STREAM:
        CameraPipeline(config, camera, warm_up=False).close()
