#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a fleet of gateways with Sparkplug is to its broker.

Usage: fleet.py [--build BUILD_DIR] [--gateways N] [--drives N] [--moving N] [--seconds S] [--away S] [--pair]

One real gateway is recorded first: a bridge with simulated drives, drivebridge-mqtt with payload = sparkplug, once with
all drives moving and once standing. Its births, data and death are then published by N connections with names of their own,
each over a socket of its own with a will, at the recorded rate; so each byte is what a gateway sends, but for names and
numbers. One subscriber has everything, as a host application has. Measured: messages and bytes a second, processor time and
memory of the broker, a restart of the broker with all births, with and without spread, and a host that is away for a while.
--pair: the gateways are half at one broker and half at another one, which is bridged to it.
"""
import argparse
import asyncio
import multiprocessing
import os
import random
import signal
import socket
import struct
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
arguments = argparse.ArgumentParser()
arguments.add_argument("--build", default=HERE.parents[1] / "build" / "gcc", type=Path)
arguments.add_argument("--gateways", default=200, type=int)
arguments.add_argument("--drives", default=32, type=int)
arguments.add_argument("--moving", default=32, type=int, help="of each gateway's drives")
arguments.add_argument("--seconds", default=20, type=float)
arguments.add_argument("--away", default=0, type=float, help="seconds that the host is away")
arguments.add_argument("--spreads", default="0,10")
arguments.add_argument("--pair", action="store_true")
WISH = arguments.parse_args()
os.environ["DRIVEBRIDGE_BUILD"] = str(WISH.build.resolve())
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, load_commands  # noqa: E402
from mqttlib import Broker, Publisher  # noqa: E402
from process import memory_mib, processor_seconds  # noqa: E402
from sparkpluglib import Host, Payload  # noqa: E402

NAME = "gw"


# --- recording -------------------------------------------------------------------------------------------------------


def record(place, broker):
    """Births in their order, and the data of `seconds` with their moments, of one gateway."""
    bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=WISH.drives)
    bridge.start()
    host = Host(broker)
    raw = []
    follow = host.client.on_message
    host.client.on_message = lambda client, data, message: (
        raw.append((time.monotonic(), message.topic, message.payload)), follow(client, data, message))
    gateway = Publisher(place, bridge, broker, publish={"payload": "sparkplug", "interval-ms": 1000}).start()
    for number in range(1, WISH.drives + 1):
        host.wait_for("DBIRTH", f"drive{number}", timeout=60)
    # The last complete sequence of births.
    first = max(i for i, one in enumerate(raw) if "/NBIRTH/" in one[1])
    births = [one for one in raw[first:] if "BIRTH/" in one[1]]
    for number in range(1, WISH.moving + 1):
        unit = bridge.drive(number)
        unit.write("watchdog_ms", 0)
        unit.command("enable")
        unit.command("move_velocity", target_velocity=200.0)
    time.sleep(3)
    begin, start = len(raw), time.monotonic()
    time.sleep(20)
    data = [(at - start, topic, payload) for at, topic, payload in raw[begin:] if "DATA/" in topic]
    assert not host.problems, host.problems
    gateway.stop()
    host.close()
    bridge.finish()
    return [(topic, payload) for _, topic, payload in births], data


def split(payload):
    """The metrics of a payload, without its time and number, which are put in front for each gateway."""
    read = Payload.FromString(payload)
    read.ClearField("timestamp")
    read.ClearField("seq")
    return read.SerializeToString()


# --- gateways --------------------------------------------------------------------------------------------------------


def text(data):
    return struct.pack(">H", len(data)) + data


def packet(kind, body):
    length, sizes = len(body), b""
    while True:
        sizes += bytes([length & 0x7F | (0x80 if length > 0x7F else 0)])
        length >>= 7
        if not length:
            return bytes([kind]) + sizes + body


def death(number):
    made = Payload(timestamp=int(time.time() * 1000))
    made.metrics.add(name="bdSeq", timestamp=made.timestamp, datatype=4, long_value=number)
    return made.SerializeToString()


class Gateway:
    """A connection that sends what the recorded gateway sent. Counts its own messages."""

    def __init__(self, number, address, births, data, period):
        self.name = f"{NAME}{number:04}"
        self.address, self.births, self.data, self.period = address, births, data, period
        self.shift = random.uniform(0, period)
        self.seq = self.sent = self.sessions = self.size = 0
        self.spread = 0.0
        self.born_at = 0.0

    def topic(self, topic):
        return topic.replace(f"/{NAME}", f"/{self.name}", 1)

    def message(self, topic, metrics):
        head = Payload(timestamp=int(time.time() * 1000), seq=self.seq).SerializeToString()
        self.seq = (self.seq + 1) % 256
        body = text(self.topic(topic).encode()) + b"\0" + head + metrics
        self.sent += 1
        self.size += len(body)
        return packet(0x30, body)

    async def connect(self):
        reader, writer = await asyncio.open_connection(*self.address)
        will = text(f"spBv1.0/drivebridge/NDEATH/{self.name}".encode()) + text(death(self.sessions % 256))
        # The properties of connection and will are empty; a will of quality of service 1.
        body = text(b"MQTT") + bytes([5, 0x0E]) + struct.pack(">H", 60) + b"\0" + text(self.name.encode()) + b"\0" + will
        writer.write(packet(0x10, body))
        assert (await reader.readexactly(2))[0] == 0x20
        self.sessions += 1
        body = struct.pack(">H", 1) + b"\0" + text(f"spBv1.0/drivebridge/NCMD/{self.name}".encode()) + b"\1"
        writer.write(packet(0x82, body))
        self.seq = 0
        for topic, metrics in self.births:
            writer.write(self.message(topic, metrics))
        await writer.drain()
        self.born_at = time.monotonic()
        return reader, writer

    async def drop(self, reader):
        while await reader.read(65536):
            pass
        raise ConnectionError

    async def publish(self, writer):
        start = time.monotonic() - self.shift
        while True:
            for at, topic, metrics in self.data:
                late = start + at - time.monotonic()
                if late > 0:
                    await asyncio.sleep(late)
                elif late < -0.5:
                    continue  # of a moment before this connection
                writer.write(self.message(topic, metrics))
                await writer.drain()
            start += self.period

    async def live(self):
        tries = 0
        while True:
            try:
                reader, writer = await self.connect()
                tries = 0
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(self.drop(reader))
                    tasks.create_task(self.publish(writer))
            except* (OSError, EOFError, AssertionError):
                pass
            # As drivebridge-mqtt waits: 1 s at first, and half of that at random; then twice as long.
            wait = min(2 ** tries, 60)
            await asyncio.sleep(wait + random.uniform(0, wait / 2) + (random.uniform(0, self.spread) if not tries else 0))
            tries += 1


def read_all(address, counts):
    """A host, as a process of its own: counts births of nodes and devices, other messages, and bytes; asks nothing."""
    line = socket.create_connection(address)
    line.sendall(packet(0x10, text(b"MQTT") + bytes([5, 2]) + struct.pack(">H", 0) + b"\0" + text(b"host")))
    line.recv(256)
    line.sendall(packet(0x82, struct.pack(">H", 1) + b"\0" + text(b"spBv1.0/#") + b"\0"))
    buffer = b""
    while True:
        more = line.recv(1 << 20)
        if not more:
            return
        buffer += more
        at = 0
        while len(buffer) - at >= 5:
            length, shift, head = 0, 0, at + 1
            while True:
                byte = buffer[head]
                length |= (byte & 0x7F) << shift
                shift, head = shift + 7, head + 1
                if byte < 0x80:
                    break
            if len(buffer) < head + length:
                break
            if buffer[at] & 0xF0 == 0x30:
                kind = buffer[head + 2:head + 60].split(b"/")[2]
                counts[0 if kind == b"NBIRTH" else 1 if kind == b"DBIRTH" else 2] += 1
                counts[3] += length
            at = head + length
        buffer = buffer[at:]


class Reader:
    def __init__(self, address):
        self.address = address
        self.counts = multiprocessing.Array("q", 4, lock=False)
        self.process = None

    async def connect(self):
        for place in range(4):
            self.counts[place] = 0
        self.process = multiprocessing.Process(target=read_all, args=(self.address, self.counts), daemon=True)
        self.process.start()

    @property
    def messages(self):
        return sum(self.counts[:3])

    @property
    def births(self):
        return sum(self.counts[:2])

    async def close(self):
        self.process.kill()
        self.process.join()


def show(title, **values):
    print(f"{title:34} " + "  ".join(f"{key.replace('_', ' ')} {value}" for key, value in values.items()), flush=True)


class Fleet:
    def __init__(self, place, brokers, births, data):
        period = 20.0
        self.place, self.brokers = place, brokers
        self.gateways = [Gateway(number, (brokers[number % len(brokers)].host, brokers[number % len(brokers)].port),
                                 births, data, period) for number in range(WISH.gateways)]
        self.reader = Reader((brokers[0].host, brokers[0].port))

    def totals(self):
        return (sum(one.sent for one in self.gateways), sum(one.size for one in self.gateways),
                self.reader.messages, sum(processor_seconds(one.process.pid) for one in self.brokers),
                time.monotonic())

    async def steady(self, title, seconds):
        before = self.totals()
        await asyncio.sleep(seconds)
        sent, size, got, used, passed = (b - a for a, b in zip(before, self.totals(), strict=True))
        show(title, messages_a_second=f"{sent / passed:.0f}", kB_a_second=f"{size / passed / 1000:.0f}",
             at_the_host=f"{got / passed:.0f}", broker_cpu=f"{100 * used / passed:.1f} %",
             broker_MiB=f"{sum(memory_mib(one.process.pid) for one in self.brokers):.1f}")

    async def births(self, title, begun, least):
        """Until all gateways are there again."""
        most, last_count, last_at = 0.0, 0, time.monotonic()
        while sum(one.sessions >= least for one in self.gateways) < len(self.gateways):
            await asyncio.sleep(0.25)
            count, now = self.reader.messages, time.monotonic()
            most = max(most, (count - last_count) / (now - last_at))
            last_count, last_at = count, now
            assert now - begun < 120, "births take too long"
        await asyncio.sleep(2)
        show(title, all_born_after=f"{max(one.born_at for one in self.gateways) - begun:.1f} s",
             most_messages_a_second=f"{most:.0f}",
             births=self.reader.births)

    async def restart(self, spread):
        least = max(one.sessions for one in self.gateways) + 1
        for one in self.gateways:
            one.spread = spread
        broker = self.brokers[0]
        here = [one for one in self.gateways if one.address == (broker.host, broker.port)]
        broker.stop(signal.SIGKILL)
        await asyncio.sleep(0.2)
        for one in self.gateways:
            if one not in here:
                one.sessions = least
        begun = time.monotonic()
        used = 0.0
        await asyncio.to_thread(broker.start)
        await self.reader.close()
        await self.reader.connect()
        await self.births(f"broker killed, spread {spread:g} s", begun, least)
        used = processor_seconds(broker.process.pid)
        show("", broker_cpu_seconds=f"{used:.2f}", at=f"{time.monotonic() - begun:.1f} s")

    async def away(self, seconds):
        await self.reader.close()
        await self.steady(f"the host is away for {seconds:g} s", seconds)
        begun = time.monotonic()
        await self.reader.connect()
        await asyncio.sleep(2)
        show("it comes back", messages_in_2_s=self.reader.messages,
             births_without_being_asked=self.reader.births, after=f"{time.monotonic() - begun:.1f} s")

    async def run(self):
        begun = time.monotonic()
        await self.reader.connect()
        lives = [asyncio.create_task(one.live()) for one in self.gateways]
        await self.births("all gateways connect at once", begun, 1)
        await asyncio.sleep(5)
        await self.steady(f"{WISH.gateways} gateways", WISH.seconds)
        for spread in WISH.spreads.split(",") if WISH.spreads else ():
            await self.restart(float(spread))
            await asyncio.sleep(3)
        if WISH.away:
            await self.away(WISH.away)
        for one in lives:
            one.cancel()
        await asyncio.gather(*lives, return_exceptions=True)


def main():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        (place / "bridge").mkdir()
        limits = "max_queued_messages 0\nset_tcp_nodelay true"
        first = Broker(place / "broker", limits).start()
        births, data = record(place / "bridge", first)
        size = sum(len(topic) + len(payload) for topic, payload in births)
        show("one gateway", births=len(births), bytes_of_them=size, data_a_second=f"{len(data) / 20:.1f}",
             bytes_a_second=f"{sum(len(t) + len(p) for _, t, p in data) / 20:.0f}", drives=WISH.drives, moving=WISH.moving)
        brokers = [first]
        if WISH.pair:
            bridge = f"connection pair\naddress {first.host}:{first.port}\ntopic spBv1.0/# out 1\nnotifications false"
            brokers.append(Broker(place / "second", limits + "\n" + bridge).start())
        fleet = Fleet(place, brokers, [(topic, split(payload)) for topic, payload in births],
                      [(at, topic, split(payload)) for at, topic, payload in data])
        try:
            asyncio.run(fleet.run())
        finally:
            for one in brokers:
                one.stop(signal.SIGKILL)


main()
