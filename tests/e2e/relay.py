# SPDX-License-Identifier: Apache-2.0
"""A line between a program and a server."""

import collections
import socket
import threading
import time


class Relay:
    """A line to a server, which has a host and a port, that can stand still. heard(bytes) is told what clients send, as
    it goes on to the server."""

    def __init__(self, server, address=("127.0.0.1", 0), heard=lambda data: None):
        self.server = server
        self.heard = heard
        self.listener = socket.create_server(address)
        self.port = self.listener.getsockname()[1]
        self.flows = threading.Event()
        self.flows.set()
        self.sockets = []
        # What clients have sent, and still waits here.
        self.kept = b""

    def __enter__(self):
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *unused):
        self.flows.set()
        for one in [self.listener, *self.sockets]:
            one.close()

    def _accept(self):
        try:
            while True:
                near = self.listener.accept()[0]
                # Little is under way while it stands still.
                near.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                far = socket.create_connection((self.server.host, self.server.port))
                self.sockets += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._carry, args=(one, other, one is near), daemon=True).start()
        except OSError:
            pass

    def _carry(self, one, other, upward):
        try:
            while True:
                data = one.recv(4096)
                if upward and not self.flows.is_set():
                    self.kept += data
                self.flows.wait()
                if not data:
                    break
                if upward:
                    self.heard(data)
                other.sendall(data)
        except OSError:
            pass
        for each in (one, other):
            try:
                each.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def hold(self):
        self.flows.clear()

    def go_on(self):
        self.kept = b""
        self.flows.set()


class SlowLine(Relay):
    """A line whose answers come `delay` s late, or with at most `rate` bytes/s, as over a weak radio link; both may be
    changed while it runs. Little of what waits is in buffers of the machine."""

    def __init__(self, server):
        super().__init__(server)
        self.delay = 0.0
        self.rate = None

    def _carry(self, one, other, upward):
        if upward:
            super()._carry(one, other, upward)
            return
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        waiting = collections.deque()
        come = threading.Condition()
        threading.Thread(target=self._deliver, args=(other, waiting, come), daemon=True).start()
        data = b"first"
        while data:
            # What is under way on the line does not keep the sender from sending; what the line is too slow for does.
            with come:
                come.wait_for(lambda: self.rate is None or len(waiting) < 2)
            try:
                data = one.recv(512 if self.rate else 4096)
            except OSError:
                data = b""
            with come:
                waiting.append((time.monotonic(), data))
                come.notify_all()

    def _deliver(self, other, waiting, come):
        while True:
            with come:
                come.wait_for(lambda: waiting)
                moment, data = waiting[0]
            time.sleep(max(0, moment + self.delay - time.monotonic()))
            if self.rate:
                time.sleep(len(data) / self.rate)
            with come:
                waiting.popleft()
                come.notify_all()
            try:
                if not data:
                    other.shutdown(socket.SHUT_RDWR)
                    return
                other.sendall(data)
            except OSError:
                return
