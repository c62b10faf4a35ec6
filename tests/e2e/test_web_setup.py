# SPDX-License-Identifier: Apache-2.0
"""A drive gets another address or speed over drivebridge-webd, as the page asks for it."""

import pytest
from bridgelib import eventually
from test_scan import ROOMY, heard, said, switch_power
from test_web import gateway, refused  # noqa: F811 (a fixture)
from weblib import OPERATOR, READER


def make_page(gateway, bridge, user=OPERATOR):  # noqa: F811
    return gateway.page(gateway.webd(bridge), user)


def begin(page, **more):
    return page.stream("setup", **({"bus": "line", "what": "address", "from": 2, "to": 9} | more))


def answer(page, stream, yes=True, number=1):
    """The next question; what it says."""
    asked = stream.wait(lambda data: data["question"] == number, event="ask", timeout=60)
    page.ask("POST", "/api/setup", {"question": number, "yes": yes})
    return asked["text"]


def texts(stream, event):
    return [data["text"] for name, data in stream.events if name == event]


@pytest.mark.parametrize("settles", ["power-up", "at-once"])
def test_a_drive_gets_another_address(gateway, make_bridge, settles):  # noqa: F811
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY, sim_drive={"settles": settles})
    page = make_page(gateway, bridge)
    stream = begin(page)
    assert "the drive at address 2 of line gets address 9\n  it says that it is VSMD" in answer(page, stream)
    assert "save_parameters" in answer(page, stream, number=2)
    if settles == "power-up":
        eventually(lambda: heard(bridge, "drive2", "2 sav"))
        switch_power(bridge, "drive2")
    stream.wait_end(60)
    assert texts(stream, "problem") == []
    assert texts(stream, "say")[-1].startswith("done: it answers at address 9")
    assert bridge.sim.get("drive2")["address"] == 9
    # A scan shows what to write into the configuration.
    found = page.stream("Scan", bus="line", first=1, last=9)
    found.wait_end(30)
    configuration = [data["configuration"] for name, data in found.events if name is None][-1]
    assert configuration.startswith("drive line-9 {    # VSMD") and "    address = 9\n" in configuration


def test_nothing_is_set_unless_somebody_says_so(gateway, make_bridge):  # noqa: F811
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY)
    page = make_page(gateway, bridge)
    other = make_page(gateway, bridge, READER)
    mark = bridge.sim.mark()
    for wrong in ({"from": -1}, {"from": "2"}, {"to": None}, {"what": "name"}, {"speed": 1.5}):
        assert refused(400, begin, page, **wrong).error == "BadRequest"
    assert refused(400, begin, page, to=2).error == "BadValue"
    assert refused(404, begin, page, bus="none").error == "NoSuchBus"
    assert refused(403, begin, other).error == "NotAllowed"
    assert refused(409, page.ask, "POST", "/api/setup", {"question": 1, "yes": True}).error == "BadAnswer"

    stream = begin(page)
    stream.wait(event="ask")
    assert refused(503, begin, page).error == "Busy"
    assert refused(409, page.ask, "POST", "/api/setup", {"question": 7, "yes": True}).error == "BadAnswer"
    answer(page, stream, yes=False)
    stream.wait_end()
    assert texts(stream, "problem") == ["nothing was changed"]

    stream = begin(page)
    stream.wait(event="ask")
    page.ask("POST", "/api/setup", {"end": True})
    stream.wait_end()
    assert texts(stream, "problem") == ["it was ended"]

    stream = begin(page, to=1)
    stream.wait_end(30)
    assert "address 1 of line is taken" in texts(stream, "problem")[0]

    # A page that is gone ends it, and another one can begin.
    stream = begin(page)
    stream.wait(event="ask")
    stream.close()
    stream = eventually(lambda: try_begin(page), what="the first one to end")
    stream.wait(event="ask")
    stream.close()
    assert not [word for _, word in said(bridge, mark) if word.startswith(("cfg ", "sav"))]


def try_begin(page):
    """None while it is busy, or while this address opens connections faster than the page takes them."""
    try:
        return begin(page)
    except ConnectionError:
        return None
    except Exception as error:  # noqa: BLE001
        assert getattr(error, "error", None) == "Busy", error
        return None


@pytest.mark.parametrize("how", ["no", "end", "stop"])
def test_who_ends_it_halfway_is_told_where_the_drive_may_be(gateway, make_bridge, how):  # noqa: F811
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY)
    page = make_page(gateway, bridge)
    stream = begin(page)
    answer(page, stream)
    stream.wait(lambda data: data["question"] == 2, event="ask", timeout=30)
    if how == "no":
        answer(page, stream, yes=False, number=2)
    elif how == "end":
        page.ask("POST", "/api/setup", {"end": True})
    else:
        page.run("drive1", "stop")
        answer(page, stream, number=2)
    stream.wait_end()
    assert "the drive may be found at address 2 or 9 of line; a scan of line shows where" in texts(stream, "problem")[-1]
    assert not heard(bridge, "drive2", "2 sav")


def test_a_drive_gets_another_speed(gateway, make_bridge):  # noqa: F811
    bridge = make_bridge(drives=1, bus=ROOMY, sim_bus={"follow-host": True}, sim_drive={"settles": "power-up"})
    page = make_page(gateway, bridge)
    stream = begin(page, what="speed", to=57600, **{"from": 1})
    assert "is taken out of service" in answer(page, stream)
    answer(page, stream, number=2)
    stream.wait(lambda data: data["question"] == 3, event="ask", timeout=30)
    switch_power(bridge, "drive1")
    answer(page, stream, number=3)
    stream.wait_end(60)
    assert texts(stream, "problem") == []
    last = [data for name, data in stream.events if name == "say"][-1]
    assert last["configuration"] == "bus line {\n    baud = 57600\n    ...\n"


def test_the_service_ends_in_between(gateway, make_bridge):  # noqa: F811
    bridge = make_bridge(drives=1, sim_drives=2, bus=ROOMY)
    page = make_page(gateway, bridge)
    stream = begin(page)
    stream.wait(event="ask")
    assert bridge.stop_bridge() == 0
    eventually(lambda: not page.load()["service"])
    if not stream.ended:
        answer(page, stream)
        stream.wait_end()
        assert texts(stream, "problem")
    assert bridge.sim.get("drive2")["address"] == 2
