# SPDX-License-Identifier: Apache-2.0
"""Plays a history against a bridge and a simulator, and keeps what was asked and answered when."""

import asyncio
import os
import struct
import subprocess
import time
from dataclasses import dataclass, field

from bridgelib import (
    DOCS,
    MAP,
    MOVING_BIT,
    QUALITY_GOOD,
    Bridge,
    ahead_of_tests,
    encode,
    eventually,
    find_program,
    load_commands,
)
from model import modbus
from model.families import FAMILIES, POWER, Event, Reader
from model.history import CLIENTS, WINDOW, WORLD, Step

# How long a plant may take until all is right again.
RECOVERY = 30.0
# Longer than any answer may take; the bridge alone needs no second for any of them.
PATIENCE = 20.0
FLOOD = 60  # commands
SOURCES = [f"127.0.0.{11 + client}" for client in range(CLIENTS)]
VENDOR_UNIT = 100
VENDOR_CODES = {"stop": 0x0400, "halt": 0x0401, "enable": 0x0101, "go": 0x0301}
GROUP_STOP = 1


@dataclass
class Attempt:
    """One request. code: 0 success, an exception, None: the connection was closed before."""

    sent: float
    answered: float = 0.0
    code: object = None
    silent: bool = False  # no answer within PATIENCE


@dataclass
class Result:
    """The registers about results, read behind an attempt."""

    sent: float
    number: int
    code: int


@dataclass
class Done:
    step: object
    attempts: list = field(default_factory=list)
    result: object = None
    process: object = None  # what a read brought
    chaser: object = None   # the stop that was sent right behind
    seconds: object = None  # that a recovery took; None: it did not come


@dataclass
class Deed:
    """What the world did, from when to when."""

    step: object
    begun: float
    ended: float = 0.0


@dataclass
class Record:
    history: object
    family: object
    done: list = field(default_factory=list)
    deeds: list = field(default_factory=list)
    events: list = field(default_factory=list)
    problems: list = field(default_factory=list)  # ends of programs, sanitizers
    ended: float = 0.0


# Of register trouble.
MAY_HAVE_RESTARTED = 13


class Layout:
    """Addresses, from the register map."""

    def __init__(self, register_map, commands):
        self.map = register_map
        self.codes = {name: int(row["code"]) for name, row in commands.items()}
        self.ends = {}
        for name, row in commands.items():
            last = max((self.row(argument).address + self.row(argument).size
                        for argument in row["arguments"].split()), default=0)
            self.ends[name] = max(last, self.at("command") + 1)

    def row(self, name, view="drive"):
        return self.map.find(name, view)

    def at(self, name, view="drive"):
        return self.row(name, view).address

    def block(self, step):
        """The words of a command from command_id on."""
        first = self.at("command_id")
        words = [0] * (self.ends[step.name] - first)
        words[0], words[1] = step.number, self.codes[step.name]
        self._put(words, first, "target_position", step.position)
        self._put(words, first, "target_velocity", step.velocity)
        return first, words

    def _put(self, words, first, name, value):
        row = self.row(name)
        at = row.address - first
        if at < len(words):
            words[at:at + row.size] = encode(row.type, value)

    def arguments(self, step):
        first = self.at("target_position")
        return first, [*encode("i32", step.position), *encode("f32", step.velocity)]


def listening_port(process):
    """The port on which it takes connections, as the kernel has it; None: not yet."""
    links = []
    for entry in os.scandir(f"/proc/{process}/fd"):
        try:
            links.append(os.readlink(entry.path))
        except FileNotFoundError:
            pass  # closed meanwhile
    with open(f"/proc/{process}/net/tcp", encoding="ascii") as table:
        for line in list(table)[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in links:
                return int(fields[1].split(":")[1], 16)
    return None


class Player:
    def __init__(self, history, place):
        self.history = history
        self.family = FAMILIES[history.family]()
        self.record = Record(history, self.family)
        commands = load_commands(DOCS / "commands.csv")
        self.layout = Layout(MAP, commands)
        self.bridge = self._make_bridge(place, MAP, commands)
        self.links = [modbus.Link(self._port, source) for source in SOURCES]
        self.running = asyncio.Event()
        self.open_steps = {}
        self.moved_on = asyncio.Condition()
        self.changes = 0
        self.reader = Reader(self.family)
        self.earlier = []  # events of simulators that have ended
        self.window = history.settings.get("window", WINDOW)

    def _options(self):
        settings, given = self.history.settings, self.family.options
        drives = {number: dict((given.get("per_drive") or {}).get(number, {}))
                  for number in range(1, self.family.drives + 1)}
        if self.family.vendor:
            for number, keys in drives.items():
                keys["vendor-unit"] = VENDOR_UNIT + number
        modbus_keys = {"confirm-ms": settings["confirm-ms"], "command-id-scope": settings["scope"],
                       "control": "drive" if settings["control"] else "off"}
        bus = {"cycle-ms": 10, **given.get("bus", {})}
        return {**given, "bus": bus, "modbus": modbus_keys, "per_drive": drives}

    def _make_bridge(self, place, register_map, commands):
        """On the serial lines of this machine, or on a CAN interface of a kernel made for tests."""
        options, interface = self._options(), self.history.settings.get("interface")
        if not interface:
            return Bridge(place, register_map, commands, **options)
        from kernellib import CanBridge  # pylint: disable=import-outside-toplevel

        for section in ("bus", "sim_bus"):
            for key in ("transport", "bitrate", "line", "protocol", "baud"):
                options[section].pop(key, None)
        options.pop("baud")
        return CanBridge(place, register_map, commands, interface=interface,
                         protocol=self.family.name, **options)

    def _port(self):
        return self.bridge.port

    # --- what clients do

    def request_of(self, step):
        """Unit and PDU of a step."""
        layout = self.layout
        if step.do == "command":
            first, words = layout.block(step)
            if step.bare and len(words) == 2:
                return step.drive, modbus.write_single(first + 1, words[1])
            return step.drive, modbus.write(first + step.bare, words[step.bare:])
        if step.do == "vendor":
            code = VENDOR_CODES[step.name]
            if step.name != "go":
                return VENDOR_UNIT + step.drive, modbus.write_single(0, code)
            words = struct.unpack(">HH", struct.pack(">i", step.position))
            return VENDOR_UNIT + step.drive, modbus.write(0, [code, words[1], words[0]])
        if step.do == "parameter":
            return step.drive, modbus.write(layout.at(self.family.parameter),
                                            encode("f32", step.velocity))
        if step.do == "group_stop":
            return 255, modbus.write_single(layout.at("group_stop", "gateway"), GROUP_STOP)
        if step.do == "group_start":
            return 255, modbus.write_single(layout.at("group_start", "gateway"), 1)
        if step.do == "control":
            return step.drive, modbus.write_single(layout.at("control_request"), step.number)
        raise ValueError(step.do)

    async def attempt(self, done, unit, pdu, cut=""):
        """Sends once; with `cut` the connection is closed behind it. False: try again later."""
        link = self.links[done.step.who]
        await self.running.wait()
        attempt = Attempt(time.monotonic())
        try:
            await link.send(unit, pdu)
        except modbus.Lost:
            # A bridge that is down refuses the connection; a request may be lost with it.
            done.attempts.append(attempt)
            await asyncio.sleep(0.01)
            return False
        done.attempts.append(attempt)
        if cut:
            link.close(reset=cut == "rst")
            return True
        try:
            attempt.code = modbus.exception_of(await link.receive(PATIENCE))
            attempt.answered = time.monotonic()
        except modbus.Silent:
            attempt.silent = True
            link.close()
        except modbus.Lost:
            return False
        return True

    async def flood(self, step):
        """So many commands in one piece, each at a speed of its own."""
        flood = [Done(Step(step.who, "command", step.drive, step.name, velocity=step.velocity + i,
                           place=step.place)) for i in range(FLOOD)]
        self.record.done += flood
        link = self.links[step.who]
        sent = time.monotonic()
        for done in flood:
            done.attempts.append(Attempt(sent))
        await link.send(step.drive, *[self.request_of(done.step)[1] for done in flood])
        for done in flood:
            done.attempts[0].code = modbus.exception_of(await link.receive(PATIENCE))
            done.attempts[0].answered = time.monotonic()

    async def chase(self, done, unit, pdu):
        """The command and a stop in one piece: whatever becomes of the first, the stop is behind it."""
        stop = Done(Step(done.step.who, "command", done.step.drive, done.step.chase,
                         place=done.step.place))
        self.record.done.append(stop)
        done.chaser = stop
        link = self.links[done.step.who]
        await self.running.wait()
        sent = time.monotonic()
        for each in (done, stop):
            each.attempts.append(Attempt(sent))
        try:
            await link.send(unit, pdu, self.request_of(stop.step)[1])
            for each in (done, stop):
                each.attempts[0].code = modbus.exception_of(await link.receive(PATIENCE))
                each.attempts[0].answered = time.monotonic()
        except modbus.Silent:
            stop.attempts[0].silent = True
            link.close()
        except modbus.Lost:
            pass

    async def look(self, done):
        first, last = self.layout.row("result_id"), self.layout.row("result")
        sent = time.monotonic()
        try:
            pdu = await self.links[done.step.who].ask(
                done.step.drive, modbus.read(first.address, 2), PATIENCE)
        except (modbus.Lost, modbus.Silent):
            return
        if not pdu[0] & 0x80 and last.address == first.address + 1:
            done.result = Result(sent, *modbus.words_of(pdu))

    async def read(self, done):
        """The process data in one read: what is shown belongs together."""
        end = self.layout.row("trouble")
        await self.running.wait()
        attempt = Attempt(time.monotonic())
        done.attempts.append(attempt)
        try:
            pdu = await self.links[done.step.who].ask(
                done.step.drive, modbus.read(0, end.address + end.size), PATIENCE)
        except modbus.Lost:
            return
        except modbus.Silent:
            attempt.silent = True
            self.links[done.step.who].close()
            return
        attempt.answered = time.monotonic()
        attempt.code = modbus.exception_of(pdu)
        if attempt.code == 0:
            done.process = self._process(modbus.words_of(pdu))

    async def rest(self, done):
        """Until the drive stands; what comes behind needs that."""
        begun = time.monotonic()
        while time.monotonic() < begun + RECOVERY:
            look = Done(Step(done.step.who, "read", done.step.drive))
            await self.read(look)
            if look.process and not look.process["status"] & MOVING_BIT and \
                    look.process["velocity"] == 0:
                return
            await asyncio.sleep(0.005)

    async def recover(self, done):
        """Until the drive's data are good and a stop is confirmed. How long that took."""
        begun = time.monotonic()
        stop = Step(done.step.who, "command", done.step.drive, "stop", place=done.step.place)
        while time.monotonic() < begun + RECOVERY:
            look = Done(Step(done.step.who, "read", done.step.drive, place=done.step.place))
            await self.read(look)
            # One sign of a restart leaves it open where positions are counted from, until somebody decides that.
            if look.process and (look.process["quality"] == QUALITY_GOOD or
                                 look.process["trouble"] == MAY_HAVE_RESTARTED):
                last = Done(stop)
                await self.attempt(last, *self.request_of(stop))
                if last.attempts[-1].code == 0:
                    done.seconds = time.monotonic() - begun
                    return
            await asyncio.sleep(0.005)

    def _process(self, words):
        values = {}
        for name in ("axis_state", "status", "quality", "age_ms", "position", "velocity",
                     "trouble", "poll_interval_ms"):
            row = self.layout.row(name)
            raw = struct.pack(f">{row.size}H", *words[row.address:row.address + row.size])
            kind = {"u16": ">H", "bits32": ">I", "u32": ">I", "i32": ">i", "f32": ">f"}[row.type]
            values[name] = struct.unpack(kind, raw)[0]
        return values

    async def client_step(self, step):
        done = Done(step)
        self.record.done.append(done)
        if step.do in ("read", "recover", "rest"):
            await {"read": self.read, "recover": self.recover, "rest": self.rest}[step.do](done)
            return
        if step.do in ("stage", "flood"):
            await (self.stage(done) if step.do == "stage" else self.flood(step))
            return
        unit, pdu = self.request_of(step)
        if step.chase:
            await self.chase(done, unit, pdu)
        else:
            await self.attempt(done, unit, pdu, step.cut)
        for _ in range(step.again):
            await self.attempt(done, unit, pdu)
        if step.look:
            await self.look(done)

    async def stage(self, done):
        first, words = self.layout.arguments(done.step)
        if await self.attempt(done, done.step.drive, modbus.write(first, words)):
            code = self.layout.codes[done.step.name]
            await self.attempt(done, done.step.drive, modbus.write_single(
                self.layout.at("staged_command"), code))

    # --- what the world does

    async def world_step(self, step):
        await asyncio.sleep(step.delay / 1000)
        deed = Deed(step, time.monotonic())
        self.record.deeds.append(deed)
        simulated = self.family.resource[step.drive][0]
        if step.do == "fault":
            await asyncio.to_thread(self.bridge.sim.fault, step.name, simulated)
        elif step.do in ("power", "silence"):
            begin, end = (("power {} off", "power {} on") if step.do == "power" else
                          ("fault {} silence on", "fault {} silence off"))
            await asyncio.to_thread(self.bridge.sim.control, begin.format(simulated))
            deed.begun = time.monotonic()
            await asyncio.sleep(step.gap / 1000)
            deed.ended = time.monotonic()
            await asyncio.to_thread(self.bridge.sim.control, end.format(simulated))
            return
        elif step.do == "control":
            await asyncio.to_thread(self.bridge.sim.control, step.name)
            if step.undo:
                await asyncio.sleep(step.gap / 1000)
                await asyncio.to_thread(self.bridge.sim.control, step.undo)
        elif step.do == "clock":
            await asyncio.to_thread(self.step_clock, int(step.name))
        elif step.do == "link":
            await asyncio.to_thread(self.cut_link, step)
        elif step.do == "port":
            await asyncio.to_thread(self.unplug, step)
        elif step.do == "disk":
            await self.restart(self.kill_bridge, full_disk=not step.undo)
        elif step.do == "kill":
            await self.restart(self.kill_bridge)
        elif step.do == "restart":
            await self.restart(self.terminate_bridge)
        else:
            await asyncio.to_thread(self.reload, step)
        deed.ended = time.monotonic()

    async def restart(self, end, full_disk=False):
        self.running.clear()
        await asyncio.to_thread(end)
        await asyncio.to_thread(self.start_full if full_disk else self.bridge.start_bridge)
        self.running.set()

    def start_full(self):
        """The bridge, with a log for which there is no room: its port is found in the kernel."""
        with open("/dev/full", "ab") as log, ahead_of_tests():
            self.bridge.process = subprocess.Popen(
                [find_program("drivebridged"), "--config", self.bridge.config_path],
                stdout=log, stderr=log)
        self.bridge.port = eventually(lambda: listening_port(self.bridge.process.pid),
                                      what="the bridge to listen")

    def unplug(self, step):
        """The port goes with what is behind it, and comes back."""
        self.end_sim()
        time.sleep(step.gap / 1000)
        self.start_sim()

    def cut_link(self, step):
        """The interface of the kernel goes down, or away, and comes back."""
        from kernellib import Link  # pylint: disable=import-outside-toplevel

        link = Link(self.history.settings["interface"])
        (link.down if step.name == "down" else link.delete)()
        time.sleep(step.gap / 1000)
        (link.up if step.name == "down" else link.add)()
        self.end_sim()
        self.start_sim()

    def step_clock(self, seconds):
        """The time of day jumps; the bridge's timestamps follow."""
        time.clock_settime(time.CLOCK_REALTIME, time.time() + seconds)
        unit = self.bridge.connect(1)
        try:
            eventually(lambda: abs(unit.read("timestamp_us") / 1e6 - time.time()) < 1, 3,
                       "timestamps to follow the clock")
        finally:
            unit.close()

    def end_sim(self):
        if self.bridge.sim.process.poll() is None:
            self.bridge.sim.stop()
        self.earlier += self.reader.read(self.bridge.sim.trace_path)

    def start_sim(self):
        self.bridge.sim.start()
        now = time.monotonic()
        self.earlier += [Event(now, drive, POWER) for drive in self.family.resource]

    def kill_bridge(self):
        self.bridge.units.clear()
        self.bridge.process.kill()
        self.bridge.process.wait(5)

    def terminate_bridge(self):
        status = self.bridge.stop_bridge()
        if status != 0:
            self.record.problems.append(f"drivebridged ended with {status} on SIGTERM")

    def reload(self, step):
        """A drive whose section changed goes and comes back."""
        if step.do == "change":
            self.changes += 1
            keys = self.bridge.sections[f"drive drive{step.drive}"]
            keys["min-position"] = -1000000000 - self.changes
        self.bridge.reload()

    # --- the whole

    async def actor(self, who):
        steps = [step for step in self.history.steps if step.who == who]
        for step in steps:
            await self.turn(step)
            if step.gap and who != WORLD:
                await asyncio.sleep(step.gap / 1000)
            if who == WORLD:
                await self.world_step(step)
            else:
                await self.client_step(step)
            async with self.moved_on:
                self.open_steps.pop(id(step))
                self.moved_on.notify_all()

    async def turn(self, step):
        order = self.order[id(step)]
        async with self.moved_on:
            await self.moved_on.wait_for(
                lambda: min(self.open_steps.values()) > order - self.window)

    async def begin(self):
        """All motors powered."""
        for drive in range(1, self.family.drives + 1):
            address = self.layout.at("command")
            request = modbus.write_single(address, self.layout.codes["enable"])
            await self.insist(drive, request)

    async def end(self):
        """What was accepted ends, and every motor stands."""
        await self.running.wait()
        for simulated in {name for name, _ in self.family.resource.values()}:
            await asyncio.to_thread(self.bridge.sim.control, f"fault {simulated} none")
        await self.insist(255, modbus.write_single(self.layout.at("group_stop", "gateway"),
                                                   GROUP_STOP))

    async def insist(self, unit, request):
        """The first request behind a restart finds the old connection closed."""
        try:
            await self.links[0].ask(unit, request, PATIENCE)
        except modbus.Lost:
            await self.links[0].ask(unit, request, PATIENCE)

    async def play(self):
        self.order = {id(step): place for place, step in enumerate(self.history.steps)}
        self.open_steps = dict(self.order)
        self.running.set()
        await self.begin()
        async with asyncio.TaskGroup() as group:
            for who in (WORLD, *range(CLIENTS)):
                group.create_task(self.actor(who))
        await self.end()
        self.record.ended = time.monotonic()
        for link in self.links:
            link.close()

    def run(self):
        try:
            self.bridge.start()
            self.bridge.wait_online = False  # after a restart nobody waits for it
            asyncio.run(self.play())
        except* (modbus.Lost, modbus.Silent, AssertionError, OSError) as errors:
            for error in errors.exceptions:
                self.record.problems.append(f"{type(error).__name__} {error}")
        finally:
            self.record.problems += self.bridge.finish()
        self.record.events = self.earlier + self.reader.read(self.bridge.sim.trace_path)
        return self.record
