# SPDX-License-Identifier: Apache-2.0
"""Profiles: servos that deviate from what is documented work with a file that says how, and show that something is
wrong without it. One profile each, for all drives of the bus."""

import os

import pytest
from bridgelib import (
    ACKNOWLEDGE,
    AT_TARGET_BIT,
    DISABLED,
    ENABLED_BIT,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    RESULT_FAILED,
    RESULT_OK,
    RESULT_TIMEOUT,
    RESULT_UNPROVEN,
    STANDSTILL,
    Refused,
    code,
    eventually,
    section,
)

CAN = {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "line": None}
WORDS = {"command-word-base": 160, "command-word-length": 4, "command-word-0-at": 0,
         "command-word-1-at": 2, "command-word-ack": 7}
WINDOW = {"in-position-window": 15}


class Kind:
    """How drives are, and what their profile says of it. `frames` are the same on both sides."""

    def __init__(self, frames, sim_drive=None, bus=None, drive=None, moves=2):
        self.moves = moves
        self.sim_bus = frames
        self.sim_drive = sim_drive or {}
        self.bus = {**frames, **(bus or {})}
        self.drive = {**WINDOW, **(drive or {})}

    def text(self):
        return "\n".join([section("profile", {"protocol": "servo-can"}),
                          section("bus", self.bus), section("drive", self.drive), "end\n"])


KINDS = {
    "move frame, low byte first, steps of ten counts": Kind(
        {"move-frame-base": 0x120, "move-frame-length": 5, "move-frame-at": 1,
         "move-frame-bytes": 3, "move-frame-order": "low-first", "move-frame-fixed": 0x0A5A,
         "move-frame-ack": 3},
        {"move-step": 10.0, "demand": "moved"}, bus={"move-frame-scale": 10}, moves=3),
    "relative move frame that nothing acknowledges": Kind(
        {"move-frame-base": 0x60, "move-frame-length": 5, "move-frame-at": 1,
         "move-frame-fixed": 3, "move-frame-ack": 0},
        {"moves": "relative"}, bus={"move-frame-target": "relative"}),
    "words in frames of their own, internal position 5": Kind(
        {"command-word-base": 0xA0, "command-word-length": 2, "command-word-0-at": 0,
         "command-word-ack": 7, "command-word-1-base": 0xC0, "command-word-1-length": 3,
         "command-word-1-at": 1, "command-word-1-fixed": 0x5A, "command-word-1-ack": 8,
         "position-slot": 5, "position-slot-base": 0x120, "position-slot-ack": 11}),
    "status bits elsewhere, and upside down": Kind(
        WORDS,
        # Power in bit 3, a fault in 0, homed in 12; no bits for standstill and for the way.
        {"status-places": "3--------5012---", "status-inverted": 0x0108, "moving-bit": 8},
        drive={"enabled-bit": 3, "fault-bit": 0, "standstill-bit": -1, "overload-bit": 5,
               "homed-bit": -1, "warning-bit": -1, "reverse-bit": -1, "forward-bit": -1,
               "moving-bit": 8, "status-inverted": 0x0108}),
    "positions the other way, in other steps": Kind(
        WORDS, {"mirrored": True, "demand-step": -4.0},
        drive={"position-sign": "reversed", "position-command-scale": -4}),
    "speeds and currents in other steps and signs": Kind(
        WORDS,
        {"speed-step": -0.5, "setpoint-step": 0.25, "current-step": -0.01,
         "current-setpoint-step": 0.02},
        drive={"speed-scale": -0.5, "speed-command-scale": 0.25, "current-scale": -0.01,
               "current-command-scale": 0.02}),
    "the target bit is what ends a move": Kind(
        WORDS, {"status-places": "0123b5678-a4cdef"},
        drive={"target-bit": 11, "overload-bit": -1}),
}


@pytest.fixture(name="make_kind")
def fixture_make_kind(make_bridge, tmp_path):
    def make(kind, profile=True, **options):
        path = tmp_path / "kind.conf"
        path.write_text(kind.text(), encoding="utf-8")
        bus = {**CAN, "baud": 3000000, "profile": path if profile else None,
               **options.pop("bus", {})}
        return make_bridge(
            bus=bus, sim_bus={**CAN, "baud": None, **kind.sim_bus},
            sim_drive={"identity": None, "set": None, **kind.sim_drive}, **options)

    return make


def obeyed(bridge):
    """The frames that the drives obeyed, reads not among them."""
    lines = bridge.sim.trace_path.read_text(encoding="utf-8").splitlines()
    return [line.split(" obeyed ")[1].split()[0] for line in lines if " ! obeyed " in line]


def state(drive, wanted):
    eventually(lambda: drive.read("axis_state") == wanted, what=f"state {wanted}")


def shaft(bridge, kind, target="drive1"):
    """Where the shaft is, in the counts that a user sees."""
    position = float(bridge.sim.get(target)["position"])
    mirrored = kind.sim_drive.get("mirrored", False)
    reversed_by = kind.drive.get("position-sign") == "reversed"
    return -position if mirrored and not reversed_by else position


def expect_move(bridge, kind, number, command, position, end):
    drive = bridge.drive(number)
    assert drive.settle(command, target_position=position, target_velocity=0) == RESULT_OK
    eventually(lambda: drive.read("status") & AT_TARGET_BIT, what=f"{command} to end")
    state(drive, STANDSTILL)
    assert abs(drive.read("position") - end) <= 15
    assert abs(shaft(bridge, kind, f"drive{number}") - end) <= 15


@pytest.mark.parametrize("name", KINDS)
def test_a_profile_makes_them_work(make_kind, name):
    kind = KINDS[name]
    bridge = make_kind(kind, drives=2)
    for number in (1, 2):
        drive = bridge.drive(number)
        state(drive, DISABLED)
        assert drive.settle("enable") == RESULT_OK
        assert drive.read("status") & ENABLED_BIT
        state(drive, STANDSTILL)
        expect_move(bridge, kind, number, "move_absolute", 20000, 20000)
        expect_move(bridge, kind, number, "move_relative", -4000, 16000)
    drive = bridge.drive(1)
    assert drive.settle("move_velocity", target_velocity=300) == RESULT_OK
    eventually(lambda: abs(drive.read("velocity") - 300) < 3, what="the speed")
    assert abs(abs(float(bridge.sim.get()["velocity"])) - 300) < 3
    before = drive.read("position")
    eventually(lambda: drive.read("position") > before + 100, what="the way of the speed")
    assert drive.settle("stop") == RESULT_OK
    state(drive, STANDSTILL)
    assert drive.settle("disable") == RESULT_OK
    state(drive, DISABLED)
    bridge.sim.control("faults drive1 0x8")
    eventually(lambda: drive.read("error") == code("error", "overcurrent"), what="the fault")
    bridge.sim.control("faults drive1 0")
    eventually(lambda: drive.read("error") == 0, what="the end of the fault")
    # Each moved twice, and nothing was said twice; a demand of where it stands may be a move, too.
    for number in (1, 2):
        assert int(bridge.sim.get(f"drive{number}")["moves"]) == kind.moves


def test_current_in_steps_of_its_own(make_kind):
    kind = KINDS["speeds and currents in other steps and signs"]
    bridge = make_kind(kind, sim_per_drive={1: {"inertia": 1.0}})
    drive = bridge.drive()
    assert drive.settle("enable") == RESULT_OK
    assert drive.settle("move_current", target_current=1.5) in (RESULT_OK, RESULT_UNPROVEN)
    eventually(lambda: abs(float(bridge.sim.get()["current"]) - 1.5) < 0.02, what="the current")
    eventually(lambda: abs(drive.read("current") - 1.5) < 0.02, what="the current that is read")
    # 16 bits of steps of 0.02 A.
    assert drive.command("move_current", target_current=700.0) == ILLEGAL_VALUE


def test_word_1_in_a_frame_of_its_own(make_kind):
    bridge = make_kind(KINDS["words in frames of their own, internal position 5"])
    drive = bridge.drive()
    drive.write("command_word_1", 0x8001)
    eventually(lambda: drive.read("command_word_1") == 0x8001, what="the word")
    assert "0C1#5A8001" in obeyed(bridge)
    assert int(bridge.sim.get()["word_1_frames"]) >= 1
    # Word 0 goes on without it.
    drive.write("zclamp", 1)
    # With the bits of internal position 5.
    eventually(lambda: "0A1#0144" in obeyed(bridge), what="word 0")


MOVE_FRAMES = [name for name in KINDS if "move frame" in name]


@pytest.mark.parametrize("name", MOVE_FRAMES)
def test_without_it_there_are_no_moves(make_kind, name):
    bridge = make_kind(KINDS[name], profile=False)
    drive = bridge.drive()
    assert drive.settle("enable") == RESULT_OK
    assert drive.command("move_absolute", target_position=20000, target_velocity=0) == \
        ILLEGAL_FUNCTION


@pytest.mark.parametrize("name", ["words in frames of their own, internal position 5",
                                  "status bits elsewhere, and upside down"])
def test_without_it_no_motor_gets_power(make_kind, name):
    bridge = make_kind(KINDS[name], profile=False, bus=WORDS)
    drive = bridge.drive()
    assert drive.command("enable") not in (0, ACKNOWLEDGE)
    assert drive.read("result") in (RESULT_TIMEOUT, RESULT_FAILED)
    eventually(lambda: bridge.sim.get()["enabled"] == 0, what="the power to be off")


@pytest.mark.parametrize("name", ["positions the other way, in other steps",
                                  "speeds and currents in other steps and signs"])
def test_without_it_moves_fail(make_kind, name):
    bridge = make_kind(KINDS[name], profile=False, bus=WORDS)
    drive = bridge.drive()
    assert drive.settle("enable") == RESULT_OK
    drive.command("move_absolute", target_position=20000, target_velocity=0)
    eventually(lambda: drive.read("result") == RESULT_FAILED or
               drive.read("motion_result") == RESULT_FAILED, what="the move to fail")
    assert not drive.read("status") & AT_TARGET_BIT


def test_without_it_a_speed_is_unproven(make_kind):
    bridge = make_kind(KINDS["speeds and currents in other steps and signs"], profile=False)
    drive = bridge.drive()
    assert drive.settle("enable") == RESULT_OK
    assert drive.settle("move_velocity", target_velocity=300) == RESULT_UNPROVEN


@pytest.mark.parametrize("places, result", [("0123-5678-abcdef", RESULT_FAILED), ("0123456789abcdef", RESULT_OK)],
                         ids=["never", "shown"])
def test_the_target_bit_decides(make_kind, places, result):
    """A drive that never says that it is there is not there, and its move is no success."""
    kind = Kind(WORDS, {"status-places": places}, drive={"target-bit": 4})
    bridge = make_kind(kind)
    drive = bridge.drive()
    assert drive.settle("enable") == RESULT_OK
    assert drive.settle("move_absolute", target_position=5000, target_velocity=0) == RESULT_OK
    eventually(lambda: abs(drive.read("position") - 5000) <= 15, what="the position")
    state(drive, STANDSTILL)
    eventually(lambda: drive.read("motion_result") == result, what=f"the end of the motion: {result}")
    assert bool(drive.read("status") & AT_TARGET_BIT) == (result == RESULT_OK)


# --- the file ------------------------------------------------------------------------------------


def max_speed(drive):
    """None: the drive was not given one yet. It tells none, so the service knows it from giving it."""
    try:
        return drive.read("max_speed")
    except Refused:
        return None


def test_a_reload_takes_a_changed_profile(make_kind, tmp_path):
    kind = Kind(WORDS, drive={"max-speed": 1000})
    bridge = make_kind(kind, drives=2, per_drive={2: {"max-speed": 700}})
    drive = bridge.drive()
    eventually(lambda: max_speed(drive) == 1000, what="the profile's speed")
    eventually(lambda: max_speed(bridge.drive(2)) == 700, what="the drive's own speed")
    kind.drive["max-speed"] = 1200
    (tmp_path / "new").write_text(kind.text(), encoding="utf-8")
    os.replace(tmp_path / "new", tmp_path / "kind.conf")
    text = bridge.reload()
    assert "drive drive1: reload: it is changed" in text and "drive2" not in text
    bridge.wait_ready()
    eventually(lambda: max_speed(drive) == 1200, what="the new speed")
    eventually(lambda: max_speed(bridge.drive(2)) == 700, what="the other drive's speed")


def test_a_wrong_profile_is_refused_with_its_place(make_kind, tmp_path):
    kind = Kind(WORDS, drive={"max-speed": 1000})
    bridge = make_kind(kind)
    drive = bridge.drive()
    eventually(lambda: max_speed(drive) == 1000, what="the profile's speed")
    path = tmp_path / "kind.conf"
    path.write_text(kind.text().replace("command-word-ack = 7", "command-word-ack = 1"),
                    encoding="utf-8")
    text = bridge.reload()
    assert "kind.conf:" in text
    assert "the acknowledgement of the command words is 01, which is that of enable" in text
    assert drive.read("max_speed") == 1000


@pytest.fixture(name="state_folder")
def fixture_state_folder(tmp_path, monkeypatch):
    """systemd's StateDirectory."""
    folder = tmp_path / "state"
    folder.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    return folder


def wait_for_configuration(bridge, name):
    wanted = bridge.map.find("configuration_state", view="gateway").codes[name]
    eventually(lambda: bridge.gateway().read("configuration_state") == wanted,
               what=f"configuration_state to be {name}")


def test_a_profile_on_the_disk_is_noticed(make_kind, tmp_path):
    """Changed, wrong, gone, and as it was."""
    kind = Kind(WORDS, drive={"max-speed": 1000})
    bridge = make_kind(kind)
    path = tmp_path / "kind.conf"
    good = kind.text()
    wait_for_configuration(bridge, "in_force")
    path.write_text(good.replace("1000", "1200"), encoding="utf-8")
    wait_for_configuration(bridge, "changed")
    path.write_text(good.replace("1000", "fast"), encoding="utf-8")
    wait_for_configuration(bridge, "refused")
    assert bridge.gateway().read("configuration_message").startswith(f"{path}:")
    path.unlink()
    wait_for_configuration(bridge, "refused")
    eventually(lambda: "there is no such file" in bridge.gateway().read("configuration_message"),
               what="the new reason")
    path.write_text(good, encoding="utf-8")
    wait_for_configuration(bridge, "in_force")
    assert bridge.drive().read("max_speed") == 1000


def test_the_last_good_configuration_has_its_profile(make_kind, tmp_path, state_folder):
    kind = Kind(WORDS, drive={"max-speed": 1000})
    bridge = make_kind(kind)
    copy = state_folder / "last-good-configuration"
    eventually(lambda: copy.exists() and "max-speed = 1000" in copy.read_text(encoding="utf-8"),
               what="the copy")
    (tmp_path / "kind.conf").write_text("profile { }\n", encoding="utf-8")
    bridge.restart_bridge()
    wait_for_configuration(bridge, "last_good")
    bridge.wait_ready()
    eventually(lambda: max_speed(bridge.drive()) == 1000, what="the profile's speed")
