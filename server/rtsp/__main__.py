"""Runs the gateway: settings as one JSON object on standard input, log lines of JSON on standard output.

It ends with its standard input, so that it never outlives the process that has started it.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import threading

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GLib, Gst  # noqa: E402

from server.rtsp import PORT_IN_USE  # noqa: E402
from server.rtsp.rtsp_server import Gateway, GatewaySettings  # noqa: E402
from server.rtsp.service_stream import Service  # noqa: E402


class _JsonLines(logging.Formatter):
    """A record as a JSON array: level, text."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return json.dumps([record.levelno, super().format(record)])


def main() -> int:
    """Serve until standard input ends; return the exit code."""
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(_JsonLines())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    Gst.init(None)
    given = json.loads(sys.stdin.readline())
    service = Service(given.pop("service"), given.pop("service_certificate"))
    gateway = Gateway(GatewaySettings(service=service, **given))
    if not gateway.listen():
        return PORT_IN_USE
    scheme = "rtsp" if gateway.settings.certificate is None else "rtsps"
    logging.getLogger(__name__).info(
        "streams on %s://%s:%d/objects/1, /cameras/ID", scheme, gateway.settings.host, gateway.port
    )
    loop = GLib.MainLoop()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who has started it ends it
    threading.Thread(target=_end_with_input, daemon=True).start()
    loop.run()
    return 0


def _end_with_input() -> None:
    while sys.stdin.readline():
        pass
    sys.stdout.flush()
    os._exit(0)  # media in the midst of a change of state would block


if __name__ == "__main__":
    sys.exit(main())
