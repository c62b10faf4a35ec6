# SPDX-License-Identifier: Apache-2.0
"""./demo as somebody sees it who types it in a terminal."""

import contextlib
import os
import pty
import re
import select
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from bridgelib import ROOT, STANDSTILL, Unit, ahead_of_tests, build_directory, eventually
from weblib import Failed, Page

# The cursor goes up by the lines of the table, which is then drawn over.
REDRAWN = "\x1b[5A"


class Demo:
    """./demo on a terminal of its own."""

    low_first = False
    family = "vsmd-serial"

    def __init__(self, register_map, commands, tree=ROOT, **variables):
        self.map = register_map
        self.commands = commands
        with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
            self.port, self.web_port = one.getsockname()[1], other.getsockname()[1]
        self.terminal, far = pty.openpty()
        self.text = ""
        environment = {**os.environ, "DRIVEBRIDGE_DEMO_PORT": str(self.port),
                       "DRIVEBRIDGE_DEMO_WEB_PORT": str(self.web_port), "TERM": "xterm",
                       "DRIVEBRIDGE_BUILD": str(build_directory()), **variables}
        with ahead_of_tests():
            self.process = subprocess.Popen(
                # Somebody's shell, which is there when the demo has ended.
                ["sh", "-c", 'trap : INT; "$0"; status=$?; read -r _; exit $status', tree / "demo"], stdin=far, stdout=far, stderr=far, env=environment,
                start_new_session=True, preexec_fn=lambda: (
                    take_terminal(far),
                    # A shell that started the tests in the background has made this one ignored.
                    signal.signal(signal.SIGINT, signal.SIG_DFL)))
        os.close(far)

    def screen(self):
        """All that was written until now."""
        while select.select([self.terminal], [], [], 0)[0]:
            try:
                more = os.read(self.terminal, 65536)
            except OSError:
                break
            if not more:
                break
            self.text += more.decode(errors="replace")
        return self.text

    def positions(self, name):
        """What the table has shown of one drive, oldest first."""
        shown = re.findall(rf"{name} +position +(-?\d+)", self.screen())
        return [int(position) for position in shown]

    def runs(self):
        assert self.process.poll() is None, self.screen()
        return "Ctrl-C ends the demo." in self.screen()

    def end(self, terminate=False):
        """By Ctrl-C, as the user does, or by SIGTERM to it alone, as another program does."""
        if terminate:
            children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
            os.kill(int(children.read_text(encoding="ascii").split()[0]), signal.SIGTERM)
        else:
            os.write(self.terminal, b"\x03")
        eventually(lambda: self.screen().replace("\r", "").endswith("\nstopped\n"), 20, "the demo to stop")
        eventually(lambda: not self.left_over(), 5, "nothing to be left")
        os.write(self.terminal, b"\n")
        assert self.process.wait(20) == 0

    def left_over(self):
        """The names of programs that the demo has started and that run."""
        mark = f"DRIVEBRIDGE_DEMO_PORT={self.port}".encode()
        names = []
        for place in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if int(place.name) != self.process.pid and mark in (place / "environ").read_bytes().split(b"\0"):
                    names.append((place / "comm").read_text(encoding="utf-8").strip())
        return names

    def close(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGTERM)
            self.process.wait(20)
        os.close(self.terminal)


def take_terminal(descriptor):
    """In a new session: its terminal, so that Ctrl-C there reaches it."""
    os.close(os.open(os.ttyname(descriptor), os.O_RDWR))


@pytest.fixture
def demo(register_map, command_table):
    made = Demo(register_map, command_table)
    try:
        eventually(made.runs, 60, "the demo to run")
        yield made
    finally:
        print(made.screen())
        made.close()


def test_drives_move_by_themselves_in_a_table_that_stays(demo):
    eventually(lambda: demo.screen().count(REDRAWN) >= 2, 30, "the table to be drawn over")
    for name in ("feeder", "gripper"):
        eventually(lambda name=name: len(set(demo.positions(name))) > 1, 30, f"{name} to move")
    demo.end()


def test_who_commands_a_drive_has_it(demo):
    """The demo's own moves end with the first command of somebody else."""
    unit = Unit(demo, 1, "drive", port=demo.port)
    try:
        eventually(lambda: unit.read("axis_state") == STANDSTILL and unit.read("command_id") > 2,
                   30, "the feeder to have been moved")
        eventually(lambda: unit.command("stop", command_id=60500) == 0)
        assert unit.read("command_id") == 60500
        target = unit.read("position")
        # As long as two of the demo's looks at the drive.
        begin = time.monotonic()
        while time.monotonic() - begin < 1.5:
            assert unit.read("command_id") == 60500
            time.sleep(0.1)
        assert unit.read("position") == target
    finally:
        unit.close()
    demo.end()


def test_its_drives_are_shown_by_their_names(demo):
    """As the demo says it."""
    (line,) = re.findall(r"By their names: (.*) status", demo.screen())
    status = subprocess.run([*line.split(), "status"], capture_output=True, text=True, timeout=20,
                            check=False)
    assert status.returncode in (0, 1), status
    for name in ("feeder", "conveyor", "lift", "turntable", "gripper"):
        assert re.search(rf"^{name} ", status.stdout, re.M)
    demo.end(terminate=True)


def test_its_page_is_for_who_reads_the_terminal(demo):
    address, user, password = re.search(r"In a browser: (http://\S+) with user (\w+), password (\w+)",
                                        demo.screen()).groups()
    web = SimpleNamespace(address=("127.0.0.1", demo.web_port))
    assert address == f"http://127.0.0.1:{demo.web_port}"
    page = Page(web)
    assert page.load()["role"] == "none"
    with pytest.raises(Failed) as refused:
        page.call("Describe")
    assert refused.value.status == 401
    assert page.log_in(user, password)["role"] == "engineer"
    assert len(page.call("Describe")["drives"]) == 5
    assert b"uPlot" in page.request("GET", "/uPlot.iife.min.js")[2]
    page.close()
    demo.end()


def test_ctrl_c_while_it_is_made_ready(tmp_path, register_map, command_table):
    """The build stands still half way, which was said by then, and a server has no libraries to give: Ctrl-C leaves nothing."""
    page = "src/tools/web/page/"
    for name in ("demo", "tests/lib/packages.sh", page + "fetch", page + "requirements.txt", page + "package-lock.json"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    for name in ("bin", "run", "tmp"):
        (tmp_path / name).mkdir()
    cmake = tmp_path / "bin/cmake"
    cmake.write_text("#!/bin/sh\n[ $1 != --build ] || { echo '[5/10] half'; exec sleep 600; }\n", encoding="ascii")
    cmake.chmod(0o755)
    silent = socket.create_server(("127.0.0.1", 0))
    demo = Demo(register_map, command_table, tmp_path, DRIVEBRIDGE_BUILD="", XDG_RUNTIME_DIR=str(tmp_path / "run"),
                PATH=f"{tmp_path / 'bin'}:{os.environ['PATH']}", TMPDIR=str(tmp_path / "tmp"), PIP_FIND_LINKS="",
                PIP_INDEX_URL=f"http://127.0.0.1:{silent.getsockname()[1]}/", NO_PROXY="127.0.0.1")
    try:
        eventually(lambda: " 50 %" in demo.screen(), 20, "half of the build to be said")
        assert select.select([silent], [], [], 60)[0], demo.screen()
        os.write(demo.terminal, b"\x03")
        eventually(lambda: "demo: interrupted before it ran" in demo.screen(), 20, "the demo to end")
        eventually(lambda: not demo.left_over(), 5, "nothing to be left")
        assert not [*(tmp_path / "run").iterdir(), *(tmp_path / "tmp").iterdir()]
    finally:
        print(demo.screen())
        demo.close()
        silent.close()
