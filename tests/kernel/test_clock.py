# SPDX-License-Identifier: Apache-2.0
"""A gateway without a battery boots in the past and is told the time later. Only here may a test set
the clock: it is that of a kernel of its own."""

import re
import time

import pytest
from bridgelib import eventually, find_program
from kernellib import run
from opcualib import (  # noqa: F401
    OPERATOR,
    Follower,
    at,
    call,
    event_of,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    until,
)

MINUTES = 37 * 60


def age_of_stamp(drive):
    """How far timestamp_us is from the clock, in seconds."""
    return abs(drive.read("timestamp_us") / 1e6 - time.time())


def test_stamps_follow_a_clock_that_is_set(link, make_bridge):
    bridge = make_bridge(interface=link.name)
    drive = bridge.drive()
    eventually(lambda: age_of_stamp(drive) < 1, what="stamps of now")
    for step in (MINUTES, -2 * MINUTES, MINUTES):
        time.clock_settime(time.CLOCK_REALTIME, time.time() + step)
        began = time.monotonic()
        eventually(lambda: age_of_stamp(drive) < 1, what=f"stamps after a step of {step} s")
        # "Within a second", and what a kernel with one processor and all of this takes.
        assert time.monotonic() - began < 3
    assert drive.read("age_ms") < 1000


YEAR_1971 = 365 * 24 * 3600


@pytest.fixture
def clock_of_1971():
    """As after a boot without a battery; set right again afterwards."""
    now, began = time.time(), time.monotonic()
    time.clock_settime(time.CLOCK_REALTIME, YEAR_1971)
    yield lambda: time.clock_settime(time.CLOCK_REALTIME, now + time.monotonic() - began)
    time.clock_settime(time.CLOCK_REALTIME, now + time.monotonic() - began)


@pytest.fixture
def state(tmp_path, monkeypatch):
    """systemd's StateDirectory."""
    folder = tmp_path / "state"
    folder.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    return folder


def ctl(bridge, *words):
    return run(find_program("drivebridgectl"), "--socket", bridge.control_path, *words).stdout


def test_what_was_done_in_1971_is_on_record(link, make_bridge, state, clock_of_1971):
    """The trail goes on over the step, and a restart after it."""
    del state
    bridge = make_bridge(interface=link.name)
    assert bridge.drive().command("enable") == 0
    assert abs(bridge.drive().read("timestamp_us") / 1e6 - YEAR_1971) < 3600
    clock_of_1971()
    assert bridge.drive().command("move_absolute", target_position=100) == 0
    eventually(lambda: age_of_stamp(bridge.drive()) < 1, what="stamps of now")
    eventually(lambda: "move_absolute" in ctl(bridge, "audit"), what="the record of the move")
    bridge.stop_bridge()
    bridge.start_bridge()
    told = ctl(bridge, "audit")
    assert re.search(r" 1971-01-01 .* enable ", told) and "move_absolute" in told, told
    ctl(bridge, "audit", "verify")


def test_a_state_folder_that_cannot_be_written_is_no_fault(link, make_bridge, state, clock_of_1971):
    """On a read-only root drives are moved all the same, and status says what is missing."""
    run("mount", "-t", "tmpfs", "-o", "ro", "none", state)
    try:
        bridge = make_bridge(interface=link.name)
        assert bridge.drive().command("enable") == 0
        clock_of_1971()
        assert bridge.drive().command("move_absolute", target_position=100) == 0
        assert bridge.told("cannot store the last good configuration: Read-only file system")
        told = ctl(bridge, "status")
        assert "the audit trail cannot be written: Read-only file system" in told
        assert told.endswith("no faults, 1 hint\n")
        bridge.stop_bridge()
        bridge.start_bridge()
        assert bridge.drive().command("enable") == 0
    finally:
        run("umount", "-l", state)


def sessions_of(bridge):
    """How many there have been at the control socket."""
    told = run(find_program("drivebridgectl"), "--socket", bridge.control_path, "metrics").stdout
    return int(re.search(r"^drivebridge_control_accepted_total (\d+)$", told, re.M).group(1))


@in_loop
async def test_opc_ua_goes_on_when_the_clock_is_set_back(link, make_bridge, make_server, certificate):
    """What was told after a command is not taken for older than that: values come with the times of the new clock, over the
    connection that there is, and no event is taken for one that was told already."""
    bridge = make_bridge(interface=link.name)
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as session:
        position = at(session, "drive1.PositionActualValue")
        follower = await Follower(session).start([position], events=(at(session, "drive1"),))

        def is_of_now():
            values = follower.of(position)
            return values and abs(values[-1].SourceTimestamp.timestamp() - time.time()) < 2

        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 100.0)
        await until(is_of_now)
        time.clock_settime(time.CLOCK_REALTIME, time.time() - MINUTES)
        await until(is_of_now)
        begun = sessions_of(bridge)
        known = len(follower.of(position))
        await until(lambda: len(follower.of(position)) > known + 15)
        # Not one for each new value. The second look is one; a machine that stands still may cost others.
        assert sessions_of(bridge) < begun + 5
        bridge.sim.fault("silence on")
        await until(lambda: event_of(follower, "DriveLost"))
        bridge.sim.fault("silence off")
        await until(lambda: event_of(follower, "DriveOnline"))
