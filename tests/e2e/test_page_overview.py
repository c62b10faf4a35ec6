# SPDX-License-Identifier: Apache-2.0
"""The overview: trouble is above everything, rows stay where they are, and every column is there on a tablet."""

import re

import pytest
from bridgelib import eventually
from browserlib import DESKTOP, PHONE, expect, findings
from test_browser import chromium, make_site, visit  # noqa: F401 (fixtures)

TABLET = {"width": 768, "height": 1024}


@pytest.fixture
def plant(make_site):  # noqa: F811
    return make_site(drives=12, bus={"drive-latency-ms": 100})


def box(page, selector):
    return page.locator(selector).bounding_box()


def test_trouble_is_in_sight_and_rows_stay(plant, visit):  # noqa: F811
    visitor = visit(plant)
    page = visitor.page
    rows = page.locator("#drives tbody tr")
    expect(rows).to_have_count(12)
    expect(page.locator("#summary")).to_have_text("all is well")
    # The pointer rests on the table, as after a login.
    page.locator('tr[data-drive="drive3"]').hover()
    plant.bridge.sim.fault("silence on", "drive12")
    strip = page.locator('#troubles [data-of="drive drive12"]')
    expect(strip).to_be_visible()
    expect(strip).to_contain_text("no answer")
    expect(strip).to_contain_text(re.compile(r"since \d\d:\d\d:\d\d, for \d+ s"))
    expect(strip.locator(".troubles-advice")).not_to_be_empty()
    top = strip.bounding_box()
    assert 0 <= top["y"] and top["y"] + top["height"] < DESKTOP["height"]
    names = rows.evaluate_all("rows => rows.map((row) => row.dataset.drive)")
    assert names == [f"drive{number}" for number in range(1, 13)]
    # What needs somebody, and nothing else, on request; the link leads there.
    page.locator("#summary").click()
    expect(page.locator("#drives tbody tr:visible")).to_have_count(1)
    page.locator("#filter-state").select_option("standing")
    expect(page.locator("#drives tbody tr:visible")).to_have_count(11)
    page.locator("#filter").fill("drive1")
    expect(page.locator("#drives tbody tr:visible")).to_have_count(3)
    assert findings(page) == []
    strip.get_by_role("link").click()
    expect(page.locator("#drive-state")).to_have_text("Offline")
    page.go_back()
    plant.bridge.sim.fault("silence off", "drive12")
    expect(page.locator("#troubles")).to_be_hidden()


def test_nothing_moves_under_a_pointer_on_its_way(plant, visit):  # noqa: F811
    """The strip waits for the pointer to rest; then it comes."""
    visitor = visit(plant)
    page = visitor.page
    stop = page.locator('[data-stop="drive2"]')
    expect(stop).to_be_visible()
    expect(page.locator("#summary")).to_have_text("all is well")
    # Rows are made anew when the service describes its drives.
    before = eventually(stop.bounding_box, what="the row")
    # A pointer that goes on moving over the table.
    page.evaluate("""() => { window.moves = setInterval(() => document.querySelector("#drives")
        .dispatchEvent(new PointerEvent("pointermove")), 50); }""")
    plant.bridge.sim.fault("silence on", "drive12")
    expect(page.locator("#summary")).to_have_text("1 drive needs you")
    assert stop.bounding_box() == before
    expect(page.locator("#troubles")).to_be_hidden()
    page.evaluate("clearInterval(window.moves)")
    expect(page.locator("#troubles")).to_be_visible()


def test_an_upright_tablet_has_every_column(plant, visit):  # noqa: F811
    visitor = visit(plant, viewport=TABLET)
    page = visitor.page
    expect(page.locator('tr[data-drive="drive1"]')).to_contain_text("Standstill")
    plant.bridge.sim.fault("silence on", "drive2")
    needs = page.locator('tr[data-drive="drive2"] .needs')
    expect(needs).to_contain_text("no answer")
    for cell in page.locator('tr[data-drive="drive2"] > *').all():
        where = cell.bounding_box()
        assert where["x"] >= 0 and where["x"] + where["width"] <= TABLET["width"], cell.inner_text()
    assert page.evaluate("document.documentElement.scrollWidth") <= TABLET["width"]
    page.locator("#dense").click()
    assert box(page, 'tr[data-drive="drive1"]')["height"] < 60
    assert findings(page) == []


def test_a_phone_begins_with_drives(plant, visit):  # noqa: F811
    page = visit(plant, viewport=PHONE).page
    expect(page.locator('tr[data-drive="drive1"]')).to_contain_text("stands")
    assert box(page, "#drives")["y"] < PHONE["height"] / 2
    assert box(page, "#buses")["y"] > box(page, "#drives")["y"]
