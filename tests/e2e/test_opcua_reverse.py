# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua connects to clients that wait for it (reverse connect): an operator's session goes over such a connection
as over any other."""

import asyncio
import contextlib
import struct

from opcualib import (  # noqa: F401
    OPERATOR,
    at,
    call,
    connect,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    until,
)


class Waiting:
    """The place where a client waits for servers, and the line by which an ordinary client uses what came."""

    def __init__(self):
        self.came = asyncio.Queue()
        self.greetings = []
        self.tasks = []

    async def __aenter__(self):
        self.outside = await asyncio.start_server(self.greeted, "127.0.0.1", 0)
        self.inside = await asyncio.start_server(self.used, "127.0.0.1", 0)
        self.url = f"opc.tcp://127.0.0.1:{self.outside.sockets[0].getsockname()[1]}"
        self.port = self.inside.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_):
        for task in self.tasks:
            task.cancel()
        self.outside.close()
        self.inside.close()

    async def greeted(self, reader, writer):
        """The server says who it is before anything else."""
        with contextlib.suppress(asyncio.IncompleteReadError):
            kind, size = struct.unpack("<4sI", await reader.readexactly(8))
            body = await reader.readexactly(size - 8)
            (length,) = struct.unpack_from("<i", body)
            self.greetings.append((kind, body[4:4 + length].decode()))
            self.came.put_nowait((reader, writer))

    async def used(self, reader, writer):
        outer_reader, outer_writer = await self.came.get()

        async def carry(source, target):
            with contextlib.suppress(ConnectionError):
                while data := await source.read(65536):
                    target.write(data)
                    await target.drain()
            target.close()

        self.tasks += [asyncio.ensure_future(carry(reader, outer_writer)), asyncio.ensure_future(carry(outer_reader, writer))]


@in_loop
async def test_a_client_that_waits_is_connected_to(bridge, make_server, certificate):
    """The server comes to it, by itself and again after the connection was lost; over it an operator moves a drive, and a client
    that comes the usual way is served, too."""
    async with Waiting() as waiting:
        server = make_server(bridge, server={"reverse-connect": [waiting.url]})
        for number in (1, 2):
            session = await connect(server.client(certificate, OPERATOR, port=waiting.port))
            try:
                await until(at(session, "/Drives").get_children, timeout=40, what="drives")
                assert waiting.greetings[:number] == number * [(b"RHEF", "urn:gw:drivebridge")]
                assert (await call(session, "drive1", "Enable"))[0] in ("ok", "pending")
                assert (await call(session, "drive1", "MoveVelocity", 1600.0))[0] in ("ok", "pending")
                assert (await call(session, "drive1", "Stop"))[0] in ("ok", "pending")
                async with server.session() as other:
                    assert await other.nodes.server_state.read_value() == 0
            finally:
                await session.disconnect()
        await until(lambda: bridge.wait_standing() or True)


@in_loop
async def test_a_client_that_is_not_there(bridge, make_server):
    """Nobody waits where one is configured: others are served, and the log is not filled."""
    server = make_server(bridge, server={"reverse-connect": ["opc.tcp://127.0.0.1:1"]})
    lines = len(server.log().splitlines())
    async with server.session() as session:
        for _ in range(30):
            assert await session.nodes.server_state.read_value() == 0
            await asyncio.sleep(0.1)
    assert len(server.log().splitlines()) < lines + 12, server.log()
