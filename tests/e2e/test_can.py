# SPDX-License-Identifier: Apache-2.0
"""VSMD drives on CAN, behind a serial CAN adapter. A PLC program must not notice which bus a drive
hangs on: the same registers, promises and commands as on RS485, and the frames of the document."""

import pytest
from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    DISCRETE,
    HOMED_BIT,
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    ORIGIN_LOST_BIT,
    RESULT_OK,
    RESULT_REFUSED,
    STANDSTILL,
    Refused,
    eventually,
    f32,
)

CAN = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}
PASSIVE_RESULTS = (0x05, 0x0A, 0x0B, 0x04)

# Cyclic reads, what belongs to looking for a drive and identifying it, and what is asked behind reads of
# registers, to know that their answer is through.
BACKGROUND = ("9E#0003", "9E#0A01", "9E#0A07", "8F#00", "9E#0B01")
CONFIRMATION = "0008039E#0102"
# The speed and the position alone: what a command changes, and where a relative move is counted from.
LOOKS = (CONFIRMATION, "0008039E#0001", "0008039E#0101")


@pytest.fixture(name="make_can")
def fixture_make_can(make_bridge):
    def make(bus=None, sim_bus=None, **options):
        return make_bridge(bus={**CAN, "baud": 3000000, **(bus or {})},
                           sim_bus={**CAN, "baud": None, **(sim_bus or {})}, **options)

    return make


@pytest.fixture(name="can")
def fixture_can(make_can):
    return make_can()


def frames(bridge, mark):
    """What was sent since, without the cyclic frames."""
    return [line for line in bridge.sim.sent(mark, polls=True) if not line.endswith(BACKGROUND)]


def sends(bridge, name, *wanted, exception=0, **args):
    """Writes a command; these frames, each burst with its confirmation, went out because of it. A
    confirmation that came before the drive got going is asked for again."""
    drive = bridge.drive()
    mark = bridge.sim.mark()
    assert drive.command(name, **args) == exception
    sent = [line for line in frames(bridge, mark) if line not in LOOKS]
    assert sent == list(wanted)
    assert CONFIRMATION in frames(bridge, mark)


def state(bridge, wanted, number=1):
    eventually(lambda: bridge.drive(number).read("axis_state") == wanted, what=f"state {wanted}")


def counts(bridge, verb):
    return bridge.sim.get()[verb]


# --- commands ---------------------------------------------------------------------------------------


def test_power_and_velocity(can):
    drive = can.drive()
    sends(can, "disable", "00080382#")
    state(can, DISABLED)
    sends(can, "enable", "00080381#")
    state(can, STANDSTILL)
    sends(can, "move_velocity", "00080385#C5480000", target_velocity=-3200)
    state(can, CONTINUOUS)
    eventually(lambda: drive.read("velocity") == -3200, what="full speed")
    # Said again while it decelerates.
    mark = can.sim.mark()
    assert drive.command("stop") == 0
    assert "00080384#00" in frames(can, mark)
    state(can, STANDSTILL)
    assert drive.read("position") == can.sim.get()["position"]


def test_moves(can):
    drive = can.drive()
    sends(can, "move_absolute", "00080386#0000138846480000", target_position=5000,
          target_velocity=12800)
    state(can, DISCRETE)
    state(can, STANDSTILL)
    assert drive.read("position") == 5000
    sends(can, "move_relative", "00080386#0000157C", target_position=500, target_velocity=0)
    eventually(lambda: drive.read("position") == 5500)
    sends(can, "set_position", "00080383#00000007", target_position=7)
    assert drive.read("position") == 7


def test_home(make_can):
    can = make_can(sim_drive={
        "start": 300, "sensor": ["3:below:0"],
        "set": ["zmd=1", "snr=2", "osv=0", "zsd=-6400", "acc=64000", "dec=64000", "pae=1"],
    })
    drive = can.drive()
    sends(can, "home", "0008038A#", "00080389#")
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")


def test_outputs_and_shake(make_can):
    can = make_can(sim_drive={"external": True, "set": ["s5=1", "s6=1", "pae=1", "acc=64000"]})
    sends(can, "set_output", "00080388#0501", output_number=5, output_value=1)
    sends(can, "set_outputs", "00080388#0500", "00080388#0601", output_mask=0b110000,
          output_levels=0b100000)
    sends(can, "set_sv", "0008038D#01FF", output_number=2, output_value=255)
    sends(can, "set_nmos", "0008038E#0200", output_number=3, output_value=0)
    # What a shake is to be comes twice: nothing confirms these frames, and one that is lost must not matter.
    settings = ["0008039B#1000000000", "0008039B#11000000C8", "0008039B#123F800000"]
    sends(can, "shake_start", *settings, *settings, "0008039B#0100000003", shake_start_position=0, shake_end_position=200,
          shake_frequency=1, shake_cycles=3)
    sends(can, "shake_stop", "0008039B#00")


def test_what_the_drive_refuses(can):
    drive = can.drive()
    assert drive.command("disable") == 0
    assert drive.command("move_absolute", target_position=10, target_velocity=0) == DEVICE_FAILURE
    assert drive.read("result") == RESULT_REFUSED


def test_saving_and_reading_parameters(can):
    sends(can, "save_parameters", "00080387#")
    assert can.drive().command("read_parameters") == 0


# --- parameters ---------------------------------------------------------------------------------------


def test_parameters_read_as_on_rs485(make_can):
    can = make_can(sim_drive={"closed-loop": True})
    drive = can.drive()
    assert drive.read("cid") == 1
    assert drive.read("bdr") == 1000000
    assert drive.read("spd") == f32(6400)
    assert drive.read("identity").startswith("VSMD113_025T-1.0.008.17042")
    assert drive.read("acceleration") == f32(64000)
    for row in can.map.parameters():
        assert drive.read(row.name) is not None, row


def test_a_packed_parameter_is_read_modified_and_written(can):
    drive = can.drive()
    assert drive.write("s1f", 3) == 0
    assert drive.write("s2r", 4) == 0
    mark = can.sim.mark()
    assert drive.write("s1r", 2) == 0
    assert frames(can, mark) == ["0008039F#0901", "00080309#03020004", "0008039F#0901"]
    assert (drive.read("s1f"), drive.read("s1r"), drive.read("s2r")) == (3, 2, 4)


def test_writing_mcs_never_disables(can):
    mark = can.sim.mark()
    assert can.drive().write("mcs", 5) == 0
    assert frames(can, mark) == ["00080302#00000005", "0008039F#0201"]
    assert counts(can, "off") == 0


def test_parameters_in_no_document(make_can):
    can = make_can(drives=2, sim_per_drive={2: {"lacks": ["13", "19", "1b"]}})
    can.wait_ready(1)
    can.wait_ready(2)
    drive = can.drive()
    for name, value in (("dmd", 0xFFFF0000), ("sds", 0.5), ("caf", 0xFFFF0002)):
        assert drive.write(name, value) == 0
        assert drive.read(name) == value
        with pytest.raises(Refused) as refused:
            can.drive(2).read(name)
        assert refused.value.code == ILLEGAL_ADDRESS
    assert can.drive(2).read("res") == 0


def test_parameters_out_of_range(can):
    drive = can.drive()
    assert drive.write("bdr", 123456) == ILLEGAL_VALUE
    assert drive.write("bdr", 500000) == 0
    assert drive.read("bdr") == 500000


def test_standard_frames(make_can):
    can = make_can(bus={"frames": "standard"}, sim_bus={"frames": "standard"})
    drive = can.drive()
    assert drive.command("move_absolute", target_position=300, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 300)
    assert "0E6#0000012C" in can.sim.sent(0, polls=True)
    # Registers from 0x20 on are out of reach.
    with pytest.raises(Refused) as refused:
        drive.read("spl")
    assert refused.value.code == ILLEGAL_ADDRESS
    assert drive.write("spl", 5) == ILLEGAL_ADDRESS


# --- several drives -------------------------------------------------------------------------------------


def test_many_drives_each_at_its_place(make_can):
    can = make_can(drives=12)
    for number in range(1, 13):
        assert can.drive(number).command("set_position", target_position=1000 + number) == 0
    for number in range(1, 13):
        assert can.drive(number).read("position") == 1000 + number
    gateway = can.gateway()
    eventually(lambda: gateway.read("bus1_online") == 12)
    # Twelve exchanges of a third of a millisecond, side by side.
    eventually(lambda: gateway.read("bus1_cycle_us") < 20000)


def test_a_silent_drive_leaves_the_others_alone(make_can):
    can = make_can(drives=4)
    can.sim.fault("silence on", "drive2")
    eventually(lambda: not can.drive(1).read("age_ms") > 200)

    def gone():
        try:
            can.drive(2).read("position")
        except Refused as refused:
            return refused.code == 0x0B
        return False

    eventually(gone, what="drive 2 to be offline")
    for number in (1, 3, 4):
        assert can.drive(number).command("move_absolute", target_position=50,
                                         target_velocity=0) == 0
    can.sim.fault("silence off", "drive2")
    can.wait_ready(2)


# --- faults ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["drop", "lose-request", "corrupt", "truncate", "garbage",
                                   "wrong-id", "delay 120"])
def test_relative_moves_on_a_bad_bus_move_once(can, fault):
    drive = can.drive()
    assert drive.command("set_position", target_position=0) == 0
    can.sim.fault(f"{fault} 1")
    answer = drive.command("move_relative", target_position=300, target_velocity=0)
    assert answer == 0 or answer in PASSIVE_RESULTS
    if answer != 0:
        eventually(drive.online)
        if drive.read("result") == RESULT_OK:
            answer = 0
    moved = 300 if answer == 0 else 0
    eventually(lambda: can.sim.get()["shaft"] in (0, 300) and drive.read("axis_state") ==
               STANDSTILL)
    assert can.sim.get()["shaft"] == moved
    assert counts(can, "rmv") == 0


def test_a_lost_reversal_is_no_success(can):
    """That the drive moves proves nothing: it did before."""
    drive = can.drive()
    assert drive.command("move_velocity", target_velocity=3000) == 0
    wanted = 3000
    for number in range(20):
        eventually(lambda: can.sim.get()["velocity"] == wanted, what="full speed")
        can.sim.fault(f"lose-request {1 + number % 2}")
        answer = drive.command("move_velocity", target_velocity=-wanted)
        can.sim.fault("none")
        if answer == 0:
            wanted = -wanted
        eventually(drive.online)
        eventually(lambda: can.sim.get()["velocity"] == wanted, what="what was answered")


def test_a_power_cut_loses_the_origin(make_can):
    can = make_can(sim_drive={
        "start": 300, "sensor": ["3:below:0"],
        "set": ["zmd=1", "snr=2", "osv=0", "zsd=-6400", "acc=64000", "dec=64000", "pae=1"],
    })
    drive = can.drive()
    assert drive.command("home") == 0
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")
    # With pae it has power again at once, and stands at 0 as before.
    can.sim.control("power drive1 off")
    eventually(lambda: not_online(drive), what="the drive to be offline")
    can.sim.control("power drive1 on")
    can.wait_ready(1)
    assert drive.read("status") & (HOMED_BIT | ORIGIN_LOST_BIT) == ORIGIN_LOST_BIT
    # A cable that was out is another thing: the drive still has its homing bit.
    assert drive.command("home") == 0
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")
    can.sim.fault("silence on")
    eventually(lambda: not_online(drive), what="the drive to be offline")
    can.sim.fault("silence off")
    can.wait_ready(1)
    assert drive.read("status") & (HOMED_BIT | ORIGIN_LOST_BIT) == HOMED_BIT


def not_online(drive):
    try:
        return not drive.online()
    except Refused:
        return True


def test_a_lost_confirmation_is_resolved_by_reading_back(can):
    drive = can.drive()
    taken = counts(can, "pos")
    # The position that the target is counted from is answered, the move's confirmation is not.
    for lost in range(1, 4):
        eventually(lambda: drive.read("axis_state") == STANDSTILL)
        can.sim.fault(f"drop {lost}")
        drive.command("move_relative", target_position=100, target_velocity=0)
        can.sim.fault("none")
        eventually(drive.online)
        eventually(lambda: drive.read("axis_state") == STANDSTILL)
        assert can.sim.get()["shaft"] % 100 == 0
    assert can.sim.get()["shaft"] <= 300
    assert counts(can, "pos") - taken <= 3 * 3


def test_answers_of_others_are_counted_and_not_trusted(can):
    drive = can.drive()
    gateway = can.gateway()
    before = gateway.read("bus1_stray_frames") + gateway.read("bus1_timeouts")
    can.sim.fault("wrong-id 3")
    eventually(lambda: gateway.read("bus1_stray_frames") + gateway.read("bus1_timeouts") > before)
    eventually(drive.online)
    assert drive.command("move_absolute", target_position=20, target_velocity=0) == 0


MEASURES_VELOCITY = 1 << 18


def test_reports_take_the_place_of_polls(make_can):
    can = make_can(bus={"report-ms": 10})
    drive = can.drive()
    assert drive.read("capabilities") & MEASURES_VELOCITY
    gateway = can.gateway()
    eventually(lambda: gateway.read("bus1_reports") > 20)
    assert drive.command("move_absolute", target_position=4000, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 4000)
    mark = can.sim.mark()
    start = gateway.read("bus1_reports")
    eventually(lambda: gateway.read("bus1_reports") > start + 50)
    polls = [line for line in can.sim.sent(mark, polls=True) if line.endswith("9E#0003")]
    assert len(polls) < 5


def test_reports_without_speed(make_can):
    """The velocity follows from the positions, and the drive's capabilities say so."""
    can = make_can(bus={"report-ms": 10, "report": "position-status"})
    drive = can.drive()
    assert not drive.read("capabilities") & MEASURES_VELOCITY
    gateway = can.gateway()
    eventually(lambda: gateway.read("bus1_reports") > 20)
    assert drive.command("move_velocity", target_velocity=2000) == 0
    eventually(lambda: abs(drive.read("velocity") - 2000) < 200, what="velocity")
    assert drive.command("stop") == 0
    state(can, STANDSTILL)
    eventually(lambda: drive.read("velocity") == 0)
    assert drive.command("set_position", target_position=0) == 0
    assert drive.command("move_relative", target_position=500) == 0
    eventually(lambda: drive.read("position") == 500)
    mark = can.sim.mark()
    start = gateway.read("bus1_reports")
    eventually(lambda: gateway.read("bus1_reports") > start + 50)
    assert len([line for line in can.sim.sent(mark, polls=True) if line.endswith("9E#0102")]) < 5


def test_reports_of_a_drive_that_tells_two_registers_at_once(make_can):
    """No cyclic read is longer, but those of its identity and of commands are."""
    can = make_can(bus={"report-ms": 10, "report": "position-status"}, sim_drive={"read-max": 2})
    drive = can.drive()
    assert drive.settle("enable") == RESULT_OK
    assert drive.settle("move_velocity", target_velocity=2000) == RESULT_OK
    assert drive.settle("stop") == RESULT_OK
    state(can, STANDSTILL)


def test_reports_of_the_position_alone(make_can):
    """More often than drives are asked; what else there is to know comes with the cyclic reading."""
    can = make_can(bus={"report-ms": 5, "report": "position", "cycle-ms": 100})
    drive = can.drive()
    gateway = can.gateway()
    eventually(lambda: gateway.read("bus1_reports") > 20)
    assert drive.command("move_velocity", target_velocity=2000) == 0
    ages = []
    eventually(lambda: ages.append(drive.read("age_ms")) or len(ages) > 100)
    assert sorted(ages)[50] < 50
    assert drive.command("stop") == 0
    state(can, STANDSTILL)
    goal = drive.read("position") - 300
    assert drive.command("move_absolute", target_position=goal, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == goal)
    state(can, STANDSTILL)


# --- the adapter ------------------------------------------------------------------------------------------


def unreachable(drive, code):
    try:
        drive.read("position")
    except Refused as refused:
        return refused.code == code
    return False


def test_bus_off_and_back(can):
    drive = can.drive()
    gateway = can.gateway()
    can.sim.fault("bus-off on", "line")
    eventually(lambda: unreachable(drive, 0x0A), what="the bus to be down")
    assert drive.command("enable") == 0x0A
    eventually(lambda: gateway.read("line1_bus_offs") > 0 or gateway.read("bus1_last_error"))
    can.sim.fault("bus-off off", "line")
    can.wait_ready(1)
    assert drive.command("move_absolute", target_position=77, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 77)


@pytest.mark.parametrize("late", [False, True])
def test_a_stop_for_a_bus_that_is_down_is_kept(can, late):
    """Its writer learns that the bus is down; the drive stands when it is back."""
    drive = can.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=3000) == 0
    eventually(lambda: can.sim.get()["velocity"] == 3000, what="full speed")
    can.sim.fault("bus-off on", "line")
    if late:
        eventually(lambda: unreachable(drive, 0x0A), what="the bus to be down")
    assert drive.command("stop") == 0x0A
    assert can.sim.get()["velocity"] == 3000
    can.sim.fault("bus-off off", "line")
    eventually(lambda: can.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: drive.read("result") == RESULT_OK, what="the end of the stop")


def test_unplugged_and_plugged_in_again(can):
    drive = can.drive()
    can.sim.stop()
    eventually(lambda: unreachable(drive, 0x0A), what="the bus to be down")
    can.sim.start()
    can.wait_ready(1)
    assert drive.command("set_position", target_position=5) == 0


def test_an_adapter_that_comes_later(make_can):
    can = make_can(start_sim=False)
    drive = can.drive()
    assert unreachable(drive, 0x0A)
    can.sim.start()
    can.wait_ready(1)


def test_another_bit_rate_is_told(make_can):
    can = make_can(bus={"bitrate": 500000}, wait_online=False)
    drive = can.drive()
    eventually(lambda: unreachable(drive, 0x0A) or unreachable(drive, 0x0B))
    assert drive.command("enable") in (0x0A, 0x0B)


# --- the promises -------------------------------------------------------------------------------------------


def test_the_same_id_again_is_not_executed(can):
    drive = can.drive()
    drive.command("enable", command_id=1)
    assert drive.command("move_relative", command_id=2, target_position=150, target_velocity=0) == 0
    for _ in range(5):
        assert drive.command("move_relative", command_id=2, target_position=150,
                             target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 150)
    assert can.sim.get()["shaft"] == 150


def test_the_end_stops_moving_drives(make_can):
    can = make_can(drives=3)
    for number in (1, 2, 3):
        assert can.drive(number).command("move_velocity", target_velocity=2000) == 0
    mark = can.sim.mark()
    assert can.stop_bridge() == 0
    # One frame for all of them.
    assert "00040384#00" in can.sim.sent(mark, polls=True)
    for number in (1, 2, 3):
        eventually(lambda number=number: can.sim.get(f"drive{number}")["velocity"] == 0)
