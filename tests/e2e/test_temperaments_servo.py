# SPDX-License-Identifier: Apache-2.0
"""CAN servos with every temperament: whatever the document leaves open, a PLC's commands do what their
results say, and nothing moves by itself."""

import time

import pytest
import temperament
from bridgelib import (
    AT_TARGET_BIT,
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    DISCRETE,
    ENABLED_BIT,
    ERROR_STOP,
    MOVING_BIT,
    NO_ANSWER,
    RESULT_OK,
    STANDSTILL,
    code,
    eventually,
)
from temperament import Temperament

FAMILY = "servo-can"
CAN = {"protocol": FAMILY, "transport": "slcan", "bitrate": 1000000, "line": None}
WORDS = {"command-word-base": 160, "command-word-length": 4, "command-word-0-at": 0,
         "command-word-1-at": 2, "command-word-ack": 7}
# Counts that a drive may rest beside a target here, and that trembling makes.
WINDOW = 6


# Frames that no page shows, the same for the bridge and the simulator.
OWN_WORDS = (("command-word-length", 2), ("command-word-1-length", 3), ("command-word-1-at", 1),
             ("command-word-1-fixed", 0x5A), ("command-word-1-ack", 8))
SLOT = (("position-slot-base", 0x120), ("position-slot-ack", 11))
LOW_FIRST = (("move-frame-length", 5), ("move-frame-at", 1), ("move-frame-bytes", 3), ("move-frame-order", "low-first"),
             ("move-frame-fixed", 0x0A5A), ("move-frame-ack", 3))
SILENT = (("move-frame-length", 5), ("move-frame-at", 1), ("move-frame-fixed", 3), ("move-frame-ack", 0))


def one(key, value, sees, **more):
    return Temperament(FAMILY, key, value, sees, **more)


TEMPERAMENTS = [
    one("answer-length", "eight", "Nothing."),
    one("answer-length", "mixed", "Nothing."),
    one("answer-length", "short", "It is not online; `trouble` is not_understood, and the log shows its last frame.", core=False),
    one("padded", True, "It does not answer (0B), without this.", section="bus", bus=(("padded", "yes"),)),
    one("ack-latency-us", 20000, "Commands are answered later."),
    one("fault-power", "kept",
        "Nothing begins when the fault is gone: the bridge took the power off, see `on-fault`."),
    one("fault-power", "resumes", "The same."),
    one("demand", "kept", "Nothing."),
    one("demand", "triggered", "Nothing."),
    one("demand", "moved",
        "`enable` after a position move fails (04) and takes the power off again, without this.",
        drive=(("mode", "speed"),)),
    one("reached-bit", "profile", "Nothing: `at_target` and `done` come from the position."),
    one("zero-speed-rpm", 30.0, "Nothing: `moving` comes from the speed."),
    one("setpoints", "in-mode",
        "An `enable` takes longer, by some `drive-latency-ms`, while the bridge knows no mode."),
    one("dither", 2.0,
        "`position` trembles while it is held; a move to the count is done only by chance.",
        drive=(("in-position-window", WINDOW),)),
    one("motion-delay-ms", 100, "Motions are answered later, or with 05."),
    one("motion-delay-ms", 400,
        "Position moves fail (04) and take the power off, and speeds are unproven, without this.",
        drive=(("reaction-ms", 600),)),
    one("power-ms", 100, "`enable` and `disable` are answered later, or with 05."),
    one("power-ms", 300,
        "`enable` fails (04) and takes the power off again, and `disable` fails though the drive "
        "obeys, without this.",
        drive=(("reaction-ms", 500),)),
    one("command-word-ack", 0, "Nothing.", section="bus", bus=(("command-word-ack", 0),)),
    one("command-word-1-base", 0xC0,
        "Position moves and writes of the command words time out (0B), without this.", section="bus",
        sim_bus=OWN_WORDS, bus=(("command-word-1-base", 0xC0), *OWN_WORDS)),
    one("position-slot", 5,
        "No motor gets power: `enable` times out (0B), without this.", section="bus",
        sim_bus=SLOT, bus=(("position-slot", 5), *SLOT)),
    one("move-frame-base", 0x120,
        "move_absolute and move_relative are answered 01, without this.", section="bus",
        sim_bus=LOW_FIRST, sim_drive=(("move-step", 10.0),),
        bus=(("move-frame-base", 0x120), *LOW_FIRST, ("move-frame-scale", 10)),
        drive=(("in-position-window", WINDOW),)),
    one("move-frame-base", 0x60,
        "move_absolute and move_relative are answered 01, without this.", section="bus",
        sim_bus=SILENT, sim_drive=(("moves", "relative"),),
        bus=(("move-frame-base", 0x60), *SILENT, ("move-frame-target", "relative"))),
    one("status-places", "3--------5012---",
        "`enable` fails (04) and takes the power off again, without this.",
        sim_drive=(("status-inverted", 0x0108), ("moving-bit", 8)),
        drive=(("enabled-bit", 3), ("fault-bit", 0), ("standstill-bit", -1), ("overload-bit", 5), ("homed-bit", -1),
               ("warning-bit", -1), ("reverse-bit", -1), ("forward-bit", -1), ("moving-bit", 8),
               ("status-inverted", 0x0108))),
    one("status-places", "0123b5678-a4cdef",
        "Nothing; with this `at_target` waits for the drive's own bit, too.",
        drive=(("target-bit", 11), ("overload-bit", -1))),
    one("mirrored", True,
        "`position` falls while `velocity` is above 0, and position moves fail (04) and take the power off, without this.",
        drive=(("position-sign", "reversed"),)),
    one("demand-step", -4.0,
        "Position moves fail, some of them after they went elsewhere, without this.",
        drive=(("position-command-scale", -4), ("in-position-window", WINDOW))),
    one("speed-step", -0.5,
        "`velocity` is not the motor's, and speeds are unproven, without this.",
        sim_drive=(("setpoint-step", 0.25),), drive=(("speed-scale", -0.5), ("speed-command-scale", 0.25))),
    one("current-step", -0.01,
        "`current` is not the motor's, and target_current is another one, without this.",
        sim_drive=(("current-setpoint-step", 0.02),),
        drive=(("current-scale", -0.01), ("current-command-scale", 0.02))),
    one("counts-anew", True,
        "Nothing: with the drive's power its origin is lost, and origin_lost is set."),
    one("ignores-broadcast", True,
        "With `group-start = broadcast` it does not start, and its command has failed."),
    one("report-position-ms", 0, "Nothing: what is not reported is asked for."),
    one("report-motion-ms", 10, "Nothing."),
    one("stray-acks", True, "Nothing."),
    one("speed-sign", "bits",
        "The sign of `velocity` is missing, and motions backwards are unproven, without this.",
        drive=(("speed-sign", "bits"),)),
]

# Reports of faults five times a second, so that nobody waits for them; 10 ms cycles.
SIM_DRIVE = {"identity": None, "set": None, "report-health-ms": 100}


@pytest.fixture(name="make_servo")
def fixture_make_servo(make_bridge):
    def make(chosen, **drive):
        words = {} if any(one.key == "move-frame-base" for one in chosen) else WORDS
        return temperament.start(
            make_bridge, chosen, bus={**CAN, **words, "cycle-ms": 10, "baud": 3000000},
            sim_bus={**CAN, **words, "baud": None}, drive={"in-position-window": 1, **drive},
            sim_drive=SIM_DRIVE)

    return make


def agree(chosen):
    """A drive that is moved by a frame of its own has no command words, and no CTRG that takes its demand."""
    values = {one.key: one.value for one in chosen}
    if "move-frame-base" in values and ({"command-word-ack", "command-word-1-base", "position-slot", "demand-step"} & values.keys() or
                                        values.get("demand") in ("triggered", "moved")):
        return False
    # A speed without a sign has none that could be the other one; and its bits have to be somewhere.
    return not ("speed-sign" in values and ("speed-step" in values or values.get("status-places", "").startswith("3")))


CASES = [pytest.param(chosen, id=temperament.name(chosen)) for chosen in temperament.sets(TEMPERAMENTS, agree)]


def motor(bridge):
    return float(bridge.sim.get()["position"])


def velocity(bridge):
    return float(bridge.sim.get()["velocity"])


def state(bridge, wanted):
    eventually(lambda: bridge.drive().read("axis_state") == wanted, what=f"state {wanted}")


def rests_at(bridge, position, off=WINDOW):
    drive = bridge.drive()
    eventually(lambda: drive.read("axis_state") == STANDSTILL and
               drive.read("status") & AT_TARGET_BIT, what=f"rest at {position}")
    assert abs(drive.read("position") - position) <= off
    assert abs(motor(bridge) - position) <= off
    eventually(lambda: drive.read("motion_result") == RESULT_OK, what="the motion's result")


def power_and_speed(bridge):
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.read("status") & ENABLED_BIT
    assert drive.command("move_velocity", target_velocity=-600) == 0
    assert drive.read("result") == RESULT_OK
    eventually(lambda: abs(velocity(bridge) + 600) < 5, what="full speed")
    state(bridge, CONTINUOUS)
    # Slow is a motion, too.
    assert drive.command("move_velocity", target_velocity=20) == 0
    eventually(lambda: abs(velocity(bridge) - 20) < 2, what="the slow speed")
    eventually(lambda: abs(drive.read("velocity") - 20) < 2, what="the slow speed, as read")
    assert drive.read("status") & MOVING_BIT
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    eventually(lambda: velocity(bridge) == 0, what="the motor to stand")
    assert drive.command("move_current", target_current=1.0) == 0
    eventually(lambda: velocity(bridge) > 50, what="acceleration")
    assert drive.command("disable") == 0
    assert not drive.read("status") & ENABLED_BIT
    eventually(lambda: velocity(bridge) == 0, what="the motor to run out", timeout=30)
    eventually(lambda: drive.read("velocity") == 0, what="the speed to be read")


def positions(bridge):
    drive = bridge.drive()
    assert drive.command("set_position", target_position=1000) == 0
    assert drive.read("result") == RESULT_OK
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=21000, target_velocity=0) == 0
    assert drive.read("result") == RESULT_OK
    rests_at(bridge, 21000)
    assert drive.command("move_relative", target_position=-500, target_velocity=0) == 0
    # Counted from where it rested, which may be beside the target already.
    rests_at(bridge, 20500, 3 * WINDOW)
    # The origin is set anew: nothing jumps when the motor has its power again.
    assert drive.command("disable") == 0
    assert drive.command("set_position", target_position=0) == 0
    assert drive.command("enable") == 0
    for _ in range(20):
        assert abs(motor(bridge)) <= WINDOW
    assert drive.command("move_absolute", target_position=900, target_velocity=0) == 0
    rests_at(bridge, 900)


def fault(bridge):
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=300) == 0
    bridge.sim.control("faults drive1 0x1")
    state(bridge, ERROR_STOP)
    assert drive.command("move_velocity", target_velocity=800) == DEVICE_FAILURE
    assert drive.command("move_absolute", target_position=0, target_velocity=0) == DEVICE_FAILURE
    eventually(lambda: not bridge.sim.get()["enabled"], what="the power to be taken off")
    bridge.sim.control("faults drive1 0")
    state(bridge, DISABLED)
    eventually(lambda: velocity(bridge) == 0, what="the motor to run out", timeout=30)
    assert drive.command("enable") == 0
    state(bridge, STANDSTILL)
    assert velocity(bridge) == 0


@pytest.mark.parametrize("chosen", CASES)
def test_core_behaviour(make_servo, chosen):
    bridge = make_servo(chosen)
    power_and_speed(bridge)
    positions(bridge)
    fault(bridge)


def test_ctrg_without_effect_is_no_success(make_servo):
    ignored = one("trigger", "ignored", "")
    bridge = make_servo((ignored,))
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=5000, target_velocity=0) == DEVICE_FAILURE
    assert not drive.read("status") & AT_TARGET_BIT
    assert motor(bridge) == 0
    # It could have been slow, and begun yet.
    state(bridge, DISABLED)


@pytest.mark.parametrize("reaction", ["none", "stop", "disable"])
def test_nothing_goes_on_when_a_fault_is_gone(make_servo, reaction):
    """A drive that keeps power and speed through a fault, and reports that only after a second."""
    kept = one("fault-power", "kept", "")
    bridge = make_servo((kept,), **{"on-fault": reaction})
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=800) == 0
    bridge.sim.control("faults drive1 0x1")
    state(bridge, ERROR_STOP)
    eventually(lambda: velocity(bridge) == 0, what="the motor to stand")
    bridge.sim.control("faults drive1 0")
    state(bridge, DISABLED if reaction == "disable" else STANDSTILL)
    assert velocity(bridge) == 0


def test_a_bridge_that_comes_back_finds_an_old_speed(make_servo):
    """What the bridge before it left in the drive does not run when the motor gets its power."""
    bridge = make_servo((), **{"on-exit": "disable"})
    assert bridge.drive().command("enable") == 0
    assert bridge.drive().command("move_velocity", target_velocity=800) == 0
    bridge.restart_bridge()
    state(bridge, DISABLED)
    eventually(lambda: velocity(bridge) == 0, what="the motor to run out", timeout=30)
    assert bridge.drive().command("enable") == 0
    state(bridge, STANDSTILL)
    assert velocity(bridge) == 0


def stays(bridge, position=None, off=0, seconds=0.7):
    """For longer than anything of this drive takes to begin, here and by default."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        assert velocity(bridge) == 0
        assert position is None or abs(motor(bridge) - position) <= off


@pytest.mark.parametrize("reaction", ["none", "stop", "disable"])
@pytest.mark.parametrize("reports", ["0", "60000"])
@pytest.mark.parametrize("power", ["kept", "resumes"])
def test_a_fault_between_two_reports(make_servo, reaction, reports, power):
    """A drive that keeps power and speed through a fault whose reason it does not report in time."""
    bridge = make_servo((one("fault-power", power, ""),), **{"on-fault": reaction})
    drive = bridge.drive()
    bridge.sim.control(f"reports drive1 100 100 {reports}")
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=300) == 0
    bridge.sim.control("faults drive1 0x1")
    state(bridge, ERROR_STOP)
    assert drive.read("error") == code("error", "unexplained_fault")
    assert drive.command("move_velocity", target_velocity=800) == DEVICE_FAILURE
    eventually(lambda: velocity(bridge) == 0, what="the motor to stand")
    if reaction == "disable":
        eventually(lambda: not bridge.sim.get()["enabled"], what="the power to be taken off")
    bridge.sim.control("faults drive1 0")
    state(bridge, DISABLED if reaction == "disable" else STANDSTILL)
    stays(bridge)


@pytest.mark.parametrize("demand", ["position", "kept", "triggered"])
@pytest.mark.parametrize("enabled", [True, False])
def test_a_reset_that_is_too_short_to_be_missed(make_servo, demand, enabled):
    """Mode, speed and demand are the drive's own again, and it never fell silent."""
    bridge = make_servo((one("demand", demand, ""),),
                        **{"ramp-acceleration": 5000, "ramp-deceleration": 5000})
    drive = bridge.drive()
    online = drive.read("came_online")
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=600) == 0
    eventually(lambda: motor(bridge) > 5000, what="some way")
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    eventually(lambda: velocity(bridge) == 0, what="the motor to stand")
    if not enabled:
        assert drive.command("disable") == 0
    place = motor(bridge)
    told = bridge.sim.get()["ramps"]
    bridge.sim.control("power drive1 cycle")
    state(bridge, DISABLED)
    assert drive.command("enable") == 0
    assert bridge.sim.get()["ramps"] > told
    stays(bridge, place)
    assert drive.command("move_velocity", target_velocity=60) == 0
    assert drive.read("result") == RESULT_OK
    assert drive.read("came_online") == online


@pytest.mark.parametrize(("demand", "mode"), [("triggered", "unknown"), ("moved", "speed")])
def test_a_demand_that_only_ctrg_loads(make_servo, demand, mode):
    bridge = make_servo((one("demand", demand, ""),), mode=mode)
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=9000, target_velocity=0) == 0
    rests_at(bridge, 9000)
    assert drive.command("disable") == 0
    assert drive.command("set_position", target_position=0) == 0
    assert drive.command("enable") == 0
    state(bridge, STANDSTILL)
    stays(bridge, 0)


def test_a_motor_that_jumps_when_it_gets_power(make_servo):
    """Its demand is one that nobody can change without power: it does not keep the power."""
    bridge = make_servo((one("demand", "moved", ""),))
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=50000, target_velocity=0) == 0
    rests_at(bridge, 50000)
    assert drive.command("disable") == 0
    assert drive.command("set_position", target_position=0) == 0
    assert drive.command("enable") == DEVICE_FAILURE
    assert drive.read("result") == code("result", "failed")
    state(bridge, DISABLED)
    eventually(lambda: velocity(bridge) == 0, what="the motor to run out", timeout=30)
    assert abs(motor(bridge)) < 25000
    stays(bridge)


@pytest.mark.parametrize("command", ["move_absolute", "move_relative"])
def test_a_move_that_has_failed_does_not_begin(make_servo, command):
    """The drive begins 400 ms behind CTRG, and reaction-ms is 200."""
    bridge = make_servo((one("motion-delay-ms", 400, ""),))
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command(command, target_position=50000, target_velocity=0) == DEVICE_FAILURE
    assert drive.read("result") == code("result", "failed")
    assert motor(bridge) == 0
    state(bridge, DISABLED)
    stays(bridge, 0)
    # With its power back there is nothing left of it.
    assert drive.command("enable") == 0
    stays(bridge, 0)


def test_a_late_move_may_be_followed(make_servo):
    bridge = make_servo((one("motion-delay-ms", 400, ""),), **{"late-move": "follow"})
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=50000, target_velocity=0) == NO_ANSWER
    assert drive.read("result") == code("result", "indeterminate")
    state(bridge, DISCRETE)
    eventually(lambda: drive.read("axis_state") == STANDSTILL and
               drive.read("status") & AT_TARGET_BIT, what="the target")
    assert abs(motor(bridge) - 50000) <= WINDOW


@pytest.mark.parametrize("bit", ["fault", "alarm"])
def test_an_error_bit_that_no_report_explains(make_servo, bit):
    """Some drives may set bit 10 for a mere alarm: that has to be said."""
    bridge = make_servo((), **{"error-bit": bit})
    drive = bridge.drive()
    bridge.sim.control("bits drive1 0x400")
    if bit == "fault":
        state(bridge, ERROR_STOP)
        stays(bridge)
        assert drive.read("axis_state") == ERROR_STOP
        bridge.sim.control("bits drive1 0")
        state(bridge, DISABLED)
        return
    # Until the next report, that is.
    eventually(lambda: drive.read("drive_status") & 0x400 and
               drive.read("axis_state") == DISABLED, what="the report")
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=60) == 0
    state(bridge, CONTINUOUS)
