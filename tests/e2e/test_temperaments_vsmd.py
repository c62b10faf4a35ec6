# SPDX-License-Identifier: Apache-2.0
"""VSMD drives with every temperament: whatever the documents leave open, a PLC's commands do what
their results say, on RS485 and on CAN."""

import pytest
import temperament
from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    ENABLED_BIT,
    HOMED_BIT,
    MUST_STAND_BIT,
    NO_ANSWER,
    ONLINE_BIT,
    ORIGIN_LOST_BIT,
    RESULT_OK,
    STANDSTILL,
    Refused,
    eventually,
    f32,
)
from temperament import Temperament

# A busy machine lets the simulator wait: that is not what is tested here.
LATENCY = {"drive-latency-ms": 200}
SERIAL = {"bus": LATENCY, "sim_bus": {}}
CAN = {
    "bus": {**LATENCY, "protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None,
            "baud": 3000000},
    "sim_bus": {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None,
                "baud": None},
}
BUSES = {"vsmd-serial": SERIAL, "vsmd-can": CAN}


def both(key, value, sees, **more):
    """A drive on either bus may be so."""
    return [Temperament(family, key, value, sees, **more) for family in BUSES]


def serial(key, value, sees, **more):
    return [Temperament("vsmd-serial", key, value, sees, **more)]


def can(key, value, sees, **more):
    return [Temperament("vsmd-can", key, value, sees, **more)]


WINDOW = (("in-position-window", 1),)
PATIENT = (("drive-latency-ms", 600),)

UNTOLD = ("Its parameters read as NaN and 0 beside process data and are 0B alone; writing one is `unproven` when the drive "
          "took it, and refused when not. The register outputs stays 0.")

NOT_UNDERSTOOD = "It is not online; `trouble` is not_understood, and the log shows its last frame."

TEMPERAMENTS = [
    *both("latency-us", 1000, "Nothing.", section="bus"),
    *both("latency-us", 20000, "Nothing but longer round trips.", section="bus"),
    *both("latency-us", 300000, "With the default confirm-ms every command gives 05, and its result "
          "follows. After a lost answer a stop may end with `runs_on` (04), without this.", section="bus",
          bus=PATIENT, drive=(("stop-reaction-ms", 3000),)),
    *serial("turnaround-us", 1000, "Nothing.", section="bus"),
    *serial("turnaround-us", 5000, "Nothing; how soon the drive hears is learnt in its first second.", section="bus"),
    *serial("turnaround-us", 8000, "Nothing; how soon the drive hears is learnt in its first seconds, in which a command may time "
            "out (0B).", section="bus"),
    *serial("line-hold-us", 5000, "Nothing; for how long the drive has the line is learnt.", section="bus"),
    *serial("own-turnaround-us", 3000, "Nothing; how soon the drive hears is learnt in its first second."),
    *serial("own-latency-us", 20000, "Nothing but longer round trips of this drive."),
    *serial("handshake", "any", "Nothing."),
    *can("handshake", "dev", "Nothing."),
    *both("handshake-kept", True, "Nothing; a restart is known by power, position and homing bit."),
    *both("handshake-lapses-ms", 300, "Nothing; with pae 1 a drive that stands at 0 may be told once as one that "
          "may have been restarted, with uncertain quality until it is homed or placed."),
    *both("power-delay-ms", 5, "enable and disable are answered that much later."),
    *both("power-delay-ms", 100, "enable and disable are answered that much later."),
    *both("standing-delay-ms", 20, "Motions and stops are answered that much later."),
    *both("standing-delay-ms", 100, "Motions are answered that much later, and a drive that stopped "
          "is shown as moving for so long."),
    *both("motion-delay-ms", 20, "Motions are answered that much later."),
    *both("motion-delay-ms", 100, "Motions are answered that much later."),
    *both("refusal", "kept", "Nothing."),
    *both("refusal", "once", "Nothing."),
    *both("refusal", "cleared", "A refused command ends as failed, not as refused, where the drive "
          "does not answer commands."),
    *both("clamps", True, "A value that the drive changed is refused, and its register shows what "
          "the drive holds."),
    *both("rests-off", 1, "A position that is off by one, and at_target with a window of one.",
          drive=WINDOW),
    *both("trembles", 1, "A position that trembles, and at_target with a window of one; never a restart.",
          drive=WINDOW),
    *both("speed", "unsigned", "`velocity` is never below 0, without this.", drive=(("speed-sign", "position"),)),
    *both("speed", "none", "`velocity` is always 0; a change of speed in the same direction is unproven."),
    *both("homing-bit-kept", True, "A second `home` is answered later, and fails where nobody sees the drive move."),
    *both("keeps-position", True, "Nothing: `homed` is gone with the power, and origin_lost is set, though it counts on."),
    *both("coasts", True, "axis_state is Disabled after a stop, and a doubt about the origin may be told; motions need `enable` first, when "
          "must_stand is off again."),
    *both("mirrored", True, "Motions go the other way than `position` and `velocity` say, and position moves fail (04); `drivebridgectl "
          "commission` names it.", core=False),
    *both("hides-outputs", True, "set_output ends as unproven, and the register outputs stays 0."),
    *both("ignores-broadcast", True, "Stops of all drives reach it one by one; with `group-start = "
          "broadcast` it does not start, and its command has failed."),
    *serial("text", "nul", "Nothing."),
    *serial("text", "crlf", "Nothing."),
    *serial("text", "quoted", "Nothing."),
    *serial("numbers", "exponent", "Nothing."),
    *serial("numbers", "quoted", "Nothing."),
    *serial("capitals", True, "Nothing."),
    *serial("commas", True, "Nothing."),
    *serial("text-length", 1600, "Nothing but longer reads of all parameters."),
    *serial("text-length", 8000, "Nothing but longer reads of all parameters."),
    *serial("parameters", "refused", UNTOLD),
    *serial("parameters", "silent", UNTOLD),
    *can("lacks", ["0b"], "02 for the parameters of that register."),
    *can("lacks", ["13", "19", "1b"], "02 for `dmd`, `caf` and `sds`, which no document describes."),
    *can("lacks", ["1c-2b"], "02 for the parameters of these registers."),
    *can("answers", "padded", "Nothing."),
    *can("answers", "singles", "Nothing."),
    *can("read-max", 2, "Nothing but more frames, and a later beginning."),
    *can("hides-identity", True, "An empty `identity`."),
    *[one for replies in ("host-0", "broadcast", "standard")
      for one in can("replies", replies, NOT_UNDERSTOOD, core=False)],
]

# The origin sensor is high below 0, and the drive stands above it.
DRIVE = {
    "start": 300, "sensor": ["3:below:0"],
    "set": ["sds=0.5", "zmd=1", "snr=2", "osv=0", "zsd=-6400", "spd=6400", "acc=64000", "dec=64000", "s5=1",
            "pae=0"],
}


def sets_of(family):
    return temperament.sets([one for one in TEMPERAMENTS if one.family == family], in_time)


# A bridge's default turnaround-us.
CONFIGURED_US = 1000
# What a bridge learns of a drive that does not hear after its reply is no more than this; beyond it turnaround-us has to be set.
LEARNT_MOST_US = 8000


def deaf_us(chosen):
    """How long the drive does not hear after its reply."""
    return sum(one.value for one in chosen if one.key in ("turnaround-us", "own-turnaround-us"))


def in_time(chosen):
    """Searching for what a model lacks takes many reads: not with a third of a second for each."""
    values = {one.key: one.value for one in chosen}
    return deaf_us(chosen) <= LEARNT_MOST_US and not (values.get("latency-us") == 300000 and "lacks" in values)


CASES = [pytest.param(family, chosen, id=f"{family}-{temperament.name(chosen)}")
         for family in BUSES for chosen in sets_of(family)]


class Machine:
    """A bridge with one drive whose temperament is known."""

    def __init__(self, bridge, chosen):
        self.bridge = bridge
        self.drive = bridge.drive()
        self.habits = {one.key: one.value for one in chosen}

    def simulated(self):
        return self.bridge.sim.get()

    def is_at(self, position):
        """One that trembles does so around where it is, and was when a way was counted from there."""
        off = self.drive.read("position") - position - self.habits.get("rests-off", 0)
        return 0 <= off <= 2 * self.habits.get("trembles", 0)

    def stands_at(self, position):
        """The PLC and the motor agree that it stands there."""
        eventually(lambda: self.drive.read("axis_state") == STANDSTILL and self.is_at(position),
                   what=f"the drive to stand at {position}")
        assert self.simulated()["velocity"] == 0

    def lacks(self, register):
        for text in self.habits.get("lacks", []):
            first, _, last = text.partition("-")
            if int(first, 16) <= register <= int(last or first, 16):
                return True
        return False


    def tells_parameters(self):
        return self.habits.get("parameters", "told") == "told"


def power_and_speed(machine):
    drive = machine.drive
    assert drive.command("enable") == 0
    assert drive.read("status") & ENABLED_BIT
    assert drive.command("move_velocity", target_velocity=3200) == 0
    told = 0 if machine.habits.get("speed") == "none" else 3200
    eventually(lambda: machine.simulated()["velocity"] == 3200, what="the speed")
    eventually(lambda: drive.read("velocity") == told, what="the speed to be shown")
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)
    assert drive.command("move_velocity", target_velocity=-3200) == 0
    eventually(lambda: machine.simulated()["velocity"] == -3200, what="the reversal")
    eventually(lambda: drive.read("velocity") == -told, what="the reversal to be shown")
    assert drive.command("stop") == 0
    if "coasts" in machine.habits:
        # A stop that is said again takes the power again.
        eventually(lambda: drive.read("axis_state") == DISABLED and not drive.read("status") & MUST_STAND_BIT,
                   what="the power to be seen to be gone, and the stop to be over")
        assert drive.command("enable") == 0
    eventually(lambda: drive.read("axis_state") == STANDSTILL, what="the drive to stand")
    assert machine.simulated()["velocity"] == 0


def positions(machine):
    drive = machine.drive
    off = machine.habits.get("rests-off", 0)
    assert drive.command("set_position", target_position=1000) == 0
    assert machine.is_at(1000)
    assert drive.command("move_absolute", target_position=1500, target_velocity=0) == 0
    machine.stands_at(1500)
    assert drive.command("move_relative", target_position=-200, target_velocity=0) == 0
    machine.stands_at(1300 + off)
    # There already, or within the window: hardly anything moves, and that is no failure.
    assert drive.command("move_absolute", target_position=1300 + off, target_velocity=0) == 0
    eventually(lambda: drive.read("axis_state") == STANDSTILL and machine.is_at(1300 + off) and
               machine.simulated()["velocity"] == 0, what="the drive to stand where it stood")


def homing(machine):
    drive = machine.drive
    if "homing-bit-kept" in machine.habits:
        # At its origin already it would be there again before anybody has seen it move.
        assert drive.settle("move_relative", target_position=300, target_velocity=0) == RESULT_OK
        eventually(lambda: drive.read("axis_state") == STANDSTILL)
    assert drive.settle("home") == RESULT_OK
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")
    assert not drive.read("status") & ORIGIN_LOST_BIT
    eventually(lambda: drive.read("axis_state") == STANDSTILL)


def outputs_and_parameters(machine):
    drive = machine.drive
    assert drive.command("set_output", output_number=5, output_value=1) == 0
    if "hides-outputs" not in machine.habits and machine.tells_parameters():
        eventually(lambda: drive.read("outputs") & 1 << 4, what="the output to be on")
    assert machine.simulated()["output"] >= 1
    if not machine.tells_parameters():
        assert drive.write("crn", 9.0) == (0 if "clamps" in machine.habits else DEVICE_FAILURE)
        assert drive.write("spd", 3000.5) == 0
        assert machine.simulated()["cfg_write"] >= 1
        with pytest.raises(Refused) as refusal:
            drive.read("spl")
        assert refusal.value.code == NO_ANSWER
        return
    # More than this model takes: what it holds is what the register shows.
    assert drive.write("crn", 9.0) == DEVICE_FAILURE
    eventually(lambda: drive.read("crn") == f32(2.5 if "clamps" in machine.habits else 0.6))
    assert drive.write("spd", 3000.5) == 0
    assert drive.read("spd") == f32(3000.5)
    if not machine.lacks(0x2A):
        assert drive.write("sml", -5000000) == 0
    for name, register in (("s5f", 0x0B), ("spl", 0x2B)):
        if machine.lacks(register):
            with pytest.raises(Refused):
                drive.read(name)
        else:
            assert drive.read(name) == 0


def power_off(machine):
    drive = machine.drive
    assert drive.command("disable") == 0
    assert drive.read("axis_state") == DISABLED
    assert not drive.read("status") & (ENABLED_BIT | HOMED_BIT)
    moves = machine.simulated()["pos"]
    assert drive.command("move_absolute", target_position=10, target_velocity=0) == DEVICE_FAILURE
    assert machine.simulated()["pos"] == moves


def power_cut(machine):
    """Too short to be noticed as silence."""
    drive = machine.drive
    assert drive.command("enable") == 0
    homing(machine)
    machine.bridge.sim.control("power drive1 cycle")
    eventually(lambda: drive.read("status") & (HOMED_BIT | ORIGIN_LOST_BIT) == ORIGIN_LOST_BIT,
               what="the origin to be lost")


@pytest.mark.parametrize("family, chosen", CASES)
def test_core_behaviour(make_bridge, family, chosen):
    # One that rests off and trembles is two counts off now and then.
    off = sum(one.value for one in chosen if one.key in ("rests-off", "trembles"))
    options = temperament.options(chosen, sim_drive=DRIVE, modbus={"confirm-ms": 9000}, wait_online=False, **BUSES[family])
    options["drive"]["in-position-window"] = off
    bridge = make_bridge(**options)
    # With so long for each answer, reading all parameters takes its time.
    if any(one.key == "parameters" for one in chosen):
        eventually(lambda: bridge.drive().read("status") & ONLINE_BIT, what="the drive to be online")
        # Until then commands may time out.
        eventually(lambda: deaf_us(chosen) <= CONFIGURED_US or bridge.drive().read("learnt_gap_us") >= deaf_us(chosen),
                   timeout=40, what="how soon it hears to be learnt")
    else:
        bridge.wait_ready(1, 40)
    machine = Machine(bridge, chosen)
    drive = machine.drive
    told = "" if "hides-identity" in machine.habits else "VSMD113_025T-1.0.008.17042"
    eventually(lambda: drive.read("identity")[:len(told) or None] == told, what="the identity")
    if machine.tells_parameters():
        assert drive.read("spd") == f32(6400)
        if not machine.lacks(0x1B):
            assert drive.read("sds") == f32(0.5)
    power_and_speed(machine)
    positions(machine)
    homing(machine)
    outputs_and_parameters(machine)
    power_off(machine)
    power_cut(machine)
