# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, as people use it. What a browser has to complain of (errors, what the Content Security
Policy forbids, addresses elsewhere) fails each of these tests. When drives moved and stood is read off the wire."""

import contextlib
import csv
import io
import itertools
import re
import signal
import time

import pytest
from bridgelib import ENABLED_BIT, NO_ERROR, eventually
from browserlib import PHONE, Chromium, Visitor, expect, findings, picture
from relay import Relay
from test_audit import state  # noqa: F401 (a fixture)
from test_web_audit import write_trail
from weblib import OPERATOR, READER, Webd

# How long a drive may go on after its browser has gone: the dead man's 300 ms and the drive's own ramp, s.
STANDS_WITHIN = 0.5
# counts/s² of the simulated drives: from jogging to a stand in some milliseconds.
RAMP = 640000
# The watchdog has no part in it.
UNITS = {"counts-per-unit": 320.0, "unit-name": "mm", "max-velocity": 100.0, "watchdog-ms": 30000}
VIEWS = ["", "drive/drive1", "commission/drive1", "parameters/drive1", "scan", "scope", "trace", "events", "health", "health/drive1",
         "audit", "config", "gateway"]


@pytest.fixture(scope="module")
def chromium():
    browser = Chromium()
    yield browser
    browser.close()


@pytest.fixture
def make_site(make_bridge):
    """A function that starts a bridge with two drives, and drivebridge-webd."""
    made = []

    def make(**options):
        # No drive looks slow on a machine that browsers keep busy.
        bridge = make_bridge(**{"drives": 2, "bus": {"drive-latency-ms": 400}, "drive": UNITS, "sim_drive": {
            "set": ["spd=3200", f"acc={RAMP}", f"dec={RAMP}", "pae=1"]}, **options})
        web = Webd(bridge.place, bridge).start().wait_for_service()
        web.bridge = bridge
        web.host, web.port = web.address  # for a Relay
        made.append(web)
        return web

    yield make
    problems = []
    for web in made:
        problems += web.finish()
        print(f"--- webd.log\n{web.log()}")
    assert not problems, problems


@pytest.fixture
def site(make_site):
    return make_site()


@pytest.fixture
def visit(request, chromium):
    """A function that opens the page in a browser of its own, and logs in."""
    made = []

    def go(site, user=OPERATOR, url=None, **options):
        visitor = Visitor(chromium, url or site.url, **options)
        made.append(visitor)
        if user:
            visitor.log_in(*user)
        return visitor

    yield go
    for visitor in made:
        visitor.describe_failure(getattr(request.node, "failed", False))
    problems = [problem for visitor in made for problem in visitor.close()]
    assert not problems, problems


# --- what went over the wire ------------------------------------------------------------------------------------


def obeyed(bridge, drive="drive1"):
    """(moment of time.monotonic(), what), of what the simulated drive did: the commands that it obeyed, and `stands`."""
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        parts = line.split(" ", 3)
        if len(parts) == 4 and parts[1:3] == [drive, "!"]:
            yield int(parts[0]) / 1e6, parts[3].split(" |")[0].removeprefix("obeyed ")


def motions(bridge, drive="drive1"):
    return [what for _, what in obeyed(bridge, drive) if " mov" in what or " pos" in what or " rmv" in what]


def is_moving(bridge, drive="drive1"):
    return bridge.sim.get(drive)["velocity"] != 0


def wait_moving(bridge, drive="drive1"):
    eventually(lambda: is_moving(bridge, drive), what=f"{drive} to move")


def wait_stand(bridge, since, drive="drive1"):
    """When it came to its stand, s from `since` on."""
    return eventually(lambda: next((max(moment - since, 1e-6) for moment, what in obeyed(bridge, drive)
                                    if what == "stands" and moment >= since), None), what=f"{drive} to stand")


class Network(Relay):
    """What is between a browser and the gateway: notes when the last word of a jog button passed."""

    def __init__(self, site):
        super().__init__(site, heard=self._note)
        self.url = f"http://127.0.0.1:{self.port}"
        self.last_beat = 0.0

    def _note(self, data):
        if b"POST /api/jog" in data:
            self.last_beat = time.monotonic()


# --- a visitor's hands -------------------------------------------------------------------------------------------


def open_drive(visitor, name="drive1", speed="10"):
    view = visitor.go(f"drive/{name}")
    expect(view.locator("#jog .hold").first).to_be_enabled()
    view.locator("#jog-speed").fill(speed)
    return view


def hold(visitor, direction=1):
    """The mouse goes down on a jog button, and stays."""
    visitor.page.locator(f'#jog .hold[data-direction="{direction}"]').hover()
    visitor.page.mouse.down()


def hold_for(visitor, bridge, seconds):
    """Holds it so long; anew where the machine was too busy for the beats, which the page then says."""
    for _ in range(5):
        hold(visitor)
        began = time.monotonic()
        wait_moving(bridge)
        time.sleep(max(0.0, began + seconds - time.monotonic()))
        if bridge.sim.get()["velocity"] == 3200:
            return
        expect(visitor.page.locator("#jog-state")).to_contain_text("Ended")
        let_go(visitor)
    raise AssertionError("the button could not be held for so long")


def let_go(visitor):
    visitor.page.mouse.up()


def give(view, command, **arguments):
    """A command with values, by its form."""
    view.locator("#command").select_option(command)
    for name, value in arguments.items():
        view.locator(f'[data-argument="{name}"]').fill(value)
    view.locator("#command-run").click()


# Whether the focus is there, and can be seen; a link that is as large as its row has it around the row. Asked at once,
# because the page may move the focus meanwhile.
FOCUSED = """node => node !== document.activeElement ? "elsewhere" : [null, "::after"].some((part) => {
    const { outlineStyle, outlineWidth } = getComputedStyle(node, part);
    return outlineStyle !== "none" && outlineWidth !== "0px";
}) ? "seen" : 'hidden'"""


def tab_to(page, target):
    """By the key alone, as far as it takes; what has the focus can be seen to have it."""
    for _ in range(120):
        page.keyboard.press("Tab")
        focus = target.evaluate(FOCUSED)
        assert focus != "hidden", "the focus cannot be seen"
        if focus == "seen":
            return
    raise AssertionError(f"the key Tab does not lead to {target}")


# --- access ------------------------------------------------------------------------------------------------------


def test_who_logs_in_sees_the_drives(site, visit):
    visitor = visit(site, user=None)
    page = visitor.page
    page.get_by_label("User").fill(OPERATOR[0])
    page.get_by_label("Password").fill("not this one")
    page.get_by_role("button", name="Log in").click()
    expect(page.locator("#login-problem")).not_to_be_empty()
    visitor.log_in(*OPERATOR)
    for name in ("drive1", "drive2"):
        expect(page.locator(f'tr[data-drive="{name}"]')).to_contain_text("Standstill")
    expect(page.locator("#stop-all")).to_be_visible()
    # The session is the cookie's, not the page's.
    page.reload()
    expect(page.locator('tr[data-drive="drive1"]')).to_be_visible()
    page.locator("#logout").click()
    expect(page.get_by_label("Password")).to_be_visible()
    expect(page.locator("#stop-all")).to_be_hidden()


def test_who_may_only_look_and_stop_is_offered_nothing_else(site, visit):
    visitor = visit(site, READER)
    expect(visitor.page.locator("#stop-all")).to_be_visible()
    for name in "users", "audit":
        expect(visitor.page.locator(f'#navigation a[data-view="{name}"]')).to_be_hidden()
    expect(visitor.go("audit")).to_contain_text("needs the role engineer or administrator")
    view = visitor.go("drive/drive1")
    expect(view.locator(".plot")).to_be_visible()
    expect(view.locator("#stop")).to_be_visible()
    expect(view.locator("#may-not")).to_contain_text("needs the role operator")
    assert view.locator("#jog, #commands, #control-take").count() == 0
    assert view.get_by_role("link", name="Commission").count() == 0
    expect(visitor.go("commission/drive1")).to_contain_text("needs the role engineer")
    expect(visitor.go("scan")).to_contain_text("needs the role engineer")
    expect(visitor.go("users")).to_contain_text("needs the role administrator")
    view = visitor.go("parameters/drive1")
    expect(view.locator("#parameters-table")).to_be_visible()
    assert view.locator("#parameters-table input").count() == 0


def test_users_and_passwords_are_changed_on_the_page(site, visit):
    """An administrator makes an operator of one drive; he finds what is his, and gives himself another password."""
    site.add_user("ada", "makes the users", "administrator")
    ada = visit(site, ("ada", "makes the users"))
    view = ada.go("users")
    view.locator("#user-name").fill("otto")
    view.locator("#user-role").select_option("operator")
    view.locator("#user-drives").fill("drive1")
    view.locator("#user-password").fill("short")
    view.locator("#user-submit").click()
    expect(view.locator("#user-problem")).to_contain_text("too short")
    view.locator("#user-password").fill("winds up the clocks")
    view.locator("#user-submit").click()
    expect(view.locator('tr[data-user="otto"]')).to_contain_text("drive1")
    otto = visit(site, ("otto", "winds up the clocks"))
    view = otto.go("drive/drive2")
    expect(view.locator("#may-not")).to_contain_text("drive2 is not among the drives of otto: drive1")
    view = otto.go("drive/drive1")
    expect(view.locator("#jog")).to_be_visible()
    # What needs more is named, not offered.
    expect(view.locator("[data-denied]").first).to_contain_text("Set position")
    assert view.locator('[data-command="save_parameters"]').count() == 0
    second = visit(site, ("otto", "winds up the clocks"))
    view = otto.go("account")
    expect(view.locator("#sessions tbody tr")).to_have_count(2)
    expect(view.locator("#sessions tbody tr").first).to_contain_text("this one")
    assert findings(otto.page) == []
    view.locator("[data-session]").click()
    expect(view.locator("#sessions tbody tr")).to_have_count(1)
    expect(second.page.locator("#login-user")).to_be_visible()
    expect(second.page.locator("#navigation")).to_be_hidden()
    assert "add-user" not in second.page.content()
    for id_, word in ("now", "winds up the clocks"), ("fresh", "stops all the clocks"), ("again", "stops all the clocks"):
        view.locator(f"#password-{id_}").fill(word)
    view.locator("#password-submit").click()
    expect(otto.page.locator("#notices")).to_contain_text("The password was changed")
    view = ada.go("users")
    view.locator('[data-remove="otto"]').click()
    ada.page.get_by_role("dialog").get_by_role("button", name="Remove").click()
    expect(view.locator('tr[data-user="otto"]')).to_have_count(0)
    expect(otto.page.locator("#login-user")).to_be_visible()


# --- a drive -----------------------------------------------------------------------------------------------------


def test_a_move_is_watched_on_the_plot(site, visit):
    visitor = visit(site)
    view = open_drive(visitor)
    give(view, "move_absolute", target_position="20", target_velocity="25")
    expect(view.locator("#position")).to_have_text("20.000")
    expect(view.locator("#command-result")).to_contain_text("ok")
    expect(view.locator("#history tbody tr").first).to_contain_text("move absolute", ignore_case=True)
    expect(view.locator("#history tbody tr").first).to_contain_text(re.compile(rf"{OPERATOR[0]} \((through|page)"))
    picture(visitor.page, "web-drive")
    view.locator(".plot-pause").click()
    expect(view.locator(".plot-pause")).to_have_text("Go on")
    with visitor.page.expect_download() as download:
        view.locator(".plot-csv").click()
    rows = list(csv.reader(io.StringIO(download.value.path().read_text(encoding="utf-8"))))
    assert rows[0] == ["time_s", "unix_time_s", "drive1.position [mm]", "drive1.velocity [mm/s]"]
    positions = [float(row[2]) for row in rows[1:]]
    velocities = [float(row[3]) for row in rows[1:]]
    # The whole way and nothing else: from where it stood to where it stands, at the speed that was asked for.
    assert positions == sorted(positions) and (positions[0], positions[-1]) == (0, 20)
    assert len({round(position, 2) for position in positions}) > 8
    assert max(velocities) == pytest.approx(25, abs=0.5)
    # What has a range is held to it before anything is sent.
    before = motions(site.bridge)
    give(view, "move_absolute", target_position="1", target_velocity="5000")
    expect(view.locator("#command-result")).to_contain_text("out of range")
    assert motions(site.bridge) == before


def test_jogging_lasts_as_long_as_the_button_is_held(site, visit):
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    open_drive(visitor)
    # Longer than the dead man's time, with one motion for one press.
    hold_for(visitor, bridge, 0.8)
    expect(page.locator("#jog-state")).to_contain_text("Moving")
    since, count = time.monotonic(), len(motions(bridge))
    let_go(visitor)
    wait_stand(bridge, since)
    expect(page.locator("#drive-state")).to_have_text("Standstill")
    assert len(motions(bridge)) == count
    # A key on the button, the other way.
    page.locator('#jog .hold[data-direction="-1"]').focus()
    page.keyboard.down("ArrowLeft")
    eventually(lambda: bridge.sim.get()["velocity"] == -3200, what="the other direction")
    since = time.monotonic()
    page.keyboard.up("ArrowLeft")
    wait_stand(bridge, since)
    # Space stops, though the button stays pressed, and it stays stopped.
    hold(visitor)
    wait_moving(bridge)
    since = time.monotonic()
    page.keyboard.press("Space")
    wait_stand(bridge, since)
    count = len(motions(bridge))
    eventually(lambda: time.monotonic() - since > 0.6)
    let_go(visitor)
    assert not is_moving(bridge) and len(motions(bridge)) == count


def test_a_drive_stands_when_its_tab_is_closed(site, visit):
    with Network(site) as network:
        visitor = visit(site, url=network.url)
        open_drive(visitor)
        hold(visitor)
        wait_moving(site.bridge)
        closing = time.monotonic()
        visitor.page.close()
        assert closing + wait_stand(site.bridge, closing) - network.last_beat < STANDS_WITHIN
    site.bridge.wait_standing()
    assert site.bridge.drive(1).read("error") == NO_ERROR


def test_a_drive_stands_when_the_network_goes(site, visit):
    with Network(site) as network:
        visitor = visit(site, url=network.url)
        page = visitor.page
        open_drive(visitor)
        hold(visitor)
        wait_moving(site.bridge)
        lost = time.monotonic()
        network.hold()
        assert lost + wait_stand(site.bridge, lost) - network.last_beat < STANDS_WITHIN
        expect(page.locator("#banner")).to_be_visible()
        expect(page.locator("#link")).not_to_have_attribute("data-state", "live")
        expect(page.locator("html")).to_have_class(re.compile(r"\bstale\b"))
        # Beats that were on their way arrive now, and the button is still down.
        count = len(motions(site.bridge))
        network.go_on()
        expect(page.locator("#link")).to_have_attribute("data-state", "live")
        expect(page.locator("#banner")).to_be_hidden()
        assert len(motions(site.bridge)) == count and not is_moving(site.bridge)
        let_go(visitor)
        hold(visitor)
        wait_moving(site.bridge)
        since = time.monotonic()
        let_go(visitor)
        wait_stand(site.bridge, since)


@pytest.mark.parametrize("late", [0.5, 2, 5])
def test_a_press_that_outlived_its_browser_moves_nothing(site, chromium, late):
    """Its first beat is on its way, in a hole of the network, when the browser dies; it comes so many seconds later."""
    with Network(site) as network:
        browser = Chromium(beside=chromium)
        visitor = Visitor(browser, network.url).log_in(*OPERATOR)
        open_drive(visitor)
        network.hold()
        since = time.monotonic()
        hold(visitor)
        eventually(lambda: b"POST /api/jog" in network.kept, what="the first beat to be under way")
        browser.kill()
        eventually(lambda: time.monotonic() - since >= late)
        network.go_on()
        site.wait_for_log("jog of drive1")
        assert motions(site.bridge) == [] and not is_moving(site.bridge)
        assert "late and was not carried out" in site.log()
        browser.close()


def test_what_came_late_is_said_on_the_page(site, visit):
    with Network(site) as network:
        visitor = visit(site, url=network.url)
        page = visitor.page
        view = open_drive(visitor)
        network.hold()
        since = time.monotonic()
        page.locator("#jog-step-forward").click()
        hold(visitor)
        eventually(lambda: b"POST /api/jog" in network.kept and b"move_relative" in network.kept)
        eventually(lambda: time.monotonic() - since >= 0.8)
        network.go_on()
        late = re.compile(r"came \d+\.\d s late and was not carried out")
        expect(view.locator("#jog .problem")).to_have_text(late)
        let_go(visitor)
        site.wait_for_log("a jog of drive1 came")
        assert motions(site.bridge) == []
        # With the network as it was all is as it was.
        expect(page.locator("#link")).to_have_attribute("data-state", "live")
        hold_for(visitor, site.bridge, 0.5)
        let_go(visitor)


def test_a_service_that_goes_is_seen(site, visit):
    visitor = visit(site)
    page = visitor.page
    expect(page.locator('tr[data-drive="drive1"]')).to_contain_text("Standstill")
    site.bridge.stop_bridge()
    expect(page.locator("#link")).to_have_attribute("data-state", "down")
    expect(page.locator("#banner")).to_contain_text("drivebridged")
    age = page.locator('tr[data-drive="drive1"] .age')
    # It grows by itself.
    expect(age).to_have_text(re.compile(r"^([2-9]|\d\d)(\.\d)? s$"))
    site.bridge.start_bridge()
    expect(page.locator("#link")).to_have_attribute("data-state", "live")
    expect(page.locator('tr[data-drive="drive1"]')).to_contain_text("Standstill")
    expect(age).to_have_text(re.compile(r"ms$"))


def test_two_browsers_and_a_plc_want_one_drive(make_site, visit):
    site = make_site(modbus={"control": "drive", "control-timeout-ms": 60000})
    bridge, plc = site.bridge, site.bridge.drive(1)
    anna, ben = visit(site), visit(site)
    assert plc.write("control_request", 1) == 0
    plc.settle("move_velocity", target_velocity=640)
    wait_moving(bridge)
    for visitor in (anna, ben):
        view = open_drive(visitor)
        expect(view.locator("#control-holder")).to_contain_text("127.0.0.1")
    # The PLC's claim is respected, and everybody may stop.
    hold(anna)
    expect(anna.page.locator("#jog-state")).to_contain_text("Ended")
    let_go(anna)
    assert bridge.sim.get()["velocity"] == 640 and len(motions(bridge)) == 1
    since = time.monotonic()
    anna.page.locator("#stop").click()
    wait_stand(bridge, since)
    # It lets go; one browser takes it, and both see who has it.
    assert plc.write("control_request", 0) == 0
    expect(anna.page.locator("#control")).to_have_attribute("data-control", "nobody")
    anna.page.locator("#control-take").click()
    expect(anna.page.locator("#control")).to_have_attribute("data-control", "mine")
    expect(ben.page.locator("#control")).to_have_attribute("data-control", "other")
    expect(ben.page.locator("#control-holder")).to_contain_text(re.compile(rf"{OPERATOR[0]} \((through|page)"))
    assert plc.command("move_velocity", target_velocity=640) == 6
    hold(anna)
    eventually(lambda: bridge.sim.get()["velocity"] == 3200, what="the one who has control to move it")
    since = time.monotonic()
    ben.page.locator("#stop").click()
    wait_stand(bridge, since)
    expect(anna.page.locator("#jog-state")).to_contain_text("Ended")
    let_go(anna)
    hold(ben)
    expect(ben.page.locator("#jog-state")).to_contain_text("Ended")
    let_go(ben)
    assert len(motions(bridge)) == 2
    anna.page.locator("#control-release").click()
    expect(ben.page.locator("#control")).to_have_attribute("data-control", "nobody")


# --- a stop that is not confirmed --------------------------------------------------------------------------------

# Notes in the page when something was pressed, and when the alarm was to be seen first: both by the page's clock, ms.
WATCH_ALARM = """() => {
    window.seen = {};
    const alarm = document.getElementById("stop-alarm");
    for (const press of ["click", "keydown"])
        window.addEventListener(press, () => { window.seen.pressed ??= performance.now(); }, true);
    new MutationObserver(() => {
        if (!alarm.hidden && alarm.dataset.kind === "unconfirmed")
            window.seen.alarm ??= performance.now();
    }).observe(alarm, { attributes: true });
}"""


@contextlib.contextmanager
def hung(process):
    """One that does not run any more, and is not gone either."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("who", ["server", "service"])
@pytest.mark.parametrize("how", ["stop", "key", "all"])
def test_a_stop_that_is_not_confirmed_is_seen_and_repeated(site, visit, who, how):
    """The page's server, or the service, hangs: nobody may believe that the drive was told."""
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    visitor.go("" if how == "all" else "drive/drive1")
    if how != "all":
        expect(page.locator("#drive-state")).to_have_text("Standstill")
    bridge.drive(1).settle("move_velocity", target_velocity=640)
    wait_moving(bridge)
    page.evaluate(WATCH_ALARM)
    alarm = page.locator("#stop-alarm")
    with hung(site.process if who == "server" else bridge.process):
        if how == "key":
            page.keyboard.press("Space")
        else:
            page.locator("#stop-all" if how == "all" else "#stop").click()
        expect(alarm).to_be_visible()
        expect(alarm).to_contain_text("NOT CONFIRMED: use the emergency stop")
        expect(alarm).to_contain_text("all drives" if how == "all" else "drive1: stop")
        # Nor is what is shown said to be new.
        expect(page.locator("#link")).to_have_attribute("data-state", re.compile("hung|silent|lost|down"), timeout=5000)
        seen = page.evaluate("window.seen")
        # Half a second, and a look of a page that may not get the processor at once.
        print(f"the alarm was seen {seen['alarm'] - seen['pressed']:.0f} ms after the press")
        assert 450 <= seen["alarm"] - seen["pressed"] < 2500, seen
        # It stays, longer than a try lasts, and so does the drive's motion.
        eventually(lambda: page.evaluate("performance.now() - window.seen.alarm > 2500"))
        expect(alarm).to_be_visible()
        assert is_moving(bridge)
        since = time.monotonic()
    # Nobody presses anything any more.
    wait_stand(bridge, since)
    expect(alarm).to_be_hidden()


def test_a_long_ramp_is_no_alarm(make_site, visit):
    """A drive that is seen to brake has been told; it takes longer than half a second to stand."""
    site = make_site(sim_drive={"set": ["spd=3200", f"acc={RAMP}", "dec=1600", "pae=1"]})
    visitor = visit(site)
    page = visitor.page
    visitor.go("drive/drive1")
    expect(page.locator("#drive-state")).to_have_text("Standstill")
    site.bridge.drive(1).settle("move_velocity", target_velocity=3200)
    eventually(lambda: site.bridge.sim.get()["velocity"] == 3200)
    page.evaluate(WATCH_ALARM)
    since = time.monotonic()
    page.locator("#stop").click()
    assert wait_stand(site.bridge, since) > 1.5
    expect(page.locator("#drive-state")).to_have_text("Standstill")
    expect(page.locator("#stop-alarm")).to_be_hidden()
    assert "alarm" not in page.evaluate("window.seen")


def test_a_stop_of_all_releases_what_is_held(site, visit):
    """Also a button that has not moved anything yet."""
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    open_drive(visitor)
    page.evaluate("""() => {
        const ask = window.fetch;
        window.beats = [];
        window.fetch = (path, options) => {
            if (path === "/api/jog")
                window.beats.push(JSON.parse(options.body).velocity);
            return ask(path, options);
        };
    }""")
    hold(visitor)
    wait_moving(bridge)
    page.keyboard.press("Control+.")
    eventually(lambda: page.evaluate("window.beats.at(-1)") == 0, what="the release")
    bridge.wait_standing()
    page.mouse.up()


def test_a_press_waits_for_the_stop_of_the_drive_before_only_while_it_is_held(site, visit):
    """The server's answer to a press on the next drive while the one before is still being stopped; see test_web.py."""
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    open_drive(visitor)
    page.evaluate("""() => {
        const ask = window.fetch;
        Object.assign(window, { beats: [], waits: 2 });
        window.fetch = (path, options) => {
            if (path !== "/api/jog")
                return ask(path, options);
            const { velocity } = JSON.parse(options.body);
            window.beats.push(velocity);
            return velocity === 0 || window.waits-- <= 0 ? ask(path, options) : Promise.resolve(new Response(JSON.stringify(
                { held: false, why: "waiting", text: "drive2 is still being stopped", result: "" })));
        };
    }""")
    hold(visitor)
    wait_moving(bridge)
    page.mouse.up()
    bridge.wait_standing()
    told = motions(bridge)
    page.evaluate("() => Object.assign(window, { beats: [], waits: 100 })")
    hold(visitor)
    eventually(lambda: page.evaluate("window.beats.length"), what="the first beat")
    page.mouse.up()
    page.evaluate("() => { window.waits = 0; }")
    eventually(lambda: page.evaluate("window.beats.at(-1)") == 0, what="the release")
    # The next press is one of its own: nothing of the one before has been sent after the hand let go.
    hold(visitor, -1)
    wait_moving(bridge)
    page.mouse.up()
    bridge.wait_standing()
    beats = page.evaluate("window.beats")
    assert max(beats[beats.index(0):]) == 0, beats
    assert told and all("spd=-" in what for what in motions(bridge)[len(told):]), motions(bridge)


def test_a_stop_that_the_drive_does_not_confirm_can_be_taken_away_by_hand(site, visit):
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    alarm = page.locator("#stop-alarm")
    bridge.sim.fault("silence on", "drive2")
    row = page.locator('tr[data-drive="drive2"]')
    expect(row).to_contain_text("Offline")
    # Why, what to do and the event about it are the service's.
    expect(row).to_contain_text("no answer")
    expect(row).to_contain_text("check its power, its cable and its address; it comes back by itself")
    expect(row).to_contain_text("does not answer at address 2")
    expect(page.locator("#summary")).to_have_text("1 drive needs you")
    page.locator("#stop-all").click()
    # It is named, and the one that stands is not.
    expect(alarm).to_contain_text("drive2: stop (")
    expect(alarm).not_to_contain_text("drive1")
    page.get_by_role("button", name="I have seen to it").click()
    expect(alarm).to_be_hidden()
    # Pressed again, and confirmed when it is there again.
    page.locator('[data-stop="drive2"]').click()
    expect(alarm).to_contain_text("NOT CONFIRMED")
    bridge.sim.fault("silence off", "drive2")
    expect(alarm).to_be_hidden()


# --- the first drive of a kind ------------------------------------------------------------------------------------


def begin_step(visitor, step, seconds=""):
    """Up to the question whether it may move."""
    view = visitor.go("commission/drive1/trials")
    view.locator("#commission-step").select_option(step)
    view.locator("#commission-seconds").fill(seconds)
    view.locator("#commission-begin").click()
    answer(view, "uncoupled", "yes")
    expect(view.locator("#commission-question")).to_contain_text("Go on?")
    return view


def answer(view, question, choice):
    expect(view.locator("#commission-question")).to_contain_text(question)
    view.locator(f'#commission-answers [data-answer="{choice}"]').click()


def test_a_drive_is_commissioned_in_the_browser(make_site, visit):
    """As by drivebridgectl: questions, a motion, what contradicts a setting, the section to paste, the report."""
    site = make_site(drives=1, sim_drive={"speed": "unsigned", "set": ["spd=3200", f"acc={RAMP}", f"dec={RAMP}", "pae=1"]},
                     drive={**UNITS, "reaction-ms": 800})
    visitor = visit(site)
    visitor.go("drive/drive1").get_by_role("link", name="Commission").click()
    view = begin_step(visitor, "speed", "0.8")
    assert motions(site.bridge) == []
    answer(view, "Go on?", "yes")
    expect(view.locator('tr[data-setting="speed-sign"]')).to_have_attribute("data-verdict", "contradicted")
    expect(view.locator("#commission-counts")).to_contain_text("1 contradicted")
    assert len(motions(site.bridge)) >= 1 and not is_moving(site.bridge)
    assert "speed-sign = position" in view.locator("#commission-result textarea").input_value()
    picture(visitor.page, "web-commission")
    with visitor.page.expect_download() as download:
        view.locator("#commission-report").click()
    report = download.value.path().read_text(encoding="utf-8")
    assert download.value.suggested_filename.startswith("drive1.commissioning-")
    assert "commissioning of drive1 (vsmd-serial on bus line)" in report and "counts-per-unit = 320" in report
    assert f"{OPERATOR[0]} at 127.0.0.1: commission" in site.log()
    # It can begin again, and an answer that is none is said.
    view.locator("#commission-begin").click()
    answer(view, "uncoupled", "no")
    expect(view.locator("#commission-now")).to_have_text("Done. The motor has no power.")


def hide(visitor, hidden=True):
    visitor.page.evaluate("""hidden => {
        Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
        document.dispatchEvent(new Event("visibilitychange"));
    }""", hidden)


def test_a_trial_ends_and_nothing_moves_on(site, visit):
    """Stops of the page, and a page that is not seen any more: of this step's two motions the second never comes."""
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    ways = [lambda: page.locator("#commission-stop").click(), lambda: page.locator("#stop-all").click(),
            lambda: page.keyboard.press("Space"), lambda: hide(visitor), lambda: visitor.go("events"), page.close]
    for number, end in enumerate(ways, 1):
        view = begin_step(visitor, "stop", "5")
        begun, count = time.monotonic(), len(motions(bridge))
        answer(view, "Go on?", "yes")
        wait_moving(bridge)
        ended = time.monotonic()
        end()
        # Beats that a busy machine did not bring in time have ended it before.
        assert begun + wait_stand(bridge, begun) - ended < 1.0
        if number <= 3:
            expect(view.locator("#commission-now")).to_contain_text("Interrupted")
            expect(view.locator("#commission-begin")).to_be_enabled()
        eventually(lambda expected=number: site.log().count("commissioning of drive1 ended") == expected,
                   what="the server to end it")
        if number == 4:
            hide(visitor, False)
        bridge.wait_standing()
        assert len(motions(bridge)) == count + 1
        assert not bridge.drive(1).read("status") & ENABLED_BIT


def test_a_browser_that_is_gone_does_not_hold_a_trial(site, visit):
    """No beat passes any more, and nothing says so: the server's rule stops it."""
    with Network(site) as network:
        visitor = visit(site, url=network.url)
        answer(begin_step(visitor, "motion", "5"), "Go on?", "yes")
        wait_moving(site.bridge)
        since = time.monotonic()
        network.hold()
        assert wait_stand(site.bridge, since) < STANDS_WITHIN + 0.3
        site.wait_for_log("commissioning of drive1 ended")


# --- for everybody -----------------------------------------------------------------------------------------------


@contextlib.contextmanager
def finger(page, target):
    """One that is on the screen."""
    box = target.bounding_box()
    touch = page.context.new_cdp_session(page)
    point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})
    try:
        yield
    finally:
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_a_phone_is_enough(site, visit):
    visitor = visit(site, viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
    page = visitor.page
    for route in VIEWS:
        visitor.go(route)
        expect(page.locator("#link")).to_have_attribute("data-state", "live")
        # Nobody has to push the page about to read it.
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0, route
    view = open_drive(visitor)
    stop = view.locator("#stop")
    expect(stop).to_be_in_viewport()
    assert stop.bounding_box()["height"] >= 44
    button = view.locator('#jog .hold[data-direction="1"]')
    button.scroll_into_view_if_needed()
    expect(stop).to_be_in_viewport()
    with finger(page, button):
        wait_moving(site.bridge)
        picture(page, "web-phone")
        since = time.monotonic()
    wait_stand(site.bridge, since)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_view_is_for_everybody(site, visit, scheme):
    """What axe finds: names, roles, order, and the contrast in either colours."""
    rules = None if scheme == "light" else ["color-contrast"]
    visitor = visit(site, user=None, color_scheme=scheme)
    page = visitor.page
    found = findings(page, rules)
    visitor.log_in(*OPERATOR)
    for route in VIEWS:
        view = visitor.go(route)
        expect(view.locator("h1")).to_be_visible()
        found += [f"{route or 'overview'}: {one}" for one in findings(page, rules)]
    assert not found, "\n".join(found)
    ground = [int(part) for part in re.findall(r"\d+", page.evaluate("getComputedStyle(document.body).backgroundColor"))]
    assert (sum(ground[:3]) < 200) == (scheme == "dark")
    # The switch is stronger than the system, and is remembered.
    other = "dark" if scheme == "light" else "light"
    while page.locator("#theme").get_attribute("data-theme") != other:
        page.locator("#theme").click()
    page.reload()
    assert page.evaluate("getComputedStyle(document.documentElement).colorScheme") == other


def test_the_keyboard_is_enough(site, visit):
    visitor = visit(site, user=None)
    page, keyboard = visitor.page, visitor.page.keyboard
    expect(page.get_by_label("User")).to_be_focused()
    keyboard.type(OPERATOR[0])
    tab_to(page, page.get_by_label("Password"))
    keyboard.type(OPERATOR[1])
    keyboard.press("Enter")
    link = page.locator('tr[data-drive="drive1"] .row-link')
    expect(link).to_be_visible()
    tab_to(page, link)
    keyboard.press("Enter")
    button = page.locator('#jog .hold[data-direction="1"]')
    expect(button).to_be_enabled()
    tab_to(page, page.locator("#jog-speed"))
    keyboard.press("Control+a")
    keyboard.type("10")
    tab_to(page, button)
    keyboard.down("Enter")
    wait_moving(site.bridge)
    since = time.monotonic()
    keyboard.up("Enter")
    wait_stand(site.bridge, since)
    # A motion that nobody holds; the one key stops it wherever the focus is.
    tab_to(page, page.locator("#jog-step"))
    keyboard.press("Control+a")
    keyboard.type("1000")
    tab_to(page, page.locator("#jog-step-forward"))
    keyboard.press("Enter")
    wait_moving(site.bridge)
    since = time.monotonic()
    keyboard.press("Escape")
    wait_stand(site.bridge, since)
    # To another view, by its link in the head.
    page.reload()
    events = page.get_by_role("link", name="Events").first
    expect(events).to_be_visible()
    tab_to(page, events)
    keyboard.press("Enter")
    expect(page.locator('.view[data-view="events"]')).to_be_visible()


# --- parameters, scan, trace, events -----------------------------------------------------------------------------


def edit(view, name, value):
    field = view.locator(f"#parameter-{name}")
    field.fill(value)
    field.press("Tab")


def test_parameters_are_changed_compared_and_restored(site, visit, tmp_path):
    bridge, visitor = site.bridge, visit(site)
    page = visitor.page
    view = visitor.go("parameters/drive1")
    expect(view.locator("#parameter-acc")).to_have_value(str(RAMP))
    with page.expect_download() as download:
        view.locator("#parameters-backup").click()
    backup = tmp_path / "drive1.params"
    download.value.save_as(backup)
    assert f"acc = {RAMP}" in re.sub(" +", " ", backup.read_text(encoding="utf-8"))
    # What cannot be is not written; what was changed is marked.
    edit(view, "acc", "plenty")
    expect(view.locator('tr[data-name="acc"] .note')).to_contain_text("is no number")
    edit(view, "acc", "320000")
    edit(view, "dec", "310000")
    expect(view.locator('tr[data-name="acc"]')).to_have_class(re.compile(r"\bchanged\b"))
    expect(view.locator('tr[data-name="acc"] .note')).to_contain_text(f"was {RAMP}")
    picture(page, "web-parameters")
    assert bridge.drive(1).read("acc") == RAMP
    view.locator("#parameters-write").click()
    expect(view.locator("#parameters-report")).to_contain_text("2 written")
    assert (bridge.drive(1).read("acc"), bridge.drive(1).read("dec")) == (320000, 310000)
    # Beside the other drive, which still has what this one had.
    view.locator("#parameters-beside").select_option("drive drive2")
    expect(view.locator("#parameters-take")).to_have_text("Take 2 from drive2")
    # Back from the file.
    view.locator("#parameters-file").set_input_files(backup)
    expect(view.locator("#parameters-take")).to_have_text("Take 2 from drive1.params")
    view.locator("#parameters-take").click()
    view.locator("#parameters-write").click()
    expect(view.locator("#parameters-take")).to_have_count(0)
    assert (bridge.drive(1).read("acc"), bridge.drive(1).read("dec")) == (RAMP, RAMP)


def test_a_drive_that_no_configuration_names_is_found(make_site, visit):
    # Room for questions in each cycle, also while the machine is busy.
    site = make_site(drives=1, sim_drives=2, bus={"cycle-ms": 100, "drive-latency-ms": 12})
    visitor = visit(site)
    view = visitor.go("scan")
    view.locator("#scan-last").fill("4")
    view.locator("#scan-start").click()
    finds = view.locator("#scan-finds tbody tr")
    expect(finds).to_have_count(2)
    expect(finds.nth(0)).to_contain_text("drive1")
    expect(finds.nth(1)).to_contain_text("new")
    text = view.locator("#scan").get_by_label("For the configuration, then reload")
    expect(text).to_be_visible()
    picture(visitor.page, "web-scan")
    # As it stands there, pasted by who may: it is taken, and the page shows the drive.
    pasted = text.input_value()
    assert re.search(r"address\s+= 2\b", pasted), pasted
    site.bridge.reload(site.bridge.config_path.read_text(encoding="utf-8") + pasted)
    visitor.go("")
    expect(visitor.page.locator("#drives tbody tr")).to_have_count(2)


def test_a_found_drive_gets_another_address(make_site, visit):
    site = make_site(drives=1, sim_drives=2, bus={"cycle-ms": 100, "drive-latency-ms": 12}, sim_drive={"settles": "at-once"})
    visitor = visit(site)
    view = visitor.go("scan")
    view.locator("#scan-last").fill("4")
    view.locator("#scan-start").click()
    view.get_by_role("button", name="Give address 2 another address or speed").click()
    question = visitor.page.get_by_role("dialog")
    steps = view.locator("#setup-steps")
    # Who does not want it after all has changed nothing.
    view.locator("#setup-to").fill("9")
    view.locator("#setup-start").click()
    expect(question).to_contain_text("it says that it is VSMD")
    question.get_by_role("button", name="Cancel").click()
    expect(steps).to_contain_text("Nothing was changed")
    view.locator("#setup-start").click()
    question.get_by_role("button", name="Go on").click()
    expect(question).to_contain_text("save_parameters")
    question.get_by_role("button", name="Save").click()
    expect(steps).to_contain_text("Done: it answers at address 9")
    assert site.bridge.sim.get("drive2")["address"] == 9


def test_a_move_is_captured_around_its_trigger(site, visit):
    visitor = visit(site)
    view = visitor.go("scope/drive1")
    expect(view.locator("#scope-channels li")).to_have_count(2)
    view.locator("#scope-trigger-drive").select_option("drive1")
    view.locator("#scope-trigger-value").select_option("position")
    view.locator("#scope-relation").select_option(">")
    view.locator("#scope-limit").fill("far")
    view.locator("#scope-start").click()
    expect(view.locator("#scope-problem")).to_contain_text("“far” is no number")
    # In the drive's unit: 320 counts each.
    expect(view.locator("#scope-unit")).to_have_text("mm")
    view.locator("#scope-limit").fill("0.5")
    view.locator("#scope-duration").fill("0.2")
    view.locator("#scope-start").click()
    expect(view.locator("#scope-said")).to_contain_text("Waits for drive1.position rises above 0.5 mm")

    def captured():
        """Its samples may come only after some moves."""
        for target in (640, 0):
            site.bridge.drive(1).settle("move_absolute", target_position=target)
            eventually(lambda target=target: site.bridge.drive(1).read("position") == target, what="its end")
        return "Waits" not in view.locator("#scope-said").inner_text()

    eventually(captured, 60, "the trigger to come")
    expect(view.locator("#scope-said")).to_contain_text("samples")
    with visitor.page.expect_download() as download:
        view.locator("#scope-save").click()
    heads, *lines = download.value.path().read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines]
    assert "drive1.position [mm]" in heads
    # What was before it, and the position at it.
    assert float(rows[0][0]) < 0
    at = [row for row in rows if float(row[0]) == 0]
    assert at and 0.5 < float(at[0][2]) <= 2
    # The next move needs no settings.
    view.locator("#scope-move").click()
    expect(view.locator("#scope-said")).to_contain_text("Waits for drive1.velocity is not 0 mm/s")
    eventually(captured, 60, "the move")
    expect(view.locator("#scope-said")).to_contain_text("samples")
    # How it answers to the next move.
    view.locator("#scope-duration").fill("0.6")
    view.locator("#scope-move").click()
    expect(view.locator("#scope-said")).to_contain_text("Waits for")
    targets = itertools.cycle((960, 0))

    def moved():
        target = next(targets)
        site.bridge.drive(1).settle("move_absolute", target_position=target)
        eventually(lambda: site.bridge.drive(1).read("position") == target, what="its end")
        return "Waits" not in view.locator("#scope-said").inner_text()

    eventually(moved, 60, "the trigger to come")
    expect(view.locator("#scope-response")).to_contain_text("drive1.position does not overshoot")
    expect(view.locator("#scope-response")).to_contain_text("of the step after 0.")


def test_the_wire_and_the_log_are_read(site, visit):
    visitor = visit(site)
    page = visitor.page
    view = visitor.go("trace")
    view.locator("#trace-kind").select_option("command")
    site.bridge.drive(1).settle("move_absolute", target_position=640)
    expect(view.get_by_text("drive1: move to 640 pulses").first).to_be_visible()
    expect(view.locator("#trace-counts")).to_contain_text("records")
    view.locator("#trace-kind").select_option("")
    picture(page, "web-trace")
    with page.expect_download() as download:
        view.locator("#trace-save").click()
    assert "pos" in download.value.path().read_text(encoding="utf-8")
    # Trouble: it is in the log as it happens, and the seconds before it are kept.
    view = visitor.go("events")
    expect(view.locator("#events-level")).to_have_value("warning")
    site.bridge.sim.fault("silence on", "drive2")
    expect(view.get_by_text("drive-lost").first).to_be_visible()
    view.locator("#events-drive").select_option("drive1")
    expect(view.get_by_text("drive-lost")).to_have_count(0)
    view.locator("#events-drive").select_option("drive2")
    # The newest is above.
    view.locator("#events-level").select_option("debug")
    expect(view.get_by_text("drive-lost").first).to_be_visible()
    moments = view.locator(".newest-list tbody td:first-child").all_inner_texts()
    assert len(moments) > 1 and moments == sorted(moments, reverse=True)
    # It is on the plot of its drive.
    view = visitor.go("drive/drive2")
    expect(view.locator("#drive-state")).to_have_text("Offline")
    expect(view.locator("section.plot")).to_have_attribute("data-marks", re.compile(r"[1-9]"))
    view = visitor.go("trace")
    expect(view.locator("#trace-kept tbody tr").first).to_contain_text("drive2")
    view.locator("#trace-kept tbody tr").first.get_by_role("button").click()
    expect(view.locator("#trace-counts")).to_contain_text("all that was kept")
    # On paper there are more than those in sight.
    printed, shown = page.evaluate("""() => {
        dispatchEvent(new Event("beforeprint"));
        const rows = document.querySelectorAll(".long-list tbody tr:not(.space)").length;
        dispatchEvent(new Event("afterprint"));
        return [rows, parseInt(document.querySelector("#trace-counts").textContent)];
    }""")
    assert printed == min(shown, 1000) > 100


def test_the_audit_trail_is_searched_verified_and_saved(state, make_site, visit):  # noqa: F811
    write_trail(state / "audit", [250])
    site = make_site()
    assert site.bridge.drive(2).command("enable") == 0
    visitor = visit(site)
    page = visitor.page
    view = visitor.go("audit")
    rows = view.locator("#audit tbody tr")
    # The newest first, and older ones when they are wanted.
    expect(rows).to_have_count(100)
    expect(rows.nth(99)).to_have_attribute("data-number", re.compile(r"1[5-9]\d"))
    expect(view.locator("#audit-state")).to_contain_text("Newest record 2")
    picture(page, "web-audit")
    view.locator("#audit-older").click()
    expect(rows).to_have_count(200)
    view.locator("#audit-older").click()
    expect(view.locator("#audit-count")).to_contain_text("there are no older ones")
    expect(rows.last).to_have_attribute("data-number", "1")
    # Filters.
    view.locator("#audit-drive").select_option("drive2")
    expect(rows.last).to_contain_text("enable")
    expect(rows.filter(has_text="drive2")).to_have_count(rows.count())
    view.locator("#audit-drive").select_option("")
    view.locator("#audit-text").fill("entry 0005")
    view.locator("#audit-text").press("Enter")
    expect(rows).to_have_count(10)
    view.locator("#audit-refused").check()
    expect(rows).to_have_count(0)
    view.locator("#audit-text").fill("entry")
    view.locator("#audit-search").click()
    expect(rows).to_have_count(2)
    expect(rows.first).to_have_attribute("data-kind", "warning")
    # As files, with the same filter.
    for form, begin in ("jsonl", '{"number":100'), ("cef", "CEF:0|drivebridge"):
        with page.expect_download() as download:
            view.locator(f"#audit-{form}").click()
        assert download.value.suggested_filename.endswith(f".{form}")
        lines = download.value.path().read_text(encoding="utf-8").splitlines()
        assert len(lines) == 2 and lines[0].startswith(begin), lines
    view.locator("#audit-verify").click()
    expect(view.locator("#audit-chain")).to_contain_text("the chain is whole")
    # The same records in words of another language.
    page.evaluate("() => localStorage.setItem('language', 'de')")
    page.reload()
    expect(rows.filter(has_text="Anmeldung: angemeldet").first).to_be_visible()
    view.locator("#audit-drive").select_option("drive2")
    expect(rows.last).to_contain_text("Freigabe")
