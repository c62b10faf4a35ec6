#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What certificates cost a PLC: reads over port 502 and over TLS, side by side, alone and beside strangers.

Usage: tls.py [BUILD_DIR [SECONDS]]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs the tests' Python packages (build/venv/bin/python).
One client reads 20 registers over each in turn, 100 times a second, so that what else the machine does is in both. Beside
it nothing; 60 clients with certificates that read once a second each; strangers who begin greetings and do not go on;
strangers who greet as fast as they can, and have no certificate. Prints percentiles in ms, and what drivebridge-tls
takes of memory and processor.
"""
import os
import socket
import ssl
import struct
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, load_commands  # noqa: E402
from cryptography.x509.oid import ExtendedKeyUsageOID  # noqa: E402
from tlslib import Authority, Tlsd, utf8  # noqa: E402
from weblib import memory_kib  # noqa: E402

SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
READ = struct.pack(">BHH", 3, 0, 20)
PLC, OTHERS = "127.0.0.9", ["127.0.0.2", "127.0.0.3", "127.0.0.4"]
HELLO = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"


class Strangers(threading.Thread):
    """Does something again and again until it is ended."""

    def __init__(self, act):
        super().__init__(daemon=True)
        self.act, self.ending, self.count = act, threading.Event(), 0

    def run(self):
        while not self.ending.is_set():
            try:
                self.act()
                self.count += 1
            except OSError:
                pass

    def end(self):
        self.ending.set()
        self.join(10)


def percentile(times, part):
    return sorted(times)[min(int(len(times) * part), len(times) - 1)] * 1000


def measure(plain, secure):
    times = {"502": [], "802": []}
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        for name, client in (("502", plain), ("802", secure)):
            begun = time.monotonic()
            assert client.request(READ)[0] == 3
            times[name].append(time.monotonic() - begun)
            time.sleep(0.005)
    return times


def report(what, times, tlsd, cpu):
    line = "  ".join(f"{name}: {percentile(of, 0.5):6.3f} {percentile(of, 0.99):6.3f} {percentile(of, 0.999):6.3f}"
                     for name, of in times.items())
    print(f"{what:<42} {line}   {100 * (tlsd.cpu_s() - cpu) / SECONDS:5.1f} % of a processor", flush=True)


def main():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        authority = Authority(place)
        own = authority.issue("gateway", usage=ExtendedKeyUsageOID.SERVER_AUTH, hosts=["gateway"])
        plc, panel = authority.issue("plc", utf8("Operator")), authority.issue("panel", utf8("Reader"))
        (place / "bridge").mkdir()
        bridge = Bridge(place / "bridge", MAP, load_commands(DOCS / "commands.csv"), drives=8,
                        modbus={"secure-socket": place / "modbus", "max-clients": 128})
        bridge.sections.update({"role Operator": {"write": "all"}, "role Reader": {}})
        bridge.write_config()
        bridge.start()
        tlsd = Tlsd(place, bridge, authority, own, {"server": {"clients": 64, "clients-per-address": 30}})
        tlsd.start()
        before = memory_kib(tlsd.process)
        plain, secure = bridge.raw(PLC), tlsd.connect(plc, source=PLC)

        print(f"{'':<42} {'median, 99 %, 99.9 % in ms':<50}")
        cpu = tlsd.cpu_s()
        report("alone", measure(plain, secure), tlsd, cpu)

        others = [tlsd.connect(panel, source=OTHERS[n // 20]) for n in range(60)]
        with_others = memory_kib(tlsd.process)

        def poll():
            for other in others:
                other.request(READ)
                time.sleep(1 / len(others))

        cpu, busy = tlsd.cpu_s(), Strangers(poll)
        busy.start()
        report("60 others with certificates", measure(plain, secure), tlsd, cpu)
        busy.end()

        def begin():
            with socket.create_connection(("127.0.0.1", tlsd.port), 5, source_address=("127.0.0.5", 0)) as half:
                half.sendall(HELLO)
                time.sleep(0.002)

        cpu, halves = tlsd.cpu_s(), [Strangers(begin) for _ in range(8)]
        for half in halves:
            half.start()
        report("half greetings", measure(plain, secure), tlsd, cpu)
        for half in halves:
            half.end()
        print(f"    {sum(half.count for half in halves) / SECONDS:.0f} a second")

        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE

        def greet():
            with socket.create_connection(("127.0.0.1", tlsd.port), 5, source_address=("127.0.0.6", 0)) as bare:
                with context.wrap_socket(bare) as stranger:
                    stranger.recv(1)

        cpu, greetings = tlsd.cpu_s(), [Strangers(greet) for _ in range(8)]
        for one in greetings:
            one.start()
        report("greetings without a certificate", measure(plain, secure), tlsd, cpu)
        for one in greetings:
            one.end()

        print(f"memory: {before / 1024:.1f} MiB at first, {with_others / 1024:.1f} MiB with 61 clients, "
              f"{(with_others - before) / 61:.1f} KiB each")
        problems = tlsd.finish() + bridge.finish()
        assert not problems, problems


if __name__ == "__main__":
    main()
