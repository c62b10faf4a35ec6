# SPDX-License-Identifier: Apache-2.0
"""What a bus carries, in words: live, kept behind trouble and in files, through the control socket and
drivebridgectl."""

import csv
import os
import re
import signal
import subprocess
import time

import pytest
from bridgelib import ROOT, eventually, find_program
from test_control import Line
from test_ctl import ctl, objects

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


def test_trouble_leaves_a_trace(make_bridge):
    plant = make_bridge(drives=2)
    plant.wait_ready(1)
    plant.wait_ready(2)
    assert "no trace was kept" in ctl(plant, "traces")
    assert "no trace was kept" in ctl(plant, "trace", "--kept", "last", status=2)
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
    assert "no trace 77 was kept" in ctl(plant, "trace", "--kept", "77", status=2)


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
    log = plant.log_path.read_text(encoding="utf-8")
    assert "drive drive1: answers after" in log and "its answers are given up too soon" in log
    eventually(lambda: plant.drive(2).read("status") & 1 and plant.drive(2).read("timeouts") == 1)
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
    assert -0.21 < first[0][0] < -0.1 and 0.1 < first[-1][0] <= 0.2
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
