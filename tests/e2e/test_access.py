# SPDX-License-Identifier: Apache-2.0
"""Who may do what: places kept for writers, limits per address, who is connected, and control of a
drive by one client at a time. Several source addresses of the loopback network stand for clients."""

import os
import signal
import struct
import subprocess
import time

import pytest
from bridgelib import (
    BUSY,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    RESULT_NOT_IN_CONTROL,
    RESULT_OK,
    RESULT_UNSUPPORTED,
    Client,
    as_shown,
    eventually,
)

PLC, SECOND_PLC, HMI, OTHER_HMI = "127.0.0.2", "127.0.0.3", "127.0.0.4", "127.0.0.5"


READ = struct.pack(">BHH", 3, 0, 10)


def number_of(address):
    """As in the registers: the first byte highest."""
    return int.from_bytes(bytes(int(part) for part in address.split(".")), "big")


def gone(bridge, clients):
    """Waits until only so many are connected: closing is noticed a moment later."""
    gateway = bridge.gateway()
    eventually(lambda: gateway.read("clients") == clients, what="a connection to be gone")


# --- connections


def test_displays_never_lock_the_plc_out(make_bridge):
    bridge = make_bridge(
        modbus={"max-clients": 6, "reserved-writers": 2, "allow-write": ["127.0.0.1", PLC]},
        start_sim=False,
    )
    gateway = bridge.gateway()  # the first of them
    displays = [bridge.raw(source=HMI) for _ in range(4)]
    for display in displays:
        assert len(display.request(struct.pack(">BHH", 3, 0, 2))) == 6
    # Four of six are taken by readers: the next reader has no place, writers do.
    for _ in range(3):
        with bridge.raw(source=OTHER_HMI) as late:
            assert late.closed()
    assert gateway.read("refused_reserved") == 3
    with bridge.raw(source=PLC) as plc:
        assert len(plc.request(struct.pack(">BHH", 3, 0, 2))) == 6
        with bridge.raw(source=PLC) as more:
            assert more.closed()
    assert gateway.read("refused_full") == 1
    assert len(bridge.told(f"client {OTHER_HMI}: connection refused")) == 1
    for display in displays:
        display.close()


def test_connections_of_one_address(make_bridge):
    bridge = make_bridge(modbus={"max-clients-per-address": 2}, start_sim=False)
    first, second = bridge.raw(source=HMI), bridge.raw(source=HMI)
    for client in (first, second):
        assert len(client.request(struct.pack(">BHH", 3, 0, 2))) == 6
    with bridge.raw(source=HMI) as third:
        assert third.closed()
    with bridge.raw(source=PLC) as other:
        assert len(other.request(struct.pack(">BHH", 3, 0, 2))) == 6
    assert bridge.gateway().read("refused_per_address") == 1
    first.close()
    gone(bridge, 2)
    with bridge.raw(source=HMI) as again:
        assert len(again.request(struct.pack(">BHH", 3, 0, 2))) == 6
    second.close()


def test_too_many_requests_are_answered_later(make_bridge):
    """All of them, in order, without closing; others notice nothing."""
    rate, requests = 50, 40
    bridge = make_bridge(modbus={"max-requests-per-second": rate, "idle-timeout-s": 1},
                         wait_online=False)
    drive = Client(bridge, PLC)
    eventually(drive.online)
    with bridge.raw(source=HMI) as hasty, bridge.raw(source=HMI) as twin:
        start = time.monotonic()
        for number in range(requests):
            hasty.send(hasty.adu(number, 1, READ))
            twin.send(twin.adu(number, 1, READ))
        asked = time.monotonic()
        assert drive.online()
        assert time.monotonic() - asked < 0.5
        for number in range(requests):
            for client in (hasty, twin):
                transaction, _, pdu = client.receive()
                assert (transaction, len(pdu)) == (number, 22)
        took = time.monotonic() - start
    # A tenth of a second's worth comes at once.
    assert took >= (2 * requests - rate / 10) / rate - 0.05
    assert took < 5
    gateway = Client(bridge, SECOND_PLC, 255, "gateway")
    assert gateway.read("held_back") >= 2 * requests - rate / 10 - 2
    assert len(bridge.told(f"client {HMI}: request answered later")) == 1
    gateway.close()
    drive.close()


def test_refusals_are_logged_once(make_bridge):
    bridge = make_bridge(modbus={"allow-read": [HMI], "allow-write": ["127.0.0.1"]})
    write = struct.pack(">BHH", 6, bridge.map.find("command").address, 3)
    with bridge.raw(source=HMI) as display:
        for _ in range(20):
            assert display.request(write) == bytes([0x86, ILLEGAL_FUNCTION])
    for _ in range(20):
        with bridge.raw(source=OTHER_HMI) as stranger:
            assert stranger.closed()
    assert bridge.gateway().read("refused_writes") == 20
    assert bridge.gateway().read("refused_address") == 20
    assert len(bridge.told(f"client {HMI}: write refused")) == 1
    assert len(bridge.told(f"client {OTHER_HMI}: connection refused")) == 1
    assert len(bridge.told("refused")) == 2


def test_who_is_connected(make_bridge):
    bridge = make_bridge(modbus={"allow-write": ["127.0.0.1", PLC], "control": "drive"})
    gateway = bridge.gateway()
    bridge.drive().close()
    gone(bridge, 1)
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        assert plc.write("control_request", 1) == 0
        for _ in range(5):
            hmi.read("position")
        shown = gateway.read_many("client1_ipv4", "client3_controls")
        assert shown["client1_ipv4"] == number_of("127.0.0.1")
        assert shown["client2_ipv4"] == number_of(PLC)
        assert shown["client2_port"] == plc.port
        assert shown["client2_may_write"] == 1
        assert shown["client2_controls"] == 1
        assert shown["client3_ipv4"] == number_of(HMI)
        assert shown["client3_port"] == hmi.port
        assert shown["client3_may_write"] == 0
        assert shown["client3_requests"] == 5
        assert shown["client3_controls"] == 0
        assert shown["client3_idle_s"] <= shown["client3_connected_s"] < 60
        assert gateway.read("client4_ipv4") == 0
        assert [gateway.read(f"client{i}_address") for i in range(1, 5)] == \
            [as_shown("127.0.0.1"), as_shown(PLC), as_shown(HMI), ""]
    gone(bridge, 1)
    assert gateway.read("client2_ipv4") == 0
    assert gateway.read("client16_address") == ""


def test_a_restarted_client_has_no_past(make_bridge):
    """A limit counts connections that are there, not those that were."""
    bridge = make_bridge(modbus={"max-clients-per-address": 1, "max-clients": 3}, start_sim=False)
    for _ in range(20):
        with bridge.raw(source=PLC) as plc:
            assert len(plc.request(struct.pack(">BHH", 3, 0, 2))) == 6
        gone(bridge, 1)


# --- control


@pytest.fixture
def controlled(make_bridge):
    return make_bridge(modbus={"control": "drive", "control-timeout-ms": 5000})


def test_without_control_everybody_commands(bridge):
    with Client(bridge, PLC) as plc, Client(bridge, SECOND_PLC) as second:
        assert plc.command("enable") == 0
        assert second.command("disable") == 0
        assert plc.write("control_request", 1) == ILLEGAL_FUNCTION
        assert plc.read("write_result") == RESULT_UNSUPPORTED
        assert plc.read("control_holder") == 0


def test_the_first_writer_has_control(controlled):
    bridge = controlled
    with Client(bridge, PLC) as plc, Client(bridge, SECOND_PLC) as second:
        assert second.read("control_holder") == 0
        assert plc.command("enable") == 0
        assert plc.read("control_request") == 1
        shown = second.read_many("control_request", "control_remaining_ms")
        assert shown["control_request"] == 0
        assert shown["control_holder"] == number_of(PLC)
        assert shown["control_port"] == plc.port
        assert 0 < shown["control_remaining_ms"] <= 5000
        mark = bridge.sim.mark()
        assert second.command("move_relative", target_position=6400) == BUSY
        assert second.command("disable") == 0
        assert plc.command("enable") == 0
        assert second.write("target_position", 1) == BUSY
        assert second.write("watchdog_ms", 0) == BUSY
        assert second.write("acceleration", 1000) == BUSY
        assert second.write("control_request", 1) == BUSY
        assert second.read("write_result") == RESULT_NOT_IN_CONTROL
        assert bridge.sim.sent(mark) == ["1 off", "1 ena"]
        assert bridge.gateway().read("refused_control") == 5
        assert len(bridge.told(f"client {SECOND_PLC}: write refused")) == 1
        # It lets go; now the other one has it.
        assert plc.write("control_request", 2) == ILLEGAL_VALUE
        assert plc.write("control_request", 0) == 0
        assert second.write("control_request", 1) == 0
        assert plc.command("enable") == BUSY


def test_everybody_may_stop(controlled):
    """And the one in control, who repeats its block like a scanner, does not undo it."""
    bridge = controlled
    with Client(bridge, PLC) as plc, Client(bridge, SECOND_PLC) as second:
        assert plc.command("enable") == 0
        plc.command("move_velocity", 1, target_velocity=3200)
        assert plc.command("move_velocity", 2, target_velocity=3200) == 0
        eventually(lambda: plc.read("velocity") > 3000)
        mark = bridge.sim.mark()
        assert second.command("stop", 9) == 0
        assert plc.command("move_velocity", 2, target_velocity=3200) == 0
        eventually(lambda: plc.read("velocity") == 0)
        assert bridge.sim.sent(mark) == ["1 stp"]
        assert plc.read("control_request") == 1
        # A new id is a new command.
        assert plc.command("move_velocity", 3, target_velocity=3200) == 0
        eventually(lambda: plc.read("velocity") > 3000)
        assert second.command("quick_stop") == 0
        assert plc.settled() == RESULT_OK


def test_control_ends_with_the_connection(controlled):
    bridge = controlled
    with Client(bridge, SECOND_PLC) as second:
        with Client(bridge, PLC) as plc:
            assert plc.command("enable") == 0
            assert second.command("enable") == BUSY
        eventually(lambda: second.command("enable") == 0, timeout=3)
        assert second.read("control_holder") == number_of(SECOND_PLC)


def test_control_ends_with_silence(make_bridge):
    bridge = make_bridge(modbus={"control": "drive", "control-timeout-ms": 1500}, drives=2)
    with Client(bridge, PLC) as plc, Client(bridge, PLC, 2) as plc_of_2, \
            Client(bridge, SECOND_PLC) as second:
        assert plc.write("control_request", 1) == 0
        assert plc_of_2.write("control_request", 1) == 0
        # Any of its requests to this drive keeps it; those to another drive do not.
        start = time.monotonic()
        while time.monotonic() < start + 2:
            assert plc.read("control_remaining_ms") == 1500
            assert second.write("control_request", 1) == BUSY
        eventually(lambda: second.read("control_remaining_ms") == 0)
        assert second.read("control_port") == 0
        assert second.write("control_request", 1) == 0
        assert plc.write("target_position", 1) == BUSY
        with Client(bridge, SECOND_PLC, 2) as second_of_2:
            assert second_of_2.read("control_holder") == 0
            assert second_of_2.command("enable") == 0


def test_a_plc_that_comes_back_takes_over_from_itself(controlled):
    """Its old connection may be there still for the bridge: it asks on the new one."""
    bridge = controlled
    with Client(bridge, PLC) as lost, Client(bridge, PLC) as back, \
            Client(bridge, SECOND_PLC) as second:
        assert lost.command("enable") == 0
        assert back.command("enable") == BUSY
        assert second.write("control_request", 1) == BUSY
        assert back.write("control_request", 1) == 0
        assert back.command("enable") == 0
        assert lost.command("enable") == BUSY
        assert second.read("control_port") == back.port


def test_only_the_one_in_control_feeds_the_watchdog(make_bridge):
    """A second client that keeps reading does not keep an abandoned drive moving."""
    bridge = make_bridge(modbus={"control": "drive", "control-timeout-ms": 300},
                         drive={"watchdog-ms": 600})
    with Client(bridge, PLC) as plc, Client(bridge, SECOND_PLC) as second:
        assert plc.command("enable") == 0
        assert plc.command("move_velocity", target_velocity=3200) == 0
        assert eventually(lambda: second.read("watchdog_trips"), timeout=5) == 1
        eventually(lambda: second.read("velocity") == 0)
        assert second.command("clear_fault") == 0


def test_control_and_the_vendors_map(make_bridge):
    """Both units of a drive are the same drive."""
    bridge = make_bridge(modbus={"control": "drive"}, drive={"vendor-unit": 101})
    with Client(bridge, PLC) as plc, bridge.raw(source=SECOND_PLC) as vendor:
        assert plc.command("enable") == 0
        enable = struct.pack(">BHH", 6, 0, 0x0101)
        stop = struct.pack(">BHH", 6, 0, 0x0400)
        assert vendor.request(enable, unit=101) == bytes([0x86, BUSY])
        assert vendor.request(struct.pack(">BHHBI", 16, 1, 2, 4, 0), unit=101) == \
            bytes([0x90, BUSY])
        mark = bridge.sim.mark()
        assert vendor.request(stop, unit=101) == stop
        assert bridge.sim.sent(mark) == ["1 stp"]
        assert plc.write("control_request", 0) == 0
        assert vendor.request(stop, unit=101) == stop
        assert plc.read("control_holder") == 0
        assert vendor.request(enable, unit=101) == enable
        assert plc.read("control_holder") == number_of(SECOND_PLC)
        assert plc.command("enable") == BUSY


# --- users of this machine

DAEMON, NOBODY = 1, 65534  # the first one's group is daemon's own, on every Debian
ENABLE_WRITE = struct.pack(">BHH", 6, 101, 1)  # `command`
AS_USER = """
import socket, struct, sys
s = socket.create_connection(("127.0.0.1", int(sys.argv[1])), timeout=10)
print("connected", flush=True)
for pdu in map(bytes.fromhex, sys.argv[3:]):
    try:
        s.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu)
        if sys.argv[2] == "leave":
            break
        head = s.recv(7, socket.MSG_WAITALL)
    except ConnectionError:
        head = b""
    if len(head) < 7:
        print("closed", flush=True)
        break
    print(s.recv(struct.unpack(">H", head[4:6])[0] - 1, socket.MSG_WAITALL).hex(), flush=True)
    if sys.argv[2] == "wait":
        sys.stdin.readline()
"""

only_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")


def as_user(bridge, user, *pdus, how="stay"):
    """A Modbus client of that user, without other groups than its own."""
    return subprocess.Popen(
        ["setpriv", "--reuid", str(user), "--regid", str(user), "--clear-groups", "/usr/bin/python3", "-c", AS_USER,
         str(bridge.port), how, *(pdu.hex() for pdu in pdus)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def answers(process):
    """Of a client that has nothing more to send."""
    lines = process.communicate(timeout=20)[0].splitlines()
    assert process.returncode == 0 and lines[0] == "connected"
    return lines[1:]


def newest_client(bridge):
    """Of the newest command, as the history has it."""
    return bridge.drive().read("history1_address")


@only_root
def test_users_of_this_machine(make_bridge):
    """The address may write; the user decides, as it does at the control socket."""
    bridge = make_bridge(control={"act-group": "daemon"})
    mark = bridge.sim.mark()
    read, refused, fetched = answers(as_user(bridge, NOBODY, READ, ENABLE_WRITE, READ))
    assert read.startswith("0314") and fetched.startswith("0314")
    assert refused == "8601"
    assert "1 ena" not in bridge.sim.sent(mark)
    assert bridge.told("client 127.0.0.1, user nobody: connected (port ")
    bridge.told("client 127.0.0.1: write refused: on this machine only root,")
    assert answers(as_user(bridge, DAEMON, ENABLE_WRITE)) == [ENABLE_WRITE.hex()]
    assert bridge.sim.sent(mark).count("1 ena") == 1
    assert newest_client(bridge) == "127.0.0.1, user daemon"
    # The tests are root.
    assert bridge.drive().command("enable") == 0
    assert newest_client(bridge) == "127.0.0.1, user root"
    # For a PLC that knows addresses only.
    assert bridge.drive().read("history1_ipv4") == number_of("127.0.0.1")


@only_root
def test_a_user_who_may_not_even_read(make_bridge):
    bridge = make_bridge(control={"read-group": "daemon"}, modbus={"listen": "[::]:0"})
    assert answers(as_user(bridge, NOBODY, READ)) == ["closed"]
    assert answers(as_user(bridge, DAEMON, READ, ENABLE_WRITE))[1] == "8601"
    bridge.told("connection refused: its user is in neither read-group nor act-group")


@only_root
def test_a_user_who_has_gone_is_not_root(make_bridge):
    """The kernel has no owner for a socket that was closed, and says root's number."""
    bridge = make_bridge()
    mark = bridge.sim.mark()
    bridge.process.send_signal(signal.SIGSTOP)
    try:
        assert answers(as_user(bridge, NOBODY, ENABLE_WRITE, how="leave")) == []
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    bridge.told("client 127.0.0.1: write refused: on this machine only root,")
    assert "1 ena" not in bridge.sim.sent(mark)
    assert bridge.told("client 127.0.0.1, user unknown: connected (port ")


@only_root
def test_everybody_of_this_machine_until_a_reload(make_bridge):
    bridge = make_bridge(modbus={"local-writers": "everybody"})
    process = as_user(bridge, NOBODY, ENABLE_WRITE, ENABLE_WRITE, READ, how="wait")
    assert [process.stdout.readline().strip() for _ in range(2)] == ["connected", ENABLE_WRITE.hex()]
    assert newest_client(bridge) == "127.0.0.1, user nobody"
    bridge.sections["modbus"]["local-writers"] = "command-group"
    bridge.reload()
    for answer in ("8601", "0314"):
        process.stdin.write("\n")
        process.stdin.flush()
        assert process.stdout.readline().startswith(answer)
    process.communicate("\n", timeout=20)
