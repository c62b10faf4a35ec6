# SPDX-License-Identifier: Apache-2.0
"""drivebridgectl commission in front of simulated drives that are right, and of others that are wired, scaled, signed
or timed wrongly: each is found and named. What somebody at the bench sees is an answer of the test."""

import csv
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from bridgelib import MOVING_BIT, RESULT_OK, eventually, find_program

ROOT = Path(__file__).parents[2]
CAN = {"transport": "slcan", "bitrate": 1000000, "line": None}
SERVO = {"bus": {**CAN, "protocol": "servo-can"}, "sim_bus": {**CAN, "protocol": "servo-can", "baud": None}}
SERVO_SIM = {"identity": None, "set": None}
VSMD_CAN = {"bus": {**CAN, "protocol": "vsmd-can"}, "sim_bus": {**CAN, "protocol": "vsmd-can", "baud": None}}
XYZA = {"bus": {"protocol": "xyza"}, "sim_bus": {"protocol": "xyza"}, "per_drive": {1: {"axis": "x"}},
        "sim_drive": {"identity": None, "step-ms": 50, "set": ["manual_speed=2000", "brake=15", "enable=15"]}}

SEEN = {"uncoupled": "yes", "standing.turned": "skip", "power.go": "yes", "power.holds": "yes", "power.free": "yes",
        "motion.go": "yes", "motion.turned": "clockwise", "motion.forward": "yes", "speed.go": "yes", "stop.go": "yes",
        "stop.seen": "ramp", "silence.go": "yes", "watchdog.go": "yes", "scale.go": "skip", "limits.go": "yes"}


def command(bridge, *words):
    return [find_program("drivebridgectl"), "--socket", bridge.control_path, "commission", "drive1", *words]


def commission(bridge, *words, status=None, **seen):
    """With answers by name; SEEN has the usual ones. The result, its verdicts by setting."""
    path = bridge.place / "answers"
    answers = {**SEEN, **{name.replace("__", ".").replace("_", "-"): text for name, text in seen.items()}}
    path.write_text("# what was seen\n" + "".join(f"{name} = {text}\n" for name, text in answers.items()))
    done = subprocess.run(command(bridge, "--json", "--answers", path, *words), capture_output=True, text=True,
                          timeout=120, check=False, cwd=bridge.place)
    assert done.returncode in (0, 1), done
    told = json.loads(done.stdout.splitlines()[-1])
    told["by"] = {one["setting"]: one for one in told["verdicts"]}
    assert status in (None, done.returncode), "\n".join(
        f"{one['setting']}: {one['verdict']}: {one['how']}" for one in told["verdicts"])
    return told


def contradicted(told):
    return {name: one["right"] for name, one in told["by"].items() if one["verdict"] == "contradicted"}


def proven_or_doubtful(told):
    """Times that were measured while the computer was busy are told as doubtful, and never as wrong."""
    return {name for name, one in told["by"].items()
            if one["verdict"] == "proven" or (one["verdict"] == "not seen" and "doubtful" in one["how"])}


def others(told, names):
    """Of these settings those that are neither proven nor doubtful, with the reason."""
    return {name: told["by"][name]["how"] for name in names - proven_or_doubtful(told)}


def step(bridge, name, **seen):
    return commission(bridge, "--step", name, "--duration", "0.8", **seen)


def test_a_right_drive_has_nothing_contradicted(make_bridge):
    """On a busy machine a motion may begin late: reaction-ms leaves room for that."""
    bridge = make_bridge(drive={"counts-per-unit": 640.0, "unit-name": "mm", "reaction-ms": 500, "watchdog-ms": 600})
    told = commission(bridge, "--duration", "0.7", status=0)
    assert contradicted(told) == {}
    assert others(told, {
        "address", "drive-latency-ms", "turnaround-us", "status", "enable", "disable", "motion", "direction",
        "reaction-ms", "speed-sign", "velocity", "stop-reaction-ms", "stop", "quick_stop", "silence",
        "watchdog-ms"}) == {}
    assert told["by"]["counts-per-unit"]["verdict"] == "not seen"
    report = (bridge.place / "drive1.commissioning.txt").read_text()
    assert "commissioning of drive1 (vsmd-serial on bus line)" in report and "0 contradicted" in report
    assert "VSMD113_025T" in report and "# drive drive1: nothing that was seen changes it" in report
    # It is left as it should be on a bench: standing, without power.
    assert not bridge.sim.get()["velocity"] and not bridge.drive().read("status") & MOVING_BIT


@pytest.mark.parametrize("family", [
    {**XYZA, "bus": {**XYZA["bus"], "reaction-ms": 500}},
    {**SERVO, "sim_drive": SERVO_SIM, "drive": {"mode": "speed", "reaction-ms": 800, "counts-per-turn": 10000}}],
    ids=["xyza", "servo"])
def test_a_right_drive_of_another_family(make_bridge, family):
    bridge = make_bridge(**family)
    told = commission(bridge, "--duration", "0.5", status=0)
    assert contradicted(told) == {}
    assert others(told, {
        "address", "drive-latency-ms", "status", "enable", "disable", "motion", "direction", "reaction-ms",
        "velocity" if "drive" not in family else "speed-sign", "stop-reaction-ms", "stop", "quick_stop",
        "silence"}) == {}
    other = {"enabled-bit", "speed-sign", "counts-per-turn"} if "drive" not in family else {"turnaround-us"}
    assert {name for name, one in told["by"].items() if one["verdict"] == "does not apply"} == other


# --- wrong in one way each -------------------------------------------------------------------------


def test_wired_the_other_way_round(bridge):
    told = step(bridge, "motion", motion__forward="no")
    assert "swap the two wires" in contradicted(told)["direction"]


def test_a_motor_that_does_not_turn(bridge):
    told = step(bridge, "motion", motion__turned="none")
    assert "motor's wires" in contradicted(told)["motion"]


def test_scaled_wrongly_by_ten(make_bridge):
    """The answer says how far it went: a tenth of what its position says."""
    bridge = make_bridge(drive={"counts-per-unit": 64.0, "unit-name": "mm", "max-velocity": 1000.0})
    process = talk(bridge, "--step", "scale")
    said = answer(process, {"uncoupled": "yes", "scale.go": "yes"}, "scale.way")
    counts = int(said["text"].split("by ")[1].split()[0])
    told = finish(process, str(counts / 640))
    assert float(contradicted(told)["counts-per-unit"]) == pytest.approx(640, rel=0.01)
    assert "# was 64.0: " in told["sections"] and "counts-per-unit = 640" in told["sections"]
    assert "unit-name = mm" in told["sections"]


@pytest.mark.parametrize("family", [{}, VSMD_CAN], ids=["serial", "can"])
def test_a_speed_without_a_sign(make_bridge, family):
    bridge = make_bridge(**family, sim_drive={"speed": "unsigned"}, drive={"reaction-ms": 600})
    told = step(bridge, "speed")
    assert contradicted(told) == {"speed-sign": "position"}
    assert "speed-sign = position" in told["sections"]
    # What it says to paste is right: with it the same step contradicts nothing.
    bridge.sections["drive drive1"]["speed-sign"] = "position"
    bridge.reload()
    bridge.drive().reconnect()
    bridge.wait_ready()
    assert contradicted(step(bridge, "speed")) == {}


def test_a_speed_that_is_always_0(make_bridge):
    bridge = make_bridge(sim_drive={"speed": "none"}, drive={"reaction-ms": 600})
    assert set(contradicted(step(bridge, "speed"))) == {"velocity"}


def test_a_motion_that_begins_later_than_configured(make_bridge):
    """With the default reaction-ms the motion fails before it begins: what is named then leads to a measurement."""
    bridge = make_bridge(sim_drive={"motion-delay-ms": 400})
    told = step(bridge, "motion", motion__turned="none")
    assert contradicted(told)["reaction-ms"] == "1000"
    assert "nothing moved within 250 ms" in told["by"]["reaction-ms"]["how"]
    assert told["by"]["direction"]["how"] == "nothing moved: the motion ended as failed"
    bridge.sections["drive drive1"]["reaction-ms"] = 1000
    bridge.reload()
    bridge.drive().reconnect()
    bridge.wait_ready()
    again = step(bridge, "motion")["by"]["reaction-ms"]
    assert again["verdict"] == "proven" and "it began 4" in again["how"]


def test_a_motion_and_a_stand_that_are_told_late(make_bridge):
    """With the default reaction-ms the motion fails although the shaft turns; with more the late stand is seen."""
    bridge = make_bridge(sim_drive={"standing-delay-ms": 400})
    found = step(bridge, "motion")
    assert contradicted(found) == {"reaction-ms": "1000"}
    assert "did not say within 250 ms that it moves" in found["by"]["reaction-ms"]["how"]
    bridge.sections["drive drive1"]["reaction-ms"] = 1000
    bridge.reload()
    bridge.drive().reconnect()
    bridge.wait_ready()
    assert set(contradicted(step(bridge, "stop"))) == {"standing"}


@pytest.mark.parametrize("adapt, sim_bus, bus, line, setting, least, most, how", [
    ("off", {"latency-us": 40000}, {"drive-latency-ms": 20}, "drive-latency-ms", "drive-latency-ms", 40, 40,
     "was not measured"),
    ("off", {"turnaround-us": 5000}, {}, "raise turnaround-us", "turnaround-us", 6000, 6000, "was not measured"),
    ("on", {"latency-us": 40000}, {"drive-latency-ms": 20}, "drive-latency-ms = ", "drive-latency-ms", 40, 200,
     "only because the service has learnt to wait"),
    ("on", {"turnaround-us": 5000}, {}, "turnaround-us = ", "turnaround-us", 4000, 8000, "has learnt to leave")],
    ids=["late", "deaf", "late-and-learnt", "deaf-and-learnt"])
def test_answers_that_do_not_keep_to_the_times(make_bridge, adapt, sim_bus, bus, line, setting, least, most, how):
    """With adapt the service finds out itself, and what it has learnt is told: of a gap the part that it has to wait for."""
    bridge = make_bridge(bus={**bus, "adapt": adapt}, sim_bus=sim_bus, wait_online=False)
    bridge.told(line)
    if adapt == "on":
        bridge.wait_ready()
    told = commission(bridge, "--step", "presence", status=1)
    assert least <= int(contradicted(told)[setting]) <= most
    assert how in told["by"][setting]["how"] and "bus line {" in told["sections"]


@pytest.mark.parametrize("family, drive, name, setting, how", [
    ({"sim_drive": {"mirrored": True}}, {}, "motion", "position", "told forwards, its position fell"),
    ({**SERVO, "sim_drive": {**SERVO_SIM, "mirrored": True}}, {"mode": "speed", "reaction-ms": 800}, "motion",
     "position", "told forwards, its position fell"),
    ({"sim_drive": {"coasts": True}}, {}, "stop", "stop", "no power any more after stop: it coasts"),
    ({"sim_drive": {"power-delay-ms": 60000, "set": ["pae=0"]}}, {}, "power", "enable",
     "2000 ms later it still did not say that its motor has power"),
], ids=["wired-backwards", "servo-wired-backwards", "coasts", "never-enabled"])
def test_what_a_drive_shows_itself(make_bridge, family, drive, name, setting, how):
    """Nobody who watches says anything of it: the drive's own positions and status do."""
    bridge = make_bridge(**family, drive=drive)
    told = step(bridge, name, motion__turned="skip", stop__seen="skip", power__holds="skip")
    assert set(contradicted(told)) == {setting} and how in told["by"][setting]["how"]


def test_power_that_is_told_later_than_configured(make_bridge):
    bridge = make_bridge(sim_drive={"power-delay-ms": 600, "set": ["pae=0"]})
    found = contradicted(step(bridge, "power"))
    assert set(found) == {"reaction-ms"} and 600 < int(found["reaction-ms"]) <= 1500


def test_power_that_does_not_reach_the_motor(bridge):
    told = step(bridge, "power", power__holds="no")
    assert "motor's wires" in contradicted(told)["enable"]


def test_a_stop_that_coasts(bridge):
    told = step(bridge, "stop", stop__seen="coasts")
    assert "brake" in contradicted(told)["stop"]


def test_a_servo_with_other_counts_per_turn_and_an_unsigned_speed(make_bridge):
    bridge = make_bridge(**SERVO, sim_drive={**SERVO_SIM, "speed-sign": "bits"},
                         drive={"counts-per-turn": 1000, "mode": "speed", "reaction-ms": 800})
    found = contradicted(step(bridge, "speed"))
    assert found["speed-sign"] == "bits"
    assert float(found["counts-per-turn"]) == pytest.approx(10000, rel=0.1)


def test_a_servo_whose_enabled_bit_is_another(make_bridge):
    bridge = make_bridge(**SERVO, sim_drive=SERVO_SIM, drive={"mode": "speed", "reaction-ms": 800})
    assert contradicted(step(bridge, "power", power__holds="no")) == {"enabled-bit": "1"}


def test_an_axis_that_takes_seconds_to_stop(make_bridge):
    bridge = make_bridge(**{**XYZA, "sim_drive": {**XYZA["sim_drive"], "braking-ms": 10000}})
    told = commission(bridge, "--step", "stop", "--duration", "0.5", status=0)
    assert told["by"]["stop-reaction-ms"]["verdict"] == "proven"
    last, later = re.fullmatch(r"its position changed last (\d+) ms after stop, and it was told as standing (\d+) ms after "
                               r"that", told["by"]["standing"]["how"]).groups()
    assert int(last) > 1000 and int(later) < 140 and f"stood after {last} ms" in told["by"]["stop"]["how"]


# --- somebody answers line by line -----------------------------------------------------------------


def talk(bridge, *words):
    return subprocess.Popen(command(bridge, "--json", "--answers", "-", *words), stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True, cwd=bridge.place)


def answer(process, answers, until):
    """Answers questions by their names until that one is asked."""
    for line in process.stdout:
        said = json.loads(line)
        if said.get("ask") == until:
            return said
        if "ask" in said:
            reply(process, answers.get(said["ask"], "skip"))
    raise AssertionError(f"{until} was not asked")


def reply(process, text):
    process.stdin.write(text + "\n")
    process.stdin.flush()


def finish(process, text):
    """The last answer. The result."""
    out, _ = process.communicate(text + "\n", timeout=120)
    assert process.returncode in (0, 1)
    lines = [json.loads(line) for line in out.splitlines()]
    told = {**lines[-1], "again": any("again" in line for line in lines)}
    told["by"] = {one["setting"]: one for one in told["verdicts"]}
    return told


def lose_power(bridge):
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.settle("move_absolute", target_position=5000, target_velocity=6400) == RESULT_OK
    eventually(lambda: drive.read("position") == 5000)
    process = talk(bridge, "--step", "power-loss")
    answer(process, {}, "power-loss.off")
    bridge.sim.control("power drive1 off")
    reply(process, "done")
    answer(process, {}, "power-loss.on")
    bridge.sim.control("power drive1 on")
    return finish(process, "done")


def test_a_position_that_is_lost_without_power_and_told_so(make_bridge):
    bridge = make_bridge(sim_drive={"set": ["spd=6400", "acc=64000", "dec=64000", "pae=0"]})
    told = lose_power(bridge)
    assert told["by"]["origin"]["verdict"] == "proven" and "loses its position" in told["by"]["origin"]["how"]
    assert told["by"]["power-up"]["verdict"] == "proven"


def test_a_position_that_outlives_the_power(make_bridge):
    bridge = make_bridge(sim_drive={"keeps-position": True, "set": ["spd=6400", "acc=64000", "dec=64000", "pae=0"]})
    told = lose_power(bridge)
    assert told["by"]["origin"]["verdict"] == "proven" and "keeps its position" in told["by"]["origin"]["how"]


def test_a_drive_that_comes_up_with_power_and_other_parameters(bridge):
    """What was set and not saved is lost with the power."""
    assert bridge.drive().write("spd", 3200) == 0
    found = contradicted(lose_power(bridge))
    assert "pae = 0" in found["power-up"] and "save_parameters" in found["parameters"]


def test_a_question_is_asked_again_until_its_answer_is_one(bridge):
    process = talk(bridge, "--step", "motion")
    assert answer(process, {}, "uncoupled")["choices"] == "yes no"
    reply(process, "y")
    assert json.loads(process.stdout.readline())["ask"] == "uncoupled"
    told = finish(process, "no")
    assert contradicted(told) == {} and told["by"]["reaction-ms"]["verdict"] == "not seen"
    assert bridge.sim.sent() == [line for line in bridge.sim.sent() if " mov" not in line]


# --- motions end -----------------------------------------------------------------------------------


def begin_motion(bridge):
    process = talk(bridge, "--step", "motion", "--duration", "5")
    answer(process, {"uncoupled": "yes"}, "motion.go")
    reply(process, "yes")
    eventually(lambda: abs(bridge.sim.get()["velocity"]) > 0, what="the motion to begin")
    return process


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGSTOP])
def test_the_drive_stands_when_the_program_is_ended_or_frozen(bridge, end):
    process = begin_motion(bridge)
    process.send_signal(end)
    told_at = time.monotonic()
    eventually(lambda: not bridge.sim.get()["velocity"], 2, "the drive to stand")
    assert time.monotonic() - told_at < (0.8 if end == signal.SIGSTOP else 0.5)
    process.kill()
    process.communicate()


def test_the_drive_stands_when_nobody_is_there_to_answer_any_more(bridge):
    process = begin_motion(bridge)
    process.stdin.close()
    process.stdout.read()
    assert process.wait(20) == 1
    assert not bridge.sim.get()["velocity"]


def test_a_trial_does_not_leave_the_limits(make_bridge):
    bridge = make_bridge(drive={"min-position": -1000, "max-position": 100})
    told = step(bridge, "motion", motion__turned="none")
    assert " mov" not in " ".join(bridge.sim.sent())
    assert told["by"]["direction"]["how"] == "nothing moved: the motion ended as limit"


def test_more_than_max_velocity_is_refused(make_bridge):
    bridge = make_bridge(drive={"max-velocity": 3200.0})
    told = commission(bridge, "--step", "limits")
    assert told["by"]["max-velocity"]["verdict"] == "proven"


# --- going on, and what is listed ------------------------------------------------------------------


def test_it_goes_on_where_it_ended(bridge):
    state = bridge.place / "state"
    commission(bridge, "--step", "presence", "--state", state)
    assert json.loads(state.read_text())["done"] == ["presence"]
    told = commission(bridge, "--state", state, uncoupled="no")
    assert told["by"]["address"]["verdict"] == "proven" and told["done"][0] == "presence"
    state.write_text("{}")
    done = subprocess.run(command(bridge, "--state", state, "--answers", os.devnull), capture_output=True, text=True,
                          timeout=20, check=False, cwd=bridge.place)
    assert done.returncode == 2 and "is no state of a commissioning of drive1" in done.stderr


def test_what_is_not_configured_is_taken_as_the_service_takes_it():
    """commission has no service's table of keys: its presets are those of the documents that are made from it."""
    source = (ROOT / "src/tools/commission/judge.c").read_text()
    rows = re.findall(r'\{ "(bus|drive)", "([a-z-]+)", "([^"]*)", "([^"]*)" \}', source)
    with (ROOT / "docs/config-keys.csv").open() as file:
        keys = list(csv.DictReader(file))
    every = {"vsmd-serial", "vsmd-can", "xyza", "servo-can"}
    assert len(rows) > 5
    for section, name, families, preset in rows:
        fitting = [key for key in keys if key["section"] == section and key["name"] == name]
        assert {key["default"] for key in fitting if key["families"] == "all" or
                set(key["families"].split()) & set(families.split())} == {preset}, name
        assert set(families.split()) <= every and set(families.split()) <= {
            family for key in fitting for family in (every if key["families"] == "all" else key["families"].split())}


def test_a_watchdog_that_does_nothing_is_found(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 600, "on-client-loss": "none", "reaction-ms": 600})
    told = step(bridge, "watchdog")
    assert set(contradicted(told)) == {"watchdog-ms"} and "on-client-loss" in told["by"]["watchdog-ms"]["how"]
    assert not bridge.sim.get()["velocity"]


def test_a_computer_that_stands_still_contradicts_nothing(make_bridge):
    """The service, its drives and this program stand still again and again while times are measured."""
    bridge = make_bridge(drive={"reaction-ms": 100})
    process = talk(bridge, "--step", "stop", "--duration", "0.8")
    answer(process, {"uncoupled": "yes"}, "stop.go")
    reply(process, "yes")
    everybody = [process, bridge.process, bridge.sim.process]
    for _ in range(20):
        time.sleep(0.05)
        for one in everybody:
            one.send_signal(signal.SIGSTOP)
        time.sleep(0.15)
        for one in everybody:
            one.send_signal(signal.SIGCONT)
    told = finish(process, "skip")
    assert contradicted(told) == {}
    assert told["again"]


def test_steps_are_listed_and_others_refused(bridge):
    done = subprocess.run(command(bridge, "--list"), capture_output=True, text=True, timeout=20, check=True)
    assert [line.split()[0] for line in done.stdout.splitlines()][:3] == ["presence", "round-trips", "standing"]
    for words, text in ((["--step", "x"], 'there is no step "x"'), ([], "nobody can be asked here"),
                        (["--duration", "9"], "0.2 to 5 s is right"), (["--answers", "/nowhere"], "No such file")):
        done = subprocess.run(command(bridge, *words), capture_output=True, text=True, timeout=20, check=False,
                              stdin=subprocess.DEVNULL, cwd=bridge.place)
        assert done.returncode == 2 and text in done.stderr, done
