"""The section `sites` is refused in one line where sites could not be told apart."""

from __future__ import annotations

from typing import Any

import pytest

from fakes.service.scripted_cameras import small_config
from server.system.errors import UserError

YARD = {"connect": "tcp/yard:7447", "url": "http://yard:8080"}


@pytest.mark.parametrize(
    ("sections", "reason"),
    [
        ({"sites": {"index": 1}}, "index is 1, but of 1 sites the last is 0"),
        ({"sites": {"link": {"yard": YARD}}}, "but with those of link there are 2 sites"),
        ({"sites": {"of": 2, "link": {"hall": YARD}}}, "sites.link: 'hall' is this site; name the others"),
        ({"sites": {"of": 4}, "view": {"share": {"of": 2}}}, "have a common divisor"),
        ({"sites": {"of": 2, "link": {"yard": {**YARD, "url": "yard"}}}}, "sites.link.yard.url"),
        ({"sites": {"of": 2, "link": {"yard": {**YARD, "connect": "yard"}}}}, "sites.link.yard.connect"),
        ({"sites": {"of": 2, "link": {"my yard": YARD}}}, "sites.link"),
    ],
)
def test_sites_that_do_not_fit_are_refused_in_one_line(sections: dict[str, Any], reason: str) -> None:
    with pytest.raises(UserError, match="sites") as refusal:
        small_config(**sections)
    assert reason in str(refusal.value).replace("index: is", "index is")
    assert "\n" not in str(refusal.value)


def test_a_link_has_a_base_url_and_a_session() -> None:
    link = small_config(sites={"of": 2, "link": {"yard": YARD}}).sites.link["yard"]
    assert link.base_url == "http://yard:8080/"
    assert link.bus(2.0).routers == ("tcp/yard:7447",)
