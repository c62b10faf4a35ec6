# SPDX-License-Identifier: Apache-2.0
"""Every command, from the PLC's write to the line on the wire and back into the registers."""

import pytest
from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    DISCRETE,
    ENABLED_BIT,
    HOMED_BIT,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    NO_ERROR,
    ORIGIN_LOST_BIT,
    RESULT_OK,
    RESULT_OUT_OF_RANGE,
    RESULT_RATE_LIMITED,
    RESULT_REFUSED,
    RESULT_UNSUPPORTED,
    STANDSTILL,
    code,
    eventually,
)


def sends(bridge, name, *lines, exception=0, **args):
    """Writes a command and checks that exactly these lines went to the drive because of it. A drive that was not asked in
    time on a busy machine is asked once more who it is: that is none of them."""
    drive = bridge.drive()
    mark = bridge.sim.mark()
    assert drive.command(name, **args) == exception
    assert [line for line in bridge.sim.sent(mark) if line != "1 dev" or line in lines] == list(lines)


def state(bridge, wanted):
    eventually(lambda: bridge.drive().read("axis_state") == wanted, what=f"state {wanted}")


def test_enable_and_disable(bridge):
    drive = bridge.drive()
    sends(bridge, "disable", "1 off")
    state(bridge, DISABLED)
    assert not drive.read("status") & ENABLED_BIT
    assert drive.read("status") & ORIGIN_LOST_BIT
    sends(bridge, "enable", "1 ena")
    state(bridge, STANDSTILL)
    assert drive.read("status") & ENABLED_BIT
    assert (drive.read("result"), drive.read("result_id")) == (RESULT_OK, 0)


def test_move_velocity_and_stop(bridge):
    drive = bridge.drive()
    sends(bridge, "move_velocity", "1 mov spd=-3200", target_velocity=-3200)
    state(bridge, CONTINUOUS)
    eventually(lambda: drive.read("velocity") == -3200, what="full speed")
    eventually(lambda: drive.read("position") < -50)
    sends(bridge, "stop", "1 stp")
    state(bridge, STANDSTILL)
    assert drive.read("velocity") == 0
    assert drive.read("position") == bridge.sim.get()["position"]


def test_quick_stop(bridge):
    sends(bridge, "move_velocity", "1 mov spd=1600", target_velocity=1600)
    state(bridge, CONTINUOUS)
    sends(bridge, "quick_stop", "1 stp 1")
    state(bridge, STANDSTILL)


def test_move_preset_uses_the_drives_own_speed(bridge):
    sends(bridge, "move_preset", "1 mov")
    eventually(lambda: bridge.drive().read("velocity") == 6400, what="the preset speed")
    bridge.drive().command("stop")
    state(bridge, STANDSTILL)


@pytest.mark.parametrize("target", [1200, -1200])
def test_move_absolute(bridge, target):
    drive = bridge.drive()
    sends(bridge, "move_absolute", f"1 pos {target} spd=12800", target_position=target,
          target_velocity=12800)
    state(bridge, STANDSTILL)
    assert drive.read("position") == target == bridge.sim.get()["position"]


def test_move_absolute_at_the_preset_speed(bridge):
    sends(bridge, "move_absolute", "1 pos 40", target_position=40, target_velocity=0)
    state(bridge, STANDSTILL)
    assert bridge.sim.get()["position"] == 40


def test_axis_state_during_a_move(bridge):
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=200000, target_velocity=800) == 0
    state(bridge, DISCRETE)
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)


def test_move_relative_adds_up(bridge):
    drive = bridge.drive()
    for _ in range(3):
        assert drive.command("move_relative", target_position=-250, target_velocity=12800) == 0
        state(bridge, STANDSTILL)
    assert drive.read("position") == -750 == bridge.sim.get()["position"]


def test_home_and_home_stop(make_bridge):
    bridge = make_bridge(sim_drive={
        "start": 300, "sensor": ["3:below:0"],
        "set": ["zmd=1", "snr=2", "osv=0", "zsd=-6400", "acc=64000", "dec=64000", "pae=1"],
    })
    drive = bridge.drive()
    sends(bridge, "home", "1 zero stop", "1 zero start")
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")
    state(bridge, STANDSTILL)
    assert drive.command("move_absolute", target_position=60000, target_velocity=12800) == 0
    # Far enough for the way home to take longer than the next commands.
    eventually(lambda: drive.read("position") > 6000, what="the drive to be on its way")
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    sends(bridge, "home", "1 zero stop", "1 zero start")
    sends(bridge, "home_stop", "1 zero stop")
    state(bridge, STANDSTILL)
    assert not drive.read("status") & HOMED_BIT


def test_set_position(bridge):
    drive = bridge.drive()
    sends(bridge, "set_position", "1 org 4711", target_position=4711)
    eventually(lambda: drive.read("position") == 4711)
    assert bridge.sim.get()["shaft"] == 0
    sends(bridge, "set_position", "1 org 0", target_position=0)
    eventually(lambda: drive.read("position") == 0)


def test_clear_fault_of_a_closed_loop_drive(make_bridge):
    bridge = make_bridge(sim_drive={
        "closed-loop": True,
        "set": ["emod=1", "ewr=1", "spd=6400", "acc=64000", "dec=64000", "pae=1"],
    })
    drive = bridge.drive()
    bridge.sim.control("stall drive1 on")
    drive.command("move_velocity", target_velocity=3200)
    eventually(lambda: drive.read("error"), what="the stall to be seen")
    bridge.sim.control("stall drive1 off")
    sends(bridge, "clear_fault", "1 eclr")
    eventually(lambda: drive.read("error") == NO_ERROR, what="the error to be gone")
    assert drive.command("move_absolute", target_position=100) == 0


def test_save_and_read_parameters(make_bridge):
    bridge = make_bridge(bus={"save-interval-s": 60})
    drive = bridge.drive()
    assert drive.write("acc", 12345) == 0
    sends(bridge, "save_parameters", "1 sav")
    assert drive.command("save_parameters") == DEVICE_FAILURE
    assert drive.read("result") == RESULT_RATE_LIMITED
    before = drive.read("parameters_generation")
    read = bridge.sim.get()["cfg_read"]
    sends(bridge, "read_parameters", "1 dev")
    assert bridge.sim.get()["cfg_read"] == read + 1
    eventually(lambda: drive.read("parameters_generation") != before)
    assert drive.read("acc") == 12345


def test_a_failing_flash_is_reported(bridge):
    bridge.sim.control("flash drive1 fail")
    drive = bridge.drive()
    assert drive.command("save_parameters") == DEVICE_FAILURE
    assert drive.read("result") != RESULT_OK


OUTPUTS = {
    "external": True,
    "set": ["s3=1", "s4=1", "s5=1", "s6=1", "pae=1"],
}


def test_outputs(make_bridge):
    bridge = make_bridge(sim_drive=OUTPUTS)
    drive = bridge.drive()
    sends(bridge, "set_output", "1 s5 on", output_number=5, output_value=1)
    eventually(lambda: drive.read("outputs") & 16)
    sends(bridge, "set_output", "1 s5 off", output_number=5, output_value=0)
    eventually(lambda: not drive.read("outputs") & 16)
    sends(bridge, "set_outputs", "1 s3 on", "1 s4 off", "1 s6 on", output_mask=0b101100,
          output_levels=0b100100)
    eventually(lambda: drive.read("outputs") & 0b101100 == 0b100100)


def test_outputs_as_coils(make_bridge):
    bridge = make_bridge(sim_drive=OUTPUTS)
    unit = bridge.drive()
    mark = bridge.sim.mark()
    assert not unit.client.write_coil(2, True, device_id=1).isError()
    assert not unit.client.write_coils(3, [True, False], device_id=1).isError()
    assert bridge.sim.sent(mark) == ["1 s3 on", "1 s4 on", "1 s5 off"]
    eventually(
        lambda: unit.client.read_coils(0, count=6, device_id=1).bits[:6]
        == [False, False, True, True, False, False]
    )


def test_coils_that_touch_an_input_switch_nothing(make_bridge):
    bridge = make_bridge(sim_drive=dict(OUTPUTS, set=["s3=1", "s4=1", "s6=1"]))
    unit = bridge.drive()
    mark = bridge.sim.mark()
    assert unit.client.write_coils(2, [True] * 4, device_id=1).exception_code == 4
    assert (unit.read("write_result"), unit.read("write_result_register")) == (
        RESULT_REFUSED, 5)
    assert bridge.sim.sent(mark) == []
    assert not unit.client.write_coils(2, [True] * 2, device_id=1).isError()
    assert unit.read("write_result_register") == 0


def test_pwm_ports(make_bridge):
    bridge = make_bridge(sim_drive=OUTPUTS)
    sends(bridge, "set_sv", "1 sv2 255", output_number=2, output_value=255)
    sends(bridge, "set_nmos", "1 nmos3 0", output_number=3, output_value=0)


def test_shaking(bridge):
    args = {"shake_start_position": 0, "shake_end_position": 200, "shake_frequency": 1}
    sends(bridge, "shake_start", "1 shake start spos=0 epos=200 freq=1 cycles=0", shake_cycles=0,
          **args)
    eventually(lambda: bridge.drive().read("axis_state") not in (DISABLED, STANDSTILL))
    sends(bridge, "shake_stop", "1 shake stop")
    state(bridge, STANDSTILL)
    sends(bridge, "shake_start_time", "1 shake start spos=0 epos=200 freq=1 time=3", shake_time=3,
          **args)
    sends(bridge, "shake_stop", "1 shake stop")
    state(bridge, STANDSTILL)


def test_stop_ends_homing_and_shaking_too(bridge):
    drive = bridge.drive()
    assert drive.command("shake_start", shake_start_position=0, shake_end_position=200,
                         shake_frequency=1, shake_cycles=0) == 0
    sends(bridge, "stop", "1 stp", "1 shake stop")
    state(bridge, STANDSTILL)


def test_moving_a_disabled_drive_is_refused(bridge):
    drive = bridge.drive()
    assert drive.command("disable") == 0
    refusals = drive.read("refusals")
    for name in ("move_velocity", "move_absolute", "move_relative"):
        assert drive.command(name, target_velocity=100, target_position=50) == DEVICE_FAILURE
        assert drive.read("result") == RESULT_REFUSED
    assert drive.read("refusals") >= refusals + 3
    assert bridge.sim.get()["shaft"] == 0


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("move_velocity", {"target_velocity": 192001}),
        ("move_velocity", {"target_velocity": float("nan")}),
        ("move_velocity", {"target_velocity": float("inf")}),
        ("move_absolute", {"target_position": 1, "target_velocity": -1}),
        ("move_relative", {"target_position": 1, "target_velocity": 192001}),
        ("set_output", {"output_number": 0, "output_value": 1}),
        ("set_output", {"output_number": 7, "output_value": 1}),
        ("set_output", {"output_number": 1, "output_value": 2}),
        ("set_outputs", {"output_mask": 64, "output_levels": 0}),
        ("set_sv", {"output_number": 4, "output_value": 0}),
        ("set_nmos", {"output_number": 1, "output_value": 256}),
        ("shake_start", {"shake_frequency": 0}),
    ],
)
def test_out_of_range_is_refused_before_the_wire(bridge, name, args):
    sends(bridge, name, exception=ILLEGAL_VALUE, **args)
    assert bridge.drive().read("write_result") == RESULT_OUT_OF_RANGE


def test_unknown_code(bridge):
    mark = bridge.sim.mark()
    drive = bridge.drive()
    assert drive.write_word(drive.row("command").address, 63) == ILLEGAL_VALUE
    assert drive.write_word(drive.row("command").address, 1000) == ILLEGAL_VALUE
    assert bridge.sim.sent(mark) == []


def test_unsupported_commands(bridge, command_table):
    drive = bridge.drive()
    others = [
        row for row in command_table.values()
        if row["families"] != "all" and "vsmd-serial" not in row["families"].split()
    ]
    for row in others:
        assert drive.command(int(row["code"])) == ILLEGAL_FUNCTION
        assert drive.read("result") == RESULT_UNSUPPORTED


def test_arguments_alone_never_execute_and_are_kept(bridge):
    drive = bridge.drive()
    mark = bridge.sim.mark()
    assert drive.write("target_position", 600) == 0
    assert drive.write("target_velocity", 12800) == 0
    assert bridge.sim.sent(mark) == []
    code = int(bridge.commands["move_absolute"]["code"])
    assert drive.write_word(drive.row("command").address, code) == 0
    assert bridge.sim.sent(mark) == ["1 pos 600 spd=12800"]
    state(bridge, STANDSTILL)
    assert drive.read("position") == 600
    assert drive.read("target_position") == 600


def test_every_command_of_the_family_is_tested_here(command_table):
    """A command that is new in the table needs a test here."""
    with open(__file__, encoding="utf-8") as file:
        text = file.read()
    for row in command_table.values():
        if row["families"] == "all" or "vsmd-serial" in row["families"].split():
            assert f'"{row["name"]}"' in text, row["name"]


def test_rs232_has_one_drive_and_no_address(make_bridge):
    bridge = make_bridge(line="rs232")
    drive = bridge.drive()
    mark = bridge.sim.mark()
    assert drive.command("move_absolute", target_position=77, target_velocity=0) == 0
    assert [line for line in bridge.sim.sent(mark) if line != "sts"] == ["pos 77"]
    state(bridge, STANDSTILL)
    assert drive.read("position") == 77


def test_a_preset_that_is_being_written_is_no_preset(make_bridge):
    """The speed that the drive will have when the move begins is the one that counts."""
    bridge = make_bridge(drive={"max-velocity": 6400.0}, modbus={"confirm-ms": 5})
    drive = bridge.drive()
    bridge.sim.fault("silence on")
    assert drive.write("spd", 12800.0) == 5
    assert drive.command("move_preset") == 3
    assert drive.read("result_limit") == code("result_limit", "max_velocity")
    assert bridge.sim.get()["mov"] == 0
