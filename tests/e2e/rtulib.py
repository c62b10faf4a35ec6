# SPDX-License-Identifier: Apache-2.0
"""A serial line with a PLC: pseudo terminals, and Modbus RTU by hand or by pymodbus."""

import os
import select
import struct
import threading
import time
import tty

from bridgelib import Refused, Unit
from pymodbus.client import ModbusSerialClient

# Far above the silences of the line, at whatever speed.
PAUSE = 0.03


def crc(data):
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def framed(unit, pdu):
    data = bytes([unit]) + pdu
    return data + struct.pack("<H", crc(data))


class SerialLine:
    """One end is the bridge's device, the other the PLC's, here."""

    def __init__(self, link):
        self.link = link
        self.master = None
        self.plug()

    def plug(self):
        """A new port under the same name, as after an adapter was pulled and put back."""
        self.master, slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(slave)
        fresh = self.link.with_suffix(".new")
        fresh.symlink_to(os.ttyname(slave))
        os.replace(fresh, self.link)
        # The bridge holds it open from here on; a terminal that nobody has open counts as hung up.
        self.slave = slave

    def unplug(self):
        os.close(self.slave)
        os.close(self.master)
        self.link.unlink()
        self.master = None

    def close(self):
        if self.master is not None:
            self.unplug()

    def send(self, data):
        os.write(self.master, data)

    def receive(self, timeout=5.0):
        """What comes until the line is silent; b"" when nothing does."""
        data = b""
        while select.select([self.master], [], [], timeout if not data else PAUSE)[0]:
            data += os.read(self.master, 4096)
        return data

    def is_silent(self, for_seconds=0.3):
        return self.receive(for_seconds) == b""

    def request(self, pdu, unit=1, timeout=5.0):
        """The PDU of the answer to one PDU; None: no answer came."""
        self.send(framed(unit, pdu))
        answer = self.receive(timeout)
        if not answer:
            return None
        assert crc(answer) == 0 and answer[0] == unit, answer.hex(" ")
        return answer[1:-2]


class Plc(Unit):
    """pymodbus as the master of the line, which speaks to one unit by the names of the register map."""

    def __init__(self, bridge, line, number=1, view="drive", timeout=5, retries=0):
        self.line = line
        self.timeout, self.retries = timeout, retries
        self.near, far = os.openpty()
        tty.setraw(self.near)
        tty.setraw(far)
        self.path = os.ttyname(far)
        self.far = far
        self.ending, self.ender = os.pipe()
        self.relay = threading.Thread(target=self.pass_on, daemon=True)
        self.relay.start()
        super().__init__(bridge, number, view, port=self.path)

    def make_client(self, port):
        return ModbusSerialClient(port, baudrate=115200, timeout=self.timeout, retries=self.retries)

    def pass_on(self):
        to = {self.near: self.line.master, self.line.master: self.near}
        while True:
            ready, _, _ = select.select([*to, self.ending], [], [])
            if self.ending in ready:
                return
            for fd in ready:
                os.write(to[fd], os.read(fd, 4096))

    def close(self):
        super().close()
        os.write(self.ender, b"x")
        self.relay.join()
        for fd in (self.near, self.far, self.ending, self.ender):
            os.close(fd)

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()


__all__ = ["PAUSE", "Plc", "Refused", "SerialLine", "crc", "framed", "time"]
