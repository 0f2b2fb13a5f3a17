"""Window settings given in frames."""

from __future__ import annotations

from typing import Any

from tracking import WindowSettings


def window_of_frames(
    window: int = 15, stride: int = 5, birth_window: int | None = None, fps: float = 25.0, **settings: Any
) -> WindowSettings:
    """Return the settings whose times are so many frames at `fps` frames per second."""
    return WindowSettings(
        length_s=window / fps,
        stride_s=stride / fps,
        birth_s=(min(window, 15) if birth_window is None else birth_window) / fps,
        min_frames=3,
        **settings,
    )
