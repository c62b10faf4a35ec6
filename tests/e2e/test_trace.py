# SPDX-License-Identifier: Apache-2.0
"""What a bus carries, in words: live, kept behind trouble and in files, through the control socket and
drivebridgectl."""

import re
import subprocess

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
