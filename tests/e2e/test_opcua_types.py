# SPDX-License-Identifier: Apache-2.0
"""The types of drivebridge-opcua, as a client of OPC UA (asyncua) finds them: namespaces, the types of drives, values and
events, the node set that is shipped, and what the server says of itself."""

import datetime
import xml.etree.ElementTree

import pytest
from asyncua import Server, ua
from bridgelib import DOCS, MAP
from opcualib import (  # noqa: F401
    DEVICES,
    NAMESPACE,
    OPERATOR,
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
    type_at,
    until,
)
from test_opcua import FAMILIES

NODESET = DOCS / "drivebridge.NodeSet2.xml"
SCHEMA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
TITLES = {"vsmd-serial": "VsmdSerialDriveType", "vsmd-can": "VsmdCanDriveType", "xyza": "XyzaDriveType",
          "servo-can": "ServoCanDriveType"}


def node_set():
    """Its nodes by their ids."""
    return {one.get("NodeId").removeprefix("ns=1;s="): one
            for one in xml.etree.ElementTree.parse(NODESET).getroot() if one.get("NodeId")}


def as_in_file(session, node):
    """A node's id as the file has it: it counts namespaces in an order of its own."""
    number = {session.types: "ns=1;", session.devices: "ns=2;", 0: ""}[node.NamespaceIndex]
    return number + ua.NodeId(node.Identifier, 0).to_string()


async def references_of(session, nodes):
    """Of each node all, in both directions."""
    request = ua.BrowseParameters()
    for node in nodes:
        one = ua.BrowseDescription()
        one.NodeId, one.BrowseDirection = node.nodeid, ua.BrowseDirection.Both
        one.ReferenceTypeId, one.IncludeSubtypes = ua.NodeId(ua.ObjectIds.References), True
        one.ResultMask = ua.BrowseResultMask.All
        request.NodesToBrowse.append(one)
    return await session.uaclient.browse(request)


# --- namespaces


@in_loop
async def test_two_gateways_share_types_and_no_drive(bridge, make_server, tmp_path):
    """Both have a drive1: its ids differ by the namespace, so that one who collects from both does not mix them. Types are
    the same nodes. Each namespace says what it is."""
    one = make_server(bridge)
    other = make_server(bridge, server={"gateway": "other"}, security={"pki": tmp_path / "other"})
    assert NAMESPACE == "urn:gw:drivebridge:drives"
    seen = {}
    for server, uri in ((one, NAMESPACE), (other, "urn:other:drivebridge:drives")):
        session = await connect(server.client(), uri)
        try:
            await until(at(session, "/Drives").get_children, timeout=40, what="drives")
            spaces = await session.get_namespace_array()
            seen[uri] = {(spaces[node.nodeid.NamespaceIndex], node.nodeid.Identifier)
                         for node in await at(session, "/Drives").get_children()}
            drive = await at(session, "drive1").read_type_definition()
            assert (spaces[drive.NamespaceIndex], drive.Identifier) == (TYPES, "VsmdSerialDriveType")
            said = {}
            for node in await session.get_node(ua.ObjectIds.Server_Namespaces).get_children():
                said[(await node.read_browse_name()).Name] = {
                    (await each.read_browse_name()).Name: await each.read_value() for each in await node.get_properties()}
            assert {TYPES, uri, DEVICES} <= set(said)
            for name, static, year in ((TYPES, [ua.IdType.String], 2026), (uri, [], 2026), (DEVICES, [ua.IdType.Numeric], 2022)):
                assert said[name]["NamespaceUri"] == name
                assert said[name]["NamespaceVersion"] and said[name]["IsNamespaceSubset"] is (name == DEVICES)
                assert said[name]["NamespacePublicationDate"].year >= year
                assert (said[name]["StaticNodeIdTypes"] or []) == static
        finally:
            await session.disconnect()
    assert not seen[NAMESPACE] & seen["urn:other:drivebridge:drives"]


# --- the types


@in_loop
async def test_the_node_set_is_what_the_server_shows(bridge, make_server):
    """Each node of the file is in the server, with its name, class, text, type, access and what is above it, and the server
    has no other in that namespace."""
    server = make_server(bridge)
    nodes = node_set()
    assert len(nodes) > 500
    kinds = {"UAObjectType": ua.NodeClass.ObjectType, "UADataType": ua.NodeClass.DataType, "UAObject": ua.NodeClass.Object,
             "UAVariable": ua.NodeClass.Variable, "UAMethod": ua.NodeClass.Method}
    async with server.session() as session:
        shown = [(name, one, type_at(session, name)) for name, one in nodes.items()]

        async def read(attribute, chosen):
            found = []
            for first in range(0, len(chosen), 200):
                found += await session.read_attributes([node for _, _, node in chosen[first:first + 200]], attribute)
            return [value.Value.Value for value in found]

        for (name, one, _), kind in zip(shown, await read(ua.AttributeIds.NodeClass, shown)):
            assert ua.NodeClass(kind) == kinds[one.tag.removeprefix(SCHEMA)], name
        for (name, one, _), got in zip(shown, await read(ua.AttributeIds.BrowseName, shown)):
            own, _, text = one.get("BrowseName").rpartition(":")
            assert (got.Name, got.NamespaceIndex) == (text, {"": 0, "1": session.types, "2": session.devices}[own]), name
        for (name, one, _), text in zip(shown, await read(ua.AttributeIds.Description, shown)):
            assert text.Text == one.find(f"{SCHEMA}Description").text, name
        variables = [each for each in shown if each[1].tag == f"{SCHEMA}UAVariable"]
        for attribute, key, usual in ((ua.AttributeIds.ValueRank, "ValueRank", "-1"), (ua.AttributeIds.AccessLevel, "AccessLevel", "1")):
            for (name, one, _), got in zip(variables, await read(attribute, variables)):
                assert got == int(one.get(key, usual)), name
        for (name, one, _), got in zip(variables, await read(ua.AttributeIds.DataType, variables)):
            assert as_in_file(session, got) == one.get("DataType"), name

        # References of each node, and nothing of this namespace that is not in the file.
        found = set()
        for first in range(0, len(shown), 50):
            part = shown[first:first + 50]
            for (name, one, _), result in zip(part, await references_of(session, [node for _, _, node in part])):
                wanted = {(each.get("ReferenceType"), each.text) for each in one.iter(f"{SCHEMA}Reference")}
                got = {(ua.ObjectIdNames[each.ReferenceTypeId.Identifier],
                        as_in_file(session, each.NodeId)) for each in result.References}
                forward = {(each.ReferenceTypeId.Identifier, each.NodeId.Identifier) for each in result.References
                           if each.IsForward and each.NodeId.NamespaceIndex == session.types}
                found |= {target for _, target in forward}
                assert wanted <= got, name
        assert found <= set(nodes)
        events = await session.get_node(ua.ObjectIds.BaseEventType).get_children(refs=ua.ObjectIds.HasSubtype)
        assert type_at(session, "DriveEventType") in events


@pytest.mark.parametrize("family", FAMILIES)
@in_loop
async def test_a_drive_is_an_instance_of_its_family(make_bridge, make_server, family):
    """It has all that its type always has, under the same names, and what it has of the type is of the type's data type."""
    bridge = make_bridge(**FAMILIES[family])
    server = make_server(bridge)
    nodes = node_set()
    async with server.session() as session:
        drive = await browse(session, at(session, "drive1"), "drive1")
        assert (await drive.node.read_type_definition()) == type_at(session, TITLES[family]).nodeid
        lineage = [TITLES[family]]
        while True:
            above = next(one.text for one in nodes[lineage[-1]].iter(f"{SCHEMA}Reference")
                         if one.get("ReferenceType") == "HasSubtype")
            if not above.startswith("ns=1"):
                break
            lineage.append(above.removeprefix("ns=1;s="))
        assert lineage[-1] == "DriveType"
        members = {}
        for title in lineage:
            for name, one in nodes.items():
                if name.startswith(f"{title}."):
                    members.setdefault(name.removeprefix(f"{title}."), one)
        found = {path.replace("/", "."): entry for path, entry in drive.walk() if path}
        always = {path for path, one in members.items() if "." not in path and any(
            each.text == "i=78" for each in one.iter(f"{SCHEMA}Reference"))}
        assert {"AxisState", "PositionActualValue", "Stop", "Identification"} <= always <= set(found)
        # No member is the instance's alone but what the service tells in properties.
        more = {path for path in found if path not in members}
        assert {path.rpartition(".")[2] for path in more} <= {"EngineeringUnits", "EURange", "InputArguments"}, more
        both = [(path, found[path]) for path in members if path in found]
        assert len(both) > 90
        for (path, _), name in zip(both, await read_all(session, [entry for _, entry in both], ua.AttributeIds.BrowseName)):
            space = {"1": session.types, "2": session.devices}.get(members[path].get("BrowseName").rpartition(":")[0], 0)
            assert name.Value.Value.NamespaceIndex == space, path
        variables = [(path, entry) for path, entry in both if entry.kind == ua.NodeClass.Variable]
        for (path, _), kind in zip(variables, await read_all(session, [entry for _, entry in variables], ua.AttributeIds.DataType)):
            assert as_in_file(session, kind.Value.Value) == members[path].get("DataType"), path


# Numbers and names of OPC UA for Devices (OPC 10000-100) that a tool finds a drive by.
NAMEPLATE = ("Manufacturer ManufacturerUri Model HardwareRevision SoftwareRevision DeviceRevision ProductCode DeviceManual"
             " DeviceClass SerialNumber ProductInstanceUri RevisionCounter AssetId ComponentName").split()
LOCALIZED = {"Manufacturer", "Model", "ComponentName"}


@in_loop
async def test_a_drive_is_a_component_of_the_devices_model(make_bridge, make_server):
    """Clients that know OPC UA for Devices find each drive in DeviceSet, and who it is in Identification: only what it tells."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    async with server.session() as session:
        def devices(number):
            return session.get_node(ua.NodeId(number, session.devices))

        for kind, above, members in ((15063, devices(1001), dict(zip(range(15086, 15100), NAMEPLATE))),
                                     (15035, session.get_node(17602), dict(zip(range(15036, 15048), NAMEPLATE))),
                                     (15048, session.get_node(17602), dict(zip(range(15049, 15051), NAMEPLATE[12:]))),
                                     (1001, session.get_node(58), {6014: "Identification"}),
                                     (1005, session.get_node(61), {})):
            assert await devices(kind).get_parent() == above
            found = {one.NodeId: one for one in await devices(kind).get_references(
                ua.ObjectIds.Aggregates, ua.BrowseDirection.Forward)}
            assert {node.Identifier: one.BrowseName.Name for node, one in found.items()} == members
            assert {one.BrowseName.NamespaceIndex for one in found.values()} <= {session.devices}
            for node, one in found.items():
                rules = await session.get_node(node).get_referenced_nodes(ua.ObjectIds.HasModellingRule)
                assert [each.nodeid.Identifier for each in rules] == [80]
                if one.BrowseName.Name in NAMEPLATE:
                    data = (await session.get_node(node).read_data_type()).Identifier
                    assert data == (21 if one.BrowseName.Name in LOCALIZED else 6 if "Counter" in one.BrowseName.Name else 12)
        assert [one.nodeid for one in await session.nodes.objects.get_children() if one == devices(5001)]
        assert [one.nodeid for one in await devices(5001).get_children()] == [at(session, name).nodeid for name in ("drive1", "drive2")]
        # What a VSMD drive tells is read by the names of the standard; nothing that it does not tell is there.
        group = await at(session, "drive1").get_child(f"{session.devices}:Identification")
        assert (await group.read_type_definition()) == devices(1005).nodeid
        assert {one.Identifier for one in [each.nodeid for each in await group.get_referenced_nodes(
            ua.ObjectIds.HasInterface)]} == {15035, 15048}
        told = {(await one.read_browse_name()).Name for one in await group.get_children()}
        assert told == {"ComponentName", "Location", "Model", "SoftwareRevision"}

        async def read(name):
            return (await (await group.get_child(f"{session.devices}:{name}")).read_data_value(raise_on_bad_status=False)).Value.Value

        assert (await read("ComponentName")).Text == "drive1"
        model = await until(lambda: read("Model"), what="the drive to say its model")
        assert (model.Text, await read("SoftwareRevision")) == ("VSMD113_025T", "1.0.008.170428")


@in_loop
async def test_values_and_bits_have_names(bridge, make_server):
    """A client that knows enumerations and sets of options shows Standstill, not 2: the data type has the names, and the value
    is in the form that such types have."""
    server = make_server(bridge)
    async with server.session() as session:
        for variable, register, base in (("AxisState", "axis_state", ua.ObjectIds.Enumeration),
                                         ("Result", "result", ua.ObjectIds.Enumeration),
                                         ("ErrorCode", "error", ua.ObjectIds.Enumeration),
                                         ("CommandBlock.Command", "command", ua.ObjectIds.Enumeration),
                                         ("StatusWord", "status", ua.ObjectIds.UInt32),
                                         ("Capabilities", "capabilities", ua.ObjectIds.UInt32)):
            node = at(session, f"drive1.{variable}")
            kind = session.get_node(await node.read_data_type())
            assert [one.nodeid.Identifier for one in await kind.get_referenced_nodes(
                ua.ObjectIds.HasSubtype, ua.BrowseDirection.Inverse)] == [base]
            value = await node.read_data_value()
            if base == ua.ObjectIds.Enumeration:
                assert value.Value.VariantType == ua.VariantType.Int32
                said = await (await kind.get_child("0:EnumValues")).read_value()
                names = {one.DisplayName.Text: one.Value for one in said}
            else:
                assert value.Value.VariantType == ua.VariantType.UInt32
                said = await (await kind.get_child("0:OptionSetValues")).read_value()
                names = {one.Text: bit for bit, one in enumerate(said) if one.Text}
            assert names == MAP.find(register).codes and len(names) > 6
        history = await at(session, "drive1.History.Command").read_data_value()
        assert history.Value.VariantType == ua.VariantType.Int32 and history.Value.is_array


def made_type(number, name, above):
    return (f'<UAObjectType NodeId="ns=1;i={number}" BrowseName="1:{name}"><DisplayName>{name}</DisplayName><References>'
            f'<Reference ReferenceType="i=45" IsForward="false">{above}</Reference></References></UAObjectType>')


DEVICES_MODEL = (
    '<?xml version="1.0" encoding="utf-8"?><UANodeSet xmlns="http://opcfoundation.org/UA/2011/03/UANodeSet.xsd">'
    f"<NamespaceUris><Uri>{DEVICES}</Uri></NamespaceUris><Models><Model ModelUri=\"{DEVICES}\" Version=\"1.04.0\" "
    'PublicationDate="2022-11-03T00:00:00Z"/></Models>'
    + made_type(1001, "TopologyElementType", "i=58") + made_type(15063, "ComponentType", "ns=1;i=1001")
    + made_type(1005, "FunctionalGroupType", "i=61") + made_type(15035, "IVendorNameplateType", "i=17602")
    + made_type(15048, "ITagNameplateType", "i=17602") + "</UANodeSet>")


@in_loop
async def test_the_node_set_loads_without_a_server(tmp_path):
    """Another program takes it in, and makes a drive of it with all that it may have."""
    server = Server()
    await server.init()
    # In the place of the model that tools have: its types that ours are below.
    (tmp_path / "di.xml").write_text(DEVICES_MODEL, encoding="utf-8")
    await server.import_xml(tmp_path / "di.xml")
    await server.import_xml(NODESET)
    space = await server.get_namespace_index(TYPES)
    made = await server.nodes.objects.add_object(space, "feeder", ua.NodeId("ServoCanDriveType", space), instantiate_optional=True)
    names = {(await one.read_browse_name()).Name for one in await made.get_children()}
    assert {"AxisState", "MoveAbsolute", "CommandBlock", "Identification", "ConverterTemperature"} <= names
    assert (await server.get_node(ua.NodeId("DriveType", space)).get_parent()).nodeid.Identifier == 15063
    words = await server.get_node(ua.NodeId("AxisStateEnum.EnumValues", space)).read_value()
    assert {one.DisplayName.Text: one.Value for one in words} == MAP.find("axis_state").codes
    arguments = await server.get_node(ua.NodeId("DriveType.MoveAbsolute.InputArguments", space)).read_value()
    assert [one.Name for one in arguments] == ["TargetPosition", "TargetVelocity"]


@in_loop
async def test_methods_of_types_do_nothing(make_bridge, make_server, certificate):
    """A drive's methods are called by their own ids; those of its type and of others are refused."""
    bridge = make_bridge(**FAMILIES["xyza"])
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as session:
        obeyed = bridge.sim.trace_path.read_text(encoding="utf-8").count(" ! obeyed ")
        for place, method in (("drive1", "DriveType.Enable"), ("drive1", "XyzaDriveType.JogPositive"),
                              ("drive1", "VsmdDriveType.Home"), ("/Gateway", "DriveType.Enable")):
            request = ua.CallMethodRequest(at(session, place).nodeid, type_at(session, method).nodeid, [])
            status = (await session.uaclient.call([request]))[0].StatusCode.name
            assert status in ("BadMethodInvalid", "BadNotExecutable"), (place, method, status)
        assert bridge.sim.trace_path.read_text(encoding="utf-8").count(" ! obeyed ") == obeyed


UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"


@in_loop
async def test_units_are_whose_they_are(make_bridge, make_server):
    """A unit has UNECE's code and namespace when it is one of UNECE's, else ours and no code."""
    bridge = make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "inch"})
    server = make_server(bridge)
    async with server.session() as session:
        for node, shown, space, code in (("PositionActualValue", "counts", "urn:drivebridge:units", -1),
                                         ("Acceleration", "pulses/s^2", "urn:drivebridge:units", -1),
                                         ("PositionActualValueUnits", "inch", UNECE, 0x494E48),
                                         ("AgeMs", "ms", UNECE, 0x433236)):
            unit = await at(session, f"drive1.{node}.EngineeringUnits").read_value()
            assert (unit.DisplayName.Text, unit.NamespaceUri, unit.UnitId) == (shown, space, code)


@in_loop
async def test_limits_of_the_configuration_are_ranges(make_bridge, make_server):
    """Position and velocity have the range that the configuration allows, so that a client may ask for changes by percent."""
    bridge = make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "mm", "min-position": -10, "max-position": 100,
                                "max-velocity": 25})
    server = make_server(bridge)
    async with server.session() as session:
        for name, low, high in (("PositionActualValue", -3200, 32000), ("VelocityActualValue", -8000, 8000)):
            said = await at(session, f"drive1.{name}.EURange").read_value()
            assert (said.Low, said.High) == (low, high), name
        follower = Follower(session)
        subscription = await session.create_subscription(50, follower)
        await subscription.deadband_monitor(at(session, "drive1.PositionActualValue"), 10, deadbandtype=2)
        await until(lambda: follower.of(at(session, "drive1.PositionActualValue")))


# --- events


@in_loop
async def test_types_of_events_are_there_before_the_first_one(make_bridge, make_server, certificate):
    """An alarm for a trip of the watchdog is set up while none has happened, and comes when one does."""
    bridge = make_bridge(drive={"watchdog-ms": 300})
    server = make_server(bridge)
    async with server.session() as session:
        kind = type_at(session, "WatchdogTrippedEventType")
        assert await kind.read_node_class() == ua.NodeClass.ObjectType
        assert (await kind.get_parent()) == type_at(session, "DriveEventType")
        follower = await Follower(session).start(events=(session.nodes.server, kind))
        unit = bridge.drive()
        unit.settle("enable")
        unit.command("move_velocity", target_velocity=3200.0)
        event = await until(lambda: event_of(follower, "WatchdogTripped"))
        assert event.SourceName == "drive1" and event.EventType == kind.nodeid
        assert {one.EventType for one in follower.events} == {kind.nodeid}


@in_loop
async def test_a_reload_tells_that_nodes_changed(make_bridge, make_server):
    """A client that keeps the tree in its memory learns which drives came and went, and which have other members."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    async with server.session() as session:
        await until(lambda: says_drives(session, {"drive1", "drive2"}))
        kind = session.get_node(ua.ObjectIds.GeneralModelChangeEventType)
        follower = await Follower(session).start(events=(session.nodes.server, kind))
        del bridge.sections["drive drive2"]
        bridge.sections["drive drive3"] = {"bus": "line", "address": 2, "unit": 2, "watchdog-ms": 0}
        bridge.reload()
        event = await until(lambda: next(iter(follower.events), None))
        said = {one.Affected.Identifier: (one.AffectedType.Identifier, one.Verb) for one in event.Changes}
        assert said == {"drive2": ("VsmdSerialDriveType", 2), "drive3": ("VsmdSerialDriveType", 1),
                        "/Drives": (ua.ObjectIds.FolderType, 4 | 8)}
        assert all(one.Affected.NamespaceIndex == session.space for one in event.Changes)
        assert event.SourceNode == session.nodes.server.nodeid
        # An event says that the tree is what it says now.
        assert await says_drives(session, {"drive1", "drive3"})

        bridge.sections["drive drive1"] |= {"unit-name": "mm", "counts-per-unit": 320.0}
        bridge.reload()
        event = await until(lambda: next(iter(follower.events[1:]), None))
        said = {one.Affected.Identifier: one.Verb for one in event.Changes}
        assert said == {"drive1": 4 | 8, "/Drives": 4 | 8}
        assert len(follower.events) == 2


async def says_drives(session, wanted):
    return {node.nodeid.Identifier for node in await at(session, "/Drives").get_children()} == wanted


# --- what it says of itself


@in_loop
async def test_what_the_server_says_of_itself(bridge, make_server):
    """When it was built, what it can and its limits: true, and there."""
    server = make_server(bridge, limits={"sessions": 7, "subscriptions": 3, "monitored-items": 900})
    async with server.session() as session:
        built = await session.get_node(ua.ObjectIds.Server_ServerStatus_BuildInfo_BuildDate).read_value()
        assert built.timetz() == datetime.time(tzinfo=built.tzinfo) and built.year >= 2026
        profiles = await session.get_node(ua.ObjectIds.Server_ServerCapabilities_ServerProfileArray).read_value()
        assert [one.rpartition("/")[2] for one in profiles] == ["EmbeddedUA2017", "Methods"]
        for name, value in (("MaxSessions", 7), ("MaxSubscriptionsPerSession", 3), ("MaxSubscriptions", 21),
                            ("MaxMonitoredItems", 900), ("MaxMonitoredItemsPerSubscription", 900),
                            ("MaxArrayLength", 2 ** 20), ("MaxStringLength", 2 ** 20), ("MaxByteStringLength", 2 ** 20)):
            node = session.get_node(getattr(ua.ObjectIds, f"Server_ServerCapabilities_{name}"))
            assert await node.read_value() == value, name


async def is_there(node):
    try:
        return await node.read_browse_name()
    except ua.uaerrors.BadNodeIdUnknown:
        return None


@in_loop
async def test_everything_is_described(bridge, make_server):
    """Each node of ours has a text, also those of buses, folders and properties."""
    server = make_server(bridge)
    async with server.session() as session:
        # The service tells its figures a moment later.
        await until(lambda: is_there(at(session, "/Buses.line.CycleUs")))
        tree = await browse(session, session.nodes.objects)
        ours = [(path, entry) for path, entry in tree.walk() if entry.node.nodeid.NamespaceIndex == session.space
                and not path.startswith("Server/")]
        texts = await read_all(session, [entry for _, entry in ours], ua.AttributeIds.Description)
        assert [path for (path, _), text in zip(ours, texts) if not text.Value.Value.Text] == []
        assert len(ours) > 400
