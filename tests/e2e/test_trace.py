# SPDX-License-Identifier: Apache-2.0
"""What a bus carries, in words: live, kept behind trouble and in files, through the control socket and
drivebridgectl."""

import csv
import json
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import time

import pytest
from bridgelib import ROOT, eventually, find_program
from test_can import fixture_make_can  # noqa: F401
from test_control import Line
from test_ctl import ctl, objects
from test_servo_can import fixture_make_servo  # noqa: F401
from test_xyza import fixture_make_xyza  # noqa: F401

INTERFACE = "io.drivebridge.Control"


def lines(text):
    return [line for line in text.splitlines() if not line.startswith("#")]


def test_a_serial_bus_is_told_in_words_and_bytes(make_bridge):
    plant = make_bridge(drives=2)
    plant.wait_ready(1)
    plant.wait_ready(2)
    said = ctl(plant, "trace", "line", "--duration", "0.3")
    assert said.splitlines()[0] == "# drivebridge trace"
    assert re.search(r"^\S+ > poll +drive1: status\? \| 31 20 73 74 73 0A$", said, re.M)
    assert re.search(r"^\S+ < answer +drive2: position -?\d+ pulses, velocity 0 pulses/s, status .*stp.* "
                     r"\(\d+\.\d+ ms\) \| FF 02 02( [0-9A-F]{2})+ FE$", said, re.M)
    told = objects(plant, "trace", "--duration", "0.3")
    asked = {one["number"]: one for one in told if one["direction"] == "sent"}
    answers = [one for one in told if one["kind"] == "answer" and one["question"] in asked]
    assert answers
    for answer in answers:
        question = asked[answer["question"]]
        assert question["drive"] == answer["drive"] and question["time_us"] <= answer["time_us"]
    assert [one["number"] for one in told] == list(range(told[0]["number"], told[0]["number"] + len(told)))
    path = plant.place / "trace.json"
    assert objects(plant, "trace", "--past", "--duration", "0.1", "--output", path) == []
    assert json.loads(path.read_text(encoding="utf-8").splitlines()[0])["number"] == 1
    assert "cannot write /nowhere/a.txt: No such file" in ctl(plant, "trace", "--output", "/nowhere/a.txt", status=1)


def test_trouble_leaves_a_trace(make_bridge):
    plant = make_bridge(drives=2)
    plant.wait_ready(1)
    plant.wait_ready(2)
    assert "no trace was kept" in ctl(plant, "traces")
    assert 'no trace "last" was kept' in ctl(plant, "trace", "--kept", "last", status=2)
    plant.sim.fault("silence on", "drive2")
    (kept,) = eventually(lambda: objects(plant, "traces")[0], what="a trace to be kept")
    assert (kept["bus"], kept["drive"], kept["event"]) == ("line", "drive2", "drive-lost")
    said = lines(ctl(plant, "trace", "--kept", "last"))
    lost = next(i for i, line in enumerate(said) if line.endswith("= event      drive2: drive-lost"))
    good = max(i for i, line in enumerate(said) if " < answer     drive2: " in line)
    silent = [i for i, line in enumerate(said) if "! unanswered drive2: no answer to " in line]
    # The last good exchange, then questions without answers, then the loss, and what followed.
    assert good < silent[0] < lost < len(said) - 1
    assert any(" > poll       drive2: status? | " in line for line in said[good:lost])
    assert said == lines(ctl(plant, "trace", "line", "--kept", str(kept["number"])))
    assert 'no trace "77" was kept' in ctl(plant, "trace", "--kept", "77", status=2)


def test_what_is_asked_wrongly_is_told(make_bridge):
    plant = make_bridge(drives=1)
    plant.wait_ready(1)
    assert "no bus is called \"lime\"; did you mean line?" in ctl(plant, "trace", "lime", status=2)
    assert "--duration soon: right is a number of seconds" in ctl(plant, "trace", "--duration", "soon", status=2)
    with Line(plant) as tool:
        tool.ask(f"{INTERFACE}.Trace", {"bus": "lime"}, more=True)
        assert tool.answer()["error"] == f"{INTERFACE}.NoSuchBus"
        tool.ask(f"{INTERFACE}.Trace", {"bus": "line", "kept": 5}, more=True)
        assert tool.answer()["error"] == f"{INTERFACE}.NoSuchTrace"
        tool.ask(f"{INTERFACE}.Trace", {"bus": "line"})
        assert tool.answer()["error"] == "org.varlink.service.ExpectedMore"
        for wrong in ({"bus": 7}, {"bus": "line", "past": "yes"}, {"bus": "line", "kept": 0}, {}):
            tool.ask(f"{INTERFACE}.Trace", wrong, more=True)
            assert tool.answer()["error"] == "org.varlink.service.InvalidParameter"


# --- the families --------------------------------------------------------------------------------------------


def live(plant, *words):
    return lines(ctl(plant, "trace", *words, "--past", "--duration", "0.2"))


def test_a_bus_of_vsmd_on_can_is_told_in_words(make_can):
    plant = make_can(drives=2)
    plant.drive(1).settle("enable")
    plant.drive(1).settle("move_absolute", target_position=500, target_velocity=8000.0)
    said = live(plant)
    for wanted in (r"> probe +drive2: identity\? \| 0010039E#0A01", r"> command +drive1: enable \| 00080381#",
                   r"> command +drive1: move to 500 pulses at 8000 pulses/s \| 00080386#000001F445FA0000",
                   r"< part +drive1: velocity \S+ pulses/s, position \d+ pulses \(\S+ ms\) \| 00080200#[0-9A-F]{16}",
                   r"< answer +drive1: status .*stp.* \(\S+ ms\) \| 00080202#[0-9A-F]{8}"):
        assert any(re.search(wanted + "$", line) for line in said), wanted


def test_a_bus_of_servos_is_told_in_words(make_servo):
    plant = make_servo()
    eventually(lambda: plant.drive().read("axis_state") == 1)
    assert plant.drive().command("enable") == 0
    assert plant.drive().command("move_velocity", target_velocity=-600) == 0
    said = live(plant)
    for wanted in (r"> command +drive1: enable \| 021#000A", r"< answer +drive1: acknowledges enable \(\S+ ms\) \| 002#01",
                   r"> command +drive1: mode speed", r"> command +drive1: speed -\d+ rpm \| 061#01",
                   r"< \S+ +drive1: status servo_started .*inputs", r"drive1: speed -?\d+ rpm, current"):
        assert any(re.search(wanted, line) for line in said), wanted


def test_a_bus_of_controllers_is_told_in_words_by_axis(make_xyza):
    plant = make_xyza()
    plant.wait_ready(1)
    said = live(plant)
    for wanted in (r"> probe +address 3: are you there\? \| 5A A5 0A AC 01 03 AC AC 08",
                   r"< answer +address 3: I am here \(", r"> poll +drive2: position without its sign\?",
                   r"< answer +drive2: position without its sign \d+ pulses", r"drive1: does it stand\?",
                   r"< answer +drive1: it stands", r"< answer +address 3: inputs \w+, outputs \w+"):
        assert any(re.search(wanted, line) for line in said), wanted
    # What holds passwords is asked for, and its answer is not shown.
    secret = [line for line in said if "read_password" in line and " < " in line]
    assert secret and all("|" not in line for line in secret)


# --- files and readers -----------------------------------------------------------------------------------------


def read_pcapng(data):
    """Frames of a file, strictly: (seconds, id, data, sent, comment)."""
    frames, at = [], 0
    while at < len(data):
        kind, length = struct.unpack_from("<II", data, at)
        assert length % 4 == 0 and struct.unpack_from("<I", data, at + length - 4) == (length,)
        body = data[at + 8:at + length - 4]
        at += length

        def options(body, place):
            found = {}
            while True:
                code, size = struct.unpack_from("<HH", body, place)
                place += 4
                if code == 0:
                    assert size == 0 and place == len(body)
                    return found
                found[code] = body[place:place + size]
                place += (size + 3) // 4 * 4

        if kind == 0x0A0D0D0A:
            assert not frames and struct.unpack("<IHHq", body) == (0x1A2B3C4D, 1, 0, -1)
        elif kind == 1:
            assert struct.unpack_from("<HHI", body) == (227, 0, 0)
            interface = options(body, 8)
            assert interface[2] == b"line" and interface[9] == b"\x06"
        else:
            assert kind == 6
            number, high, low, captured, original = struct.unpack_from("<IIIII", body)
            assert number == 0 and captured == original
            packet = body[20:20 + captured]
            can_id, size = struct.unpack_from(">IB", packet)
            assert packet[5:8] == bytes(3) and len(packet) == 8 + size
            told = options(body, 20 + (captured + 3) // 4 * 4)
            frames.append(((high << 32 | low) / 1e6, can_id, packet[8:], told[2] == b"\x02\0\0\0",
                           told[1].decode()))
    return frames


def test_a_file_of_can_has_every_frame(make_can, tmp_path):
    plant = make_can()
    path = tmp_path / "can.pcapng"
    mark = plant.sim.mark()
    said = ctl(plant, "trace", "--duration", "0.4", "--output", path)
    assert re.fullmatch(rf"\d+ records in {path}, 0 missing\n", said)
    frames = read_pcapng(path.read_bytes())
    times = [frame[0] for frame in frames]
    assert times == sorted(times) and abs(times[0] - time.time()) < 60
    # The same that the simulator heard, in a row.
    sent = [f"{can_id & 0x1FFFFFFF:08X}#{data.hex().upper()}" for _, can_id, data, out, _ in frames if out]
    heard = "\n".join(plant.sim.sent(mark, polls=True))
    assert len(sent) > 5 and "\n".join(sent) in heard
    assert all(can_id & 0x80000000 for _, can_id, *_ in frames)
    assert {"poll: drive1: velocity, position and status?"} < {comment for *_, comment in frames}
    answers = [comment for *_, out, comment in frames if not out]
    assert any(comment.startswith("answer: drive1: status ") for comment in answers)


def test_a_slow_reader_is_told_what_it_misses(make_can):
    """Much traffic, and a client that reads nothing for a while; another one has all of it meanwhile."""
    plant = make_can(drives=4, bus={"cycle-ms": 5})
    with Line(plant) as slow, Line(plant) as fast:
        slow.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for tool in (slow, fast):
            tool.ask(f"{INTERFACE}.Trace", {"bus": "line"}, more=True)
        state = {"expected": None, "missed": 0}

        def take_slowly():
            """One answer: what is missing before it is told."""
            told = slow.answer()["parameters"]
            numbers = [one["number"] for one in told["records"]]
            assert state["expected"] is None or numbers[0] == state["expected"] + told["missed"]
            state["missed"] += told["missed"]
            state["expected"] = numbers[-1] + 1

        last, seen, taken = None, 0, 0
        # More than the ring holds goes by: 256 KiB, 32 bytes for each frame. Who takes nothing for ten seconds would
        # be dropped.
        while seen < 300 * 1024 / 32:
            told = fast.answer()["parameters"]
            numbers = [one["number"] for one in told["records"]]
            assert last is None or numbers[0] == last + 1 + told["missed"]
            assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
            last, seen = numbers[-1], seen + len(numbers)
            if seen > 2000 * (taken + 1):
                take_slowly()
                taken += 1
        while state["expected"] <= last:
            take_slowly()
        assert state["missed"] > 0


def test_a_trace_goes_on_with_the_bus_that_takes_the_place_of_another(make_bridge):
    """A reload with another cycle: the bus ends and a new one begins, whose trace does as well; what was kept stays."""
    plant = make_bridge(drives=2)
    plant.sim.fault("silence on", "drive2")
    eventually(lambda: objects(plant, "traces")[0], what="a trace to be kept")
    plant.sim.fault("silence off", "drive2")
    with Line(plant) as tool:
        tool.ask(f"{INTERFACE}.Trace", {"bus": "line"}, more=True)
        assert tool.answer()["parameters"]["records"][0]["number"] > 1
        plant.sections["bus line"]["cycle-ms"] = 30
        plant.reload()
        records = eventually(lambda: [one for one in tool.answer()["parameters"]["records"] if one["number"] == 1])
        assert (records[0]["kind"], records[0]["words"]) == ("event", "bus-up")
        # And when there is none of that name any more, it ends.
        plant.sections["bus other"] = plant.sections.pop("bus line")
        for number in (1, 2):
            plant.sections[f"drive drive{number}"] = {**plant.sections.pop(f"drive drive{number}"), "bus": "other"}
        plant.reload()
        answer = eventually(lambda: [one for one in [tool.answer()] if "error" in one])[0]
        assert answer["error"] == f"{INTERFACE}.NoSuchBus"
    assert objects(plant, "traces")[0][0]["drive"] == "drive2"


def test_who_may_only_read_may_trace(make_bridge):
    plant = make_bridge(control={"act-group": "nobody-is-in-this"})
    with Line(plant) as tool:
        tool.ask(f"{INTERFACE}.Trace", {"bus": "line", "past": True}, more=True)
        assert tool.answer()["parameters"]["records"]


def test_the_watchdog_leaves_a_trace(make_bridge):
    plant = make_bridge(per_drive={1: {"watchdog-ms": 300}})
    plant.drive().settle("enable")
    plant.drive().command("move_velocity", target_velocity=3000.0)
    (kept,) = eventually(lambda: objects(plant, "traces")[0], what="a trace to be kept")
    assert (kept["drive"], kept["event"]) == ("drive1", "watchdog-tripped")
    said = lines(ctl(plant, "trace", "--kept", "last"))
    tripped = next(i for i, line in enumerate(said) if line.endswith("= event      drive1: watchdog-tripped"))
    moved = next(i for i, line in enumerate(said) if "> command    drive1: turn at 3000 pulses/s" in line)
    stopped = next(i for i, line in enumerate(said) if "> stop       drive1: stop | 31 20 73 74 70 0A" in line)
    assert moved < tripped < stopped


# --- traces as tests -------------------------------------------------------------------------------


@pytest.fixture
def replay(make_bridge, tmp_path):
    """The bridge in front of the drives' side of a trace, and what the simulator said of it when it has ended."""
    processes = []

    def begin(name):
        plant = make_bridge(drives=2, bus={"cycle-ms": 50, "drive-latency-ms": 30}, start_sim=False)
        log = tmp_path / "replay.log"
        with open(log, "wb") as out:
            processes.append(subprocess.Popen(
                [find_program("drivebridge-sim"), "--replay", ROOT / "tests" / "e2e" / "traces" / name,
                 "--link", f"replay={plant.link}"], stdout=out, stderr=out))

        def end():
            processes[0].terminate()
            return processes[0].wait(5), log.read_text(encoding="utf-8")

        return plant, end

    yield begin
    for process in processes:
        if process.poll() is None:
            process.kill()
            process.wait()


def test_a_trace_is_replayed_against_the_drivers(replay):
    """Recorded: an answer 53 ms after its question, 30 ms being allowed, and a frame with a wrong sum."""
    plant, end = replay("late-and-damaged.txt")
    plant.wait_ready(1)
    plant.wait_ready(2)

    def figures():
        with Line(plant) as tool:
            tool.ask(f"{INTERFACE}.Figures")
            return tool.answer()["parameters"]["buses"]["line"]

    eventually(lambda: figures()["bad_frames"] == 1, what="the damaged frame")
    # One late answer is no pattern: nothing is learnt of it, and nothing said.
    assert "ms after a request" not in plant.log_path.read_text(encoding="utf-8")
    eventually(lambda: plant.drive(1).read("timeouts") >= 1)
    eventually(lambda: plant.drive(2).read("status") & 1 and plant.drive(2).read("timeouts") >= 1)
    # Neither lost a drive: both were asked what cannot be confused, and went on.
    assert objects(plant, "traces") == [[]]
    past = ctl(plant, "trace", "line", "--past", "--duration", "0.1")
    assert re.search(r"! unanswered drive1: no answer to \"status\?\".*\n(?:.*\n)*?.* > probe +drive1: identity\? .*\n"
                     r".* < late +drive1: position 0 pulses", past)
    eventually(lambda: figures()["transactions"] > 60)
    status, told = end()
    assert status == 0, told
    assert "all of it was replayed" in told


def test_a_trace_that_is_none_is_refused(tmp_path):
    path = tmp_path / "wrong.txt"
    for text, wrong in (("10:00:00.000000 > poll a: b | 31 2\n", ":1: right are bytes of two hexadecimal digits"),
                        ("# x\n10:00:00 > poll\n", ":2: right is a time of day and a direction"),
                        ("10:00:00.000000 > poll\n", ":1: right are bytes behind a stroke"),
                        ("10:00:00.000000 > poll | 123#00\n", "a trace of CAN cannot be replayed"),
                        ("# nothing\n", ":2: nothing is asked in this file")):
        path.write_text(text, encoding="utf-8")
        done = subprocess.run([find_program("drivebridge-sim"), "--replay", path], capture_output=True, text=True,
                              timeout=10, check=False)
        assert done.returncode == 1 and wrong in done.stdout + done.stderr, done


# --- records of values -----------------------------------------------------------------------------


def read_csv(path):
    with open(path, newline="", encoding="utf-8") as table:
        return list(csv.DictReader(table))


def test_a_record_has_every_cycle_once(make_bridge, tmp_path):
    plant = make_bridge(drives=1)
    path = tmp_path / "a.csv"
    said = ctl(plant, "record", "drive1.position", "drive1.axis_state", "--samples", "40", "--output", path)
    told = re.fullmatch(rf"40 samples in {path}, (\d+) lost\n", said)
    rows = read_csv(path)
    assert list(rows[0]) == ["time_s", "unix_time_s", "drive1.position [counts]", "drive1.axis_state"]
    times = [float(row["unix_time_s"]) for row in rows]
    assert times == sorted(set(times)) and float(rows[0]["time_s"]) == 0
    assert abs(times[0] - time.time()) < 60
    # One a cycle; those that are missing are told.
    assert float(rows[-1]["time_s"]) >= 0.020 * (39 + int(told[1])) * 0.9
    assert ctl(plant, "record", "drive1.position", "--samples", "2").startswith("time_s,unix_time_s,")


def test_a_trigger_begins_a_record_some_time_before(make_bridge, tmp_path):
    plant = make_bridge(drives=2)
    path = tmp_path / "a.csv"
    recorder = subprocess.Popen(
        [find_program("drivebridgectl"), "--socket", plant.control_path, "record", "drive1.position",
         "drive2.position", "--trigger", "drive1.position>2000", "--before", "0.2", "--duration", "0.2",
         "--output", path], stderr=subprocess.PIPE, text=True)
    plant.drive(1).settle("enable")
    eventually(lambda: "drive1.position" in path.read_text(encoding="utf-8") if path.exists() else False)
    time.sleep(0.3)
    plant.drive(1).command("move_absolute", target_position=4000, target_velocity=8000.0)
    assert recorder.wait(10) == 0
    told = recorder.stderr.read()
    assert told.startswith("drive1.position>2000 came\n")
    rows = read_csv(path)
    first = [(float(row["time_s"]), int(row["drive1.position [counts]"])) for row in rows
             if row["drive1.position [counts]"]]
    assert all(position <= 2000 for seconds, position in first if seconds < 0)
    assert [position > 2000 for seconds, position in first if seconds == 0] == [True]
    assert -0.2 <= first[0][0] < 0 < first[-1][0] <= 0.2
    assert any(row["drive2.position [counts]"] for row in rows)


def test_a_record_is_whole_when_it_is_ended(make_bridge, tmp_path):
    plant = make_bridge(drives=1)
    path = tmp_path / "a.csv"
    recorder = subprocess.Popen(
        [find_program("drivebridgectl"), "--socket", plant.control_path, "record", "drive1.position", "--trigger",
         "drive1.status=error_stop", "--output", path], stderr=subprocess.PIPE, text=True)
    eventually(lambda: path.exists())
    time.sleep(0.3)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(5) == 1
    assert "drive1.status=error_stop did not come" in recorder.stderr.read()
    assert path.read_bytes() == b"time_s,unix_time_s,drive1.position [counts]\r\n"
    # The drive is lost on the way: it ends all the same.
    recorder = subprocess.Popen(
        [find_program("drivebridgectl"), "--socket", plant.control_path, "record", "drive1.position", "--duration",
         "0.5", "--output", path], stderr=subprocess.PIPE, text=True)
    eventually(lambda: path.exists())
    time.sleep(0.2)
    plant.sim.fault("silence on", "drive1")
    assert recorder.wait(10) == 0
    assert read_csv(path)


def test_a_picture_is_made_by_gnuplot(make_bridge, tmp_path):
    plant = make_bridge(drives=1)
    command = [find_program("drivebridgectl"), "--socket", plant.control_path, "record", "drive1.position",
               "--samples", "5", "--output", tmp_path / "it's.csv", "--plot", tmp_path / "a.svg"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False,
                          env={**os.environ, "PATH": str(tmp_path)})
    assert done.returncode == 1 and "gnuplot is not installed" in done.stderr and "apt install gnuplot" in done.stderr
    assert len(read_csv(tmp_path / "it's.csv")) == 5
    # What gnuplot is told, by one that says so.
    fake = tmp_path / "gnuplot"
    fake.write_text(f"#!/bin/sh\nprintf '%s' \"$2\" > {tmp_path}/script\n", encoding="utf-8")
    fake.chmod(0o755)
    done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False,
                          env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"})
    assert done.returncode == 0, done
    script = (tmp_path / "script").read_text(encoding="utf-8")
    assert f"set terminal svg noenhanced size 1000,600; set output '{tmp_path}/a.svg'" in script
    assert f"plot for [i=3:3] '{tmp_path}/it''s.csv' using 1:i with lines" in script


def test_a_record_that_cannot_be_is_told(make_bridge):
    plant = make_bridge(drives=1)
    for words, wrong in ((["position"], "right is DRIVE.NAME"),
                         (["drive7.position"], 'no drive is called "drive7"'),
                         (["drive1.positron"], 'has no register "positron"; did you mean position?'),
                         (["drive1.position", "--trigger", "drive1.position"], "right is DRIVE.NAME=VALUE"),
                         (["drive1.position", "--trigger", "drive1.axis_state=Errorstep"], "or a name of its codes"),
                         (["drive1.position", "--samples", "0"], "right is a number above 0"),
                         (["drive1.position", "--before", "1"], "only with a trigger"),
                         (["drive1.position", "--plot", "a.png"], "ends with .svg"),
                         (["drive1.position", "--duration", "-1"], "right is a number of seconds")):
        assert wrong in ctl(plant, "record", *words, status=2), words


def test_names_are_there_to_be_completed(make_bridge):
    plant = make_bridge(drives=1)
    assert ctl(plant, "names", "buses") == "line\n"
    assert "drive1.position\n" in ctl(plant, "names", "values")


# --- Wireshark -------------------------------------------------------------------------------------------------


def tshark(path, *options):
    """The lines that tshark prints of a file, with the dissector that the package has."""
    # From 4.4 on it reads no script when root runs it; and nobody may look into root's folders.
    account = {"user": "nobody", "group": "nogroup", "extra_groups": []} if os.geteuid() == 0 else {}
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as place:
        os.chmod(place, 0o755)
        capture = shutil.copy(path, place)
        script = shutil.copy(ROOT / "packaging" / "wireshark" / "drivebridge.lua", place)
        os.chmod(capture, 0o644)
        os.chmod(script, 0o644)
        done = subprocess.run(["tshark", "-X", f"lua_script:{script}", "-r", capture, *options], capture_output=True,
                              text=True, timeout=60, check=True, cwd=place, env={**os.environ, "HOME": place}, **account)
    assert "Error" not in done.stderr and "error" not in done.stderr, done.stderr
    return done.stdout.splitlines()


def dissected(path, *fields):
    """The values of these fields in each packet."""
    lines = tshark(path, "-T", "fields", "-E", "separator=\t", *[word for field in fields for word in ("-e", field)])
    return [line.split("\t") for line in lines]


def test_wireshark_shows_a_serial_line_in_words(make_bridge, tmp_path):
    bridge = make_bridge()
    path = tmp_path / "line.pcapng"
    bridge.sim.fault("lose-request 1")
    text = ctl(bridge, "trace", "line", "--past", "--duration", "0.4", "--output", path)
    count = int(re.match(r"(\d+) records in ", text)[1])
    packets = dissected(path, "drivebridge.direction", "drivebridge.family", "drivebridge.kind", "drivebridge.words",
                        "drivebridge.bytes", "_ws.col.Info", "drivebridge.malformed")
    assert len(packets) == count > 5
    assert {packet[1] for packet in packets} == {"vsmd-serial"} and not any(packet[6:] != [""] for packet in packets)
    polls = [packet for packet in packets if packet[2] == "poll"]
    assert polls and all(packet[0] == "1" and packet[3] == "drive1: status?" for packet in polls), polls
    assert all(bytes.fromhex(packet[4].replace(":", "")).startswith(b"1 sts") for packet in polls)
    assert all(packet[5] == f"> poll  {packet[3]}" for packet in polls)
    # What did not come is there, too.
    assert any(packet[2] == "unanswered" and packet[4] == "" for packet in packets)


def test_wireshark_shows_can_in_words(make_can, tmp_path):
    plant = make_can()
    path = tmp_path / "can.pcapng"
    ctl(plant, "trace", "--duration", "0.3", "--output", path)
    packets = dissected(path, "can.id", "drivebridge_can.words")
    assert len(packets) > 3 and all(packet[0] for packet in packets)
    poll = "poll: drive1: velocity, position and status?"
    assert any(packet[1] == poll for packet in packets), packets
    # From 4.4 on the field _ws.col.info is taken before the words are in the column, which people see.
    assert poll in tshark(path, "-o", 'gui.column.format:"Info","%i"')
