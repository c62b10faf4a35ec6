# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua and clients of it (asyncua): certificates, the tree as a client finds it, subscriptions."""

import asyncio
import contextlib
import dataclasses
import datetime
import functools
import signal
import subprocess
import time

import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from bridgelib import eventually, find_program, free_address, section
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

URI = "urn:drivebridge:tests:client"
NAMESPACE = "urn:gw:drivebridge:drives"
TYPES = "urn:drivebridge:types"
DEVICES = "http://opcfoundation.org/UA/DI/"

# Names and passwords.
OPERATOR = ("olga", "turns-motors")
READER = ("rita", "only-looks")


def in_loop(test):
    """A test that is a coroutine."""

    @functools.wraps(test)
    def run(*args, **kwargs):
        asyncio.run(asyncio.wait_for(test(*args, **kwargs), 120))

    return run


async def until(check, timeout=10.0, what=None):
    """As bridgelib.eventually, while the loop goes on; check may be a coroutine."""
    deadline = time.monotonic() + timeout
    while True:
        value = check()
        if asyncio.iscoroutine(value):
            value = await value
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {timeout} s: {what or check}; last {value!r}")
        await asyncio.sleep(0.01)


@dataclasses.dataclass
class Certificate:
    """A client's own, with its key, as files that asyncua takes."""

    path: object
    key: object
    der: bytes


def make_certificate(place, name, begin=-1, end=30, uri=URI):
    """begin and end in days from now."""
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    now = datetime.datetime.now(datetime.timezone.utc)
    title = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    made = (
        x509.CertificateBuilder().subject_name(title).issuer_name(title).public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now + datetime.timedelta(days=begin))
        .not_valid_after(now + datetime.timedelta(days=end))
        .add_extension(x509.SubjectAlternativeName(
            [x509.UniformResourceIdentifier(uri), x509.DNSName("localhost")]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(
            digital_signature=True, content_commitment=True, key_encipherment=True,
            data_encipherment=True, key_agreement=False, key_cert_sign=False, crl_sign=False,
            encipher_only=False, decipher_only=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False)
        .sign(key, hashes.SHA256()))
    der = made.public_bytes(serialization.Encoding.DER)
    path, key_path = place / f"{name}.der", place / f"{name}.key.pem"
    path.write_bytes(der)
    key_path.write_bytes(key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()))
    return Certificate(path, key_path, der)


@functools.cache
def users_text():
    """The file of users; hashes as crypt(5) has them."""
    lines = []
    for (name, password), role in ((OPERATOR, "operator"), (READER, "reader")):
        done = subprocess.run(["openssl", "passwd", "-6", password], capture_output=True, text=True, check=True)
        lines.append(f"{name}:{role}:{done.stdout.strip()}\n")
    return "".join(lines)


class Server:
    """drivebridge-opcua, which can be ended and come back at the same place."""

    def __init__(self, place, bridge, **sections):
        self.place = place
        self.pki = place / "pki"
        self.log_path = place / "opcua.log"
        self.config_path = place / "opcua.conf"
        self.users_path = place / "opcua-users"
        self.host, self.port = free_address()
        self.url = f"opc.tcp://{self.host}:{self.port}"
        self.sections = {
            "service": {"socket": bridge.control_path if bridge else place / "nowhere"},
            "server": {"address": self.host, "port": self.port, "gateway": "gw"},
            "security": {"none": "read", "anonymous": "read", "pki": self.pki, "users": self.users_path},
            "commands": {"confirm-ms": 1000},
            "limits": {},
        }
        for name, keys in sections.items():
            self.sections[name].update(keys)
        self.process = None

    def write_config(self):
        text = "\n".join(section(title, keys) for title, keys in self.sections.items())
        self.config_path.write_text(text, encoding="utf-8")

    def launch(self, *arguments, **options):
        self.write_config()
        self.users_path.write_text(users_text(), encoding="utf-8")
        self.users_path.chmod(0o640)
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(
                [find_program("drivebridge-opcua"), "--config", self.config_path, *arguments],
                stdout=log, stderr=log, **options)
        return self

    def start(self):
        offset = self.log_path.stat().st_size if self.log_path.exists() else 0
        self.launch()

        def listening():
            assert self.process.poll() is None, self.log()
            return "listens on " in self.log()[offset:]

        eventually(listening, what="the OPC UA server to listen")
        return self

    def trust(self, certificate):
        """As an administrator does: copies it."""
        folder = self.pki / "trusted"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / certificate.path.name).write_bytes(certificate.der)

    def log(self):
        return self.log_path.read_text(errors="replace")

    def wait_for_log(self, text, timeout=10):
        eventually(lambda: text in self.log(), timeout, f"'{text}' in its log")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(10)

    def finish(self):
        """What was wrong with its end."""
        problems = []
        if self.process and self.process.poll() is None:
            try:
                if self.stop() != 0:
                    problems.append(f"drivebridge-opcua ended with {self.process.returncode}")
            except subprocess.TimeoutExpired:
                self.process.kill()
                problems.append("drivebridge-opcua did not end")
        text = self.log() if self.log_path.exists() else ""
        if "Sanitizer" in text or "runtime error:" in text:
            problems.append("sanitizer output of drivebridge-opcua")
        return problems

    # --- its clients

    def client(self, certificate=None, user=None, policy=SecurityPolicyBasic256Sha256,
               mode=ua.MessageSecurityMode.SignAndEncrypt, uri=URI, port=None):
        """One that is not connected yet; without a certificate of security policy None. user: (name, password); port: of a
        line to the server."""
        made = Client(f"opc.tcp://127.0.0.1:{port}" if port else self.url, timeout=10)
        made.application_uri = uri
        made.security = (policy, certificate, mode) if certificate else None
        if user:
            made.set_user(user[0])
            made.set_password(user[1])
        return made

    @contextlib.asynccontextmanager
    async def session(self, *args, **options):
        """A client that is connected; nothing is said when its server has gone meanwhile."""
        made = await connect(self.client(*args, **options))
        try:
            # It finds the drives while it serves clients already; 32 of them take 6 s with sanitizers on a quiet machine.
            await until(at(made, "/Drives").get_children, timeout=40, what="drives")
            yield made
        finally:
            with contextlib.suppress(Exception):
                await asyncio.wait_for(made.disconnect(), 5)


async def connect(client, namespace=NAMESPACE):
    """Connects it, and has the numbers of the namespaces of drives and of types in it."""
    if client.security:
        policy, certificate, mode = client.security
        await client.set_security(policy, str(certificate.path), str(certificate.key), mode=mode)
    await client.connect()
    client.space = await client.get_namespace_index(namespace)
    client.types = await client.get_namespace_index(TYPES)
    client.devices = await client.get_namespace_index(DEVICES)
    return client


def type_at(client, name):
    """The node of this name among the types: DriveType.AxisState."""
    return client.get_node(ua.NodeId(name, client.types))


def at(client, name):
    """The node of this name: feeder.PositionActualValue."""
    return client.get_node(ua.NodeId(name, client.space))


async def outcome(session, drive, command, *arguments):
    """The status of a method by its name, and what it returns: what a client shows to people who look closer."""
    node = at(session, f"{drive}.{command}")
    request = ua.CallMethodRequest(at(session, drive).nodeid, node.nodeid, await typed(node, arguments))
    result = (await session.uaclient.call([request]))[0]
    return result.StatusCode.name, *(one.Value for one in result.OutputArguments)


async def call(client, drive, command, *arguments):
    """A command by its method, with arguments of the types that it declares. On a machine that is busy with other things it may
    be pending, and the one before may be so still: then it is told again, as nothing was done."""
    node = at(client, f"{drive}.{command}")
    values = await typed(node, arguments)
    for _ in range(200):
        try:
            return await at(client, drive).call_method(node, *values)
        except ua.uaerrors.BadRequestNotComplete:
            return ["pending", ""]
        except ua.uaerrors.BadResourceUnavailable:
            await asyncio.sleep(0.05)
    raise AssertionError(f"{drive}: what was told before {command} does not end")


async def typed(method, values):
    declared = []
    with contextlib.suppress(ua.uaerrors.BadNoMatch):
        declared = await (await method.get_child("0:InputArguments")).read_value()
    types = [ua.VariantType(one.DataType.Identifier) for one in declared]
    return [ua.Variant(value, kind) for value, kind in zip(values, types)] + list(values[len(types):])


def cut(client):
    """As a cable that is pulled: the connection is gone without a goodbye."""
    client.uaclient.disconnect_socket()


# --- fixtures, which tests import


@pytest.fixture(scope="session", name="certificate")
def fixture_certificate(tmp_path_factory):
    """A client's, which servers of tests trust."""
    return make_certificate(tmp_path_factory.mktemp("certificate"), "client")


@pytest.fixture(name="make_server")
def fixture_make_server(request, tmp_path, certificate):
    """A function that starts a server for a bridge; it is ended, and judged, afterwards."""
    made = []

    def make(bridge, **options):
        server = Server(tmp_path, bridge, **options)
        server.trust(certificate)
        made.append(server)
        return server.start()

    yield make
    problems = [problem for server in made for problem in server.finish()]
    if problems or getattr(request.node, "failed", False):
        for server in made:
            print(f"--- {server.config_path}\n{server.config_path.read_text(encoding='utf-8')}")
            print(f"--- {server.log_path}\n{server.log()[-20000:]}")
    assert not problems, problems


# --- the tree


@dataclasses.dataclass
class Entry:
    """A node as a client finds it: references forward, by the name of what they lead to."""

    node: object
    name: str
    kind: ua.NodeClass
    type: object
    children: dict = dataclasses.field(default_factory=dict)

    def find(self, path):
        entry = self
        for name in path.split("/"):
            entry = entry.children[name]
        return entry

    def walk(self, path=""):
        yield path, self
        for name, child in self.children.items():
            yield from child.walk(f"{path}/{name}" if path else name)


async def browse(client, node, name=""):
    """Everything below a node, with as many nodes a request as a client may ask for."""
    root = Entry(node, name, ua.NodeClass.Object, None)
    fresh, seen = [root], {node.nodeid: root}
    while fresh:
        batch, fresh = fresh[:100], fresh[100:]
        for entry, (_, result) in zip(batch, await client.browse_nodes([one.node for one in batch])):
            result.StatusCode.check()
            references = list(result.References)
            while result.ContinuationPoint:
                request = ua.BrowseNextParameters()
                request.ContinuationPoints = [result.ContinuationPoint]
                result = (await client.uaclient.browse_next(request))[0]
                references += result.References
            for one in references:
                if not one.IsForward or one.ReferenceTypeId.Identifier not in HIERARCHICAL:
                    continue
                child = seen.get(one.NodeId)
                if child is None:
                    child = Entry(client.get_node(one.NodeId), one.BrowseName.Name, one.NodeClass,
                                  one.TypeDefinition)
                    seen[one.NodeId] = child
                    fresh.append(child)
                entry.children[one.BrowseName.Name] = child
    return root


HIERARCHICAL = {ua.ObjectIds.Organizes, ua.ObjectIds.HasComponent, ua.ObjectIds.HasProperty,
                ua.ObjectIds.HasOrderedComponent, ua.ObjectIds.HasAddIn}


async def read_all(client, entries, attribute=ua.AttributeIds.Value):
    """The data values of this attribute, in the order of the entries."""
    values = []
    for first in range(0, len(entries), 200):
        values += await client.read_attributes([one.node for one in entries[first:first + 200]], attribute)
    return values


# --- subscriptions


class Follower:
    """Keeps each data change and event of one subscription, in the order in which they came."""

    def __init__(self, client):
        self.client = client
        self.changes = {}
        self.events = []
        self.subscription = None

    def datachange_notification(self, node, value, data):
        self.changes.setdefault(node.nodeid.Identifier, []).append(data.monitored_item.Value)

    def event_notification(self, event):
        self.events.append(event)

    def status_change_notification(self, status):
        pass

    async def start(self, nodes=(), interval=50, events=None, queue=100):
        self.subscription = await self.client.create_subscription(interval, self)
        if nodes:
            await self.subscription.subscribe_data_change(
                nodes, queuesize=queue, sampling_interval=interval)
        if events:
            await self.subscription.subscribe_events(*events)
        return self

    def of(self, node):
        return self.changes.get(node.nodeid.Identifier, [])

    def status(self, node):
        """Of its latest value."""
        return self.of(node)[-1].StatusCode


def event_of(follower, kind):
    """The first one of a type by its name."""
    return next((one for one in follower.events if one.EventType.Identifier == f"{kind}EventType"), None)


def is_bad(status, *names):
    """Whether a StatusCode is one of these."""
    return status.value in [getattr(ua.StatusCodes, name) for name in names]


@contextlib.contextmanager
def says(*names):
    """What is in it ends with one of these status codes."""
    with pytest.raises(ua.uaerrors.UaStatusCodeError) as caught:
        yield
    assert type(caught.value).__name__ in names, caught.value


# --- bytes on the wire


class Recorder:
    """A line to the server that keeps each message of the client, and comes from another address of this machine."""

    def __init__(self, server, source="127.0.0.1"):
        self.server = server
        self.source = source
        self.messages = []

    async def __aenter__(self):
        self.listener = await asyncio.start_server(self._carry, "127.0.0.1", 0)
        self.port = self.listener.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *unused):
        self.listener.close()

    async def _carry(self, reader, writer):
        far_reader, far_writer = await asyncio.open_connection(
            self.server.host, self.server.port, local_addr=(self.source, 0))

        async def back():
            while data := await far_reader.read(65536):
                writer.write(data)
            writer.close()

        task = asyncio.create_task(back())
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                head = await reader.readexactly(8)
                body = await reader.readexactly(int.from_bytes(head[4:], "little") - 8)
                self.messages.append(head + body)
                far_writer.write(head + body)
        far_writer.close()
        await task


def spoil(message, random):
    """The message with something wrong in it: bits, bytes, lengths, its end."""
    data = bytearray(message)
    for _ in range(random.choice((1, 1, 2, 5))):
        what = random.randrange(7)
        at = random.randrange(len(data)) if data else 0
        if what == 0 and data:
            data[at] ^= 1 << random.randrange(8)
        elif what == 1 and data:
            data[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF))
        elif what == 2:
            data[at:at + 4] = random.choice((0, 1, 0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0x10000,
                                             len(data))).to_bytes(4, "little")
        elif what == 3:
            del data[at:]
        elif what == 4:
            del data[at:at + random.randrange(1, 9)]
        elif what == 5:
            data[at:at] = bytes(random.randrange(256) for _ in range(random.randrange(1, 60)))
        else:
            data[4:8] = random.randrange(0, 2 * len(data) + 9).to_bytes(4, "little")
    return bytes(data)


async def say(server, messages, last, patience):
    """A connection of its own that says the messages as in a conversation, with the channel that this server
    opens for it, and then the last one; until the server says something or closes it."""
    reader, writer = await asyncio.open_connection(server.host, server.port)
    channel = None
    try:
        for message in messages:
            writer.write(in_channel(message, channel))
            head = await asyncio.wait_for(reader.readexactly(8), 10)
            body = await reader.readexactly(int.from_bytes(head[4:], "little") - 8)
            if head.startswith(b"OPN"):
                channel = channel_of(body)
        writer.write(in_channel(last, channel))
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(reader.read(4096), patience)
    except (ConnectionError, asyncio.IncompleteReadError):
        pass
    finally:
        writer.close()


def in_channel(message, channel):
    """A recorded message with the id and the token of another channel."""
    if channel and message[:3] in (b"MSG", b"CLO"):
        return message[:8] + channel + message[16:]
    return message


def channel_of(body):
    """Of an answer to OpenSecureChannel without security: the channel's id and its token's."""
    at = 4
    for _ in range(3):
        length = int.from_bytes(body[at:at + 4], "little", signed=True)
        at += 4 + max(length, 0)
    # Sequence header, type, response header, protocol version.
    return body[at + 8 + 4 + 24 + 4:][:8]
