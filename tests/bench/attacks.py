# SPDX-License-Identifier: Apache-2.0
"""Clients that mean no good, for timing.py: each keeps a processor busy for as long as it is let.

ATTACKS[name](port, seed) never returns. Attacks of many connections share them among as many processes as
this machine has processors, PROCESSES.
"""
import contextlib
import os
import random
import select
import socket
import struct

from bus_cycle import addresses

PROCESSES = os.cpu_count() or 1
CONNECTIONS = 60
UNITS = 8


def adu(unit, pdu):
    return struct.pack(">HHHB", 7, 0, len(pdu) + 1, unit) + pdu


def connect(port, receive_buffer=0):
    link = socket.socket()
    if receive_buffer:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    link.connect(("127.0.0.1", port))
    return link


def share():
    return range(CONNECTIONS // PROCESSES)


def flood(port, requests, read=65536):
    """Sends requests for as long as they are taken, on all connections, and reads what comes."""
    links = {}
    for _ in share():
        link = connect(port)
        link.setblocking(False)
        links[link.fileno()] = [link, b""]
    poll = select.epoll()
    for number in links:
        poll.register(number, select.EPOLLIN | select.EPOLLOUT)
    while True:
        for number, events in poll.poll():
            link, rest = links[number]
            with contextlib.suppress(BlockingIOError):
                if events & select.EPOLLIN:
                    link.recv(read)
            with contextlib.suppress(BlockingIOError):
                if events & select.EPOLLOUT:
                    rest = rest or requests
                    links[number][1] = rest[link.send(rest):]


def pipelining(port, _seed):
    """Reads of 100 registers, sent without waiting for the answers."""
    flood(port, b"".join(adu(unit, struct.pack(">BHH", 3, 0, 100)) for unit in range(1, UNITS + 1)) * 16)


def never_reading(port, _seed):
    """Reads, too, and one byte of an answer is fetched now and then, so that it is never over."""
    flood(port, b"".join(adu(unit, struct.pack(">BHH", 3, 0, 100)) for unit in range(1, UNITS + 1)) * 16, 1)


def writers(port, _seed):
    """Writes of a target, which is kept and moves nothing, without waiting for the answers."""
    target = addresses("drive")["target_velocity"]
    flood(port, b"".join(adu(unit, struct.pack(">BHHBI", 16, target, 2, 4, 0))
                         for unit in range(1, UNITS + 1)) * 16)


def commanders(port, _seed):
    """Commands, each of which is an exchange with its drive, without waiting for the answers."""
    command = addresses("drive")["command"]
    flood(port, b"".join(adu(unit, struct.pack(">BHH", 6, command, 1)) for unit in range(1, UNITS + 1)) * 16)


def reconnecting(port, _seed):
    """Connects, asks, and is gone with a reset."""
    request = adu(1, struct.pack(">BHH", 3, 0, 100))
    while True:
        link = connect(port)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        link.send(request)
        link.close()


def malformed(port, seed):
    """Bytes that are no Modbus, and frames that are nearly, on connection after connection."""
    chance = random.Random(seed)
    while True:
        link = connect(port)
        with contextlib.suppress(OSError):
            for _ in range(20):
                good = adu(chance.randrange(256), bytes([chance.randrange(128)]) + chance.randbytes(8))
                link.send(good if chance.random() < 0.8 else chance.randbytes(300))
        link.close()


def burning(_port, _seed):
    """No client at all: takes a processor."""
    while True:
        pass


ATTACKS = {
    "60 clients that pipeline reads": pipelining,
    "60 clients that pipeline writes": writers,
    "60 clients that pipeline commands": commanders,
    "60 clients that hardly read": never_reading,
    "connections and resets": reconnecting,
    "malformed frames": malformed,
}
