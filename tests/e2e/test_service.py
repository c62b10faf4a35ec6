# SPDX-License-Identifier: Apache-2.0
"""The service beside others on its machine: an address that comes later, a port that is taken, the same
configuration started twice, and file descriptors that run short."""

import contextlib
import os
import re
import resource
import signal
import socket
import subprocess
from pathlib import Path

import pytest
from bridgelib import ROOT, Raw, eventually, find_program

NOWHERE = "192.0.2.1"  # TEST-NET-1: no machine has it


def test_an_address_that_the_machine_does_not_have_yet(make_bridge):
    """The bus runs meanwhile. Giving this machine another address would need root's rights."""
    bridge = make_bridge(modbus={"listen": f"{NOWHERE}:0"}, wait_online=False)
    bridge.told(f"does not have the address {NOWHERE} yet")
    eventually(lambda: re.search("drive drive1: answers", bridge.log_path.read_text()),
               what="the drive to be found")
    assert bridge.process.poll() is None
    # Back to an address that is there.
    bridge.sections["modbus"]["listen"] = "127.0.0.1:0"
    log = bridge.reload()
    bridge.port = int(re.search(r"listening on .*:(\d+)\n", log).group(1))
    bridge.wait_ready()


@contextlib.contextmanager
def run_beside(config):
    """One more drivebridged; it does not outlive its test."""
    process = subprocess.Popen([find_program("drivebridged"), "--config", config],
                               stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_second_one_with_the_same_configuration(make_bridge, tmp_path):
    bridge = make_bridge()
    link = tmp_path / "same.conf"
    link.symlink_to(bridge.config_path)
    opens = bridge.gateway().read("clients")
    for name in (bridge.config_path, link):
        with run_beside(name) as second:
            _, errors = second.communicate(timeout=20)
        assert second.returncode == 1
        assert f"in use by another process ({bridge.process.pid})" in errors
        assert "listening" not in errors
    assert bridge.gateway().read("clients") == opens
    assert bridge.drive().online()


def test_a_second_one_on_the_same_port_leaves_it_alone(make_bridge, tmp_path):
    bridge = make_bridge()
    other = tmp_path / "other.conf"
    other.write_text(bridge.config_path.read_text(), encoding="utf-8")
    with run_beside(other) as second:
        line = ""
        while f"drivebridged (process {bridge.process.pid}) has it" not in line:
            line = second.stderr.readline()
            assert line, "it ended"
        second.terminate()
        second.communicate(timeout=20)
    assert bridge.drive().online()
    assert bridge.drive().read("timeouts") == 0


def test_a_service_waits_for_its_port_and_a_person_is_told(make_bridge, monkeypatch, tmp_path):
    bridge = make_bridge(start_sim=False)
    assert bridge.stop_bridge() == 0
    with socket.create_server(("127.0.0.1", 0)) as taken:
        bridge.sections["modbus"]["listen"] = f"127.0.0.1:{taken.getsockname()[1]}"
        bridge.write_config()
        with run_beside(bridge.config_path) as by_hand:
            _, errors = by_hand.communicate(timeout=20)
        assert by_hand.returncode == 1 and "another program uses this port" in errors
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
            systemd.bind(str(tmp_path / "notify"))
            monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
            with run_beside(bridge.config_path) as service:
                assert "another program uses this port" in service.stderr.readline()
                taken.close()
                text = service.stderr.readline()
                assert "listening on" in text, text
                service.send_signal(signal.SIGTERM)
                service.communicate(timeout=20)
            assert service.returncode == 0


def test_stopped_while_it_waits_it_ends_well(make_bridge, monkeypatch, tmp_path):
    bridge = make_bridge(start_sim=False)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    with run_beside(bridge.config_path) as second:
        assert "in use by another process" in second.stderr.readline()
        second.terminate()
        second.communicate(timeout=20)
        assert second.returncode == 0


def test_the_soft_limit_on_descriptors_is_raised(make_bridge):
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(soft, 512), hard))
    try:
        bridge = make_bridge(start_sim=False)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert resource.prlimit(bridge.process.pid, resource.RLIMIT_NOFILE) == (hard, hard)


def test_idle_clients_leave_descriptors_to_buses_and_reloads(make_bridge):
    bridge = make_bridge(modbus={"max-clients": 64, "listen": "127.0.0.1:0"})
    resource.prlimit(bridge.process.pid, resource.RLIMIT_NOFILE, (60, 60))
    idle = []
    while "the file descriptors left" not in bridge.log_path.read_text():
        idle.append(Raw(bridge.port))
        assert len(idle) <= 500, "nobody is refused"
    # The adapter is pulled out and plugged in again, and the file is read.
    bridge.sim.stop()
    eventually(lambda: not bridge.drive().online(), what="the drive to be lost")
    bridge.sim.start()
    bridge.wait_ready()
    bridge.sections["drive drive1"]["watchdog-ms"] = 700
    assert "reload: done" in bridge.reload()
    bridge.wait_ready()
    for client in idle:
        client.close()


def test_a_tool_for_which_no_descriptor_is_left_waits_and_costs_nothing(make_bridge):
    bridge = make_bridge(start_sim=False)
    pid = bridge.process.pid

    def ticks():
        # Of the network thread, which is the first one.
        fields = Path(f"/proc/{pid}/task/{pid}/stat").read_text().rpartition(")")[2].split()
        return int(fields[11]) + int(fields[12])

    before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    used = max(int(name) for name in os.listdir(f"/proc/{pid}/fd")) + 1
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (used, before[1]))
    fillers = []
    with socket.socket(socket.AF_UNIX) as tool:
        # Descriptors below the highest one may be free.
        for _ in range(used):
            filler = socket.socket(socket.AF_UNIX)
            filler.connect(str(bridge.control_path))
            fillers.append(filler)
            if len(os.listdir(f"/proc/{pid}/fd")) >= used:
                break
        tool.connect(str(bridge.control_path))
        tool.sendall(b'{"method":"org.varlink.service.GetInfo"}\0')
        tool.settimeout(1)
        began = ticks()
        with pytest.raises(TimeoutError):
            tool.recv(1)
        assert ticks() - began < 10, "the network thread spins"
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)
        tool.settimeout(20)
        assert b"drivebridge" in tool.recv(4096)
    for filler in fillers:
        filler.close()


def test_adapters_whose_driver_is_loaded_later_may_be_opened():
    """systemd looks names of drivers up at the start of the service, when the first adapter may not have been
    plugged in. Their numbers are the kernel's for good (admin-guide/devices.rst)."""
    unit = (ROOT / "packaging" / "systemd" / "drivebridge.service").read_text(encoding="utf-8")
    allowed = re.findall(r"^DeviceAllow=(\S+) rw$", unit, re.MULTILINE)
    for number, name in ((188, "ttyUSB"), (166, "ttyACM")):
        assert f"char-{number}" in allowed and f"char-{name}" in allowed
