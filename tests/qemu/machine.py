# SPDX-License-Identifier: Apache-2.0
"""A PC in qemu with the ports of a gateway, a way to run commands in it, and the drives' side of its serial
lines on this machine."""

import base64
import json
import select
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "model"))
from modbus import exception_of, read, words_of, write  # noqa: E402

ADAPTER = {"driver": "usb-serial", "id": "adapter", "bus": "usb.0", "chardev": "press",
           "serial": "FT4XY123"}
CAN_PORT = {"driver": "kvaser_pci", "id": "can0", "canbus": "wire", "addr": "0x10"}


class Late(Exception):
    """What was waited for did not come."""


def eventually(condition, what, timeout=60.0, pause=0.02):
    """The first true value of `condition`, and the seconds it took."""
    start = time.monotonic()
    while True:
        value = condition()
        passed = time.monotonic() - start
        if value:
            return value, passed
        if passed > timeout:
            raise Late(f"{what}: not within {timeout:.0f} s")
        time.sleep(pause)


def connect_unix(path, timeout=20.0):
    def attempt():
        link = socket.socket(socket.AF_UNIX)
        try:
            link.connect(str(path))
        except OSError:
            link.close()
            return None
        return link

    return eventually(attempt, f"socket {path}", timeout)[0]


class Lines:
    """Lines over a stream socket."""

    def __init__(self, link):
        self.link = link
        self.buffer = b""

    def send(self, text):
        self.link.sendall(text.encode() + b"\n")

    def receive(self, timeout):
        """The next line; None when there is none in time."""
        deadline = time.monotonic() + timeout
        while b"\n" not in self.buffer:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self.link], [], [], left)[0]:
                return None
            more = self.link.recv(65536)
            if not more:
                raise ConnectionError("the other side is gone")
            self.buffer += more
        line, self.buffer = self.buffer.split(b"\n", 1)
        return line.decode(errors="replace")


class FarEnds:
    """drivebridge-sim with a drive on each serial line, on this machine."""

    def __init__(self, program, folder):
        self.control_path = folder / "drives"
        self.ports = {"cabinet": folder / "cabinet", "press": folder / "press"}
        config = folder / "drives.conf"
        config.write_text("".join(
            f'bus {bus} {{\n\tprotocol = vsmd-serial\n\tdevice = "pty"\n\tbaud = 115200\n'
            f"\tlatency-us = 800\n}}\n"
            f"drive {drive} {{\n\tbus = {bus}\n\taddress = 1\n"
            f'\tset = {{"spd=6400", "acc=12800", "dec=12800"}}\n}}\n'
            for bus, drive in (("cabinet", "feeder"), ("press", "ram"))))
        links = [word for bus, path in self.ports.items() for word in ("--link", f"{bus}={path}")]
        self.process = subprocess.Popen(
            [program, "--config", config, "--control", self.control_path, "--trace",
             folder / "drives.trace", *links],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        for line in self.process.stdout:
            if line.strip() == "ready":
                break
        else:
            raise Late("drivebridge-sim did not become ready")
        self.control = Lines(connect_unix(self.control_path))

    def get(self, name):
        """The state of a drive or bus as the simulator knows it."""
        self.control.send(f"get {name}")
        while True:
            line = self.control.receive(5)
            if line is None:
                raise Late("drivebridge-sim does not answer")
            if line.startswith("ok"):
                return dict(word.split("=", 1) for word in line.split()[1:])
            if line.startswith("error"):
                raise ValueError(line)

    def velocity(self, drive):
        return float(self.get(drive)["velocity"])

    def stop(self):
        self.process.terminate()
        self.process.wait(10)


class Machine:
    """qemu. `cabinet` and `press` are paths of serial ports of this machine."""

    def __init__(self, folder, kernel, initrd, image, ports, port, first_wait=300):
        self.folder = folder
        self.boot_time = first_wait
        self.numbers = 0
        self.events = []
        self.agent_lines = None
        self.process = subprocess.Popen([
            "qemu-system-x86_64", "-M", "pc,accel=tcg", "-cpu", "qemu64", "-m", "1024", "-smp", "1",
            "-display", "none", "-nodefaults", "-no-user-config",
            "-kernel", kernel, "-initrd", initrd,
            "-append", "root=/dev/vda rw console=ttyS0 panic=5",
            "-drive", f"file={image},format=raw,if=virtio,snapshot=on,cache=unsafe",
            "-netdev", f"user,id=net,hostfwd=tcp:127.0.0.1:{port}-:502",
            "-device", "virtio-net-pci,netdev=net",
            "-chardev", f"file,id=console,path={folder / 'console.log'}", "-serial", "chardev:console",
            "-chardev", f"serial,id=cabinet,path={ports['cabinet']}", "-serial", "chardev:cabinet",
            "-chardev", f"serial,id=press,path={ports['press']}",
            "-device", "qemu-xhci,id=usb",
            "-object", "can-bus,id=wire",
            "-device", "kvaser_pci,id=can0,canbus=wire,addr=0x10",
            "-device", "kvaser_pci,id=can1,canbus=wire,addr=0x11",
            "-chardev", f"socket,id=agent,path={folder / 'agent'},server=on,wait=off",
            "-device", "virtio-serial-pci", "-device", "virtserialport,chardev=agent,name=agent",
            "-qmp", f"unix:{folder / 'qmp'},server=on,wait=off",
        ], stdin=subprocess.DEVNULL)
        self.monitor = Lines(connect_unix(folder / "qmp"))
        self.monitor.receive(10)  # the greeting
        self.qmp("qmp_capabilities")
        self.agent_lines = Lines(connect_unix(folder / "agent"))

    def qmp(self, command, arguments=None):
        self.monitor.send(json.dumps({"execute": command, "arguments": arguments or {}}))
        while True:
            answer = self._message(20)
            if "error" in answer:
                raise RuntimeError(f"{command}: {answer['error']}")
            if "return" in answer:
                return answer["return"]

    def _message(self, timeout):
        line = self.monitor.receive(timeout)
        if line is None:
            raise Late("qemu does not answer")
        message = json.loads(line)
        if "event" in message:
            self.events.append(message)
        return message

    def plug(self, device):
        self.qmp("device_add", device)

    def unplug(self, device):
        """Ends when it is out."""
        def out(event):
            return event["event"] == "DEVICE_DELETED" and event["data"].get("device") == device["id"]

        self.events.clear()
        self.qmp("device_del", {"id": device["id"]})
        while not any(out(event) for event in self.events):
            self._message(60)

    def reset(self):
        """Like the power going off and on."""
        self.qmp("system_reset")

    def wait_booted(self):
        """Seconds until the commands of run() can be given."""
        start = time.monotonic()
        while time.monotonic() < start + self.boot_time:
            line = self.agent_lines.receive(1)
            if self.process.poll() is not None:
                raise Late("qemu has ended")
            if line is not None and line.endswith("agent ready"):
                return time.monotonic() - start
        raise Late(f"no system after {self.boot_time} s")

    def run(self, command, timeout=60):
        """Status and output of a shell command in the machine."""
        self.numbers += 1
        text = base64.b64encode(command.encode()).decode()
        self.agent_lines.send(f"{self.numbers} {text}")
        while True:
            line = self.agent_lines.receive(timeout)
            if line is None:
                raise Late(f"in the machine: {command}")
            words = line.split(" ")
            if words[0] == str(self.numbers):
                output = base64.b64decode(words[2]).decode(errors="replace") if len(words) > 2 else ""
                return int(words[1]), output.strip()

    def ask(self, command, timeout=60):
        """Output of a command that has to succeed."""
        status, output = self.run(command, timeout)
        if status != 0:
            raise RuntimeError(f"{command}: {status}: {output}")
        return output

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(20)


class Plc:
    """A Modbus TCP client: one request at a time."""

    def __init__(self, port):
        self.port = port
        self.link = None
        self.transaction = 0
        self.slowest = 0.0

    def close(self):
        if self.link:
            self.link.close()
        self.link = None

    def ask(self, unit, pdu, timeout=10.0):
        """The PDU of the answer; None when the connection was lost or stays silent."""
        start = time.monotonic()
        try:
            if not self.link:
                self.link = socket.create_connection(("127.0.0.1", self.port), timeout)
            self.link.settimeout(timeout)
            self.transaction = (self.transaction + 1) & 0xFFFF
            self.link.sendall(
                struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, unit) + pdu)
            head = self._exactly(7)
            answer = self._exactly(int.from_bytes(head[4:6], "big") - 1)
        except OSError:
            self.close()
            return None
        if int.from_bytes(head[:2], "big") != self.transaction:
            raise AssertionError("the answer to another request")
        self.slowest = max(self.slowest, time.monotonic() - start)
        return answer

    def _exactly(self, count):
        data = b""
        while len(data) < count:
            more = self.link.recv(count - len(data))
            if not more:
                raise ConnectionError
            data += more
        return data

    def command(self, unit, code, position=0, velocity=0.0):
        """The exception, 0 for success, None for no answer."""
        words = struct.unpack(">4H", struct.pack(">if", position, velocity))
        answer = self.ask(unit, write(100, [0, code, *words]))
        return None if answer is None else exception_of(answer)

    def registers(self, unit, address, count):
        """Words, or the exception as a negative number, or None for no answer."""
        answer = self.ask(unit, read(address, count))
        if answer is None:
            return None
        return -exception_of(answer) if exception_of(answer) else words_of(answer)

    def position_answer(self, unit):
        """What reading the position is answered with: 0 for success, or an exception, or None."""
        words = self.registers(unit, 12, 4)
        return -words if isinstance(words, int) else None if words is None else 0

    def good(self, unit):
        """Is there fresh data?"""
        words = self.registers(unit, 0, 5)
        return isinstance(words, list) and words[4] == 192

    def state(self, unit):
        """axis_state, error, status."""
        words = self.registers(unit, 0, 4)
        if not isinstance(words, list):
            return None
        return words[0], words[1], words[2] << 16 | words[3]

    def watchdog_trips(self, unit):
        words = self.registers(unit, 50, 2)
        return words[0] << 16 | words[1] if isinstance(words, list) else None
