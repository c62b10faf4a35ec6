# SPDX-License-Identifier: Apache-2.0
"""How the drives were, on the page: a loose plug is seen at once, gaps are gaps, alarms are seen to by who may, and
nobody sees drives that are not his."""

import time

from bridgelib import eventually
from browserlib import PHONE, expect, findings
from healthlib import write_week
from test_audit import find, state  # noqa: F401 (a fixture)
from test_browser import chromium, make_site, visit  # noqa: F401 (fixtures)
from test_web import refused
from weblib import OPERATOR, READER, Page

ERNA = ("erna", "sets drive two up")
NAMES = [f"drive{number}" for number in range(1, 6)]
# Of a row of the picture at a place from 0 to 1: its colour, or "none" where nothing is known.
COLOUR = """(canvas, at) => {
    const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, -Math.floor(at * (canvas.width - 1)), 0);
    const [r, g, b, a] = copy.getImageData(0, 0, 1, 1).data;
    return a === 0 ? "none" : `${r},${g},${b}`;
}"""


def week(drive, hours):
    if drive is None:
        return not 80 < hours < 100
    if drive == "drive4" and hours > 48:
        return None
    lost = 0.04 if drive == "drive3" and 30 < hours < 34 else 0.0005 if drive == "drive1" and hours < 24 else 0
    return {"lost": lost, "offline": 1.0 if drive == "drive5" and 48.5 < hours < 51.5 else 0.0}


def colour(page, drive, hours_ago):
    canvas = page.locator(f'#heat tr[data-drive="{drive}"] canvas')
    return canvas.evaluate(COLOUR, 1 - hours_ago / 168)


def test_a_loose_plug_is_seen_and_alarms_are_seen_to(state, make_site, visit):  # noqa: F811
    write_week(state / "health", NAMES, week)
    site = make_site(drives=5)
    site.add_user(*ERNA, "engineer", "drive2")
    visitor = visit(site)
    page = visitor.page
    view = visitor.go("health")
    view.locator("#health-range").select_option("week")
    rows = view.locator("#heat tbody tr")
    expect(rows).to_have_count(5)
    # The worst is on top, and says what it was.
    expect(rows.nth(0)).to_contain_text("drive5")
    expect(rows.nth(0)).to_contain_text("100 % lost, offline for 3 h")
    expect(rows.nth(1)).to_contain_text("drive3")
    expect(rows.nth(1)).to_contain_text("4 % lost")
    expect(rows.last).to_contain_text("nothing lost")
    eventually(lambda: colour(page, "drive3", 32) != "none", what="the picture")
    well, plug, little = colour(page, "drive2", 10), colour(page, "drive3", 32), colour(page, "drive1", 10)
    assert len({well, plug, little, colour(page, "drive5", 50)}) == 4 and "none" not in (well, plug, little)
    assert colour(page, "drive3", 28) == well
    # The service did not run, or the drive was not there.
    assert colour(page, "drive3", 90) == colour(page, "drive4", 60) == "none"
    assert findings(page) == []
    # Its curves, over the day and the week.
    rows.nth(1).get_by_role("link").click()
    curves = page.locator('.view[data-view="health"] #health-curves')
    expect(curves.locator("figure")).to_have_count(4)
    expect(curves.locator("figure canvas")).to_have_count(3)
    expect(curves.locator('[data-curve="temperature"]')).to_contain_text("reports no temperature")
    assert findings(page) == []
    page.locator("#health-range").select_option("hour")
    expect(page.locator("h1")).to_have_text("Health of drive3")

    # An alarm: the strip of troubles leads to it.
    site.bridge.sim.fault("silence on", "drive3")
    visitor.go("")
    page.locator("#troubles").get_by_role("link", name="All alarms").click()
    alarm = page.locator('#alarms tr[data-present="true"]')
    expect(alarm).to_contain_text("drive3")
    expect(alarm).to_contain_text("still there")
    expect(alarm).to_contain_text("nobody yet")
    # Who may not, is told why; whose drive it is not, does not see it, and cannot say that it is his.
    reader = visit(site, user=READER)
    reader.go("health")
    expect(reader.page.locator("#alarms button")).to_be_disabled()
    erna = Page(site, ERNA)
    number = int(alarm.get_attribute("data-alarm"))
    assert erna.ask("POST", "/api/alarms", {"after": 0})["alarms"] == []
    for drive, status in (("drive3", 403), ("drive2", 404), ("", 403), (None, 403)):
        parameters = {"id": number, **({} if drive is None else {"drive": drive})}
        refused(status, erna.ask, "POST", "/api/call/AcknowledgeAlarm", parameters)
    assert find(site.bridge, kind="alarm") == []
    mine = erna.ask("POST", "/api/health/rows", {"for_s": 604800, "step_s": 3600})
    assert [row["drive"] for row in mine["rows"]] == ["drive2"] and len(mine["times"]) > 140
    refused(403, erna.ask, "POST", "/api/health", {"for_s": 3600, "step_s": 60, "drive": "drive3"})
    assert erna.ask("POST", "/api/health", {"for_s": 3600, "step_s": 60, "drive": "drive2"})["values"]
    refused(400, erna.ask, "POST", "/api/health/rows", {"for_s": 604801, "step_s": 3600})
    refused(400, erna.ask, "POST", "/api/health/rows", {"for_s": 60, "step_s": 61})
    refused(401, Page(site).ask, "POST", "/api/alarms", {"after": 0})
    erna.close()

    before = time.time()
    alarm.get_by_role("button").click()
    expect(alarm).to_contain_text(OPERATOR[0])
    (record,) = eventually(lambda: find(site.bridge, kind="alarm"), what="the record of it")
    assert record["drive"] == "drive3" and record["user"] == OPERATOR[0] and record["time_us"] / 1e6 > before - 1
    # Seen and gone, it is open no more, also for the other one.
    site.bridge.sim.fault("silence off", "drive3")
    expect(page.locator("#alarms")).to_contain_text("No alarm is open.")
    expect(reader.page.locator("#alarms")).to_contain_text("No alarm is open.")
    page.locator("#alarms-filter").select_option("all")
    gone = page.locator('#alarms tr[data-present="false"]').first
    expect(gone).to_contain_text(OPERATOR[0])
    expect(gone).not_to_contain_text("still there")
    reader.page.set_viewport_size(PHONE)
    assert reader.page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
