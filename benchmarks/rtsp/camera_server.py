"""Simulated cameras on GStreamer's RTSP server; runs on the system's Python.

Reads one line of JSON: ``host``; ``certificate`` and ``key`` (PEM files; none: no TLS); ``login``
(``method``, ``name``, ``password``; none: open); ``streams``, by path: ``pipeline`` and, if it changes,
``later``: after so many seconds the element ``size`` gets these caps. Prints its port; ends with its input.
"""

from __future__ import annotations

import json
import os
import re
import sys
import threading
from typing import Any

import gi

for _name in ("Gst", "GstRtsp", "GstRtspServer"):
    gi.require_version(_name, "1.0")
from gi.repository import Gio, GLib, Gst, GstRtsp, GstRtspServer  # noqa: E402

_ROLE = "viewer"


def _access(given: dict[str, Any]) -> GstRtspServer.RTSPAuth | None:
    login = given["login"]
    if login is None and given["certificate"] is None:
        return None
    auth, token = GstRtspServer.RTSPAuth(), GstRtspServer.RTSPToken()
    token.set_string(GstRtspServer.RTSP_TOKEN_MEDIA_FACTORY_ROLE, _ROLE)
    if login is None:
        auth.set_default_token(token)
    elif login["method"] == "digest":
        auth.set_supported_methods(GstRtsp.RTSPAuthMethod.DIGEST)
        auth.add_digest(login["name"], login["password"], token)
    else:
        auth.add_basic(GstRtspServer.RTSPAuth.make_basic(login["name"], login["password"]), token)
    if given["certificate"] is not None:
        auth.set_tls_certificate(Gio.TlsCertificate.new_from_files(given["certificate"], given["key"]))
    return auth


def _change_later(factory: Any, media: Any, after_s: float, caps: str) -> None:
    """Change a stream while it is watched, and for those who connect later."""

    def change() -> bool:
        media.get_element().get_by_name("size").set_property("caps", Gst.Caps.from_string(caps))
        factory.set_launch(re.sub(r"(name=size caps=)\S+", rf"\g<1>{caps}", factory.get_launch()))
        factory.later = None
        return False

    GLib.timeout_add(int(after_s * 1000), change)


def _configure(factory: Any, media: Any) -> None:
    if factory.later is not None:
        _change_later(factory, media, *factory.later)


def main() -> None:
    """Serve until the input ends."""
    Gst.init(None)
    given = json.loads(sys.stdin.readline())
    server = GstRtspServer.RTSPServer()
    server.set_address(given["host"])
    server.set_service("0")
    auth = _access(given)
    if auth is not None:
        server.set_auth(auth)
    for path, stream in given["streams"].items():
        factory = GstRtspServer.RTSPMediaFactory()
        factory.set_launch(f"( {stream['pipeline']} )")
        factory.set_shared(True)
        if auth is not None:
            allowed = "media.factory.access=(boolean)true, media.factory.construct=(boolean)true"
            factory.add_role_from_structure(Gst.Structure.from_string(f"{_ROLE}, {allowed}")[0])
        if "later" in stream:
            factory.later = stream["later"]
            factory.connect("media-configure", _configure)
        server.get_mount_points().add_factory(path, factory)
    server.attach(None)
    print(server.get_bound_port(), flush=True)
    threading.Thread(target=_end_with_input, daemon=True).start()
    GLib.MainLoop().run()


def _end_with_input() -> None:
    sys.stdin.read()
    os._exit(0)


if __name__ == "__main__":
    main()
