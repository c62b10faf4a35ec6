# SPDX-License-Identifier: Apache-2.0
"""The nodes of drives, which are there only while somebody asks for them, as a client of OPC UA finds them."""

from asyncua import ua
from bridgelib import build_directory, code
from opcualib import (  # noqa: F401
    TYPES,
    Follower,
    at,
    browse,
    connect,
    event_of,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    read_all,
    says,
    until,
)


@in_loop
async def test_each_node_leads_back(bridge, make_server):
    """From each node below Objects of ours the reference back leads to where it was found, and its id and name are what
    they were there; so does its path by names."""
    server = make_server(bridge)
    async with server.session() as session:
        await until(at(session, "/Buses").get_children)
        tree = await browse(session, session.nodes.objects)
        # Below Server is what the server says of the namespace; DeviceSet refers to the drives, too.
        ours = [(path, entry) for path, entry in tree.walk() if entry.node.nodeid.NamespaceIndex == session.space
                and not path.startswith(("Server/", "DeviceSet/"))]
        assert len(ours) > 400 and len({entry.node.nodeid for _, entry in ours}) == len(ours)
        entries = [entry for _, entry in ours]
        for attribute, shown in ((ua.AttributeIds.NodeId, lambda entry: entry.node.nodeid),
                                 (ua.AttributeIds.BrowseName, lambda entry: entry.name),
                                 (ua.AttributeIds.NodeClass, lambda entry: entry.kind)):
            for entry, value in zip(entries, await read_all(session, entries, attribute)):
                value = getattr(value.Value.Value, "Name", value.Value.Value)
                assert value == shown(entry)
        found = {entry.node.nodeid: entry for entry in (*entries, tree)}
        for entry in entries[::7]:
            parent = found[(await entry.node.get_parent()).nodeid]
            assert parent.children[entry.name] is entry
        unit = await session.nodes.objects.get_child([
            f"{session.types}:Drives", f"{session.space}:drive1", f"{session.types}:PositionActualValue",
            "0:EngineeringUnits"])
        assert unit.nodeid.Identifier == "drive1.PositionActualValue.EngineeringUnits"
        for name in ("drive1.", "drive1.Nope", "drive", "drive1.Stop.InputArguments", "/Buses.", "/Gateway.Bus1Up",
                     "drive1." + 300 * "x"):
            with says("BadNodeIdUnknown"):
                await at(session, name).read_browse_name()


@in_loop
async def test_the_fastest_sampling(bridge, make_server):
    """Who asks for the fastest sampling that there is, 0, follows the drive, at the interval of the service's values."""
    server = make_server(bridge)
    unit = bridge.drive()
    unit.settle("enable")
    async with server.session() as session:
        position = at(session, "drive1.PositionActualValue")
        shortest = (await position.read_attribute(ua.AttributeIds.MinimumSamplingInterval)).Value.Value
        assert shortest == 50
        follower = Follower(session)
        subscription = await session.create_subscription(100, follower)
        await subscription.subscribe_data_change([position], queuesize=100, sampling_interval=0)
        unit.command("move_absolute", target_position=2000)
        await until(lambda: follower.of(position) and follower.of(position)[-1].Value.Value == 2000)
        assert len(follower.of(position)) > 2


@in_loop
async def test_descriptions_in_the_language_of_the_session(bridge, make_server, monkeypatch):
    """Each session reads them in the language that it has asked for, and in English otherwise."""
    monkeypatch.setenv("TEXTDOMAINDIR", str(build_directory() / "locale"))
    server = make_server(bridge)
    async with server.session() as session:
        assert (await session.get_node(ua.ObjectIds.Server_ServerCapabilities_LocaleIdArray).read_value()) == ["en", "de", "zh-CN"]
        english = (await at(session, "drive1.ErrorCode").read_description()).Text
    for wanted, locale, begins in ((["fr", "de"], "de", "Warum die Achse"), (["de-AT"], "de", "Warum die Achse"), (["zh-Hans-CN"], "zh-CN", "轴"),
                                   (["fr"], "en", english)):
        client = server.client()
        client.set_locale(wanted)
        try:
            await connect(client)
            text = await at(client, "drive1.ErrorCode").read_description()
            assert text.Locale == locale and text.Text.startswith(begins)
        finally:
            await client.disconnect()
    await names_and_events(bridge, server)


async def names_and_events(bridge, server):
    """Sessions that are there at the same time: names, enumerations, and what one event says to each of them."""
    clients = {wanted: server.client() for wanted in ("de", "zh-CN", "en")}
    followers = {}
    for wanted, client in clients.items():
        client.set_locale([wanted])
        await connect(client)
        followers[wanted] = await Follower(client).start(events=[client.nodes.server])
    try:
        shown = {}
        for wanted, client in clients.items():
            space = await client.get_namespace_index(TYPES)
            values = await client.get_node(ua.NodeId("AxisStateEnum.EnumValues", space)).read_value()
            display = [(await at(client, f"drive1.{name}").read_display_name()).Text for name in ("ClearFault", "AxisState", "AgeMs")]
            assert display == {"de": ["Störung quittieren", "Achszustand", "Alter"], "zh-CN": ["故障复位", "轴状态", "数据时间"],
                               "en": ["ClearFault", "AxisState", "AgeMs"]}[wanted]
            part = ua.ReadValueId(ua.NodeId("AxisStateEnum.EnumValues", space), ua.AttributeIds.Value, "1:2")
            assert [one.Value.Value for one in await client.uaclient.read(ua.ReadParameters(NodesToRead=[part]))] == [values[1:3]]
            shown[wanted] = next((one.DisplayName.Locale, one.DisplayName.Text) for one in values if one.Value == code("axis_state", "Standstill"))
        assert shown == {"de": ("de", "Stillstand"), "zh-CN": ("zh-CN", "静止"), "en": ("en", "Standstill")}
        bridge.sim.control(f"bits drive1 {1 << 21:#x}")
        for wanted, alarm in (("de", "drive1: Störung: Überstrom"), ("zh-CN", "drive1: 故障: 过流"), ("en", "drive1: fault: over_current")):
            told = await until(lambda wanted=wanted: next((one for one in followers[wanted].events if one.EventType == ua.NodeId(
                ua.ObjectIds.DiscreteAlarmType)), None))
            assert (told.Message.Locale, told.Message.Text) == (wanted, alarm)
            followers[wanted].events.clear()
        bridge.sim.control("bits drive1 0")
        await until(lambda: all(any(one.EventType == ua.NodeId(ua.ObjectIds.DiscreteAlarmType) for one in follower.events)
                                for follower in followers.values()))
        for follower in followers.values():
            follower.events.clear()
        bridge.sim.fault("silence on")
        for wanted, event, alarm in (("de", "antwortet nicht mit Adresse 1", "drive1: keine Antwort"), ("zh-CN", "地址 1", "drive1: 无应答"),
                                     ("en", "does not answer at address 1", "drive1: no answer")):
            lost = await until(lambda wanted=wanted: event_of(followers[wanted], "DriveLost"))
            told = await until(lambda wanted=wanted: next((one for one in followers[wanted].events if one.EventType == ua.NodeId(
                ua.ObjectIds.DiscreteAlarmType)), None))
            assert (lost.Message.Locale, told.Message.Locale) == (wanted, wanted)
            assert event in lost.Message.Text and told.Message.Text == alarm
    finally:
        for client in clients.values():
            await client.disconnect()
