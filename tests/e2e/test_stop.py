# SPDX-License-Identifier: Apache-2.0
"""Stop comes first, and silence is safe when the bridge itself ends."""

import contextlib
import itertools
import signal
import socket
import struct
import threading
import time

import pytest
from bridgelib import (
    BUSY,
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    ILLEGAL_VALUE,
    LATCHED_BIT,
    MOVE_VELOCITY,
    NO_ERROR,
    RESULT_CANCELLED,
    RESULT_OK,
    RESULT_RUNS_ON,
    RUNS_ON_ERROR,
    STANDSTILL,
    STOP,
    Client,
    Refused,
    encode,
    eventually,
)


def fc16(bridge, name, **args):
    """The PDU of one command with all its arguments, target_position and target_velocity."""
    code = int(bridge.commands[name]["code"])
    words = [code, *encode("i32", args.get("target_position", 0)),
             *encode("f32", args.get("target_velocity", 0))]
    address = bridge.map.find("command").address
    return struct.pack(">BHHB", 16, address, len(words), 2 * len(words)) + struct.pack(
        f">{len(words)}H", *words)


def starts_moving(bridge, number=1, velocity=3200):
    drive = bridge.drive(number)
    assert drive.command("move_velocity", target_velocity=velocity) == 0
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)


def test_stop_overtakes_and_cancels_what_waits(make_bridge):
    """Six moves wait behind a slow drive; a stop goes out next, and none of them after it."""
    bridge = make_bridge(bus={"drive-latency-ms": 500})
    bridge.sim.fault("delay 100")
    mark = bridge.sim.mark()
    with bridge.raw() as mover, bridge.raw() as stopper:
        for number in range(1, 7):
            mover.send(mover.adu(number, 1, fc16(bridge, "move_absolute",
                                                 target_position=number * 10000,
                                                 target_velocity=1000)))
        eventually(lambda: bridge.sim.sent(mark), what="the first move on the wire")
        assert stopper.request(fc16(bridge, "stop"))[0] == 16
        answers = [mover.receive() for _ in range(6)]
    bridge.sim.fault("none")
    assert [transaction for transaction, _, _ in answers] == [1, 2, 3, 4, 5, 6]
    cancelled = [pdu for _, _, pdu in answers if pdu == bytes([0x90, DEVICE_FAILURE])]
    lines = bridge.sim.sent(mark)
    # What had gone out before the stop may stand; nothing may follow it.
    assert lines[-1] == "1 stp"
    assert len(lines) - 1 + len(cancelled) >= 6
    assert len(cancelled) >= 4
    drive = bridge.drive()
    assert drive.read("result") == RESULT_OK
    assert drive.read("result_command") == int(bridge.commands["stop"]["code"])
    eventually(lambda: drive.read("axis_state") == STANDSTILL)


def test_a_cancelled_id_is_remembered_as_cancelled(make_bridge):
    bridge = make_bridge(bus={"drive-latency-ms": 500})
    drive = bridge.drive()
    assert drive.command("move_absolute", 1, target_position=0, target_velocity=1000) != 0
    bridge.sim.fault("delay 100")
    mark = bridge.sim.mark()
    with bridge.raw() as mover, bridge.raw() as stopper:
        mover.send(mover.adu(1, 1, fc16(bridge, "move_absolute", target_position=9000)))
        eventually(lambda: bridge.sim.sent(mark))
        words = [2, int(bridge.commands["move_absolute"]["code"]), *encode("i32", 9),
                 *encode("f32", 9)]
        address = drive.row("command_id").address
        mover.send(mover.adu(2, 1, struct.pack(">BHHB6H", 16, address, 6, 12, *words)))
        eventually(lambda: drive.read("result_id") == 2)
        assert stopper.request(fc16(bridge, "stop"))[0] == 16
        mover.receive()
        assert mover.receive()[2] == bytes([0x90, DEVICE_FAILURE])
    bridge.sim.fault("none")
    # The same id again is told the same end, and does not move.
    assert drive.command("move_absolute", 2, target_position=9, target_velocity=9) == DEVICE_FAILURE
    assert drive.read("write_result") == RESULT_CANCELLED
    assert not [line for line in bridge.sim.sent(mark) if line == "1 pos 9 spd=9"]


def test_wrong_arguments_do_not_keep_a_stop_from_the_drive(bridge):
    """A PLC writes its whole block, in which 0/0 has become the velocity."""
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=2000) == 0
    block = [0, MOVE_VELOCITY, 0, 0, 0x7FC0, 0]
    assert drive.write_words(100, block) == ILLEGAL_VALUE
    assert drive.read("axis_state") == CONTINUOUS
    block[1] = STOP
    assert drive.write_words(100, block) == 0
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    assert drive.read("target_velocity") == 2000.0


def test_a_stop_of_one_drive_leaves_the_others_alone(make_bridge):
    bridge = make_bridge(drives=3)
    for number in (1, 2, 3):
        starts_moving(bridge, number)
    assert bridge.drive(2).command("stop") == 0
    eventually(lambda: bridge.drive(2).read("axis_state") == STANDSTILL)
    for number in (1, 3):
        assert bridge.drive(number).read("axis_state") == CONTINUOUS


@pytest.mark.parametrize("fault", ["drop 4", "lose-request 4", "corrupt 4", "truncate 4"])
def test_a_stop_is_repeated_until_confirmed(bridge, fault):
    starts_moving(bridge)
    bridge.sim.fault(fault)
    assert bridge.drive().command("stop") == 0
    assert bridge.sim.get()["velocity"] == 0 or bridge.drive().read("result") == RESULT_OK
    eventually(lambda: bridge.sim.get()["velocity"] == 0)
    assert bridge.sim.get()["stp"] >= 1


def test_a_dead_drive_takes_nobody_elses_stops(make_bridge):
    """A PLC that says stop and disable, again and again, to a drive without power."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 20000})
    starts_moving(bridge, 1)
    bridge.sim.fault("silence on", "drive2")
    eventually(lambda: not bridge.drive(2).online(), what="drive 2 to be offline")
    living = bridge.drive(1)
    with bridge.raw() as raw:
        for number in range(24):
            raw.send(raw.adu(number, 2, fc16(bridge, ("stop", "disable", "quick_stop")[number % 3])))
        answers = {raw.receive()[2] for _ in range(24)}
        assert bytes([0x90, BUSY]) not in answers
        assert living.command("stop") == 0
        eventually(lambda: living.read("axis_state") == STANDSTILL)
        # And so do the watchdog and a stop of all.
        starts_moving(bridge, 1)
        assert living.write("watchdog_ms", 500) == 0
        living.close()
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")


def test_a_drive_that_takes_a_stop_and_runs_on_is_told_of(make_bridge):
    bridge = make_bridge(drive={"stop-reaction-ms": 300}, modbus={"confirm-ms": 2000})
    starts_moving(bridge)
    bridge.sim.fault("runaway on")
    drive = bridge.drive()
    assert drive.command("stop") == DEVICE_FAILURE
    assert drive.read("result") == RESULT_RUNS_ON
    assert drive.read("error") == RUNS_ON_ERROR
    bridge.told("the stop is repeated")
    assert bridge.sim.get()["velocity"] == 3200
    bridge.sim.fault("runaway off")
    eventually(lambda: bridge.sim.get()["velocity"] == 0)
    eventually(lambda: drive.read("error") == NO_ERROR)


def test_the_last_resort_for_a_drive_that_runs_on(make_bridge):
    bridge = make_bridge(drive={"stop-reaction-ms": 300, "on-stop-failure": "disable"})
    starts_moving(bridge)
    bridge.sim.fault("runaway on")
    bridge.drive().command("stop")
    eventually(lambda: bridge.drive().read("axis_state") == DISABLED)
    assert "1 off" in bridge.sim.sent()


def test_a_stop_waits_for_a_drive_that_is_away(bridge):
    starts_moving(bridge)
    bridge.sim.fault("silence on")
    drive = bridge.drive()
    with bridge.raw() as raw:
        raw.send(raw.adu(1, 1, fc16(bridge, "stop")))
        eventually(lambda: not drive.online(), what="the drive to be offline")
        assert bridge.sim.get()["velocity"] == 3200
        bridge.sim.fault("silence off")
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the stop to reach the drive")
        assert raw.receive()[0] == 1


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({}, "stp"),
        ({"on-client-loss": "quick-stop"}, "stp 1"),
        ({"on-client-loss": "none", "on-exit": "disable"}, "off"),
        ({"on-exit": "stop"}, "stp"),
    ],
)
def test_the_end_of_the_bridge_stops_what_moves(make_bridge, keys, line):
    bridge = make_bridge(drive=keys)
    starts_moving(bridge)
    assert bridge.stop_bridge() == 0
    assert f"1 {line}" in bridge.sim.sent()
    eventually(lambda: bridge.sim.get()["velocity"] == 0)


def test_the_end_of_the_bridge_stops_on_a_bad_line(bridge):
    starts_moving(bridge)
    bridge.sim.fault("lose-request 2")
    assert bridge.stop_bridge() == 0
    eventually(lambda: bridge.sim.get()["velocity"] == 0)


def test_the_end_of_the_bridge_waits_for_nobody(bridge):
    """Neither a silent drive nor a client that does not read delays it beyond its time."""
    starts_moving(bridge)
    bridge.sim.fault("silence on")
    with bridge.raw() as raw:
        raw.send(raw.adu(1, 1, struct.pack(">BHH", 3, 0, 10)) * 200)
        assert bridge.stop_bridge() == 0
    assert "drive drive1: is released and did not confirm its on-exit" in bridge.log_path.read_text()


def test_on_exit_none_leaves_it_moving(make_bridge):
    bridge = make_bridge(drive={"on-exit": "none"})
    starts_moving(bridge)
    mark = bridge.sim.mark()
    assert bridge.stop_bridge() == 0
    assert not [text for text in bridge.sim.sent(mark) if " stp" in text or " off" in text]
    position = bridge.sim.get()["position"]
    eventually(lambda: bridge.sim.get()["velocity"] == 3200)
    eventually(lambda: bridge.sim.get()["position"] > position)


def test_watchdog_stops_when_the_plc_falls_silent(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 300})
    starts_moving(bridge)
    bridge.drive().close()
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")
    assert "1 stp" in bridge.sim.sent()
    bridge.units.clear()
    drive = bridge.drive()
    assert drive.read("watchdog_trips") == 1
    assert drive.read("status") & LATCHED_BIT
    # Latched: an explicit reset is needed before it moves again.
    assert drive.command("move_velocity", target_velocity=100) == DEVICE_FAILURE
    eventually(lambda: drive.read("axis_state") not in (CONTINUOUS, DISABLED))


def test_a_talking_client_feeds_the_watchdog(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 300})
    starts_moving(bridge)
    drive = bridge.drive()
    start = drive.read("position")
    eventually(lambda: drive.read("position") > start + 3200, what="a second of travel")
    assert drive.read("watchdog_trips") == 0
    assert drive.read("axis_state") == CONTINUOUS
    assert drive.command("stop") == 0


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.5"])
def test_a_monitor_does_not_feed_the_watchdog(make_bridge, address):
    """On the gateway itself or elsewhere: it may write, but it only reads."""
    bridge = make_bridge(drive={"watchdog-ms": 500})
    with Client(bridge, "127.0.0.1") as plc, Client(bridge, address) as monitor:
        assert plc.command("enable") == 0
        assert plc.command("move_velocity", target_velocity=3200) == 0
        start = monitor.read("position")
        # The PLC only reads meanwhile, over the connection that it commands with.
        eventually(lambda: plc.read("position") > start + 3200, what="a second of travel")
        assert plc.read("watchdog_trips") == 0
        # It dies, connected as it is.
        eventually(lambda: monitor.read("watchdog_trips") == 1, what="the watchdog")
        eventually(lambda: bridge.sim.get()["velocity"] == 0)


def test_who_only_stops_is_no_commander(make_bridge):
    """A panel may stop a drive and go on showing it; the PLC that moves it next is missed all the same."""
    bridge = make_bridge(drive={"watchdog-ms": 500})
    with Client(bridge, "127.0.0.1") as plc, Client(bridge, "127.0.0.5") as panel:
        assert plc.command("enable") == 0
        assert plc.command("move_velocity", target_velocity=3200) == 0
        assert panel.command("stop") == 0
        assert plc.command("move_velocity", target_velocity=3200) == 0
        eventually(lambda: panel.read("watchdog_trips") == 1, what="the watchdog")


def test_monitors_feed_where_every_request_does(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 300, "watchdog-feed": "requests"})
    starts_moving(bridge)
    with Client(bridge, "127.0.0.5") as monitor:
        start = monitor.read("position")
        eventually(lambda: monitor.read("position") > start + 3200, what="a second of travel")
        assert monitor.read("watchdog_trips") == 0


def test_what_is_left_in_buffers_feeds_nothing(make_bridge):
    """A PLC that asks for more than its pace allows, and is cut off: what it had sent is served for
    many seconds more."""
    bridge = make_bridge(modbus={"max-requests-per-second": 20}, drive={"watchdog-ms": 500})
    with Client(bridge, "127.0.0.1") as plc, Client(bridge, "127.0.0.5") as witness:
        assert plc.command("enable") == 0
        assert plc.command("move_velocity", target_velocity=3200) == 0
        flood = bridge.raw()
        flood.send(flood.adu(1, 1, bytes.fromhex("0600680001")) * 400)
        plc.close()
        flood.socket.shutdown(socket.SHUT_WR)
        began = time.monotonic()
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")
        assert time.monotonic() - began < 3
        assert witness.read("watchdog_trips") == 1
        flood.close()


def test_a_plc_waits_through_a_pause_of_the_bridge(make_bridge):
    """Its one request stands for all its drives: it could not ask for the next one."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 1000})
    with Client(bridge, "127.0.0.1") as plc:
        for unit in (1, 2):
            plc.number = unit
            assert plc.command("enable") == 0
            assert plc.command("move_velocity", target_velocity=320) == 0
        bridge.process.send_signal(signal.SIGSTOP)
        plc.number = 1

        def ask():
            with contextlib.suppress(Refused):  # what is known of the drive is old by then
                plc.read("position")

        asked = threading.Thread(target=ask)
        asked.start()
        time.sleep(1.5)  # longer than both watchdogs: nothing else tells that the time is over
        bridge.process.send_signal(signal.SIGCONT)
        asked.join()
        for unit in (1, 2):
            plc.number = unit
            assert plc.read("watchdog_trips") == 0, unit
            assert plc.command("stop") == 0


def keep_asking(drive, seconds, ask):
    """What a PLC's I/O scanner does by itself."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not drive.read("watchdog_trips"):
        ask()


def test_reading_does_not_feed_a_watchdog_that_waits_for_writes(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 500, "watchdog-feed": "writes"})
    starts_moving(bridge)
    drive = bridge.drive()
    keep_asking(drive, 1.5, lambda: drive.write("heartbeat", 1))
    assert drive.read("watchdog_trips") == 0
    assert eventually(lambda: drive.read("watchdog_trips"), timeout=5) == 1
    eventually(lambda: bridge.sim.get()["velocity"] == 0)


@pytest.mark.parametrize("view", ["drive", "gateway"])
def test_only_a_beating_heart_feeds_a_watchdog_that_waits_for_it(make_bridge, view):
    bridge = make_bridge(drive={"watchdog-ms": 500, "watchdog-feed": "heartbeat"})
    starts_moving(bridge)
    drive = bridge.drive()
    unit = drive if view == "drive" else bridge.gateway()
    beats = itertools.count(1)
    keep_asking(drive, 1.5, lambda: unit.write("heartbeat", next(beats)))
    assert drive.read("watchdog_trips") == 0
    assert drive.read("axis_state") == CONTINUOUS
    # The program dies; its scanner goes on with reading, the last heartbeat and the last command.
    last = unit.read("heartbeat")
    assert last >= 2
    keep_asking(drive, 5, lambda: (unit.write("heartbeat", last),
                                   drive.command("move_velocity", target_velocity=3200)))
    assert drive.read("watchdog_trips") == 1
    eventually(lambda: bridge.sim.get()["velocity"] == 0)
    assert drive.read("heartbeat") == (last if view == "drive" else 0)


def test_a_dead_plc_is_not_kept_alive_by_another(make_bridge):
    """Two clients that write different heartbeats, and neither changes its own."""
    bridge = make_bridge(drive={"watchdog-ms": 500, "watchdog-feed": "heartbeat"})
    starts_moving(bridge)
    with Client(bridge, "127.0.0.2") as plc, Client(bridge, "127.0.0.3") as other:
        keep_asking(plc, 5, lambda: (plc.write("heartbeat", 1), other.write("heartbeat", 2)))
        assert plc.read("watchdog_trips") == 1
