# SPDX-License-Identifier: Apache-2.0
"""Named positions and their sequence on the page: whatever takes the hand or the eyes away stops the drives."""

import time

import pytest
from bridgelib import eventually
from browserlib import expect
from test_browser import STANDS_WITHIN, chromium, is_moving, make_site, motions, site, visit, wait_stand  # noqa: F401 (fixtures)
from weblib import READER

ROW = 'tr[data-position="{}"]'


def teach(visitor, site, name, target):  # noqa: F811
    drive = site.bridge.drive()
    drive.settle("move_absolute", target_position=target, target_velocity=32000)
    eventually(lambda: site.bridge.sim.get()["position"] == target)
    site.bridge.wait_standing()
    visitor.page.locator("#position-name").fill(name)
    visitor.page.locator("#position-teach").click()
    expect(visitor.page.locator(ROW.format(name))).to_contain_text("good")


@pytest.fixture
def view(site, visit):  # noqa: F811
    """The positions of drive1 with near and far, and a sequence from far to near."""
    site.bridge.drive().settle("enable")
    visitor = visit(site)
    shown = visitor.go("positions/drive1")
    teach(visitor, site, "far", 16000)
    teach(visitor, site, "near", 320)
    for name in ("far", "near"):
        shown.locator(f'{ROW.format(name)} [data-do="add"]').click()
    expect(shown.locator("#sequence-steps li")).to_have_count(2)
    shown.locator("#sequence-steps li").first.get_by_label("Speed, empty for the drive's own").fill("3200")
    shown.locator("#sequence-steps li").first.get_by_label("Wait after it in seconds").fill("0.2")
    shown.locator("#sequence-hold").focus()
    return shown


def hold(shown):
    shown.locator("#sequence-hold").hover()
    shown.page.mouse.down()


def hold_until(shown, bridge, holds):
    """Held until that is true; once more where the machine was too busy for the beats, which the page then says."""
    said = shown.locator("#sequence-state")
    for _ in range(5):
        hold(shown)
        if eventually(lambda: holds() or ("Ended" in said.inner_text() and "ended"), 30) != "ended":
            return
        shown.page.mouse.up()
        bridge.wait_standing()
    raise AssertionError("the button could not be held for so long")


def test_positions_and_a_sequence(site, visit, view):  # noqa: F811
    bridge, page = site.bridge, view.page
    # By a click, as any command.
    view.locator(f'{ROW.format("far")} [data-do="go"]').click()
    eventually(lambda: bridge.sim.get()["position"] == 16000)
    view.locator(f'{ROW.format("near")} [data-do="go"]').click()
    eventually(lambda: bridge.sim.get()["position"] == 320)
    bridge.wait_standing()
    # Held to its end.
    said = view.locator("#sequence-state")
    seen = set()

    def is_done():
        seen.add(said.inner_text())
        return said.inner_text() == "All steps are done."

    hold_until(view, bridge, is_done)
    assert "Step 1 of 2: drive1 goes to far" in seen
    page.mouse.up()
    assert bridge.sim.get()["position"] == 320
    # The list is there when the page comes again.
    page.reload()
    expect(view.locator("#sequence-steps li")).to_have_count(2)
    expect(view.locator("#sequence-steps li").first).to_contain_text("drive1 to far")
    # A place that may have moved is not offered.
    bridge.drive().command("set_position", target_position=0)
    expect(view.locator(ROW.format("far"))).to_contain_text("the origin may have moved")
    expect(view.locator(f'{ROW.format("far")} [data-do="go"]')).to_be_disabled()
    view.locator(f'{ROW.format("far")} [data-do="keep"]').click()
    page.get_by_role("button", name="It is the same").click()
    expect(view.locator(ROW.format("far"))).to_contain_text("good")
    view.locator(f'{ROW.format("near")} [data-do="forget"]').click()
    page.get_by_role("button", name="Forget").last.click()
    expect(view.locator(ROW.format("near"))).to_have_count(0)
    # Who may only look sees them, and has no buttons.
    reader = visit(site, READER)
    seen = reader.go("positions/drive1")
    expect(seen.locator(ROW.format("far"))).to_be_visible()
    assert seen.locator(".toolbar button, #sequence").count() == 0


HIDE = """hidden => {
    Object.defineProperty(document, "visibilityState", { value: hidden ? "hidden" : "visible", configurable: true });
    Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
}"""
ENDS = {
    "let go": lambda page: page.mouse.up(),
    "hidden": lambda page: page.evaluate(HIDE, True),
    "blur": lambda page: page.evaluate("() => window.dispatchEvent(new Event('blur'))"),
    "Space": lambda page: page.keyboard.press("Space"),
    "Escape": lambda page: page.keyboard.press("Escape"),
    "left": lambda page: page.evaluate("() => { location.hash = '#/events'; }"),
    "closed": lambda page: page.close(),
}


def test_what_takes_the_hand_away_stops_it(site, view):  # noqa: F811
    bridge, page = site.bridge, view.page
    for how, end in ENDS.items():
        bridge.drive().settle("move_absolute", target_position=320, target_velocity=32000)
        eventually(lambda: bridge.sim.get()["position"] == 320)
        bridge.wait_standing()
        button = view.locator("#sequence-hold")
        hold_until(view, bridge, lambda: is_moving(bridge) and "held" in button.get_attribute("class").split())
        since = time.monotonic()
        end(page)
        assert wait_stand(bridge, since) < STANDS_WITHIN + 0.3, how
        orders = len(motions(bridge))
        eventually(lambda: time.monotonic() - since > 1)
        assert not is_moving(bridge) and len(motions(bridge)) == orders, f"{how}: no further step"
        assert 320 < bridge.sim.get()["position"] < 16000, how
        if how == "left":
            page.evaluate("() => { location.hash = '#/positions/drive1'; }")
        if how == "hidden":
            page.evaluate(HIDE, False)
        if how != "closed":
            page.mouse.up()
