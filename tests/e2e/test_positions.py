# SPDX-License-Identifier: Apache-2.0
"""Named positions: taught where a drive stands, gone to by their name, and never after what they are counted from has
moved. Where the drive is, is read off the simulator."""

import json
import re

import pytest
from bridgelib import HOMED_BIT, eventually
from holdlib import Failed, Hand
from test_audit import ctl, find, kill, state  # noqa: F401

HERE = {"drive": "drive1", "name": "loading place"}


def place(bridge):
    return bridge.sim.get()["position"]


def go(hand, name="loading place", **more):
    return hand.run("move_absolute", position=name, until_end=True, **more)


def flaw(hand, name="loading place"):
    return next(one["flaw"] for one in hand.call("Positions", drive="drive1")["positions"] if one["name"] == name)


def stays(bridge, ask, *arguments, **options):
    """Why the drive is not sent there; it has not moved."""
    before = place(bridge), len(obeyed_motions(bridge))
    with pytest.raises(Failed, match="PositionRefused") as caught:
        ask(*arguments, **options)
    assert (place(bridge), len(obeyed_motions(bridge))) == before
    assert len(caught.value.parameters["text"]) > 20
    return caught.value.parameters["why"]


def obeyed_motions(bridge):
    return [line for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines() if " obeyed " in line and
            (" pos" in line or " mov" in line or " rmv" in line)]


def home(bridge):
    assert bridge.drive().settle("home") == 1
    eventually(lambda: bridge.drive().read("status") & HOMED_BIT, what="the drive to be homed")
    bridge.wait_standing()


def move(bridge, target):
    assert bridge.drive().settle("move_absolute", target_position=target, target_velocity=20000) == 1
    eventually(lambda: place(bridge) == target)
    bridge.wait_standing()


@pytest.fixture
def bridge(state, make_bridge):  # noqa: F811
    # With a switch at 0 for homing.
    made = make_bridge(sim_drive={"start": 300, "sensor": ["3:below:0"], "set":
                                  ["zmd=1", "snr=2", "osv=0", "zsd=-64000", "acc=640000", "dec=640000", "pae=1"]},
                       drive={"counts-per-unit": 640.0, "unit-name": "mm", "max-position": 100000.0})
    made.drive().settle("enable")
    return made


def test_a_drive_goes_where_it_was_taught(bridge, state):  # noqa: F811
    """By calls and by drivebridgectl; it is on record, and on the disk over a kill."""
    move(bridge, 6400)
    with Hand(bridge.control_path) as hand:
        taught = hand.call("Teach", **HERE)["position"]
        assert (taught["counts"], taught["units"], taught["unit"], taught["flaw"]) == (6400, 10.0, "mm", "")
        move(bridge, 0)
        assert go(hand, token=hand.token()) == "ok"
        assert place(bridge) == 6400
        # Limits, tokens and forms are as of any other move.
        with pytest.raises(Failed, match="TooOld"):
            go(hand, token="00000000-1")
        for wrong in ({"arguments": {"target_position": 7}}, {"command": "home"}, {"command": "move_velocity"}):
            with pytest.raises(Failed, match="BadValue"):
                hand.call("Run", **{"drive": "drive1", "command": "move_absolute", "position": HERE["name"], **wrong})
        with pytest.raises(Failed, match="NoSuchPosition"):
            go(hand, "nowhere")
        # A stop is a stop.
        assert hand.run("stop", position="nowhere") in ("ok", "pending")
        # What moves stands nowhere.
        bridge.drive().settle("move_velocity", target_velocity=100)
        eventually(lambda: bridge.sim.get()["velocity"] != 0)
        eventually(lambda: bridge.drive().read("velocity") != 0)
        with pytest.raises(Failed, match="PositionRefused") as moving:
            hand.call("Teach", drive="drive1", name="other")
        assert moving.value.parameters["why"] == "moves"
        bridge.drive().command("stop")
        bridge.wait_standing()
        for name in ("", " a", "a\n", "x" * 33, "a\u202eb"):
            with pytest.raises(Failed, match="BadValue"):
                hand.call("Teach", drive="drive1", name=name)
    done = ctl(bridge, "position", "drive1", "go", "loading place")
    assert done.returncode == 0 and place(bridge) == 6400, done
    assert "loading place is at 10 mm" in ctl(bridge, "position", "drive1", "teach", "loading place").stdout
    listed = ctl(bridge, "position", "drive1").stdout
    assert re.search(r"^loading place +10 mm +6400 +good ", listed, re.M), listed
    assert ctl(bridge, "position", "drive1", "teach").returncode == 2
    assert ctl(bridge, "names", "positions", "drive1").stdout == "loading place\n"
    assert [record["what"] for record in find(bridge, kind="position")][:1] == ["taught"]

    # Within a second it is on the disk, as a whole; a kill loses nothing.
    eventually(lambda: (state / "positions.json").exists(), 1.0)
    kept = json.loads((state / "positions.json").read_text(encoding="utf-8"))
    assert [(one["drive"], one["counts"]) for one in kept["positions"]] == [("drive1", 6400)]
    kill(bridge)
    bridge.start_bridge()
    eventually(lambda: bridge.drive().online())
    with Hand(bridge.control_path) as hand:
        # It is not known what happened to the drive meanwhile.
        eventually(lambda: flaw(hand) == "other_origin")
        assert stays(bridge, go, hand) == "other_origin"
        assert find(bridge, kind="position", what="not gone to")[0]["drive"] == "drive1"
        # Somebody says that nothing did.
        assert hand.call("Teach", **HERE, keep=True)["position"]["counts"] == 6400
        assert go(hand) == "ok"
        hand.call("Forget", **HERE)
        assert hand.call("Positions", drive="drive1") == {"positions": [], "trouble": ""}
        with pytest.raises(Failed, match="NoSuchPosition"):
            hand.call("Teach", **HERE, keep=True)


def test_a_moved_origin_is_never_driven_to(bridge):
    """Set by hand, lost with the power, and with another scale; homing finds what homing had found."""
    move(bridge, 3200)
    with Hand(bridge.control_path) as hand:
        hand.call("Teach", **HERE)
        # Somebody sets the position.
        assert bridge.drive().command("set_position", target_position=0) == 0
        assert stays(bridge, go, hand) == "other_origin"
        hand.call("Teach", **HERE)
        assert go(hand) == "ok"
        # The motor loses its power, and with it this drive its origin.
        bridge.drive().settle("disable")
        assert eventually(lambda: flaw(hand)) == "origin_lost"
        assert stays(bridge, go, hand) == "origin_lost"
        with pytest.raises(Failed, match="PositionRefused"):
            hand.call("Teach", drive="drive1", name="other")
        bridge.drive().settle("enable")
        assert stays(bridge, go, hand) == "origin_lost"
        # Homed: what was taught before that is elsewhere, what is taught after it is found again.
        home(bridge)
        assert stays(bridge, go, hand) == "other_origin"
        move(bridge, 1600)
        hand.call("Teach", drive="drive1", name="homed")
        bridge.drive().settle("disable")
        bridge.drive().settle("enable")
        assert stays(bridge, go, hand, "homed") == "origin_lost"
        home(bridge)
        assert go(hand, "homed") == "ok" and place(bridge) == 1600
        assert bridge.drive().command("set_position", target_position=0) == 0
        assert stays(bridge, go, hand, "homed") == "other_origin"
        home(bridge)
        assert flaw(hand, "homed") == ""
        # Other counts per unit.
        text = bridge.config_path.read_text(encoding="utf-8")
        bridge.reload(text.replace("counts-per-unit = 640.0", "counts-per-unit = 64.0"))
        assert eventually(lambda: flaw(hand, "homed") == "other_scale" and flaw(hand, "homed"))
        assert stays(bridge, go, hand, "homed") == "other_scale"


def test_a_damaged_file_is_kept_and_a_full_disk_is_told(bridge, state):  # noqa: F811
    with Hand(bridge.control_path) as hand:
        hand.call("Teach", **HERE)
    path = state / "positions.json"
    bridge.stop_bridge()
    whole = path.read_text(encoding="utf-8")
    path.write_text(whole[:-20], encoding="utf-8")
    bridge.start_bridge()
    assert (state / "positions.json.damaged").read_text(encoding="utf-8") == whole[:-20]
    assert "cannot read the named positions" in bridge.log_path.read_text()
    eventually(lambda: bridge.drive().online())
    # Nothing can be written where a folder has the name.
    (state / "positions.json.new").mkdir()
    with Hand(bridge.control_path) as hand:
        assert hand.call("Positions", drive="drive1")["positions"] == []
        hand.call("Teach", **HERE)
        assert "cannot write" in eventually(lambda: hand.call("Positions", drive="drive1")["trouble"])
        assert "cannot write" in ctl(bridge, "position", "drive1").stdout
        (state / "positions.json.new").rmdir()
        hand.call("Teach", drive="drive1", name="other")
        eventually(lambda: hand.call("Positions", drive="drive1")["trouble"] == "")
    assert len(json.loads(path.read_text(encoding="utf-8"))["positions"]) == 2
    # The end of the service writes what came last.
    with Hand(bridge.control_path) as hand:
        hand.call("Forget", **HERE)
        assert bridge.stop_bridge() == 0
    assert [one["name"] for one in json.loads(path.read_text(encoding="utf-8"))["positions"]] == ["other"]
    bridge.start_bridge()
