# SPDX-License-Identifier: Apache-2.0
"""A held motion goes on only while somebody holds it, and what comes late moves nothing. When drives moved and stood
is read off the wire."""

import contextlib
import signal
import subprocess
import sys
import time
from pathlib import Path

import holdlib
import pytest
from bridgelib import RESULT_OK, RESULT_PENDING, Refused, Unit, encode, eventually
from holdlib import Failed, Hand

SPEED = 2000
# A busy machine takes its time: what is judged by the clock may be later by so much (s).
PATIENCE = 0.4


def obeyed(bridge, drive="drive1"):
    """(moment of time.monotonic(), what), of what the simulated drive did: the commands that it obeyed, and `stands`."""
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        parts = line.split(" ", 3)
        if len(parts) == 4 and parts[1:3] == [drive, "!"]:
            yield int(parts[0]) / 1e6, parts[3].split(" |")[0].removeprefix("obeyed ")


def stopped(bridge, since):
    """When the drive obeyed the first stop, s from `since` on."""
    return eventually(lambda: next((max(moment - since, 1e-6) for moment, what in obeyed(bridge)
                                    if " stp" in what and moment >= since), None), what="a stop")


def nothing_moved_after(bridge, since):
    """Nothing set the drive in motion after the first stop since then."""
    stop = since + stopped(bridge, since)
    return not any(" mov" in what for moment, what in obeyed(bridge) if moment > stop)


def stands(bridge):
    eventually(lambda: bridge.sim.get()["velocity"] == 0, what="the drive to stand")


def moves(bridge):
    eventually(lambda: bridge.sim.get()["velocity"] == SPEED, what="the drive to move")


def errors(name):
    return pytest.raises(Failed, match=name)


def events(bridge, name="hold-lost"):
    with Hand(bridge.control_path) as hand:
        return [event for event in hand.call("Events")["events"] if event["name"] == name]


def nothing_is_latched(bridge):
    assert bridge.drive().read("watchdog_trips") == 0
    eventually(lambda: bridge.drive().settle("move_velocity", target_velocity=100) == RESULT_OK, what="a motion")
    assert bridge.drive().command("stop") == 0


# Whatever the watchdog says: as it is by default, off, and off with nothing to be done.
WATCHDOGS = {"default": {"watchdog-ms": 3000}, "off": {"watchdog-ms": 0},
             "none": {"watchdog-ms": 0, "on-client-loss": "none"}}


@pytest.fixture(params=WATCHDOGS)
def plant(request, make_bridge):
    bridge = make_bridge(drive=WATCHDOGS[request.param])
    bridge.drive().settle("enable")
    return bridge


@pytest.fixture
def free(make_bridge):
    """Without a watchdog."""
    bridge = make_bridge(drive=WATCHDOGS["none"])
    bridge.drive().settle("enable")
    return bridge


@pytest.fixture
def hand(free):
    with Hand(free.control_path) as session:
        yield session


@pytest.fixture
def holder(plant):
    """A process that holds the drive, and when it said its last beat."""
    process = subprocess.Popen(
        [sys.executable, Path(holdlib.__file__), plant.control_path, "drive1", "300", str(SPEED)],
        stdout=subprocess.PIPE, text=True)
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


# --- who is gone ----------------------------------------------------------------------------------------------------


def test_a_holder_that_is_killed_is_missed_at_once(plant, holder):
    moves(plant)
    # It goes on for longer than a hold without beats.
    began = time.monotonic()
    while time.monotonic() - began < 1:
        holder.stdout.readline()
    assert plant.sim.get()["velocity"] == SPEED
    killed = time.monotonic()
    holder.kill()
    assert stopped(plant, killed) < 0.05 + PATIENCE
    stands(plant)
    assert events(plant)[0]["drive"] == "drive1"
    assert "its connection has ended" in events(plant)[0]["text"]
    nothing_is_latched(plant)


def test_a_holder_that_is_frozen_is_missed_after_its_hold(plant, holder):
    moves(plant)
    holder.stdout.readline()
    frozen = time.monotonic()
    holder.send_signal(signal.SIGSTOP)
    assert stopped(plant, frozen) < 0.3 + PATIENCE
    stands(plant)
    assert "it no longer sends beats" in events(plant)[0]["text"]
    # What it does when it goes on moves nothing.
    holder.send_signal(signal.SIGCONT)
    assert holder.wait(10) != 0
    assert plant.sim.get()["velocity"] == 0
    assert nothing_moved_after(plant, frozen)
    nothing_is_latched(plant)


def test_a_service_that_was_frozen_believes_no_beat_that_waited(plant, holder):
    moves(plant)
    holder.stdout.readline()
    plant.process.send_signal(signal.SIGSTOP)
    time.sleep(1)
    back = time.monotonic()
    plant.process.send_signal(signal.SIGCONT)
    assert stopped(plant, back) < 0.05 + PATIENCE
    stands(plant)
    assert nothing_moved_after(plant, back)


@pytest.mark.parametrize("hold_ms", [100, 300, 1000])
def test_a_hold_without_a_beat_ends(free, hand, hold_ms):
    asked = time.monotonic()
    hand.hold(SPEED, hold_ms)
    answered = time.monotonic()
    assert stopped(free, asked) > hold_ms / 1000
    assert stopped(free, answered) < hold_ms / 1000 + PATIENCE
    with errors("NotHeld"):
        hand.beat()
    stands(free)


def test_who_closes_its_half_of_the_connection_holds_no_more(free, hand):
    """Also while its call waits for the end of the motion."""
    hand.send("Run", drive="drive1", command="move_relative", arguments={"target_position": 1000000}, until_end=True,
              hold_ms=1000, token=hand.token())
    eventually(lambda: free.drive().read("motion_result") == RESULT_PENDING and free.drive().read("active_command") == 0,
               what="the drive to move")
    ended = time.monotonic()
    hand.socket.shutdown(1)
    assert stopped(free, ended) < 0.05 + PATIENCE
    with errors("Refused"):
        hand.answer()


# --- what a hold is -------------------------------------------------------------------------------------------------


def test_a_holder_changes_speed_and_direction(free, hand):
    hand.hold(SPEED)
    moves(free)
    hand.hold(-SPEED)
    eventually(lambda: hand.beat() or free.sim.get()["velocity"] == -SPEED, what="the other direction")
    began = time.monotonic()
    hand.beat()
    stopped(free, began)


def test_a_stop_by_anybody_ends_the_hold(free, hand):
    hand.hold(SPEED, 1000)
    moves(free)
    assert free.drive().command("stop") == 0
    with errors("NotHeld"):
        hand.beat()
    stands(free)
    assert not events(free)


def test_a_motion_that_nobody_holds_ends_the_hold(free, hand):
    hand.hold(SPEED, 100)
    assert free.drive().settle("move_velocity", target_velocity=100) == 1
    with errors("NotHeld"):
        hand.beat()
    time.sleep(0.3)
    assert free.sim.get()["velocity"] == 100
    assert not events(free)


def test_a_motion_that_came_to_its_end_is_held_no_more(free, hand):
    hand.send("Run", drive="drive1", command="move_relative", arguments={"target_position": 1000}, until_end=True,
              hold_ms=300, token=hand.token())
    # Its answer is still to come: beats that nobody waits for are taken meanwhile.
    with Hand(free.control_path) as clock:
        while True:
            hand.send("Beat", flags={"oneway": True}, drive="drive1", token=clock.token())
            hand.socket.settimeout(0.05)
            try:
                assert hand.answer()["result"] == "ok"
                break
            except TimeoutError:
                pass
    hand.socket.settimeout(10)
    assert free.sim.get()["position"] == 1000
    with errors("NotHeld"):
        hand.beat()
    assert not events(free)


def test_what_waits_behind_a_call_is_nobody_elses(free, hand):
    """Each call is as long as it is, whatever waits in another session, and only a beat overtakes."""
    with Hand(free.control_path) as waiting:
        waiting.send("Run", drive="drive1", command="move_relative", arguments={"target_position": 1000000},
                     until_end=True)
        eventually(lambda: free.drive().read("motion_result") == RESULT_PENDING
                   and free.drive().read("active_command") == 0, what="the drive to move")
        waiting.send("Beat", drive="drive1", token="x" * 400)
        for _ in range(20):
            hand.token()
        assert hand.run("stop") == "ok"
        with errors("Refused"):
            waiting.answer()
        with errors("TooOld"):
            waiting.answer()


def test_another_sessions_beat_is_none(free, hand):
    with Hand(free.control_path) as other:
        hand.hold(SPEED)
        began = time.monotonic()
        with errors("NotHeld"):
            other.beat()
        assert stopped(free, began) < 0.3 + PATIENCE


def test_the_drives_own_reaction_is_what_stops_it(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 3000, "on-client-loss": "disable"})
    bridge.drive().settle("enable")
    with Hand(bridge.control_path) as hand:
        hand.hold(SPEED, 100)
        eventually(lambda: any(" off" in what for _, what in obeyed(bridge)), what="the power to be off")


@pytest.mark.parametrize("parameters, error", [
    ({"hold_ms": 300}, "BadValue"),
    ({"hold_ms": 99, "token": ""}, "InvalidParameter"),
    ({"hold_ms": 1001, "token": ""}, "InvalidParameter"),
    ({"hold_ms": True, "token": ""}, "InvalidParameter"),
    ({"hold_ms": 300, "token": 5}, "InvalidParameter"),
    ({"hold_ms": 300, "token": ""}, "TooOld"),
])
def test_what_a_hold_needs(free, hand, parameters, error):
    with errors(error):
        hand.run("move_velocity", arguments={"target_velocity": SPEED}, **parameters)
    with errors("BadValue"):
        hand.run("enable", hold_ms=300, token=hand.token())
    assert hand.run("stop", hold_ms=5, token="nonsense") == "ok"
    assert not any(" mov" in what for _, what in obeyed(free))


# --- what comes late ------------------------------------------------------------------------------------------------


def late(token, ms):
    run, moment = token.split("-")
    return f"{run}-{int(moment) - ms}"


def test_what_comes_late_moves_nothing(free, hand):
    token = hand.token()
    arguments = {"target_velocity": SPEED}
    for old, age in ((late(token, 501), 501), (late(token, 60000), 60000)):
        with errors("TooOld") as failed:
            hand.run("move_velocity", arguments=arguments, token=old)
        assert age <= failed.value.parameters["age_ms"] < age + 5000
    for other in ("", "nonsense", late(token, -60000), "0" + token, token.replace("-", "-0x")):
        with errors("TooOld") as failed:
            hand.run("move_velocity", arguments=arguments, hold_ms=300, token=other)
        assert failed.value.parameters["age_ms"] is None
    with errors("TooOld"):
        hand.call("Write", drive="drive1", token=late(token, 501),
                  values={"command": "move_velocity", "target_velocity": SPEED})
    with errors("TooOld"):
        hand.call("Write", drive="", token=late(token, 501), values={"group_start": 1})
    assert not any(" mov" in what for _, what in obeyed(free))
    # What moves nothing may be as old as it likes.
    for command in ("stop", "enable"):
        assert hand.run(command, token=late(token, 60000)) == "ok"
    hand.call("Write", drive="drive1", token="nonsense", values={"target_velocity": SPEED, "command": "stop"})
    assert hand.run("move_velocity", arguments=arguments, token=hand.token()) == "ok"
    moves(free)


def test_a_late_beat_holds_nothing(free, hand):
    hand.hold(SPEED)
    old = late(hand.token(), 501)
    began = time.monotonic()
    try:
        while True:
            with errors("TooOld"):
                hand.call("Beat", drive="drive1", token=old)
            assert time.monotonic() - began < 5
            if any(" stp" in what for moment, what in obeyed(free) if moment > began):
                break
    finally:
        assert stopped(free, began) < 0.3 + PATIENCE


def test_every_sample_has_a_token(free, hand):
    with Hand(free.control_path) as reader:
        reader.send("Subscribe", flags={"more": True}, drives=[], names=["position"], interval_ms=10)
        for _ in range(3):
            token = reader.answer()["token"]
    assert hand.run("move_velocity", arguments={"target_velocity": SPEED}, hold_ms=300, token=token) == "ok"


def test_another_run_knows_no_token(free):
    with Hand(free.control_path) as hand:
        token = hand.token()
    free.restart_bridge()
    with Hand(free.control_path) as hand:
        with errors("TooOld"):
            hand.run("move_velocity", arguments={"target_velocity": SPEED}, token=token)


def test_a_call_that_waited_while_the_service_was_frozen_moves_nothing(free, hand):
    token = hand.token()
    free.process.send_signal(signal.SIGSTOP)
    hand.send("Run", drive="drive1", command="move_velocity", arguments={"target_velocity": SPEED}, token=token)
    time.sleep(0.6)
    free.process.send_signal(signal.SIGCONT)
    with errors("TooOld"):
        hand.answer()
    assert not any(" mov" in what for _, what in obeyed(free))


def test_who_is_gone_starts_nothing(free):
    """A held motion that its own session's end came with."""
    with Hand(free.control_path) as hand:
        token = hand.token()
        free.process.send_signal(signal.SIGSTOP)
        hand.send("Run", drive="drive1", command="move_velocity", arguments={"target_velocity": SPEED}, hold_ms=300,
                  token=token)
    free.process.send_signal(signal.SIGCONT)
    with Hand(free.control_path) as hand:
        hand.token()
        eventually(lambda: free.drive().read("active_command") == 0, what="the command to end")
    stands(free)


# --- by registers: a PLC, or an HMI's push button -------------------------------------------------------------------


class Button:
    """What an HMI does while its button is pressed, over a connection of its own."""

    def __init__(self, bridge, hold_ms=300):
        self.bridge = bridge
        self.unit = Unit(bridge, 1, "drive")
        self.count = 100
        assert self.unit.write("hold_ms", hold_ms) == 0

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.unit.close()

    def beat(self):
        self.count += 1
        assert self.unit.write("hold_beat", self.count) == 0

    def press(self):
        self.beat()
        assert self.unit.write("target_velocity", SPEED) == 0
        assert self.unit.write_word(self.unit.row("command").address, 5) == 0

    def held(self, seconds):
        began = time.monotonic()
        while time.monotonic() - began < seconds:
            self.beat()
            time.sleep(0.02)
        assert self.bridge.sim.get()["velocity"] == SPEED


def moved(bridge):
    return sum(" mov" in what for _, what in obeyed(bridge))


def test_a_button_that_counts_no_more(plant):
    # A long hold, because a machine that stands still beats no more either.
    with Button(plant, 1000) as button:
        button.press()
        button.held(1)
        last = time.monotonic()
        button.beat()
        counted = time.monotonic()
        # It is there and reads; but nobody presses it.
        while not any(" stp" in what for moment, what in obeyed(plant) if moment > last):
            with contextlib.suppress(Refused):
                button.unit.read("position")
            assert time.monotonic() - last < 5
        assert stopped(plant, last) > 0.95
        assert stopped(plant, counted) < 1.0 + PATIENCE
        stands(plant)
        assert events(plant)[0]["client"].startswith("127.0.0.1")
        assert button.unit.read("hold_beat") == button.count
        assert button.unit.write("hold_ms", 0) == 0
    nothing_is_latched(plant)


def test_a_button_whose_connection_ends(plant):
    with Button(plant, 1000) as button:
        button.press()
        button.held(0.1)
        ended = time.monotonic()
    assert stopped(plant, ended) < 0.05 + PATIENCE
    stands(plant)
    assert plant.drive().write("hold_ms", 0) == 0
    nothing_is_latched(plant)


def block(bridge, command_id, beat, command=5):
    """What an I/O scanner writes in each cycle: one FC 16 over the whole block."""
    row = bridge.drive().row
    first = row("command_id").address
    words = [0] * (row("hold_beat").address + 1 - first)
    for name, value in (("command_id", command_id), ("command", command), ("hold_ms", 300), ("hold_beat", beat)):
        words[row(name).address - first] = value
    at = row("target_velocity").address - first
    words[at:at + 2] = encode("f32", SPEED)
    return lambda: bridge.drive().write_words(first, words)


@pytest.mark.parametrize("command_id", [0, 8])
def test_a_scanner_whose_program_has_died(free, command_id):
    """It writes for ever what it found last: that is no beat, and moves nothing again."""
    assert free.drive().command("stop", command_id=7) == 0
    assert free.drive().settle("enable", command_id=1) in (1, 7)
    for beat in range(50):
        assert block(free, command_id, beat)() == 0
        time.sleep(0.02)
    assert free.sim.get()["velocity"] == SPEED
    last = time.monotonic()
    began = moved(free)
    while time.monotonic() - last < 1.5:
        answer = block(free, command_id, 49)()
        time.sleep(0.02)
    assert 0.15 < stopped(free, last) < 0.3 + PATIENCE
    stands(free)
    assert answer == (3 if command_id == 0 else 0)
    late = [moment for moment, what in obeyed(free) if " mov" in what and moment - last > 0.3 + PATIENCE]
    assert moved(free) >= began and not late
    # The program lives again.
    assert block(free, 9, 50)() == 0
    moves(free)
    assert free.drive().command("stop") == 0


def test_somebody_elses_count_is_none(free):
    with Button(free) as button, Button(free) as other:
        other.count = 5000
        button.press()
        began = time.monotonic()
        while not any(" stp" in what for _, what in obeyed(free)):
            other.beat()
            assert time.monotonic() - began < 5
        assert stopped(free, began) < 0.3 + PATIENCE


def test_a_session_counts_as_well(free, hand):
    """Write over the control socket is a write like a PLC's, with a token where it has one."""
    def write(**values):
        hand.call("Write", drive="drive1", token=hand.token(), values=values)

    write(hold_ms=300, hold_beat=1, target_velocity=SPEED, command="move_velocity")
    for beat in range(2, 30):
        time.sleep(0.02)
        write(hold_beat=beat)
    moves(free)
    with errors("TooOld"):
        hand.call("Write", drive="drive1", token=late(hand.token(), 501), values={"hold_beat": 1000})
    last = time.monotonic()
    assert stopped(free, last) < 0.3 + PATIENCE


def test_hold_registers_alone_execute_nothing(free):
    drive = free.drive()
    mark = free.sim.mark()
    for wrong in (1, 99, 1001, 65535):
        assert drive.write("hold_ms", wrong) == 3
        assert drive.read("hold_ms") == 0
    for right in (100, 1000, 300):
        assert drive.write("hold_ms", right) == 0
        assert drive.read("hold_ms") == right
    for value in (1, 2, 65535, 0):
        assert drive.write("hold_beat", value) == 0
        assert drive.read("hold_beat") == value
    assert free.sim.sent(mark) == []
    # A stop is a stop, whatever stands beside it.
    assert drive.command("stop", hold_ms=5) == 0
    assert drive.read("hold_ms") == 300
    # Without hold_ms a motion goes on by itself.
    assert drive.command("move_velocity", target_velocity=SPEED, hold_ms=0, hold_beat=1) == 0
    time.sleep(0.5)
    moves(free)


def test_a_motion_that_was_staged_is_held_by_who_starts_it(free):
    with Button(free) as button:
        button.beat()
        assert button.unit.write("target_velocity", SPEED) == 0
        assert button.unit.write("staged_command", 5) == 0
        assert free.gateway().write("group_start", 1) == 0
        began = time.monotonic()
        assert stopped(free, began) < 0.3 + PATIENCE


def test_what_waits_behind_a_call_does_not_begin_after_a_stop(make_bridge):
    """Six motions in one connection; a stop over another one goes past those that wait."""
    bridge = make_bridge(drive={"watchdog-ms": 0}, sim_bus={"latency-us": 30000})
    assert bridge.drive().command("enable") == 0
    with Hand(bridge.control_path) as mover, Hand(bridge.control_path) as stopper:
        mark = bridge.sim.mark()
        for number in range(6):
            mover.send("Run", drive="drive1", command="move_velocity",
                       arguments={"target_velocity": 900 + number})
        eventually(lambda: any("mov" in line for line in bridge.sim.sent(mark)), what="the first one")
        stopper.run("stop")
        for _ in range(6):
            with contextlib.suppress(Failed):
                mover.answer()
        stop = bridge.sim.sent(mark).index("1 stp")
        assert not [line for line in bridge.sim.sent(mark)[stop:] if "mov" in line]
        eventually(lambda: bridge.sim.get()["velocity"] == 0, what="a stand")
