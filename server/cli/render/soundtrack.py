"""The site's sound for films: of a recording, read as far as films are written."""

from __future__ import annotations

from server.camera.audio import RecordedAudioSource, consecutive_runs, open_audio
from server.config.site_config import Config
from server.messaging.messages import AudioHeader
from server.service.streaming.audio_buffer import AudioBuffer

_KEPT_S = 20.0
_AHEAD_S = 1.0
"""Seconds read ahead; an encoder holds back less."""


class Soundtrack:
    """Fills a shelf. ``shelf`` is None where there is no sound, or none that is recorded.

    Raises:
        UserError: it cannot be opened.
    """

    def __init__(self, config: Config) -> None:
        camera, form = config.audio_camera, config.sound.format
        opened = None if camera is None else open_audio(config, camera)
        self._sound = opened if isinstance(opened, RecordedAudioSource) else None
        self._fps = config.site.fps
        self._begun = False
        self.frame_buffer = None
        if form is not None and self._sound is not None:
            self.frame_buffer = AudioBuffer(form, self._fps, _KEPT_S)

    def read(self, first: int, until: int) -> None:
        """Put what sounds at the pulses ``first … until - 1`` on the shelf; pulses must grow."""
        if self._sound is None or self.frame_buffer is None:
            return
        frames = [] if self._begun else self._sound.until(first)
        self._begun = True
        frames += self._sound.until(until + round(_AHEAD_S * self._fps))
        for run in consecutive_runs(frames):
            head = AudioHeader(first=run[0].number, sizes=[len(frame.data) for frame in run])
            self.frame_buffer.put(head, b"".join(frame.data for frame in run))
