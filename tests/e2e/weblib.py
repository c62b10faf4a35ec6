# SPDX-License-Identifier: Apache-2.0
"""drivebridge-webd beside a bridge and its simulator, and what asks it as a page does, over plain HTTP."""

import http.client
import itertools
import json
import os
import re
import secrets
import signal
import subprocess
import threading
import time
from pathlib import Path

from bridgelib import ahead_of_tests, build_directory, eventually, find_program, section

# Name and password; who may do everything to drives, and who looks.
OPERATOR = ("olga", "the operator's word")
READER = ("rudi", "the reader's word")

PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>A page</title><p>Nothing to see.</p></html>
"""


class Webd:
    """drivebridge-webd with an engineer and an observer, on a port of its own.

    server, access, metrics
             keys for the sections of its configuration
    page     folder with the page; without it that of the build, where there is one, else a bare file
    users    [(name, password, role)], or [(name, password, role, drives)]
    """

    def __init__(self, place, bridge=None, *, server=None, access=None, metrics=None, page=None,
                 users=((*OPERATOR, "engineer"), (*READER, "observer"))):
        self.place = Path(place)
        self.log_path = self.place / "webd.log"
        self.config_path = self.place / "web.conf"
        # Beside its folder the file of before.
        self.users_path = self.place / "access" / "users"
        self.former_path = self.place / "web-users"
        page = page or build_directory() / "web"
        if not (Path(page) / "index.html").exists():
            page = self.place / "page"
            page.mkdir(exist_ok=True)
            (page / "index.html").write_text(PAGE, encoding="utf-8")
        self.sections = {
            "service": {"socket": bridge.control_path if bridge else self.place / "nowhere"},
            "server": {"listen": "127.0.0.1:0", "page": page, **(server or {})},
            "access": {"users-file": self.users_path, **(access or {})},
            "metrics": metrics or {},
        }
        self.users = users
        self.process = None
        self.url = None
        self.address = None

    def write_config(self):
        text = "\n".join(section(title, keys) for title, keys in self.sections.items())
        self.config_path.write_text(text, encoding="utf-8")

    def command(self, *arguments, **options):
        """The program with its configuration, until it ends."""
        return subprocess.run([find_program("drivebridge-webd"), "--config", self.config_path, *arguments],
                              capture_output=True, text=True, timeout=30, check=False, **options)

    def add_user(self, name, password, role, drives="*"):
        done = self.command("--add-user", name, "--role", role, "--drives", drives, input=password + "\n")
        assert done.returncode == 0, done.stderr

    def start(self):
        self.write_config()
        for user in self.users:
            self.add_user(*user)
        self.users = ()
        offset = self.log_path.stat().st_size if self.log_path.exists() else 0
        with open(self.log_path, "ab") as log, ahead_of_tests():
            # Memory that the sanitizer keeps back is not the program's.
            options = os.environ.get("ASAN_OPTIONS", "") + ":quarantine_size_mb=1"
            self.process = subprocess.Popen([find_program("drivebridge-webd"), "--config", self.config_path],
                                            stdout=log, stderr=log,
                                            env={**os.environ, "ASAN_OPTIONS": options})

        def listening():
            text = self.log_path.read_text(errors="replace")[offset:]
            assert self.process.poll() is None, text
            return re.search(r" at (https?://(\S+?):(\d+))/", text)

        found = eventually(listening, what="drivebridge-webd to listen")
        self.url = found[1]
        self.address = (found[2].strip("[]"), int(found[3]))
        return self

    def wait_for_service(self):
        page = Page(self)
        eventually(lambda: page.load()["service"], what="drivebridge-webd to find the service")
        page.close()
        return self

    def log(self):
        return self.log_path.read_text(errors="replace")

    def wait_for_log(self, text, timeout=10):
        eventually(lambda: text in self.log(), timeout, f"'{text}' in its log")

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        return self.process.wait(10)

    def finish(self):
        """What was wrong with its end."""
        problems = []
        if self.process and self.process.poll() is None:
            try:
                if self.stop() != 0:
                    problems.append(f"drivebridge-webd ended with {self.process.returncode}")
            except subprocess.TimeoutExpired:
                self.process.kill()
                problems.append("drivebridge-webd did not end")
        elif self.process and self.process.returncode not in (0, -signal.SIGKILL):
            problems.append(f"drivebridge-webd ended with {self.process.returncode} by itself")
        text = self.log() if self.log_path.exists() else ""
        if "Sanitizer" in text or "runtime error:" in text:
            problems.append("sanitizer output of drivebridge-webd")
        return problems


class Failed(Exception):
    """An answer that is none."""

    def __init__(self, status, body):
        super().__init__(f"{status} {body}")
        self.status = status
        self.error = body.get("error")
        self.text = body.get("text")
        self.body = body


class Page:
    """A page in a browser: cookie, token, an id of its own; one connection for its calls."""

    def __init__(self, webd, user=None, tab=None):
        self.webd = webd
        self.cookie = None
        self.devices = {}  # cookies by which the browser is known, by their names
        self.token = None
        self.tab = tab or secrets.token_hex(12)
        self.connection = None
        self.lock = threading.Lock()
        self.used = 0
        self.grip = 0
        self.numbers = itertools.count(1)
        self.streams = []
        self.clock = None
        if user:
            self.load()
            self.log_in(*user)

    def beside(self):
        """The same page, over one more connection: browsers have several."""
        made = Page(self.webd, tab=self.tab)
        made.cookie, made.token, made.numbers = self.cookie, self.token, self.numbers
        # Tokens come to a page, however many connections it has.
        made.find_clock = self.find_clock
        return made

    def find_clock(self):
        if not self.clock or self.clock.ended:
            self.clock = self.stream("overview")
        return self.clock

    def newest_token(self):
        """Of the service's clock, as the page's overview brings it; "" for who may not see that."""
        try:
            return self.find_clock().wait_token()
        except Failed:
            return ""

    def close(self):
        for stream in self.streams:
            stream.close()
        if self.connection:
            self.connection.close()
        self.connection = None

    def connect(self):
        return http.client.HTTPConnection(*self.webd.address, timeout=30)

    def headers(self, **more):
        made = {"Content-Type": "application/json", "X-Tab": self.tab, "X-Call": str(next(self.numbers))}
        cookies = [*([self.cookie] if self.cookie else []), *(f"{name}={value}" for name, value in self.devices.items())]
        if cookies:
            made["Cookie"] = "; ".join(cookies)
        if self.token:
            made["X-Drivebridge"] = self.token
        made.update({key.replace("_", "-"): value for key, value in more.items()})
        return {key: value for key, value in made.items() if value is not None}

    def take_cookie(self, response):
        for header in response.headers.get_all("Set-Cookie") or []:
            cookie = header.split(";")[0]
            name, value = cookie.split("=", 1)
            if "device" in name:
                self.devices[name] = value
            else:
                self.cookie = cookie

    def request(self, method, path, body=None, **headers):
        """(status, headers, bytes); over the connection that there is, else a new one."""
        with self.lock:
            # One that was silent may have been closed meanwhile.
            if self.connection and time.monotonic() - self.used > 5:
                self.connection.close()
                self.connection = None
            self.connection = self.connection or self.connect()
            self.used = time.monotonic()
            try:
                self.connection.request(method, path, body, self.headers(**headers))
                response = self.connection.getresponse()
                data = response.read()
            except (OSError, http.client.HTTPException):
                self.connection.close()
                self.connection = None
                raise
        self.take_cookie(response)
        return response.status, response.headers, data

    def ask(self, method, path, body=None, **headers):
        text = None if body is None else json.dumps(body)
        status, _, data = self.request(method, path, text, **headers)
        answer = json.loads(data)
        if status != 200:
            raise Failed(status, answer)
        if "token" in answer:
            self.token = answer["token"]
        return answer

    def load(self):
        return self.ask("GET", "/api/session")

    def log_in(self, user, password):
        return self.ask("POST", "/api/login", {"user": user, "password": password})

    def log_out(self):
        return self.ask("POST", "/api/logout", {})

    def call(self, method, **parameters):
        return self.ask("POST", f"/api/call/{method}", parameters)

    def run(self, drive, command, **arguments):
        parameters = {"drive": drive, "command": command}
        if arguments:
            parameters["arguments"] = arguments
        return self.call("Run", **parameters)["result"]

    def alive(self):
        return self.ask("POST", "/api/alive", {})

    def beat(self, drive, grip, beat, velocity, token=None):
        return self.ask("POST", "/api/jog", {"drive": drive, "grip": grip, "beat": beat, "velocity": velocity,
                                             "token": token or (self.newest_token() if velocity else "")})

    def hold(self, drive, velocity):
        """A button that is held until it is released."""
        self.grip += 1
        return Grip(self, drive, self.grip, velocity)

    def stream(self, method, **parameters):
        made = Stream(self, method, parameters)
        self.streams.append(made)
        return made


class Grip:
    """Beats each 100 ms, over a connection of its own, as a page sends them while a button is held."""

    def __init__(self, page, drive, number, velocity):
        self.page = page.beside()
        self.drive, self.number, self.velocity = drive, number, velocity
        self.beats = 0
        self.answers = []
        self.held = threading.Event()
        self.held.set()
        self.thread = threading.Thread(target=self._beat, daemon=True)
        self.thread.start()

    def _beat(self):
        while self.held.is_set():
            self.beats += 1
            try:
                self.answers.append(self.page.beat(self.drive, self.number, self.beats, self.velocity))
            except (OSError, http.client.HTTPException, Failed) as error:
                self.answers.append(error)
                return
            time.sleep(0.1)

    def last(self, key):
        """Of the latest answer; None before the first one, and behind an error."""
        last = self.answers[-1] if self.answers else None
        return last.get(key) if isinstance(last, dict) else None

    def let_go(self):
        """The button is released."""
        self.vanish()
        return self.page.beat(self.drive, self.number, self.beats + 1, 0)

    def vanish(self):
        """The beats just end."""
        self.held.clear()
        self.thread.join(10)


class Stream:
    """A stream of server-sent events, read by a thread of its own while nobody holds it."""

    def __init__(self, page, method, parameters):
        self.connection = page.connect()
        self.connection.request("POST", f"/api/stream/{method}", json.dumps(parameters), page.headers())
        self.response = self.connection.getresponse()
        self.events = []
        self.changed = threading.Condition()
        self.ended = False
        self.comments = 0
        self.token = None
        if self.response.status != 200:
            body = json.loads(self.response.read())
            self.connection.close()
            raise Failed(self.response.status, body)
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self):
        name, data = None, ""
        try:
            while line := self.response.readline():
                text = line.decode().rstrip("\n")
                if text.startswith(":"):
                    self.comments += 1
                elif text.startswith("event: "):
                    name = text[7:]
                elif text.startswith("data: "):
                    data += text[6:]
                elif not text and data:
                    with self.changed:
                        if name == "token":
                            self.token = json.loads(data)["token"]
                        else:
                            self.events.append((name, json.loads(data)))
                        self.changed.notify_all()
                    name, data = None, ""
        except (OSError, ValueError, AttributeError, http.client.HTTPException):
            pass
        with self.changed:
            self.ended = True
            self.changed.notify_all()

    def count(self):
        with self.changed:
            return len(self.events)

    def wait(self, check=lambda data: True, event=None, since=0, timeout=15):
        """The first event of this name that the check takes."""
        deadline = time.monotonic() + timeout
        with self.changed:
            while True:
                for name, data in self.events[since:]:
                    if name == event and check(data):
                        return data
                left = deadline - time.monotonic()
                assert not self.ended, f"the stream has ended; the last: {self.events[-3:]}"
                if left <= 0:
                    raise AssertionError(f"no such event; the last: {self.events[-3:]}")
                self.changed.wait(left)

    def wait_token(self, timeout=15):
        """The newest one; waits for the first."""
        with self.changed:
            self.changed.wait_for(lambda: self.token or self.ended, timeout)
            return self.token

    def wait_end(self, timeout=15):
        with self.changed:
            assert self.changed.wait_for(lambda: self.ended, timeout), "the stream does not end"
        return self.events[-1] if self.events else None

    def close(self):
        # The reader has the response: a shutdown ends its waiting.
        if self.connection.sock:
            try:
                self.connection.sock.shutdown(2)
            except OSError:
                pass
        self.thread.join(10)
        self.connection.close()


def memory_kib(process):
    """Resident, at most so far."""
    text = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    return int(re.search(r"VmHWM:\s+(\d+)", text)[1])
