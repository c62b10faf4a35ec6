# SPDX-License-Identifier: Apache-2.0
"""Parameters as files: `drivebridgectl params` in front of the real drivebridged and simulated drives of each family."""

import json
import re
import subprocess

import pytest
from bridgelib import eventually, find_program

SERIAL = ["spd=6400", "acc=64000", "dec=64000", "cra=0.1", "s1f=2", "pud=39"]

FAMILIES = {
    "vsmd-serial": {"sim_drive": {"set": SERIAL}},
    "vsmd-can": {"bus": {"transport": "slcan", "bitrate": 1000000, "line": None}, "sim_drive": {"set": SERIAL}},
    "xyza": {"sim_drive": {"identity": None, "set": ["min_speed=100", "max_speed=3200", "manual_speed=2000"]}},
    "servo-can": {"bus": {"transport": "slcan", "bitrate": 1000000, "line": None}, "sim_drive": {"identity": None, "set": None}},
}


def make_plant(make_bridge, family, **more):
    setup = {"drives": 2, "sim_drives": 2, **FAMILIES[family]} | more
    bus = {"protocol": family} | setup.pop("bus", {})
    bridge = make_bridge(bus=bus, sim_bus=dict(bus), **setup)
    for number in (1, 2):
        bridge.wait_ready(number)
    return bridge


@pytest.fixture
def plant(make_bridge):
    return make_plant(make_bridge, "vsmd-serial")


def run(plant, *words, **more):
    return subprocess.run([find_program("drivebridgectl"), "--socket", plant.control_path, *map(str, words)],
                          capture_output=True, text=True, timeout=60, check=False, **more)


def ctl(plant, *words, status=0, **more):
    done = run(plant, *words, **more)
    assert done.returncode == status, done
    return done.stdout + done.stderr


def objects(plant, *words, status=0, **more):
    return [json.loads(line) for line in ctl(plant, "--json", *words, status=status, **more).splitlines()]


def values_of(text):
    """The parameters of a file, as they stand there."""
    body = text[text.index("parameters {"):]
    return dict(re.findall(r"^\t(\w+) += (\S+)", body, re.M))


# --- looking ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_a_saved_drive_is_as_its_file(make_bridge, family, tmp_path):
    plant = make_plant(make_bridge, family)
    if family == "servo-can":  # of which nothing is known before it is written
        ctl(plant, "set", "drive1", "ramp_acceleration=1000", "ramp_deceleration=2000")
    path = tmp_path / "drive1.params"
    said = ctl(plant, "params", "save", "drive1", path)
    assert said.startswith(f"drive1: saved in {path}\n")
    text = path.read_text(encoding="utf-8")
    assert f"\tfamily   = {family}\n" in text and text.endswith("}\n\nend\n")
    values = values_of(text)
    (told,) = objects(plant, "get", "drive1", *values)
    assert {name: float(value) for name, value in values.items()} == \
        {name: float(value) for name, value in told["values"].items()}
    assert not {"factory_reset", "password", "read_password"} & set(values)
    assert ctl(plant, "params", "diff", "drive1", path) == ""
    assert ctl(plant, "params", "diff", path, path) == ""
    assert ctl(plant, "params", "save", "drive1", "-") == text


def test_list_marks_what_is_changed(plant, tmp_path):
    said = ctl(plant, "params", "list", "drive1")
    assert re.search(r"^\* +pud +39 +0 \.\. 63 +63$", said, re.M)
    assert re.search(r"^ +spd +6400 +pulses/s +-192000 \.\. 192000 +-$", said, re.M)
    assert said.endswith("\n* is another in a drive as delivered\n")
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    path.write_text(path.read_text(encoding="utf-8").replace("6400 ", "3200 "), encoding="utf-8")
    said = ctl(plant, "params", "list", "drive1", path)
    assert re.search(r"^\* +spd +6400 .* 3200$", said, re.M)
    assert re.search(r"^ +pud +39 ", said, re.M)
    (told,) = objects(plant, "params", "list", "drive1")
    assert told["values"]["spd"] == 6400 and told["defaults"]["pud"] == 63
    assert told["family"] == "vsmd-serial" and told["identity"].startswith("VSMD")


def test_diff_tells_what_differs_as_diff_does(plant, tmp_path):
    ctl(plant, "set", "drive2", "spd=3200")
    said = ctl(plant, "params", "diff", "drive1", "drive2", status=1)
    assert said.splitlines() == ["NAME  drive1  drive2  UNIT", "cid        1       2",
                                 "spd     6400    3200  pulses/s"]
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    (told,) = objects(plant, "params", "diff", path, "drive2", status=1)
    assert told["differences"] == [{"name": "cid", "one": 1, "other": 2, "unit": ""},
                                   {"name": "spd", "one": 6400, "other": 3200.0, "unit": "pulses/s"}]
    said = ctl(plant, "params", "diff", "drive1", "default", status=1)
    assert re.search(r"^pud +39 +63$", said, re.M)
    assert re.search(r"^of \d+ others no default is documented$", said, re.M)
    assert "of which drive" in ctl(plant, "params", "diff", "default", "default", status=2)
    assert "No such file" in ctl(plant, "params", "diff", "drive1", tmp_path / "none", status=2)


def test_a_drive_that_is_away_has_no_parameters(plant, tmp_path):
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    plant.sim.fault("silence on", "drive2")
    eventually(lambda: run(plant, "params", "list", "drive2").returncode == 1)
    assert "are not known now" in ctl(plant, "params", "save", "drive2", tmp_path / "g", status=1)
    assert not (tmp_path / "g").exists()
    assert "are not known now" in ctl(plant, "params", "diff", "drive2", path, status=2)


def test_a_file_that_cannot_be_written_stays_as_it_was(plant, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    said = ctl(plant, "params", "save", "drive1", folder / "none" / "f", status=1)
    assert "No such file" in said
    ctl(plant, "params", "save", "drive1", folder, status=1)
    assert not list(tmp_path.glob("folder?*"))
    assert "drive1.params" in ctl(plant, "params", "save", "drive1", cwd=tmp_path)
    assert (tmp_path / "drive1.params").stat().st_mode & 0o777 == 0o644


def test_two_words_are_one_command(plant):
    assert "did you mean params save, " in ctl(plant, "params", "sav", "drive1", status=2)
    assert "params list" in ctl(plant, "params", status=2)
    assert ctl(plant, "params", "list", status=2).endswith("usage: drivebridgectl params list DRIVE [FILE]\n")
