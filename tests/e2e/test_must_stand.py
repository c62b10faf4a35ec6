# SPDX-License-Identifier: Apache-2.0
"""A drive that must stand: the record outlives the drive's and the port's absence, a reload and a restart, and ends
with what is read after the stop."""

import signal

from bridgelib import (
    NO_PATH,
    CONTINUOUS,
    OFFLINE,
    RUNS_ON_ERROR,
    STANDSTILL,
    STOPPING,
    Refused,
    bit,
    eventually,
)
from holdlib import Hand

SPEED = 3200


def moves(bridge, number=1):
    drive = bridge.drive(number)
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=SPEED) == 0
    eventually(lambda: drive.read("velocity") == SPEED, what="full speed")
    return drive


def cause(drive):
    codes = drive.row("must_stand_cause").codes
    value = drive.read("must_stand_cause")
    return next(name for name, code in codes.items() if code == value)


def must_stand(drive):
    return bool(drive.read("status") & bit("status", "must_stand"))


def stops_sent(bridge, mark):
    return bridge.sim.sent(mark).count("1 stp")


def record(bridge):
    """The file in which the service keeps what must stand."""
    return bridge.control_path.with_name(bridge.control_path.name + ".must-stand")


def try_stop(drive):
    try:
        return drive.command("stop")
    except Refused as refused:
        return refused.code


def kill(bridge):
    bridge.units.clear()
    bridge.process.send_signal(signal.SIGKILL)
    assert bridge.process.wait(5) == -signal.SIGKILL


def start_again(bridge):
    bridge.wait_online = False
    bridge.start_bridge()
    drive = bridge.drive()
    eventually(drive.online)
    return drive


def test_it_is_shown_while_it_lasts(make_bridge):
    bridge = make_bridge(drive={"stop-reaction-ms": 300, "watchdog-ms": 20000})
    drive = moves(bridge)
    assert cause(drive) == "none"
    assert drive.read("must_stand_ms") == 0
    bridge.sim.fault("runaway on")
    assert try_stop(drive) != 0
    assert must_stand(drive)
    assert cause(drive) == "client"
    assert drive.read("axis_state") == STOPPING
    eventually(lambda: drive.read("error") == RUNS_ON_ERROR, what="runs_on")
    count = drive.read("must_stand_count")
    since = drive.read("must_stand_ms")
    mark = bridge.sim.mark()
    eventually(lambda: stops_sent(bridge, mark) >= 5, what="stops that go on")
    assert drive.read("must_stand_count") > count
    assert drive.read("must_stand_ms") > since
    bridge.sim.fault("runaway off")
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    assert not must_stand(drive)
    assert drive.read("must_stand_count") == 0


def test_a_watchdog_s_stop_outlives_silence_while_it_brakes(make_bridge):
    """The drive is away when its stop would be seen, and comes back moving."""
    bridge = make_bridge(drive={"watchdog-ms": 300, "on-client-loss": "stop"},
                         modbus={"stale": "value"})
    drive = moves(bridge)
    bridge.sim.fault("silence on")
    bridge.told("it was silent for too long")
    eventually(lambda: drive.read("axis_state") == OFFLINE, what="silence")
    assert must_stand(drive)
    assert cause(drive) == "watchdog"
    bridge.sim.fault("silence off")
    bridge.sim.fault("lose-request 1")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not must_stand(drive), what="the end of the record")


def test_it_outlives_a_kill(make_bridge):
    bridge = make_bridge(drive={"stop-reaction-ms": 300, "watchdog-ms": 20000})
    drive = moves(bridge)
    bridge.sim.fault("runaway on")
    assert try_stop(drive) != 0
    eventually(lambda: record(bridge).exists(), what="the file")
    kill(bridge)
    mark = bridge.sim.mark()
    drive = start_again(bridge)
    eventually(lambda: stops_sent(bridge, mark) >= 2, what="stops by the new run")
    assert cause(drive) == "restart"
    bridge.sim.fault("runaway off")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not must_stand(drive), what="the end of the record")
    eventually(lambda: not record(bridge).exists(), what="the file to go")


def test_a_drive_that_stood_is_sent_nothing_after_a_kill(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 20000})
    drive = moves(bridge)
    assert drive.command("stop") == 0
    eventually(lambda: not must_stand(drive), what="the end of the record")
    eventually(lambda: not record(bridge).exists(), what="no file")
    kill(bridge)
    mark = bridge.sim.mark()
    start_again(bridge)
    assert stops_sent(bridge, mark) == 0


def test_a_drive_that_did_not_confirm_its_end_is_stopped_by_the_next_run(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 20000})
    moves(bridge)
    bridge.sim.fault("silence on")
    eventually(lambda: not bridge.drive().online(), what="silence")
    bridge.units.clear()
    assert bridge.stop_bridge() == 0
    assert record(bridge).exists()
    bridge.sim.fault("silence off")
    drive = start_again(bridge)
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not must_stand(drive), what="the end of the record")


def test_it_outlives_a_reload_that_replaces_the_drive(make_bridge):
    bridge = make_bridge(drive={"stop-reaction-ms": 300, "watchdog-ms": 20000,
                                "on-exit": "none"})
    drive = moves(bridge)
    bridge.sim.fault("runaway on")
    assert try_stop(drive) != 0
    bridge.sections["drive drive1"]["counts-per-unit"] = 7
    bridge.reload()
    drive = bridge.drive()
    eventually(drive.online)
    assert drive.read("axis_state") != CONTINUOUS
    assert must_stand(drive)
    mark = bridge.sim.mark()
    eventually(lambda: stops_sent(bridge, mark) >= 2, what="stops for the new drive")
    bridge.sim.fault("runaway off")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not must_stand(drive), what="the end of the record")


def test_it_outlives_a_reload_that_gives_the_drive_another_name(make_bridge):
    """By two reloads: one takes it out, the other one brings it back."""
    bridge = make_bridge(drive={"stop-reaction-ms": 300, "watchdog-ms": 20000, "on-exit": "none"})
    drive = moves(bridge)
    bridge.sim.fault("runaway on")
    assert try_stop(drive) != 0
    keys = bridge.sections.pop("drive drive1")
    bridge.reload()
    bridge.sections["drive another"] = keys
    bridge.reload()
    drive = bridge.drive()
    eventually(drive.online)
    bridge.sim.fault("runaway off")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not must_stand(drive), what="the end of the record")


CAN = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}
ALONE = {"watchdog-ms": 0, "on-client-loss": "none", "on-exit": "none"}


def test_what_is_held_is_stopped_by_a_reload_that_changes_the_drive(make_bridge):
    bridge = make_bridge(drive=ALONE)
    assert bridge.drive().command("enable") == 0
    with Hand(bridge.control_path) as hand:
        assert hand.hold(SPEED, 1000) == "ok"
        bridge.sections["drive drive1"]["counts-per-unit"] = 7
        bridge.reload()
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")


def test_what_is_held_is_stopped_when_the_service_ends(make_bridge):
    bridge = make_bridge(drive=ALONE)
    assert bridge.drive().command("enable") == 0
    with Hand(bridge.control_path) as hand:
        assert hand.hold(SPEED, 1000) == "ok"
        assert bridge.stop_bridge() == 0
        assert bridge.sim.get()["velocity"] == 0


def test_what_was_held_is_stopped_by_the_next_run(make_bridge):
    bridge = make_bridge(drive=ALONE)
    assert bridge.drive().command("enable") == 0
    with Hand(bridge.control_path) as hand:
        assert hand.hold(SPEED, 1000) == "ok"
        eventually(lambda: record(bridge).exists(), what="the file")
        kill(bridge)
    assert bridge.sim.get()["velocity"] > 0
    start_again(bridge)
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")


def test_a_file_that_nobody_wrote_is_passed_over(make_bridge):
    bridge = make_bridge()
    bridge.units.clear()
    assert bridge.stop_bridge() == 0
    record(bridge).write_text(f"rubbish\n1 0 move_velocity {bridge.link}\n9 0 stop {bridge.link}\n")
    mark = bridge.sim.mark()
    start_again(bridge)
    assert stops_sent(bridge, mark) == 0
    assert "understand a line of" in bridge.log_path.read_text()


def test_a_stop_for_a_bus_that_is_down_outlives_a_kill(make_bridge):
    """And another one, while the bus is still down."""
    bridge = make_bridge(bus={**CAN, "baud": 3000000}, sim_bus={**CAN, "baud": None}, drive={"watchdog-ms": 0})
    moves(bridge)
    bridge.sim.fault("bus-off on", "line")
    drive = bridge.drive()
    assert try_stop(drive) == NO_PATH
    eventually(lambda: record(bridge).exists(), what="the file")
    for _ in range(2):
        kill(bridge)
        bridge.wait_online = False
        bridge.start_bridge()
        eventually(lambda: record(bridge).exists(), what="the file of the next run")
    assert bridge.sim.get()["velocity"] == SPEED
    bridge.sim.fault("bus-off off", "line")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
    eventually(lambda: not record(bridge).exists(), what="the file to go")


def test_a_stop_for_a_bus_that_is_down_outlives_a_reload(make_bridge):
    bridge = make_bridge(bus={**CAN, "baud": 3000000}, sim_bus={**CAN, "baud": None}, drive={"watchdog-ms": 0, "on-exit": "none"})
    moves(bridge)
    bridge.sim.fault("bus-off on", "line")
    assert try_stop(bridge.drive()) == NO_PATH
    bridge.sections["drive drive1"]["counts-per-unit"] = 7
    bridge.reload()
    assert bridge.sim.get()["velocity"] == SPEED
    bridge.sim.fault("bus-off off", "line")
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
