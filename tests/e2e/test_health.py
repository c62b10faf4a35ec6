# SPDX-License-Identifier: Apache-2.0
"""How the drives were, and the alarms: over kills, for who may only read, without a disk, and switched off."""

import json
import os
import time

import pytest
from bridgelib import eventually
from test_audit import ctl, find, kill, state  # noqa: F401
from test_control import INTERFACE, Line, Tool, as_nobody


def health(bridge, drive="drive1", **options):
    with Tool(bridge) as tool:
        return tool.Health(drive=drive, **options)


def values(bridge, drive="drive1", **options):
    """Those of intervals that have ended, once there are any."""
    return eventually(lambda: health(bridge, drive, **options)["values"], 20, what="an interval that has ended")


def alarms(bridge, **wanted):
    with Tool(bridge) as tool:
        answer = tool.Alarms()
    assert answer["over"]
    return [alarm for alarm in answer["alarms"] if all(alarm[name] == value for name, value in wanted.items())]


def wait_for_alarm(bridge, **wanted):
    return eventually(lambda: alarms(bridge, **wanted), 20, what=f"an alarm with {wanted}")[0]


def test_a_loose_plug_is_seen_over_a_kill(state, make_bridge):  # noqa: F811
    bridge = make_bridge()
    begun = time.time()

    asked = set()

    def lose():
        """Two answers in a second."""
        (value,) = health(bridge)["running"]
        if value["losses"] == 0 and value["span_s"] not in asked:
            asked.add(value["span_s"])
            bridge.sim.fault("drop 2")
        return value["exchanges"] > value["losses"] > 0 and value

    # At once, while the interval goes on ...
    running = eventually(lose)
    assert running["drive"] == "drive1" and running.get("hottest") is None
    # ... and when it has ended, in the file.
    (value, *_) = eventually(lambda: [value for value in health(bridge)["values"] if value["losses"] > 0], 90)
    assert value["exchanges"] > value["losses"]
    assert 0 < value["round_trip_us"] <= value["round_trip_longest_us"] < 10_000_000
    assert begun - 1 < value["end_us"] / 1e6 < time.time() + 1
    answer = health(bridge)
    assert answer["on"] and answer["kept"] and answer["trouble"] == "" and answer["step_s"] == 60

    bridge.sim.fault("silence on")
    alarm = wait_for_alarm(bridge, cause="no_answer", present=True)
    assert (alarm["kind"], alarm["name"], alarm["need"], alarm["times"]) == ("drive", "drive1", "act", 1)
    assert alarm["gone_us"] == 0 and alarm["acknowledged_us"] == 0 and alarm["since_us"] / 1e6 >= begun
    file = state / "health" / "alarms"
    eventually(lambda: file.exists() and b"drive1" in file.read_bytes(), what="the file of the alarms")
    kill(bridge)
    bridge.sim.fault("silence off")
    bridge.start_bridge()
    assert value in values(bridge)
    (kept,) = alarms(bridge)
    now = ("change", "present", "gone_us")
    assert {**kept, **dict.fromkeys(now)} == {**alarm, **dict.fromkeys(now)}
    done = ctl(bridge, "alarms", "acknowledge", str(alarm["id"]))
    assert done.returncode == 0 and "no_answer of drive1" in done.stdout
    seen = alarms(bridge)[0]
    assert seen["acknowledged_us"] / 1e6 > begun and "user root" in seen["acknowledged_by"]
    assert find(bridge, kind="alarm")[0]["drive"] == "drive1"
    gone = wait_for_alarm(bridge, id=alarm["id"], present=False)
    assert gone["gone_us"] / 1e6 > begun and gone["times"] == 1 and len(alarms(bridge)) == 1

    shown = ctl(bridge, "health", "drive1")
    assert shown.returncode == 0 and "LONGEST" in shown.stdout and "restart" not in shown.stdout
    every = json.loads(ctl(bridge, "health", "--json", "--since", "1h").stdout)
    assert [one["drive"] for one in every["values"]] == ["drive1"] and every["values"][0]["losses"] > 0
    listed = ctl(bridge, "alarms").stdout
    assert "no_answer" in listed and "user root" in listed


def test_the_end_of_the_service_writes_what_it_has(state, make_bridge):  # noqa: F811
    bridge = make_bridge()
    eventually(lambda: health(bridge)["running"][0]["span_s"] >= 1)
    bridge.stop_bridge()
    bridge.start_bridge()
    (value, *_) = values(bridge)
    assert 1 <= value["span_s"] <= 6 and value["exchanges"] > 0
    # The chart needs two of them.
    bridge.stop_bridge()
    bridge.start_bridge()
    eventually(lambda: len(health(bridge)["values"]) >= 2)
    assert "longest round trip, ms, at most" in ctl(bridge, "health", "drive1").stdout


def test_changes_of_alarms_come_by_themselves(make_bridge):
    bridge = make_bridge()
    with Line(bridge) as line:
        line.ask(f"{INTERFACE}.Alarms", {}, more=True)
        first = line.answer()["parameters"]
        assert first["alarms"] == [] and first["over"] and not first["kept"]
        bridge.sim.fault("silence on")
        news = line.answer()["parameters"]
        assert [alarm["cause"] for alarm in news["alarms"]] == ["no_answer"]
        with Tool(bridge) as tool:
            again = tool.AcknowledgeAlarm(id=news["alarms"][0]["id"])["alarm"]
            assert again["acknowledged_us"] > 0 and again["change"] > news["change"]
            # Again it changes nothing.
            assert tool.AcknowledgeAlarm(id=again["id"])["alarm"] == again
            with pytest.raises(Exception, match="NoSuchAlarm"):
                tool.AcknowledgeAlarm(id=77)
        assert line.answer()["parameters"]["alarms"] == [again]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_who_may_only_read_sees_and_acknowledges_nothing(make_bridge):
    bridge = make_bridge()
    read, alarms_, acknowledge = as_nobody(
        bridge, {"method": f"{INTERFACE}.Health", "parameters": {}}, {"method": f"{INTERFACE}.Alarms", "parameters": {}},
        {"method": f"{INTERFACE}.AcknowledgeAlarm", "parameters": {"id": 1}})
    assert read["parameters"]["running"][0]["drive"] == "drive1"
    assert alarms_["parameters"]["alarms"] == []
    assert acknowledge["error"].endswith("NotAllowed")


def test_who_leaves_while_values_are_read_leaves_them_to_others(bridge):
    for _ in range(20):
        with Line(bridge) as line:
            line.ask(INTERFACE + ".Health")
    with Line(bridge) as line:
        line.ask(INTERFACE + ".Health")
        assert line.answer()["parameters"]["on"]


def test_wrong_questions(bridge):
    with Line(bridge) as line:
        for method, parameters, error in (
            ("Health", {"step_s": 61}, "InvalidParameter"), ("Health", {"since_us": -1}, "InvalidParameter"),
            ("Health", {"drive": 5}, "InvalidParameter"), ("Health", {"drives": []}, "InvalidParameter"),
            ("Health", {"drive": "nobody"}, "NoSuchDrive"), ("Health", {"drive": "x" * 100}, "NoSuchDrive"),
            ("Alarms", {"after": -1}, "InvalidParameter"), ("AcknowledgeAlarm", {}, "InvalidParameter"),
            ("AcknowledgeAlarm", {"id": 0}, "InvalidParameter"), ("AcknowledgeAlarm", {"id": 1}, "NoSuchAlarm"),
        ):
            line.ask(f"{INTERFACE}.{method}", parameters)
            assert line.answer()["error"].endswith(error), (method, parameters)
    assert ctl(bridge, "health", "nobody").returncode != 0
    assert "30m" in ctl(bridge, "health", "--since", "soon").stderr
    assert "is no alarm" in ctl(bridge, "alarms", "acknowledge", "1", "x").stderr


def test_without_room_it_goes_on_in_memory(state, make_bridge):  # noqa: F811
    (state / "health").write_text("no folder")
    bridge = make_bridge()
    assert values(bridge)[0]["exchanges"] > 0
    answer = eventually(lambda: (now := health(bridge))["trouble"] and now)
    assert not answer["kept"]
    bridge.told("health values or alarms cannot be written")
    with Tool(bridge) as tool:
        assert tool.Describe()["health_trouble"] == answer["trouble"]
    assert "health values and alarms cannot be written" in ctl(bridge, "status").stdout


def test_switched_off_and_on(state, make_bridge):  # noqa: F811
    bridge = make_bridge(control={"health": "off"})
    answer = health(bridge)
    assert not answer["on"] and answer["values"] == answer["running"] == []
    assert "health = off" in ctl(bridge, "health").stdout
    bridge.sections["control"]["health"] = "on"
    bridge.write_config()
    assert ctl(bridge, "reload").returncode == 0
    eventually(lambda: health(bridge)["running"])
    assert values(bridge) and (state / "health" / "values").exists()
