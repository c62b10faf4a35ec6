# SPDX-License-Identifier: Apache-2.0
"""The Modbus server against clients that are slow, many, hasty, hostile or not allowed."""

import socket
import struct
import time

import pytest
from bridgelib import (
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    eventually,
)

READ = struct.pack(">BHH", 3, 0, 10)


def serves(bridge):
    """The bridge answers an ordinary client."""
    with bridge.raw() as raw:
        assert len(raw.request(READ)) == 22
    return True


def test_byte_by_byte(bridge):
    with bridge.raw() as raw, bridge.raw() as other:
        for byte in raw.adu(0x1234, 1, READ):
            raw.send(bytes([byte]))
            # Between two bytes of the one, the other is served.
            assert len(other.request(READ)) == 22
        transaction, unit, pdu = raw.receive()
        assert (transaction, unit, len(pdu)) == (0x1234, 1, 22)


def test_an_unfinished_request_ends_its_connection_only(make_bridge):
    bridge = make_bridge()
    with bridge.raw() as slow, bridge.raw() as other:
        slow.send(slow.adu(1, 1, READ)[:9])
        assert slow.closed()
        assert len(other.request(READ)) == 22
    assert bridge.gateway().read("timeouts") == 1


def test_an_idle_connection(make_bridge):
    bridge = make_bridge(modbus={"idle-timeout-s": 1})
    with bridge.raw() as idle:
        assert idle.closed(timeout=5)
    assert serves(bridge)


def test_sixty_four_clients(bridge):
    clients = [bridge.raw() for _ in range(63)]
    for number, client in enumerate(clients):
        client.send(client.adu(number, 1, READ))
    for number, client in enumerate(clients):
        assert client.receive()[0] == number
    # The 64th is the one the fixture holds.
    assert bridge.drive().online()
    for client in clients:
        client.close()


def test_one_client_too_many(make_bridge):
    bridge = make_bridge(modbus={"max-clients": 3}, start_sim=False)
    state = struct.pack(">BHH", 3, bridge.map.find("axis_state").address, 1)
    clients = [bridge.raw() for _ in range(3)]
    for client in clients:
        assert client.request(state) == b"\x03\x02\x00\x00"
    with bridge.raw() as extra:
        assert extra.closed()
    for client in clients:
        assert client.request(state) == b"\x03\x02\x00\x00"
    clients.pop().close()

    def place_again():
        try:
            with bridge.raw() as raw:
                return raw.request(state)[0] == 3
        except ConnectionError:
            return False

    eventually(place_again, what="a place to be free again")
    for client in clients:
        client.close()


def test_pipelined_requests_are_answered_in_order(bridge):
    """Reads behind a write that waits for its drive wait too."""
    command = bridge.map.find("command").address
    stop = int(bridge.commands["stop"]["code"])
    with bridge.raw() as raw:
        data = b""
        for number in range(60):
            pdu = struct.pack(">BHH", 6, command, stop) if number % 10 == 0 else READ
            data += raw.adu(number, 1, pdu)
        raw.send(data)
        for number in range(60):
            transaction, _, pdu = raw.receive()
            assert transaction == number
            assert pdu[0] == (6 if number % 10 == 0 else 3)


def test_a_read_behind_a_write_sees_what_it_did(bridge):
    drive = bridge.drive()
    address = drive.row("dar").address
    with bridge.raw() as raw:
        for value in range(1, 30):
            write = raw.adu(1, 1, struct.pack(">BHH", 6, address, value))
            raw.send(write + raw.adu(2, 1, struct.pack(">BHH", 3, address, 1)))
            assert raw.receive()[2] == struct.pack(">BHH", 6, address, value)
            assert raw.receive()[2] == struct.pack(">BBH", 3, 2, value)


def flood(bridge, other):
    """Requests whose answers nobody reads, until the server takes no more; others are served meanwhile."""
    with bridge.raw() as link:
        link.socket.setblocking(False)
        block = link.adu(1, 1, struct.pack(">BHH", 3, 0, 36)) * 500
        sent, quiet = 0, 0
        while sent < 64 << 20 and quiet < 20:
            try:
                sent += link.socket.send(block)
                quiet = 0
            except BlockingIOError:
                quiet += 1
                start = time.monotonic()
                assert len(other.request(READ)) == 22
                assert time.monotonic() - start < 1
        assert quiet == 20, "the server takes without end"
        return memory(bridge)


def test_a_flood_that_nobody_reads(bridge):
    """Back-pressure for the one, ordinary service for the others, and bounded memory: what the first
    floods take is also what a sanitizer and a compiler take for code that runs for the first time."""
    with bridge.raw() as other:
        before = max(flood(bridge, other) for _ in range(2))
        for _ in range(3):
            assert flood(bridge, other) < before + 2048
        assert bridge.drive().read("age_ms") < 500


def memory(bridge):
    """Resident memory in KiB."""
    with open(f"/proc/{bridge.process.pid}/status", encoding="ascii") as file:
        for line in file:
            if line.startswith("VmRSS"):
                return int(line.split()[1])
    raise AssertionError("no VmRSS")


@pytest.mark.parametrize(
    "data",
    [
        b"\x00\x01\x00\x01\x00\x06\x01\x03\x00\x00\x00\x01",  # protocol is not 0
        b"\x00\x01\x00\x00\x00\x00\x01\x03",  # length 0
        b"\x00\x01\x00\x00\x00\x01\x01\x03",  # no function code
        b"\x00\x01\x00\x00\x01\x00\x01\x03",  # longer than an ADU may be
        b"\x00\x01\x00\x00\xff\xff\x01\x03",
        b"GET / HTTP/1.0\r\n\r\n",
    ],
)
def test_what_cannot_be_modbus_closes_that_connection_only(bridge, data):
    with bridge.raw() as other, bridge.raw() as bad:
        bad.send(data)
        assert bad.closed()
        assert len(other.request(READ)) == 22
    assert bridge.gateway().read("bad_frames") == 1


@pytest.mark.parametrize(
    "pdu",
    [
        struct.pack(">BHHB", 16, 100, 4, 8),  # says 8 bytes, brings none
        struct.pack(">BHHB", 16, 100, 2, 8) + bytes(8),  # count and bytes disagree
        struct.pack(">BHHB", 16, 100, 0, 0),
        struct.pack(">BHHB", 16, 100, 124, 248) + bytes(246),
        struct.pack(">BHH", 3, 0, 0),
        struct.pack(">BHH", 3, 0, 126),
        struct.pack(">BHH", 3, 0, 65535),
        struct.pack(">BHH", 1, 0, 2001),
        struct.pack(">BHHHHB", 23, 0, 126, 100, 1, 2) + bytes(2),
        struct.pack(">BHHHHB", 23, 0, 1, 100, 122, 244) + bytes(240),
        struct.pack(">BHHBB", 15, 0, 9, 1, 0),
    ],
)
def test_requests_of_wrong_form(bridge, pdu):
    """Answered at once with 03; the connection and everybody else go on."""
    mark = bridge.sim.mark()
    with bridge.raw() as raw, bridge.raw() as other:
        start = time.monotonic()
        assert raw.request(pdu) == bytes([pdu[0] | 0x80, ILLEGAL_VALUE])
        assert len(other.request(READ)) == 22
        assert time.monotonic() - start < 0.4, "libmodbus's half second"
        assert len(raw.request(READ)) == 22
    assert bridge.sim.sent(mark) == []


def test_a_request_hidden_in_another(bridge):
    """An FC 16 in the tail of a read that is too long is never taken for a request."""
    command = bridge.map.find("command").address
    hidden = struct.pack(">HHHBBHHBH", 2, 0, 9, 1, 16, command, 1, 2,
                         int(bridge.commands["disable"]["code"]))
    mark = bridge.sim.mark()
    with bridge.raw() as raw:
        assert raw.request(READ + hidden) == bytes([0x83, ILLEGAL_VALUE])
        assert len(raw.request(READ)) == 22
    assert bridge.sim.sent(mark) == []


def test_clients_that_vanish(bridge):
    """Reset in the middle of a request, or while an answer is on its way."""
    command = bridge.map.find("command").address
    for pdu in (READ, READ[:3], struct.pack(">BHH", 6, command, 3)):
        for _ in range(10):
            raw = bridge.raw()
            raw.send(raw.adu(1, 1, READ)[: 7 + len(pdu)] if len(pdu) < 5 else raw.adu(1, 1, pdu))
            raw.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            raw.close()
    assert serves(bridge)
    eventually(lambda: bridge.gateway().read("clients") <= 2)


# --- who may do what


def test_writing_from_elsewhere_is_not_allowed(make_bridge):
    bridge = make_bridge(modbus={"allow-write": ["127.0.0.2"]})
    command = bridge.map.find("command").address
    disable = struct.pack(">BHH", 6, command, int(bridge.commands["disable"]["code"]))
    mark = bridge.sim.mark()
    with bridge.raw() as raw:
        assert len(raw.request(READ)) == 22
        for pdu in (
            disable,
            struct.pack(">BHHBH", 16, command, 1, 2, 2),
            struct.pack(">BHHH", 22, command, 0, 2),
            struct.pack(">BHHHHBH", 23, 0, 1, command, 1, 2, 2),
            struct.pack(">BHH", 5, 0, 0xFF00),
            struct.pack(">BHHBB", 15, 0, 1, 1, 1),
        ):
            assert raw.request(pdu) == bytes([pdu[0] | 0x80, ILLEGAL_FUNCTION])

    def commands():
        # A drive that a busy machine has missed for a moment is asked again which one it is.
        return [line for line in bridge.sim.sent(mark) if line != "1 dev"]

    assert commands() == []
    assert bridge.gateway().read("refused_writes") == 6
    with bridge.raw(source="127.0.0.2") as raw:
        assert raw.request(disable) == disable
    assert commands() == ["1 off"]


def test_reading_from_elsewhere_is_not_even_connected(make_bridge):
    bridge = make_bridge(modbus={"allow-read": ["127.0.0.3"], "allow-write": ["127.0.0.1"]})
    with bridge.raw(source="127.0.0.4") as raw:
        assert raw.closed()
    with bridge.raw(source="127.0.0.3") as raw:
        assert len(raw.request(READ)) == 22
        assert raw.request(struct.pack(">BHH", 6, 101, 2)) == bytes([0x86, ILLEGAL_FUNCTION])
    assert bridge.gateway().read("refused_address") == 1


def pace_under_reads(bridge, clients):
    """How many cycles of 25 were late, and how many the drive was polled short of its pace."""
    gateway = bridge.gateway()
    cycles, overruns = gateway.read("bus1_cycles"), gateway.read("bus1_overruns")
    start = time.monotonic()
    while gateway.read("bus1_cycles") < cycles + 25:
        for client in clients:
            client.send(client.adu(1, 1, READ) * 10)
        for client in clients:
            for _ in range(10):
                client.receive()
    took = time.monotonic() - start
    short = took * 1000 / 20 * 0.8 - 2 - (gateway.read("bus1_cycles") - cycles)
    return gateway.read("bus1_overruns") - overruns, short


def test_the_line_keeps_its_pace_under_a_flood_of_reads(bridge):
    """Four busy clients do not cost the drive a poll. Other programs on this machine may: then it is
    looked at again, which would not help if the clients were the cause."""
    clients = [bridge.raw() for _ in range(4)]
    for _ in range(10):
        late, short = pace_under_reads(bridge, clients)
        if late <= 5 and short <= 0:
            break
    else:
        raise AssertionError(f"{late} of 25 cycles were late, {short} polls are missing")
    for client in clients:
        client.close()


# --- FC 8 -----------------------------------------------------------------------------------------------------


def test_a_loopback_waits_for_what_came_before_it(make_bridge):
    """Its data are echoed in full, behind the answer to a write that a drive is slow to confirm."""
    bridge = make_bridge(modbus={"confirm-ms": 2000})
    drive = bridge.drive()
    bridge.sim.fault("lose-request 1")
    command = drive.row("command").address
    enable = struct.pack(">BHH", 6, command, int(bridge.commands["enable"]["code"]))
    data = bytes(range(250))
    with bridge.raw() as raw:
        raw.send(raw.adu(1, 1, enable) + raw.adu(2, 1, b"\x08\0\0" + data) + raw.adu(3, 1, READ))
        assert raw.receive()[0] == 1
        assert raw.receive()[::2] == (2, b"\x08\0\0" + data)
        assert raw.receive()[0] == 3


def test_counters_are_of_the_connection(make_bridge):
    bridge = make_bridge()
    with bridge.raw() as raw, bridge.raw() as other:
        def counter(number):
            return struct.unpack(">BHH", raw.request(struct.pack(">BHH", 8, number, 0)))[2]

        other.request(READ)
        assert raw.request(b"\x07") == bytes([0x87, ILLEGAL_FUNCTION])
        assert [counter(number) for number in (11, 12, 13, 14, 18)] == [2, 0, 1, 5, 0]
        before = bridge.gateway().read("requests")
        assert raw.request(struct.pack(">BHH", 8, 10, 0)) == struct.pack(">BHH", 8, 10, 0)
        assert counter(11) == 1
        # What monitoring reads goes on.
        assert bridge.gateway().read("requests") > before
        # No such function of a device on a line, and wrong forms.
        assert raw.request(struct.pack(">BHH", 8, 4, 0)) == bytes([0x88, ILLEGAL_FUNCTION])
        assert raw.request(struct.pack(">BHH", 8, 11, 1)) == bytes([0x88, ILLEGAL_VALUE])


def test_identification_of_each_unit(bridge):
    def objects(unit):
        found, at = {}, 0
        with bridge.raw() as raw:
            answer = raw.request(b"\x2b\x0e\x02\0", unit=unit)
        assert answer[:6] == b"\x2b\x0e\x02\x82\0\0"
        at = 7
        for _ in range(answer[6]):
            found[answer[at]] = answer[at + 2:at + 2 + answer[at + 1]].decode()
            at += 2 + answer[at + 1]
        return found

    drive, gateway = objects(1), objects(255)
    assert drive[1] == "vsmd-serial" and drive[4] == "VSMD stepper on RS485 or RS232"
    assert drive[5].startswith("VSMD113") and drive[6] == "drive1"
    assert gateway[1] == "gateway" and gateway[4] == "drivebridge gateway" and gateway[5] == "gateway"
