# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua and those who would keep others out or the server busy: sessions without a login, passwords,
messages that are too large."""

import asyncio
import contextlib

from asyncua import ua
from bridgelib import CONTINUOUS
from opcualib import (  # noqa: F401
    OPERATOR,
    Recorder,
    at,
    call,
    connect,
    cut,
    fixture_certificate,
    fixture_make_server,
    in_loop,
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
        assert (await call(session, "drive1", "Stop"))[0] == "ok"


@in_loop
async def test_who_does_not_log_in_keeps_nobody_out(make_bridge, make_server, certificate):
    """More connections and sessions without a login than there are places: operators get in, drives are fed, and the
    connections are closed."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 1000})
    server = make_server(bridge, limits={"sessions": 3})
    async with moving_drive(bridge, server, certificate):
        strangers = []
        for _ in range(4 * 3):
            client = server.client()
            await client.connect_socket()
            await client.send_hello()
            await client.open_secure_channel()
            with contextlib.suppress(ConnectionError, ua.UaError):
                for _ in range(3):
                    await client.create_session()
            strangers.append(client)
        for _ in range(3):
            async with server.session(certificate, OPERATOR) as session:
                assert (await call(session, "drive2", "Enable"))[0] == "ok"
        # As many as there are connections stay; then they have been silent for too long.
        await until(lambda: not any(is_open(one) for one in strangers), 30)


def is_open(client):
    protocol = client.uaclient.protocol
    return protocol and protocol.transport and not protocol.transport.is_closing()


@in_loop
async def test_who_makes_room(bridge, make_server, certificate):
    """When all places are taken: sessions that lost their connection, for anybody; readers, for operators; operators for
    nobody."""
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
    for who in ((certificate, OPERATOR), ()):
        with says("BadTooManySessions"):
            await come(*who)
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

    async def guess(port):
        with contextlib.suppress(ua.UaError, ConnectionError, asyncio.TimeoutError):
            await connect(server.client(user=(OPERATOR[0], "guessed"), port=port))

    async with moving_drive(bridge, server, certificate), contextlib.AsyncExitStack() as stack:
        lines = [await stack.enter_async_context(Recorder(server, f"127.0.0.{2 + place}"))
                 for place in range(places)]
        await asyncio.gather(*(guess(line.port) for line in lines for _ in range(4)))
        async with server.session(certificate, OPERATOR):
            pass
    compared, refused = (server.log().count(f"not logged in: {OPERATOR[0]}: {why}")
                         for why in ("BadUserAccessDenied", "BadTcpServerTooBusy"))
    assert compared + refused == places * 4
    # Ten at once, and two a second.
    assert 1 <= compared <= 10 + 2 * 15 < refused, (compared, refused)
