# SPDX-License-Identifier: Apache-2.0
"""CAN interfaces, and witnesses of what goes over them that share no code with the bridge:
candump, cansend and slcand of can-utils. For tests that run inside the kernel of run-in-uml."""

import errno
import os
import re
import select
import socket
import struct
import subprocess
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path

from bridgelib import Bridge, eventually

# The upper bits of an id in <linux/can.h>, and the classes of error frames in <linux/can/error.h>.
EXTENDED_FLAG = 0x80000000
ERROR_FLAG = 0x20000000
STANDARD_MASK = 0x7FF
EXTENDED_MASK = 0x1FFFFFFF
ERROR_TX_TIMEOUT = 0x001
ERROR_LOST_ARBITRATION = 0x002
ERROR_CONTROLLER = 0x004
ERROR_PROTOCOL = 0x008
ERROR_ACKNOWLEDGE = 0x020
ERROR_BUS_OFF = 0x040
ERROR_BUS_ERROR = 0x080
ERROR_RESTARTED = 0x100
# Data byte 1 of a controller error.
CONTROLLER_RX_PASSIVE = 0x10
CONTROLLER_TX_PASSIVE = 0x20
# A frame that belongs to nobody: what the witness sends to see how far it is.
MARK = EXTENDED_MASK


def run(*command, check=True):
    """Runs a tool; a failure says what it said."""
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=20, check=False
    )
    assert not check or done.returncode == 0, f"{command}: {done.stderr or done.stdout}"
    return done


# --- Frames


@dataclass(frozen=True)
class Frame:
    """A frame as candump saw it. An error frame has its classes as id and is not `extended`."""

    id: int
    data: bytes = b""
    extended: bool = False
    error: bool = False
    remote: bool = False
    interface: str = ""
    time: float = 0.0

    def __str__(self):
        kind = " error" if self.error else " remote" if self.remote else ""
        digits = 8 if self.extended or self.error else 3
        return f"{self.time:.6f} {self.interface} {self.id:0{digits}X}{kind} [{self.data.hex(' ')}]"


LOG_LINE = re.compile(r"\((\d+\.\d+)\) +(\S+) +([0-9A-Fa-f]+)#(R?)([0-9A-Fa-f]*)")


def parse_log_line(line):
    """A line of candump -L, None when it is not a frame."""
    match = LOG_LINE.match(line)
    if match is None:
        return None
    stamp, interface, number, remote, data = match.groups()
    identifier = int(number, 16)
    error = len(number) == 8 and bool(identifier & ERROR_FLAG)
    return Frame(
        id=identifier & EXTENDED_MASK,
        data=b"" if remote else bytes.fromhex(data),
        extended=len(number) == 8 and not error,
        error=error,
        remote=bool(remote),
        interface=interface,
        time=float(stamp),
    )


def cansend(interface, identifier, data=b"", *, extended=None, error=False, check=True):
    """Sends a frame with can-utils. Ids beyond 11 bits are extended ones without being told."""
    if error:
        text = f"{identifier | ERROR_FLAG:08X}"
    elif extended or (extended is None and identifier > STANDARD_MASK):
        text = f"{identifier:08X}"
    else:
        text = f"{identifier:03X}"
    return run("cansend", interface, f"{text}#{bytes(data).hex().upper()}", check=check)


class Witness:
    """candump on one interface: every frame and every error frame, from whomever.

    Being there before the first frame is what start() waits for. An interface that goes down and up
    again keeps its witness; one that is removed needs a new one for its successor, which may be
    started while that is still down.
    """

    def __init__(self, interface):
        self.interface = interface
        self.process = None
        self.reader = None
        self.complaints = []
        self._frames = []
        self._marks_sent = 0
        self._marks_seen = 0
        self._changed = threading.Condition()

    def __enter__(self):
        return self.start()

    def __exit__(self, *unused):
        self.stop()

    def _listeners(self):
        """Sockets that want the interface's error frames; candump asks for them last."""
        table = Path("/proc/net/can/rcvlist_err").read_text(encoding="ascii")
        return sum(line.split()[:1] == [self.interface] for line in table.splitlines())

    def start(self):
        before = self._listeners()
        self.process = subprocess.Popen(
            ["candump", "-L", "-D", f"{self.interface},0:0,#FFFFFFFF"],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

        def listening():
            assert self.process.poll() is None, f"candump ended: {self.complaints}"
            return self._listeners() > before

        eventually(listening, what=f"candump to listen on {self.interface}")
        return self

    def _read(self):
        for line in self.process.stdout:
            frame = parse_log_line(line)
            with self._changed:
                if frame is None:
                    self.complaints.append(line.strip())
                elif frame.id == MARK and frame.extended:
                    self._marks_seen = int.from_bytes(frame.data, "big")
                else:
                    self._frames.append(frame)
                self._changed.notify_all()

    def stop(self):
        if self.process is not None:
            self.process.terminate()
            self.process.wait(5)
            self.reader.join(5)
            self.process = None

    def catch_up(self, timeout=10.0):
        """Waits until everything said before is in the record: for that a frame of its own, which
        does not appear there, must come back."""
        self._marks_sent += 1
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
            sender.bind((self.interface,))
            sender.send(struct.pack("=IB3x8s", MARK | EXTENDED_FLAG, 8,
                                    self._marks_sent.to_bytes(8, "big")))
        with self._changed:
            assert self._changed.wait_for(lambda: self._marks_seen == self._marks_sent, timeout), (
                f"candump on {self.interface} is stuck: {self.complaints}")

    def mark(self):
        """A place in the record, for `since`: between what was said before and after this."""
        self.catch_up()
        with self._changed:
            return len(self._frames)

    def frames(self, identifier=None, since=0):
        with self._changed:
            found = self._frames[since:]
        return [frame for frame in found if identifier is None or frame.id == identifier]

    def wait_for(self, match, timeout=10.0, since=0, count=1):
        """The first frame that matches (a list of so many, if count is more than one). `match` is
        an id, or a function of a frame."""

        def fits(frame):
            return match(frame) if callable(match) else frame.id == match and not frame.error

        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                found = [frame for frame in self._frames[since:] if fits(frame)]
                if len(found) >= count:
                    return found[0] if count == 1 else found[:count]
                left = deadline - time.monotonic()
                if left <= 0 or not self._changed.wait(left):
                    seen = "\n".join(str(frame) for frame in self._frames[since:][-40:])
                    wanted = match if callable(match) else f"id {match:X}"
                    raise AssertionError(
                        f"{len(found)} of {count} frames within {timeout} s: {wanted}; "
                        f"the last on {self.interface}:\n{seen or 'none'}"
                    )

    def wait_error(self, classes, timeout=10.0, since=0):
        """The first error frame that has all of these classes."""
        return self.wait_for(
            lambda frame: frame.error and frame.id & classes == classes, timeout, since
        )


# --- Interfaces


class Link:
    """A vcan interface. It echoes a frame to its senders once it has left its queue, as hardware
    does; see throttle() for how that takes time."""

    def __init__(self, name):
        self.name = name

    def add(self, up=True):
        run("ip", "link", "add", self.name, "type", "vcan")
        if up:
            self.up()
        return self

    def up(self):
        run("ip", "link", "set", self.name, "up")

    def down(self):
        run("ip", "link", "set", self.name, "down")

    def delete(self):
        run("ip", "link", "delete", self.name)

    def exists(self):
        return Path("/sys/class/net", self.name).exists()

    def details(self):
        return run("ip", "-details", "-statistics", "link", "show", self.name).stdout

    def counter(self, name):
        """tx_packets, rx_packets, tx_dropped ..."""
        path = Path("/sys/class/net", self.name, "statistics", name)
        return int(path.read_text(encoding="ascii"))

    def throttle(self, bitrate, frames=10):
        """Lets frames pass at about the pace of a bus of this bit rate, and the queue before it
        hold so many; what finds it full is refused with ENOBUFS. To the kernel each frame is the
        128 bits of its struct, about what an extended frame with eight bytes takes on a wire."""
        run("tc", "qdisc", "replace", "dev", self.name, "root", "tbf", "rate", f"{bitrate}bit",
            "burst", 16, "limit", 16 * frames)

    def unthrottle(self):
        run("tc", "qdisc", "delete", "dev", self.name, "root")


class SerialLink(Link):
    """The kernel's own serial CAN adapter driver on a terminal: what a test says on the other side
    of the terminal is the adapter. A real CAN device to the kernel: it has states, error frames
    and bus off."""

    def __init__(self, name, device, bitrate=1000000):
        super().__init__(name)
        self.device = device
        self.bitrate = bitrate
        self.process = None

    RATES = {10000: 0, 20000: 1, 50000: 2, 100000: 3, 125000: 4, 250000: 5, 500000: 6, 800000: 7,
             1000000: 8}

    def add(self, up=True):
        """Has slcand (in the foreground, so that its end can be seen) make the interface. It writes
        C, S and O to the adapter."""
        self.process = subprocess.Popen(
            ["slcand", "-F", "-o", f"-s{self.RATES[self.bitrate]}", str(self.device), self.name],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )

        def made():
            assert self.process.poll() is None, f"slcand: {self.process.stdout.read()}"
            return self.exists()

        eventually(made, what=f"slcand to make {self.name}")
        if up:
            self.up()
        return self

    def delete(self):
        self.process.terminate()
        self.process.wait(5)
        eventually(lambda: not self.exists(), what=f"{self.name} to go")

    def state(self):
        match = re.search(r"\bstate (\S+) +(\(.*\) +)?restart-ms", self.details())
        return match.group(1) if match else None


class AdapterEnd:
    """The adapter's side of a terminal: lines that end with CR, both ways."""

    def __init__(self):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.device = os.ttyname(self.slave)
        self.pending = b""

    def close(self):
        os.close(self.master)
        os.close(self.slave)

    def say(self, text):
        os.write(self.master, text.encode("ascii") + b"\r")

    def hear(self, timeout=10.0):
        """The next line, without its CR."""
        deadline = time.monotonic() + timeout
        while b"\r" not in self.pending:
            left = max(0.0, deadline - time.monotonic())
            assert select.select([self.master], [], [], left)[0], f"only {self.pending!r}"
            self.pending += os.read(self.master, 4096)
        line, self.pending = self.pending.split(b"\r", 1)
        return line.decode("ascii")


def is_enobufs(error):
    return isinstance(error, OSError) and error.errno == errno.ENOBUFS


# --- The bridge


class CanBridge(Bridge):
    """The bridge and the simulator, both on one CAN interface. As Bridge, with

    interface    the interface's name
    protocol     the family
    bitrate      what both believe the bus runs at; the simulator keeps its pace
    """

    def __init__(self, place, register_map, commands, *, interface, protocol="vsmd-can",
                 bitrate=1000000, bus=None, sim_bus=None, **options):
        here = {"protocol": protocol, "transport": "socketcan", "interface": interface,
                "bitrate": bitrate, "device": None, "baud": None, "line": None}
        super().__init__(
            place, register_map, commands,
            bus={**here, **(bus or {})}, sim_bus={**here, **(sim_bus or {})}, **options)
        # No terminal whose name the simulator could link to.
        self.sim.links = {}

    def restart_sim(self):
        """After its interface went away; mostly the simulator ended with that. Its drives start
        anew."""
        if self.sim.process.poll() is None:
            self.sim.stop()
        self.sim.start()
