# SPDX-License-Identifier: Apache-2.0
"""XYZA controllers: four axes are four drives with a unit each, what the controller has in common is
seen at all of them, and the sign of a position is right while it crosses zero."""

import struct
import time

import pytest
from bridgelib import (
    ACKNOWLEDGE,
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    ERROR_STOP,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    OFFLINE,
    ONLINE_BIT,
    RESULT_INDETERMINATE,
    RESULT_OK,
    RESULT_REFUSED,
    RESULT_UNPROVEN,
    STANDSTILL,
    Raw,
    Refused,
    code,
    eventually,
)

AXES = "xyza"
NUMBER = 3  # the controller's
IDLE, RUNNING, WAITING, INTERRUPTED = range(4)

# What the cyclic reading asks: position, sign and state of an axis, ports, program.
POLLS = ("F10103E1", "F10103E400", "F401030A00")


@pytest.fixture(name="make_xyza")
def fixture_make_xyza(make_bridge):
    def make(controllers=1, axes=AXES, bus=None, sim_bus=None, sim_drive=None, **options):
        places = [(NUMBER + c, axis) for c in range(controllers) for axis in axes]
        return make_bridge(
            drives=len(places), sim_drives=controllers,
            bus={"protocol": "xyza", **(bus or {})},
            sim_bus={"protocol": "xyza", **(sim_bus or {})},
            per_drive={n + 1: {"address": address, "axis": axis}
                       for n, (address, axis) in enumerate(places)},
            sim_drive={"identity": None, "step-ms": 50,
                       "set": ["manual_speed=2000", "brake=15", "enable=15"],
                       **(sim_drive or {})},
            sim_per_drive={c + 1: {"address": NUMBER + c} for c in range(controllers)},
            **options)

    return make


@pytest.fixture(name="xyza")
def fixture_xyza(make_xyza):
    return make_xyza()


def requests(bridge):
    """All that was sent, in hexadecimal without header, mark and sum."""
    frames = []
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        parts = line.split(" |")[0].split(" ")
        if len(parts) > 6 and parts[2] == ">":
            frames.append("".join(parts[6:-1]).upper())
    return frames


def without_turns(sent, wanted):
    """Without the items that are read again from time to time."""
    rest, kept = list(wanted), []
    for frame in sent:
        if rest and frame == rest[0]:
            rest.pop(0)
        elif len(frame) == 10 and frame[6:8] in ("E2", "E3", "E5"):
            continue
        kept.append(frame)
    return kept


def sends(bridge, number, name, *wanted, exception=0, **args):
    """Writes a command; these frames went out because of it."""
    mark = len(requests(bridge))
    assert bridge.drive(number).command(name, **args) == exception
    sent = without_turns(
        [frame for frame in requests(bridge)[mark:] if not frame.startswith(POLLS)], wanted)
    if name in ("stop", "quick_stop"):  # said again until the axis stands
        assert sent[:len(wanted)] == list(wanted)
        assert set(sent[len(wanted):]) <= set(wanted)
        return
    assert sent == list(wanted)


def state(bridge, wanted, number=1):
    eventually(lambda: bridge.drive(number).read("axis_state") == wanted, what=f"state {wanted}")


def stand(bridge, number=1):
    assert bridge.drive(number).command("stop") == 0
    state(bridge, STANDSTILL, number)


def place(bridge, axis, position):
    bridge.sim.control(f"place drive1 {axis} {position}")
    eventually(lambda: bridge.drive(AXES.index(axis) + 1).read("position") == position)


def program_state(bridge, wanted):
    eventually(lambda: bridge.drive().read("program_state") == wanted,
               what=f"program state {wanted}")


# --- reading -----------------------------------------------------------------------------------------


def bit(drive, name):
    rows = drive.map.of_drive("discrete", family="xyza")
    row = next(row for row in rows if row.name == f"drive_{name}")
    return drive.client.read_discrete_inputs(row.address, count=1, device_id=drive.number).bits[0]


def test_bits_of_drive_status_are_discrete_inputs(xyza):
    drive = xyza.drive(1)
    for position in (-700, 700):
        place(xyza, "x", position)
        assert bit(drive, "negative") == (position < 0)
    assert bit(drive, "stands")
    assert drive.command("jog_positive") == 0
    assert not bit(drive, "stands")
    stand(xyza)
    assert bit(drive, "stands")


def test_axes_are_drives(xyza):
    for number, axis in enumerate(AXES, 1):
        place(xyza, axis, 1000 * number * (-1) ** number)
    for number in range(1, 5):
        drive = xyza.drive(number)
        assert drive.read("position") == 1000 * number * (-1) ** number
        assert drive.read("axis_state") == STANDSTILL
        # 3200 pulses to a turn of 5 mm: nothing of it is in the configuration.
        assert drive.read("counts_per_unit") == 640
        assert drive.read("position_units") == 1000 * number * (-1) ** number / 640


def test_what_is_common_is_seen_at_all_axes(xyza):
    xyza.sim.control("input drive1 1 1")
    xyza.sim.control("input drive1 16 1")
    assert xyza.drive(4).command("set_output", output_number=2, output_value=1) == 0
    assert xyza.drive(2).command("set_outputs", output_mask=0xF0, output_levels=0xA0) == 0
    for number in range(1, 5):
        drive = xyza.drive(number)
        eventually(lambda drive=drive: drive.read("inputs") == 0x8001)
        eventually(lambda drive=drive: drive.read("outputs") == 0xA2)
    assert xyza.sim.get()["outputs"] == 0xA2


def test_a_controller_is_polled_once_for_all_its_axes(xyza):
    def counts():
        values = xyza.sim.get()
        return values["read_ports"], values["read_program"], values["read_standing"]

    before = counts()
    eventually(lambda: counts()[0] >= before[0] + 20)
    ports, programs, standing = (now - then for now, then in zip(counts(), before))
    assert abs(programs - ports) <= 1
    assert abs(standing - 4 * ports) <= 4


def test_two_controllers_have_axes_of_their_own(make_xyza):
    bridge = make_xyza(controllers=2)
    # One axis of each at a time.
    assert bridge.drive(1).command("jog_positive") == 0
    assert bridge.drive(6).command("jog_negative") == 0
    eventually(lambda: bridge.drive(1).read("position") > 300)
    eventually(lambda: bridge.drive(6).read("position") < -300)
    stand(bridge, 1)
    assert bridge.drive(6).read("axis_state") == CONTINUOUS
    stand(bridge, 6)
    for number in (2, 3, 4, 5, 7, 8):
        assert bridge.drive(number).read("position") == 0


@pytest.mark.parametrize("speed", [50, 700, 6000])
def test_the_sign_is_right_while_zero_is_crossed(make_xyza, speed):
    """Half a cycle lies between the two reads that make a position: what is shown never goes the
    other way, and never leaves the way that is gone."""
    bridge = make_xyza(axes="x", sim_bus={"latency-us": 4000})
    drive = bridge.drive()
    end = max(4, speed // 4)
    seen = set()
    place(bridge, "x", -end)
    for turn in range(4):
        way = -1 if turn % 2 else 1
        last = drive.read("position")
        assert drive.command("move_velocity", target_velocity=way * speed) == 0

        def arrived(way=way):
            nonlocal last
            position = drive.read("position")
            assert (position - last) * way >= 0, (last, position)
            seen.add(position)
            last = position
            return position * way >= end

        eventually(arrived)
        stand(bridge)
        assert drive.read("position") == bridge.sim.get()["x"]
    assert min(seen) < 0 < max(seen)


def test_a_position_is_set_without_showing_another(xyza):
    drive = xyza.drive()
    last = 0
    for position in (1000, -1000, -20, 30, 0, -5, 5, 0):
        seen = set()
        assert drive.command("set_position", target_position=position) == 0
        assert drive.read("position") == position
        eventually(lambda seen=seen: seen.add(drive.read("position")) or len(seen) > 1 or
                   xyza.sim.get()["x"] == position)
        assert seen <= {last, 0, position}
        assert xyza.sim.get()["x"] == position
        last = position


# --- manual mode ---------------------------------------------------------------------------------------


def test_commands_in_frames(xyza):
    # The manual speed is that already: nothing is written.
    sends(xyza, 1, "move_velocity", "F10103E2A4", "F3010303A1", target_velocity=2000)
    state(xyza, CONTINUOUS)
    eventually(lambda: xyza.drive().read("velocity") > 1000, what="speed")
    sends(xyza, 1, "stop", "F301030200", "F401030200")
    state(xyza, STANDSTILL)
    assert xyza.drive().read("velocity") == 0
    sends(xyza, 4, "jog_negative", "F3010303A8")
    eventually(lambda: xyza.drive(4).read("position") < -100)
    sends(xyza, 4, "quick_stop", "F301030100", "F401030200")
    state(xyza, STANDSTILL, 4)
    assert xyza.drive(4).read("position") == xyza.sim.get()["a"]
    sends(xyza, 4, "set_position", "F3010304A7", target_position=0)
    assert xyza.drive(4).read("position") == 0
    sends(xyza, 2, "disable", "F10103E5C1", "F10103E5C10D000000", "F10103E5C1")
    state(xyza, DISABLED, 2)
    eventually(lambda: xyza.drive(1).read("enable") == 0x0D)
    sends(xyza, 2, "enable", "F10103E5C1", "F10103E5C10F000000", "F10103E5C1")
    sends(xyza, 2, "enable", "F10103E5C1")
    state(xyza, STANDSTILL, 2)


def test_another_speed_the_same_way(make_xyza):
    """Nothing stops. That the drive goes at the new speed its velocity tells."""
    bridge = make_xyza(axes="x")
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=500) == 0
    eventually(lambda: drive.read("position") > 50)
    mark = len(requests(bridge))
    assert drive.settle("move_velocity", target_velocity=1500) == RESULT_OK
    assert bridge.sim.get()["x_speed"] == 1500
    assert not [frame for frame in requests(bridge)[mark:] if frame.startswith("F3010302")]
    # A little more it cannot be told from its positions.
    assert drive.settle("move_velocity", target_velocity=1600) == RESULT_UNPROVEN
    stand(bridge)


@pytest.mark.parametrize("axes", ["x", "xyza"])
def test_another_speed_that_is_ignored_has_failed(make_xyza, axes):
    bridge = make_xyza(axes=axes, sim_drive={"latches-speed": True})
    drive = bridge.drive()
    assert drive.settle("move_velocity", target_velocity=500) == RESULT_OK
    eventually(lambda: 400 < drive.read("velocity") < 600, what="speed")
    assert drive.settle("move_velocity", target_velocity=2000) == code("result", "failed")
    eventually(lambda: bridge.sim.get()["x_speed"] == 0, what="a stand")


def test_another_speed_from_a_stand(make_xyza):
    bridge = make_xyza(axes="x", bus={"jog-speed-change": "standing"})
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=500) == 0
    eventually(lambda: drive.read("position") > 50)
    mark = len(requests(bridge))
    assert drive.settle("move_velocity", target_velocity=1500) == RESULT_OK
    assert [frame for frame in requests(bridge)[mark:] if frame.startswith("F3010302")]
    stand(bridge)


def test_one_axis_is_disabled_while_another_moves(xyza):
    assert xyza.drive(2).command("jog_positive") == 0
    sends(xyza, 1, "disable", "F10103E5C1", "F10103E5C10E000000", "F10103E5C1")
    state(xyza, DISABLED, 1)
    assert xyza.sim.get()["y_speed"] > 0
    assert xyza.drive(2).read("axis_state") == CONTINUOUS
    # One that moves is stopped before.
    assert xyza.drive(2).command("disable") == 0
    state(xyza, DISABLED, 2)
    assert xyza.sim.get()["y_speed"] == 0


def test_the_other_way_is_gone_from_a_stand(xyza):
    drive = xyza.drive()
    assert drive.command("move_velocity", target_velocity=2000) == 0
    eventually(lambda: drive.read("position") > 200)
    assert drive.command("move_velocity", target_velocity=-1500) == 0
    eventually(lambda: xyza.sim.get()["x_speed"] == -1500)
    assert drive.read("manual_speed") == 1500
    assert xyza.sim.get()["failed"] == 0
    stand(xyza)


def test_who_waits_for_a_stand_leaves_the_bus_to_others(make_xyza):
    """Brakes may take seconds, in which the status of all axes is read as ever."""
    bridge = make_xyza(axes="xy", bus={"cycle-ms": 40}, sim_drive={"braking-ms": 6000},
                       modbus={"confirm-ms": 40})
    drive, other = bridge.drive(1), bridge.drive(2)
    assert drive.settle("move_velocity", target_velocity=6000) == RESULT_OK
    eventually(lambda: bridge.sim.get()["x_speed"] == 6000)
    assert drive.command("move_velocity", target_velocity=0) == ACKNOWLEDGE
    ages = []
    eventually(lambda: ages.append(other.read("age_ms")) or drive.read("velocity") < 3000,
               what="slower", timeout=20)
    # Behind the questions of who waits, of which a cycle holds ten, a round took more than 400 ms.
    assert len(ages) > 10
    assert max(ages) < 200


def test_one_axis_moves_at_a_time(xyza):
    assert xyza.drive(1).command("jog_positive") == 0
    for number in (2, 3, 4):
        assert xyza.drive(number).command("jog_positive") == DEVICE_FAILURE
        assert xyza.drive(number).read("result") == RESULT_REFUSED
    stand(xyza, 1)
    assert xyza.drive(2).command("jog_positive") == 0
    assert xyza.drive(1).command("move_velocity", target_velocity=5) == DEVICE_FAILURE
    # Whoever says stop means the controller.
    stand(xyza, 3)
    state(xyza, STANDSTILL, 2)
    assert xyza.sim.get()["y_speed"] == 0


def test_a_jog_does_not_pass_a_limit(make_xyza):
    """The limits are in mm, because the controller tells how many pulses one has: 640."""
    bridge = make_xyza(axes="x", drive={"min-position": -1.0, "max-position": 4.0})
    drive = bridge.drive()
    assert bytes(drive.read("unit_name"), "ascii") == b"mm"
    for name, limit, end in (("jog_positive", 2, 4.0), ("jog_negative", 1, -1.0)):
        for _ in range(2):
            assert drive.settle(name) == RESULT_OK
            eventually(lambda limit=limit: drive.read("result_limit") == limit, what="a limit")
            state(bridge, STANDSTILL)
            eventually(lambda: drive.read("position") == bridge.sim.get()["x"])
            assert abs(drive.read("position_units")) <= abs(end)
            assert abs(drive.read("position_units") - end) < 1.0
            # Its braking way is measured to where it is seen to stand, which is not where it is put.
            stood = drive.read("timestamp_us")
            eventually(lambda stood=stood: drive.read("timestamp_us") > stood + 300000)
            place(bridge, "x", 1280)
    # Beyond it there is only the way back.
    place(bridge, "x", 3000)
    assert drive.command("jog_positive") == ILLEGAL_VALUE
    assert drive.settle("jog_negative") == RESULT_OK
    stand(bridge)


def test_a_limit_holds_when_somebody_has_set_the_brake(make_xyza):
    """It takes its way to stand then, and that is read before the jog begins."""
    bridge = make_xyza(axes="x", drive={"max-position": 4.0},
                       sim_drive={"set": ["manual_speed=2000", "brake=0", "enable=15"]})
    drive = bridge.drive()
    assert drive.read("brake") == 0
    bridge.sim.control("item drive1 x acceleration_time 20")
    bridge.sim.control("item drive1 x brake 15")
    assert drive.settle("jog_positive") == RESULT_OK
    assert drive.read("brake") == 15
    state(bridge, STANDSTILL)
    assert drive.read("result_limit") == 2
    assert 1.0 < bridge.sim.get()["x"] / 640 <= 4.0


def test_what_is_changed_at_the_controller_shows(make_xyza):
    bridge = make_xyza(axes="xy", bus={"cycle-ms": 20})
    x, y = bridge.drive(1), bridge.drive(2)
    state(bridge, STANDSTILL)
    bridge.sim.control("item drive1 x enable 2")
    state(bridge, DISABLED)
    assert y.read("axis_state") == STANDSTILL
    assert x.read("enable") == y.read("enable") == 2
    bridge.sim.control("item drive1 y manual_speed 777")
    eventually(lambda: y.read("manual_speed") == 777, timeout=60, what="the speed")
    assert x.read("manual_speed") == 2000


def test_what_the_family_does_not_have(xyza):
    drive = xyza.drive()
    for name, args in (("move_absolute", {"target_position": 5, "target_velocity": 0}),
                       ("move_relative", {"target_position": 5, "target_velocity": 0}),
                       ("home", {}), ("save_parameters", {})):
        assert drive.command(name, **args) == ILLEGAL_FUNCTION, name
    assert drive.read("capabilities") & 0b1110 == 0
    assert drive.read("capabilities") & 0b10001 == 0b10001
    # Its velocity is computed from positions.
    assert not drive.read("capabilities") & 1 << 18
    assert xyza.sim.get()["x"] == 0


def test_the_end_stops_what_moves(xyza):
    assert xyza.drive(3).command("jog_positive") == 0
    assert xyza.stop_bridge() == 0
    eventually(lambda: xyza.sim.get()["z_speed"] == 0)


# --- programs --------------------------------------------------------------------------------------------


def test_a_program(xyza):
    drive = xyza.drive()
    sends(xyza, 1, "start_program", "F401030500", "F401030302", program_number=2,
          program_delay=0)
    program_state(xyza, RUNNING)
    eventually(lambda: xyza.drive(4).read("program") == 2)
    eventually(lambda: xyza.drive(3).read("program_step") > 5)
    # No jogs meanwhile, and no other program.
    assert xyza.drive(2).command("jog_positive") == DEVICE_FAILURE
    assert drive.command("start_program", program_number=1, program_delay=0) == DEVICE_FAILURE
    sends(xyza, 1, "pause_program", "F401030200")
    program_state(xyza, WAITING)
    step = drive.read("program_step")
    sends(xyza, 1, "continue_program", "F401030600")
    eventually(lambda: drive.read("program_step") > step + 2)
    assert drive.command("end_program") == DEVICE_FAILURE  # it runs
    assert drive.command("pause_program") == 0
    sends(xyza, 1, "end_program", "F401030700")
    program_state(xyza, IDLE)
    assert xyza.sim.get()["program_start"] == 1


def test_a_program_has_an_end(make_xyza):
    bridge = make_xyza(axes="x", sim_drive={"program-steps": 60})
    drive = bridge.drive()

    def ended(result):
        eventually(lambda: drive.read("motion_result") == result, what="its end")
        return bool(drive.read("status") & 1 << 15)

    assert drive.settle("start_program", program_number=2, program_delay=0) == RESULT_OK
    assert drive.read("motion_result") == code("result", "pending")
    assert ended(RESULT_OK)
    assert bridge.sim.get()["program_state"] == IDLE
    # Somebody presses the pause key.
    assert drive.settle("start_program", program_number=2, program_delay=0) == RESULT_OK
    bridge.sim.control("input drive1 8 1")
    assert not ended(code("result", "cancelled"))
    assert drive.settle("end_program") == RESULT_OK


def test_a_jog_that_stands_by_itself_has_failed(make_xyza):
    bridge = make_xyza(axes="x")
    drive = bridge.drive()
    assert drive.settle("jog_positive") == RESULT_OK
    eventually(lambda: drive.read("position") > 50, what="motion")
    assert drive.read("motion_result") == code("result", "pending")
    bridge.sim.control("place drive1 x 0")  # as at a limit switch
    eventually(lambda: drive.read("motion_result") == code("result", "failed"), what="its end")
    assert drive.read("result") == code("result", "failed")
    # One that is stopped is not.
    assert drive.settle("jog_positive") == RESULT_OK
    assert drive.settle("stop") == RESULT_OK
    assert drive.read("motion_result") == code("result", "cancelled")
    state(bridge, STANDSTILL)
    assert drive.read("result") == RESULT_OK


def test_a_delayed_start_can_be_called_off(xyza):
    drive = xyza.drive()
    sends(xyza, 1, "start_program", "F401030501", "F401030304", program_number=4,
          program_delay=1)
    program_state(xyza, IDLE)
    program_state(xyza, RUNNING)
    assert drive.command("stop") == 0
    assert drive.command("end_program") == 0
    state(xyza, STANDSTILL)
    assert drive.command("start_program", program_number=4, program_delay=200) == 0
    program_state(xyza, IDLE)
    assert drive.command("jog_positive") == DEVICE_FAILURE  # it is about to start
    assert drive.command("stop") == 0
    assert drive.command("jog_positive") == 0
    stand(xyza)
    # The delay does not stay behind.
    assert drive.command("start_program", program_number=4, program_delay=0) == 0
    program_state(xyza, RUNNING)


def test_single_steps(xyza):
    drive = xyza.drive()
    assert drive.command("single_step", output_value=1) == 0
    assert drive.command("start_program", program_number=1, program_delay=0) == 0
    for step in range(1, 4):
        eventually(lambda step=step: drive.read("program_step") == step)
        program_state(xyza, WAITING)
        assert drive.command("continue_program") == 0
    assert drive.command("single_step", output_value=0) == 0
    eventually(lambda: drive.read("program_state") in (WAITING, RUNNING))
    drive.command("continue_program")
    eventually(lambda: drive.read("program_step") > 6)


@pytest.mark.parametrize("first, second", [("disable", "stop"), ("disable", "quick_stop"), ("stop", "disable")])
def test_a_stop_beside_a_disable_stops_the_whole_controller(xyza, first, second):
    """A disable is for its own axis: it does not do for a stop that comes at the same time."""
    x, y = xyza.drive(1), xyza.drive(2)
    place = x.row("command").address
    assert y.settle("jog_positive") == RESULT_OK
    eventually(lambda: xyza.sim.get()["y_speed"] == 2000, what="motion")
    with xyza.raw() as client:
        for number, name in enumerate((first, second)):
            command = struct.pack(">BHH", 6, place, int(xyza.commands[name]["code"]))
            client.send(Raw.adu(number, 1, command))
        answers = {client.receive()[2][0] for _ in range(2)}
    assert answers == {6}, "both are answered with success"
    eventually(lambda: xyza.sim.get()["y_speed"] == 0, what="the other axis to stand")
    eventually(lambda: y.read("axis_state") == STANDSTILL, what="that to show")
    assert x.read("axis_state") == DISABLED


def test_an_emergency_stop_interrupts(xyza):
    drive = xyza.drive()
    assert drive.command("start_program", program_number=1, program_delay=0) == 0
    program_state(xyza, RUNNING)
    sends(xyza, 2, "quick_stop", "F401030100", "F301030100")
    program_state(xyza, INTERRUPTED)
    assert xyza.sim.get()["x_speed"] == 0
    for number in range(1, 5):
        state(xyza, ERROR_STOP, number)
    assert drive.command("jog_positive") == DEVICE_FAILURE
    # Any of them gets out of it.
    assert drive.command("end_program") == 0
    assert drive.command("start_program", program_number=1, program_delay=0) == 0
    assert drive.command("quick_stop") == 0
    for number in range(1, 5):
        state(xyza, ERROR_STOP, number)
    assert xyza.drive(3).command("clear_fault") == 0
    for number in range(1, 5):
        state(xyza, STANDSTILL, number)


def test_keys_start_and_stop_programs(xyza):
    drive = xyza.drive()
    assert drive.write("start_key", 1) == 0
    xyza.sim.control("input drive1 1 1")
    program_state(xyza, RUNNING)
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)
    xyza.sim.control("input drive1 7 1")
    program_state(xyza, WAITING)


# --- parameters -------------------------------------------------------------------------------------------


def test_parameters_are_read_and_written(xyza):
    x, y = xyza.drive(1), xyza.drive(2)
    assert y.write("lead", 2000) == 0
    assert (x.read("lead"), y.read("lead")) == (5000, 2000)
    eventually(lambda: y.read("counts_per_unit") == 1600)
    assert x.read("counts_per_unit") == 640
    for name, value in (("min_speed", 100), ("max_speed", 70000), ("acceleration_time", 3),
                        ("manual_speed", 900), ("step_angle", 400), ("microstep", 8)):
        assert y.write(name, value) == 0
        assert y.read(name) == value
        assert x.read(name) != value, name
    for name, value in (("brake", 3), ("sound", 1), ("start_up", 0), ("pulse_mode", 5)):
        assert x.write(name, value) == 0
        eventually(lambda name=name, value=value: y.read(name) == value)
    for name, value in (("read_password", 4000000000), ("password", 1234)):
        assert x.write(name, value) == 0
        assert (x.read(name), y.read(name)) == (0, 0)
        assert x.read("history1_value") == 0
    assert x.write("brake", 16) == ILLEGAL_VALUE
    assert x.write("pause_key", 3) == ILLEGAL_VALUE


def test_one_key_leaves_the_others(xyza):
    x, y = xyza.drive(1), xyza.drive(2)
    keys = ("start_key", "stop_key", "pause_key")
    assert [y.read(name) for name in keys] == [6, 7, 8]
    sends_before = len(requests(xyza))
    assert x.write("stop_key", 2) == 0
    sent = [frame for frame in requests(xyza)[sends_before:] if not frame.startswith(POLLS)]
    assert sent == ["F10103E5C2", "F10103E5C206020800", "F10103E5C2"]
    assert [x.read(name) for name in keys] == [6, 2, 8]
    eventually(lambda: [y.read(name) for name in keys] == [6, 2, 8])


def test_acceleration_under_its_neutral_name(make_xyza):
    """The controller knows a time: from min_speed to max_speed, in tenths of a second."""
    bridge = make_xyza(drive={"max-acceleration": 50000, "counts-per-unit": 1})
    x, y = bridge.drive(1), bridge.drive(2)
    for name, value in (("min_speed", 200), ("max_speed", 3200), ("acceleration_time", 5),
                        ("brake", 1)):
        assert x.write(name, value) == 0
    assert x.read("acceleration") == x.read("deceleration") == 6000
    eventually(lambda: y.read("deceleration") == 0)
    assert x.write("acceleration", 1000) == 0
    assert x.read("acceleration_time") == 30
    assert x.read("deceleration") == 1000
    assert x.write("deceleration", 8000) == 0
    assert (x.read("acceleration_time"), x.read("acceleration")) == (4, 7500)
    assert x.read("ramp_acceleration") == 7500
    for value in (0, -1, 80000):
        assert x.write("acceleration", value) == ILLEGAL_VALUE
    assert y.write("deceleration", 1000) == DEVICE_FAILURE
    assert y.read("write_result") == RESULT_REFUSED
    assert y.write("acceleration", 50001) == ILLEGAL_VALUE
    assert y.read("result_limit") == code("result_limit", "max_acceleration")


def raw_args(frame):
    content = bytes.fromhex(frame)
    padded = content.ljust(16, b"\0")
    words = [int.from_bytes(padded[i:i + 2], "big") for i in range(0, 16, 2)]
    return {"raw_length": len(content),
            **{f"raw_request{i + 1}": word for i, word in enumerate(words)}}


def raw_answer(drive):
    words = [drive.read(f"raw_answer{i}") for i in range(1, 11)]
    content = b"".join(word.to_bytes(2, "big") for word in words)
    return content[:drive.read("raw_answer_length")].hex().upper()


def test_a_raw_frame_and_its_answer(make_xyza):
    bridge = make_xyza(bus={"raw-frames": "on"}, drive={"watchdog-ms": 60000})
    drive = bridge.drive(2)
    assert drive.read("capabilities") & 1 << 17
    assert drive.command("raw_frame", **raw_args("0AF10100E2A4")) == 0
    assert drive.read("result") == RESULT_OK
    assert raw_answer(drive) == "5AA50BF10003E2A4D007000051"
    # It may move something: the watchdog wants to be fed.
    assert drive.read("watchdog_remaining_ms") > 0
    assert bridge.drive(1).read("raw_answer_length") == 0
    # Acknowledged; and what it changed is read again.
    assert drive.command("raw_frame", **raw_args("0BF10103E2A484030000")) == 0
    assert drive.read("result") == RESULT_UNPROVEN
    assert raw_answer(drive) == "5AA50CAA000300F19E"
    eventually(lambda: bridge.drive(1).read("manual_speed") == 900)
    # Turned down, and not said again.
    mark = len(requests(bridge))
    assert drive.command("raw_frame", **raw_args("0AF301000101")) == DEVICE_FAILURE
    assert drive.read("result") == RESULT_REFUSED
    assert raw_answer(drive)[4:8] == "0CAB"
    assert requests(bridge)[mark:].count("F301030101") == 1
    # For itself only, and only what is a frame.
    mark = len(requests(bridge))
    for frame in ("0AF10104E2A4", "0AF10000E2A4", "0AF10100E2", "0CAA010000F1", ""):
        assert drive.command("raw_frame", **raw_args(frame)) == ILLEGAL_VALUE
    assert all(frame.startswith((*POLLS, "F10103E")) for frame in requests(bridge)[mark:])
    log = bridge.log_path.read_text(encoding="utf-8")
    assert "drive drive2: is sent a client's raw frame, 5AA50AF10103E2A47B" in log
    assert "drive drive2: answers the raw frame with 5AA50BF10003E2A4D007000051" in log


def test_raw_frames_are_off_by_default(xyza):
    drive = xyza.drive()
    assert not drive.read("capabilities") & 1 << 17
    assert drive.command("raw_frame", **raw_args("0AF10100E2A4")) == ILLEGAL_FUNCTION


def test_dangerous_parameters_are_locked(xyza):
    drive = xyza.drive()
    mark = len(requests(xyza))
    for name, value in (("factory_reset", 1), ("slave_number", 6), ("system_info", 1)):
        assert drive.write(name, value) == ILLEGAL_ADDRESS, name
    assert all(frame.startswith(POLLS) for frame in requests(xyza)[mark:])


def test_another_slave_number(make_xyza):
    bridge = make_xyza(bus={"unlock-system": "yes"})
    assert bridge.drive(2).write("slave_number", 9) == 0
    assert bridge.sim.get()["address"] == 9
    for number in range(1, 5):
        state(bridge, OFFLINE, number)


def test_a_factory_reset(make_xyza):
    """It takes 10 s and then power off and on; one that is cut short changes nothing."""
    bridge = make_xyza(axes="xy", bus={"unlock-system": "yes"})
    drive = bridge.drive()
    assert drive.write("lead", 2000) == 0
    for wait, lead in ((0, 2000), (10, 5000)):
        mark = len(requests(bridge))
        assert drive.write("factory_reset", 1) == 0
        began = time.monotonic()
        state(bridge, OFFLINE, 1)
        state(bridge, OFFLINE, 2)
        eventually(lambda began=began, wait=wait: time.monotonic() - began > wait, timeout=20)
        bridge.sim.control("power drive1 cycle")
        bridge.wait_ready(1)
        assert drive.read("lead") == lead
        assert requests(bridge)[mark:].count("F10103E5CA00000000") == 1


# --- faults ---------------------------------------------------------------------------------------------

FAULTS = ["drop", "lose-request", "delay 120", "corrupt", "truncate", "garbage", "wrong-id"]


@pytest.mark.parametrize("fault", FAULTS)
def test_values_stay_true(xyza, fault):
    place(xyza, "x", -123456)
    place(xyza, "z", 77)
    for _ in range(8):
        xyza.sim.fault(f"{fault} 1")
        taken = xyza.sim.get()["heard"]
        eventually(lambda taken=taken: xyza.sim.get()["heard"] >= taken + 20)
        assert xyza.drive(1).read("position") == -123456
        assert xyza.drive(3).read("position") == 77
        assert xyza.drive(2).read("position") == 0
    assert xyza.drive(1).read("came_online") == 1


@pytest.mark.parametrize("fault", FAULTS)
def test_a_jog_is_carried_out_once(xyza, fault):
    drive = xyza.drive()
    for times in range(1, 4):
        xyza.sim.fault(f"{fault} 1")
        code = drive.command("jog_positive")
        xyza.sim.fault("none")
        if code == 0:
            assert drive.read("result") == RESULT_OK
            eventually(lambda: xyza.sim.get()["x_speed"] > 0)
        assert xyza.sim.get()["jog"] <= times
        eventually(drive.online)
        stand(xyza)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_program_is_started_once(xyza, fault):
    drive = xyza.drive()
    xyza.sim.fault(f"{fault} 2")
    code = drive.command("start_program", program_number=5, program_delay=0)
    xyza.sim.fault("none")
    eventually(drive.online)
    started = xyza.sim.get()["program_start"]
    assert started <= 1
    if code == 0:
        assert started == 1
        program_state(xyza, RUNNING)
        assert drive.read("program") == 5
    else:
        assert drive.read("result") in (RESULT_INDETERMINATE, RESULT_REFUSED) or started == 0


def test_a_lost_answer_of_a_start_is_resolved(xyza):
    """The first frame is the delay's, which may be said again."""
    drive = xyza.drive()
    drive.command("start_program", program_number=8, program_delay=0)
    assert drive.command("stop") == 0
    assert drive.command("end_program") == 0
    program_state(xyza, IDLE)
    for _ in range(5):
        before = xyza.sim.get()["program_start"]
        xyza.sim.fault("drop 3")
        code = drive.command("start_program", program_number=8, program_delay=0)
        xyza.sim.fault("none")
        eventually(drive.online)
        assert xyza.sim.get()["program_start"] - before <= 1
        if code == 0:
            program_state(xyza, RUNNING)
        drive.command("stop")
        drive.command("end_program")
        program_state(xyza, IDLE)


def test_local_echo(xyza):
    xyza.sim.fault("echo on", "line")
    place(xyza, "x", -777)
    assert xyza.drive().command("jog_positive") == 0
    eventually(lambda: xyza.drive().read("position") > -700)
    stand(xyza)
    assert xyza.drive().write("lead", 4321) == 0
    assert xyza.drive().read("came_online") == 1


def test_power_comes_back(xyza):
    place(xyza, "y", -5000)
    assert xyza.drive(3).write("lead", 2345) == 0
    xyza.sim.control("power drive1 off")
    for number in range(1, 5):
        state(xyza, OFFLINE, number)
        with pytest.raises(Refused):
            xyza.drive(number).read("position")
        assert xyza.drive(number).command("jog_positive") in (0x0B, 0x0A)
    xyza.sim.control("power drive1 on")
    for number in range(1, 5):
        xyza.wait_ready(number)
        assert xyza.drive(number).read("came_online") == 2
    # The controller has forgotten where it is, and only that.
    eventually(lambda: xyza.drive(2).read("position") == 0)
    assert xyza.drive(3).read("lead") == 2345
    assert xyza.drive(4).read("status") & ONLINE_BIT


@pytest.mark.parametrize("style", [{"answer-mark": "0a"}, {"failure-code": "bb"},
                                   {"echo-a4": True}])
def test_other_ways_to_say_the_same(make_xyza, style):
    bridge = make_xyza(sim_drive=style)
    assert bridge.drive(1).command("jog_positive") == 0
    eventually(lambda: bridge.drive(1).read("position") > 50)
    # Refused by the controller itself.
    assert bridge.drive(1).command("start_program", program_number=99,
                                   program_delay=0) == DEVICE_FAILURE
    assert bridge.drive(1).read("result") == RESULT_REFUSED
    stand(bridge)


def test_a_controller_with_fewer_axes(make_xyza):
    """An axis that the controller does not have is not shown; the others are."""
    bridge = make_xyza(axes="xya", sim_drive={"axes": 1}, wait_online=False)
    bridge.wait_ready(1)
    place(bridge, "x", 42)
    for number in (2, 3):
        state(bridge, OFFLINE, number)
    bridge.sim.control("input drive1 5 1")
    eventually(lambda: bridge.drive(1).read("inputs") == 1 << 4)
    assert bridge.drive(1).read("came_online") == 1


def test_the_watchdogs_latch_can_be_cleared(make_xyza):
    """The latch is the bridge's own: the controller is asked for nothing."""
    bridge = make_xyza(axes="x", drive={"watchdog-ms": 200})
    drive, gateway = bridge.drive(), bridge.gateway()
    assert drive.command("jog_positive") == 0
    eventually(lambda: gateway.words(2004, 2)[1] & 1 << 10, what="the watchdog")
    assert drive.command("jog_positive") == DEVICE_FAILURE
    assert drive.command("clear_fault") == 0
    assert drive.read("result") == RESULT_OK
    assert drive.command("jog_positive") == 0
    assert drive.command("stop") == 0
