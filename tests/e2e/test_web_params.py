# SPDX-License-Identifier: Apache-2.0
"""Parameters over drivebridge-webd, as the page asks for them: files, and writing them into a drive."""

import re

import pytest
from bridgelib import code, eventually
from test_params import FAMILIES, MANY, ctl, make_plant, stop_and_stand, writes_of
from test_web import gateway, refused  # noqa: F401 (a fixture)
from weblib import OPERATOR, READER


MANY_VALUES = {name: float(value) if "." in value else int(value) for name, value in (one.split("=") for one in MANY)}


@pytest.fixture
def plant(make_bridge):
    return make_plant(make_bridge, "vsmd-serial")


def make_pages(gateway, plant, *users):  # noqa: F811
    webd = gateway.webd(plant)
    return [gateway.page(webd, user) for user in users]


def save(page, drive):
    return page.ask("POST", "/api/parameters/file", {"drive": drive})


def read(page, drive, text, name="a.params"):
    return page.ask("POST", "/api/parameters/read", {"drive": drive, "name": name, "text": text})


def write(page, values, drive="drive2", **more):
    return page.stream("parameters", drive=drive, values=values, **more)


def result_of(stream):
    found = stream.wait(event="result", timeout=60)
    stream.wait_end()
    return found


def states_of(stream):
    return [(data["name"], data["state"]) for name, data in stream.events
            if name == "parameter" and data["state"] != "writing"]


def end_writing(page, drive="drive2"):
    return page.ask("POST", "/api/parameters/end", {"drive": drive})["ends"]


def test_each_role_may_what_it_may(gateway, plant):  # noqa: F811
    nobody, reader, operator = make_pages(gateway, plant, None, READER, OPERATOR)
    text = save(reader, "drive1")["text"]
    assert read(reader, "drive1", text)["values"]
    assert refused(401, save, nobody, "drive1").error == "LoginRequired"
    assert refused(401, read, nobody, "drive1", text).error == "LoginRequired"
    assert refused(403, write, reader, {"spd": 5}).error == "NotAllowed"
    assert refused(403, end_writing, reader).error == "NotAllowed"
    assert refused(404, save, operator, "nope").error == "NoSuchDrive"
    for path, body in (("file", {}), ("file", {"drive": 1}), ("read", {"drive": "drive1"}),
                       ("read", {"drive": "drive1", "name": "x" * 200, "text": ""}), ("end", {})):
        assert refused(400, operator.ask, "POST", f"/api/parameters/{path}", body).error == "BadRequest"
    for values in ({}, [], {"spd": "5"}, None):
        assert refused(400, write, operator, values).error == "BadRequest"
    assert not end_writing(operator)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_file_is_that_of_drivebridgectl(gateway, make_bridge, family):  # noqa: F811
    plant = make_plant(make_bridge, family)
    (page,) = make_pages(gateway, plant, READER)
    saved = save(page, "drive1")
    assert saved["text"] == ctl(plant, "params", "save", "drive1", "-").split("drive1 does not")[0]
    assert saved["missing"] == []
    # A drive of this family reports no ages.
    assert saved["oldest_ms"] >= 0 or family == "servo-can"
    back = read(page, "drive1", saved["text"])
    assert back["name"] == "a.params" and f'identity = "{back["identity"]}"' in saved["text"]
    assert {name: float(value) for name, value in re.findall(r"^\t(\w+) += (\S+) +# ", saved["text"], re.M)} == \
        {name: pytest.approx(value, rel=1e-6) for name, value in back["values"].items()}


def test_mistakes_in_a_file_have_their_lines(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, READER)
    text = save(page, "drive1")["text"]

    def mistakes(changed):
        error = refused(400, read, page, "drive1", changed, "b.params")
        assert error.error == "BadFile"
        return error.text

    assert re.search(r"^b\.params:\d+: spd: \"fast\" is no number", mistakes(re.sub(r"\tspd += \S+", "\tspd = fast", text)))
    assert re.search(r"^b\.params:5: these are parameters of xyza, and drive1 is vsmd-serial",
                     mistakes(text.replace("vsmd-serial", "xyza").split("\nparameters")[0] + "parameters {\n}\nend\n"))
    assert "the last line is not 'end'" in mistakes(text.replace("\nend\n", "\n"))
    assert "b.params" in mistakes("")
    # A shortened name ends within a letter.
    assert "b.params:" in mistakes(text.replace("\tspd ", f"\t{'a' * 39}é "))
    assert refused(413, read, page, "drive1", "#" * 49152).error == "TooLong"
    assert read(page, "drive1", text + "#" * 30000)["values"]


def test_parameters_are_written_in_their_order_and_read_back(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    mark = plant.sim.mark()
    stream = write(page, {"acc": 70000, "s1f": 3, "spd": 1234.5, "none_such": 1})
    done = result_of(stream)
    assert sorted(done["written"]) == ["acc", "s1f", "spd"] and done["failed"] == {} and done["over"] == ""
    assert sorted(writes_of(plant, 2, mark)) == ["acc", "s1f", "spd"]
    assert page.call("Read", drive="drive2", names=["acc", "spd"])["values"] == {"acc": 70000, "spd": 1234.5}
    shown = {data["name"]: data for name, data in stream.events if name == "parameter" and data["state"] == "done"}
    assert shown["spd"]["value"] == 1234.5 and shown["spd"]["text"] == "ok"
    # Each write is in the drive's history, by the name of the user.
    history = ctl(plant, "history", "drive2")
    assert "olga" in history, history


def test_one_that_is_refused_does_not_keep_the_others(gateway, make_bridge):  # noqa: F811
    plant = make_plant(make_bridge, "vsmd-serial", sim_per_drive={2: {"max-current": 1.9}})
    (page,) = make_pages(gateway, plant, OPERATOR)
    stream = write(page, {"cra": 2, "spd": 100})
    done = result_of(stream)
    assert done["written"] == ["spd"] and list(done["failed"]) == ["cra"] and done["over"] == ""
    assert ("spd", "done") in states_of(stream) and ("cra", "failed") in states_of(stream)


@pytest.mark.parametrize("how", ["end", "close", "stop", "unplug", "logout"])
def test_a_writing_ends(gateway, plant, how):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    mark = plant.sim.mark()
    stream = write(page, MANY_VALUES)
    stream.wait(lambda data: data["state"] == "done", event="parameter")
    if how == "end":
        assert end_writing(page)
    elif how == "close":
        stream.close()
    elif how == "stop":
        page.run("drive2", "stop")
    elif how == "unplug":
        plant.sim.fault("silence on", "drive2")
    else:
        page.log_out()
    if how in ("end", "stop", "unplug"):
        done = result_of(stream)
        assert 1 <= len(done["written"]) < len(MANY_VALUES)
        assert sorted([*done["written"], *done["failed"]]) == sorted(MANY_VALUES)
        assert {"end": "it was ended", "stop": "a stop overtook it"}.get(how, "") in done["over"] and done["over"]
        assert ("stopped" in [state for _, state in states_of(stream)])
    else:
        stream.wait_end()
    # Nothing comes after it.
    if how == "unplug":
        plant.sim.fault("silence off", "drive2")
        plant.wait_ready(2)
    eventually(lambda: no_more(plant, mark), what="the writes to end")
    assert len(set(writes_of(plant, 2, mark))) < len(MANY_VALUES)


def no_more(plant, mark):
    """Ten polls pass without another write."""
    before = writes_of(plant, 2, mark)
    polls = plant.sim.mark()
    eventually(lambda: len([line for line in plant.sim.sent(polls, polls=True) if line == "2 sts"]) >= 10,
               what="polls of drive 2")
    return writes_of(plant, 2, mark) == before


def test_two_do_not_write_into_one_drive(gateway, plant):  # noqa: F811
    one, other = make_pages(gateway, plant, OPERATOR, OPERATOR)
    stream = write(one, MANY_VALUES)
    stream.wait(event="parameter")
    assert refused(503, write, other, {"spd": 5}).error == "Busy"
    assert not end_writing(other)
    assert end_writing(one)
    result_of(stream)
    assert result_of(write(other, {"spd": 5}))["written"] == ["spd"]


def test_what_moves_gets_no_other_set(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    mark = plant.sim.mark()
    page.run("drive2", "enable")
    page.run("drive2", "move_velocity", target_velocity=2000.0)
    eventually(lambda: plant.sim.get("drive2")["velocity"] > 0, what="the drive to move")
    stream = write(page, {"spd": 5}, standing=True)
    assert stream.wait(event="error")["text"] == "the drive moves; stop it first"
    assert writes_of(plant, 2, mark) == []


def test_what_is_set_going_meanwhile_gets_no_more(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    plc = plant.drive(2)
    assert plc.settle("enable") == code("result", "ok")
    mark = plant.sim.mark()
    stream = write(page, MANY_VALUES, standing=True)
    stream.wait(lambda data: data["state"] == "done", event="parameter")
    assert plc.command("move_velocity", target_velocity=2000.0) == 0
    moved = plant.sim.mark()
    done = result_of(stream)
    assert len(writes_of(plant, 2, moved)) <= 1  # it was on its way
    assert done["over"] == "drive2 moves; stop it first"
    assert sorted(done["written"]) == sorted(writes_of(plant, 2, mark)) and len(done["written"]) < len(MANY_VALUES)
    assert sorted([*done["written"], *done["failed"]]) == sorted(MANY_VALUES)
    stop_and_stand(plant)
    left = {name: MANY_VALUES[name] for name in done["failed"]}
    assert sorted(result_of(write(page, left, standing=True))["written"]) == sorted(left)


def test_what_another_writes_meanwhile_is_no_longer_written(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    stream = write(page, MANY_VALUES)
    first = stream.wait(lambda data: data["state"] == "done", event="parameter")["name"]
    ctl(plant, "set", "drive2", f"{first}=2")
    done = result_of(stream)
    assert done["failed"] == {first: "something has changed it since: the drive shows 2"}, done
    assert sorted([*done["written"], first]) == sorted(MANY_VALUES) and done["over"] == ""
    assert (first, "failed") in states_of(stream)


def test_while_the_service_is_away(gateway, plant):  # noqa: F811
    (page,) = make_pages(gateway, plant, OPERATOR)
    stream = write(page, MANY_VALUES)
    stream.wait(lambda data: data["state"] == "done", event="parameter")
    assert plant.stop_bridge() == 0
    last = stream.wait_end()
    assert last[0] in ("result", "end", "error")
    eventually(lambda: not page.load()["service"], what="the loss of the service to be seen")
    assert refused(502, save, page, "drive1").error == "ServiceUnreachable"
    plant.start_bridge()
    plant.wait_ready(2)
    eventually(lambda: page.load()["service"], what="drivebridge-webd to find the service")
    assert save(page, "drive2")["text"]
