# SPDX-License-Identifier: Apache-2.0
"""Buses and drives of the configuration are changed over the control socket and over drivebridge-webd: checked first,
never over a change of somebody else, with the former texts at hand, and without a way to more rights."""

import json

import pytest
import varlink
from bridgelib import CONTINUOUS, eventually
from test_control import Tool
from test_last_good import ctl
from test_web import gateway, refused  # noqa: F811 (a fixture)
from weblib import OPERATOR, READER

EDITS = {"edit": "on"}
SECOND = "drive drive2 {{\n\tbus = line\n\taddress = 2\n\tunit = 2\n\twatchdog-ms = 0\n{more}}}\n"
ADDED = SECOND.format(more="")


def edited(bridge):
    return bridge.place / "edited" / "edited.conf"


def why(call, *arguments):
    """The reason of an EditFailed."""
    with pytest.raises(varlink.VarlinkError) as caught:
        call(*arguments)
    assert caught.value.error() == "io.drivebridge.Control.EditFailed"
    return caught.value.parameters()["why"]


def drives(tool):
    return [drive["name"] for drive in tool.Describe()["drives"]]


def save(tool, text):
    """Written and loaded; the effects that were foretold."""
    answer = tool.SetConfiguration(text, tool.Configuration()["version"])
    assert answer["good"], answer
    assert tool.Reload()["messages"] == []
    return answer["effects"]


@pytest.fixture
def state(tmp_path, monkeypatch):
    """systemd's StateDirectory."""
    folder = tmp_path / "state"
    folder.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    return folder


@pytest.fixture
def bridge(state, make_bridge):
    return make_bridge(drives=1, sim_drives=2, control=EDITS)


def test_a_drive_is_added_and_taken_out(bridge):
    with Tool(bridge) as tool:
        before = tool.Configuration()
        assert before["may_edit"] and before["text"] == "" and before["formers"] == []
        assert before["path"] == str(edited(bridge)) and "drive drive1 {" in before["running"]
        checked = tool.CheckConfiguration(ADDED)
        assert checked["good"] and checked["messages"] == []
        assert checked["effects"] == [
            {"bus": "line", "drive": "drive2", "text": "it is added", "moves": False}]
        # Nothing is written, and nothing changes by a check.
        assert tool.Configuration() == before and not edited(bridge).exists()
        assert save(tool, ADDED) == checked["effects"]
        assert edited(bridge).read_text(encoding="utf-8") == ADDED
        assert drives(tool) == ["drive1", "drive2"]
        eventually(lambda: bridge.drive(2).online(), what="the drive that was added")
        # Back to the text of before, which is kept, as the new one is then.
        former = tool.Configuration()["formers"][0]
        assert tool.Configuration(former["number"])["text"] == ""
        removed = save(tool, "")
        assert [(effect["drive"], effect["text"]) for effect in removed] == [
            ("drive2", "it is removed: its on-exit is carried out")]
        assert drives(tool) == ["drive1"]
        number = tool.Configuration()["formers"][0]["number"]
        assert tool.Configuration(number)["text"] == ADDED and number > former["number"]


def test_mistakes_have_their_lines_and_nothing_is_written(bridge):
    wrong = ADDED.replace("address = 2", "addres = 2")
    with Tool(bridge) as tool:
        checked = tool.CheckConfiguration(wrong)
        assert not checked["good"] and checked["effects"] == []
        assert any(line.startswith(f"{edited(bridge)}:3: unknown key 'addres'") for line in checked["messages"])
        answer = tool.SetConfiguration(wrong, checked["version"])
        assert not answer["good"] and answer["messages"] == checked["messages"]
        assert not edited(bridge).exists()
        # A drive of the file of root stays that file's.
        taken = tool.CheckConfiguration(ADDED.replace("drive2", "drive1"))
        assert not taken["good"] and "drive1" in taken["messages"][0]
        assert why(tool.CheckConfiguration, "#" * 24577) == "long"


@pytest.mark.parametrize("section", ["modbus", "control", "role press", "modbus-rtu press", "endpoint hall2"])
def test_who_may_is_for_root_to_say(bridge, section):
    with Tool(bridge) as tool:
        checked = tool.CheckConfiguration(f"{section} {{\n}}\n")
        assert not checked["good"]
        assert f"{edited(bridge)}:1: section {section.split()[0]} is reserved" in checked["messages"][0]
        # Not by writing the file past the service either.
        edited(bridge).parent.mkdir()
        edited(bridge).write_text(f"{section} {{\n}}\n", encoding="utf-8")
        assert any("is reserved" in line for line in tool.Reload()["messages"])


@pytest.mark.parametrize("profile", ["../secret", "/etc/passwd", "profiles/../secret", "profiles/x/../../secret", "secret"])
def test_no_other_file_is_read_by_it(bridge, profile):
    (bridge.place / "secret").write_text("password-of-somebody\n", encoding="utf-8")
    with Tool(bridge) as tool:
        checked = tool.CheckConfiguration(SECOND.format(more=f'\tprofile = "{profile}"\n'))
        assert not checked["good"] and "may name only those" in checked["messages"][0]
        assert "password-of-somebody" not in "".join(checked["messages"])


def test_nothing_is_written_over_a_change_of_somebody_else(bridge):
    with Tool(bridge) as tool, Tool(bridge) as other:
        version = tool.Configuration()["version"]
        assert other.SetConfiguration("# other\n", version)["good"]
        assert why(tool.SetConfiguration, ADDED, version) == "changed"
        assert edited(bridge).read_text(encoding="utf-8") == "# other\n"
        # Root's file as well.
        version = tool.Configuration()["version"]
        bridge.write_config()
        assert why(tool.SetConfiguration, ADDED, version) == "changed"


def test_the_last_ten_are_kept(bridge):
    with Tool(bridge) as tool:
        for number in range(12):
            answer = tool.SetConfiguration(f"# {number}\n", tool.Configuration()["version"])
            assert answer["good"]
        formers = tool.Configuration()["formers"]
        assert [tool.Configuration(former["number"])["text"] for former in formers] == [
            f"# {number}\n" for number in range(10, 0, -1)]
        assert why(tool.Configuration, 1) == "gone"
    assert len(list(edited(bridge).parent.iterdir())) == 11


def test_it_is_off_unless_root_turns_it_on(make_bridge):
    bridge = make_bridge(drives=1, sim_drives=2)
    with Tool(bridge) as tool:
        answer = tool.Configuration()
        assert not answer["may_edit"]
        assert tool.CheckConfiguration(ADDED)["good"]
        assert why(tool.SetConfiguration, ADDED, answer["version"]) == "off"
    assert not edited(bridge).parent.exists()


def test_a_drive_that_moves_is_named(bridge):
    with Tool(bridge) as tool:
        save(tool, ADDED)
        second = bridge.drive(2)
        eventually(second.online)
        second.settle("move_velocity", target_velocity=3200.0)
        eventually(lambda: second.read("axis_state") == CONTINUOUS)
        [effect] = tool.CheckConfiguration(SECOND.format(more="\tmax-velocity = 9000\n"))["effects"]
        assert effect["drive"] == "drive2" and effect["moves"] and "it is changed" in effect["text"]


def test_the_change_is_in_the_audit_trail(bridge):
    with Tool(bridge) as tool:
        save(tool, "# first\n# second\n# third\n")
        save(tool, "# first\n# other\n# third\n")

        def texts():
            return [record.get("text") for record in tool.Audit()["records"] if record.get("what") == "changed"]

        assert eventually(lambda: texts() if len(texts()) == 2 else None) == [
            "+# first|+# second|+# third|", "-# second|+# other|"]


def test_it_runs_after_a_restart_and_with_the_last_good_copy(state, bridge):
    with Tool(bridge) as tool:
        save(tool, ADDED)
        copy = state / "last-good-configuration"
        eventually(lambda: copy.exists() and "drive drive2" in copy.read_text(encoding="utf-8"))
    assert bridge.stop_bridge() == 0
    edited(bridge).write_text("nonsense = 1\n", encoding="utf-8")
    bridge.start_bridge()
    with Tool(bridge) as tool:
        assert drives(tool) == ["drive1", "drive2"]
        assert tool.Describe()["configuration_state"] == "last_good"


def test_an_engineer_edits_over_the_page_server(gateway, bridge):  # noqa: F811
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    reader = gateway.page(webd, READER)
    for method in ("Configuration", "CheckConfiguration", "SetConfiguration"):
        assert refused(403, reader.call, method, text=ADDED).error == "NotAllowed"
    answer = page.call("Configuration")
    text = ADDED + "#" * 20000 + "\n"
    assert page.call("CheckConfiguration", text=text)["good"]
    assert page.call("SetConfiguration", text=text, version=answer["version"])["good"]
    stale = refused(409, page.call, "SetConfiguration", text=ADDED, version=answer["version"])
    assert stale.error == "EditFailed"
    assert page.call("Reload")["messages"] == []
    assert edited(bridge).read_text(encoding="utf-8") == text


def test_a_command_line_does_the_same(bridge, tmp_path):
    path = tmp_path / "text"
    path.write_text(ADDED, encoding="utf-8")
    done = ctl(bridge, "config", "check", str(path))
    assert done.returncode == 0 and done.stdout == "drive2: it is added\nall other drives go on\n"
    # Nobody says yes.
    assert ctl(bridge, "config", "set", str(path)).returncode != 0 and not edited(bridge).exists()
    assert ctl(bridge, "config", "back").stderr == "drivebridgectl: there is no former text\n"
    done = ctl(bridge, "config", "set", str(path), "--yes")
    assert done.returncode == 0 and done.stdout.endswith("the configuration is in force\n")
    assert ctl(bridge, "config", "show").stdout == ADDED
    path.write_text("modbus {\n}\n", encoding="utf-8")
    done = ctl(bridge, "config", "set", "--yes", str(path))
    assert done.returncode == 1 and "section modbus is reserved" in done.stderr
    done = ctl(bridge, "config", "back", "--yes")
    assert done.returncode == 0 and "drive2: it is removed" in done.stdout
    assert ctl(bridge, "config", "show").stdout == ""
    assert json.loads(ctl(bridge, "config", "show", "--json").stdout)["may_edit"] is True
