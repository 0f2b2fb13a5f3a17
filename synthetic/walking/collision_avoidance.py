"""Giving way: ways of several people, planned together, are bent where they come too near each other."""

from __future__ import annotations

import cv2
import numpy as np

from synthetic.cameras.pinhole import Floats

_ROUNDS = 60
_SMOOTH = 0.45  # seconds over which one bends one's way
_SIDE = np.radians(50.0)  # both turn to the same hand: so they pass, and do not push each other back
_FIRM = 0.7  # of what is missing is made up for in each round
_EASE = 0.6  # seconds at either end that stay as they are


def give_way(ways: Floats, keep: Floats, rate: float) -> Floats:
    """Bend ways ``(P, T, 2 or 3)``, sampled `rate` times a second, until pairs keep ``(P, P)`` metres apart.

    Ends stay where they are. Where there is no room for all, people come nearer than they should.
    """
    people, count, axes = ways.shape
    if people < 2:  # noqa: PLR2004 — nobody to give way to
        return ways
    clock = np.arange(count)
    ease = np.clip(np.minimum(clock, count - 1 - clock) / (_EASE * rate), 0, 1)[None, :, None]
    turn = np.eye(axes)
    turn[:2, :2] = [[np.cos(_SIDE), np.sin(_SIDE)], [-np.sin(_SIDE), np.cos(_SIDE)]]
    kernel = 2 * int(3 * _SMOOTH * rate) + 1
    bent = ways.copy()
    for _ in range(_ROUNDS):
        gaps = bent[:, None] - bent[None]
        far = np.linalg.norm(gaps, axis=3)
        short = np.maximum(keep[..., None] - far, 0)
        short[np.arange(people), np.arange(people)] = 0
        if not short.any():
            break
        away = gaps / np.maximum(far, 1e-6)[..., None]
        push = (away @ turn * (short / 2)[..., None]).sum(axis=1)
        flat = np.ascontiguousarray(push.transpose(0, 2, 1).reshape(axes * people, count))
        soft = cv2.GaussianBlur(flat, (kernel, 1), _SMOOTH * rate, borderType=cv2.BORDER_REPLICATE)
        # A short push is flattened by the smoothing: it is brought back to its height.
        peak = np.abs(flat).max(axis=1, keepdims=True) / np.maximum(
            np.abs(soft).max(axis=1, keepdims=True), 1e-9
        )
        bent += _FIRM * ease * (soft * peak).reshape(people, axes, count).transpose(0, 2, 1)
    return bent
