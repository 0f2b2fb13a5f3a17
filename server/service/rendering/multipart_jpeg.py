"""Multipart JPEG: one answer whose picture is replaced again and again (``multipart/x-mixed-replace``)."""

from __future__ import annotations

from server.media.rendering_messages import Jpeg

CONTENT_TYPE = "multipart/x-mixed-replace; boundary=picture"
BEGIN = b"--picture\r\n"
"""What the answer begins with."""
PULSE = "X-MyView-Pulse"


def part(picture: Jpeg) -> bytes:
    """Give one picture with the boundary that ends it: browsers show it only when they have seen that."""
    head = ["Content-Type: image/jpeg", f"Content-Length: {len(picture.data)}", f"{PULSE}: {picture.pulse}"]
    return "\r\n".join([*head, "", ""]).encode("ascii") + picture.data + b"\r\n" + BEGIN
