# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a drive: one record of the service, with its cause, since when, what to do, and the event about it."""

import errno
import fcntl
import os
import re
import time

import pytest
from bridgelib import QUALITY_GOOD, code, eventually
from test_control import Line, Tool

OVER_CURRENT = 1 << 21  # in the status of a VSMD drive


def record(bridge, name="drive1"):
    with Tool(bridge) as tool:
        return tool.Troubles([name])["drives"][0]


def has(bridge, cause, name="drive1", timeout=10):
    """The record, once it has this cause and an event about it."""

    def look():
        now = record(bridge, name)
        return now if now["cause"] == cause and now.get("event") else None

    return eventually(look, timeout, what=f"{cause} of {name}, not {record(bridge, name)}")


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


def test_who_has_a_busy_port_is_said(make_bridge):
    bridge = make_bridge()
    assert bridge.stop_bridge() == 0

    def line():
        with Tool(bridge) as tool:
            return tool.Troubles([])["buses"][0]

    with open(bridge.sections["bus line"]["device"], "rb") as port:
        fcntl.flock(port, fcntl.LOCK_EX)
        bridge.wait_online = False
        bridge.start_bridge()
        now = eventually(lambda: line() if line()["cause"] == "port" and line().get("event") else None)
        assert now["detail"] == os.strerror(errno.EBUSY) and f"(process {os.getpid()}) has it: end that" in now["advice"]
        assert f"(process {os.getpid()}) has it: end that; trying again" in now["event"]["text"]
        assert record(bridge)["advice"] == now["advice"]
    eventually(lambda: line()["cause"] == "none")
    bridge.wait_ready()


def test_a_drive_that_is_not_there_is_refused(bridge):
    with Line(bridge) as line:
        line.ask("io.drivebridge.Control.Troubles", {"drives": ["nobody"]})
        assert line.answer()["error"].endswith("NoSuchDrive")


def test_each_outage_is_an_event_of_its_own(make_bridge):
    """Of three drives, four times: each with its cause and what to do, and each end with how long it was."""
    bridge = make_bridge(drives=3)
    names = [f"drive{number}" for number in (1, 2, 3)]

    def causes():
        with Tool(bridge) as tool:
            return {drive["cause"] for drive in tool.Troubles(names)["drives"]}

    begun = time.monotonic()
    for _ in range(4):
        for name in names:
            bridge.sim.fault("silence on", name)
        eventually(lambda: causes() == {"no_answer"})
        for name in names:
            bridge.sim.fault("silence off", name)
        eventually(lambda: causes() == {"none"})
    whole = time.monotonic() - begun
    for name in names:
        lost = [event for event in events(bridge, "drive-lost") if event["drive"] == name]
        assert len(lost) == 4 and all("check its power" in event["text"] for event in lost)
        back = [event for event in events(bridge, "drive-online", " again, after ") if event["drive"] == name]
        assert len(back) == 4
        seconds = [float(re.search(r"after ([0-9.]+) s \(no_answer\)", event["text"])[1]) for event in back]
        assert 0 < sum(seconds) < whole + 1


# --- frames that come and do not fit ---------------------------------------------------------------------

VSMD_CAN = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}
MISFITS = {
    **{f"vsmd-can-{replies}": (VSMD_CAN, {"replies": replies}) for replies in ("host-0", "broadcast", "standard")},
    "servo-can": ({**VSMD_CAN, "protocol": "servo-can"}, {"answer-length": "short", "identity": None, "set": None}),
    "xyza": ({"protocol": "xyza"}, {"answers-as-host": True, "identity": None, "set": None}),
}


@pytest.mark.parametrize("misfit", MISFITS)
def test_answers_that_are_not_as_documented_are_named(make_bridge, misfit):
    """Its power and wiring are right, and no time that could be set is the cause."""
    wire, habits = MISFITS[misfit]
    can = "transport" in wire
    bridge = make_bridge(bus={**wire, **({"baud": 3000000} if can else {})}, sim_bus={**wire, **({"baud": None} if can else {})},
                         drive={"axis": "x"} if misfit == "xyza" else None, sim_drive=habits, wait_online=False)
    now = has(bridge, "not_understood")
    text = now["event"]["text"]
    assert now["need"] == "act" and now["event"]["name"] == "drive-heard"
    assert "answers at address 1, but not as documented: " in text
    frame = text.split("documented: ")[1].split(" ")[0]
    assert int(frame.replace("#", ""), 16) and ("#" in frame) == can
    assert bridge.drive().read("trouble") == code("trouble", "not_understood")
    for wrong in ("check its power", "turnaround-us", "drive-latency-ms"):
        assert wrong not in bridge.log_since(0)
        assert wrong not in now["advice"]


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
    # An answer that a busy computer delivers late proves nothing, nor does what follows within 5 s.
    now = has(bridge, "two_drives", timeout=40)
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
        if family == "servo-can":
            assert drive.command("set_position", target_position=drive.read("position")) == 0
        else:
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
