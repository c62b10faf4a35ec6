# SPDX-License-Identifier: Apache-2.0
"""What the other tests in this folder rely on: the kernel's CAN does what hardware would."""

import socket
import struct

import pytest
from bridgelib import eventually
from kernellib import (
    CONTROLLER_RX_PASSIVE,
    CONTROLLER_TX_PASSIVE,
    ERROR_BUS_OFF,
    ERROR_CONTROLLER,
    AdapterEnd,
    Frame,
    Link,
    SerialLink,
    Witness,
    cansend,
    is_enobufs,
    parse_log_line,
)

FRAME = struct.Struct("=IB3x8s")


@pytest.fixture
def can_socket():
    """A raw CAN socket that the test binds."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as made:
        made.settimeout(10)
        yield made


@pytest.fixture
def adapter():
    end = AdapterEnd()
    yield end
    end.close()


@pytest.fixture
def serial_link(adapter, new_name):
    made = SerialLink(new_name("slc"), adapter.device)
    made.add()
    assert [adapter.hear() for _ in range(3)] == ["C", "S8", "O"]
    yield made
    made.delete()


def test_candump_lines():
    assert parse_log_line("(1.500000) vcan0 123#DEADBEEF\n") == Frame(
        0x123, b"\xde\xad\xbe\xef", interface="vcan0", time=1.5)
    assert parse_log_line("(1.5) vcan0 00000123#") == Frame(
        0x123, extended=True, interface="vcan0", time=1.5)
    assert parse_log_line("(1.5) vcan0 123#R8").remote
    error = parse_log_line("(1.5) vcan0 20000040#0000000000000000")
    assert error.error and error.id == ERROR_BUS_OFF and not error.extended
    assert parse_log_line("read: Network is down") is None


def test_standard_and_extended_frames(link, witness):
    cansend(link.name, 0x123, b"\xde\xad\xbe\xef")
    cansend(link.name, 0x123, b"\x01\x02", extended=True)
    cansend(link.name, 0x1ABCDEF0, bytes(range(8)))
    witness.wait_for(0x1ABCDEF0)
    seen = [(frame.id, frame.extended, frame.data) for frame in witness.frames()]
    assert seen == [
        (0x123, False, b"\xde\xad\xbe\xef"),
        (0x123, True, b"\x01\x02"),
        (0x1ABCDEF0, True, bytes(range(8))),
    ]


def test_interfaces_are_apart(link, witness, new_name):
    other = Link(new_name()).add()
    cansend(other.name, 0x111)
    cansend(link.name, 0x222)
    witness.wait_for(0x222)
    assert not witness.frames(0x111)
    other.delete()


def test_nothing_seen_says_so(link, witness):
    cansend(link.name, 0x222)
    witness.wait_for(0x222)
    with pytest.raises(AssertionError, match="0 of 1 frames.*id 333(.|\n)*222"):
        witness.wait_for(0x333, timeout=0.1)


def test_error_frame_needs_the_error_filter(link, witness, can_socket):
    can_socket.bind((link.name,))
    cansend(link.name, ERROR_BUS_OFF, bytes(8), error=True)
    cansend(link.name, 0x321)
    witness.wait_error(ERROR_BUS_OFF)
    # Without an error filter only the frame behind it arrives.
    identifier, _, _ = FRAME.unpack(can_socket.recv(FRAME.size))
    assert identifier == 0x321


def test_kernel_filters(link, can_socket):
    can_socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", 0x7, 0xF))
    can_socket.bind((link.name,))
    for identifier in (0x101, 0x107, 0x118, 0x127):
        cansend(link.name, identifier)
    got = [FRAME.unpack(can_socket.recv(FRAME.size))[0] for _ in range(2)]
    assert got == [0x107, 0x127]


def test_down_and_up(link, witness, can_socket):
    can_socket.bind((link.name,))
    link.down()
    with pytest.raises(OSError, match="Network is down"):
        can_socket.recv(FRAME.size)
    assert cansend(link.name, 0x100, check=False).returncode != 0
    link.up()
    cansend(link.name, 0x200)
    witness.wait_for(0x200)
    assert FRAME.unpack(can_socket.recv(FRAME.size))[0] == 0x200
    assert not witness.frames(0x100)


def test_removed_and_back(link, can_socket):
    can_socket.bind((link.name,))
    link.delete()
    with pytest.raises(OSError, match="Network is down|No such device"):
        can_socket.recv(FRAME.size)
    assert cansend(link.name, 0x100, check=False).returncode != 0
    link.add(up=False)
    with Witness(link.name) as witness:
        link.up()
        cansend(link.name, 0x200)
        witness.wait_for(0x200)


def test_full_queue_refuses(link, witness, can_socket):
    """ENOBUFS, and nothing is lost or doubled but what was refused."""
    link.throttle(10000, frames=5)
    can_socket.setblocking(False)
    can_socket.bind((link.name,))
    taken = []
    refused = None
    for number in range(200):
        try:
            can_socket.send(FRAME.pack(number, 1, bytes([number])))
            taken.append(number)
        except OSError as error:
            refused = error
            break
    assert is_enobufs(refused), refused
    assert 5 <= len(taken) < 100
    witness.wait_for(taken[-1])
    link.unthrottle()
    seen = witness.frames()
    assert [frame.id for frame in seen] == taken
    # 128 bits each; the first has a token waiting.
    assert seen[-1].time - seen[0].time > (len(taken) - 2) * 128 / 10000


def test_serial_adapter_frames(serial_link, adapter):
    with Witness(serial_link.name) as witness:
        cansend(serial_link.name, 0x123, b"\x11\x22\x33")
        assert adapter.hear() == "t1233112233"
        cansend(serial_link.name, 0x1ABCDEF0, b"\x01")
        assert adapter.hear() == "T1ABCDEF0101"
        adapter.say("T1234567820102")
        frame = witness.wait_for(0x12345678)
        assert frame.extended and frame.data == b"\x01\x02"
        adapter.say("t7FF0")
        assert not witness.wait_for(0x7FF).extended


def test_serial_adapter_states(serial_link, adapter):
    """The kernel tells of a controller's states with error frames of its own."""
    with Witness(serial_link.name) as witness:
        adapter.say("sp128000")
        frame = witness.wait_error(ERROR_CONTROLLER)
        assert frame.data[1] & (CONTROLLER_RX_PASSIVE | CONTROLLER_TX_PASSIVE)
        assert serial_link.state() == "ERROR-PASSIVE"
        adapter.say("sb000000")
        witness.wait_error(ERROR_BUS_OFF)
        eventually(lambda: serial_link.state() == "BUS-OFF", what="the interface to be bus off")


def test_serial_adapter_unplugged(serial_link, adapter):
    name = serial_link.name
    serial_link.delete()
    assert not serial_link.exists()
    serial_link.add()
    assert adapter.hear() == "C"
    assert serial_link.exists() and serial_link.name == name
