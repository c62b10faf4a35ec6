# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua and those who would keep others out or the server busy: sessions without a login, passwords,
messages that are too large."""

import asyncio
import collections
import contextlib
import re
import struct

from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_to_binary
from bridgelib import CONTINUOUS
from opcualib import (  # noqa: F401
    OPERATOR,
    Recorder,
    at,
    call,
    channel_of,
    connect,
    cut,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    outcome,
    says,
    until,
)


@contextlib.asynccontextmanager
async def moving_drive(bridge, server, certificate):
    """A session whose drive moves for as long as the session is served."""
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        await until(lambda: unit.read("axis_state") == CONTINUOUS)
        yield session
        assert unit.read("axis_state") == CONTINUOUS and unit.read("watchdog_trips") == 0
        assert (await call(session, "drive1", "Stop"))[0] in ("ok", "pending")


@in_loop
async def test_who_does_not_log_in_keeps_nobody_out(make_bridge, make_server, certificate):
    """More connections and sessions without a login than there are places: operators get in, drives are fed, and the
    connections are closed."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 1000})
    server = make_server(bridge, limits={"sessions": 3})
    async with moving_drive(bridge, server, certificate):
        strangers = []
        for sessions in (300, *[1] * 40):
            client = server.client()
            strangers.append(client)
            await client.connect_socket()
            await client.send_hello()
            await client.open_secure_channel()
            for _ in range(sessions):
                await client.create_session()
        for _ in range(3):
            async with server.session(certificate, OPERATOR) as session:
                assert (await call(session, "drive2", "Enable"))[0] in ("ok", "pending")
        # As many as there are connections stay; then they have been silent for too long.
        await until(lambda: not any(is_open(one) for one in strangers), 30)


def is_open(client):
    protocol = client.uaclient.protocol
    return protocol and protocol.transport and not protocol.transport.is_closing()


@in_loop
async def test_who_makes_room(bridge, make_server, certificate):
    """When all places are taken: sessions that lost their connection, for anybody; readers, for operators; operators for
    nobody, but one more operator has a place for stops, and the older of two such makes room for the next."""
    server = make_server(bridge, limits={"sessions": 3})

    async def come(*who):
        return await connect(server.client(*who))

    for one in [await come() for _ in range(3)]:
        cut(one)
    readers = [await until(lambda: connected(server)) for _ in range(3)]
    with says("BadTooManySessions"):
        await come()
    operators = [await come(certificate, OPERATOR)]
    await readers[0].nodes.server_state.read_value()
    with says("BadSessionIdInvalid", "BadSessionClosed"):
        await readers[2].nodes.server_state.read_value()
    operators += [await come(certificate, OPERATOR) for _ in range(2)]
    with says("BadTooManySessions"):
        await come()
    late = [await come(certificate, OPERATOR) for _ in range(3)]
    with says("BadSessionIdInvalid", "BadSessionClosed"):
        await late[0].nodes.server_state.read_value()
    for one in late[1:]:
        assert await at(one, "drive1.PositionActualValue").read_value() == 0
        for stop in "Stop", "QuickStop", "Disable":
            assert (await outcome(one, "drive1", stop))[1] in ("ok", "pending")
        assert (await outcome(one, "drive1", "Enable"))[:2] == ("BadResourceUnavailable", "busy")
        with says("BadResourceUnavailable"):
            await at(one, "drive1.CommandBlock.TargetPosition").write_value(5, ua.VariantType.Int32)
    for one in late:
        with contextlib.suppress(Exception):
            await one.disconnect()
    for one in operators:
        await one.nodes.server_state.read_value()
        await one.disconnect()
    for one in readers:
        with contextlib.suppress(Exception):
            await one.disconnect()


async def connected(server):
    """None when there is no place; the server may not know yet that another one has gone."""
    try:
        return await connect(server.client())
    except ua.uaerrors.BadTooManySessions:
        return None


@in_loop
async def test_wrong_passwords(make_bridge, make_server, certificate):
    """Who guesses is soon not listened to, from however many addresses: neither a drive that moves nor an operator's login
    waits for that."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge)
    places = 12

    ends = collections.Counter()

    async def guess(line):
        try:
            await connect(server.client(user=(OPERATOR[0], "guessed"), port=line.port))
        except (ua.UaError, ConnectionError, asyncio.TimeoutError) as end:
            ends[type(end).__name__] += 1

    async with moving_drive(bridge, server, certificate), contextlib.AsyncExitStack() as stack:
        lines = [await stack.enter_async_context(Recorder(server, f"127.0.0.{2 + place}"))
                 for place in range(places)]
        begin = asyncio.get_running_loop().time()
        for line in 3 * lines:
            await guess(line)
        # Ten at once, and two a second; all are answered.
        assert 1 <= ends["BadUserAccessDenied"] <= 11 + 2 * (asyncio.get_running_loop().time() - begin)
        assert ends["BadUserAccessDenied"] + ends["BadTcpServerTooBusy"] == 3 * places
        await asyncio.gather(*(guess(line) for line in 3 * lines))
        async with server.session(certificate, OPERATOR):
            pass
    assert ends["BadTcpServerTooBusy"] > places
    # Each address has its ration of lines in a minute, and hides no line of another one.
    counts = collections.Counter(re.findall(r"(127[.0-9]+): not logged in: ", server.log()))
    assert len(counts) == places and max(counts.values()) <= 2 * 10, counts


# --- too much


class Asker:
    """A reader who asks for all that a drive's folder refers to, a hundred times in a request, and asks on without waiting."""

    def __init__(self, client):
        self.protocol = client.uaclient.protocol
        self.protocol.data_received = self.count
        self.answers = 0
        self.bytes = bytearray()
        request = ua.BrowseRequest()
        request.Parameters.NodesToBrowse = [
            ua.BrowseDescription(at(client, "drive1.Parameters").nodeid, ua.BrowseDirection.Both,
                                 ua.NodeId(ua.ObjectIds.References), True, 0, 63)] * 100
        self.protocol._setup_request_header(request.RequestHeader, 60)
        self.body = struct_to_binary(request)

    def count(self, data):
        self.bytes += data
        while len(self.bytes) >= 8 and len(self.bytes) >= int.from_bytes(self.bytes[4:8], "little"):
            self.answers += self.bytes[:4] == b"MSGF"
            del self.bytes[:int.from_bytes(self.bytes[4:8], "little")]

    def ask(self, times):
        first = self.protocol._request_id + 1
        self.protocol.transport.writelines(
            [self.protocol._connection.message_to_binary(self.body, ua.MessageType.SecureMessage, first + i)
             for i in range(times)])


@in_loop
async def test_readers_who_ask_for_more_than_can_be_answered(make_bridge, make_server, certificate):
    """An operator who comes, and his stop, wait for a few of their requests, not for all; a drive that moves is fed. All of
    them would take far longer than its watchdog."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 3000})
    server = make_server(bridge)
    async with moving_drive(bridge, server, certificate), contextlib.AsyncExitStack() as stack:
        askers = [Asker(await stack.enter_async_context(connected_for(server))) for _ in range(8)]
        for asker in askers:
            asker.ask(60)
        await until(lambda: any(asker.answers for asker in askers))
        async with server.session(certificate, OPERATOR) as session:
            assert (await call(session, "drive2", "Stop"))[0] in ("ok", "pending")
        assert sum(asker.answers for asker in askers) < 60 * 8 / 2


@contextlib.asynccontextmanager
async def connected_for(server):
    """A client without a user who goes without a word."""
    client = await connect(server.client())
    yield client
    cut(client)


@in_loop
async def test_requests_that_ask_for_too_much(make_bridge, make_server, certificate):
    """More things in one request than it takes: it says so, does none of them, and the session goes on."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge)
    async with moving_drive(bridge, server, certificate), server.session(certificate, OPERATOR) as session:
        speed = at(session, "drive1.Parameters.spd")
        before = await speed.read_value()
        stop = ua.CallMethodRequest(at(session, "drive1").nodeid, at(session, "drive1.Stop").nodeid, [])
        write = ua.WriteValue(speed.nodeid, ua.AttributeIds.Value, None, ua.DataValue(ua.Variant(1.0, ua.VariantType.Float)))
        many = ua.WriteParameters([write] * 101)
        assert len(await session.read_values([speed] * 5000)) == 5000
        for asked in (session.read_values([speed] * 5001), session.uaclient.write(many), session.uaclient.call([stop] * 101),
                      session.browse_nodes([speed] * 101)):
            with says("BadTooManyOperations"):
                await asked
        assert await speed.read_value() == before


@in_loop
async def test_items_that_ask_for_long_queues(bridge, make_server):
    """Who does not fetch what he follows takes a bounded memory: as many values wait in each item as clients need."""
    server = make_server(bridge)
    async with server.session() as session:
        subscription = await session.create_subscription(3600000, None)
        node = at(session, "drive1.PositionActualValue").nodeid
        items = [ua.MonitoredItemCreateRequest(
            ua.ReadValueId(node, ua.AttributeIds.Value), ua.MonitoringMode.Reporting,
            ua.MonitoringParameters(ClientHandle=size, SamplingInterval=100, QueueSize=size)) for size in (1, 10, 100000)]
        made = await session.uaclient.create_monitored_items(
            ua.CreateMonitoredItemsParameters(subscription.subscription_id, ItemsToCreate=items))
        assert [one.RevisedQueueSize for one in made] == [1, 80, 80]


def framed(kind, channel, number, body):
    """A chunk of a message without security: header, channel and token, number and request."""
    return struct.pack("<4sI8sII", kind, 24 + len(body), channel, number, number) + body


def declaring(count):
    """A request to read, by somebody who has no session, that says how many nodes it has."""
    request = ua.ReadRequest()
    request.Parameters.NodesToRead = []
    return struct_to_binary(request)[:-4] + struct.pack("<I", count)


TOO_LARGE = {
    "a chunk": lambda channel: [framed(b"MSGF", channel, 2, bytes(70000))],
    "a header alone": lambda channel: [struct.pack("<4sI8s", b"MSGF", 0x7FFFFFFF, channel)],
    "a message": lambda channel: [framed(b"MSGC", channel, 2 + i, bytes(60000)) for i in range(20)],
    "its chunks": lambda channel: [framed(b"MSGC", channel, 2 + i, bytes(8)) for i in range(40)],
    "an array": lambda channel: [framed(b"MSGF", channel, 2, declaring(0x7FFFFFFF))],
    "another array": lambda channel: [framed(b"MSGF", channel, 2, declaring(0xFFFF))],
}


@in_loop
async def test_messages_that_are_too_large(make_bridge, make_server, certificate):
    """What is larger than it may be, or says so: that connection ends or is told, no memory is taken for it, and a drive
    that moves goes on."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge)
    async with Recorder(server) as recorder:
        async with Client(f"opc.tcp://127.0.0.1:{recorder.port}"):
            pass
    hello, opening = recorder.messages[:2]
    assert hello.startswith(b"HEL") and opening.startswith(b"OPN")
    async with moving_drive(bridge, server, certificate) as session:
        before = peak_memory(server)
        for what, make in TOO_LARGE.items():
            reader, writer = await asyncio.open_connection(server.host, server.port)
            writer.write(hello)
            await answer(reader)
            writer.write(opening)
            for message in make(channel_of((await answer(reader))[8:])):
                writer.write(message)
            try:
                reply = await answer(reader)
                assert reply[:3] in (b"ERR", b"MSG"), what
                if reply.startswith(b"MSG"):
                    # A fault of the service: its type is the first thing behind the headers.
                    assert reply[24:28] == b"\x01\x00\x8d\x01", what
            except (ConnectionError, asyncio.IncompleteReadError):
                pass
            writer.close()
            assert await session.nodes.server_state.read_value() == 0, what
        assert peak_memory(server) - before < 32 * 1024


async def answer(reader):
    head = await asyncio.wait_for(reader.readexactly(8), 6)
    return head + await reader.readexactly(int.from_bytes(head[4:], "little") - 8)


def peak_memory(server):
    """KiB."""
    with open(f"/proc/{server.process.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM:"))
