# SPDX-License-Identifier: Apache-2.0
"""The bridge is killed while a drive moves, and started again: it says what it finds, sends nothing
on its own, and watches the PLC of a motion that it did not command itself."""

import signal
import time

import pytest
from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    RESULT_NONE,
    RESULT_RESTARTED,
    STANDSTILL,
    eventually,
)

# What tells a drive's identity and parameters, beside the cyclic status.
QUESTIONS = {"1 dev", "1 cfg"}


def starts_moving(bridge):
    drive = bridge.drive()
    assert drive.command("enable", 4) == DEVICE_FAILURE  # the baseline
    assert drive.command("move_velocity", 5, target_velocity=3200) == 0
    eventually(lambda: drive.read("velocity") == 3200, what="full speed")


def kill(bridge):
    bridge.units.clear()
    bridge.process.send_signal(signal.SIGKILL)
    assert bridge.process.wait(5) == -signal.SIGKILL


def lines(bridge, offset, *words):
    text = bridge.log_path.read_text()[offset:]
    return [line for line in text.splitlines() if all(word in line for word in words)]


def test_it_says_what_it_finds_and_sends_nothing(bridge):
    starts_moving(bridge)
    kill(bridge)
    offset = bridge.log_path.stat().st_size
    mark = bridge.sim.mark()
    bridge.wait_online = False
    start = time.monotonic()
    bridge.start_bridge()
    served = time.monotonic() - start
    drive = bridge.drive()
    eventually(drive.online)
    online = time.monotonic() - start
    print(f"registers after {served * 1000:.0f} ms, drive online after {online * 1000:.0f} ms")
    # A second, with what systemd waits before it starts the service again.
    assert served < 0.8
    assert drive.read("axis_state") == CONTINUOUS
    assert drive.read("velocity") == 3200
    assert drive.read("result") == RESULT_NONE
    found = eventually(lambda: lines(bridge, offset, "bus line: drive drive1: answers"))
    assert "enabled, moving at 3200 counts/s, position " in found[0]
    # The text of its parameters would keep a stop waiting: it is asked for when the drive stands.
    assert not [line for line in bridge.sim.sent(mark, polls=True) if line.endswith(" cfg")]
    assert set(bridge.sim.sent(mark)) <= QUESTIONS
    assert bridge.sim.get()["velocity"] == 3200
    # The block that a scanner keeps writing is only the baseline; a stop works at once.
    mark = bridge.sim.mark()
    assert drive.command("move_velocity", 5, target_velocity=3200) == DEVICE_FAILURE
    assert drive.read("result") == RESULT_RESTARTED
    assert set(bridge.sim.sent(mark)) <= QUESTIONS
    assert drive.command("stop", 5) == 0
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    bridge.wait_ready()
    assert drive.command("move_velocity", 6, target_velocity=-100) == 0


def test_it_finds_a_standing_drive(bridge):
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=500, target_velocity=12800) == 0
    eventually(lambda: drive.read("position") == 500)
    kill(bridge)
    offset = bridge.log_path.stat().st_size
    bridge.start_bridge()
    eventually(lambda: lines(bridge, offset, "drive drive1: answers", "enabled, standing, position 500 counts"))


@pytest.mark.parametrize(("keys", "stops"), [
    ({"watchdog-ms": 500}, True),
    ({"watchdog-ms": 500, "on-client-loss": "none"}, False),
    ({"watchdog-ms": 0}, False),
])
def test_a_plc_that_went_with_it_is_missed(make_bridge, keys, stops):
    """Nobody talks to the drive after the crash: it stops, if it has a watchdog."""
    bridge = make_bridge(drive=keys)
    starts_moving(bridge)
    kill(bridge)
    bridge.wait_online = False
    bridge.start_bridge()
    gateway = bridge.gateway()
    if stops:
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")
        assert bridge.drive().read("watchdog_trips") == 1
        return
    heard = bridge.sim.get()["heard"]
    eventually(lambda: bridge.sim.get()["heard"] > heard + 100, what="two seconds of cycles")
    assert gateway.read("clients") == 1
    assert bridge.sim.get()["velocity"] == 3200


def test_a_plc_that_is_still_there_keeps_it_moving(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 500})
    starts_moving(bridge)
    kill(bridge)
    # Its parameters follow some seconds later, as it moves; its PLC does not wait for them.
    bridge.wait_online = False
    bridge.start_bridge()
    drive = bridge.drive()
    eventually(drive.online)
    start = drive.read("position")

    def has_gone_on():
        # As its scanner does; what only reads is a monitor, and arguments alone command nothing.
        assert drive.command("move_velocity", target_velocity=3200) == 0
        return drive.read("position") > start + 2 * 3200

    eventually(has_gone_on, what="two seconds of travel")
    assert drive.read("watchdog_trips") == 0
    assert drive.read("watchdog_remaining_ms") > 0
    drive.close()
    bridge.units.clear()
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the watchdog")
