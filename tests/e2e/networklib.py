# SPDX-License-Identifier: Apache-2.0
"""Random histories of a bad network between a page and its gateway: connections that are delayed (each by another time,
so that beats overtake each other), held up and then let go at once, cut without a word, and reset; with buttons that are
pressed and released at random moments. Whatever comes of it, a drive begins and goes on only as long as somebody may still
want it. What drives did is read off the simulated bus."""

import asyncio
import contextlib
import http.client
import json
import random
import re
import threading
import time

from bridgelib import eventually
from weblib import OPERATOR, Failed, Page

SPEED = 3200.0
# A token is too old after this (the service's limit), and a motion without beats is stopped after this, s.
FRESH, HELD = 0.5, 0.3
# From the service's decision to a stand: the bus's cycle, the ramp; and how late the simulator's clock may be, s.
RAMP = 0.15
BEAT_EVERY = 0.1
CONNECTIONS = 3


class Faults:
    """What the network does from when to when, in seconds of time.monotonic(): [(from, to, place, kind, parameter)]. Place:
    the connection's number modulo CONNECTIONS + 1; the last one is the stream with the tokens."""

    def __init__(self, chance, begin):
        self.windows = []
        for _ in range(chance.randint(1, 5)):
            at = begin + chance.uniform(0, 1.6)
            kind = chance.choice(["delay", "delay", "hold", "loss", "reset"])
            span = chance.uniform(0.05, 1.2)
            self.windows.append((at, at + span, chance.randrange(CONNECTIONS + 1), kind, chance.uniform(0.05, 1.0)))
        self.end = max(end for _, end, *_ in self.windows) + 1.0

    def now(self, place):
        moment = time.monotonic()
        return next((window for window in self.windows if window[0] <= moment < window[1] and window[2] == place), None)


class Network:
    """A relay with faults, in a thread of its own."""

    def __init__(self, address):
        self.far = address
        self.faults = None
        self.count = 0
        self.writers = set()
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.ready = threading.Event()
        self.thread.start()
        assert self.ready.wait(10)

    def _run(self):
        async def listen():
            self.server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
            self.port = self.server.sockets[0].getsockname()[1]
            self.ready.set()

        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(listen())
        self.loop.run_forever()

    def close(self):
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(10)
        for writer in self.writers:
            with contextlib.suppress(OSError):
                writer.transport.abort()
        self.server.close()
        for task in asyncio.all_tasks(self.loop):
            task.cancel()
        self.loop.run_until_complete(asyncio.sleep(0))
        self.loop.close()

    async def _serve(self, reader, writer):
        # Which connection it is shows in its first bytes.
        first = await reader.read(65536)
        found = re.search(rb"X-Place: (\d)", first)
        place = int(found[1]) if found else CONNECTIONS
        try:
            far_reader, far_writer = await asyncio.open_connection(*self.far)
        except OSError:
            writer.transport.abort()
            return
        self.writers |= {writer, far_writer}
        await asyncio.gather(self._carry(place, reader, far_writer, first), self._carry(place, far_reader, writer, b""),
                             return_exceptions=True)
        for one in (writer, far_writer):
            with contextlib.suppress(OSError):
                one.transport.abort()
        self.writers -= {writer, far_writer}

    async def _carry(self, place, reader, writer, data):
        """In order, each piece when the network lets it go."""
        while True:
            data = data or await reader.read(65536)
            if not data:
                break
            window = self.faults.now(place) if self.faults else None
            if window:
                _, end, _, kind, parameter = window
                if kind == "reset":
                    break
                if kind == "loss":
                    # It is gone, and the connection says so only much later.
                    await asyncio.sleep(max(0.0, end - time.monotonic()))
                    break
                await asyncio.sleep(parameter if kind == "delay" else max(0.0, end - time.monotonic()))
            writer.write(data)
            await writer.drain()
            data = b""
        for one in (writer,):
            one.transport.abort()
        raise ConnectionResetError


def moment_of(token):
    """When the service made it, by time.monotonic()."""
    made = int(token.rsplit("-", 1)[1]) / 1000
    return made - time.clock_gettime(time.CLOCK_BOOTTIME) + time.monotonic()


class Finger:
    """A press of a button as a page sends it: a beat each 100 ms over whichever connection is free, until it is released."""

    def __init__(self, hand, body):
        hand.grip += 1
        self.hand = hand
        self.body = {**body, "grip": hand.grip}
        self.beats = 0
        self.known = False
        self.over = False

    def beat(self, held):
        self.beats += 1
        token = self.hand.token if held else ""
        body = {**self.body, "beat": self.beats, "token": token}
        if "steps" in body:
            path = "/api/sequence"
            body["held"] = held
            if self.known:
                del body["steps"]
        else:
            path = "/api/jog"
            body["velocity"] = SPEED if held else 0
        if held and token:
            self.hand.wishes.append(moment_of(token))
        self.hand.post(path, body, self)


class Hand:
    """A page behind the network."""

    def __init__(self, webd, network):
        self.page = Page(webd, OPERATOR)
        self.network = network
        self.grip = 0
        self.token = ""
        self.wishes = []  # when the tokens of held beats were made
        self.free = list(range(CONNECTIONS))
        self.lock = threading.Lock()
        self.ended = False
        self.threads = []
        self.streamer = threading.Thread(target=self._stream, daemon=True)
        self.streamer.start()

    def close(self):
        self.ended = True
        self.streamer.join(10)
        self.page.close()

    def _stream(self):
        """The overview, for its tokens; begun again when it ends."""
        while not self.ended:
            connection = http.client.HTTPConnection("127.0.0.1", self.network.port, timeout=2)
            try:
                connection.request("POST", "/api/stream/overview", "{}", self.page.headers(X_Place=str(CONNECTIONS)))
                response = connection.getresponse()
                while not self.ended and (line := response.readline()):
                    if line.startswith(b"data: ") and b'"token"' in line:
                        token = json.loads(line[6:]).get("token")
                        self.token = token if isinstance(token, str) else self.token
            except (OSError, ValueError, http.client.HTTPException):
                pass
            connection.close()

    def post(self, path, body, finger):
        with self.lock:
            place = self.free.pop(0) if self.free else None
        if place is None:
            return

        def send():
            connection = http.client.HTTPConnection("127.0.0.1", self.network.port, timeout=2)
            try:
                connection.request("POST", path, json.dumps(body), self.page.headers(X_Place=str(place)))
                answer = json.loads(connection.getresponse().read())
                finger.known = True
                finger.over = finger.over or not answer.get("held")
            except (OSError, ValueError, http.client.HTTPException, Failed):
                pass
            connection.close()
            with self.lock:
                self.free.append(place)

        thread = threading.Thread(target=send, daemon=True)
        self.threads.append(thread)
        thread.start()

    def wait(self):
        for thread in self.threads:
            thread.join(10)
        self.threads.clear()


class Bus:
    """What the drives did: intervals of motion, [(drive, began, ended)], of what came since the last look."""

    def __init__(self, bridge):
        self.file = open(bridge.sim.trace_path, encoding="utf-8")
        self.file.seek(0, 2)
        self.since = {}

    def close(self):
        self.file.close()

    def look(self):
        found = []
        for line in self.file:
            match = re.match(r"(\d+) (drive\d) ! (?:obeyed \d+ (mov|pos|stp)|(stands))", line)
            if not match:
                continue
            moment, drive, what = int(match[1]) / 1e6, match[2], match[3] or match[4]
            if what in ("mov", "pos"):
                # To where it stands it does not move.
                if "moving=1" in line:
                    self.since.setdefault(drive, moment)
            elif what == "stands" and drive in self.since:
                found.append((drive, self.since.pop(drive), moment))
        return found


def judge(motions, wishes, patience):
    """What is wrong with these motions."""
    wrong = []
    for drive, began, ended in motions:
        if not any(wish - 0.02 <= began <= wish + FRESH + patience for wish in wishes):
            wrong.append(f"{drive} began at {began:.3f}, and no wish was younger than {FRESH} s: "
                         f"{[round(began - wish, 3) for wish in wishes][-8:]}")
        last = max((wish for wish in wishes if wish <= ended), default=float("-inf"))
        if ended > last + FRESH + HELD + RAMP + patience:
            wrong.append(f"{drive} stood only {ended - last:.3f} s after the last wish was made")
    return wrong


class Histories:
    """`bridge` has drive1 and drive2 with the positions near and far; both are enabled."""

    def __init__(self, bridge, webd):
        self.bridge, self.webd = bridge, webd
        self.network = Network(webd.address)
        self.hand = Hand(webd, self.network)
        self.bus = Bus(bridge)
        self.motions = self.presses = 0
        self.latest = 0.0
        eventually(lambda: self.hand.token, what="a token to come through the network")

    def close(self):
        self.hand.close()
        self.network.close()
        self.bus.close()

    def run(self, seed, patience=0.0):
        """One history; what was wrong with it."""
        chance = random.Random(seed)
        begin = time.monotonic()
        faults = Faults(chance, begin)
        plan, at = [], begin
        while len(plan) < chance.randint(1, 3):
            at += chance.uniform(0.05, 0.5)
            to = at + chance.uniform(0.05, 0.9)
            plan.append((at, to, chance.choice(["jog", "sequence"])))
            at = to
        self.hand.wishes.clear()
        self.network.faults = faults
        for press, release, kind in plan:
            self._sleep_until(press)
            finger = Finger(self.hand, {"drive": "drive1"} if kind == "jog" else {"steps": [
                {"drive": "drive1", "position": chance.choice(["near", "far"]), "velocity": SPEED, "wait_ms": 50},
                {"drive": "drive2", "position": chance.choice(["near", "far"]), "velocity": SPEED, "wait_ms": 50}] * 3})
            self.presses += 1
            while time.monotonic() < release and not finger.over:
                finger.beat(True)
                self._sleep_until(min(release, time.monotonic() + BEAT_EVERY))
            finger.beat(False)
        # All that the network still keeps comes, and moves nothing.
        self._sleep_until(faults.end)
        self.network.faults = None
        self.hand.wait()
        eventually(lambda: all(self.bridge.sim.get(drive)["velocity"] == 0 for drive in ("drive1", "drive2")))
        motions = self.bus.look()
        self.motions += len(motions)
        for _, _, ended in motions:
            last = max((wish for wish in self.hand.wishes if wish <= ended), default=ended)
            self.latest = max(self.latest, ended - last)
        wrong = judge(motions, self.hand.wishes, patience)
        if self.bus.since:
            wrong.append(f"not known to stand: {self.bus.since}")
        return wrong

    @staticmethod
    def _sleep_until(moment):
        left = moment - time.monotonic()
        if left > 0:
            time.sleep(left)
