# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a drive: one record of the service, with its cause, since when, what to do, and the event about it."""

import time

import pytest
from bridgelib import QUALITY_GOOD, code, eventually
from test_control import Line, Tool

OVER_CURRENT = 1 << 21  # in the status of a VSMD drive


def record(bridge, name="drive1"):
    with Tool(bridge) as tool:
        return tool.Troubles([name])["drives"][0]


def has(bridge, cause, name="drive1"):
    """The record, once it has this cause and an event about it."""

    def look():
        now = record(bridge, name)
        return now if now["cause"] == cause and now.get("event") else None

    return eventually(look, what=f"{cause} of {name}, not {record(bridge, name)}")


def events(bridge, *words):
    with Tool(bridge) as tool:
        return [event for event in tool.Events()["events"]
                if all(word in f"{event['name']} {event['text']}" for word in words)]


def test_nothing_is_wrong(bridge):
    eventually(lambda: record(bridge)["cause"] == "none")
    now = record(bridge)
    assert (now["need"], now["since_us"], now["advice"], now.get("event")) == ("nothing", 0, "", None)
    with Tool(bridge) as tool:
        answer = tool.Troubles([])
    assert answer["well"] and answer["buses"][0]["cause"] == "none"
    assert bridge.drive().read("trouble") == 0 and bridge.drive().read("trouble_ms") == 0


def test_a_silent_drive_in_the_record_and_in_its_registers(bridge):
    begun = time.time()
    bridge.sim.fault("silence on")
    now = has(bridge, "no_answer")
    assert now["need"] == "act" and "check its power" in now["advice"]
    assert begun - 0.5 < now["since_us"] / 1e6 < time.time()
    assert now["event"]["name"] == "drive-lost" and now["event"]["drive"] == "drive1"
    drive = bridge.drive()
    assert drive.read("trouble") == code("trouble", "no_answer")
    assert drive.read("trouble_ms") > 0
    bridge.sim.fault("silence off")
    eventually(lambda: record(bridge)["cause"] == "none")


def test_a_fault_by_its_name(bridge):
    bridge.sim.control(f"bits drive1 {OVER_CURRENT:#x}")
    now = has(bridge, "fault")
    assert now["detail"] == "over_current" and now["event"]["name"] == "drive-fault"
    assert "short circuit" in now["advice"] and "run drive1 clear_fault" in now["advice"]


def test_changes_come_by_themselves(bridge):
    eventually(lambda: record(bridge)["cause"] == "none")
    with Line(bridge) as line:
        line.ask("io.drivebridge.Control.Troubles", {"drives": []}, more=True)
        first = line.answer()["parameters"]
        assert [drive["cause"] for drive in first["drives"]] == ["none"] and first["well"]
        bridge.sim.fault("silence on")
        while True:
            news = line.answer()["parameters"]
            if news["drives"] and news["drives"][0]["cause"] == "no_answer":
                break
        assert not news["well"]
        bridge.sim.fault("silence off")
        while not line.answer()["parameters"]["well"]:
            pass


def test_a_drive_that_is_not_there_is_refused(bridge):
    with Line(bridge) as line:
        line.ask("io.drivebridge.Control.Troubles", {"drives": ["nobody"]})
        assert line.answer()["error"].endswith("NoSuchDrive")


# --- two drives on one address -----------------------------------------------------------------------

CAN = {"transport": "slcan", "bitrate": 1000000, "line": None}
FAMILIES = {
    "vsmd-serial": ({}, {"twins": "in-turn"}, {}),
    "vsmd-can": ({"protocol": "vsmd-can", **CAN, "baud": 3000000},
                 {"protocol": "vsmd-can", **CAN, "baud": None, "twins": "in-turn"}, {}),
    "servo-can": ({"protocol": "servo-can", **CAN, "baud": 3000000},
                  {"protocol": "servo-can", **CAN, "baud": None, "twins": "in-turn"},
                  {"identity": None, "set": None}),
    "xyza": ({"protocol": "xyza"}, {"protocol": "xyza", "twins": "in-turn"}, {"identity": None, "set": None}),
}


def make_pair(make_bridge, family):
    """Two drives, the second one in another place."""
    bus, sim_bus, sim_drive = FAMILIES[family]
    bridge = make_bridge(drives=2, bus=bus, sim_bus=sim_bus, sim_drive=sim_drive,
                         drive={"axis": "x"} if family == "xyza" else None)
    if family == "xyza":
        bridge.sim.control("place drive2 x 5000")
        return bridge
    other = bridge.drive(2)
    if family == "servo-can":
        assert other.command("enable") == 0
    assert other.command("move_velocity", target_velocity=600) == 0
    eventually(lambda: abs(other.read("position")) > 100)
    assert other.command("stop") == 0
    return bridge


@pytest.mark.parametrize("family", FAMILIES)
def test_two_drives_on_one_address(make_bridge, family):
    bridge = make_pair(make_bridge, family)
    drive = bridge.drive()
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    assert drive.read("doubled_answers") == 0
    bridge.sim.control("address drive2 1")
    now = has(bridge, "two_drives")
    assert now["need"] == "act" and now["event"]["name"] == "drive-doubled"
    assert "address 1" in now["event"]["text"]
    # Never two places with a good quality.
    good = set()
    until = time.monotonic() + 1
    while time.monotonic() < until:
        row = drive.read_many("axis_state", "position")
        if row["quality"] == QUALITY_GOOD:
            good.add(row["position"])
    assert not good
    eventually(lambda: drive.read("doubled_answers") > 5)
    bridge.sim.control("address drive2 9")
    eventually(lambda: record(bridge)["cause"] != "two_drives", timeout=30)
    # What two drives answer in turn may look like one that has restarted, and that stays open until somebody says so.
    if record(bridge)["cause"] == "may_have_restarted":
        assert drive.command("clear_fault") == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_line_that_doubles_frames_has_no_second_drive(make_bridge, family):
    bridge = make_pair(make_bridge, family)
    drive = bridge.drive()
    bridge.sim.fault("double")
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    until = time.monotonic() + 1
    while time.monotonic() < until:
        assert drive.read("doubled_answers") == 0
    assert not events(bridge, "drive-doubled")
