"""Addresses with embedded passwords, mistyped ones included, and a check whether a text leaks one."""

from __future__ import annotations

from hypothesis import strategies as st

HOST = "192.0.2.11"
PASSWORDS = st.text("QXZJKVWqxzjkvw /@#?&=:;%+|\\'\"<>{}[]$!~^()*,", min_size=4, max_size=24)
"""Characters that occur in no message of MyView, and all delimiters of addresses."""
ADDRESSES = (
    "rtsp://user:{}@192.0.2.11/x",
    "rtsp://user:{}@192.0.2.11:554",
    "rtsp://{}@192.0.2.11/x",
    "RTSP://user:{}@192.0.2.11/",
    "rtsp://192.0.2.11/{}",
    "rtsp://192.0.2.11/user=me_password={}_channel=1.sdp?real_stream",
    "http://192.0.2.11/video?p={}",
    "http://192.0.2.11/video?credentials=user:{}&size=1",
    "http://192.0.2.11?sig={}",
    "http://192.0.2.11/#{}",
    "srt://192.0.2.11:9000?passphrase={}&mode=caller",
    "rtmps://192.0.2.11/live/{}",
    "crypto+http://user:{}@192.0.2.11/x",
    "async:rtsp://user:{}@192.0.2.11/x",
    "concat:rtsp://user:{}@192.0.2.11/x|b.mp4",
    "tee:rtsp://user:{}@192.0.2.11/x",
    "subfile,,start,0,end,9,,:http://192.0.2.11/?p={}",
    "rtsp:user:{}@192.0.2.11/x",
    "rtsp:/user:{}@192.0.2.11/x",
    "rtps://user:{}@192.0.2.11/x",
    "rtsp//user:{}@192.0.2.11/x",
    "user:{}@192.0.2.11/x",
    " rtsp://user:{}@192.0.2.11/x",
    "source rtsp://user:{}@192.0.2.11/x",
    "/etc/myview/rtsp:/user:{}@192.0.2.11/x",
    "/etc/myview/rtps:/user:{}@192.0.2.11/x",
)
"""Addresses with a place for a password, mistyped ones included."""
_PIECE = 4


def leaks(text: str, password: str, without: str) -> bool:
    """Return whether a text contains four characters of a password that are not in the text without it."""
    pieces = {password[at : at + _PIECE] for at in range(len(password) - _PIECE + 1)}
    return any(piece in text and piece not in without for piece in pieces)
