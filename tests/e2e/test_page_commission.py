# SPDX-License-Identifier: Apache-2.0
"""The path of a new drive on the page, from the drive that answers to the report: a wrongly scaled drive, to its end."""

import contextlib
import re
import time

import pytest
from bridgelib import eventually
from browserlib import DESKTOP, PHONE, expect, findings, picture
from test_browser import STANDS_WITHIN, chromium, is_moving, make_site, visit, wait_moving, wait_stand  # noqa: F401 (fixtures)

RAMP = 64000
# A drive of the file that is edited on the page; its counts per unit are a tenth of what is right.
NEW_DRIVE = {"drives": 1, "sim_drives": 2, "control": {"edit": "on"},
             "sim_drive": {"set": ["spd=3200", f"acc={RAMP}", f"dec={RAMP}", "pae=1"]}}
SECTION = ("drive press {\n\tbus = line\n\taddress = 2\n\tunit = 2\n\tcounts-per-unit = 32\n\tunit-name = mm\n"
           "\treaction-ms = 2000\n\twatchdog-ms = 30000\n}\n")


def add_new_drive(bridge):
    folder = bridge.place / "edited"
    folder.mkdir()
    (folder / "edited.conf").write_text(SECTION, encoding="utf-8")
    bridge.reload()
    bridge.wait_ready(2)


def ask(view, question):
    """Whether that is asked; False: a busy machine did not bring the beats in time, and the trial has ended."""
    asked, now = view.locator("#commission-question"), view.locator("#commission-now")
    expect(asked.filter(has_text=question).or_(now.filter(has_text="Interrupted"))).to_be_visible()
    return not now.filter(has_text="Interrupted").is_visible()


def measure(view):
    """Ten times less than the position says."""
    counts = int(re.search(r"by (\d+) counts", view.locator("#commission-question").inner_text())[1])
    view.locator("#commission-number").fill(f"{counts / 320:.6f}")
    return "number"


def do_trial(view, *answers):
    """From its begin; each answer is (a part of the question, what is chosen)."""
    answers = [("uncoupled", "yes"), ("Go on?", "yes"), *answers]
    for _ in range(5):
        view.locator("#commission-begin").click()
        for question, choice in answers:
            if not ask(view, question):
                break
            choice = choice(view) if callable(choice) else choice
            view.locator(f'#commission-answers [data-answer="{choice}"]').click()
        else:
            expect(view.locator("#commission-now")).to_have_text("Done. The motor has no power.")
            return
        expect(view.locator("#commission-begin")).to_be_enabled()
    raise AssertionError("no trial came to its end")


def confirm(page):
    page.locator("dialog.question .primary").click()


def state_of(view, step):
    return view.locator(f'#commission-path [data-step="{step}"]')


def go_on(view):
    view.locator("#commission-on").click()


def enable(view):
    """A trial leaves it without power, and so may a busy machine."""
    button = view.locator("#commission-next")
    for _ in range(5):
        expect(view.locator("#commission-state")).to_have_text(re.compile("switched off|stands"))
        if button.is_visible():
            button.click()
        with contextlib.suppress(AssertionError):
            expect(view.locator("#commission-state")).to_have_text("stands", timeout=4000)
            return
    raise AssertionError("it gets no power")


def hold(page, direction, bridge, until):
    """Holds the jog button until the drive is there."""
    for _ in range(5):
        page.locator(f'#jog .hold[data-direction="{direction}"]').hover()
        page.mouse.down()
        wait_moving(bridge, "drive2")
        eventually(lambda: until(bridge.sim.get("drive2")["position"]) or not is_moving(bridge, "drive2"))
        page.mouse.up()
        bridge.wait_standing(2)
        if until(bridge.sim.get("drive2")["position"]):
            return
    raise AssertionError("the button could not be held for so long")


def walk(visitor, bridge):
    """The whole path, as somebody at a bench does it."""
    page = visitor.page
    view = visitor.go("commission/press")
    view.locator("#found-right").click()
    go_on(view)
    # It turns the wrong way: its wires are swapped, and the step is done once more.
    for positive, state in (("no", "wrong"), ("yes", "done")):
        do_trial(view, ("which way did it turn", "clockwise"), ("positive on your machine", positive))
        expect(state_of(view, "direction")).to_have_attribute("data-state", state)
    go_on(view)
    do_trial(view, ("How far did it go", measure))
    expect(state_of(view, "scale")).to_have_attribute("data-state", "wrong")
    expect(view.locator('tr[data-setting="counts-per-unit"]')).to_contain_text("320")
    # Of before, out of the edited file.
    expect(view.locator('tr[data-setting="counts-per-unit"] td').nth(1)).to_have_text("32")
    expect(view.locator('[data-key="counts-per-unit"]')).to_have_value("320")
    view.locator("#keys-write").click()
    confirm(page)
    expect(state_of(view, "scale")).to_have_attribute("data-state", "done")
    go_on(view)
    view.locator("#commission-leave").click()
    view.locator("#home-set").click()
    expect(state_of(view, "home")).to_have_attribute("data-state", "done")
    go_on(view)
    enable(view)
    view.locator("#jog-speed").fill("10")
    for direction, end in ((-1, "min"), (1, "max")):
        hold(page, direction, bridge, lambda position, sign=direction: sign * position > 2000)
        view.locator(f"#limit-{end}").click()
    expect(state_of(view, "limits")).to_have_attribute("data-state", "done")
    view.locator("#keys-write").click()
    confirm(page)
    expect(view.locator("#keys")).to_be_hidden()
    go_on(view)
    enable(view)
    view.locator("#response-distance").fill("3")
    view.locator("#response-make").click()
    expect(view.locator("#response-said")).to_contain_text("does not overshoot")
    view.locator('[data-parameter="acc"]').fill("8000")
    view.locator("#response-try").click()
    expect(view.locator("#response-said")).to_contain_text("Before: ")
    view.locator("#response-keep").click()
    expect(state_of(view, "response")).to_have_attribute("data-state", "done")
    go_on(view)
    view.locator("#saved-save").click()
    expect(state_of(view, "saved")).to_have_attribute("data-state", "done")
    go_on(view)
    expect(view.locator("#report")).to_be_visible()
    return view


def test_a_new_drive_from_found_to_its_report(make_site, visit):  # noqa: F811
    site = make_site(**NEW_DRIVE)  # noqa: F811
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    add_new_drive(bridge)
    view = walk(visitor, bridge)
    # What it has found is in force, and in the file of before with nothing else changed.
    edited = (bridge.place / "edited" / "edited.conf").read_text(encoding="utf-8")
    low, high = (float(re.search(rf"^\t{end}-position = (\S+)$", edited, re.M)[1]) for end in ("min", "max"))
    assert edited == SECTION.replace("= 32\n", "= 320\n").replace(
        "}\n", f"\tmin-position = {low:g}\n\tmax-position = {high:g}\n}}\n")
    assert low < -6 < 6 < high
    assert bridge.drive(2).read("acc") == 8000
    report = view.locator("#report")
    for words in ("320 counts per mm", "olga, ", "VSMD113_025T", "its position was set to 0 mm", "All steps"):
        expect(page.locator("main")).to_contain_text(words)
    expect(report.locator("#report-steps tr", has_text="Other trials")).to_contain_text("left out")
    expect(report.locator("#report-changed")).to_contain_text("64000")
    expect(report.locator("svg path")).to_have_count(2)
    assert report.locator("#report-open").count() == 0
    # Kept as a file it stands alone.
    with page.expect_download() as download:
        view.locator("#report-keep").click()
    kept = download.value.path().read_text(encoding="utf-8")
    assert download.value.suggested_filename.startswith("press.commissioning-")
    assert "<script" not in kept and "<svg" in kept and "min-position" in kept and "<button" not in kept
    # On paper there is nothing but the report; on a phone nothing is wider than it.
    page.emulate_media(media="print")
    expect(view.locator("#commission-path")).to_be_hidden()
    expect(report).to_be_visible()
    page.emulate_media(media="screen")
    for step in ("report", "scale", "limits", "response"):
        visitor.go(f"commission/press/{step}")
        expect(state_of(view, step)).to_have_attribute("data-state", "done")
        expect(view.locator(f"#{dict(scale='keys').get(step, step)}")).to_be_attached()
        assert findings(page) == [], step
        page.set_viewport_size(PHONE)
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0, step
        page.set_viewport_size(DESKTOP)
    picture(page, "web-response")
    # It is there when the page comes again, in another language.
    page.evaluate("() => localStorage.setItem('language', 'de')")
    visitor.go("commission/press/report")
    page.reload()
    expect(view.locator("#report")).to_contain_text("Inbetriebnahme von press")
    expect(view.locator("#report")).to_contain_text("Inkremente waren gemessen")


def test_what_moves_it_on_the_path_stops_as_elsewhere(make_site, visit):  # noqa: F811
    """Keys, another step, a stop in a step response; and values that are tried are not forgotten."""
    site = make_site(drives=1, sim_drive={"set": ["spd=3200", f"acc={RAMP}", f"dec={RAMP}", "pae=1"]})  # noqa: F811
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    ways = [lambda: page.keyboard.press("Space"), lambda: page.keyboard.press("Escape"),
            lambda: visitor.go("commission/drive1/saved")]
    for end in ways:
        view = visitor.go("commission/drive1/limits")
        expect(view.locator("#jog .hold").first).to_be_enabled()
        page.locator('#jog .hold[data-direction="1"]').hover()
        page.mouse.down()
        wait_moving(bridge)
        since = time.monotonic()
        end()
        assert wait_stand(bridge, since) < STANDS_WITHIN + 0.3
        page.mouse.up()
        bridge.wait_standing()
    # Nobody has taken anything; a step that is not done is said.
    expect(view.locator("#commission-open")).to_contain_text("Limits")
    view = visitor.go("commission/drive1/response")
    view.locator("#response-distance").fill("50")
    view.locator('[data-parameter="acc"]').fill("8000")
    view.locator("#response-try").click()
    wait_moving(bridge)
    page.keyboard.press("Escape")
    expect(view.locator("#response-back")).to_be_enabled()
    expect(state_of(view, "response")).to_have_attribute("data-state", "wrong")
    page.reload()
    expect(view.locator("#response-tried")).to_contain_text(f"acc = {RAMP}")
    assert bridge.drive().read("acc") == 8000
    view.locator("#response-back").click()
    expect(view.locator("#response-tried")).to_be_hidden()
    assert bridge.drive().read("acc") == RAMP
    # Where the configuration is root's, its lines are shown.
    bridge.drive().settle("set_position", target_position=0)
    visitor.go("commission/drive1/limits")
    view.locator("#limit-min").click()
    view.locator("#keys-write").click()
    expect(view.locator("#keys textarea")).to_have_value("drive drive1 {\n\tmin-position = 0\n}\n")
    view.locator("#keys-written").click()
    expect(view.locator("#keys")).to_be_hidden()


# Drives that are not moved over a way as they are configured, with what changes how they answer.
SPEEDS = {
    "xyza": ({"bus": {"protocol": "xyza", "drive-latency-ms": 60}, "sim_bus": {"protocol": "xyza"},
              "drive": {"axis": "x", "counts-per-unit": 320.0, "unit-name": "mm", "watchdog-ms": 30000},
              "sim_drive": {"identity": None, "set": ["max_speed=12800", "min_speed=100", "manual_speed=2000",
                                                      "acceleration_time=2", "brake=15", "enable=15"]}},
             "20", "acceleration_time", "12", "mm/s"),
    "servo-can": ({"bus": {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "baud": 3000000, "line": None},
                   "sim_bus": {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "baud": None, "line": None},
                   "drive": {"watchdog-ms": 30000, "ramp-acceleration": 6000, "ramp-deceleration": 6000, "max-speed": 3000},
                   "sim_drive": {"identity": None, "set": None}},
                  "600", "ramp_acceleration", "1500", "rpm"),
}


def hold_step(visitor, bridge, direction=1):
    """Holds the button of a step until the page ends it; again where a busy machine has ended it."""
    page = visitor.page
    said, problem = page.locator("#response-said"), page.locator("#response > .problem")
    for _ in range(5):
        page.locator(f'#response-hold [data-direction="{direction}"]').hover()
        expect(page.locator(f'#response-hold [data-direction="{direction}"]')).to_be_enabled()
        page.mouse.down()
        # What the attempt before has said is there until this one begins.
        with contextlib.suppress(AssertionError):
            expect(said).to_have_text("The drive moves …", timeout=5000)
        expect(said).not_to_have_text("The drive moves …", timeout=25000)
        measured = said.inner_text().startswith("The speed") and problem.inner_text() == ""
        # The button is still held.
        bridge.wait_standing()
        page.mouse.up()
        if measured:
            return said.inner_text()
    raise AssertionError(f"no step was measured: {said.inner_text()} {problem.inner_text()}")


def settled(words):
    return float(re.search(r"after ([0-9.]+) s", words)[1])


@pytest.mark.parametrize("family", SPEEDS)
def test_the_step_of_a_speed(make_site, visit, family):  # noqa: F811
    """While a button is held: its settling is measured, the drive stops by itself, and as soon as the button is let go."""
    options, speed, parameter, slower, unit = SPEEDS[family]
    site = make_site(drives=1, **options)
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    view = visitor.go("commission/drive1/response")
    enable(view)
    view.locator("#response-speed").fill(speed)
    assert view.locator("#response-make").is_hidden() and view.locator("#response-distance").is_hidden()
    expect(view.locator("#response").get_by_text(f"Speed, {unit}")).to_be_visible()
    # A button that is let go on the way: it stands, and nothing is measured.
    page.locator('#response-hold [data-direction="1"]').hover()
    page.mouse.down()
    eventually(lambda: bridge.drive().read("velocity") != 0, what="it to move")
    page.mouse.up()
    bridge.wait_standing()
    expect(view.locator("#response > .problem")).to_contain_text("Let go before")
    assert view.locator("#response .response-plot").count() == 0
    # Computed speeds are wrong on a machine that stands still: the steps of a tenth and of half a second are made again.
    eventually(lambda: settled(hold_step(visitor, bridge)) < 0.4, timeout=60, what="a quick step")
    expect(state_of(view, "response")).to_have_attribute("data-state", "done")
    view.locator(f'[data-parameter="{parameter}"]').fill(slower)
    view.locator("#response-try").click()
    expect(view.locator("#response-tried")).to_contain_text(parameter)
    eventually(lambda: settled(hold_step(visitor, bridge, -1)) > 0.4, timeout=60, what="a slow step")
    expect(view.locator("#response-said")).to_contain_text("Before: ")
    expect(view.locator("#response .response-plot path")).to_have_count(2)
    assert findings(page) == []
    view.locator("#response-back").click()
    expect(view.locator("#response-tried")).to_be_hidden()
    report = visitor.go("commission/drive1/report")
    expect(report.locator("#report-steps")).to_contain_text("The speed")
