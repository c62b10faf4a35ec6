# SPDX-License-Identifier: Apache-2.0
"""Parameters in front of a PLC and of tools: they never veto process data, and what is shown is what the drive has now."""

import json
import math
import os
import re
import socket

import pytest
from bridgelib import NO_ANSWER, ONLINE_BIT, PARAMS_VALID_BIT, Refused, eventually
from test_params import FAMILIES, ctl, make_plant as make_two, objects, run, values_of

WORDS = 67  # registers 0 to 66: all process data


def make_plant(make_bridge, family, **more):
    setup = {"drives": 1, **FAMILIES[family]} | more
    wire = {"protocol": family} | setup.pop("bus", {})
    return make_bridge(bus=wire, sim_bus=wire, **setup)


def wait_answered(drive):
    return eventually(lambda: drive.read("status") & ONLINE_BIT, what="the drive to be online")


def refused_with(drive, first, count):
    with pytest.raises(Refused) as refusal:
        drive.words(first, count)
    return refusal.value.code


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_process_data_do_not_wait_for_parameters(make_bridge, family):
    """A drive that never tells its parameters, and another one that moves."""
    bridge = make_plant(make_bridge, family, wait_online=False, start_sim=False, drives=2)
    bridge.sim.start()
    bridge.sim.control("params drive1 hidden")
    bridge.wait_ready(2)
    other = bridge.drive(2)
    assert other.command("enable") == 0
    assert other.command("move_velocity", target_velocity=100) == 0
    drive = bridge.drive(1)
    wait_answered(drive)
    for _ in range(10):
        values = drive.read_many("axis_state", "deceleration")
        assert math.isnan(values["acceleration"]) and math.isnan(values["deceleration"]) or family == "vsmd-can"
        assert values["position"] == 0
        assert len(drive.words(0, WORDS)) == WORDS
    if family == "vsmd-serial":
        assert not drive.read("status") & PARAMS_VALID_BIT
        assert refused_with(drive, drive.row("acceleration").address, 4) == NO_ANSWER
        assert refused_with(drive, drive.row("spd").address, 2) == NO_ANSWER
    # A PLC that copies such a block back changes nothing.
    assert drive.write("acceleration", math.nan) != 0
    bridge.sim.control("params drive1 shown")
    if family == "vsmd-serial":
        assert other.command("stop") == 0
        eventually(lambda: drive.read("status") & PARAMS_VALID_BIT)
        assert drive.read_many("axis_state", "deceleration")["acceleration"] == 64000


@pytest.mark.parametrize("family", FAMILIES)
def test_process_data_are_there_with_the_drive(make_bridge, family):
    slow = {"lacks": ["lead", "manual_speed", "max_speed"]} if family == "xyza" else {}
    sim_drive = FAMILIES[family]["sim_drive"] | slow
    bridge = make_plant(make_bridge, family, wait_online=False, sim_drive=sim_drive)
    drive = bridge.drive(1)
    wait_answered(drive)
    assert len(drive.words(0, WORDS)) == WORDS
    bridge.wait_ready()
    assert len(drive.words(0, WORDS)) == WORDS


# --- how old they are -------------------------------------------------------------------------------

# One parameter of each family: what it is before, and how the simulator changes it as somebody at the drive does.
TOUCHED = {
    "vsmd-serial": ("spd", 6400, 3200, "param drive1 spd=3200"),
    "vsmd-can": ("spd", 6400, 3200, "param drive1 spd=3200"),
    "xyza": ("manual_speed", 2000, 2500, "item drive1 x manual_speed 2500"),
}


def ages_of(plant, *names):
    """By the control socket, ms."""
    call = {"method": "io.drivebridge.Control.Read", "parameters": {"drive": "drive1", "names": list(names)}}
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(10)
        link.connect(str(plant.control_path))
        link.sendall(json.dumps(call).encode() + b"\0")
        answer = b""
        while not answer.endswith(b"\0"):
            answer += link.recv(65536)
    return json.loads(answer[:-1])["parameters"]["ages_ms"]


@pytest.mark.parametrize("family", FAMILIES)
def test_each_parameter_has_an_age(make_bridge, family):
    plant = make_two(make_bridge, family)
    name = TOUCHED[family][0] if family in TOUCHED else "ramp_acceleration"
    if family == "servo-can":  # it tells no parameter: known is what was written
        assert ages_of(plant, name) == {}
        ctl(plant, "set", "drive1", "ramp_acceleration=1000", "ramp_deceleration=2000")
    # What is no parameter has none.
    ages = ages_of(plant, name, "position")
    assert list(ages) == [name] and 0 <= ages[name] < 30000
    if family in ("vsmd-serial", "servo-can"):
        eventually(lambda: ages_of(plant, name)[name] > ages[name] + 500)
    elif family == "vsmd-can":
        eventually(lambda: ages_of(plant, name)[name] > ages[name])
    (told,) = objects(plant, "params", "list", "drive1")
    assert name in told["ages_ms"]
    assert re.search(rf"^.? +{name} .* \d+\.\d s ", ctl(plant, "params", "list", "drive1"), re.M)


@pytest.mark.parametrize("family", TOUCHED)
def test_a_drive_is_read_before_it_is_saved_compared_and_restored(make_bridge, family, tmp_path):
    plant = make_two(make_bridge, family)
    name, before, after, change = TOUCHED[family]
    path = tmp_path / "before"
    ctl(plant, "params", "save", "drive1", path)
    plant.sim.control(change)
    said = ctl(plant, "params", "diff", path, "drive1", status=1)
    assert re.search(rf"^{name} +{before} +{after}\b", said, re.M)
    plant.sim.control(change)
    ctl(plant, "params", "save", "drive1", tmp_path / "after")
    assert float(values_of((tmp_path / "after").read_text(encoding="utf-8"))[name]) == after
    assert "drive1: 1 written" in ctl(plant, "params", "restore", "drive1", path, "--yes")
    assert ctl(plant, "params", "diff", path, "drive1") == ""


def test_what_cannot_be_read_now_is_told_with_its_age(make_bridge, tmp_path):
    """Another drive of the line moves: no text of parameters then."""
    plant = make_two(make_bridge, "vsmd-serial")
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    other = plant.drive(2)
    assert other.command("enable") == 0
    assert other.command("move_velocity", target_velocity=100) == 0
    done = run(plant, "params", "diff", path, "drive1")
    assert done.returncode == 0 and done.stdout == ""
    assert re.search(r"^drive1 was not read now \(.*moves.*\): its values were read up to \d+\.\d s ago$", done.stderr, re.M)
    assert other.command("stop") == 0


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_who_may_only_look_is_told_the_age(make_bridge):
    plant = make_two(make_bridge, "vsmd-serial", control={"act-group": "adm"})
    os.chmod(plant.place, 0o755)
    os.chmod(plant.place.parent, 0o755)
    done = run(plant, "params", "save", "drive1", "-", user=65534, group=65534, extra_groups=[])
    assert done.returncode == 0 and "spd" in done.stdout
    assert re.search(r"^drive1 was not read now \(you may only look.*\): its values were read up to", done.stderr, re.M)


@pytest.mark.parametrize("family", ["vsmd-can"])
def test_parameters_are_read_again_in_turn(make_bridge, family):
    """Somebody changes one at the drive: it is shown, though nobody asked."""
    plant = make_two(make_bridge, family)
    name, before, after, change = TOUCHED[family]
    drive = plant.drive(1)
    assert drive.read(name) == before
    plant.sim.control(change)
    eventually(lambda: drive.read(name) == after, timeout=120, what=f"{name} to be read again")
    assert ages_of(plant, name)[name] < 120000
