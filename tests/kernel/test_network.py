# SPDX-License-Identifier: Apache-2.0
"""Modbus clients of another machine, which is a network of its own in the same kernel: no socket of theirs is on this
one. End-to-end tests elsewhere have the loopback only, where every client has a user."""

import os
import signal
import struct
import subprocess
import sys

import pytest
from bridgelib import eventually
from kernellib import run

GATEWAY, PLC = "10.99.0.1", "10.99.0.2"
ENABLE = struct.pack(">BHH", 6, 101, 1)  # `command`
CLIENT = """
import socket, struct, sys
s = socket.create_connection((sys.argv[1], int(sys.argv[2])), timeout=20)
pdu = bytes.fromhex(sys.argv[3])
s.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu)
if sys.argv[4:] != ["leave"]:
    try:
        print(s.recv(300)[7:].hex())
    except ConnectionError:
        pass
"""


@pytest.fixture
def plc():
    """What stands before a command that is to run on the other machine."""
    other = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
    enter = ["nsenter", "--net", "--target", other.pid]
    try:
        eventually(lambda: os.readlink(f"/proc/{other.pid}/ns/net") != os.readlink("/proc/self/ns/net"))
        run("ip", "link", "add", "here", "type", "veth", "peer", "name", "there", "netns", other.pid)
        run("ip", "address", "add", f"{GATEWAY}/24", "dev", "here")
        run("ip", "link", "set", "here", "up")
        run(*enter, "ip", "address", "add", f"{PLC}/24", "dev", "there")
        run(*enter, "ip", "link", "set", "there", "up")
        yield enter
    finally:
        other.terminate()
        other.wait()


@pytest.fixture
def bridge(make_bridge):
    return make_bridge(modbus={"listen": "0.0.0.0:0", "allow-write": [GATEWAY, PLC]})


def ask(bridge, *before, pdu=ENABLE, after=()):
    """What a client at the address of the network is answered; "": it is disconnected."""
    return run(*before, sys.executable, "-c", CLIENT, GATEWAY, bridge.port, pdu.hex(), *after).stdout.strip()


NOBODY = ("setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups")


@pytest.mark.parametrize("bind_to_any", [0, 1])
def test_a_client_of_another_machine_has_the_rights_of_its_address(plc, bridge, bind_to_any):
    """Whatever its user there is; also where sockets can be bound to foreign addresses."""
    path = "/proc/sys/net/ipv4/ip_nonlocal_bind"
    with open(path, "w", encoding="ascii") as switch:
        switch.write(str(bind_to_any))
    try:
        assert ask(bridge, *plc, *NOBODY) == ENABLE.hex()
    finally:
        with open(path, "w", encoding="ascii") as switch:
            switch.write("0")
    assert bridge.drive().read("history1_address") == PLC


def test_a_user_of_this_machine_at_its_address_of_the_network(plc, bridge):
    mark = bridge.sim.mark()
    assert ask(bridge, *NOBODY) == "8601"
    bridge.told(f"client {GATEWAY}, user nobody: connected")
    # One that has left before it is asked about.
    bridge.process.send_signal(signal.SIGSTOP)
    try:
        assert ask(bridge, *NOBODY, after=["leave"]) == ""
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    bridge.told(f"client {GATEWAY}, user unknown: connected")
    assert ask(bridge) == ENABLE.hex()
    assert bridge.drive().read("history1_address") == f"{GATEWAY}, user root"
    assert bridge.sim.sent(mark).count("1 ena") == 1


READ = struct.pack(">BHH", 3, 0, 1)


def test_the_network_needs_certificates(plc, bridge):
    """Who is refused has not moved anything; programs of the gateway are known without."""
    mark = bridge.sim.mark()
    bridge.sections["modbus"]["require-secure"] = "writes"
    bridge.reload()
    assert ask(bridge, *plc) == "8601"
    assert ask(bridge, *plc, pdu=READ).startswith("0302")
    bridge.told(f"client {PLC}: refused: it has no certificate (require-secure)")
    assert ask(bridge) == ENABLE.hex()
    bridge.sections["modbus"]["require-secure"] = "all"
    bridge.reload()
    assert ask(bridge, *plc, pdu=READ) == ""
    assert ask(bridge) == ENABLE.hex()
    assert bridge.sim.sent(mark).count("1 ena") == 2
