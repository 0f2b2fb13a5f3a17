"""Marks that skip tests whose external programs are missing."""

from __future__ import annotations

import shutil

import pytest

from benchmarks.common.browser import chromium_path


def _needs(program: str, what: str | None = None) -> pytest.MarkDecorator:
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"needs {what or program}")


needs_chromium = pytest.mark.skipif(chromium_path() is None, reason="needs Chromium")
needs_ffmpeg = _needs("ffmpeg")
needs_ffprobe = _needs("ffprobe")
needs_mpv = _needs("mpv")
needs_openssl = _needs("openssl", "openssl, to make certificates")
needs_vlc = _needs("cvlc", "cvlc, of VLC")
needs_systemd_analyze = _needs("systemd-analyze", "systemd-analyze, of systemd")
