# SPDX-License-Identifier: Apache-2.0
"""Parameters as files: `drivebridgectl params` in front of the real drivebridged and simulated drives of each family."""

import json
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest
from bridgelib import code, eventually, find_program
from fakecontrol import Fake, register
from holdlib import Failed, Hand
from test_vendor_view import VENDOR, Plc

SERIAL = ["spd=6400", "acc=64000", "dec=64000", "cra=0.1", "s1f=2", "pud=39"]

FAMILIES = {
    "vsmd-serial": {"sim_drive": {"set": SERIAL}},
    "vsmd-can": {"bus": {"transport": "slcan", "bitrate": 1000000, "line": None}, "sim_drive": {"set": SERIAL}},
    "xyza": {"sim_drive": {"identity": None, "set": ["min_speed=100", "max_speed=3200", "manual_speed=2000"]}},
    "servo-can": {"bus": {"transport": "slcan", "bitrate": 1000000, "line": None}, "sim_drive": {"identity": None, "set": None}},
}


def make_plant(make_bridge, family, **more):
    setup = {"drives": 2, "sim_drives": 2, **FAMILIES[family]} | more
    wire = {"protocol": family} | setup.pop("bus", {})
    bridge = make_bridge(bus=wire | {"save-interval-s": 0}, sim_bus=wire, **setup)
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
    assert ("\ndrive1 does not have or tell: slave_number\n" in said) == (family == "xyza"), said
    text = path.read_text(encoding="utf-8")
    assert f"\tfamily   = {family}\n" in text and text.endswith("}\n\nend\n")
    values = values_of(text)
    (told,) = objects(plant, "get", "drive1", *values)
    assert {name: float(value) for name, value in values.items()} == \
        {name: float(value) for name, value in told["values"].items()}
    assert not {"factory_reset", "password", "read_password"} & set(values)
    assert ctl(plant, "params", "diff", "drive1", path) == ""
    assert ctl(plant, "params", "diff", path, path) == ""
    assert run(plant, "params", "save", "drive1", "-").stdout == text


def test_list_marks_what_is_changed(plant, tmp_path):
    said = ctl(plant, "params", "list", "drive1")
    assert re.search(r"^\* +pud +39 +0 \.\. 63 +\d+\.\d s +63$", said, re.M)
    assert re.search(r"^ +spd +6400 +pulses/s +-192000 \.\. 192000 +\d+\.\d s +-$", said, re.M)
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


def test_what_a_drive_should_tell_is_named(make_bridge, tmp_path):
    plant = make_plant(make_bridge, "xyza", sim_drive={"identity": None, "set": None, "lacks": ["lead"]})
    path = tmp_path / "f"
    said = ctl(plant, "params", "save", "drive1", path, status=1)
    assert "\ndrive1 should have told, and did not: lead\n" in said and "slave_number" in said
    assert "lead" not in values_of(path.read_text(encoding="utf-8"))
    (told,) = objects(plant, "params", "save", "drive1", path, status=1)
    assert told["missing"] == ["lead"] and "slave_number" in told["not_told"]


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
    assert "drive1.params" in ctl(plant, "params", "save", "drive1", cwd=tmp_path, umask=0o27)
    path = tmp_path / "drive1.params"
    assert path.stat().st_mode & 0o777 == 0o640
    # A file keeps its rights, and what is a link or no file at all what it is.
    path.chmod(0o600)
    (tmp_path / "link").symlink_to(path)
    ctl(plant, "params", "save", "drive1", tmp_path / "link")
    assert (tmp_path / "link").is_symlink() and path.stat().st_mode & 0o777 == 0o600
    assert "No space left" in ctl(plant, "params", "save", "drive1", "/dev/full", status=1)
    ctl(plant, "params", "save", "drive1", "/dev/null")
    assert Path("/dev/full").is_char_device() and Path("/dev/null").is_char_device()


def test_two_words_are_one_command(plant):
    assert "did you mean params save, " in ctl(plant, "params", "sav", "drive1", status=2)
    assert "params list" in ctl(plant, "params", status=2)
    assert ctl(plant, "params", "list", status=2).endswith("usage: drivebridgectl params list DRIVE [FILE]\n")


# --- writing back ----------------------------------------------------------------------------------


CHANGES = {
    "vsmd-serial": ["spd=3200", "acc=32000", "s1f=4", "pud=63", "cra=0.33"],
    "vsmd-can": ["spd=3200", "acc=32000", "s1f=4", "pud=63", "cra=0.33"],
    "xyza": ["min_speed=4000", "max_speed=6400", "lead=6000", "start_key=2"],
    "servo-can": ["ramp_acceleration=1500", "ramp_deceleration=2500", "max_speed=900"],
}


def writes_of(plant, number, since):
    """The parameters that a drive on a serial line was told, in their order."""
    lines = [re.fullmatch(rf"{number} cfg (\w+)=\S+", line) for line in plant.sim.sent(since)]
    return [match[1] for match in lines if match]


@pytest.mark.parametrize("family", FAMILIES)
def test_parameters_go_from_one_drive_to_another(make_bridge, family, tmp_path):
    plant = make_plant(make_bridge, family)
    for change in CHANGES[family] if family != "servo-can" else ["ramp_acceleration=1500 ramp_deceleration=2500",
                                                                "max_speed=900"]:
        ctl(plant, "set", "drive1", *change.split())
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    said = ctl(plant, "params", "restore", "drive2", path, "--yes")
    names = [change.split("=")[0] for change in CHANGES[family]]
    for name in names:
        assert re.search(rf"^{name} = .*: (ok|unproven)$", said, re.M), said
    assert re.search(rf"^drive2: {len(names)} written$", said, re.M), said
    assert ("not saved in the drive yet: drivebridgectl run drive2 save_parameters" in said) == family.startswith("vsmd")
    differ = ["cid"] if family.startswith("vsmd") else []
    (told,) = objects(plant, "params", "diff", "drive2", path, status=1 if differ else 0)
    assert [row["name"] for row in told["differences"]] == differ
    said = ctl(plant, "params", "restore", "drive2", path)
    assert said.startswith(f"drive2 has what is in {path}\n") and said.endswith("drive2: 0 written\n")
    assert ("cid is the drive's address" in said) == bool(differ)


MANY = ["mcs=6", "spd=1000", "acc=1000", "dec=1000", "s1f=0", "s2f=4", "s3f=4", "pud=1", "zmd=3", "osv=1", "zsp=77"]


@pytest.fixture
def many(plant, tmp_path):
    """A file that differs from drive 2 in many parameters."""
    ctl(plant, "set", "drive1", *MANY)
    path = tmp_path / "many.params"
    ctl(plant, "params", "save", "drive1", path)
    return path


def test_what_rests_upon_others_comes_behind_them(plant, many):
    mark = plant.sim.mark()
    ctl(plant, "params", "restore", "drive2", many, "--yes")
    assert writes_of(plant, 2, mark) == ["mcs", "pud", "osv", "spd", "acc", "dec", "zsp", "s1f", "s2f", "s3f", "zmd"]


def test_a_restore_can_be_saved(plant, many):
    said = ctl(plant, "params", "restore", "drive2", many, "--yes", "--save")
    assert said.endswith("drive2: 11 written\ndrive2: save_parameters: ok\n")
    lines = objects(plant, "params", "restore", "drive2", many)
    assert lines == [{"drive": "drive2", "file": str(many), "same_model": True, "written": [], "failed": {}, "not_tried": [], "ended": True, "saved": False}]


def test_nothing_is_written_unasked(plant, many):
    mark = plant.sim.mark()
    assert "--yes" in ctl(plant, "params", "restore", "drive2", many, status=2, stdin=subprocess.DEVNULL)
    assert "--yes" in ctl(plant, "--json", "params", "restore", "drive2", many, status=2)
    for answer, status in (b"n\n", 1), (b"\n", 1), (b"y\n", 0):
        assert writes_of(plant, 2, mark) == []
        said, ended = type_in(plant, answer, "params", "restore", "drive2", many)
        assert ended == status and "write 11 into drive2? [y/N]" in said, said
    assert len(writes_of(plant, 2, mark)) == 11


def type_in(plant, text, *words):
    """At a terminal. What it shows, and the exit status."""
    master, slave = os.openpty()
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", plant.control_path, *map(str, words)],
                               stdin=slave, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    os.close(slave)
    os.write(master, text)
    try:
        said = process.communicate(timeout=30)[0].decode()
    finally:
        os.close(master)
    return said, process.returncode


def begin_restore(plant, path):
    """A restore of which the first parameter is written."""
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", plant.control_path, "params", "restore",
                                "drive2", path, "--yes"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    for line in process.stdout:
        if line.endswith(": ok\n"):
            return process
    raise AssertionError("nothing was written")


@pytest.mark.parametrize("how", ["interrupt", "kill", "unplug", "stop the service"])
def test_a_restore_that_was_ended_goes_on_where_it_was(plant, many, how):
    mark = plant.sim.mark()
    process = begin_restore(plant, many)
    if how == "interrupt":
        process.send_signal(signal.SIGINT)
    elif how == "kill":
        process.kill()
    elif how == "unplug":
        plant.sim.fault("silence on", "drive2")
    else:
        assert plant.stop_bridge() == 0
    said = process.stdout.read()
    assert process.wait(30) == {"kill": -9, "stop the service": 3}.get(how, 1), said
    first = writes_of(plant, 2, mark)
    if how != "kill":
        assert re.search(r"^\w+ = .*: stopped: ", said, re.M), said
        assert re.search(r"^drive2: \d+ written, \d+ not; the same command goes on with them$", said, re.M), said
    assert 1 <= len(first) < len(MANY)
    if how == "unplug":
        plant.sim.fault("silence off", "drive2")
    elif how == "stop the service":
        plant.start_bridge()
    plant.wait_ready(2)
    (told,) = objects(plant, "params", "diff", "drive2", many, status=1)
    left = {row["name"] for row in told["differences"]} - {"cid"}
    # What the service was told before its client was killed it goes on with: one parameter more.
    told_last = 1 if how == "kill" else 0
    assert len(left) >= len(MANY) - len(set(first)) - told_last
    mark = plant.sim.mark()
    ctl(plant, "params", "restore", "drive2", many, "--yes")
    again = set(writes_of(plant, 2, mark))
    assert again == left or (again < left and len(again) == len(left) - told_last)
    (told,) = objects(plant, "params", "diff", "drive2", many, status=1)
    assert [row["name"] for row in told["differences"]] == ["cid"]


def test_a_refused_value_does_not_keep_the_others(make_bridge, tmp_path):
    plant = make_plant(make_bridge, "vsmd-serial", sim_per_drive={2: {"max-current": 1.9}})
    ctl(plant, "set", "drive1", "cra=2", "spd=100")
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    said = ctl(plant, "params", "restore", "drive2", path, "--yes", status=1)
    assert "\nspd = 100 pulses/s: ok\n" in said
    assert "\ncra = 2 A: failed: refused: " in said and "\ndrive2: 1 written, 1 not\n" in said
    lines = objects(plant, "params", "restore", "drive2", path, "--yes", status=1)
    assert lines[0]["name"] == "cra" and lines[0]["result"] == "failed"
    assert lines[-1]["written"] == [] and set(lines[-1]["failed"]) == {"cra"}


@pytest.mark.parametrize("ordered", [False, True])
def test_speeds_that_bound_each_other_arrive(make_bridge, tmp_path, ordered):
    """Whether a controller takes a min_speed above its max_speed its document does not say."""
    plant = make_plant(make_bridge, "xyza",
                       sim_drive={"identity": None, "set": ["min_speed=100", "max_speed=3200"],
                                  "ordered-speeds": ordered})
    path = tmp_path / "f"
    ctl(plant, "set", "drive1", "max_speed=9000")
    ctl(plant, "set", "drive1", "min_speed=5000")
    ctl(plant, "params", "save", "drive1", path)
    said = ctl(plant, "params", "restore", "drive2", path, "--yes")
    names = ["max_speed", "min_speed"] if ordered else ["min_speed", "max_speed"]
    assert re.findall(r"^(\w+) = \d+ Hz: ok$", said, re.M) == names
    assert ctl(plant, "params", "diff", "drive2", path) == ""


FILE = """drive "x" {
	format = 1
	family = vsmd-serial
}
parameters {
%s
}
end
"""


@pytest.fixture
def particular(tmp_path):
    """A service whose drive takes no min_speed above its max_speed, and what it was told."""
    def parameter(name, **more):
        return register(name, "u32", True, "Hz", True, min=0, max=10000, **more)

    fake = Fake(tmp_path / "control")
    fake.values |= {"identity": "", "status": 1 | 1 << 12, "min_speed": 100, "max_speed": 1000, "pair_a": None,
                    "pair_b": None}
    fake.answers["Registers"] = {"registers": [
        register("status", "bits32", codes={"0": "online", "3": "moving", "12": "params_valid"}),
        register("identity", "text"), parameter("min_speed", traits=[7, None]), parameter("max_speed"),
        parameter("pair_a", traits=["together"]), parameter("pair_b", traits=["together"])]}

    def write(parameters):
        after = fake.values | parameters["values"]
        if after["min_speed"] > after["max_speed"]:
            return {"error": "io.drivebridge.Control.Refused",
                    "parameters": {"result": "refused", "code": 2, "reason": "the drive refuses it"}}
        fake.values = after
        return {"result": "ok"}

    fake.answers["Write"] = write
    fake.control_path = str(tmp_path / "control")
    yield fake
    fake.close()


def test_what_was_refused_is_tried_again_behind_the_others(particular, tmp_path):
    path = tmp_path / "f"
    path.write_text(FILE % "min_speed = 5000\nmax_speed = 6000", encoding="utf-8")
    said = ctl(particular, "params", "restore", "feeder", path, "--yes")
    assert said.endswith("max_speed = 6000 Hz: ok\nmin_speed = 5000 Hz: ok\nfeeder: 2 written\n")
    # Of one alone nothing changes what the drive says.
    path.write_text(FILE % "min_speed = 7000", encoding="utf-8")
    count = len(particular.called("Write"))
    said = ctl(particular, "params", "restore", "feeder", path, "--yes", status=1)
    assert said.endswith("min_speed = 7000 Hz: failed: refused: the drive refuses it\nfeeder: 0 written, 1 not\n")
    assert len(particular.called("Write")) == count + 1


def test_what_goes_together_is_one_write(particular, tmp_path):
    path = tmp_path / "f"
    path.write_text(FILE % "pair_a = 1\npair_b = 2\nmax_speed = 900", encoding="utf-8")
    ctl(particular, "params", "restore", "feeder", path, "--yes")
    assert [call["values"] for call in particular.called("Write")] == [{"max_speed": 900}, {"pair_a": 1, "pair_b": 2}]


def test_what_a_drive_does_not_have_then_was_not_written(particular, tmp_path):
    path = tmp_path / "f"
    path.write_text(FILE % "max_speed = 900", encoding="utf-8")
    particular.answers["Write"] = {"result": "ok"}
    assert "max_speed = 900 Hz: failed: the drive shows 1000 Hz\nfeeder: 0 written, 1 not\n" in \
        ctl(particular, "params", "restore", "feeder", path, "--yes", status=1)


@pytest.mark.parametrize("other, whose", [("min_speed", "written"), ("pair_a", "had before")])
def test_what_another_writes_meanwhile_is_named(particular, tmp_path, other, whose):
    """Two restores at once: the first value of one is overwritten by the other while it writes its last, or one that was
    right at its beginning."""
    path = tmp_path / "f"
    particular.values["pair_a"] = 3
    path.write_text(FILE % "min_speed = 500\nmax_speed = 900\npair_a = 3", encoding="utf-8")
    write = particular.answers["Write"]

    def write_beside(parameters):
        answer = write(parameters)
        if "max_speed" in parameters["values"]:
            particular.values = particular.values | {other: 7}
        return answer

    particular.answers["Write"] = write_beside
    said = ctl(particular, "params", "restore", "feeder", path, "--yes", status=1)
    unit = " Hz"
    assert re.search(rf"^{other} = \d+{unit}: failed: something has changed it since: the drive shows 7{unit}$", said, re.M), said
    assert said.endswith(f"feeder: {1 if whose == 'written' else 2} written, 1 not\n"), said
    del particular.answers["Write"]
    particular.answers["Write"] = write
    said = ctl(particular, "params", "restore", "feeder", path, "--yes")
    assert said.endswith("feeder: 1 written\n")
    *_, told = objects(particular, "params", "restore", "feeder", path, "--yes")
    assert told["written"] == [] and told["failed"] == {} and told["not_tried"] == []


@pytest.mark.parametrize("error, status, rest", [
    ({"error": "io.drivebridge.Control.Refused", "parameters": {"result": "offline", "code": 13, "reason": "x"}}, 1, 1),
    ({"error": "io.drivebridge.Control.NotAllowed", "parameters": {"reason": "x"}}, 1, 1),
    ({"error": "io.drivebridge.Control.Refused", "parameters": {"result": "limit", "code": 9, "reason": "x"}}, 1, 2),
])
def test_what_ends_a_restore_and_what_does_not(particular, tmp_path, error, status, rest):
    path = tmp_path / "f"
    path.write_text(FILE % "max_speed = 900\npair_a = 1", encoding="utf-8")
    particular.answers["Write"] = lambda parameters: error
    said = ctl(particular, "params", "restore", "feeder", path, "--yes", status=status)
    assert len(particular.called("Write")) == rest
    assert ("goes on with them" in said) == (rest == 1), said


def test_a_wrong_file_writes_nothing(plant, many, tmp_path):
    mark = plant.sim.mark()
    right = many.read_text(encoding="utf-8")

    def refused(text, expected):
        many.write_text(text, encoding="utf-8")
        said = ctl(plant, "params", "restore", "drive2", many, "--yes", status=2)
        assert expected in said, said

    other = tmp_path / "xyza.params"
    other.write_text(right.replace("vsmd-serial", "xyza"), encoding="utf-8")
    for words in ("list", "drive2", other), ("diff", "drive2", other), ("diff", other, "drive2"):
        assert f"{other}:5: these are parameters of xyza, and drive2 is vsmd-serial\n" in \
            ctl(plant, "params", *words, status=2)
    refused(right.replace("vsmd-serial", "xyza"), f"{many}:5: these are parameters of xyza, and drive2 is vsmd-serial")
    refused(right.replace("\tspd ", "\tspeed "), "vsmd-serial has no parameter 'speed'; did you mean spd")
    refused(right.replace("= 1000 ", "= 200000 ", 1), ": spd: 200000 is out of range, -192000 to 192000 pulses/s\n")
    refused(right[:right.index("zsp")], "the file ends too early")
    refused(right.removesuffix("end\n"), "the last line is not 'end'")
    refused("\0" + right, "zero bytes")
    refused("#" * 300000, "too long")
    assert writes_of(plant, 2, mark) == []
    many.write_text(right.replace('identity = "VSMD', 'identity = "ASMD'), encoding="utf-8")
    assert "another model or firmware: the file is of \"ASMD" in ctl(plant, "params", "restore", "drive2", many, "--yes")


def test_a_restore_powers_no_motor(make_bridge, tmp_path):
    plant = make_plant(make_bridge, "xyza")
    ctl(plant, "run", "drive1", "enable")
    ctl(plant, "set", "drive1", "lead=2000")
    path = tmp_path / "f"
    ctl(plant, "params", "save", "drive1", path)
    assert plant.drive(2).settle("disable") == code("result", "ok")
    before = plant.drive(2).read("enable")
    said = ctl(plant, "params", "restore", "drive2", path, "--yes")
    assert re.search(r"^lead = .*: ok$", said, re.M), said
    assert "\nenable stays as it is: it is what the drive does now, and no setting\n" in said
    assert plant.drive(2).read("enable") == before


def test_addresses_are_written_only_when_told(plant, many):
    mark = plant.sim.mark()
    said = ctl(plant, "params", "restore", "drive2", many, "--yes")
    assert "\ncid is the drive's address or bit rate and stays as it is; --with-address writes it\n" in said
    assert "cid" not in writes_of(plant, 2, mark)
    # It holds after save_parameters and a power cycle: nobody is heard elsewhere yet.
    said = ctl(plant, "params", "restore", "drive2", many, "--yes", "--with-address")
    assert writes_of(plant, 2, mark)[-1] == "cid" and "\ncid = 1: ok\n" in said


def test_a_drive_that_moves_is_left_alone(plant, many):
    ctl(plant, "run", "drive2", "enable")
    ctl(plant, "run", "--no-wait", "drive2", "move_velocity", "target_velocity=100")
    mark = plant.sim.mark()
    assert "drive2 moves; stop it first: drivebridgectl run drive2 stop" in \
        ctl(plant, "params", "restore", "drive2", many, "--yes", status=1)
    assert writes_of(plant, 2, mark) == []
    ctl(plant, "run", "drive2", "stop")
    ctl(plant, "params", "restore", "drive2", many, "--yes")


def stop_and_stand(plant):
    assert plant.drive(2).settle("stop") == code("result", "ok")
    eventually(lambda: plant.drive(2).read("axis_state") == code("axis_state", "Standstill"), what="drive 2 to stand")


def test_a_drive_that_is_set_going_meanwhile_gets_no_more(plant, many):
    plc = plant.drive(2)
    assert plc.settle("enable") == code("result", "ok")
    mark = plant.sim.mark()
    process = begin_restore(plant, many)
    assert plc.command("move_velocity", target_velocity=2000.0) == 0
    moved = plant.sim.mark()
    said = process.stdout.read()
    assert process.wait(30) == 1, said
    # The one that was on its way may still have come behind the motion.
    assert len(writes_of(plant, 2, moved)) <= 1
    written = writes_of(plant, 2, mark)
    assert re.search(rf"^drive2: {len(written)} written, {len(MANY) - len(written)} not; the same command goes on with them$", said, re.M), said
    stopped = re.search(r"^(\w+) = .*: stopped: drive2 moves; stop it first$", said, re.M)[1]
    left = re.search(r"^not tried any more: (.*)$", said, re.M)[1].split()
    assert sorted([*written, stopped, *left]) == sorted(one.split("=")[0] for one in MANY), said
    stop_and_stand(plant)
    said = ctl(plant, "params", "restore", "drive2", many, "--yes")
    assert f"drive2: {len(MANY) - len(written)} written" in said
    (told,) = objects(plant, "params", "diff", "drive2", many, status=1)
    assert [row["name"] for row in told["differences"]] == ["cid"]


def test_a_motion_that_has_not_begun_yet_is_one(plant, many):
    """The first status that shows it comes later than the command."""
    assert plant.drive(2).settle("enable") == code("result", "ok")
    with Hand(plant.control_path) as hand:
        assert hand.call("Write", drive="drive2", values={"spd": 5}, standing=True) == {"result": "ok"}
        go = hand.message("Run", {"oneway": True}, drive="drive2", command="move_velocity", arguments={"target_velocity": 100.0})
        hand.socket.sendall(go + hand.message("Write", drive="drive2", values={"spd": 6}, standing=True))
        with pytest.raises(Failed, match="Moving") as failed:
            hand.answer()
        assert failed.value.parameters == {"drive": "drive2"}
        assert hand.call("Write", drive="drive2", values={"spd": 7})["result"] in ("ok", "unproven")
    assert objects(plant, "get", "drive2", "spd")[0]["values"]["spd"] == 7.0


def test_a_motion_between_two_parts_of_a_write_ends_it(plant):
    """Registers that do not stand side by side are written one after the other."""
    assert plant.drive(2).settle("enable") == code("result", "ok")
    mark = plant.sim.mark()
    with Hand(plant.control_path) as writer, Hand(plant.control_path) as mover:
        writer.socket.sendall(writer.message("Write", drive="drive2", standing=True,
                                             values={"spd": 1000, "pud": 40, "s1f": 1, "cra": 0.1, "zsp": 3}))
        mover.call("Run", drive="drive2", command="move_velocity", arguments={"target_velocity": 100.0})
        with pytest.raises(Failed, match="Moving") as failed:
            writer.answer()
        assert failed.value.parameters == {"drive": "drive2"}
    # The part that was under way when the motion came may be written after it, and none of the others.
    sent = [line for line in plant.sim.sent(mark) if re.match("2 (cfg|mov) ?", line)]
    begun = next(place for place, line in enumerate(sent) if line.startswith("2 mov"))
    assert len(sent) - begun <= 2, sent
    stop_and_stand(plant)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_who_may_only_read_may_look_and_not_restore(plant, many):
    mark = plant.sim.mark()
    os.chmod(plant.place, 0o755)
    os.chmod(plant.place.parent, 0o755)

    def as_nobody(*words, **more):
        return subprocess.run(["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups",
                               find_program("drivebridgectl"), "--socket", plant.control_path, "params", *words],
                              capture_output=True, text=True, timeout=60, check=False, **more)

    assert values_of(as_nobody("save", "drive1", "-").stdout) == values_of(many.read_text(encoding="utf-8"))
    done = as_nobody("restore", "drive2", "-", "--yes", input=many.read_text(encoding="utf-8"))
    assert done.returncode == 1 and "only root and members of group" in done.stdout, done
    assert writes_of(plant, 2, mark) == []


# --- what is not saved in the drive ----------------------------------------------------------------


def is_unsaved(plant, number=1):
    (told,) = objects(plant, "get", f"drive{number}", "params_unsaved")
    drive = plant.drive(number)
    assert drive.read("status") >> 17 & 1 == told["values"]["params_unsaved"]
    return told["values"]["params_unsaved"]


def write_register(plant):
    assert plant.drive().write("spd", 1234.0) == 0


def write_neutral_name(plant):
    assert plant.drive().write("acceleration", 1234.0) == 0


def write_in_vendors_view(plant):
    """Its homing mode."""
    plc = Plc(plant.port)
    assert plc.write_one(0x18, 3) == 0
    plc.link.close()


WRITERS = {
    "the control socket": lambda plant: ctl(plant, "set", "drive1", "spd=1234"),
    "a PLC": write_register,
    "a PLC, by the neutral name": write_neutral_name,
    "a PLC, in the vendor's view": write_in_vendors_view,
}


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_what_is_written_is_unsaved_until_it_is_saved(make_bridge, family):
    plant = make_plant(make_bridge, family, per_drive={1: {"vendor-unit": VENDOR}})
    # Who writes makes no difference to a driver: of one family all of them.
    for write in WRITERS.values() if family == "vsmd-serial" else [write_register]:
        assert not is_unsaved(plant)
        write(plant)
        assert is_unsaved(plant) and not is_unsaved(plant, 2)
        status = ctl(plant, "status")
        assert re.search(r"^drive1 .* save_parameters$", status, re.M) and status.endswith("\nno faults, 1 hint\n")
        assert "drive1: params_unsaved: its parameters are not saved and are lost at power-off: drivebridgectl run drive1 save_parameters\n" \
            in status
        assert 'drivebridge_drive_params_unsaved{bus="line",drive="drive1"} 1\n' in ctl(plant, "metrics")
        ctl(plant, "run", "drive1", "save_parameters")
        assert not is_unsaved(plant)
        assert ctl(plant, "status").splitlines()[1].split()[-1] == "ms"
        # Back to what it was, for the next one.
        ctl(plant, "set", "drive1", "spd=6400", "acceleration=64000")
        ctl(plant, "run", "drive1", "save_parameters")
    # As it was saved is saved.
    ctl(plant, "set", "drive1", "spd=1")
    ctl(plant, "set", "drive1", "spd=6400")
    assert not is_unsaved(plant)


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_what_could_not_be_saved_is_unsaved(make_bridge, family):
    plant = make_plant(make_bridge, family)
    ctl(plant, "set", "drive1", "spd=1234")
    plant.sim.control("flash drive1 fail")
    ctl(plant, "run", "drive1", "save_parameters", status=1)
    assert is_unsaved(plant)
    plant.sim.control("flash drive1 ok")
    ctl(plant, "run", "drive1", "save_parameters")
    assert not is_unsaved(plant)
    assert "is out of range" in ctl(plant, "set", "drive1", "spd=1000000", status=2)
    ctl(plant, "set", "drive1", "cra=9", status=1)
    assert not is_unsaved(plant)


def test_what_a_drive_made_of_a_value_is_unsaved(make_bridge):
    plant = make_plant(make_bridge, "vsmd-serial", sim_drive={"clamps": True})
    ctl(plant, "set", "drive1", "cra=9", status=1)
    assert ctl(plant, "get", "drive1", "cra") == "2.5 A\n" and is_unsaved(plant)


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_a_drive_without_power_has_what_it_kept(make_bridge, family):
    plant = make_plant(make_bridge, family)
    ctl(plant, "set", "drive1", "spd=1234")
    # A cable that is out for a while loses nothing.
    plant.sim.fault("silence on", "drive1")
    eventually(lambda: run(plant, "status").returncode == 1, what="drive1 to be offline")
    assert not is_unsaved(plant)  # nobody knows
    plant.sim.fault("silence off", "drive1")
    plant.wait_ready()
    assert is_unsaved(plant)
    # On CAN nothing tells of a restart of a drive that stood at 0 without power.
    ctl(plant, "run", "drive1", "enable")
    plant.sim.control("power drive1 cycle")
    eventually(lambda: objects(plant, "get", "drive1", "spd")[0]["values"]["spd"] == 6400.0)
    assert not is_unsaved(plant)
    # What was before this program started is not known.
    ctl(plant, "set", "drive1", "spd=1234")
    plant.restart_bridge()
    plant.wait_ready()
    assert not is_unsaved(plant)


@pytest.mark.parametrize("family", ["xyza", "servo-can"])
def test_families_without_a_memory_to_save_into_have_no_mark(make_bridge, family):
    plant = make_plant(make_bridge, family)
    servo = family == "servo-can"
    change = ["ramp_acceleration=1", "ramp_deceleration=1"] if servo else ["lead=7000"]
    if servo:
        assert "only together with another" in ctl(plant, "set", "drive1", change[0], status=1)
    # What nothing reads back is taken, and no more.
    said = ctl(plant, "set", "drive1", *change)
    assert said.count(": unproven\n" if servo else ": ok\n") == len(change), said
    assert not is_unsaved(plant)
