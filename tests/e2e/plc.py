# SPDX-License-Identifier: Apache-2.0
"""A controller in Python that runs the blocks of docs/drivebridge.st in cycles, with a Modbus block
of its own whose connection a test can break."""

import socket
import struct
import time

from stlib import Library

ANSWER_TIME = 4.0
HEARTBEAT = 66  # its writes are signs of life: no command, and not what a test loses


class ModbusBlock:
    """The controller's own: one request at a time, Done or Error until the request falls."""

    def __init__(self, port):
        self.port = port
        self.socket = None
        self.busy = False
        self.done = self.error = False
        self.exception = 0
        self.buffer = b""
        self.transaction = 0
        self.deadline = 0.0
        self.writes = []  # the registers of every FC 16 that was sent
        self.exceptions = []
        self.tells_codes = True  # not all controllers' blocks say which exception it was
        self.lose = 0     # so many responses to writes: the connection is closed after the request
        self.lose_reads = 0  # likewise

    def close(self):
        if self.socket:
            self.socket.close()
        self.socket = None

    def cycle(self, client, mailbox):
        """One call; `client` is the library's DB_ModbusClient."""
        asked = client.ReadHolding or client.WriteMultiple
        if not asked:
            self.done = self.error = self.busy = False
        elif not self.busy and not self.done and not self.error:
            self.begin(client, mailbox)
        elif self.busy:
            self.look(client, mailbox)

    def fail(self, exception=0):
        self.busy, self.error, self.exception = False, True, exception
        if exception == 0:
            self.close()

    def begin(self, client, mailbox):
        words = mailbox.Data[:client.Count] if client.WriteMultiple else []
        pdu = struct.pack(">BHH", 16 if client.WriteMultiple else 3, client.Address, client.Count)
        if client.WriteMultiple:
            pdu += bytes([2 * len(words)]) + b"".join(word.to_bytes(2, "big") for word in words)
            if client.Address != HEARTBEAT:
                self.writes.append((client.Address, *words))
        self.transaction = (self.transaction + 1) & 0xFFFF
        self.buffer = b""
        self.busy = True
        self.deadline = time.monotonic() + ANSWER_TIME
        try:
            if not self.socket:
                self.socket = socket.create_connection(("127.0.0.1", self.port), 5)
                self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.socket.setblocking(True)
            self.socket.sendall(
                struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, client.UnitId) + pdu)
            self.socket.setblocking(False)
        except OSError:
            self.fail()
            return
        if client.WriteMultiple and client.Address != HEARTBEAT and self.lose:
            self.lose -= 1
            self.fail()
        elif client.ReadHolding and self.lose_reads:
            self.lose_reads -= 1
            self.fail()

    def look(self, client, mailbox):
        try:
            more = self.socket.recv(4096)
        except BlockingIOError:
            if time.monotonic() > self.deadline:
                self.fail()
            return
        except OSError:
            more = b""
        self.buffer += more
        if not more:
            self.fail()
        elif len(self.buffer) >= 7:
            size = 6 + int.from_bytes(self.buffer[4:6], "big")
            if len(self.buffer) == size:
                self.answered(client, mailbox, self.buffer[7:])

    def answered(self, client, mailbox, pdu):
        if pdu[0] & 0x80:
            self.exceptions.append(pdu[1])
            self.fail(pdu[1] if self.tells_codes else 255)
            return
        if client.ReadHolding:
            assert pdu[1] == 2 * client.Count
            for i in range(client.Count):
                mailbox.Data[i] = int.from_bytes(pdu[2 + 2 * i : 4 + 2 * i], "big")
        self.busy, self.done = False, True


class Connection:
    """The library's client and the controller's block, and the mailbox between them."""

    def __init__(self, library, port):
        self.client = library.types["DB_ModbusClient"]()
        self.modbus = ModbusBlock(port)

    def cycle(self, mailbox):
        block = self.modbus
        self.client(Mailbox=mailbox, Done=block.done, Error=block.error,
                    Exception=block.exception)
        block.cycle(self.client, mailbox)


class Plc:
    """One axis. Blocks are made by block() and called in every cycle, in the order of their making,
    with the inputs that were set last."""

    def __init__(self, library: Library, port, unit=1, shared=None, **axis):
        """`shared`: another controller's axis whose connection this one uses, too."""
        self.st_library = library
        self.axis = library.types["DB_AXIS_REF"]()
        self.axis.UnitId = unit
        for name, value in axis.items():
            setattr(self.axis, name, value)
        self.update = library.types["DB_Axis"]()
        self.connection = shared.connection if shared else Connection(library, port)
        self.modbus = self.connection.modbus
        self.blocks = []
        self.line = None
        self.sharing = []
        if shared:
            shared.share()
            self.join(shared)

    def share(self):
        """From now on through a line."""
        if not self.line:
            self.line = self.st_library.types["DB_LINE"]()
            self.sharing = [self]
            self.turn = self.st_library.types["DB_Share"]()

    def join(self, other):
        self.line, self.sharing = other.line, other.sharing
        self.sharing.append(self)
        self.turn = self.st_library.types["DB_Share"]()

    def block(self, name, **inputs):
        made = self.st_library.types[name]()
        self.blocks.append(made)
        self.set(made, **inputs)
        return made

    @staticmethod
    def set(block, **inputs):
        for name, value in inputs.items():
            setattr(block, name, value)

    def cycle(self):
        if self.line:
            self.connection.cycle(self.line.Mailbox)
        else:
            self.connection.cycle(self.axis.Mailbox)
        for plc in self.sharing or [self]:
            plc.call_blocks()
        time.sleep(0.001)

    def call_blocks(self):
        if self.line:
            self.turn(Axis=self.axis, Line=self.line)
        self.update(Axis=self.axis, Interval=5)
        for made in self.blocks:
            made(Axis=self.axis)
            outputs = [made.declared.get(name) and getattr(made, name)
                       for name in ("Done", "CommandAborted", "Error")]
            assert sum(map(bool, outputs)) <= 1, "one of Done, CommandAborted and Error"

    def until(self, check, timeout=15.0, what=None):
        """Runs cycles until check() says something true, which is returned."""
        deadline = time.monotonic() + timeout
        while True:
            self.cycle()
            value = check()
            if value:
                return value
            if time.monotonic() > deadline:
                state = {name: getattr(self.axis, name) for name in self.axis.declared}
                raise AssertionError(f"not within {timeout} s: {what}; axis {state}")

    def ended(self, block, timeout=15.0):
        """Runs until the block is not Busy: "Done", "CommandAborted" or its ErrorID."""
        self.until(lambda: not block.Busy, timeout, f"the end of {type(block).__name__}")
        if block.Error:
            return block.ErrorID
        return "CommandAborted" if getattr(block, "CommandAborted", False) else "Done"

    def run(self, block, timeout=15.0, **inputs):
        """One Execute of a block, to its end and back."""
        self.set(block, Execute=True, **inputs)
        self.cycle()
        end = self.ended(block, timeout)
        if end == "Done":
            assert block.Done
        self.set(block, Execute=False)
        self.cycle()
        assert not (block.Error or getattr(block, "Done", False))
        return end
