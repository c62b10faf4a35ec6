# SPDX-License-Identifier: Apache-2.0
"""What the configuration's files say beside what runs: noticed without being asked, shown everywhere, and when a start
finds wrong ones, what was in force last runs."""

import json
import os
import re
import socket
import stat
import subprocess

import pytest
from bridgelib import ROOT, STANDSTILL, eventually, find_program
from test_control import Tool

WRONG = "nonsense = 1\n"
COPY = "last-good-configuration"


@pytest.fixture
def state(tmp_path, monkeypatch):
    """systemd's StateDirectory."""
    folder = tmp_path / "state"
    folder.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    return folder


def state_of(bridge):
    return bridge.gateway().read("configuration_state")


def wait_for(bridge, name):
    wanted = bridge.map.find("configuration_state", view="gateway").codes[name]
    eventually(lambda: state_of(bridge) == wanted, what=f"configuration_state to be {name}")


def ctl(bridge, *words):
    return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words],
                          capture_output=True, text=True, timeout=30, check=False)


def trouble_of(bridge):
    """The record for all front ends, and whether all is well."""
    with Tool(bridge) as tool:
        told = tool.Troubles([])
    return told["configuration"], told["well"]


def wait_for_copy(state, text=""):
    """Of a configuration that has this in it."""
    copy = state / COPY
    eventually(lambda: copy.exists() and text in copy.read_text(encoding="utf-8"), what="the copy")
    return copy


def starts_not(bridge, *options):
    """Why, as it says itself."""
    done = subprocess.run([find_program("drivebridged"), "--config", bridge.config_path, *options],
                          capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 78, done
    return done.stderr


# --- noticed ----------------------------------------------------------------------------------------


def test_a_file_that_would_not_start_is_noticed_and_shown_everywhere(bridge):
    assert ctl(bridge, "status").stdout.splitlines()[-1] == "all is well"
    wait_for(bridge, "in_force")
    trouble, well = trouble_of(bridge)
    assert (trouble["cause"], trouble["since_us"], trouble["advice"], well) == ("none", 0, "", True)
    offset = bridge.log_size()
    since = bridge.gateway().read("configuration_since_us")
    bridge.write_config(WRONG)
    wait_for(bridge, "refused")
    told = f"{bridge.config_path}:1: "
    assert bridge.gateway().read("configuration_message").startswith(told)
    assert bridge.gateway().read("configuration_since_us") > since
    done = ctl(bridge, "status")
    assert done.returncode == 1 and "all is well" not in done.stdout
    assert "configuration: refused: the loaded configuration stays in force" in done.stdout and f"\n  {told}" in done.stdout
    shown = json.loads(ctl(bridge, "--json", "status").stdout)
    assert shown["well"] is False and shown["configuration_state"] == "refused"
    assert shown["configuration_messages"][0].startswith(told)
    trouble, well = trouble_of(bridge)
    assert (trouble["cause"], trouble["need"], well) == ("refused", "act", False)
    assert trouble["errors"][0].startswith(told) and "a restart would not load the file" in trouble["advice"]
    assert "drivebridge_configuration_state 1\n" in ctl(bridge, "metrics").stdout
    eventually(lambda: "a restart would fail; the loaded configuration stays in force" in bridge.log_since(offset))
    # Told once: a reload says it in its own words, and nobody else after it.
    assert bridge.log_since(offset).count("the configuration file has an error") == 1
    log = bridge.reload(WRONG)
    assert "has an error and is not loaded" in log
    wait_for(bridge, "refused")
    bridge.reload()
    wait_for(bridge, "in_force")
    assert bridge.gateway().read("configuration_message") == ""
    assert ctl(bridge, "status").stdout.splitlines()[-1] == "all is well"
    assert bridge.log_since(offset).count("the configuration file has an error") == 1


def test_a_wrong_file_that_is_mended_needs_no_reload(bridge):
    good = bridge.config_path.read_text(encoding="utf-8")
    folder = bridge.place / "conf.d"
    folder.mkdir()
    (folder / "more.conf").write_text("\n\n" + WRONG, encoding="utf-8")
    wait_for(bridge, "refused")
    assert bridge.gateway().read("configuration_message").startswith(f"{folder}/more.conf:3: ")
    (folder / "more.conf").write_text("# nothing\n", encoding="utf-8")
    wait_for(bridge, "in_force")
    os.rename(bridge.config_path, bridge.place / "elsewhere")
    wait_for(bridge, "refused")
    assert "there is no such file" in bridge.gateway().read("configuration_message")
    bridge.write_config(good + "# a comment more\n")
    wait_for(bridge, "in_force")


def test_a_file_that_is_right_and_not_loaded_is_a_hint(bridge):
    bridge.sections["drive drive1"]["max-velocity"] = 1000
    bridge.write_config()
    wait_for(bridge, "changed")
    done = ctl(bridge, "status")
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == "no faults, 1 hint"
    assert "configuration: changed: the file is right" in done.stdout
    trouble, well = trouble_of(bridge)
    assert (trouble["cause"], trouble["need"], trouble["errors"], well) == ("changed", "hint", [], True)
    assert ctl(bridge, "reload").returncode == 0
    wait_for(bridge, "in_force")


def test_a_file_that_a_reload_would_refuse_is_no_change(bridge):
    """Cut off on its way to the disk, and nobody has asked for a reload yet."""
    bridge.write_config("modbus { listen = \"127.0.0.1:0\" }\n")
    wait_for(bridge, "refused")
    assert "as if it had been cut off" in bridge.gateway().read("configuration_message")
    bridge.write_config()
    wait_for(bridge, "in_force")


def test_what_only_a_reload_can_refuse_stays_refused(bridge):
    with socket.create_server(("127.0.0.1", 0)) as other:
        bridge.sections["modbus"]["listen"] = f"127.0.0.1:{other.getsockname()[1]}"
        assert "cannot listen" in bridge.reload()
    wait_for(bridge, "refused")
    assert "cannot listen" in bridge.gateway().read("configuration_message")


# --- the last good one ------------------------------------------------------------------------------


def test_a_start_that_finds_a_wrong_file_runs_the_last_good_one(make_bridge, state):
    bridge = make_bridge()
    copy = wait_for_copy(state, "drive drive1")
    assert stat.S_IMODE(copy.stat().st_mode) == 0o640
    assert bridge.stop_bridge() == 0
    bridge.write_config(WRONG)
    offset = bridge.log_size()
    bridge.start_bridge()
    wait_for(bridge, "last_good")
    log = bridge.log_since(offset)
    told = f"{bridge.config_path}:1: "
    assert told in log and "so the LAST GOOD configuration is loaded instead" in log
    assert bridge.gateway().read("configuration_message").startswith(told)
    assert bridge.drive().command("enable") == 0
    assert bridge.drive().command("move_relative", target_position=100, target_velocity=3200) == 0
    eventually(lambda: bridge.drive().read("axis_state") == STANDSTILL)
    done = ctl(bridge, "status")
    assert done.returncode == 1 and "configuration: last_good: THE LAST GOOD CONFIGURATION RUNS" in done.stdout
    trouble, well = trouble_of(bridge)
    assert (trouble["cause"], trouble["need"], well) == ("last_good", "act", False)
    assert trouble["event"]["name"] == "config-last-good"
    assert f"\n  {told}" in done.stdout
    # A check says what is wrong all the same, and so does a reload.
    check = subprocess.run([find_program("drivebridged"), "--config", bridge.config_path, "--check"],
                           capture_output=True, text=True, timeout=20, check=False)
    assert check.returncode == 1 and told in check.stderr
    assert "and is not loaded" in bridge.reload(WRONG)
    wait_for(bridge, "last_good")
    # A right one is in force as soon as it is loaded, and kept from then on.
    bridge.sections["drive drive1"]["max-velocity"] = 2000
    bridge.write_config()
    eventually(lambda: "not loaded yet" in bridge.gateway().read("configuration_message"))
    wait_for(bridge, "last_good")
    bridge.reload()
    wait_for(bridge, "in_force")
    wait_for_copy(state, "max-velocity = 2000")


def test_all_files_are_kept_with_their_names(make_bridge, state):
    bridge = make_bridge()
    folder = bridge.place / "conf.d"
    folder.mkdir()
    drive = bridge.sections.pop("drive drive1")
    (folder / "drives.conf").write_text(
        "# of the plant\ndrive drive1 { bus = line address = 1 unit = 1 watchdog-ms = 0 }\n", encoding="utf-8")
    assert drive["unit"] == 1
    bridge.reload()
    wait_for_copy(state, f"of {folder}/drives.conf\n# of the plant\n")
    assert bridge.stop_bridge() == 0
    # No file at all is a wrong one.
    os.remove(bridge.config_path)
    bridge.start_bridge()
    wait_for(bridge, "last_good")
    bridge.wait_ready()
    assert "there is no such file" in bridge.gateway().read("configuration_message")


def test_a_restart_takes_the_file_when_it_is_right(make_bridge, state):
    bridge = make_bridge()
    copy = wait_for_copy(state)
    before = copy.stat()
    bridge.restart_bridge()
    wait_for(bridge, "in_force")
    # The same again wears out no memory: a look at the state comes after it.
    assert bridge.stop_bridge() == 0
    assert copy.stat().st_mtime_ns == before.st_mtime_ns and copy.stat().st_ino == before.st_ino
    bridge.sections["drive drive1"]["unit"] = 7
    bridge.write_config()
    bridge.wait_online = False
    bridge.start_bridge()
    bridge.wait_ready(7)
    wait_for(bridge, "in_force")
    wait_for_copy(state, "unit = 7")


@pytest.mark.parametrize("damage", ["cut", "changed", "empty", "missing", "of another", "link"])
def test_a_copy_that_is_not_whole_or_not_ours_is_not_used(make_bridge, state, damage):
    bridge = make_bridge()
    copy = wait_for_copy(state)
    assert bridge.stop_bridge() == 0
    text = copy.read_text(encoding="utf-8")
    if damage == "cut":
        copy.write_text(text[:-10], encoding="utf-8")
    elif damage == "changed":
        copy.write_text(text.replace("address = 1", "address = 2"), encoding="utf-8")
    elif damage == "empty":
        copy.write_text("", encoding="utf-8")
    elif damage == "missing":
        copy.unlink()
    elif damage == "link":
        copy.rename(state / "other")
        copy.symlink_to(state / "other")
    else:
        bridge.config_path = bridge.config_path.with_name("other.conf")
    bridge.write_config(WRONG)
    said = starts_not(bridge)
    assert f"{bridge.config_path}:1: " in said and str(copy) in said


def test_it_is_not_used_when_nobody_wants_it_or_it_has_no_place(make_bridge, state, monkeypatch):
    bridge = make_bridge()
    wait_for_copy(state)
    assert bridge.stop_bridge() == 0
    bridge.write_config(WRONG)
    assert COPY not in starts_not(bridge, "--no-last-good")
    monkeypatch.delenv("STATE_DIRECTORY")
    starts_not(bridge)


def test_a_place_that_cannot_be_written_is_told(make_bridge, state):
    (state / (COPY + ".new")).mkdir()
    bridge = make_bridge()
    bridge.told("cannot store the last good configuration: ")
    assert state_of(bridge) == 0


def test_the_unit_has_a_place_for_it():
    unit = (ROOT / "packaging" / "systemd" / "drivebridge.service").read_text(encoding="utf-8")
    assert re.search(r"^StateDirectory=drivebridge$", unit, re.MULTILINE)
    assert re.search(r"^StateDirectoryMode=0750$", unit, re.MULTILINE)
