# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua, judged by an independent client (asyncua): the tree against the register map, values and their
times, and what comes, goes and is hostile."""

import asyncio
import csv
import datetime
import random
import re
import signal
import subprocess
import time

import pytest
import varlink
from asyncua import Client, ua
from bridgelib import DOCS, MAP, OFFLINE, ROOT, find_program
from opcualib import (  # noqa: F401
    Follower,
    Recorder,
    at,
    browse,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    is_bad,
    read_all,
    say,
    spoil,
    until,
)

CAN = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}

with open(DOCS / "opcua-nodes.csv", newline="", encoding="utf-8") as file:
    NODES = [{**row, "node": row["node"].replace("DRIVE", "drive1")} for row in csv.DictReader(file)]
DIAGNOSIS = ("Cause", "Need", "Detail", "Advice", "SinceUs", "Event", "EventTimeUs")
GATEWAY = [row for row in NODES if row["node"].startswith("/Gateway.")]
NODES = [row for row in NODES if row not in GATEWAY]


def node_of(register):
    return next(row for row in NODES if row["register"] == register)


EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)

# Of first bytes that are wrong: enough to meet each way of spoiling each kind of message often.
SPOILED = 1500


# --- the tree


FAMILIES = {
    "vsmd-serial": {},
    "vsmd-can": {"bus": CAN, "sim_bus": {**CAN, "baud": None}},
    "xyza": {"bus": {"protocol": "xyza"}, "sim_bus": {"protocol": "xyza"},
             "per_drive": {1: {"address": 1, "axis": "x"}}, "sim_drive": {"identity": None, "set": None}},
    "servo-can": {"bus": {**CAN, "protocol": "servo-can", "baud": 3000000},
                  "sim_bus": {**CAN, "protocol": "servo-can", "baud": None},
                  "sim_drive": {"identity": None, "set": None}},
}

# A range that ends only where its type does is not said.
WHOLE = {"u16": (0, 65535), "i16": (-32768, 32767), "u32": (0, 2 ** 32 - 1), "i32": (-2 ** 31, 2 ** 31 - 1),
         "f32": (-3.4e38, 3.4e38)}

# Beside the registers; and those that tell of now, or of who asks.
IDENTIFICATION = "drive1.Identification."
PASSING = {"age_ms", "timestamp_us", "control_port", "control_holder", "control_request"}
# What HistoryRead gives of them.
KEPT = {"Service.RoundTripMeanUs", "Service.RoundTripMaxUs", "ConverterTemperature"}


@pytest.mark.parametrize("family", FAMILIES)
@in_loop
async def test_the_tree_is_the_register_map(make_bridge, make_server, command_table, family):
    """Each register and command of the family is a node, with the documents' name, type, range, unit and access, and
    there are no others; what stands in process data and parameters is what Modbus reads."""
    bridge = make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "mm"}, **FAMILIES[family])
    server = make_server(bridge)
    unit = bridge.drive()
    rows = [row for row in NODES if row["families"] == "all" or family in row["families"].split()]
    async with server.session() as session:
        tree = await browse(session, at(session, "drive1"), "drive1")
        assert tree.kind == ua.NodeClass.Object
        found = {entry.node.nodeid.Identifier: entry for _, entry in tree.walk()}
        variables = [entry for name, entry in found.items() if entry.kind == ua.NodeClass.Variable
                     and entry.type.Identifier != ua.ObjectIds.PropertyType and not name.startswith(IDENTIFICATION)]
        # What is wrong with it is no register: tests/e2e/test_everywhere.py.
        diagnosis = {f"drive1.Diagnosis.{name}" for name in DIAGNOSIS}
        assert diagnosis <= set(found)
        variables = [entry for entry in variables if entry.node.nodeid.Identifier not in diagnosis]
        # Of the command block those that this drive's commands take.
        missing = {row["node"] for row in rows} - set(found)
        assert {entry.node.nodeid.Identifier for entry in variables} == {row["node"] for row in rows} - missing
        assert all(node.startswith("drive1.CommandBlock.") for node in missing)
        rows = [row for row in rows if row["node"] not in missing]

        types = await read_all(session, variables, ua.AttributeIds.DataType)
        ranks = await read_all(session, variables, ua.AttributeIds.ValueRank)
        access = await read_all(session, variables, ua.AttributeIds.AccessLevel)
        texts = await read_all(session, variables, ua.AttributeIds.Description)
        values = await read_all(session, variables)
        shown = {entry.node.nodeid.Identifier: about
                 for entry, *about in zip(variables, types, ranks, access, texts, values)}
        for row in rows:
            kind, rank, level, text, value = (one.Value.Value if place < 4 else one
                                              for place, one in enumerate(shown[row["node"]]))
            assert named(kind) + ("[]" if rank == 1 else "") in row["type"].split(), row
            history = 4 if row["node"].split(".", 1)[1] in KEPT else 0
            assert level == (3 if row["access"] == "rw" else 1) + history, row
            register = MAP.find(row["register"], table=row["table"], family=family)
            await check_properties(found[row["node"]], register, row)
            if row["table"] == "holding" and int(row["address"]) < 1000 and row["register"] not in PASSING:
                assert text.Text, row
                # What this model does not have is no value here, and no register there.
                node = found[row["node"]].node
                if value.StatusCode.is_good():
                    await until(lambda: holds(node, unit.read(row["register"])), what=row)

        # What this drive can of what its family has.
        with varlink.Client(f"unix:{bridge.control_path}").open("io.drivebridge.Control") as control:
            commands = {one["name"]: command_table[one["name"]] for one in control.Commands("drive1")["commands"]}
        methods = {entry.name: entry for entry in found.values() if entry.kind == ua.NodeClass.Method}
        shown_as = {re.sub("(^|_)(.)", lambda part: part[2].upper(), name): row
                    for name, row in commands.items()}
        assert set(methods) == set(shown_as) and {"Stop", "MoveVelocity"} < set(methods)
        for name, row in shown_as.items():
            assert row["families"] == "all" or family in row["families"].split()
            declared = []
            if "InputArguments" in methods[name].children:
                declared = await methods[name].children["InputArguments"].node.read_value()
            arguments = [node_of(argument) for argument in row["arguments"].split()]
            assert [named(one.DataType) for one in declared] == [one["type"] for one in arguments], name
            assert missing.isdisjoint(one["node"] for one in arguments)

        gateway = await browse(session, at(session, "/Gateway"), "Gateway")
        assert {entry.node.nodeid.Identifier for _, entry in gateway.walk()
                if entry.kind == ua.NodeClass.Variable and entry.type.Identifier != ua.ObjectIds.PropertyType
                } == {row["node"] for row in GATEWAY} | {"/Gateway.Clock", "/Gateway.CertificateEnds", "/Gateway.Diagnosis.Well"} | {
                    f"/Gateway.Diagnosis.Configuration{name}" for name in [*DIAGNOSIS, "Errors"] if name != "Detail"}

        identification = found["drive1.Identification"].children
        assert (await identification["ComponentName"].node.read_value()).Text == "drive1"
        await until(lambda: holds(at(session, "/Gateway.DriveCount"), 1))
        await until(lambda: holds(at(session, "/Buses.line.Up"), True))


def named(kind):
    """A data type by its name, the standard's or ours."""
    return kind.Identifier if isinstance(kind.Identifier, str) else ua.ObjectIdNames[kind.Identifier]


async def holds(node, value):
    return (await node.read_data_value(raise_on_bad_status=False)).Value.Value == value


async def check_properties(entry, register, row):
    """Range, unit and names of values as the register has them."""
    properties = {}
    for name, child in entry.children.items():
        properties[name] = await child.node.read_value()
    # The names of values are their type's: tests/e2e/test_opcua_types.py.
    assert not {"EnumValues", "OptionSetValues"} & set(properties), row
    if row["type"].removesuffix("[]") not in ua.ObjectIdNames.values():
        assert "EURange" not in properties, row
    elif register.max is not None and row["table"] == "holding" and "[]" not in row["type"]:
        least, most = WHOLE[register.type]
        if register.max >= most or least < 0 and register.min <= least:
            assert "EURange" not in properties, row
        else:
            assert properties["EURange"].High == pytest.approx(register.max), row
            assert properties["EURange"].Low == pytest.approx(register.min), row
    unit = register.unit.replace("user units", "mm")
    if unit and row["table"] == "holding" and "[]" not in row["type"]:
        assert properties["EngineeringUnits"].DisplayName.Text, row


# --- the guide


@in_loop
async def test_the_guides_picture(bridge, make_server):
    """What the page shows of the tree is there, with these types; so are the nodes of its table."""
    page = (ROOT / "docs" / "guide" / "opcua.md").read_text(encoding="utf-8").replace("feeder", "drive1")
    server = make_server(bridge)
    async with server.session() as session:
        tree = await browse(session, session.nodes.objects)
        path, seen = [], 0
        for line in re.search("^```opcua\n(.*?)^```$", page, re.M | re.S)[1].splitlines():
            depth = (len(line) - len(line.lstrip())) // 2
            name, kind, *_ = [*line.split(), ""]
            path[depth:] = [name]
            entry = tree.find("/".join(path))
            if kind == "Method":
                assert entry.kind == ua.NodeClass.Method, line
            elif kind:
                shown = named(await entry.node.read_data_type())
                assert shown + ("[]" if await entry.node.read_value_rank() == 1 else "") == kind, line
            else:
                assert entry.kind == ua.NodeClass.Object, line
            seen += 1
    assert seen > 20
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \| `s=([\w.]+)`", page, re.M)
    assert len(rows) > 5
    for register, address, node in rows:
        assert (node_of(register)["address"], node_of(register)["node"]) == (address, node)


def test_the_guides_configurations(tmp_path):
    page = (ROOT / "docs" / "guide" / "opcua.md").read_text(encoding="utf-8")
    blocks = re.findall("^```opcuaconf\n(.*?)^```$", page, re.M | re.S)
    for text in [*blocks, (ROOT / "conf" / "opcua.conf").read_text(encoding="utf-8")]:
        path = tmp_path / "opcua.conf"
        path.write_text(text, encoding="utf-8")
        done = subprocess.run([find_program("drivebridge-opcua"), "--config", path, "--check"],
                              capture_output=True, text=True, timeout=30, check=False)
        assert done.returncode == 0, done.stderr


# --- values and their times


def since_epoch(value):
    """The source's time in microseconds, as the register timestamp_us has it."""
    return round((value.SourceTimestamp - EPOCH).total_seconds() * 1e6)


@in_loop
async def test_quality_and_time(bridge, make_server):
    """A value has the time and the quality of the drive's data: good, uncertain or bad while it is lost, and good again;
    what the service itself knows stays good."""
    server = make_server(bridge)
    unit = bridge.drive()
    async with server.session() as session:
        position, parameter = at(session, "drive1.PositionActualValue"), at(session, "drive1.Parameters.spd")
        trips = at(session, "drive1.WatchdogTrips")
        before = unit.read("timestamp_us")
        value = await position.read_data_value()
        assert before - 1000 <= since_epoch(value) <= unit.read("timestamp_us") + 1000

        bridge.sim.fault("silence on")
        lost = await until(lambda: bad_value(position))
        assert is_bad(lost.StatusCode, "BadNoCommunication")
        assert (await trips.read_data_value()).StatusCode.is_good()
        # It does not become younger by being read.
        last = since_epoch(lost)
        assert last >= before
        for _ in range(3):
            assert since_epoch(await bad_value(position)) == last
            await asyncio.sleep(0.05)
        assert not (await parameter.read_data_value(raise_on_bad_status=False)).StatusCode.is_good()

        bridge.sim.fault("silence off")
        value = await until(lambda: good_value(position))
        assert since_epoch(value) > last
        await until(lambda: good_value(parameter))


async def bad_value(node):
    value = await node.read_data_value(raise_on_bad_status=False)
    return value if value.StatusCode.is_bad() else None


async def good_value(node):
    value = await node.read_data_value(raise_on_bad_status=False)
    return value if value.StatusCode.is_good() else None


@in_loop
async def test_a_drive_that_never_spoke(make_bridge, make_server):
    bridge = make_bridge(faults={1: ["silence on"]}, wait_online=False)
    server = make_server(bridge)
    async with server.session() as session:
        value = await at(session, "drive1.PositionActualValue").read_data_value(raise_on_bad_status=False)
        assert is_bad(value.StatusCode, "BadWaitingForInitialData")
        # The oldest moment that there is says that there is none.
        assert value.SourceTimestamp.year == 1601
        assert (await good_value(at(session, "drive1.AxisState"))).Value.Value == OFFLINE


@in_loop
async def test_subscription_while_a_drive_moves(make_bridge, make_server):
    """Every 50 ms, over the places where a word of a 32-bit value overflows: positions rise, the user's units are of the
    same moment as the drive's own, and no value comes twice with the same time."""
    bridge = make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "mm"})
    server = make_server(bridge)
    unit = bridge.drive()
    unit.settle("enable")
    unit.settle("set_position", target_position=65536 - 3000)
    async with server.session() as session:
        position, units = (at(session, f"drive1.PositionActualValue{end}") for end in ("", "Units"))
        moving = at(session, "drive1.Bits.Moving")
        follower = await Follower(session).start([position, units, moving])
        unit.command("move_absolute", target_position=65536 + 3000)
        await until(lambda: follower.of(position) and follower.of(position)[-1].Value.Value == 65536 + 3000)
        await until(lambda: [one.Value.Value for one in follower.of(moving)][-2:] == [True, False])
        positions = [(one.SourceTimestamp, one.Value.Value) for one in follower.of(position)]
        assert len(positions) > 8 and positions == sorted(positions)
        assert len({when for when, _ in positions}) == len(set(positions))
        in_units = {one.SourceTimestamp: one.Value.Value for one in follower.of(units)}
        both = [(value, in_units[when]) for when, value in positions if when in in_units]
        assert len(both) > 8
        for value, wanted in both:
            assert wanted == pytest.approx(value / 320.0)


# --- what comes and goes


@in_loop
async def test_server_and_service_are_killed(make_bridge, make_server):
    """Each comes back by itself; while the service is away its values are bad, and the drives are the same nodes as
    before. A reload brings and takes drives."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    async with server.session() as session:
        await at(session, "drive2.PositionActualValue").read_value()
        server.kill()
    server.start()
    async with server.session() as session:
        position = at(session, "drive1.PositionActualValue")
        follower = await Follower(session).start([position])
        await until(lambda: good_value(position))
        await until(lambda: follower.of(position))
        bridge.process.kill()
        bridge.process.wait()
        assert is_bad((await until(lambda: bad_value(position))).StatusCode, "BadNoCommunication")
        await until(lambda: follower.status(position).is_bad())
        assert is_bad((await bad_value(at(session, "/Buses.line.Up"))).StatusCode, "BadNoCommunication")
        bridge.units = {}
        bridge.start_bridge()
        await until(lambda: good_value(position))
        await until(lambda: follower.status(position).is_good())

        del bridge.sections["drive drive2"]
        bridge.reload()

        async def drives():
            return {node.nodeid.Identifier for node in await at(session, "/Drives").get_children()}

        await until(lambda: is_set(drives(), {"drive1"}))
        await until(lambda: good_value(position))
        bridge.sections["drive drive3"] = {"bus": "line", "address": 2, "unit": 2, "watchdog-ms": 0}
        bridge.reload()
        await until(lambda: is_set(drives(), {"drive1", "drive3"}))
        await until(lambda: good_value(at(session, "drive3.PositionActualValue")))


@in_loop
async def test_a_service_that_hangs(make_bridge, make_server):
    """Its connections stay, and nothing comes: what was told last is not taken for what is now. Whoever reads what all drives are
    waits for it once, not once for each: meanwhile no client is served, and no watchdog fed."""
    bridge = make_bridge(drives=16)
    server = make_server(bridge)
    clock = asyncio.get_running_loop().time
    async with server.session() as session:
        models = [at(session, f"drive{number}.Identification.Model").nodeid for number in range(1, 17)]

        async def are_read_at_once():
            # Each is asked for once a second at most.
            await asyncio.sleep(1.1)
            begun = clock()
            await session.uaclient.read_attributes(models, ua.AttributeIds.Value)
            return clock() - begun < 0.2

        nodes = [at(session, name) for name in ("drive1.PositionActualValue", "drive1.AxisState", "/Buses.line.Up")]
        follower = await Follower(session).start(nodes)
        for node in nodes:
            await until(lambda: good_value(node))
            await until(lambda: follower.of(node))
        bridge.process.send_signal(signal.SIGSTOP)
        try:
            assert await are_read_at_once() or await are_read_at_once() or await are_read_at_once()
            for node in nodes:
                await until(lambda: says_uncertain(node))
                await until(lambda: not follower.status(node).is_good())
        finally:
            bridge.process.send_signal(signal.SIGCONT)
        for node in nodes:
            await until(lambda: good_value(node))
            await until(lambda: follower.status(node).is_good())


async def says_uncertain(node):
    value = await node.read_data_value(raise_on_bad_status=False)
    return is_bad(value.StatusCode, "UncertainLastUsableValue") and value.Value.Value is not None


async def is_set(asked, wanted):
    return await asked == wanted


# --- hostile bytes


@in_loop
async def test_first_bytes_that_are_wrong(bridge, make_server):
    """Thousands of spoiled messages, alone and behind good ones: the server lives, and a session that is there is
    served between any two of them; nothing of what they opened keeps others out, and what is said about them fills no
    journal."""
    server = make_server(bridge)
    begun = time.monotonic()
    async with Recorder(server) as recorder:
        async with Client(f"opc.tcp://127.0.0.1:{recorder.port}") as client:
            await client.nodes.objects.get_children()
    messages = recorder.messages[:6]
    assert [message[:3] for message in messages[:3]] == [b"HEL", b"OPN", b"MSG"]

    chance = random.Random(17)
    gate = asyncio.Semaphore(24)

    async def wrong():
        async with gate:
            good = chance.randrange(len(messages))
            await say(server, messages[:good], spoil(messages[good], chance), 0.01)

    async with server.session() as session:
        attack = asyncio.gather(*(wrong() for _ in range(SPOILED)))
        served = 0
        while not attack.done():
            await asyncio.wait_for(session.nodes.server_state.read_value(), 5)
            served += 1
        await attack
        assert served > 50
    async with server.session() as another:
        assert await another.nodes.server_state.read_value() == 0
    minutes = 1 + (time.monotonic() - begun) // 60
    # About as many of each kind, and what is said once.
    assert len(server.log().splitlines()) < minutes * 3 * 31 + 20
