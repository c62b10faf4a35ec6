# SPDX-License-Identifier: Apache-2.0
"""XYZA controllers with every temperament: whatever the document leaves open, a PLC hears of success
only when the controller has done it, and of failure only when it has not."""

import pytest
import temperament
from bridgelib import (
    RESULT_FAILED,
    RESULT_OK,
    RESULT_PENDING,
    RESULT_REFUSED,
    RESULT_UNPROVEN,
    STANDSTILL,
    eventually,
)
from temperament import Temperament

IDLE, RUNNING, WAITING, INTERRUPTED = range(4)
SUCCESS = (RESULT_OK, RESULT_UNPROVEN)


def xyza(key, value, sees, **more):
    return Temperament("xyza", key, value, sees, **more)


TEMPERAMENTS = [
    xyza("answer-mark", "0a", "Nothing."),
    xyza("failure-code", "bb", "Nothing."),
    xyza("echo-a4", True, "Nothing."),
    xyza("negative-zero", False, "Nothing: a position is set right either way."),
    xyza("amount-clears-sign", True, "Nothing: a position is set right either way."),
    xyza("acknowledges-all", True, "What the controller does not do is failed or indeterminate "
         "instead of refused."),
    xyza("ignores", ["position"], "set_position is failed."),
    xyza("ignores", ["sign"], "set_position to the other side of 0 is failed."),
    xyza("ignores", ["item"], "Parameters are refused, enable and disable are failed."),
    xyza("ignores", ["output"], "set_output is failed."),
    xyza("ignores", ["jog"], "Jogs are failed, and are stopped in case that they begin later."),
    xyza("ignores", ["program"], "start_program is indeterminate, other commands to the program "
         "are failed."),
    xyza("lacks", ["read_password"], "This register is unknown, and the log names it."),
    xyza("lacks", ["manual_speed"], "This register is unknown, and moves at a speed are unproven."),
    xyza("lacks", ["lead"], "Units cannot be taken from the controller; writing it is unproven."),
    xyza("lacks", ["ports"], "inputs and outputs show 0; set_output and set_outputs are unproven."),
    xyza("lacks", ["program"], "program_state shows 65535; commands to programs are unproven, and "
         "stops go to both modes."),
    xyza("idle-state", 6, "program_state shows it; that a program has ended is not known."),
    xyza("latches-speed", True, "Another speed the same way, while it moves, is failed, and the axis "
         "is stopped."),
    xyza("takes-any", True, "Values that the document does not name are shown, and stay."),
    xyza("clamps", True, "A speed that the controller makes smaller is refused; its register shows "
         "what it has become."),
    xyza("jogs-from-stand", True, "An axis is stopped before it takes another speed.",
         bus=(("jog-speed-change", "standing"),)),
    xyza("second-stop-ends", True, "Nothing: a program that was stopped can go on."),
    xyza("ordered-speeds", True, "A min_speed above max_speed is refused; whoever raises both begins with max_speed."),
    xyza("motion-delay-ms", 100, "Nothing but later answers to jogs."),
    xyza("standing-delay-ms", 100, "Nothing but later answers to jogs and stops."),
    xyza("power-delay-ms", 100, "Nothing but later answers to parameters, enable and disable."),
    xyza("braking-ms", 10000, "Stopping for seconds; a jog the other way waits for it."),
    xyza("latency-us", 1, "Nothing.", section="bus"),
    xyza("latency-us", 20000, "Nothing but longer round trips.", section="bus",
         bus=(("cycle-ms", 250),), drive=(("stop-reaction-ms", 2000),)),
    xyza("answers-as-host", True, "It is not online; `trouble` is not_understood, and the log shows its last frame.",
         core=False),
]


def agree(chosen):
    """Brakes of 10 s at ten times the latency would take minutes of tests."""
    values = {one.key: one.value for one in chosen}
    return not ("braking-ms" in values and values.get("latency-us", 0) > 1000)


CASES = [pytest.param(chosen, id=temperament.name(chosen)) for chosen in temperament.sets(TEMPERAMENTS, agree)]


class Controller:
    """The bridge in front of a controller of which it is known what it does not do or tell."""

    def __init__(self, bridge, chosen):
        values = {one.key: one.value for one in chosen}
        self.bridge = bridge
        self.x = bridge.drive(1)
        self.y = bridge.drive(2)
        self.ignored = values.get("ignores", [])
        self.hidden = values.get("lacks", [])
        self.idle = values.get("idle-state", IDLE)
        self.clamps = values.get("clamps", False)
        self.ordered = values.get("ordered-speeds", False)

    def sim(self, name):
        return self.bridge.sim.get()[name]

    def judge(self, result, kind, hidden=False):
        """Whether it was done, after its result was compared with what must have become of it."""
        if kind in self.ignored:
            # What cannot be read cannot be found wrong, either.
            assert result == RESULT_UNPROVEN if hidden else result not in SUCCESS
            return False
        assert result == (RESULT_UNPROVEN if hidden else RESULT_OK)
        return True

    def does(self, kind, name, drive=None, hidden=False, **args):
        return self.judge((drive or self.x).settle(name, **args), kind, hidden)

    def sets(self, name, value):
        self.x.write(name, value)
        done = eventually(lambda: self.x.read("write_result") != RESULT_PENDING and
                          self.x.read("write_result"), what="the write")
        return done


def cycles(drive, count):
    """At least so many come to their end."""
    seen = {drive.read("timestamp_us")}
    eventually(lambda: seen.add(drive.read("timestamp_us")) or len(seen) > count, what="cycles")


def silent(controller, question):
    """This was asked in vain so often that it is passed over."""
    trace = controller.bridge.sim.trace_path
    eventually(lambda: trace.read_text(encoding="utf-8").count(question) >= 2, what="losses")
    cycles(controller.x, 3)


def positions(controller):
    for position in (-4108, 500, -700, 0, 7):
        before = controller.sim("x")
        result = controller.x.settle("set_position", target_position=position)
        if result == RESULT_OK:
            assert controller.sim("x") == position
            assert controller.x.read("position") == position
        else:
            # What was ignored would have made a difference.
            assert "position" in controller.ignored or "sign" in controller.ignored
            assert before != position
            eventually(lambda: controller.x.read("position") == controller.sim("x"),
                       what="the truth")


def power(controller):
    controller.bridge.sim.control("place drive1 x 0")
    assert controller.x.read("enable") == 15
    if controller.does("item", "disable"):
        assert controller.x.read("enable") == 14
    # Where nothing was disabled it is enabled already.
    assert controller.x.settle("enable") == RESULT_OK
    assert controller.x.read("enable") == 15


def jogs(controller):
    x = controller.x
    hidden = "manual_speed" in controller.hidden
    moves = "jog" not in controller.ignored
    speed = {"target_velocity": 1500} if "item" not in controller.ignored else \
        {"target_velocity": 2000}
    controller.does("jog", "move_velocity", hidden=hidden and moves, **speed)
    if moves:
        assert controller.sim("x_speed") > 0
        eventually(lambda: x.read("position") > 100, what="motion")
        assert controller.y.settle("jog_positive") == RESULT_REFUSED
        assert controller.sim("y_speed") == 0
        # The other way, as soon as it stands.
        speed["target_velocity"] *= -1
        assert x.settle("move_velocity", **speed) in (SUCCESS if hidden else (RESULT_OK,))
        eventually(lambda: controller.sim("x_speed") == speed["target_velocity"], what="speed")
    else:
        assert controller.sim("x_speed") == 0
    assert x.settle("stop") == RESULT_OK
    eventually(lambda: x.read("axis_state") == STANDSTILL, timeout=20, what="a stand")
    assert controller.sim("x_speed") == 0
    eventually(lambda: x.read("position") == controller.sim("x"), what="the place")


def outputs(controller):
    hidden = "ports" in controller.hidden
    if hidden:
        silent(controller, "f1 01 03 e4 00")
    if controller.does("output", "set_output", hidden=hidden, output_number=3, output_value=1):
        assert controller.sim("outputs") == 4
    if controller.does("output", "set_outputs", hidden=hidden, output_mask=0x82,
                       output_levels=0x80):
        assert controller.sim("outputs") == 0x84
        shown = 0 if hidden else 0x84
        eventually(lambda: controller.y.read("outputs") == shown, what="all axes to show it")


def parameters(controller):
    hidden = "lead" in controller.hidden
    result = controller.sets("lead", 2000)
    if controller.judge(result, "item", hidden) and not hidden:
        assert controller.x.read("lead") == 2000
    result = controller.sets("max_speed", 50000)
    if controller.clamps and "item" not in controller.ignored:
        assert result == RESULT_REFUSED
        assert controller.x.read("max_speed") == 20000
    elif controller.judge(result, "item"):
        assert controller.x.read("max_speed") == 50000
    result = controller.sets("min_speed", 60000)
    if (controller.clamps or controller.ordered) and "item" not in controller.ignored:
        assert result == RESULT_REFUSED
    else:
        controller.judge(result, "item")
    controller.sets("min_speed", 100)
    assert controller.x.read("counts_per_unit") > 0


def untold_programs(controller):
    x = controller.x
    silent(controller, "f4 01 03 0a 00")
    assert x.read("program_state") == 65535
    result = x.settle("start_program", program_number=2, program_delay=0)
    if "program" in controller.ignored:
        assert result == RESULT_UNPROVEN
        return
    assert result in (RESULT_UNPROVEN, RESULT_REFUSED)
    assert controller.sim("program_state") == RUNNING
    assert controller.y.settle("stop") == RESULT_OK
    eventually(lambda: x.read("axis_state") == STANDSTILL, timeout=20, what="a stand")
    assert controller.sim("program_state") != RUNNING


def programs(controller):
    x = controller.x
    if "program" in controller.hidden:
        untold_programs(controller)
        return
    assert x.settle("start_program", program_number=99, program_delay=0) not in SUCCESS
    if not controller.does("program", "start_program", program_number=2, program_delay=0):
        assert controller.sim("program_start") == 0
        return
    eventually(lambda: x.read("program") == 2 and x.read("program_step") > 1, what="its steps")
    assert controller.y.settle("jog_positive") == RESULT_REFUSED
    # Stopped, it can go on.
    assert x.settle("stop") == RESULT_OK
    eventually(lambda: x.read("program_state") == WAITING, what="a pause")
    assert controller.sim("program_state") == WAITING
    assert x.settle("continue_program") == RESULT_OK
    assert x.settle("pause_program") == RESULT_OK
    assert controller.sim("program_state") == WAITING
    known = controller.idle == IDLE
    assert x.settle("end_program") == (RESULT_OK if known else RESULT_FAILED)
    eventually(lambda: x.read("program_state") == controller.idle, what="its end")
    if known:
        assert x.read("program") == 0
    eventually(lambda: x.read("axis_state") == STANDSTILL, timeout=20, what="a stand")
    # An emergency stop, and the way out of it.
    assert x.settle("start_program", program_number=3, program_delay=0) == RESULT_OK
    assert controller.y.settle("quick_stop") == RESULT_OK
    eventually(lambda: x.read("program_state") == INTERRUPTED, what="an interruption")
    assert x.settle("clear_fault") == (RESULT_OK if known else RESULT_FAILED)
    assert controller.sim("program_state") == IDLE
    eventually(lambda: x.read("axis_state") == STANDSTILL, timeout=20, what="a stand")


@pytest.mark.parametrize("chosen", CASES)
def test_core_behaviour(make_bridge, chosen):
    bridge = temperament.start(
        make_bridge, chosen, drives=2, sim_drives=1,
        bus={"protocol": "xyza"}, sim_bus={"protocol": "xyza"},
        per_drive={1: {"address": 3, "axis": "x"}, 2: {"address": 3, "axis": "y"}},
        sim_drive={"identity": None, "address": 3, "step-ms": 50,
                   "set": ["manual_speed=2000", "brake=15", "enable=15"]})
    controller = Controller(bridge, chosen)
    for number in (1, 2):
        bridge.wait_ready(number)
    positions(controller)
    power(controller)
    jogs(controller)
    outputs(controller)
    parameters(controller)
    programs(controller)


def test_what_the_document_lacks_stays(make_bridge):
    """A bit of enable and a pause key that are not documented are in nobody's way."""
    bridge = make_bridge(
        drives=1, bus={"protocol": "xyza"}, sim_bus={"protocol": "xyza"},
        per_drive={1: {"address": 3, "axis": "x"}},
        sim_drive={"identity": None, "address": 3, "takes-any": True, "set": ["enable=1"]})
    drive = bridge.drive()
    eventually(lambda: drive.read("axis_state") == STANDSTILL, what="an enabled axis")
    bridge.sim.control("item drive1 x enable 0x10")
    bridge.sim.control("item drive1 x pause_key 0x050706")
    assert drive.settle("enable") == RESULT_OK
    assert drive.read("enable") == 0x11
    drive.write("start_key", 1)
    eventually(lambda: drive.read("write_result") == RESULT_OK, what="the write")
    assert [drive.read(name) for name in ("start_key", "stop_key", "pause_key")] == [1, 7, 5]
    assert drive.settle("disable") == RESULT_OK
    assert drive.read("enable") == 0x10


def test_what_is_silent_hides_nothing_else(make_bridge):
    """The log says what it is."""
    chosen = [one for one in TEMPERAMENTS if one.value == ["read_password"]]
    bridge = temperament.start(
        make_bridge, chosen, drives=1, bus={"protocol": "xyza"}, sim_bus={"protocol": "xyza"},
        per_drive={1: {"address": 3, "axis": "x"}},
        sim_drive={"identity": None, "address": 3, "set": ["enable=1"]})
    drive = bridge.drive()
    eventually(lambda: drive.read("axis_state") == STANDSTILL, what="an enabled axis")
    assert drive.read("lead") == 5000
    eventually(lambda: "does not report read_password;" in
               bridge.log_path.read_text(encoding="utf-8"), what="the log")


@pytest.mark.parametrize("chosen", [
    {"lacks": ["ports"]}, {"lacks": ["program"]}, {"lacks": ["ports", "program"]},
    {"idle-state": 6}], ids=str)
def test_a_stop_ends_whatever_else_is_silent(make_bridge, chosen):
    """Both are asked in each cycle, behind what a stop is judged by; and no cycle waits for it on and on."""
    bridge = make_bridge(
        drives=1, bus={"protocol": "xyza", "cycle-ms": 50}, sim_bus={"protocol": "xyza"},
        per_drive={1: {"address": 3, "axis": "x"}},
        sim_drive={"identity": None, "address": 3, "set": ["enable=1"], **chosen})
    drive = bridge.drive()
    bridge.wait_ready(1)
    assert drive.settle("jog_positive") == RESULT_OK
    eventually(lambda: drive.read("position") > 100, what="motion")
    assert drive.settle("stop") == RESULT_OK
    eventually(lambda: drive.read("axis_state") == STANDSTILL, what="a stand")
    lost = drive.read("timeouts")
    cycles(drive, 20)
    assert drive.read("timeouts") <= lost + 2
