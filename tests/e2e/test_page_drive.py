# SPDX-License-Identifier: Apache-2.0
"""A drive on the page: what comes next, what cannot be done now, and who changed what."""

import re

from browserlib import expect, findings
from test_audit import state  # noqa: F401 (a fixture)
from test_browser import chromium, make_site, site, visit, wait_moving  # noqa: F401 (fixtures)
from weblib import OPERATOR

# Without max-velocity, within limits of its position; it does not power its motor by itself.
PLAIN = {"drive": {"counts-per-unit": 320.0, "unit-name": "mm", "min-position": -100.0, "max-position": 100.0,
                   "watchdog-ms": 30000},
         "sim_drive": {"set": ["spd=3200", "acc=640000", "dec=640000", "pae=0"]}}


def test_the_next_step_is_one_button(make_site, visit):  # noqa: F811
    site = make_site(**PLAIN)  # noqa: F811
    view = visit(site).go("drive/drive1")
    following = view.locator("#drive-next")
    expect(view.locator("#drive-state")).to_have_text("Disabled")
    expect(view.locator(".drive-head .state-word")).to_have_text("switched off")
    expect(following).to_have_text("Enable")
    expect(view.locator("#jog-state")).to_have_text("Enable the drive first")
    # What would be refused is not offered, and says why.
    expect(view.locator('[data-command="home"]')).to_be_disabled()
    expect(view.locator("#commands-not-now")).to_contain_text("enable the drive first")
    expect(view.locator('[data-command="disable"]')).to_be_enabled()
    view.locator("#jog-enable").click()
    expect(view.locator("#drive-state")).to_have_text("Standstill")
    expect(following).to_be_hidden()
    expect(view.locator("#jog-enable")).to_be_hidden()
    expect(view.locator('[data-command="home"]')).to_be_enabled()
    expect(view.locator('[data-command="enable"]')).to_be_disabled()


def test_a_drive_without_a_highest_velocity_is_jogged_at_part_of_its_own(make_site, visit):  # noqa: F811
    site = make_site(**{**PLAIN, "sim_drive": {"set": ["spd=3200", "acc=640000", "dec=640000", "pae=1"]}})  # noqa: F811
    visitor = visit(site)
    view = visitor.go("drive/drive1")
    hold = view.locator('#jog .hold[data-direction="1"]')
    expect(hold).to_be_enabled()
    # A tenth of 3200 counts/s, in mm/s.
    expect(view.locator("#jog-speed")).to_have_value("1")
    bar = view.locator(".limit-bar")
    expect(bar).to_have_attribute("aria-label", re.compile(r"^50 % of the way from −100 to 100 mm$"))
    hold.hover()
    visitor.page.mouse.down()
    wait_moving(site.bridge)
    visitor.page.mouse.up()
    expect(view.locator("#drive-state")).to_have_text("Standstill")
    # Nobody takes control where that is not configured; the watchdog is there all the same.
    expect(view.locator("#control")).to_contain_text(re.compile(r"Watchdog .*30 s"))
    expect(view.locator("#control")).not_to_contain_text("Nobody has control")
    assert view.locator("#control-take").count() == 0
    assert findings(visitor.page) == []
    # A limit that is reached is named, with its value, and so is one that lets nothing begin.
    assert site.bridge.drive(1).command("set_position", target_position=31968) == 0
    expect(bar).to_have_attribute("data-end", "true")
    said = view.locator("#jog-state")
    limited = 0
    while limited < 2:
        hold.hover()
        visitor.page.mouse.down()
        expect(said).to_contain_text("Ended")
        # A busy machine's beats come late, which the page says as well.
        if "late" not in said.inner_text():
            expect(said).to_have_text(re.compile(
                "^Ended: (stopped at max-position 100 mm|max-position 100 mm is reached). Let go, then press again.$"))
            limited += 1
        visitor.page.mouse.up()
        expect(view.locator("#drive-state")).to_have_text("Standstill")


def test_lamps_are_few_and_say_what_they_mean(site, visit):  # noqa: F811
    view = visit(site).go("drive/drive1")
    status = view.locator("#status")
    expect(view.locator("#drive-state")).to_have_text("Standstill")
    expect(status.locator(".lamp:visible")).to_have_count(0)
    expect(status).to_contain_text("Nothing is unusual")
    site.bridge.drive(1).write("acc", 32000.0)
    expect(status.locator(".lamp:visible")).to_have_text([re.compile("Params unsaved")])
    status.locator(".lamp:visible").click()
    expect(status.locator("#lamp-meaning")).to_contain_text("lost at power-off")
    status.locator("#lamps-all").click()
    expect(status.locator(".lamp:visible").nth(30)).to_be_visible()


def test_who_changed_what_is_seen(state, make_site, visit):  # noqa: F811
    """The history has the new value, the audit trail the one before."""
    visitor = visit(make_site())
    view = visitor.go("parameters/drive1")
    view.locator("#parameter-acc").fill("99000")
    view.locator("#parameters-write").click()
    expect(view.locator("#parameters-report")).to_contain_text("1 written")
    view = visitor.go("drive/drive1")
    row = view.locator("#history tbody tr").first
    expect(row).to_contain_text("Write acc")
    expect(row).to_contain_text("640000 pulses/s^2 → 99000 pulses/s^2")
    expect(row).to_contain_text(f"{OPERATOR[0]} (page, 127.0.0.1)")
