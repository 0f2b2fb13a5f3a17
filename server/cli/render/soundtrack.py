"""Soundtrack of films: the site's recorded sound, read as films are written."""

from __future__ import annotations

from server.camera.audio import RecordedAudioSource, consecutive_runs, open_site_audio
from server.config.site_config import Config
from server.messaging.messages import AudioHeader
from server.service.streaming.audio_buffer import AudioBuffer

_KEPT_S = 20.0
_AHEAD_S = 1.0
"""Seconds read ahead, more than the delay of an encoder."""


class Soundtrack:
    """Reads the sound into ``audio_buffer``, which is None without recorded sound.

    Raises:
        UserError: it cannot be opened.
    """

    def __init__(self, config: Config) -> None:
        camera, form = config.audio_sender, config.sound.format
        opened = None if camera is None else open_site_audio(config, camera)
        self._sound = opened if isinstance(opened, RecordedAudioSource) else None
        self._fps = config.site.fps
        self._begun = False
        self.audio_buffer = None
        if form is not None and self._sound is not None:
            self.audio_buffer = AudioBuffer(form, self._fps, _KEPT_S)

    def read(self, first: int, until: int) -> None:
        """Read the sound of pulses ``first`` to ``until - 1`` into the buffer; pulses must increase."""
        if self._sound is None or self.audio_buffer is None:
            return
        frames = [] if self._begun else self._sound.until(first)
        self._begun = True
        frames += self._sound.until(until + round(_AHEAD_S * self._fps))
        for run in consecutive_runs(frames):
            head = AudioHeader(first=run[0].number, sizes=[len(frame.data) for frame in run])
            self.audio_buffer.put(head, b"".join(frame.data for frame in run))
