"""What is wrong with a camera's picture is logged when it changes."""

from __future__ import annotations

import pytest

from server.camera.picture_reports import ConditionLog


def test_each_change_of_the_picture_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    conditions, since = ConditionLog("c1"), []
    for number, (condition, share) in enumerate(
        [
            ("clear", 0.0),
            ("clear", 0.3),
            ("clear", 0.4),
            ("covered", 0.6),
            ("covered", 1.0),
            ("clear", 0.2),
            ("clear", 0.0),
        ]
    ):
        conditions.update(condition, share, began=float(number))  # type: ignore[arg-type]
        since.append(conditions.since)
    assert since == [0.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0]
    assert [(record.levelname, record.getMessage().partition(": ")[0]) for record in caplog.records] == [
        ("WARNING", "camera c1"),
        ("WARNING", "camera c1"),
        ("WARNING", "camera c1"),
        ("INFO", "camera c1"),
    ]
    assert [record.getMessage().split(": ")[1] for record in caplog.records] == [
        "30 % of the picture is covered",
        "the lens is covered",
        "20 % of the picture is covered",
        "the picture is clear",
    ]
