# SPDX-License-Identifier: Apache-2.0
"""Finding drives on a bus through drivebridgectl: in service and with the bus out of service, two drives on one address,
and what is printed for the configuration."""

import getpass
import json
import re
import shlex
import signal
import subprocess

import pytest
from bridgelib import OFFLINE, ROOT, STANDSTILL, eventually, find_program
from test_control import Tool
from test_ctl import pattern_of, transcripts


# Room for questions in each cycle, also while the machine is busy.
ROOMY = {"cycle-ms": 100, "drive-latency-ms": 12}


def run(bridge, *words, timeout=60):
    return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words],
                          capture_output=True, text=True, timeout=timeout, check=False)


def scan(bridge, *words, status=0):
    """What the scan of bus line found, as --json tells it."""
    done = run(bridge, "--json", "scan", "line", *words)
    assert done.returncode == status, done
    return json.loads(done.stdout)


def said(bridge, since=0):
    """What went over the wire: (address, the rest)."""
    lines = [line.lstrip(".").rstrip(".") for line in bridge.sim.sent(since, polls=True)]
    return [tuple(line.split(" ", 1)) for line in lines if " " in line]


def places(found):
    return [(find["speed"], find["address"], find["verdict"]) for find in found["finds"]]


def test_drives_are_found_while_their_bus_is_in_service(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=4, bus=ROOMY, sim_per_drive={
        3: {"address": 7, "identity": "VSMD123_045T-1.0.009", "text": "quoted"}, 4: {"address": 32}})
    assert bridge.drive().command("move_velocity", target_velocity=500) == 0
    found = scan(bridge)
    assert places(found) == [(115200, address, "one") for address in (1, 2, 7, 32)]
    assert [find["drives"] for find in found["finds"]] == [["drive1"], ["drive2"], [], []]
    assert found["finds"][2]["identity"] == "VSMD123_045T-1.0.009"
    assert all(0 < find["time_min_us"] <= find["time_mean_us"] <= find["time_max_us"]
               for find in found["finds"])
    # Nobody was disturbed, and nothing but reading was said.
    assert bridge.drive().read("velocity") == pytest.approx(500, abs=1)
    assert {word for address, word in said(bridge) if address in ("7", "30", "32")} == {"sts", "dev"}
    # What is printed is taken, and the drives come online.
    path = bridge.config_path
    path.write_text(path.read_text() + found["configuration"])
    checked = subprocess.run([find_program("drivebridged"), "--check", "--config", path],
                             capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked
    assert run(bridge, "reload").returncode == 0
    for unit in (7, 32):
        eventually(lambda unit=unit: bridge.drive(unit).read("axis_state") == STANDSTILL)


# --- two drives on one address -----------------------------------------------------------------------


@pytest.mark.parametrize("twins", ["together", "shifted", "in-turn"])
def test_two_drives_on_one_address(make_bridge, twins):
    bridge = make_bridge(drives=1, sim_drives=3, bus=ROOMY, sim_bus={"twins": twins}, sim_per_drive={
        2: {"address": 4}, 3: {"address": 4, "identity": "VSMD123_045T-1.0.009"}})
    found = scan(bridge, "--addresses", "1-5")
    verdicts = {find["address"]: find["verdict"] for find in found["finds"]}
    # Of two that say the same at the same time one hears one; who they are differs.
    assert verdicts == {1: "one", 4: {"together": "two", "shifted": "garbled", "in-turn": "two"}[twins]}
    if twins == "in-turn":
        (pair,) = [find for find in found["finds"] if find["address"] == 4]
        assert pair["doubled"] > 0
    assert "address = 4" not in found["configuration"]
    told = run(bridge, "scan", "line", "--addresses", "4-4").stdout
    assert re.search(r"^address 4: .*two drives", told, re.M)


# --- the bus out of service -------------------------------------------------------------------------------


def test_drives_at_another_speed_are_found(make_bridge):
    """The bus is out of service, which its drives and the log show, and returns to service."""
    bridge = make_bridge(drives=1, bus={"drive-latency-ms": 10}, sim_bus={"follow-host": True})
    offset = bridge.log_size()
    bridge.sections["bus line"]["baud"] = 57600
    bridge.wait_online = False
    bridge.reload()
    bridge.drive().reconnect()
    eventually(lambda: bridge.drive().read("axis_state") == OFFLINE)
    refused = run(bridge, "scan", "line", "--all-bauds")
    assert refused.returncode == 2 and "--yes" in refused.stderr
    found = scan(bridge, "--all-bauds", "--addresses", "1-3", "--yes")
    assert places(found) == [(115200, 1, "one")]
    assert "at 115200 bit/s, while bus line is set to 57600" in found["configuration"]
    eventually(lambda: re.search("bus line: .* is out of service for a scan", bridge.log_since(offset)))
    eventually(lambda: "returns to service" in bridge.log_since(offset))
    bridge.sections["bus line"]["baud"] = 115200
    bridge.reload()
    bridge.drive().reconnect()
    bridge.wait_ready()


def test_a_bus_is_set_aside_only_when_its_drives_stand(make_bridge):
    bridge = make_bridge(drives=2, drive={"on-exit": "disable"}, sim_bus={"follow-host": True})
    drive = bridge.drive(2)
    assert drive.command("move_velocity", target_velocity=500) == 0
    done = run(bridge, "scan", "line", "--all-bauds", "--yes")
    assert done.returncode == 1 and "drive2 does not stand" in done.stderr
    eventually(lambda: drive.read("velocity") == 500)
    assert drive.command("stop") == 0
    bridge.wait_standing(2)
    # On-exit is honoured before, and the client's end ends the scan.
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", bridge.control_path,
                                "scan", "line", "--all-bauds", "--yes"], stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
    eventually(lambda: bridge.gateway().read("bus1_up") == 0 or process.poll() is not None)
    eventually(lambda: drive.read("axis_state") == OFFLINE)
    assert drive.command("enable") != 0
    # Whose scan it is stands in the log and in the record of the bus and of its drives.
    whose = f"control, user {getpass.getuser()}, drivebridgectl (process {process.pid})"
    with Tool(bridge) as tool:
        told = tool.Troubles(["drive2"])
    for one in (*told["buses"], *told["drives"]):
        assert (one["cause"], one["need"], one["detail"]) == ("aside", "look", whose), one
        assert f"bus line is out of service for a scan of {whose}; " in one["advice"]
        assert f"is out of service for a scan of {whose}: " in one["event"]["text"]
    assert f"bus line: aside: bus line is out of service for a scan of {whose}; " in run(bridge, "status").stdout
    process.send_signal(signal.SIGINT)
    told, _ = process.communicate(timeout=20)
    assert process.returncode == 1 and "interrupted" in told
    for number in (1, 2):
        bridge.wait_ready(number)
        assert bridge.sim.log(f"drive{number}").count(f"{number} off") >= 1


def test_the_service_ends_while_a_bus_is_set_aside(make_bridge):
    bridge = make_bridge(drives=1, sim_bus={"follow-host": True})
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", bridge.control_path,
                                "scan", "line", "--all-bauds", "--yes"], stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    eventually(lambda: "out of service" in bridge.log_path.read_text())
    assert bridge.stop_bridge() == 0
    assert process.wait(10) == 3
    bridge.start_bridge()


def test_only_one_scan_of_a_bus_at_a_time(make_bridge):
    bridge = make_bridge(drives=1, sim_bus={"follow-host": True})
    words = [find_program("drivebridgectl"), "--socket", bridge.control_path, "scan", "line"]
    process = subprocess.Popen([*words, "--all-bauds", "--yes"], stdout=subprocess.DEVNULL)
    eventually(lambda: "out of service" in bridge.log_path.read_text())
    second = run(bridge, "scan", "line")
    assert second.returncode == 1 and "too much" in second.stderr
    process.send_signal(signal.SIGKILL)
    process.wait(10)
    eventually(lambda: "returns to service" in bridge.log_path.read_text())
    bridge.wait_ready()
    # What is left of a short cycle is told.
    eventually(lambda: "each address was given" in
               run(bridge, "scan", "line", "--addresses", "1-1").stdout)


def test_no_time_for_a_question_is_said(make_bridge):
    """Nothing is asked where a cycle would be late by it."""
    bridge = make_bridge(drives=4, bus={"cycle-ms": 10}, sim_bus={"latency-us": 1500})
    mark = bridge.sim.mark()
    done = run(bridge, "scan", "line")
    assert done.returncode == 1 and re.search(r"Raise cycle-ms of this bus by \d+", done.stderr)
    assert {address for address, _ in said(bridge, mark)} <= set("1234")


# --- another address ---------------------------------------------------------------------------------


def switch_power(bridge, name):
    bridge.sim.control(f"power {name} cycle")


def start(bridge, *words):
    return subprocess.Popen([find_program("drivebridgectl"), "--socket", bridge.control_path, *words],
                            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            text=True)


def heard(bridge, name, line):
    return [text for text in bridge.sim.log(name) if text == line]


@pytest.mark.parametrize("settles", ["power-up", "after-answer", "at-once"])
def test_a_drive_gets_another_address(make_bridge, settles):
    """However it goes by its new one, and whichever it answers by."""
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY, sim_drive={"settles": settles})
    process = start(bridge, "address", "line", "2", "9", "--yes")
    if settles == "power-up":
        eventually(lambda: heard(bridge, "drive2", "2 sav") or process.poll() is not None)
        switch_power(bridge, "drive2")
    told, _ = process.communicate(timeout=30)
    assert process.returncode == 0, told
    assert "the way back: drivebridgectl address line 9 2" in told
    assert "done: it answers at address 9" in told
    assert bridge.sim.get("drive2")["address"] == 9
    # It is kept without power.
    switch_power(bridge, "drive2")
    assert [find["address"] for find in scan(bridge, "--addresses", "1-9")["finds"]] == [1, 9]


@pytest.mark.parametrize("settles", ["power-up", "at-once"])
def test_a_broken_drive_is_replaced(make_bridge, settles):
    """drive2 is gone; a new one with factory parameters is at the factory address."""
    bridge = make_bridge(drives=2, bus={**ROOMY, "save-interval-s": 0}, wait_online=False,
                         sim_drive={"settles": settles, "set": ["spd=6400"]},
                         sim_per_drive={2: {"address": 31}})
    bridge.wait_ready(1)
    path = bridge.place / "drive2.params"
    assert run(bridge, "set", "drive1", "spd=3200").returncode == 0
    assert run(bridge, "params", "save", "drive1", path).returncode == 0
    # Nothing is done without being asked, nor with a file that is none.
    assert "nobody can be asked" in run(bridge, "replace", "drive2", path).stderr
    assert "No such file" in run(bridge, "replace", "drive2", bridge.place / "none", "--yes").stderr
    assert "no new drive answers" in run(bridge, "replace", "drive2", path, "--yes", "--addresses", "5-9").stderr
    assert bridge.sim.get("drive2")["address"] == 31 and not heard(bridge, "drive2", "31 sav")
    process = start(bridge, "replace", "drive2", str(path), "--yes")
    if settles == "power-up":
        eventually(lambda: heard(bridge, "drive2", "31 sav") or process.poll() is not None)
        switch_power(bridge, "drive2")
    told, _ = process.communicate(timeout=60)
    assert process.returncode == 0, told
    steps = [told.index(text) for text in ("step 1 of 3", "done: it answers at address 2", "step 2 of 3", "step 3 of 3",
                                           "spd = 3200 pulses/s: ok", "save_parameters: ok", "drive2 is replaced")]
    assert steps == sorted(steps)
    # It is kept without power; cid is its own address, not that of the file's drive.
    switch_power(bridge, "drive2")
    bridge.drive(2).reconnect()
    bridge.wait_ready(2)
    assert (bridge.drive(2).read("spd"), bridge.sim.get("drive2")["address"]) == (3200.0, 2)
    # Ended before its parameters were written, it goes on with them.
    assert run(bridge, "set", "drive2", "spd=100").returncode == 0
    again = run(bridge, "replace", "drive2", path, "--yes")
    assert again.returncode == 0 and "a drive answers at address 2" in again.stdout
    assert "drive2: 1 written" in again.stdout and "step 3" in again.stdout


def test_an_address_is_not_given_where_it_would_be_wrong(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=4, bus=ROOMY, sim_bus={"twins": "in-turn"},
                         sim_per_drive={3: {"address": 7}, 4: {"address": 7}})
    mark = bridge.sim.mark()
    taken = run(bridge, "address", "line", "1", "2", "--yes")
    assert taken.returncode == 1 and "address 2 of line is taken" in taken.stderr
    nobody = run(bridge, "address", "line", "30", "31", "--yes")
    assert nobody.returncode == 1 and "no drive answers at address 30" in nobody.stderr
    both = run(bridge, "address", "line", "7", "8", "--yes")
    assert both.returncode == 1 and "more than one drive answers at address 7" in both.stderr
    assert run(bridge, "address", "line", "1", "9").returncode == 2
    assert bridge.drive(1).command("move_velocity", target_velocity=500) == 0
    moving = run(bridge, "address", "line", "1", "9", "--yes")
    assert moving.returncode == 1 and "does not stand" in moving.stderr
    # A save would hold up its stop.
    other = run(bridge, "address", "line", "2", "9", "--yes")
    assert other.returncode == 1 and "drive1 does not stand" in other.stderr
    # Nothing but reading was said.
    assert not [word for _, word in said(bridge, mark) if word.startswith(("cfg ", "sav"))]


def test_a_configured_drive_gets_another_address(make_bridge):
    bridge = make_bridge(drives=2, bus=ROOMY, sim_drive={"settles": "after-answer"})
    done = run(bridge, "address", "line", "2", "9", "--yes")
    assert done.returncode == 0, done
    assert "it is configured as drive2: afterwards its section must say address = 9" in done.stdout
    eventually(lambda: bridge.drive(2).read("axis_state") == OFFLINE)
    bridge.sections["drive drive2"]["address"] = 9
    bridge.reload()
    bridge.drive(2).reconnect()
    bridge.wait_ready(2)


def test_what_another_client_controls_is_left_alone(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=3, bus=ROOMY, modbus={"control": "drive"})
    assert bridge.drive(2).write("control_request", 1) == 0
    for words in (["address", "line", "2", "9"], ["scan", "line", "--all-bauds"]):
        done = run(bridge, *words, "--yes")
        assert done.returncode == 1 and "another client has control of drive2" in done.stderr
        assert bridge.drive(2).read("axis_state") == STANDSTILL
    # Looking disturbs nobody.
    assert places(scan(bridge, "--addresses", "1-3")) == [(115200, number, "one") for number in (1, 2, 3)]
    assert bridge.sim.get("drive2")["address"] == 2


def test_a_drive_that_is_not_saved_is_told_of(make_bridge):
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY)
    bridge.sim.fault("flash fail", "drive2")
    done = run(bridge, "address", "line", "2", "9", "--yes")
    assert done.returncode == 1
    assert "it was not saved: the drive may be found at address 2 or 9 of line" in done.stderr


@pytest.mark.parametrize("settles", ["", "at-once"])
def test_a_controller_gets_another_number(make_bridge, settles):
    bridge = make_bridge(drives=1, sim_drives=2, bus={**ROOMY, "protocol": "xyza"},
                         drive={"axis": "x"}, sim_bus={"protocol": "xyza"},
                         sim_drive={"settles": settles or None, "identity": None, "set": None})
    done = run(bridge, "address", "line", "2", "200", "--yes")
    assert done.returncode == 0, done
    assert bridge.sim.get("drive2")["address"] == 200
    found = scan(bridge, "--addresses", "195-205")
    assert places(found) == [(115200, 200, "one")] and "axis = x" in found["configuration"]
    refused = run(bridge, "baud", "line", "200", "9600", "--yes")
    assert refused.returncode == 1 and "no baud rate" in refused.stderr


@pytest.mark.parametrize("settles", ["power-up", "after-answer"])
def test_a_drive_gets_another_speed(make_bridge, settles):
    """Of the new one nobody knows before the drive was looked for at it."""
    bridge = make_bridge(drives=1, bus=ROOMY, sim_bus={"follow-host": True},
                         sim_drive={"settles": settles})
    process = start(bridge, "baud", "line", "1", "57600", "--yes")
    if settles == "power-up":
        eventually(lambda: heard(bridge, "drive1", "1 sav") or process.poll() is not None)
        switch_power(bridge, "drive1")
        told, _ = process.communicate("\n", timeout=30)
        assert process.returncode == 0, told
        assert "all drives of a bus must have the same bit rate" in told
        assert "drivebridgectl baud line 1 115200 --baud 57600" in told
        assert re.search(r"^bus line {\n    baud = 57600$", told, re.M)
    else:
        # It is at its new speed already, and not saved.
        told, _ = process.communicate(timeout=30)
        assert process.returncode == 1 and "former speed or at 57600 bit/s" in told
    found = scan(bridge, "--baud", "57600", "--addresses", "1-1", "--yes")
    assert places(found) == [(57600, 1, "one")]
    # And back.
    mark = bridge.sim.mark()
    saves = len(heard(bridge, "drive1", "1 sav"))
    process = start(bridge, "baud", "line", "1", "115200", "--baud", "57600", "--yes")
    if settles == "power-up":
        eventually(lambda: ("1", "sav") in said(bridge, mark) or process.poll() is not None, 20)
        eventually(lambda: len(heard(bridge, "drive1", "1 sav")) > saves or process.poll() is not None)
        switch_power(bridge, "drive1")
    told, _ = process.communicate("\n", timeout=30)
    assert process.returncode == (0 if settles == "power-up" else 1), told
    bridge.wait_ready()


# --- CAN ---------------------------------------------------------------------------------------------

CAN = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}


def test_drives_and_other_frames_of_a_can_bus(make_bridge):
    bridge = make_bridge(drives=1, sim_drives=2, bus={**CAN, "baud": 3000000, "drive-latency-ms": 150},
                         sim_bus={**CAN, "baud": None},
                         sim_per_drive={2: {"address": 9, "identity": "VSMD123_045T-1.0.009", "answers": "singles",
                                            "read-max": 2}})
    found = scan(bridge, "--addresses", "1-12")
    assert places(found) == [(1000000, 1, "one"), (1000000, 9, "one")]
    assert found["finds"][1]["identity"] == "VSMD123_045T-1.0.009"
    assert found["finds"][0]["drives"] == ["drive1"]
    # And another address for the new one.
    process = start(bridge, "address", "line", "9", "100", "--yes")
    eventually(lambda: bridge.sim.get("drive2").get("sav") or process.poll() is not None)
    switch_power(bridge, "drive2")
    told, _ = process.communicate(timeout=60)
    assert process.returncode == 0, told
    assert places(scan(bridge, "--addresses", "99-101")) == [(1000000, 100, "one")]


def test_servos_are_found_and_their_reports_are_foreign_frames(make_bridge):
    can = {**CAN, "protocol": "servo-can"}
    bridge = make_bridge(drives=1, sim_drives=2, bus={**can, "baud": 3000000, "drive-latency-ms": 150},
                         sim_bus={**can, "baud": None}, sim_drive={"identity": None, "set": None},
                         sim_per_drive={2: {"address": 5}})
    found = scan(bridge, "--addresses", "1-8")
    assert places(found) == [(1000000, 1, "one"), (1000000, 5, "one")]
    # The reports of the one that nobody has configured.
    assert {frame["id"] for frame in found["foreign"]} >= {0x1C0 + 5, 0x1E0 + 5}
    refused = run(bridge, "address", "line", "5", "6", "--yes")
    assert refused.returncode == 1 and "vendor's tool" in refused.stderr


# --- the guide ---------------------------------------------------------------------------------------


def test_the_transcripts_of_the_guide(make_bridge):
    """Typed as they stand there; the drive's power is switched where they say so."""
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY, sim_bus={"follow-host": True})
    bridge.sections["drive feeder"] = bridge.sections.pop("drive drive1")
    bridge.reload()
    bridge.drive().reconnect()
    bridge.wait_ready()
    typed = 0
    for block in transcripts(ROOT / "docs" / "guide" / "new-drive.md"):
        (line, expected), *rest = block
        typed += 1
        process = start(bridge, *shlex.split(line)[2:])
        for event, more in rest:
            assert event == "# somebody does that"
            expected = expected + more
            eventually(lambda: heard(bridge, "drive2", "2 sav") or process.poll() is not None)
            switch_power(bridge, "drive2")
        told, _ = process.communicate(timeout=60)
        # What a machine adds that stood still for most of a cycle.
        told = re.sub(r"\neach address was given .*\n.*\(--baud\)\n", "", told)
        assert re.fullmatch(pattern_of(expected), told), told
    assert typed == 3
