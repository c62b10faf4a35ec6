# SPDX-License-Identifier: Apache-2.0
"""What an electrician reads: a line for each event, with bus, drive and what to check."""

import os
import signal
import subprocess
from pathlib import Path

import pytest
from bridgelib import CONTINUOUS, ahead_of_tests, as_shown, eventually, find_program

ME = as_shown("127.0.0.1")
OVER_CURRENT = 1 << 21  # in the status of a VSMD drive


def lines(bridge, *words):
    return [line for line in bridge.log_path.read_text().splitlines()
            if all(word in line for word in words)]


def told(bridge, *words):
    return eventually(lambda: lines(bridge, *words), what=f"a line with {words}")


def test_what_happens_to_a_drive(bridge):
    told(bridge, "bus line: ", "is up")
    told(bridge, "bus line: drive drive1: answers at address 1: enabled, standing, position 0 ",
         "error none")
    bridge.sim.fault("silence on")
    told(bridge, "bus line: drive drive1: does not answer at address 1; check its power, wiring")
    bridge.sim.fault("silence off")
    eventually(lambda: len(lines(bridge, "drive drive1: answers")) == 2)
    assert len(lines(bridge, "does not answer")) == 1


def test_who_was_late_once_is_missed_when_it_is_gone(bridge):
    bridge.sim.fault("delay 90")
    told(bridge, "ms after a request")
    bridge.sim.fault("silence on")
    told(bridge, "drive drive1: does not answer at address 1")


def test_a_fault_is_told_with_what_to_check(bridge):
    bridge.sim.control(f"bits drive1 {OVER_CURRENT:#x}")
    drive = bridge.drive()
    eventually(lambda: drive.read("error") != 0)
    assert len(told(bridge, "bus line: drive drive1: reports the fault over_current ", "clear_fault")) == 1
    bridge.sim.control("bits drive1 0")
    told(bridge, "bus line: drive drive1: reports no fault any more")


def test_a_drive_that_was_never_there(make_bridge):
    bridge = make_bridge(faults={1: ["silence on"]}, wait_online=False)
    told(bridge, "drive drive1: does not answer at address 1")


def test_who_comes_and_goes(bridge):
    told(bridge, f"client {ME}: connected", "may read and write")
    bridge.drive().close()
    bridge.units.clear()
    told(bridge, f"client {ME}: disconnected")


def test_the_watchdog_names_who_fell_silent(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 300})
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=3200) == 0
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)
    drive.close()
    bridge.units.clear()
    told(bridge, f"bus line: drive drive1: client {ME}: it was silent for too long")
    eventually(lambda: bridge.sim.get()["velocity"] == 0)


def test_a_refused_write_is_told_with_its_reason(make_bridge):
    bridge = make_bridge(drive={"max-velocity": 10000})
    drive = bridge.drive()
    before = f"bus line: drive drive1: client {ME}: "
    for _ in range(20):
        assert drive.command("move_velocity", target_velocity=20000) == 3
    assert len(told(bridge, before, "command move_velocity is refused: limit (result 9)")) <= 4
    assert bridge.stop_bridge() == 0
    counted = lines(bridge, before, "command move_velocity is refused: limit", "times more in the last ")
    assert len(counted) == 1


def test_what_the_drive_refuses_is_told(bridge):
    drive = bridge.drive()
    assert drive.write("mcs", 9) == 3
    told(bridge, f"client {ME}: a write to register", "is refused: out_of_range (result 4)")
    assert drive.command("move_absolute", command_id=7, target_position=5) == 4
    assert drive.command("move_absolute", command_id=7, target_position=5) == 4  # from memory
    bridge.sim.fault("silence on")
    eventually(lambda: not drive.online())
    assert drive.command("enable") == 0x0B
    told(bridge, f"client {ME}: command enable is refused: offline (result 14)")
    assert len(lines(bridge, "command move_absolute is refused: restarted (result 7)")) == 1


def test_a_thousand_times_are_a_few_lines_and_a_count(bridge):
    for _ in range(40):
        bridge.raw().close()
    eventually(lambda: bridge.gateway().read("accepted") >= 40)
    # Of a connection that has ended before the kernel is asked nobody knows the user: those are another kind of line.
    anybody = "client 127.0.0.1, user "
    assert len(lines(bridge, anybody)) <= 8
    assert bridge.stop_bridge() == 0
    assert len(lines(bridge, anybody, "times more in the last ")) in (1, 2)


@pytest.mark.parametrize(("level", "present", "absent"), [
    ("error", [], ["is up", "answers", "does not answer"]),
    ("warning", ["does not answer"], ["is up", "answers at"]),
    ("notice", ["is up", "answers at", "does not answer"], []),
])
def test_levels_of_a_bus(make_bridge, level, present, absent):
    bridge = make_bridge(bus={"log": level}, modbus={"log": "notice"})
    drive = bridge.drive()
    bridge.sim.fault("silence on")
    eventually(lambda: not drive.online())
    assert bridge.stop_bridge() == 0
    for text in present:
        assert lines(bridge, "bus line: ", text)
    for text in absent:
        assert not lines(bridge, "bus line: ", text)
    assert lines(bridge, "listening on ")
    assert not lines(bridge, "client ")


def listening_port(pid):
    """The port on which a process listens, as the kernel knows it."""
    sockets = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            sockets.add(os.readlink(entry))
        except FileNotFoundError:
            pass
    for line in Path(f"/proc/{pid}/net/tcp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
            return int(fields[1].split(":")[1], 16)
    return None


def test_a_log_that_hangs_delays_nothing(bridge):
    """Standard error is a pipe that nobody reads: drives move, clients are served, and the end
    comes in time."""
    assert bridge.stop_bridge() == 0
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with pytest.raises(BlockingIOError):
        while True:
            os.write(writing, b"x" * 4096)
    os.set_blocking(writing, True)
    with ahead_of_tests():
        bridge.process = subprocess.Popen([find_program("drivebridged"), "--config", bridge.config_path], stderr=writing)
    os.close(writing)
    bridge.port = eventually(lambda: listening_port(bridge.process.pid))
    bridge.wait_ready()
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=500, target_velocity=12800) == 0
    eventually(lambda: drive.read("position") == 500)
    bridge.process.send_signal(signal.SIGTERM)
    assert bridge.process.wait(5) == 0
    os.close(reading)
