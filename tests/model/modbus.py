# SPDX-License-Identifier: Apache-2.0
"""A small Modbus TCP client on asyncio: one request at a time, fast, and with a connection that can be
broken at any moment."""

import asyncio
import socket
import struct
from collections import deque


class Lost(Exception):
    """The connection ended before the answer."""


class Silent(Exception):
    """No answer within the time that any answer may take."""


class Link:
    """A connection, from an address of its own. Connects again by itself."""

    def __init__(self, port_of, source):
        self.port_of = port_of  # the bridge has another port each time it starts
        self.source = source
        self.socket = None
        self.transaction = 0
        self.expected = deque()  # transactions that are to be answered
        self.buffer = b""

    async def connect(self):
        loop = asyncio.get_running_loop()
        self.socket = socket.socket()
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.setblocking(False)
        self.buffer = b""
        self.expected.clear()
        try:
            self.socket.bind((self.source, 0))
            await loop.sock_connect(self.socket, ("127.0.0.1", self.port_of()))
        except OSError as error:
            self.close()
            raise Lost from error

    def close(self, reset=False):
        """`reset`: what is still on its way is thrown away on both sides."""
        if not self.socket:
            return
        if reset:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()
        self.socket = None

    async def send(self, unit, *pdus):
        """In one piece; they are answered in this order."""
        if not self.socket:
            await self.connect()
        data = b""
        for pdu in pdus:
            self.transaction = (self.transaction + 1) & 0xFFFF
            self.expected.append(self.transaction)
            data += struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, unit) + pdu
        try:
            await asyncio.get_running_loop().sock_sendall(self.socket, data)
        except OSError as error:
            self.close()
            raise Lost from error

    async def receive(self, patience):
        """The PDU of the answer."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(patience):
                while len(self.buffer) < 7 or len(self.buffer) < 6 + self._length():
                    more = await loop.sock_recv(self.socket, 4096)
                    if not more:
                        raise Lost
                    self.buffer += more
        except TimeoutError as error:
            raise Silent from error
        except OSError as error:
            self.close()
            raise Lost from error
        except Lost:
            self.close()
            raise
        end = 6 + self._length()
        transaction, pdu = int.from_bytes(self.buffer[:2], "big"), self.buffer[7:end]
        self.buffer = self.buffer[end:]
        wanted = self.expected.popleft()
        if transaction != wanted:
            raise AssertionError(f"answer to {transaction} instead of {wanted}")
        return pdu

    def _length(self):
        return int.from_bytes(self.buffer[4:6], "big")

    async def ask(self, unit, pdu, patience):
        await self.send(unit, pdu)
        return await self.receive(patience)


def read(address, count):
    return struct.pack(">BHH", 3, address, count)


def write(address, words):
    """FC 16."""
    return struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words)


def write_single(address, word):
    """FC 6."""
    return struct.pack(">BHH", 6, address, word)


def exception_of(pdu):
    """0 when the request was answered with success."""
    return pdu[1] if pdu[0] & 0x80 else 0


def words_of(pdu):
    return list(struct.unpack(f">{pdu[1] // 2}H", pdu[2:]))
