"""Result of a background model: foreground and shadow masks."""

from __future__ import annotations

from dataclasses import dataclass

from tracking.detectors.base import Mask


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """Pixels by kind, each `(H, W)`, 0 or 255; what is in neither is background.

    Attributes:
        foreground: what surely is not background.
        shadow: what looks like a shadow, and may be somebody dressed like one.
    """

    foreground: Mask
    shadow: Mask
