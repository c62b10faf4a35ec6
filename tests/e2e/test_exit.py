# SPDX-License-Identifier: Apache-2.0
"""What each word of on-exit does when the service ends (SIGTERM) while a drive moves: which command
the drive gets, and whether its motion goes on. For every family."""

import time
from collections import namedtuple

import pytest
from bridgelib import eventually

CAN = {"transport": "slcan", "bitrate": 1000000, "line": None}

# How a family is configured and set moving; where the simulator shows its speed; and for each word
# the counters of the simulator that its command must raise, all others staying as they are.
Family = namedtuple("Family", "bus sim_bus drive sim_drive move speed full commands")

FAMILIES = {
    "vsmd-serial": Family(
        {}, {}, {}, {}, ("move_velocity", {"target_velocity": 600}), "velocity", 600,
        {"none": {}, "stop": {"stp"}, "quick-stop": {"stp"}, "disable": {"off"}}),
    "vsmd-can": Family(
        {"protocol": "vsmd-can", **CAN, "baud": 3000000},
        {"protocol": "vsmd-can", **CAN, "baud": None}, {}, {},
        ("move_velocity", {"target_velocity": 600}), "velocity", 600,
        {"none": {}, "stop": {"stp"}, "quick-stop": {"stp"}, "disable": {"off"}}),
    "servo-can": Family(
        {"protocol": "servo-can", **CAN, "baud": 3000000},
        {"protocol": "servo-can", **CAN, "baud": None}, {}, {"identity": None, "set": None},
        ("move_velocity", {"target_velocity": 600}), "velocity", 600,
        {"none": {}, "stop": {"speed_frames"}, "quick-stop": {"speed_frames"},
         "disable": {"enable"}}),
    "xyza": Family(
        {"protocol": "xyza"}, {"protocol": "xyza"}, {"axis": "x"},
        {"identity": None, "set": ["manual_speed=2000", "brake=15", "enable=15"]},
        ("jog_positive", {}), "x_speed", 2000,
        {"none": {}, "stop": {"manual_stop", "program_stop"},
         "quick-stop": {"manual_quick_stop", "program_stop"},
         "disable": {"manual_quick_stop", "write_item"}}),
}

# The counters of commands that change something.
CHANGES = {"ena", "off", "mov", "pos", "rmv", "stp", "org", "sav", "cfg_write",
           "enable", "mode_frames", "speed_frames", "current_frames", "position_frames",
           "jog", "manual_stop", "manual_quick_stop", "program_stop", "program_quick_stop",
           "program_start", "write_item", "write_output", "write_outputs", "write_magnitude"}


def moving(make_bridge, family, drives=1, **keys):
    """Drives that run, and how the family stops."""
    about = FAMILIES[family]
    bridge = make_bridge(
        drives=drives, bus=about.bus, sim_bus=about.sim_bus, sim_drive=about.sim_drive,
        drive={**about.drive, **keys})
    command, args = about.move
    for number in range(1, drives + 1):
        drive = bridge.drive(number)
        assert drive.command("enable") == 0
        assert drive.command(command, **args) == 0
        eventually(lambda n=number: speed(bridge, about, n) > 0.9 * about.full, what="full speed")
    return bridge, about


def speed(bridge, about, number=1):
    return float(bridge.sim.get(f"drive{number}")[about.speed])


def changes(bridge, number=1):
    return {name: count for name, count in bridge.sim.get(f"drive{number}").items()
            if name in CHANGES}


def raised(before, after):
    return {name for name, count in after.items() if count > before[name]}


@pytest.mark.parametrize("word", ["none", "stop", "quick-stop", "disable"])
@pytest.mark.parametrize("family", FAMILIES)
def test_each_word_of_each_family(make_bridge, family, word):
    bridge, about = moving(make_bridge, family, **{"on-exit": word, "on-client-loss": "none"})
    before = changes(bridge)
    assert bridge.stop_bridge() == 0
    # It has waited for the confirmation: nothing more is under way.
    assert raised(before, changes(bridge)) == set(about.commands[word])
    if word == "none":
        place = next(name for name in ("position", "x") if name in bridge.sim.get())
        start = bridge.sim.get()[place]
        eventually(lambda: bridge.sim.get()[place] > start + about.full / 10, what="travel")
        assert speed(bridge, about) > 0.9 * about.full
    else:
        eventually(lambda: speed(bridge, about) == 0, what="standstill")
    if family == "servo-can":
        assert bridge.sim.get()["enabled"] == (0 if word == "disable" else 1)


@pytest.mark.parametrize(("word", "line"), [("stop", "1 stp"), ("quick-stop", "1 stp 1")])
def test_a_quick_stop_is_a_quick_one(make_bridge, word, line):
    bridge, _ = moving(make_bridge, "vsmd-serial", **{"on-exit": word})
    mark = bridge.sim.mark()
    assert bridge.stop_bridge() == 0
    # Said again, as long as it is not seen to slow down.
    assert {text for text in bridge.sim.sent(mark) if text.startswith("1 ")} == {line}


def test_it_is_as_on_client_loss_when_not_given(make_bridge):
    bridge, _ = moving(make_bridge, "vsmd-serial", **{"on-client-loss": "disable"})
    assert bridge.stop_bridge() == 0
    assert bridge.sim.get()["off"] == 1


@pytest.mark.parametrize("family", FAMILIES)
def test_a_drive_that_does_not_answer_then(make_bridge, family):
    """The service ends in its time all the same."""
    bridge, _ = moving(make_bridge, family, **{"on-exit": "stop"})
    bridge.sim.fault("silence on")
    start = time.monotonic()
    assert bridge.stop_bridge() == 0
    assert time.monotonic() - start < 4.0


def test_a_silent_drive_does_not_keep_the_others_from_stopping(make_bridge):
    bridge, about = moving(make_bridge, "vsmd-serial", drives=3, **{"on-exit": "stop"})
    bridge.sim.fault("silence on", "drive2")
    assert bridge.stop_bridge() == 0
    for number in (1, 3):
        assert changes(bridge, number)["stp"] >= 1
        eventually(lambda n=number: speed(bridge, about, n) == 0, what="standstill")


def test_a_drive_that_comes_back_in_time_is_stopped(make_bridge):
    bridge, about = moving(make_bridge, "vsmd-serial", **{"on-exit": "stop"})
    bridge.sim.fault("lose-request 3")
    assert bridge.stop_bridge() == 0
    eventually(lambda: speed(bridge, about) == 0, what="standstill")
