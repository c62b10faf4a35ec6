# SPDX-License-Identifier: Apache-2.0
"""A small control socket that a test plays, for what the real one does only when something is wrong."""

import json
import socket
import threading

SERVICE = "io.drivebridge.Control."

STATES = {"0": "Offline", "1": "Disabled", "2": "Standstill", "4": "ContinuousMotion", "7": "ErrorStop"}
BITS = {"0": "online", "1": "enabled", "3": "moving", "10": "latched", "11": "origin_lost"}


def register(name, kind="i32", writable=False, unit="", parameter=False, **more):
    return {"name": name, "type": kind, "writable": writable, "unit": unit, "parameter": parameter,
            "description": f"What {name} is", **more}


REGISTERS = [
    register("axis_state", "u16", codes=STATES),
    register("error", "u16", codes={"0": "none", "1": "no_answer", "3": "client_loss"}),
    register("status", "bits32", codes=BITS),
    register("age_ms", "u32", unit="ms"),
    register("position", unit="counts"),
    register("velocity", "f32", unit="counts/s"),
    register("target_position", writable=True, unit="counts", min=-1000, max=1000),
    register("target_velocity", "f32", True, "counts/s", min=-5000, max=5000),
    register("identity", "text"),
    register("spd", "f32", True, "pulses/s", True, min=0, max=400000),
]
COMMANDS = [
    {"name": "enable", "code": 1, "arguments": [], "description": "Power the motor"},
    {"name": "stop", "code": 3, "arguments": [], "description": "Stop"},
    {"name": "move_velocity", "code": 5, "arguments": ["target_velocity"], "description": "Run"},
    {"name": "move_absolute", "code": 6, "arguments": ["target_position", "target_velocity"],
     "description": "Go"},
]


class Fake:
    """Answers by self.answers: {method: parameters, an error's name, or a function of the parameters}. A function may
    also return raw bytes, a list of several answers, or None for none."""

    def __init__(self, path):
        self.path = str(path)
        self.calls = []
        self.values = {"axis_state": 2, "error": 0, "status": 3, "age_ms": 12, "position": 100,
                       "velocity": 0.0}
        # What is wrong by name: cause, need, advice, and detail where there is one.
        self.troubles = {}
        self.answers = {
            "Describe": {
                "version": "0.1.0", "configuration": "/etc/x.conf", "started_us": 0, "may_act": True,
                "buses": [{"name": "line", "protocol": "vsmd-serial", "title": "VSMD", "device":
                           "/dev/ttyS0", "speed": 115200, "cycle_ms": 20, "up": True,
                           "drives": ["feeder", "lift"]}],
                "drives": [{"name": name, "bus": "line", "address": unit, "axis": "", "unit": unit,
                            "unit_name": ""} for unit, name in enumerate(["feeder", "lift"], 1)],
            },
            "Registers": {"registers": REGISTERS},
            "Commands": {"commands": COMMANDS},
            "Read": lambda parameters: {"values": self.values},
            "Troubles": lambda parameters: {
                "drives": [self.trouble("drive", name) for name in parameters["drives"] or ["feeder", "lift"]],
                "buses": [self.trouble("bus", "line")], "configuration": self.trouble("configuration", ""),
                "well": not any(trouble[1] in ("look", "act") for trouble in self.troubles.values())},
            "Write": {"result": "ok"},
            "Run": {"result": "ok"},
            "Clock": {"token": "8f3a2c71-123456"},
        }
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.bind(self.path)
        self.socket.listen(8)
        self.connections = []
        threading.Thread(target=self._accept, daemon=True).start()

    def trouble(self, kind, name):
        cause, need, advice, *detail = self.troubles.get(name, ("none", "nothing", ""))
        return {kind: name, "cause": cause, "need": need, "detail": detail[0] if detail else "", "since_us": 0, "advice": advice, "event": None}

    def _accept(self):
        while True:
            try:
                connection, _ = self.socket.accept()
            except OSError:
                return
            self.connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        data = b""
        while True:
            try:
                more = connection.recv(65536)
            except OSError:
                return
            if not more:
                return
            data += more
            while b"\0" in data:
                text, data = data.split(b"\0", 1)
                try:
                    self._answer(connection, json.loads(text))
                except OSError:
                    return

    def _answer(self, connection, call):
        method = call["method"].removeprefix(SERVICE)
        parameters = call.get("parameters", {})
        self.calls.append((method, parameters))
        if call.get("oneway"):
            return
        answer = self.answers.get(method, "org.varlink.service.MethodNotFound")
        if callable(answer):
            answer = answer(parameters)
        if answer is None:
            return
        if isinstance(answer, bytes):
            connection.sendall(answer)
            return
        for at, one in enumerate(answer if isinstance(answer, list) else [answer]):
            message = {"error": one, "parameters": {"method": method}} if isinstance(one, str) else (
                one if "error" in one else {"parameters": one})
            if isinstance(answer, list) and at + 1 < len(answer):
                message["continues"] = True
            connection.sendall(json.dumps(message).encode() + b"\0")

    def called(self, method):
        return [parameters for name, parameters in list(self.calls) if name == method]

    def runs(self):
        return [parameters["command"] for parameters in self.called("Run")]

    def cut(self):
        """All connections are lost; who comes again at once is let in."""
        lost, self.connections = self.connections, []
        for connection in lost:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def close(self):
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.socket.close()
        self.cut()
