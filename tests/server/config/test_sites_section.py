"""The section `sites` is refused in one line where sites could not be told apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fakes.service.scripted_cameras import small_config
from server.config.loader import build_config
from server.service.bus_connection import BusConnection
from server.system.errors import UserError

YARD = {"connect": "tcp/yard:7447", "url": "http://yard:8080"}


@pytest.mark.parametrize(
    ("sections", "reason"),
    [
        ({"sites": {"index": 1}}, "index is 1, but of 1 sites the last is 0"),
        ({"sites": {"link": {"yard": YARD}}}, "but with those of link there are 2 sites"),
        ({"sites": {"of": 2, "link": {"hall": YARD}}}, "sites.link: 'hall' is this site; name the others"),
        ({"sites": {"of": 4}, "view": {"sharding": {"of": 2}}}, "have a common divisor"),
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


def test_files_of_links_are_beside_the_configuration(tmp_path: Path) -> None:
    link = {**YARD, "users": "hall.users", "authority": "yard.pem"}
    content = {"cameras": [{"id": "c0", "source": "scene:room"}], "sites": {"of": 2, "link": {"yard": link}}}
    resolved = build_config(content, where="hall", folder=tmp_path).sites.link["yard"]
    assert (resolved.users, resolved.authority) == (tmp_path / "hall.users", tmp_path / "yard.pem")


@pytest.mark.parametrize(
    ("line", "reason"), [(None, "cannot read"), ("site-shop:x\n", "has no line for 'site-hall'")]
)
def test_a_password_that_is_missing_is_named_in_one_line(
    tmp_path: Path, line: str | None, reason: str
) -> None:
    users = tmp_path / "hall.users"
    if line is not None:
        users.write_text(line, encoding="utf-8")
    config = small_config(sites={"of": 2, "link": {"yard": {**YARD, "users": str(users)}}})
    with pytest.raises(UserError, match=r"^sites\.link\.yard\.users: ") as refusal:
        BusConnection(config).link_site("yard", config.sites.link["yard"], lambda _: None)
    assert reason in str(refusal.value)


def test_a_link_has_a_base_url_and_a_session() -> None:
    link = small_config(sites={"of": 2, "link": {"yard": YARD}}).sites.link["yard"]
    assert link.base_url == "http://yard:8080/"
    assert link.bus(2.0).routers == ("tcp/yard:7447",)
