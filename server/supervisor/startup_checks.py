"""Checks before any process starts: ports are free, recordings can be opened."""

from __future__ import annotations

import socket

from server.camera.audio import open_audio
from server.camera.pipeline import CameraPipeline
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UserError


def check_port_free(host: str, port: int, what: str) -> None:
    """Make sure that a port can be listened on, before anything is started.

    Raises:
        UserError: it cannot.
    """
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UserError(f"{what}: cannot listen on {host}:{port}: {error.strerror}") from error


def check_ports(config: Config) -> None:
    """Refuse at once when a port is taken, rather than in one of five processes.

    Raises:
        UserError: one is.
    """
    check_port_free(config.http.host, config.http.port, "http.port")
    check_port_free(config.sync.bind, config.sync.port, "sync.port")
    protocol, _, address = config.zenoh.listen.partition("/")
    host, _, port = address.rpartition(":")
    if protocol == "tcp" and port.isdecimal():
        check_port_free(host.strip("[]"), int(port), "zenoh.listen")


def check_recordings(config: Config) -> None:
    """Refuse at once what no camera process could open; live cameras may come and go.

    Raises:
        UserError: a recording, a scene, a file of detections or the sound cannot be opened.
    """
    if config.sounding is not None:
        open_audio(config, config.sounding)
    for camera in config.camera_ids:
        check_recording(config, camera)


def check_recording(config: Config, camera: str) -> None:
    """Refuse a recorded view that its process could not open.

    Raises:
        UserError: it cannot be opened, or its file of detections.
    """
    if source_kind(config.camera(camera).source) is not SourceKind.STREAM:
        CameraPipeline(config, camera, ready=False).close()
