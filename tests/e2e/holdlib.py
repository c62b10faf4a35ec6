# SPDX-License-Identifier: Apache-2.0
"""Who holds a motion over the control socket: a session that is asked for beats, in a test's own process or in one of
its own that can be killed and frozen: python holdlib.py SOCKET DRIVE HOLD_MS VELOCITY."""

import json
import socket
import sys
import time

INTERFACE = "io.drivebridge.Control"


class Failed(Exception):
    """The service answered with an error: its last word, and its parameters."""

    def __init__(self, name, parameters):
        super().__init__(name, parameters)
        self.name = name.rsplit(".", 1)[1]
        self.parameters = parameters


class Hand:
    """A session without a library, because what is sent when matters here."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(10)
        self.socket.connect(str(path))
        self.rest = b""

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()

    def close(self):
        self.socket.close()

    @staticmethod
    def message(method, flags=None, **parameters):
        call = {"method": f"{INTERFACE}.{method}", "parameters": parameters, **(flags or {})}
        return json.dumps(call).encode() + b"\0"

    def send(self, method, flags=None, **parameters):
        self.socket.sendall(self.message(method, flags, **parameters))

    def answer(self):
        while b"\0" not in self.rest:
            more = self.socket.recv(65536)
            if not more:
                raise ConnectionError("closed")
            self.rest += more
        text, self.rest = self.rest.split(b"\0", 1)
        said = json.loads(text)
        if "error" in said:
            raise Failed(said["error"], said["parameters"])
        return said["parameters"]

    def call(self, method, **parameters):
        self.send(method, **parameters)
        return self.answer()

    def token(self):
        return self.call("Clock")["token"]

    def run(self, command, drive="drive1", **more):
        return self.call("Run", drive=drive, command=command, **more)["result"]

    def hold(self, velocity, hold_ms=300, drive="drive1"):
        return self.run("move_velocity", drive, arguments={"target_velocity": velocity}, hold_ms=hold_ms,
                        token=self.token())

    def beat(self, drive="drive1"):
        self.call("Beat", drive=drive, token=self.token())


def main(path, drive, hold_ms, velocity):
    with Hand(path) as hand:
        hand.hold(float(velocity), int(hold_ms), drive)
        while True:
            time.sleep(0.03)
            hand.beat(drive)
            print(time.monotonic(), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
