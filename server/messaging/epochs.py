"""The epochs of a site: the tracking windows of all cameras end at the same pulses.

Epoch *k* is what a camera knows after its window that ends with pulse ``(k + 1) · stride - 1``. A recording
that ends in between closes with one more epoch of its own.
"""

from __future__ import annotations


def epoch_of_window(last: int, stride: int) -> int:
    """Return the epoch of a window that ends with pulse ``last``, a regular end."""
    return last // stride


def closing_epoch(last: int, stride: int) -> int:
    """Return the epoch in which a recording with the last pulse ``last`` says that it has ended.

    Where ``last`` is a regular end its own epoch is taken, so that the closing one is the next.
    """
    return (last + 1) // stride


def end_of_epoch(epoch: int, stride: int) -> int:
    """Return the last pulse of an epoch."""
    return (epoch + 1) * stride - 1
