# SPDX-License-Identifier: Apache-2.0
"""The register map in Python, a Modbus client that speaks its names, and the two programs."""

import csv
import os
import pwd
import random
import re
import signal
import socket
import struct
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

from pymodbus.client import ModbusTcpClient

ROOT = Path(__file__).resolve().parents[2]
DOCS = Path(os.environ.get("DRIVEBRIDGE_DOCS", ROOT / "docs"))

# Modbus exceptions, by what the register map's users know them as.
ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
DEVICE_FAILURE = 4
ACKNOWLEDGE = 5
BUSY = 6
NO_PATH = 0x0A
NO_ANSWER = 0x0B

# How the last line about a reload ends.
RELOAD_ENDS = ("reload: done\n", "nothing changes\n")

WIDTHS = {"u16": 1, "i16": 1, "bits16": 1, "u32": 2, "i32": 2, "f32": 2, "bits32": 2, "u64": 4}
FORMATS = {
    "u16": ">H",
    "bits16": ">H",
    "i16": ">h",
    "u32": ">I",
    "bits32": ">I",
    "i32": ">i",
    "f32": ">f",
    "u64": ">Q",
}


def build_directory():
    return Path(os.environ.get("DRIVEBRIDGE_BUILD", ROOT / "build" / "release"))


def find_program(name):
    for place in (build_directory() / name, build_directory() / "src" / name):
        if place.exists():
            return place
    raise FileNotFoundError(f"{name} is not in {build_directory()}; set DRIVEBRIDGE_BUILD")


# Tests run with this niceness: the programs, and the kernel's own threads that carry the bytes of ptys, go
# before them, as if the tests ran on another machine.
NICENESS = 10


@contextmanager
def ahead_of_tests():
    """What this thread starts meanwhile has the niceness from before the tests took theirs, where that is allowed. A
    function that runs in the new process (preexec_fn) would do the same, but for it all memory of this one is copied."""
    own = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, max(own - NICENESS, -20))
    except PermissionError:
        pass
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, own)


def eventually(check, timeout=10.0, what=None):
    """Calls check until it returns something true, which is returned."""
    begun = time.monotonic()
    while True:
        value = check()
        if value:
            return value
        waited = time.monotonic() - begun
        if waited > timeout:
            raise AssertionError(f"not within {timeout} s: {what or check}; last {value!r}")
        # Less often what takes long: the processors are for the programs.
        time.sleep(min(max(waited / 50, 0.005), 0.02))


def as_shown(address):
    """How the service shows a Modbus client of the tests at this address of the loopback: with its user."""
    try:
        return f"{address}, user {pwd.getpwuid(os.geteuid()).pw_name}"
    except KeyError:
        return f"{address}, user {os.geteuid()}"


def free_address():
    """An address of this machine's own that nobody else has asked for, and a port that is free there."""
    address = f"127.{random.randint(1, 250)}.{random.randint(0, 255)}.{random.randint(2, 250)}"
    with socket.socket() as probe:
        probe.bind((address, 0))
        return address, probe.getsockname()[1]


class Refused(Exception):
    """A Modbus exception answered a request."""

    def __init__(self, code):
        super().__init__(f"exception {code:02X}")
        self.code = code


class Register:
    def __init__(self, row):
        self.view = row["view"]
        self.table = row["table"]
        self.address = int(row["address"])
        self.name = row["name"]
        self.type = row["type"]
        self.access = row["access"]
        self.unit = row["unit"]
        self.min = float(row["min"]) if row["min"] else None
        self.max = float(row["max"]) if row["max"] else None
        self.families = row["families"].split()
        self.description = row["description"]
        self.size = WIDTHS.get(self.type, 0)
        # What the description calls its values, or its bits.
        self.codes = {name: int(code)
                      for code, name in re.findall(r"\b(\d+)=(\w+)", self.description)}

    @property
    def writable(self):
        return "w" in self.access

    def belongs_to(self, family):
        return "all" in self.families or family in self.families

    def __repr__(self):
        return f"{self.view}/{self.table} {self.address} {self.name}"


class RegisterMap:
    """docs/register-map.csv. The same name may stand in several tables, so names are looked up in
    holding registers unless told otherwise."""

    def __init__(self, path):
        with open(path, newline="", encoding="utf-8") as file:
            self.rows = [Register(row) for row in csv.DictReader(file)]
        self._size_texts()
        self.by_key = {(row.view, row.table, row.name): row for row in self.rows}
        self.by_family = {(row.view, row.table, row.name, family): row
                          for row in self.rows for family in row.families}

    def _size_texts(self):
        """How long a text is stands at the end of its description."""
        for row in self.rows:
            if row.type == "text":
                row.size = int(row.description.rsplit(";", 1)[1].split()[0])

    def find(self, name, view="drive", table="holding", family=None):
        """Two families may have parameters of the same name."""
        row = self.by_family.get((view, table, name, family))
        row = row or self.by_key.get((view, table, name))
        if row is None:
            raise KeyError(f"no register {name} in {view}/{table}")
        return row

    def of_drive(self, table="holding", family="vsmd-serial"):
        return [
            row
            for row in self.rows
            if row.view == "drive" and row.table == table and row.belongs_to(family)
        ]

    def parameters(self):
        """The vendor's parameters: the registers between the command block and the diagnostics."""
        first, last = self.find("bdr").address, self.find("sds").address
        return [row for row in self.of_drive() if first <= row.address <= last]


MAP = RegisterMap(DOCS / "register-map.csv")


def code(register, name):
    """The value of a drive's register that the register map gives this name."""
    return MAP.find(register).codes[name]


def bit(register, name):
    """The mask of a bit that the register map gives this name."""
    return 1 << code(register, name)


RESULT_NONE = code("result", "none")
RESULT_OK = code("result", "ok")
RESULT_PENDING = code("result", "pending")
RESULT_REFUSED = code("result", "refused")
RESULT_OUT_OF_RANGE = code("result", "out_of_range")
RESULT_TIMEOUT = code("result", "timeout")
RESULT_INDETERMINATE = code("result", "indeterminate")
RESULT_RESTARTED = code("result", "restarted")
RESULT_CANCELLED = code("result", "cancelled")
RESULT_LIMIT = code("result", "limit")
RESULT_LATCHED = code("result", "latched")
RESULT_UNSUPPORTED = code("result", "unsupported")
RESULT_BUSY = code("result", "busy")
RESULT_OFFLINE = code("result", "offline")
RESULT_FAILED = code("result", "failed")
RESULT_RATE_LIMITED = code("result", "rate_limited")
RESULT_NOT_IN_CONTROL = code("result", "not_in_control")
RESULT_UNPROVEN = code("result", "unproven")
RESULT_RUNS_ON = code("result", "runs_on")

OFFLINE = code("axis_state", "Offline")
DISABLED = code("axis_state", "Disabled")
STANDSTILL = code("axis_state", "Standstill")
DISCRETE = code("axis_state", "DiscreteMotion")
CONTINUOUS = code("axis_state", "ContinuousMotion")
HOMING = code("axis_state", "Homing")
STOPPING = code("axis_state", "Stopping")
ERROR_STOP = code("axis_state", "ErrorStop")

STOP = code("command", "stop")
MOVE_VELOCITY = code("command", "move_velocity")
MOVE_ABSOLUTE = code("command", "move_absolute")

NO_ERROR = code("error", "none")
NO_ANSWER_ERROR = code("error", "no_answer")
BUS_DOWN_ERROR = code("error", "bus_down")
RUNS_ON_ERROR = code("error", "runs_on")

QUALITY_BAD = code("quality", "bad")
QUALITY_UNCERTAIN = code("quality", "uncertain")
QUALITY_GOOD = code("quality", "good")

ONLINE_BIT = bit("status", "online")
ENABLED_BIT = bit("status", "enabled")
HOMED_BIT = bit("status", "homed")
MOVING_BIT = bit("status", "moving")
AT_TARGET_BIT = bit("status", "at_target")
LATCHED_BIT = bit("status", "latched")
ORIGIN_LOST_BIT = bit("status", "origin_lost")
MUST_STAND_BIT = bit("status", "must_stand")
PARAMS_VALID_BIT = bit("status", "params_valid")
ABORTED_BIT = bit("status", "aborted")


def load_commands(path):
    with open(path, newline="", encoding="utf-8") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def swap_words(words):
    return words[::-1]


def decode(kind, words, low_first=False):
    if kind == "text":
        raw = b"".join(struct.pack(">H", word) for word in words)
        return raw.split(b"\0")[0].decode()
    if low_first:
        words = swap_words(words)
    raw = b"".join(struct.pack(">H", word) for word in words)
    return struct.unpack(FORMATS[kind], raw)[0]


def encode(kind, value, low_first=False):
    raw = struct.pack(FORMATS[kind], float(value) if kind == "f32" else int(value))
    words = list(struct.unpack(f">{len(raw) // 2}H", raw))
    return swap_words(words) if low_first else words


def f32(value):
    """The nearest single-precision number, as it arrives on the other side."""
    return struct.unpack(">f", struct.pack(">f", value))[0]


class Unit:
    """One Modbus unit of the bridge, spoken to by the names of the register map."""

    def __init__(self, bridge, number, view, port=None):
        self.bridge = bridge
        self.map = bridge.map
        self.number = number
        self.view = view
        self.low_first = bridge.low_first
        self.client = self.make_client(port or bridge.port)
        assert self.client.connect()

    def make_client(self, port):
        return ModbusTcpClient("127.0.0.1", port=port, timeout=10, retries=0)

    def close(self):
        self.client.close()

    def reconnect(self):
        self.client.close()
        assert self.client.connect()

    @staticmethod
    def _check(response):
        if response.isError():
            raise Refused(response.exception_code)
        return response

    def words(self, address, count):
        answer = self.client.read_holding_registers(address, count=count, device_id=self.number)
        return self._check(answer).registers

    def input_words(self, address, count):
        answer = self.client.read_input_registers(address, count=count, device_id=self.number)
        return self._check(answer).registers

    def write_words(self, address, words):
        """FC 16. The exception code, or 0."""
        answer = self.client.write_registers(address, words, device_id=self.number)
        return answer.exception_code if answer.isError() else 0

    def write_word(self, address, word):
        """FC 6. The exception code, or 0."""
        answer = self.client.write_register(address, word, device_id=self.number)
        return answer.exception_code if answer.isError() else 0

    def row(self, name):
        return self.map.find(name, self.view, family=self.bridge.family)

    def read(self, name):
        row = self.row(name)
        return decode(row.type, self.words(row.address, row.size), self.low_first)

    def read_many(self, first, last):
        """All registers from first to last, in one request, as a dictionary."""
        begin, end = self.row(first), self.row(last)
        words = self.words(begin.address, end.address + end.size - begin.address)
        values = {}
        for row in self.map.rows:
            if (
                row.table == "holding"
                and row.view == begin.view
                and begin.address <= row.address <= end.address
            ):
                at = row.address - begin.address
                values[row.name] = decode(row.type, words[at : at + row.size], self.low_first)
        return values

    def write(self, name, value):
        row = self.row(name)
        return self.write_words(row.address, encode(row.type, value, self.low_first))

    def command(self, name, command_id=None, **args):
        """One FC 16 over the command's block. The exception code, or 0."""
        entry = self.bridge.commands[name] if isinstance(name, str) else None
        code = int(entry["code"]) if entry else name
        rows = [self.row(arg) for arg in (entry["arguments"].split() if entry else args)]
        rows += [self.row(arg) for arg in args]
        start = self.row("command" if command_id is None else "command_id")
        end = max([self.row("command"), *rows], key=lambda row: row.address)
        words = self.words(start.address, end.address + end.size - start.address)
        values = dict(args, command=code)
        if command_id is not None:
            values["command_id"] = command_id
        for key, value in values.items():
            row = self.row(key)
            at = row.address - start.address
            words[at : at + row.size] = encode(row.type, value, self.low_first)
        return self.write_words(start.address, words)

    def settle(self, name, command_id=None, **args):
        """A command whose end is awaited: the `result` register when it is not pending."""
        self.command(name, command_id, **args)
        return self.settled()

    def settled(self):
        return eventually(
            lambda: self.read("result") if self.read("result") != RESULT_PENDING else None,
            what="the command to end",
        )

    def online(self):
        return bool(self.read("status") & ONLINE_BIT)


class Client(Unit):
    """A pymodbus client from an address of its own."""

    def __init__(self, bridge, source, number=1, view="drive"):
        super().__init__(bridge, number, view)
        self.client.close()
        self.client = ModbusTcpClient("127.0.0.1", port=bridge.port, timeout=10, retries=0,
                                      source_address=(source, 0))
        assert self.client.connect()
        self.port = self.client.socket.getsockname()[1]

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()


class Raw:
    """A bare TCP connection to the bridge."""

    def __init__(self, port, source=None):
        where = (source, 0) if source else None
        self.socket = socket.create_connection(("127.0.0.1", port), 10, source_address=where)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()

    def send(self, data):
        self.socket.sendall(data)

    @staticmethod
    def adu(transaction, unit, pdu):
        return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu

    def request(self, pdu, unit=1, transaction=1):
        """Sends one PDU and returns the PDU of its answer."""
        self.send(self.adu(transaction, unit, pdu))
        got, answering, answer = self.receive()
        assert (got, answering) == (transaction, unit)
        return answer

    def _exactly(self, count):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise ConnectionError(f"closed after {data!r}")
            data += more
        return data

    def receive(self):
        """One ADU: transaction, unit and PDU."""
        transaction, protocol, length, unit = struct.unpack(">HHHB", self._exactly(7))
        assert protocol == 0
        return transaction, unit, self._exactly(length - 1)

    def closed(self, timeout=5.0):
        """Whether the other side ends the connection."""
        self.socket.settimeout(timeout)
        try:
            while self.socket.recv(4096):
                pass
        except ConnectionError:
            return True
        except TimeoutError:
            return False
        return True


def written(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "{" + ", ".join(f'"{item}"' for item in value) + "}"
    if isinstance(value, (int, float)):
        return str(value)
    return f'"{value}"'


def section(title, keys):
    lines = [f"{title} {{"]
    lines += [f"    {key} = {written(value)}" for key, value in keys.items() if value is not None]
    return "\n".join([*lines, "}", ""])


class Sim:
    """The simulator, and the control socket through which its drives go wrong."""

    def __init__(self, place, config, links):
        self.place = place
        self.control_path = place / "control"
        self.trace_path = place / "trace"
        self.log_path = place / "sim.log"
        self.config_path = place / "sim.conf"
        self.config_path.write_text(config, encoding="utf-8")
        self.links = links
        self.process = None

    def start(self):
        command = [find_program("drivebridge-sim"), "--config", self.config_path]
        command += ["--control", self.control_path, "--trace", self.trace_path]
        for bus, path in self.links.items():
            command += ["--link", f"{bus}={path}"]
        offset = self.log_path.stat().st_size if self.log_path.exists() else 0
        with open(self.log_path, "ab") as log, ahead_of_tests():
            self.process = subprocess.Popen(command, stdout=log, stderr=log)

        def ready():
            assert self.process.poll() is None, self.log_path.read_text()
            return "ready\n" in self.log_path.read_text()[offset:]

        eventually(ready, what="the simulator to be ready")

    def stop(self):
        self.process.terminate()
        return self.process.wait(5)

    def control(self, line):
        """One command; the answer's lines without its final one, which must be "ok"."""
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(5)
            link.connect(str(self.control_path))
            link.sendall(line.encode() + b"\n")
            text = b""
            while not text.endswith(b"\n") or not text.splitlines()[-1].startswith(
                (b"ok", b"error")
            ):
                more = link.recv(65536)
                assert more, f"{line}: the simulator went away"
                text += more
        lines = text.decode(errors="replace").splitlines()
        assert lines[-1].startswith("ok"), f"{line}: {lines[-1]}"
        return [*lines[:-1], lines[-1][3:]] if lines[-1] != "ok" else lines[:-1]

    def fault(self, what, target="drive1"):
        self.control(f"fault {target} {what}")

    def get(self, target="drive1"):
        """Position, shaft, counters ... as numbers where they are numbers."""
        values = {}
        for field in self.control(f"get {target}")[0].split():
            key, text = field.split("=", 1)
            try:
                values[key] = int(text, 0)
            except ValueError:
                try:
                    values[key] = float(text)
                except ValueError:
                    values[key] = text
        return values

    def log(self, target="drive1"):
        """The last requests that the drive took, the newest last."""
        return [line.split(" ", 1)[1] for line in self.control(f"log {target}")]

    def trace(self, direction, bus="line"):
        """Everything that went over the wire: '>' requests, '<' replies."""
        texts = []
        for line in self.trace_path.read_text(encoding="utf-8").splitlines():
            parts = line.split(" ", 3)
            if len(parts) == 4 and parts[1] == bus and parts[2] == direction:
                texts.append(line.split(" |", 1)[1][:-1] if " |" in line else "")
        return texts

    def mark(self):
        """A place in the trace, for sent()."""
        return len(self.trace(">"))

    def sent(self, since=0, polls=False, bus="line"):
        """The requests seen on the wire, without the cyclic ones, the reads behind a write and the bare
        line ends behind a lost line."""
        lines = [text.rstrip(".") for text in self.trace(">", bus)[since:]]
        return lines if polls else [line for line in lines
                                    if line and not line.endswith((" sts", " cfg"))]


class Bridge:
    """The simulator and drivebridged on one line, configured from Python.

    drives   number of drives, unit = address = 1.., named drive1..
    modbus, control, bus, drive, sim_bus, sim_drive
             keys for the sections of both configurations; drive and sim_drive hold for every drive
    per_drive, sim_per_drive
             {number: keys} for single drives
    faults   what the simulated drives have from the start: {number: [fault ...]}
    sim_drives
             number of simulated drives, where one of them is several of the bridge's
    launcher a command that becomes the bridge, which is given to it as its arguments
    """

    def __init__(self, place, register_map, commands, *, drives=1, modbus=None, bus=None,
                 drive=None, per_drive=None, sim_bus=None, sim_drive=None, sim_per_drive=None,
                 faults=None, line="rs485", baud=115200, start_sim=True, wait_online=True,
                 text=None, sim_drives=None, launcher=(), control=None, endpoints=None):
        self.launcher = list(launcher)
        self.place = place
        self.map = register_map
        self.commands = commands
        self.drive_count = drives
        self.family = (bus or {}).get("protocol", "vsmd-serial")
        self.start_sim = start_sim
        self.wait_online = wait_online
        self.low_first = (modbus or {}).get("word-order") == "low-first"
        self.link = place / "line"
        self.log_path = place / "bridge.log"
        self.config_path = place / "bridge.conf"
        self.control_path = place / "tools"
        self.process = None
        self.port = None
        self.ports = {}  # of further endpoints, by their names
        self.units = {}
        self.ended = False

        keys = {"listen": "127.0.0.1:0", "confirm-ms": 2000, **(modbus or {})}
        self.sections = {"modbus": keys, "control": {"socket": self.control_path, **(control or {})}}
        for name, more in (endpoints or {}).items():
            self.sections[f"endpoint {name}"] = {"listen": "127.0.0.1:0", **more}
        # Twice the default latency: many tests side by side keep a machine busy.
        keys = {"protocol": "vsmd-serial", "device": self.link, "baud": baud, "line": line,
                "cycle-ms": 20, "drive-latency-ms": 60, **(bus or {})}
        self.sections["bus line"] = keys
        for number in range(1, drives + 1):
            keys = {"bus": "line", "address": None if line == "rs232" else number,
                    "unit": number, "watchdog-ms": 0, **(drive or {}),
                    **(per_drive or {}).get(number, {})}
            self.sections[f"drive drive{number}"] = keys
        self.write_config(text)

        keys = {"protocol": "vsmd-serial", "device": "pty", "baud": baud, "line": line,
                "latency-us": 200, **(sim_bus or {})}
        parts = [section("bus line", keys)]
        for number in range(1, (sim_drives or drives) + 1):
            keys = {"bus": "line", "address": number,
                    "identity": "VSMD113_025T-1.0.008.170428",
                    "set": ["spd=6400", "acc=64000", "dec=64000", "pae=1"],
                    "fault": (faults or {}).get(number), **(sim_drive or {}),
                    **(sim_per_drive or {}).get(number, {})}
            parts.append(section(f"drive drive{number}", keys))
        self.sim = Sim(place, "\n".join(parts), {"line": self.link})

    def write_config(self, text=None):
        """What the sections say, at once: a reload never finds half a file."""
        text = text or "\n".join(section(title, keys) for title, keys in self.sections.items())
        fresh = self.config_path.with_suffix(".new")
        fresh.write_text(text, encoding="utf-8")
        os.replace(fresh, self.config_path)

    # --- running

    def start(self):
        if self.start_sim:
            self.sim.start()
        self.start_bridge()

    def start_bridge(self):
        offset = self.log_path.stat().st_size if self.log_path.exists() else 0
        command = [*self.launcher, find_program("drivebridged"), "--config", self.config_path]
        with open(self.log_path, "ab") as log, ahead_of_tests():
            self.process = subprocess.Popen(command, stdout=log, stderr=log)

        def listening():
            assert self.process.poll() is None, self.log_since(offset)
            self.find_ports(offset)
            further = sum(title.startswith("endpoint ") for title in self.sections)
            return self.port and len(self.ports) >= further

        self.port = None
        eventually(listening, what="the bridge to listen")
        if self.start_sim and self.wait_online:
            for number in range(1, self.drive_count + 1):
                self.wait_ready(number)

    def find_ports(self, offset=0):
        """Where it listens, as its log says."""
        for port, name in re.findall(r"listening on .*:(\d+)(?: for endpoint (\S+))?$", self.log_since(offset), re.M):
            if name:
                self.ports[name] = int(port)
            else:
                self.port = int(port)

    def wait_ready(self, number=1, timeout=10.0):
        drive = self.drive(number)
        eventually(
            lambda: drive.read("status") & PARAMS_VALID_BIT, timeout,
            f"drive {number} to be online with its parameters",
        )

    def stop_bridge(self):
        """SIGTERM. Returns the exit status."""
        for unit in self.units.values():
            unit.close()
        self.units = {}
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(5)

    def log_size(self):
        return self.log_path.stat().st_size

    def log_since(self, offset):
        return self.log_path.read_bytes()[offset:].decode(errors="replace")

    def told(self, text):
        """Waits for the log, which has a thread of its own: all lines with this text."""
        return eventually(lambda: [line for line in self.log_since(0).splitlines() if text in line],
                          what=f"a line with {text!r}")

    def hang_up(self):
        self.process.send_signal(signal.SIGHUP)

    def reload(self, text=None, timeout=10.0):
        """Writes the sections as they are now and has them taken. What was logged about it."""
        self.write_config(text)
        offset = self.log_size()
        self.hang_up()
        eventually(lambda: any(end in self.log_since(offset) for end in RELOAD_ENDS), timeout,
                   "the end of the reload")
        return self.log_since(offset)

    def restart_bridge(self):
        assert self.stop_bridge() == 0
        self.start_bridge()

    def finish(self):
        """Ends both programs. Returns what was wrong with their ends."""
        problems = []
        if self.process and self.process.poll() is None:
            try:
                status = self.stop_bridge()
                if status != 0:
                    problems.append(f"drivebridged ended with {status}")
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
                problems.append("drivebridged did not end within 5 s of SIGTERM")
        elif self.process and self.process.returncode != 0:
            problems.append(f"drivebridged ended with {self.process.returncode} by itself")
        if self.sim.process and self.sim.process.poll() is None:
            try:
                if self.sim.stop() != 0:
                    problems.append("drivebridge-sim ended with an error")
            except subprocess.TimeoutExpired:
                self.sim.process.kill()
                self.sim.process.wait()
                problems.append("drivebridge-sim did not end")
        for path in (self.log_path, self.sim.log_path):
            text = path.read_text(errors="replace") if path.exists() else ""
            if "Sanitizer" in text or "runtime error:" in text:
                problems.append(f"sanitizer output in {path.name}")
        return problems

    def print_logs(self):
        for path in (self.config_path, self.log_path, self.sim.config_path, self.sim.log_path):
            if path.exists():
                print(f"--- {path.name}\n{path.read_text(errors='replace')}")
        if self.sim.trace_path.exists():
            lines = self.sim.trace_path.read_text(errors="replace").splitlines()
            print("--- the last of the wire", *lines[-60:], sep="\n")

    # --- speaking to it

    def drive(self, number=1):
        """A connection of its own for each drive; one of an endpoint has the unit of its section there."""
        if number not in self.units:
            keys = self.sections.get(f"drive drive{number}", {})
            endpoint = keys.get("endpoint")
            self.units[number] = self.at(endpoint, keys["unit"]) if endpoint else Unit(self, number, "drive")
        return self.units[number]

    def at(self, endpoint, unit=255, view="drive"):
        """One more connection to a unit of an endpoint; None is the first one. The caller closes it."""
        return Unit(self, unit, view, self.ports[endpoint] if endpoint else self.port)

    def connect(self, number=1):
        """One more connection to a drive's unit; the caller closes it."""
        return Unit(self, number, "drive")

    def gateway(self):
        if 255 not in self.units:
            self.units[255] = Unit(self, 255, "gateway")
        return self.units[255]

    def raw(self, source=None):
        return Raw(self.port, source)

    # --- the drive's side

    def wait_standing(self, number=1, timeout=10.0):
        drive = self.drive(number)
        eventually(lambda: drive.read("axis_state") in (STANDSTILL, DISABLED, ERROR_STOP), timeout,
                   "the drive to stand")
