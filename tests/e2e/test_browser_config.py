# SPDX-License-Identifier: Apache-2.0
"""The configuration in a browser: a drive is added, shown what that does, and taken out by a button."""

from bridgelib import CONTINUOUS, eventually
from browserlib import expect, findings, picture
from test_browser import chromium, make_site, visit  # noqa: F401 (fixtures)
from weblib import READER

ADDED = ("drive feeder {\n\tbus = line\n\taddress = 2\n\tunit = 2\n\tcounts-per-unit = 320\n"
         "\tunit-name = mm\n\twatchdog-ms = 0\n}\n")


def answer(page, words=None):
    """The question, once it says these words, with yes."""
    question = page.locator("dialog.question")
    expect(question).to_contain_text(words)
    question.locator(".primary").click()


def test_a_drive_is_added_without_a_terminal(make_site, visit):  # noqa: F811
    site = make_site(drives=1, sim_drives=2, control={"edit": "on"})
    visitor = visit(site)
    page = visitor.page
    view = visitor.go("config")
    text, state, save = view.get_by_label("Buses and drives"), view.locator("#config-state"), view.locator("#config-save")
    expect(state).to_have_text("It is right, and saved")
    expect(view.locator("#config-back")).to_be_disabled()
    # A mistake is shown at its line, to which a button leads.
    text.fill(ADDED.replace("unit = 2", "unti = 2"))
    messages = view.locator("#config-messages li")
    expect(messages.filter(has_text="unknown key 'unti'")).to_be_visible()
    expect(save).to_be_disabled()
    expect(view.locator('.line-numbers [data-kind="error"]').last).to_have_text("4\n")
    view.locator('#config-messages [data-line="4"]').focus()
    page.keyboard.press("Enter")
    expect(text).to_be_focused()
    # The numbers stand next to their lines.
    at, beside = (view.locator(one).bounding_box() for one in (".line-numbers span >> nth=0", "#config-text"))
    assert at["x"] < beside["x"] and beside["y"] < at["y"] < beside["y"] + 20
    assert text.evaluate("node => node.value.slice(node.selectionStart, node.selectionEnd)") == "\tunti = 2"
    # In the guide's picture the file is where the package has it.
    view.locator("code").evaluate("node => { node.textContent = '/etc/drivebridge/edited/edited.conf' }")
    picture(page, "web-configuration")
    found = findings(page)
    assert not found, "\n".join(found)
    # The text stays while another view is looked at; nothing is written.
    visitor.go("events")
    visitor.go("config")
    expect(text).to_have_value(ADDED.replace("unit = 2", "unti = 2"))
    assert not (site.bridge.place / "edited").exists()
    text.fill(ADDED)
    expect(view.locator("#config-effects")).to_contain_text("feeder: it is added")
    save.click()
    answer(page, "feeder: it is added")
    expect(state).to_have_text("It is right, and saved")
    feeder = site.bridge.drive(2)
    eventually(feeder.online, what="the drive that was added")
    # What moves is said before it is stopped.
    feeder.settle("move_velocity", target_velocity=3200.0)
    eventually(lambda: feeder.read("axis_state") == CONTINUOUS)
    view.locator("#config-back").click()
    question = page.locator("dialog.question")
    expect(question).to_contain_text("feeder MOVES NOW: it is removed: its on-exit is carried out")
    question.get_by_role("button", name="Cancel").click()
    assert feeder.read("axis_state") == CONTINUOUS
    view.locator("#config-back").click()
    answer(page, "MOVES NOW")
    expect(text).to_have_value("")
    eventually(lambda: site.bridge.sim.get("drive2")["velocity"] == 0)
    expect(view.locator("#config-former option")).to_have_count(2)


def test_what_somebody_else_changed_is_not_overwritten(make_site, visit):  # noqa: F811
    site = make_site(drives=1, sim_drives=2, control={"edit": "on"})
    visitor = visit(site)
    view = visitor.go("config")
    state = view.locator("#config-state")
    expect(state).to_have_text("It is right, and saved")
    view.get_by_label("Buses and drives").fill("# mine\n")
    expect(state).to_have_text("It is right, and not saved")
    folder = site.bridge.place / "edited"
    folder.mkdir()
    (folder / "edited.conf").write_text("# somebody else's\n", encoding="utf-8")
    view.locator("#config-save").click()
    answer(visitor.page, "No drive changes")
    expect(visitor.page.locator("#notices")).to_contain_text("changed meanwhile")
    view.locator("#config-read").click()
    answer(visitor.page, "is lost")
    expect(view.get_by_label("Buses and drives")).to_have_value("# somebody else's\n")


def test_who_may_not_is_not_offered_it(make_site, visit):  # noqa: F811
    site = make_site()
    visitor = visit(site, READER)
    expect(visitor.page.locator('[data-view="config"]').first).to_be_hidden()
    expect(visitor.go("config")).to_contain_text("needs the role engineer")
    visitor = visit(site)
    view = visitor.go("config")
    expect(view.locator("#config-state")).to_contain_text("not changed")
    expect(view.locator("#config-save")).to_be_disabled()
