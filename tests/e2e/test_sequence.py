# SPDX-License-Identifier: Apache-2.0
"""A sequence of named positions runs while a button is held: whatever ends that, and whatever goes wrong with a step, no
drive moves on, and no further step begins. What drives did is read off the simulator."""

import http.client
import re
import signal
import threading
import time

import pytest
from bridgelib import RESULT_OK, eventually
from relay import Relay
from test_web import gateway, refused  # noqa: F401
from weblib import OPERATOR, READER, Failed

SPEED = 3200.0
FAR, NEAR = 32000, 320
STEPS = [{"drive": "drive1", "position": "far", "velocity": SPEED, "wait_ms": 0},
         {"drive": "drive2", "position": "far", "velocity": SPEED, "wait_ms": 0}]
# A busy machine takes its time (s).
PATIENCE = 0.3


class Held:
    """A button that is held: beats each 100 ms over a connection of its own."""

    def __init__(self, page, steps, number=None):
        page.grip += 1
        self.page = page.beside()
        self.steps = steps
        self.number = number or page.grip
        self.beats = 0
        self.answers = []
        self.held = threading.Event()
        self.held.set()
        self.thread = threading.Thread(target=self._beat, daemon=True)
        self.thread.start()

    def send(self, held):
        self.beats += 1
        beat = {"grip": self.number, "beat": self.beats, "held": held,
                "token": self.page.newest_token() if held else ""}
        # As the page does it: until it is known that they have come.
        if not self.answers:
            beat["steps"] = self.steps
        return self.page.ask("POST", "/api/sequence", beat)

    def _beat(self):
        while self.held.is_set():
            try:
                self.answers.append(self.send(True))
            except (OSError, http.client.HTTPException, Failed) as error:
                self.answers.append(error)
                return
            time.sleep(0.1)

    def last(self, key):
        last = self.answers[-1] if self.answers else None
        return last.get(key) if isinstance(last, dict) else None

    def ends(self, why):
        """What it says about that."""
        eventually(lambda: self.last("held") is False, what="the sequence to end")
        assert self.last("why") == why, self.answers[-1]
        self.vanish()
        return self.last("text")

    def let_go(self):
        self.vanish()
        return self.send(False)

    def vanish(self):
        self.held.clear()
        self.thread.join(10)


def place(bridge, drive="drive1"):
    return bridge.sim.get(drive)["position"]


def moving(bridge, drive="drive1"):
    return bridge.sim.get(drive)["velocity"] != 0


def stand(bridge, within=5.0):
    eventually(lambda: not moving(bridge) and not moving(bridge, "drive2"), within, "the drives to stand")


def orders(bridge, what, drive):
    """When a drive was told that, by the clock that does not jump."""
    found = []
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        match = re.match(rf"(\d+) {drive} ! obeyed \d+ {what}\b", line)
        if match:
            found.append(int(match[1]) / 1e6)
    return found


def stopped(bridge, since, drive="drive1"):
    """How long after that it was told to stop (s)."""
    return eventually(lambda: next((when - since for when in orders(bridge, "stp", drive) if when > since), None),
                      what=f"a stop of {drive}")


def move(bridge, number, target):
    bridge.drive(number).settle("move_absolute", target_position=target, target_velocity=64000)
    eventually(lambda: place(bridge, f"drive{number}") == target)
    bridge.wait_standing(number)


def back(bridge):
    stand(bridge)
    for number in (1, 2):
        bridge.drive(number).settle("clear_fault")
        bridge.drive(number).settle("enable")
        move(bridge, number, 0)


def prepared(gateway, **options):
    """Two drives with the positions far and near; a page."""
    bridge = gateway.make_bridge(drives=2, drive={"watchdog-ms": 0, "on-client-loss": "none", **options})
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    for number in (1, 2):
        bridge.drive(number).settle("enable")
        for name, target in (("far", FAR), ("near", NEAR)):
            move(bridge, number, target)
            bridge.wait_ready(number)
            page.call("Teach", drive=f"drive{number}", name=name)
        move(bridge, number, 0)
    return bridge, webd, page


def begun(bridge, page, steps=None):
    held = Held(page, steps or STEPS)
    try:
        eventually(lambda: moving(bridge), what="the first drive to move")
    except AssertionError as error:
        raise AssertionError(f"{error}: {held.answers[-3:]}") from error
    return held


def nothing_follows(bridge, since):
    """The second drive was never told to move, and the first one not after its stop."""
    last = orders(bridge, "stp", "drive1")[-1]
    assert not [when for when in orders(bridge, "mov", "drive2") + orders(bridge, "pos", "drive2") if when > since]
    assert not [when for when in orders(bridge, "pos", "drive1") if when > last]
    assert 0 < place(bridge) < FAR


def test_steps_follow_each_other_while_it_is_held(gateway):  # noqa: F811
    bridge, webd, page = prepared(gateway)
    steps = [{"drive": "drive1", "position": "near", "velocity": SPEED, "wait_ms": 300},
             {"drive": "drive2", "position": "near", "wait_ms": 0},
             {"drive": "drive1", "position": "far", "velocity": 64000, "wait_ms": 100}]
    since = time.monotonic()
    held = Held(page, steps)
    held.ends("done")
    assert (place(bridge), place(bridge, "drive2")) == (FAR, NEAR)
    assert not [when for when in orders(bridge, "stp", "drive1") if when > since], "nothing had to be stopped"
    first, *_ = [when for when in orders(bridge, "pos", "drive2") if when > since]
    assert {1, 2, 3} <= {answer["step"] for answer in held.answers}
    assert any(answer["wait_ms"] > 0 for answer in held.answers)
    assert first - since > 0.3
    assert "olga at 127.0.0.1: sequence of 3 steps begins" in webd.log()
    # What is no sequence, and who may not.
    for wrong in ({}, {"grip": 99, "beat": 1}, {"grip": 99, "beat": 1, "held": True, "steps": []},
                  {"grip": 99, "beat": 1, "held": True, "steps": [{"drive": "drive1"}]},
                  {"grip": 99, "beat": 1, "held": True, "steps": [{**steps[0], "wait_ms": -1}]},
                  {"grip": 99, "beat": 1, "held": True, "steps": [{**steps[0], "velocity": "fast"}]},
                  {"grip": 99, "beat": 1, "held": True, "steps": steps * 11}):
        assert refused(400, page.ask, "POST", "/api/sequence", wrong).error == "BadRequest"
    reader = gateway.page(webd, READER)
    assert refused(403, reader.ask, "POST", "/api/sequence",
                   {"grip": 1, "beat": 1, "held": True, "steps": steps}).error == "NotAllowed"
    assert refused(403, reader.call, "Teach", drive="drive1", name="x").error == "NotAllowed"
    assert {one["name"] for one in reader.call("Positions", drive="drive1")["positions"]} == {"far", "near"}
    webd.add_user("ole", "the word of ole", "operator", "drive1")
    other = gateway.page(webd, ("ole", "the word of ole"))
    assert refused(403, other.ask, "POST", "/api/sequence",
                   {"grip": 1, "beat": 1, "held": True, "token": other.newest_token(), "steps": STEPS}).error == "NotAllowed"
    # A beat without steps, of a press whose first beat was lost, moves nothing.
    lost = page.ask("POST", "/api/sequence", {"grip": 50, "beat": 2, "held": True, "token": page.newest_token()})
    assert (lost["held"], lost["why"]) == (False, "refused")
    assert not moving(bridge) and not moving(bridge, "drive2")


@pytest.mark.parametrize("how", ["released", "vanished", "doubled", "stop button", "other client", "logout"])
def test_whatever_ends_it(gateway, how):  # noqa: F811
    bridge, webd, page = prepared(gateway)
    since = time.monotonic()
    held = begun(bridge, page)
    limit = 0.1
    if how == "released":
        at = time.monotonic()
        assert held.let_go()["why"] == "released"
    elif how in ("vanished", "doubled"):
        held.vanish()
        at, limit = time.monotonic(), 0.3
        while how == "doubled" and moving(bridge) and time.monotonic() - at < 3:
            held.beats -= 1
            held.send(True)
    elif how == "stop button":
        at = time.monotonic()
        page.run("drive2", "stop")
        held.ends("stopped")
    elif how == "other client":
        at = time.monotonic()
        bridge.drive().command("stop")
        assert "step 1" in held.ends("refused")
    else:
        at = time.monotonic()
        page.log_out()
        limit = 0.3
        eventually(lambda: isinstance(held.answers[-1], Failed))
    assert stopped(bridge, at) < limit + PATIENCE
    stand(bridge)
    if how not in ("stop button", "other client", "logout"):
        # Late beats of it begin nothing.
        for beat in (held.beats, held.beats + 1, held.beats + 9):
            assert page.ask("POST", "/api/sequence", {"grip": held.number, "beat": beat, "held": True, "steps": STEPS,
                                                      "token": page.newest_token()})["held"] is False
    held.vanish()
    stand(bridge)
    nothing_follows(bridge, since)


def test_a_link_that_holds_and_a_server_that_dies(gateway):  # noqa: F811
    """Beats that a network keeps back hold nothing, and begin nothing when they come at once; nor does a killed server."""
    bridge, webd, page = prepared(gateway)
    near = webd.address

    class Server:
        host, port = near

    since = time.monotonic()
    with Relay(Server) as relay:
        webd.address = ("127.0.0.1", relay.port)
        held = begun(bridge, page)
        webd.address = near
        relay.hold()
        at = time.monotonic()
        assert stopped(bridge, at) < 0.3 + 0.1 + PATIENCE
        stand(bridge)
        eventually(lambda: time.monotonic() - at > 0.7)
        relay.go_on()
        held.ends("late")
    nothing_follows(bridge, since)
    # During a wait nothing moves, and nothing begins after it is let go.
    back(bridge)
    # One with a stream of tokens that does not come through the relay.
    page = gateway.page(webd, OPERATOR)
    since = time.monotonic()
    held = Held(page, [{**STEPS[0], "position": "near", "wait_ms": 2000}, STEPS[1]])
    eventually(lambda: held.last("wait_ms"))
    held.vanish()
    eventually(lambda: "ended at step 2: late" in webd.log())
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]
    # The server is killed: the service knows at once.
    back(bridge)
    since = time.monotonic()
    held = begun(bridge, page)
    at = time.monotonic()
    webd.stop(signal.SIGKILL)
    assert stopped(bridge, at) < 0.1 + PATIENCE
    stand(bridge)
    held.vanish()
    nothing_follows(bridge, since)


def test_a_service_that_hangs_or_dies(gateway):  # noqa: F811
    """What was held stands when there is a service again, and the sequence does not go on."""
    bridge, webd, page = prepared(gateway)
    since = time.monotonic()
    held = begun(bridge, page)
    # 20 ms later at most it is known what is held, also to another run.
    kept = bridge.control_path.with_name(bridge.control_path.name + ".must-stand")
    eventually(kept.exists, 2, "the drive that must stand to be kept")
    bridge.process.send_signal(signal.SIGKILL)
    bridge.process.wait()
    for unit in bridge.units.values():
        unit.close()
    bridge.units = {}
    eventually(lambda: held.last("held") is False or isinstance(held.answers[-1], Failed))
    at = time.monotonic()
    bridge.start_bridge()
    assert stopped(bridge, at) < 2
    stand(bridge, 10)
    assert place(bridge) < FAR
    held.vanish()
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]


def test_a_stop_between_its_steps_ends_it(gateway):  # noqa: F811
    """A stop by somebody else while nothing of the sequence moves, or of a drive whose turn comes later: it does not begin."""
    bridge, _, page = prepared(gateway)
    every = bridge.gateway()
    # All of them, during a wait.
    since = time.monotonic()
    held = Held(page, [{**STEPS[0], "position": "near", "wait_ms": 700}, STEPS[1]])
    eventually(lambda: held.last("wait_ms"))
    assert every.write("group_stop", 1) == 0
    assert "drive2" in held.ends("refused")
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]
    # The one that comes next, while the other one moves; who stopped it goes on with it, and is not disturbed.
    back(bridge)
    since = time.monotonic()
    held = Held(page, [{**STEPS[0], "position": "near", "wait_ms": 300}, STEPS[1]])
    eventually(lambda: moving(bridge))
    assert bridge.drive(2).settle("stop") == RESULT_OK
    assert bridge.drive(2).command("move_velocity", target_velocity=100) == 0
    told = time.monotonic()
    assert "was stopped after" in held.ends("refused")
    assert place(bridge) == NEAR
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]
    assert moving(bridge, "drive2") and not [when for when in orders(bridge, "stp", "drive2") if when > told]
    assert every.write("group_stop", 1) == 0
    # The next press moves it again.
    back(bridge)
    Held(page, [{**one, "position": "near"} for one in STEPS]).ends("done")


@pytest.mark.parametrize("what", ["origin", "limit", "disabled", "forgotten", "offline"])
def test_a_step_that_cannot_be_done_ends_it(gateway, what):  # noqa: F811
    bridge, webd, page = prepared(gateway, **{"max-velocity": 64000.0})
    steps = [{**STEPS[0], "position": "near"}, STEPS[1], STEPS[0]]
    if what == "origin":
        bridge.drive(2).command("set_position", target_position=5)
    elif what == "limit":
        steps[1] = {**steps[1], "velocity": 70000}
    elif what == "disabled":
        bridge.drive(2).settle("disable")
        # It counts as a stop: one that came before the press.
        old = page.newest_token()
        eventually(lambda: page.newest_token() != old)
    elif what == "forgotten":
        page.call("Forget", drive="drive2", name="far")
    else:
        bridge.sim.fault("silence on", "drive2")
        eventually(lambda: page.call("Positions", drive="drive2")["positions"][0]["flaw"] == "offline")
    since = time.monotonic()
    text = Held(page, steps).ends("refused")
    assert text.startswith("step 2, drive2 to far: "), text
    assert {"origin": "another origin", "limit": "limit", "disabled": "does not know where", "forgotten": "no position",
            "offline": "does not answer"}[what] in text, text
    assert place(bridge) == NEAR, "the step before was done, the one after not begun"
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]
    assert len([when for when in orders(bridge, "pos", "drive1") if when > since]) == 1


def test_an_origin_that_is_lost_on_the_way_ends_it(gateway):  # noqa: F811
    """The drive has its power switched off and on while it moves."""
    bridge, webd, page = prepared(gateway)
    since = time.monotonic()
    held = begun(bridge, page)
    eventually(lambda: place(bridge) > SPEED)
    bridge.sim.control("power drive1 off")
    eventually(lambda: not bridge.drive().online(), what="the drive to be missed")
    bridge.sim.control("power drive1 on")
    text = held.ends("refused")
    assert text.startswith("step 1, drive1 to far: "), text
    stand(bridge)
    assert not [when for when in orders(bridge, "pos", "drive2") if when > since]
    eventually(lambda: page.call("Positions", drive="drive1")["positions"][0]["flaw"] in ("origin_lost", "other_origin"))
