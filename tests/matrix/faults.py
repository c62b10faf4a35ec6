# SPDX-License-Identifier: Apache-2.0
"""Every fault of the matrix: what it is called in the table, on which families there is such a thing,
and what the world does to bring it about. Drive 1 is the one it happens to."""

from dataclasses import dataclass

from model.families import FAMILIES
from model.history import WORLD, Step

ALL = tuple(FAMILIES)
SERIAL = ("vsmd-serial", "xyza")
CAN = ("vsmd-can", "servo-can")
TARGET = 1

# Bytes of a reply, from 1, by what they are.
FIELDS = {
    "vsmd-serial": {"start": [1], "id": [2], "kind": [3], "speed": [4, 8], "position": [9, 12, 13],
                    "status": [14, 17, 18], "checksum": [19, 20], "end": [21]},
    "xyza": {"start": [1, 2], "mark": [3], "order": [4], "level": [5], "number": [6],
             "class": [7], "target": [8], "value": [9, 12], "checksum": [13]},
}


@dataclass(frozen=True)
class Fault:
    name: str
    families: tuple
    # Of the simulator, one is armed at a time. {drive} is where it happens; {twin} is another of
    # the bus, with the address {own}.
    lines: tuple = ()
    undo: str = ""           # a fault that lasts ends with this line
    lasts: int = 0           # ms
    deed: str = "control"
    phases: tuple = (0,)     # ms behind the command's sending at which it comes
    whole_bus: bool = False  # all drives of the bus have it
    kernel: bool = False     # of a CAN interface in a kernel of the test's own
    twins: bool = False      # the other drive of the fault does what this one is told

    def step(self, line, phase, names):
        """`names`: what stands for the places in the lines."""
        return Step(WORLD, self.deed, TARGET, name=line.format(**names),
                    undo=self.undo.format(**names), gap=self.lasts, delay=phase)

    def armed_before(self):
        """What hits the next exchange is there before the command; the rest comes while it goes on."""
        return not self.lasts and self.deed == "control"


def corrupted():
    for family, fields in FIELDS.items():
        for field, places in fields.items():
            yield Fault(f"reply corrupted: {field}", (family,),
                        tuple(f"fault {{drive}} corrupt-at {place} 1" for place in places))


def once(name, lines, families=ALL):
    return Fault(name, families, tuple(f"fault {{drive}} {line}" for line in lines))


FAULTS = [
    once("request lost", ["lose-request 1", "lose-request 2", "lose-request 4"]),
    once("reply lost", ["drop 1", "drop 2", "drop 4"]),
    once("reply late by 80 ms", ["delay 80 1", "delay 80 2"]),
    once("reply late by 400 ms", ["delay 400 1"]),
    *corrupted(),
    once("frame damaged on the wire", ["corrupt 1", "corrupt 3"], CAN),
    once("reply truncated", ["truncate 1", "truncate 2"]),
    once("reply doubled", ["double 1", "double 3"]),
    once("garbage before the reply", ["garbage 1", "garbage 3"]),
    once("reply split by garbage", ["split 1", "split 3"], SERIAL),
    once("reply in another drive's name", ["wrong-id 1", "wrong-id 2"]),
    Fault("echo of the bridge's own sending", ALL, ("fault line echo on",), "fault line echo off",
          400, whole_bus=True),
    Fault("drive unplugged for 1 s", ALL, ("fault {drive} silence on",), "fault {drive} silence off", 1000,
          phases=(0, 15)),
    Fault("power lost for a moment", ALL, ("power {drive} off",), "power {drive} on", 100,
          phases=(0, 2, 4, 6, 9, 13)),
    Fault("power lost for 1 s", ALL, ("power {drive} off",), "power {drive} on", 1000,
          phases=(0, 3, 8)),
    Fault("power lost too briefly to be missed", ("servo-can",), ("power {drive} cycle",),
          "power {drive} on", 1, phases=(0, 2, 4, 8)),
    Fault("drive fault for 0.1 s", ("servo-can",), ("faults {drive} 1",), "faults {drive} 0", 100,
          phases=(0, 2, 4, 8)),
    Fault("drive obeys no stop for 0.5 s", ALL, ("fault {drive} runaway on",), "fault {drive} runaway off", 500,
          phases=(0, 10)),
    Fault("two drives at one address", ALL, ("address {twin} 1",),
          "address {twin} {own}", 500, twins=True),
    Fault("port gone and back", ALL, ("port",), lasts=300, deed="port", phases=(0, 10),
          whole_bus=True),
    Fault("controller off the bus", CAN, ("fault line bus-off on",), "fault line bus-off off", 400,
          phases=(0, 5), whole_bus=True),
    Fault("command queue full", ALL, deed="flood"),
    Fault("bridge killed (kill -9)", ALL, ("kill",), lasts=1, deed="kill", phases=(0, 4),
          whole_bus=True),
    Fault("no room for the log on the disk", ALL, ("disk",), deed="disk", whole_bus=True),
]

# Tried in the phase kernel: they take an interface, and the time of day, for themselves.
KERNEL_FAULTS = [
    Fault("interface down for 0.5 s", CAN, ("down",), lasts=500, deed="link", phases=(0, 5),
          whole_bus=True, kernel=True),
    Fault("interface removed for 0.5 s", CAN, ("removed",), lasts=500, deed="link",
          phases=(0, 5), whole_bus=True, kernel=True),
    Fault("clock stepped by a year and back", CAN, ("31536000", "-31536000"), deed="clock",
          whole_bus=True, kernel=True),
]


def rows():
    """(family, fault) in the order of the table."""
    return [(family, fault) for fault in [*FAULTS, *KERNEL_FAULTS] for family in ALL if family in fault.families]
