# SPDX-License-Identifier: Apache-2.0
"""The function blocks of docs/drivebridge.st, run as a controller runs them, against the bridge."""

import re
import time

import pytest
from bridgelib import DOCS, eventually
from plc import ModbusBlock, Plc
from stlib import Library, examples


@pytest.fixture(scope="session")
def library():
    return Library((DOCS / "drivebridge.st").read_text(encoding="utf-8"))


@pytest.fixture
def make_plc(library):
    made = []

    def make(bridge, unit=1, **axis):
        plc = Plc(library, bridge.port, unit, **axis)
        made.append(plc)
        plc.until(lambda: plc.axis.Valid, what="the first image")
        return plc

    yield make
    for plc in made:
        plc.modbus.close()


@pytest.fixture
def plc(bridge, make_plc):
    return make_plc(bridge)


@pytest.fixture
def codes(library):
    return library.constants


def commands(plc, codes):
    """The ids and codes of all commands that were sent."""
    return [write[1:3] for write in plc.modbus.writes
            if write[0] == codes["DB_REG_COMMAND_ID"]]


def sees(plc, name):
    """Cycles until the output is true."""
    block, output = name
    plc.until(lambda: getattr(block, output), what=output)


def test_move_absolute(bridge, plc, codes):
    move = plc.block("MC_MoveAbsolute", Position=500.0, Velocity=6400.0, Execute=True)
    plc.cycle()
    assert (move.Busy, move.Active, move.Done) == (True, False, False)
    sees(plc, (move, "Active"))
    assert (move.Busy, move.Done) == (True, False)
    assert plc.ended(move) == "Done"
    assert bridge.sim.get()["position"] == 500
    assert plc.axis.PositionCounts == 500
    for _ in range(3):
        plc.cycle()
        assert move.Done and not move.Busy and not move.Active
    plc.set(move, Execute=False)
    plc.cycle()
    assert not move.Done
    # The first id after the bridge's start is not executed: the block gave it another.
    sent = commands(plc, codes)
    assert [code for _, code in sent] == [codes["DB_CMD_MOVE_ABSOLUTE"]] * 2
    assert sent[0][0] != sent[1][0] and 0 not in (sent[0][0], sent[1][0])
    assert bridge.sim.get()["pos"] == 1


@pytest.mark.parametrize(("variant", "prefix"), [("strict", ""), ("prefixed", "DB_")])
def test_the_other_forms_do_the_same(bridge, library, variant, prefix):
    text = (DOCS / f"drivebridge-{variant}.st").read_text(encoding="utf-8")
    plc = Plc(Library(text, strict=variant == "strict"), bridge.port)
    codes = library.constants
    try:
        plc.until(lambda: plc.axis.Valid, what="the first image")
        power = plc.block(prefix + "MC_Power", Enable=True)
        sees(plc, (power, "Status"))
        move = plc.block(prefix + "MC_MoveRelative", Distance=300.0, Velocity=12800.0)
        assert plc.run(move) == "Done"
        plc.modbus.lose = 1
        assert plc.run(move) == "Done"
        assert bridge.sim.get()["position"] == 600
        run = plc.block(prefix + "MC_MoveVelocity", Velocity=3000.0, Execute=True)
        sees(plc, (run, "InVelocity"))
        assert plc.run(plc.block(prefix + "MC_Stop")) == "Done"
        assert run.CommandAborted
        write = plc.block(prefix + "MC_WriteParameter", ParameterNumber=codes["DB_PAR_VSMD_ACC"])
        assert plc.run(write, Value=32000.0) == "Done"
        assert bridge.drive().read("acc") == 32000.0
        assert plc.run(write, Value=-1.0) == codes["DB_RESULT_OUT_OF_RANGE"]
    finally:
        plc.modbus.close()


def test_done_lasts_a_cycle_without_execute(bridge, plc):
    move = plc.block("MC_MoveAbsolute", PositionCounts=300, InCounts=True, Execute=True)
    plc.cycle()
    plc.set(move, Execute=False)
    plc.until(lambda: move.Done, what="Done")
    plc.cycle()
    assert not move.Done and not move.Busy
    assert bridge.sim.get()["position"] == 300


def test_user_units(make_bridge, make_plc):
    bridge = make_bridge(drive={"counts-per-unit": 100})
    plc = make_plc(bridge, CountsPerUnit=100.0)
    move = plc.block("MC_MoveRelative", Distance=-2.5, Velocity=64.0)
    for count in (1, 2):
        assert plc.run(move) == "Done"
        assert bridge.sim.get()["position"] == -250 * count
    assert plc.axis.Position == -5.0
    assert bridge.drive().read("target_velocity") == 6400.0
    assert plc.run(move, Distance=1e9) == plc.st_library.constants["DB_FAIL_ARGUMENT"]


def test_low_word_first(make_bridge, make_plc):
    bridge = make_bridge(modbus={"word-order": "low-first"})
    plc = make_plc(bridge, LowWordFirst=True)
    move = plc.block("MC_MoveAbsolute")
    assert plc.run(move, Position=-1234.0, Velocity=12345.5) == "Done"
    assert bridge.sim.get()["position"] == -1234
    assert bridge.drive().read("target_velocity") == 12345.5
    assert plc.axis.PositionCounts == -1234 and plc.axis.Moment != 0


def test_halt_aborts_a_velocity_move(bridge, plc, codes):
    run = plc.block("MC_MoveVelocity", Velocity=-5000.0, Execute=True)
    halt = plc.block("MC_Halt")
    sees(plc, (run, "InVelocity"))
    assert run.Busy and run.Active and plc.axis.State == codes["DB_STATE_CONTINUOUS_MOTION"]
    plc.set(halt, Execute=True)
    plc.until(lambda: run.CommandAborted, what="CommandAborted")
    assert not (run.Busy or run.Active or run.InVelocity)
    assert plc.ended(halt) == "Done"
    assert bridge.sim.get()["stp"] >= 1
    assert plc.axis.State == codes["DB_STATE_STANDSTILL"]
    assert plc.axis.VelocityCounts == 0.0


def test_a_velocity_move_changes_its_velocity(plc):
    run = plc.block("MC_MoveVelocity", Velocity=3000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    plc.set(run, Execute=False)
    plc.cycle()
    assert run.Busy
    plc.set(run, Execute=True, Velocity=9000.0)
    plc.cycle()
    assert not run.InVelocity
    sees(plc, (run, "InVelocity"))
    assert plc.axis.VelocityCounts == pytest.approx(9000.0, rel=0.03)
    assert plc.run(plc.block("MC_Halt")) == "Done"


def test_a_second_move_aborts_the_first(bridge, plc):
    first = plc.block("MC_MoveAbsolute", Position=100000.0, Velocity=3000.0, Execute=True)
    second = plc.block("MC_MoveAbsolute", Position=-200.0, Velocity=0.0)
    sees(plc, (first, "Active"))
    plc.set(second, Execute=True)
    assert plc.ended(first) == "CommandAborted"
    assert plc.ended(second) == "Done"
    assert bridge.sim.get()["position"] == -200


def test_the_same_block_again_while_it_moves(bridge, plc):
    move = plc.block("MC_MoveAbsolute", Position=100000.0, Velocity=3000.0, Execute=True)
    sees(plc, (move, "Active"))
    plc.set(move, Execute=False)
    plc.cycle()
    plc.set(move, Execute=True, Position=700.0, Velocity=0.0)
    assert plc.ended(move) == "Done"
    assert bridge.sim.get()["position"] == 700


def test_a_foreign_command_aborts(bridge, plc):
    move = plc.block("MC_MoveAbsolute", Position=100000.0, Velocity=3000.0, Execute=True)
    sees(plc, (move, "Active"))
    assert bridge.drive().command("stop") == 0
    assert plc.ended(move) == "CommandAborted"


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("set_output", {"output_number": 5, "output_value": 1}),
        ("move_absolute", {"target_position": 0, "target_velocity": 1e9}),
        ("clear_fault", {}),
    ],
)
def test_what_does_not_end_the_motion_does_not_abort(make_bridge, make_plc, name, args):
    """A command that is no motion, or one that was refused before it reached the drive."""
    bridge = make_bridge(sim_drive={"set": ["s5=1", "spd=6400", "acc=64000", "dec=64000", "pae=1"]})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveAbsolute", Position=3000.0, Velocity=3000.0, Execute=True)
    sees(plc, (move, "Active"))
    bridge.drive().command(name, **args)
    assert plc.ended(move) == "Done"
    assert bridge.sim.get()["position"] == 3000


def test_a_motion_that_the_drive_refuses_aborts_nothing(make_bridge, make_plc, codes):
    """It does not home (zmd=0); the move before goes on, whose block waits for its end."""
    bridge = make_bridge(sim_drive={"set": ["zmd=0", "spd=6400", "acc=64000", "dec=64000", "pae=1"]})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveAbsolute", Position=3000.0, Velocity=3000.0, Execute=True)
    sees(plc, (move, "Active"))
    home = plc.block("MC_Home", Execute=True)
    assert plc.ended(home) == codes["DB_RESULT_REFUSED"]
    assert move.Busy and not move.CommandAborted
    assert plc.ended(move) == "Done"
    assert bridge.sim.get()["position"] == 3000


def test_stop_holds_the_axis(bridge, plc, codes):
    run = plc.block("MC_MoveVelocity", Velocity=5000.0, Execute=True)
    stop = plc.block("MC_Stop")
    move = plc.block("MC_MoveAbsolute", Position=50.0)
    sees(plc, (run, "InVelocity"))
    plc.set(stop, Execute=True)
    plc.until(lambda: run.CommandAborted, what="CommandAborted")
    assert plc.ended(stop) == "Done"
    position = bridge.sim.get()["position"]
    assert plc.run(move) == codes["DB_FAIL_STOPPING"]
    assert bridge.sim.get()["position"] == position
    assert stop.Done
    plc.set(stop, Execute=False)
    plc.cycle()
    assert plc.run(move) == "Done"


def test_a_stop_overtakes_what_waits(bridge, plc, codes):
    """A move that waits for the connection is not written after the stop."""
    outputs = [plc.block("MC_ReadParameter", ParameterNumber=codes["DB_PAR_WATCHDOG_MS"])
               for _ in range(2)]
    move = plc.block("MC_MoveVelocity", Velocity=100.0)
    halt = plc.block("MC_Halt")
    for output in outputs:
        plc.set(output, Enable=True)
    plc.until(lambda: plc.axis.Engaged, what="a busy connection")
    plc.set(move, Execute=True)
    plc.set(halt, Execute=True)
    assert plc.ended(move) == "CommandAborted"
    assert plc.ended(halt) == "Done"
    assert bridge.sim.get()["velocity"] == 0


def test_power(bridge, plc, codes):
    power = plc.block("MC_Power")
    for _ in range(20):
        plc.cycle()
    # Never enabled by this block: left alone.
    assert bridge.sim.get()["off"] == 0
    plc.set(power, Enable=True)
    sees(plc, (power, "Status"))
    plc.set(power, Enable=False)
    plc.cycle()
    assert not power.Status
    plc.until(lambda: plc.axis.State == codes["DB_STATE_DISABLED"], what="Disabled")
    assert bridge.sim.get()["off"] == 1
    move = plc.block("MC_MoveRelative", Distance=10.0)
    assert plc.run(move) == codes["DB_RESULT_REFUSED"]
    plc.set(power, Enable=True)
    sees(plc, (power, "Status"))
    assert plc.run(move) == "Done"
    assert not power.Error


def test_home_and_set_position(make_bridge, make_plc, codes):
    bridge = make_bridge(sim_drive={
        "start": 300, "sensor": ["3:below:0"],
        "set": ["zmd=1", "snr=2", "osv=0", "zsd=-6400", "acc=64000", "dec=64000", "pae=1"],
    })
    plc = make_plc(bridge)
    home = plc.block("MC_Home", Execute=True)
    sees(plc, (home, "Active"))
    assert plc.ended(home) == "Done"
    assert plc.axis.Status & codes["DB_STATUS_HOMED"]
    plc.set(home, Execute=False)
    assert plc.run(plc.block("MC_SetPosition"), Position=4321.0) == "Done"
    assert bridge.sim.get()["position"] == 4321
    # Far enough for the way home to be seen.
    assert plc.run(plc.block("MC_MoveRelative"), Distance=4000.0, Velocity=50000.0) == "Done"
    plc.set(home, Execute=True)
    sees(plc, (home, "Active"))
    assert plc.run(plc.block("MC_Halt")) == "Done"
    assert home.CommandAborted


def test_read_status(bridge, plc, codes):
    status = plc.block("MC_ReadStatus", Enable=True)
    names = ["ErrorStop", "Disabled", "Stopping", "Homing", "Standstill", "DiscreteMotion",
             "ContinuousMotion"]

    def only():
        assert status.Valid
        return [name for name in names if getattr(status, name)]

    plc.cycle()
    assert only() == ["Standstill"]
    run = plc.block("MC_MoveVelocity", Velocity=5000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    plc.cycle()
    assert only() == ["ContinuousMotion"]
    plc.set(status, Enable=False)
    plc.cycle()
    assert not status.Valid and not status.ContinuousMotion


def test_parameters(bridge, plc, codes):
    write, read = plc.block("MC_WriteParameter"), plc.block("MC_ReadParameter")

    def value(name):
        plc.set(read, Enable=False)
        plc.cycle()
        plc.set(read, Enable=True, ParameterNumber=codes[name])
        plc.cycle()
        plc.until(lambda: not read.Busy, what="a value")
        assert not read.Error
        return read.Value

    for name, number in [("DB_PAR_VSMD_ACC", 32000.0), ("DB_PAR_VSMD_MCS", 4.0),
                         ("DB_PAR_WATCHDOG_MS", 1500.0), ("DB_PAR_WATCHDOG_MS", 0.0),
                         ("DB_PAR_VSMD_ZSP", -70000.0), ("DB_PAR_ACCELERATION", 64000.0)]:
        assert plc.run(write, ParameterNumber=codes[name], Value=number) == "Done"
        assert value(name) == number
        register = name.removeprefix("DB_PAR_").removeprefix("VSMD_").lower()
        assert bridge.drive().read(register) == number
    assert plc.run(write, ParameterNumber=codes["DB_PAR_VSMD_MCS"], Value=99.0) \
        == codes["DB_RESULT_OUT_OF_RANGE"]
    assert plc.run(write, ParameterNumber=codes["DB_PAR_POSITION"], Value=1.0) \
        == codes["DB_FAIL_EXCEPTION"] + 2
    assert plc.run(write, ParameterNumber=codes["DB_PAR_VSMD_MCS"], Value=-1.0) \
        == codes["DB_FAIL_ARGUMENT"]
    for name, register in [("DB_PAR_STATUS", "status"), ("DB_PAR_RESULT_ID", "result_id")]:
        assert value(name) == bridge.drive().read(register) == read.Raw
    plc.set(read, ParameterNumber=0x13000)
    plc.until(lambda: read.Error, what="an error")
    assert read.ErrorID == codes["DB_FAIL_EXCEPTION"] + 2


def test_limits_are_told(make_bridge, make_plc, codes):
    bridge = make_bridge(drive={"max-position": 500})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveAbsolute")
    assert plc.run(move, Position=501.0) == codes["DB_RESULT_LIMIT"]
    assert plc.axis.ResultLimit == codes["DB_LIMIT_MAX_POSITION"]
    assert plc.run(move, Position=500.0) == "Done"
    assert plc.run(move, Position=0.0, Velocity=1e9) == codes["DB_RESULT_OUT_OF_RANGE"]


def test_reset_clears_the_watchdogs_latch(make_bridge, make_plc, codes):
    bridge = make_bridge(drive={"watchdog-ms": 400})
    plc = make_plc(bridge)
    run = plc.block("MC_MoveVelocity", Velocity=5000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    # The controller stops its cycles.
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")
    plc.until(lambda: not run.Busy, what="the end")
    assert run.Error and run.ErrorID == codes["DB_RESULT_LATCHED"]
    assert not run.CommandAborted
    status = plc.block("MC_ReadStatus", Enable=True)
    sees(plc, (status, "ErrorStop"))
    assert not (status.Standstill or status.Stopping)
    move = plc.block("MC_MoveRelative", Distance=10.0)
    assert plc.run(move) == codes["DB_RESULT_LATCHED"]
    assert plc.run(plc.block("MC_Reset")) == "Done"
    # Its stop is seen to have lasted before it is at a standstill.
    sees(plc, (status, "Standstill"))
    assert not status.ErrorStop
    assert plc.run(move) == "Done"


def test_a_new_connection_keeps_the_drive_running(make_bridge, make_plc, codes):
    """Reads over it do not count for the watchdog: it has brought no command yet."""
    bridge = make_bridge(drive={"watchdog-ms": 700})
    plc = make_plc(bridge)
    run = plc.block("MC_MoveVelocity", Velocity=2000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    plc.modbus.close()
    images = plc.axis.Images
    until = time.monotonic() + 2.5
    plc.until(lambda: time.monotonic() > until, what="some time")
    assert run.InVelocity and plc.axis.Images > images + 10
    assert bridge.drive().read("watchdog_trips") == 0


def test_who_only_looks_keeps_no_drive_running(make_bridge, make_plc, codes):
    """The controller that commands falls silent; another one with the library reads on."""
    bridge = make_bridge(drive={"watchdog-ms": 700})
    plc, other = make_plc(bridge), make_plc(bridge)
    run = plc.block("MC_MoveVelocity", Velocity=2000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    other.until(lambda: other.axis.Status & codes["DB_STATUS_LATCHED"], what="the watchdog")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")


@pytest.mark.parametrize("lost", [1, 2, 4])
def test_lost_responses_move_once(bridge, plc, codes, lost):
    """The connection is closed after the request: the same id goes out again, and the drive moves
    once."""
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    assert plc.run(move) == "Done"
    for count in (2, 3):
        del plc.modbus.writes[:]
        plc.modbus.lose = lost
        assert plc.run(move, timeout=30) == "Done"
        assert plc.modbus.lose == 0
        sent = commands(plc, codes)
        assert len(sent) == lost + 1 and len(set(sent)) == 1
        assert bridge.sim.get()["position"] == 300 * count
        assert bridge.drive().read("result_id") == sent[0][0]


def test_a_bridge_that_restarts_before_the_answer(bridge, plc, codes):
    """Whether the move was made cannot be known: it is told, and not made again."""
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    assert plc.run(move) == "Done"
    plc.modbus.lose = 1
    plc.set(move, Execute=True)
    plc.until(lambda: plc.modbus.lose == 0, what="the request")
    eventually(lambda: bridge.sim.get()["position"] == 600, what="the move")
    bridge.restart_bridge()
    plc.modbus.port = bridge.port
    assert plc.ended(move) == codes["DB_RESULT_RESTARTED"]
    assert bridge.sim.get()["position"] == 600


def test_writes_that_are_accepted_at_once(make_bridge, make_plc, codes):
    bridge = make_bridge(modbus={"write-confirm": "accepted"})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    for count in (1, 2, 3):
        assert plc.run(move) == "Done"
        assert bridge.sim.get()["position"] == 300 * count
    assert bridge.drive().command("disable") == 0
    assert plc.run(move) == codes["DB_RESULT_REFUSED"]


def test_confirmed_later(make_bridge, make_plc, codes):
    """Exception 05 says nothing of the end: that is in the result registers."""
    bridge = make_bridge(modbus={"confirm-ms": 20})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    for count in range(1, 6):
        bridge.sim.fault("delay 40")
        end = plc.run(move)
        bridge.sim.fault("none")
        assert end == "Done"
        assert bridge.sim.get()["position"] == 300 * count


def test_a_drive_that_is_gone(bridge, plc, codes):
    move = plc.block("MC_MoveRelative", Distance=300.0)
    assert plc.run(move) == "Done"
    bridge.sim.fault("silence on")
    plc.until(lambda: plc.axis.State == codes["DB_STATE_OFFLINE"], what="Offline")
    assert plc.axis.Valid and plc.axis.ErrorCode == codes["DB_ERROR_NO_ANSWER"]
    assert plc.run(move) == codes["DB_RESULT_OFFLINE"]
    bridge.sim.fault("silence off")
    plc.until(lambda: plc.axis.State == codes["DB_STATE_STANDSTILL"], what="Standstill")
    assert plc.run(move) == "Done"
    assert bridge.sim.get()["position"] == 600


def test_a_bridge_that_is_gone(bridge, plc, codes):
    bridge.stop_bridge()
    plc.until(lambda: not plc.axis.Valid, what="not Valid")
    move = plc.block("MC_MoveRelative", Distance=300.0)
    assert plc.run(move, timeout=40) == codes["DB_FAIL_NO_ANSWER"]
    bridge.start_bridge()
    plc.modbus.port = bridge.port
    plc.until(lambda: plc.axis.Valid, what="Valid")
    assert bridge.sim.get()["position"] == 0
    assert plc.run(move) == "Done"
    assert bridge.sim.get()["position"] == 300


def test_a_new_program_finds_a_new_id(bridge, make_plc, codes):
    """A controller that lost its memory does not repeat the id that the bridge has seen last."""
    for count in range(1, 6):
        plc = make_plc(bridge)
        move = plc.block("MC_MoveRelative", Distance=100.0)
        assert plc.run(move) == "Done"
        assert bridge.sim.get()["position"] == 100 * count
        # Another client's, after which result_id does not tell the last id any more.
        assert bridge.drive().command("read_parameters") == 0


def test_ids_wrap(bridge, plc, codes):
    move = plc.block("MC_MoveRelative", Distance=10.0)
    assert plc.run(move) == "Done"
    del plc.modbus.writes[:]
    plc.axis.LastId = 65533
    for _ in range(4):
        assert plc.run(move) == "Done"
    assert [id for id, _ in commands(plc, codes)] == [65534, 65535, 1, 2]
    assert bridge.sim.get()["position"] == 50


# --- several blocks at once ----------------------------------------------------------------------


SLOW = {"set": ["spd=6400", "acc=64000", "dec=6400", "pae=1"]}


def test_a_halt_is_aborted_by_a_move(make_bridge, make_plc):
    bridge = make_bridge(sim_drive=SLOW)
    plc = make_plc(bridge)
    run = plc.block("MC_MoveVelocity", Velocity=6400.0, Execute=True)
    halt = plc.block("MC_Halt")
    move = plc.block("MC_MoveAbsolute", Position=100.0, Velocity=6400.0)
    sees(plc, (run, "InVelocity"))
    plc.set(halt, Execute=True)
    sees(plc, (halt, "Active"))
    assert not halt.Done
    plc.set(move, Execute=True)
    assert plc.ended(halt) == "CommandAborted"
    assert plc.ended(move) == "Done"
    assert bridge.sim.get()["position"] == 100


def test_a_stop_aborts_a_halt_and_refuses_others(make_bridge, make_plc, codes):
    bridge = make_bridge(sim_drive=SLOW)
    plc = make_plc(bridge)
    run = plc.block("MC_MoveVelocity", Velocity=6400.0, Execute=True)
    halt, stop = plc.block("MC_Halt"), plc.block("MC_Stop")
    sees(plc, (run, "InVelocity"))
    plc.set(halt, Execute=True)
    sees(plc, (halt, "Active"))
    plc.set(stop, Execute=True)
    assert plc.ended(halt) == "CommandAborted"
    assert plc.ended(stop) == "Done"
    sent = commands(plc, codes)
    plc.set(halt, Execute=False)
    plc.cycle()
    assert plc.run(halt) == codes["DB_FAIL_STOPPING"]
    assert commands(plc, codes) == sent
    # The power goes off all the same.
    power = plc.block("MC_Power", Enable=True)
    sees(plc, (power, "Status"))
    plc.set(power, Enable=False)
    plc.until(lambda: plc.axis.State == codes["DB_STATE_DISABLED"], what="Disabled")


@pytest.mark.parametrize("name", ["MC_Halt", "MC_Stop"])
def test_nothing_is_written_again_after_a_stop(bridge, plc, codes, name):
    """The response to a move is lost; before it is written again somebody wants a stop."""
    move = plc.block("MC_MoveVelocity", Velocity=100.0)
    stop = plc.block(name)
    assert plc.run(plc.block("MC_SetPosition")) == "Done"
    del plc.modbus.writes[:]
    plc.modbus.lose = 1
    plc.set(move, Execute=True)
    plc.until(lambda: plc.modbus.lose == 0, what="the request")
    plc.set(stop, Execute=True)
    assert plc.ended(move) == "CommandAborted"
    assert plc.ended(stop) == "Done"
    assert [code for _, code in commands(plc, codes)] == [
        codes["DB_CMD_MOVE_VELOCITY"],
        codes["DB_CMD_STOP" if name == "MC_Halt" else "DB_CMD_QUICK_STOP"]]
    assert bridge.sim.get()["velocity"] == 0


def test_a_stop_does_not_wait_for_what_moves_nothing(bridge, plc, codes):
    assert plc.run(plc.block("MC_SetPosition")) == "Done"
    preset, stop = plc.block("MC_SetPosition", Position=7.0), plc.block("MC_Stop")
    del plc.modbus.writes[:]
    plc.modbus.lose = 1
    plc.set(preset, Execute=True)
    plc.until(lambda: plc.modbus.lose == 0, what="the request")
    plc.set(stop, Execute=True)
    # Whether it was carried out is not known.
    assert plc.ended(preset) == codes["DB_FAIL_NO_ANSWER"]
    assert plc.ended(stop) == "Done"
    assert [code for _, code in commands(plc, codes)] == [codes["DB_CMD_SET_POSITION"],
                                                          codes["DB_CMD_QUICK_STOP"]]


@pytest.mark.parametrize("name", ["MC_Stop", "MC_Halt", "MC_MoveAbsolute", "MC_SetPosition",
                                  "MC_Reset"])
def test_a_lost_response_to_any_command(bridge, plc, codes, name):
    assert plc.run(plc.block("MC_MoveRelative"), Distance=10.0) == "Done"
    del plc.modbus.writes[:]
    plc.modbus.lose = 1
    assert plc.run(plc.block(name)) == "Done"
    sent = commands(plc, codes)
    assert len(sent) == 2 and len(set(sent)) == 1


def test_a_lost_response_to_a_parameter(bridge, plc, codes):
    plc.modbus.lose = 2
    assert plc.run(plc.block("MC_WriteParameter"), ParameterNumber=codes["DB_PAR_VSMD_ACC"],
                   Value=1234.0) == "Done"
    assert bridge.drive().read("acc") == 1234.0


# --- power ---------------------------------------------------------------------------------------


def test_power_is_tried_again(bridge, plc, codes):
    assert plc.run(plc.block("MC_SetPosition")) == "Done"
    bridge.sim.fault("silence on")
    plc.until(lambda: plc.axis.State == codes["DB_STATE_OFFLINE"], what="Offline")
    power = plc.block("MC_Power", Enable=True)
    sees(plc, (power, "Error"))
    assert power.ErrorID == codes["DB_RESULT_OFFLINE"] and not power.Busy
    bridge.sim.fault("silence off")
    sees(plc, (power, "Status"))
    assert not power.Error and power.ErrorID == 0
    bridge.sim.fault("silence on")
    plc.until(lambda: not power.Status, what="no Status")
    plc.set(power, Enable=False)
    bridge.sim.fault("silence off")
    plc.until(lambda: plc.axis.State == codes["DB_STATE_DISABLED"], what="Disabled")
    assert bridge.sim.get()["off"] >= 1


def test_power_that_was_taken_away_comes_back_by_reset(bridge, plc, codes):
    power = plc.block("MC_Power", Enable=True)
    sees(plc, (power, "Status"))
    assert bridge.drive().command("disable") == 0
    sees(plc, (power, "Error"))
    assert power.ErrorID == codes["DB_FAIL_AXIS"] and not power.Status
    seen = len(commands(plc, codes))
    images = plc.axis.Images
    plc.until(lambda: plc.axis.Images >= images + 30, what="some time")
    assert len(commands(plc, codes)) == seen and power.Error
    assert plc.run(plc.block("MC_Reset")) == "Done"
    sees(plc, (power, "Status"))
    assert not power.Error


def test_power_off_overtakes_power_on(bridge, plc, codes):
    assert plc.run(plc.block("MC_SetPosition")) == "Done"
    power = plc.block("MC_Power")
    plc.modbus.lose = 1
    plc.set(power, Enable=True)
    plc.until(lambda: plc.modbus.lose == 0, what="the request")
    plc.set(power, Enable=False)
    plc.until(lambda: plc.axis.State == codes["DB_STATE_DISABLED"] and not power.Busy,
              what="Disabled")
    assert not power.Error
    sent = [code for _, code in commands(plc, codes)]
    assert sent[-2:] == [codes["DB_CMD_ENABLE"], codes["DB_CMD_DISABLE"]]


@pytest.mark.parametrize("ending", ["halted", "refused"])
def test_power_survives_a_lost_read(bridge, plc, codes, ending):
    """After a move that was halted or refused an image takes two reads: between them the drive is
    measured, but what is known of it is not from now."""
    power = plc.block("MC_Power", Enable=True)
    sees(plc, (power, "Status"))
    move = plc.block("MC_MoveAbsolute", Position=1e6, Velocity=3000.0)
    if ending == "halted":
        plc.set(move, Execute=True)
        sees(plc, (move, "Active"))
        assert plc.run(plc.block("MC_Halt")) == "Done"
        assert plc.axis.Status & codes["DB_STATUS_ABORTED"]
    else:
        assert plc.run(move, Velocity=1e9) == codes["DB_RESULT_OUT_OF_RANGE"]
    for _ in range(5):
        plc.modbus.lose_reads = 1
        plc.until(lambda: not plc.axis.Valid, what="a lost read")

        def valid_again():
            assert not power.Error, power.ErrorID
            return plc.axis.Valid

        plc.until(valid_again, what="Valid")
        sees(plc, (power, "Status"))


@pytest.mark.parametrize("cycles", [0, 1, 2, 3])
def test_two_blocks_after_a_bridge_start(bridge, plc, codes, cycles):
    """The first command is only the baseline; that is read before the second one is written."""
    power = plc.block("MC_Power")
    reset = plc.block("MC_Reset")
    plc.set(power, Enable=True)
    for _ in range(cycles):
        plc.cycle()
    plc.set(reset, Execute=True)

    def both():
        assert not power.Error and not reset.Error, (power.ErrorID, reset.ErrorID)
        return power.Status and reset.Done

    plc.until(both, what="power and reset")
    # Each was executed, the first under a second id.
    sent = [code for _, code in commands(plc, codes)]
    assert sent.count(codes["DB_CMD_ENABLE"]) == 2
    assert sent.count(codes["DB_CMD_CLEAR_FAULT"]) == 1


def test_a_stop_does_not_wait_for_an_image(bridge, plc, codes):
    """What keeps others from the connection until a result is read keeps no stop from it."""
    power, stop = plc.block("MC_Power"), plc.block("MC_Stop")
    requests = []
    begin = plc.modbus.begin

    def watch(client, mailbox):
        command = client.WriteMultiple and client.Address == codes["DB_REG_COMMAND_ID"]
        requests.append(mailbox.Data[1] if command else None)
        begin(client, mailbox)

    plc.modbus.begin = watch
    plc.set(power, Enable=True)
    plc.until(lambda: plc.axis.ImageDue, what="an image that is due")
    # The bridge's answers are lost from now on, so that the image stays due.
    plc.modbus.lose_reads = 1000
    del requests[:]
    plc.set(stop, Execute=True)
    plc.until(lambda: codes["DB_CMD_QUICK_STOP"] in requests, 5, what="the stop")
    assert requests.index(codes["DB_CMD_QUICK_STOP"]) <= 1
    plc.modbus.lose_reads = 0
    assert plc.ended(stop) == "Done"


# --- what goes away, what is busy -----------------------------------------------------------------


@pytest.mark.parametrize("name", ["MC_MoveVelocity", "MC_MoveAbsolute"])
def test_a_drive_that_goes_away_while_it_moves(bridge, plc, codes, name):
    args = {"Position": 1e6} if name == "MC_MoveAbsolute" else {}
    move = plc.block(name, Velocity=1000.0, Execute=True, **args)
    sees(plc, (move, "Active"))
    bridge.sim.fault("silence on")
    assert plc.ended(move, 30) == codes["DB_RESULT_INDETERMINATE" if args else "DB_RESULT_OFFLINE"]
    assert not (getattr(move, "InVelocity", False) or move.Active)


def test_a_bridge_that_goes_away_while_a_drive_moves(bridge, plc, codes):
    run = plc.block("MC_MoveVelocity", Velocity=1000.0, Execute=True)
    sees(plc, (run, "InVelocity"))
    assert bridge.stop_bridge() == 0
    # It stops what moves before it goes: the block sees that, or no answer any more.
    assert plc.ended(run, 30) in ("CommandAborted", codes["DB_FAIL_NO_ANSWER"])
    assert not run.InVelocity
    plc.until(lambda: plc.update.Error, 30, "an error of the communication")
    assert plc.update.ErrorID == codes["DB_FAIL_NO_ANSWER"]


def test_old_data_is_not_shown_as_fresh(bridge, plc, codes):
    """As long as a command is written again nothing is read."""
    move = plc.block("MC_MoveRelative", Distance=300.0)
    status = plc.block("MC_ReadStatus", Enable=True)
    assert plc.run(move) == "Done"
    sees(plc, (status, "Standstill"))
    plc.modbus.lose = 1000
    plc.set(move, Execute=True)
    plc.until(lambda: not status.Valid, what="not Valid")
    assert plc.update.Error and plc.update.ErrorID == codes["DB_FAIL_NO_ANSWER"]
    assert move.Busy and not status.Standstill
    plc.modbus.lose = 0
    sees(plc, (status, "Valid"))
    assert plc.ended(move) == "Done" and not plc.update.Error
    assert bridge.sim.get()["position"] == 600


def test_a_full_queue(make_bridge, make_plc, codes):
    """Exception 06 executes nothing: the block tries again until there is room."""
    bridge = make_bridge(modbus={"write-confirm": "accepted"}, bus={"drive-latency-ms": 900})
    plc = make_plc(bridge)
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    assert plc.run(move) == "Done"
    bridge.sim.fault("delay 400")
    drive = bridge.drive()

    def fill():
        block = [0, codes["DB_CMD_READ_PARAMETERS"]]
        while drive.write_words(codes["DB_REG_COMMAND_ID"], block) == 0:
            pass

    fill()
    plc.set(move, Execute=True)
    plc.until(lambda: plc.modbus.exceptions and plc.modbus.exceptions[-1] == 6, what="06")
    bridge.sim.fault("none")
    assert plc.ended(move, 30) == "Done"
    assert bridge.sim.get()["position"] == 600


def test_axes_share_a_connection(make_bridge, make_plc, codes):
    bridge = make_bridge(drives=3)
    plcs = [make_plc(bridge)]
    plcs += [make_plc(bridge, unit, shared=plcs[0]) for unit in (2, 3)]
    first = plcs[0]
    moves = [plc.block("MC_MoveAbsolute", Position=100.0 * plc.axis.UnitId, Execute=True)
             for plc in plcs]
    for plc, move in zip(plcs, moves, strict=True):
        assert plc.ended(move) == "Done"
        assert plc.axis.PositionCounts == 100 * plc.axis.UnitId
    for number in (1, 2, 3):
        assert bridge.sim.get(f"drive{number}")["position"] == 100 * number
    # Also when an answer is lost, and when a stop goes before others.
    relative = plcs[1].block("MC_MoveRelative", Distance=50.0, Execute=True)
    first.modbus.lose = 2
    assert plcs[1].ended(relative) == "Done"
    assert bridge.sim.get("drive2")["position"] == 250
    runs = [plc.block("MC_MoveVelocity", Velocity=1000.0, Execute=True) for plc in plcs]
    first.until(lambda: all(run.InVelocity for run in runs), what="InVelocity")
    stop = plcs[2].block("MC_Stop", Execute=True)
    assert first.ended(stop) == "Done"
    assert [run.CommandAborted for run in runs] == [False, False, True]


def test_a_stop_goes_first_on_a_shared_connection(library, make_bridge, make_plc, codes):
    """However many others wait: after what is on its way and the axis' own read."""
    bridge = make_bridge(drives=4)
    plcs = [make_plc(bridge)]
    plcs += [make_plc(bridge, unit, shared=plcs[0]) for unit in (2, 3, 4)]
    stop = plcs[3].block("MC_Stop")
    requests = []
    begin = plcs[0].modbus.begin

    def watch(client, mailbox):
        requests.append((client.UnitId, client.WriteMultiple))
        begin(client, mailbox)

    plcs[0].modbus.begin = watch
    for _ in range(20):
        plcs[3].set(stop, Execute=True)
        del requests[:]
        plcs[0].until(lambda: (4, True) in requests, what="the stop")
        assert requests.index((4, True)) <= 2, requests
        assert plcs[3].ended(stop) == "Done"
        plcs[3].set(stop, Execute=False)
        plcs[3].cycle()


# --- controllers that tell less, and the guide's program -------------------------------------------


def test_exceptions_without_their_codes(make_bridge, make_plc, codes):
    bridge = make_bridge(modbus={"confirm-ms": 20}, drive={"max-position": 5000})
    plc = make_plc(bridge)
    plc.modbus.tells_codes = False
    move = plc.block("MC_MoveRelative", Distance=300.0, Velocity=12800.0)
    assert plc.run(move) == "Done"
    bridge.sim.fault("delay 40")
    assert plc.run(move) == "Done"
    write = plc.block("MC_WriteParameter", ParameterNumber=codes["DB_PAR_VSMD_ACC"])
    assert plc.run(write, Value=32000.0) == "Done"
    bridge.sim.fault("none")
    assert 5 in plc.modbus.exceptions
    assert bridge.sim.get()["position"] == 600
    assert plc.run(move, Distance=9000.0) == codes["DB_RESULT_LIMIT"]
    assert plc.run(write, Value=-1.0) == codes["DB_RESULT_OUT_OF_RANGE"]
    assert plc.run(write, Value=0.0, ParameterNumber=codes["DB_PAR_POSITION"]) \
        != "Done"


def test_the_guides_program(make_bridge):
    """Runs as it stands on the page, through lost responses, a watchdog and a restart."""
    [text] = [text for text in examples(DOCS / "structured-text.md")
              if "PROGRAM Feeder" in text]
    feeder = Library((DOCS / "drivebridge.st").read_text(encoding="utf-8") + text) \
        .types["Feeder"]()
    bridge = make_bridge(drive={"counts-per-unit": 640, "watchdog-ms": 5000},
                         sim_drive={"set": ["spd=6400", "acc=640000", "dec=640000", "pae=1"]})
    block = ModbusBlock(bridge.port)

    def until(check):
        def cycle():
            feeder.ModbusDone, feeder.ModbusError = block.done, block.error
            feeder.ModbusException = block.exception
            feeder()
            block.cycle(feeder.Client, feeder.Axis.Mailbox)
            time.sleep(0.001)
            return check()

        eventually(cycle, 30)

    def advance(lose=0):
        steps = feeder.Steps
        block.lose = lose
        feeder.Advance = True
        until(lambda: feeder.Steps == steps + 1)
        feeder.Advance = False
        until(lambda: not feeder.Feed.Done)
        assert bridge.sim.get()["position"] == 8000 * (steps + 1)

    feeder.Run = True
    until(lambda: feeder.Ready)
    advance()
    advance(lose=2)
    bridge.restart_bridge()
    block.close()
    block.port = bridge.port
    until(lambda: feeder.Ready and feeder.Update.Valid)
    advance()
    feeder.Hold = True
    until(lambda: feeder.Stopping.Done)
    assert not feeder.Ready
    feeder.Advance = True
    until(lambda: feeder.Fault)
    assert feeder.FaultID == 513
    feeder.Advance = feeder.Hold = False
    until(lambda: not feeder.Feed.Error)
    feeder.Acknowledge = True
    until(lambda: not feeder.Fault)
    feeder.Acknowledge = False
    until(lambda: feeder.Ready)
    advance()
    feeder.Run = False
    until(lambda: bridge.sim.get()["off"] == 1)
    block.close()


def test_the_program_for_openplc(make_bridge):
    """With the words that its runtime reads and writes for ever."""
    bridge = make_bridge(sim_drive={"set": ["spd=64000", "acc=640000", "dec=640000", "pae=1"]})
    [text] = [text for text in examples(DOCS / "structured-text.md") if "CONFIGURATION Gateway" in text]
    places = re.findall(r"(\w+) AT %([IQ])W(\d+)", text)
    program, _, _ = text.partition("CONFIGURATION")
    mover = Library(re.sub(r" AT %\w+", "", program), strict=True).types["Mover"]()
    drive = bridge.drive()

    def scan():
        rx = drive.words(0, 32)
        for name, direction, word in places:
            if direction == "I":
                setattr(mover, name, rx[int(word) - 100])
        mover()
        tx = {int(word) - 100: getattr(mover, name) for name, direction, word in places
              if direction == "Q"}
        drive.write_words(100, [tx[at] for at in range(6)])

    def scan_until(check):
        def once():
            scan()
            return check()

        eventually(once, 30)

    for _ in range(5):
        scan()
    assert mover.stage == 0 and bridge.sim.get()["pos"] == 0
    mover.wanted = True
    scan_until(lambda: bridge.sim.get()["position"] == 64000)
    assert mover.stage == 3
    for _ in range(20):
        scan()
    # However often the same block is written, the drive moves once for each edge.
    assert bridge.sim.get()["pos"] == 1
    mover.wanted = False
    scan()
    mover.wanted = True
    scan_until(lambda: bridge.sim.get()["pos"] == 2)
