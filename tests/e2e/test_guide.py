# SPDX-License-Identifier: Apache-2.0
"""The user guide says what is true: its configurations pass --check, its mbpoll lines are typed against
the simulator, its names, numbers, log lines and links exist."""

import csv
import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import pytest
from bridgelib import DISCRETE, HOMING, ROOT, STOPPING, eventually, find_program

GUIDE = ROOT / "docs" / "guide"
# Tables that the guide leads to, and that are as long as a book.
REFERENCE = [ROOT / "docs" / name for name in ("exchanges.md", "temperaments.md", "evidence.md", "mqtt-sparkplug.md", "schedule.md",
                                                "structured-text.md", "servo-profiles.md", "machine.md", "glossary.md",
                                                "special-registers.md", "page-behind-others.md", "opcua-alarms.md", "clients.md",
                                                "audit-files.md")]
PAGES = [page for folder in (GUIDE, GUIDE / "zh", GUIDE / "de") for page in sorted(folder.glob("*.md"))] + REFERENCE
README = ROOT / "README.md"
READMES = [README, ROOT / "README.zh-CN.md", ROOT / "README.de.md"]
QUICK = [page for page in PAGES if page.stem.startswith("quick-")]
FENCES = {"sh", "conf", "ini", "yaml", "udev", "log", "mermaid", "iecst", "scl", "exchange", "console", "mqtt", "mqttconf",
          "opcua", "opcuaconf", "webconf", "nginx", "lighttpd", "profile", "text"}

# What mbpoll prints for an exception.
EXCEPTIONS = {
    0x01: "Illegal function",
    0x02: "Illegal data address",
    0x03: "Illegal data value",
    0x04: "Slave device or server failure",
    0x06: "Slave device or server is busy",
    0x0B: "Target device failed to respond",
}

# Words in code formatting that are none of the program's own.
FOREIGN = {
    # programs, users, files
    "dialout", "drivebridge", "drivebridged", "drivebridgectl", "mbpoll", "latency_timer", "timedatectl",
    # other products' words
    "CONNECT", "MB_CLIENT", "MB_MODE", "MB_DATA_ADDR", "MB_DATA_LEN", "MB_DATA_PTR",
    "MB_Unit_ID", "REQ", "BUSY", "STATUS", "uiMaxRetries", "UNION", "WORD", "DINT", "REAL", "Int", "DInt", "Real", "TCON_IP_v4",
    "FB_MBReadRegs", "FB_MBWriteRegs", "nUnitID", "nQuantity", "nMBAddr", "tTimeout",
    "SamplePoint", "RestartSec", "DRIVEBRIDGE_DEMO_PORT", "DRIVEBRIDGE_DEMO_WEB_PORT", "ID_PATH",
    "modbus_exporter", "decode", "HR1", "HRI13", "HRF15",
    # a column of the map
    "reference",
    # commands of drivebridgectl
    "jog", "run", "watch", "events", "metrics", "scan", "traces", "record",
    # Sparkplug
    "buffered", "dropped", "software", "engUnit", "engLow", "engHigh", "documentation", "is_null", "true", "Quality",
    # topics and words of drivebridge-mqtt, and what is in its messages
    "drivebridge-mqtt", "online", "no-service", "offline", "state", "changes", "about", "time", "alive", "id",
    "values", "figures", "certificate_ends_s", "good", "uncertain", "bad", "null", "retain", "write", "hint", "act",
    # drivebridge-opcua: its folders, and words of OPC UA
    "drivebridge-opcua", "trusted", "issuers", "revoked", "Objects", "Server", "Reason", "ClearFault", "Stop",
    "EngineeringUnits", "EURange",
    # ... of its conditions and of the past ...
    "DiscreteAlarmType", "AlarmConditionType", "HasCondition", "ConditionName", "ActiveState", "AckedState", "Retain", "Severity",
    "Comment", "ClientUserId", "Acknowledge", "Confirm", "AddComment", "Disable", "ConditionRefresh", "ConditionRefresh2",
    "Drives", "Time", "SourceName", "Message", "ComponentType",
    "HistoryRead", "BadEventIdUnknown", "BadRefreshInProgress", "BadHistoryOperationUnsupported",
    "DriveEventType", "DriveLostEventType", "DriveOnlineEventType", "WatchdogTrippedEventType", "Standstill", "GATEWAY",
    "GeneralModelChangeEvent", "customDataTypes", "DataTypeDefinition", "NodeAdded", "NodeDeleted", "ReferenceAdded", "ReferenceDeleted", "Trouble",
    "VsmdSerialDriveType", "VsmdCanDriveType", "XyzaDriveType", "ServoCanDriveType", "DriveType",
    "AxisStateEnum", "ResultEnum", "CommandEnum", "StatusBits",
    "Good", "GoodCompletesAsynchronously", "UncertainLastUsableValue", "BadNoCommunication", "BadWaitingForInitialData",
    "BadOutOfRange", "BadInvalidState", "BadTimeout", "BadUserAccessDenied", "BadUnknownResponse", "BadNotExecutable", "opcua-client",
    "BadTcpServerTooBusy", "BadInvalidTimestamp", "BadRequestNotComplete", "BadResourceUnavailable", "BadTooManyOperations",
    "OperationLimits", "Diagnosis", "TroubleCause",
    "ComponentType", "Identification", "Drives", "AuditTrailEventType", "Time", "SourceName", "Message", "Details", "RecordOf",
    "TookUs",
    # drivebridge-tls
    "drivebridge-tls", "mbaps", "ModbusTlsClient", "drivebridge_tls_certificate_expires_timestamp_seconds",
    # drivebridge-web
    "drivebridge-web", "drivebridge-webd", "IPAddressAllow", "drivebridge_restart_needed", "drivebridge_web_requests_total", "drivebridge_web_streams",
    "drivebridge_web_certificate_expires_timestamp_seconds", "libpam-ldapd",
    "drivebridge_web_failed_logins_total", "drivebridge_web_late_jogs_total",
    # events of the log
    "hold-lost", "drive-may-have-restarted", "line-lost",
    # figures of lines with a PLC, and what Wireshark calls a kind of packets
    "drivebridge_modbus_rtu_bad_total", "LINKTYPE_USER0",
    # sections of the configuration
    "modbus", "bus", "drive", "modbus-rtu",
}

NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*([_-][A-Za-z0-9]+)*")
SETTING = re.compile(r"([a-z][a-z0-9-]*) = (.+)")


def name_of(page):
    """zh-quick-plc of zh/quick-plc.md, top of the README."""
    if page in READMES:
        return {"README": "top", "README.zh-CN": "top-zh", "README.de": "top-de"}[page.stem]
    if page in REFERENCE:
        return page.stem
    return "-".join(page.relative_to(GUIDE).with_suffix("").parts)


class Block:
    """A fenced part of a page."""

    def __init__(self, kind, line):
        self.kind = kind
        self.line = line
        self.lines = []

    @property
    def text(self):
        return "\n".join(self.lines) + "\n"


def parse(path):
    """The blocks of a page, and its prose with everything fenced left out."""
    blocks, prose, block = [], [], None
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        fence = re.fullmatch(r"\s*```(\w*)", line)
        if fence and block is None:
            block = Block(fence[1], number)
        elif fence:
            blocks.append(block)
            block = None
        elif block is not None:
            block.lines.append(line)
        else:
            prose.append((number, line))
    assert block is None, f"{path.name}: a block does not end"
    return blocks, prose


def blocks_of(kind):
    return [(page, block) for page in PAGES for block in parse(page)[0] if block.kind == kind]


def names(items):
    return [f"{name_of(page)}:{block.line}" for page, block in items]


def spans(page):
    """What stands in code formatting outside of blocks."""
    for number, line in parse(page)[1]:
        for span in re.findall(r"`([^`]+)`", line):
            yield f"{page.name}:{number}", span


# --- names and numbers ---------------------------------------------------------------------------


def rows(name):
    with open(ROOT / "docs" / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


REGISTERS = rows("register-map.csv")
COMMANDS = rows("commands.csv")
KEYS = rows("config-keys.csv") + rows("mqtt-keys.csv") + rows("opcua-keys.csv") + rows("web-keys.csv") \
    + rows("tls-keys.csv")


def enumerations():
    """Names of values, as the descriptions of registers list them: name=code and code=name."""
    for row in REGISTERS:
        for code, name in re.findall(r"\b(\d+)=([A-Za-z_0-9]+)", row["description"]):
            yield name, int(code)


def numbers_of():
    """What number a name may stand with."""
    known = {}
    for row in REGISTERS:
        known.setdefault(row["name"], set()).add(int(row["address"]))
    for row in COMMANDS:
        known.setdefault(row["name"], set()).add(int(row["code"]))
    for name, code in enumerations():
        known.setdefault(name, set()).add(code)
    return known


NUMBERS = numbers_of()
KEY_NAMES = {row["name"] for row in KEYS}
WORDS = {word for row in KEYS for word in row["words"].split()}
FAMILIES = {"vsmd-serial", "vsmd-can", "xyza", "servo-can"}
# Methods, errors and parameters of the control socket.
INTERFACE_NAMES = {word for words in re.findall(
    r"^(?:method|error) (\w+)|\b(\w+): ", (ROOT / "docs" / "io.drivebridge.Control.varlink").read_text(encoding="utf-8"),
    re.M) for word in words}
STEPS = set(re.findall(r'^\t{ "([a-z-]+)", (?:true|false), ',
                       (ROOT / "src" / "tools" / "commission" / "steps.c").read_text(encoding="utf-8"), re.M))
KNOWN = STEPS | set(NUMBERS) | KEY_NAMES | WORDS | FAMILIES | FOREIGN | INTERFACE_NAMES


def structured_text(page):
    """The names in a page's programs, and in the library that they use."""
    texts = [block.text for block in parse(page)[0] if block.kind == "iecst"]
    texts += [path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.st")]
    return {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}


def simulator_words(page):
    """The keys and values of the simulator's configuration, which one page is about."""
    if page.stem != "temperaments":
        return set()
    texts = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "src" / "sim").glob("*.c"))]
    return {word for text in texts for word in re.findall(r'"([a-z0-9-]+)"', text)}


def node_words(page):
    """The parts of nodes' ids, on the page that is about them."""
    if page.stem not in ("opcua", "opcua-alarms"):
        return set()
    ids = [row["node"].strip("/") for row in rows("opcua-nodes.csv")]
    ids += re.findall(r'NodeId="ns=1;s=([^"]+)"', (ROOT / "docs" / "drivebridge.NodeSet2.xml").read_text(encoding="utf-8"))
    return {word for one in ids for word in one.split(".")}


def wrong_setting(key, value):
    fitting = [row for row in KEYS if row["name"] == key]
    if not fitting:
        return f"no key {key}"
    if value.startswith('"') or value == "FILE":
        return None
    for row in fitting:
        if row["words"] and value in row["words"].split():
            return None
        if row["type"] == "family" and value in FAMILIES:
            return None
        if row["type"] in ("integer", "number") and re.fullmatch(r"-?[0-9.]+", value):
            low, high = row["min"] or "-inf", row["max"] or "inf"
            if float(low) <= float(value) <= float(high):
                return None
    return f"{key} cannot be {value}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_names_exist(page):
    wrong, known = [], KNOWN | structured_text(page) | simulator_words(page) | node_words(page)
    for place, span in spans(page):
        setting = SETTING.fullmatch(span)
        if setting and setting[1] in NUMBERS and setting[1] not in KEY_NAMES:
            wrong += [f"{place}: {span}: write a register's value in prose"]
        elif setting:
            complaint = wrong_setting(setting[1], setting[2])
            wrong += [f"{place}: {complaint}"] if complaint and setting[1] not in simulator_words(page) else []
        elif NAME.fullmatch(span) and span not in known:
            wrong.append(f"{place}: {span}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_numbers_belong_to_their_names(page):
    wrong = []
    for number, line in parse(page)[1]:
        pairs = re.findall(r"`(\w+)` \((0|[1-9]\d*)\)", line)
        pairs += [(name, code) for code, name in re.findall(r"\b(0|[1-9]\d*) \(`(\w+)`\)", line)]
        wrong += [f"{page.name}:{number}: {name} is not {code}" for name, code in pairs
                  if int(code) not in NUMBERS.get(name, ())]
    assert not wrong, "\n".join(wrong)


# --- configurations ------------------------------------------------------------------------------


CONFIGURATIONS = blocks_of("conf")


@pytest.mark.parametrize("page, block", CONFIGURATIONS, ids=names(CONFIGURATIONS))
def test_configuration_is_right(page, block, tmp_path):
    path = tmp_path / "guide.conf"
    path.write_text(block.text, encoding="utf-8")
    done = subprocess.run([find_program("drivebridged"), "--config", path, "--check"],
                          capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, f"{page.name}:{block.line}\n{done.stderr}"


PROFILES = blocks_of("profile")


@pytest.mark.parametrize("page, block", PROFILES, ids=names(PROFILES))
def test_profile_is_right(page, block, tmp_path):
    """For a bus of the family that it says."""
    (tmp_path / "profile.conf").write_text(block.text, encoding="utf-8")
    protocol = re.search(r"protocol\s*= (\S+)", block.text)[1]
    path = tmp_path / "guide.conf"
    path.write_text(f"bus b {{ protocol = {protocol} interface = can0 profile = profile.conf }}\n"
                    "drive d { bus = b address = 1 unit = 1 }\n", encoding="utf-8")
    done = subprocess.run([find_program("drivebridged"), "--config", path, "--check"],
                          capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, f"{page.name}:{block.line}\n{done.stderr}"
    assert "from profile" in done.stdout


MQTT_CONFIGURATIONS = blocks_of("mqttconf")


@pytest.mark.parametrize("page, block", MQTT_CONFIGURATIONS, ids=names(MQTT_CONFIGURATIONS))
def test_mqtt_configuration_is_right(page, block, tmp_path):
    path, secret = tmp_path / "mqtt.conf", tmp_path / "password"
    secret.write_text("secret\n", encoding="utf-8")
    secret.chmod(0o640)
    path.write_text(block.text.replace("/etc/drivebridge/mqtt-password", str(secret)), encoding="utf-8")
    done = subprocess.run([find_program("drivebridge-mqtt"), "--config", path, "--check"],
                          capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, f"{page.name}:{block.line}\n{done.stderr}"


WEB_CONFIGURATIONS = blocks_of("webconf")


@pytest.mark.parametrize("page,block", WEB_CONFIGURATIONS, ids=names(WEB_CONFIGURATIONS))
def test_web_configuration_is_right(page, block, tmp_path):
    made = {kind: tmp_path / f"{kind}.pem" for kind in ("certificate", "key")}
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                    "-subj", "/CN=gateway", "-out", made["certificate"], "-keyout", made["key"]],
                   capture_output=True, timeout=60, check=True)
    (tmp_path / "index.html").write_text("", encoding="utf-8")
    text = block.text.replace("/etc/drivebridge/web-certificate.pem", str(made["certificate"]))
    path = tmp_path / "web.conf"
    path.write_text(text.replace("/etc/drivebridge/web-key.pem", str(made["key"])), encoding="utf-8")
    done = subprocess.run([find_program("drivebridge-webd"), "--config", path, "--page", tmp_path, "--check"],
                          capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, f"{page.name}:{block.line}\n{done.stderr}"


# --- mbpoll --------------------------------------------------------------------------------------


class Line:
    """One mbpoll line, with what its comment claims."""

    def __init__(self, text):
        self.text = text
        self.argv = shlex.split(text, comments=True)
        self.comment = text.partition(" # ")[2].strip()
        claim = re.match(r"exception ([0-9A-F]{2})", self.comment)
        self.exception = int(claim[1], 16) if claim else 0
        claim = re.match(r"reads (-?[0-9.]+)(?: in (.*))?", self.comment)
        self.reads = claim[1] if claim else None
        self.about = (claim[2] or "") if claim else self.comment
        self.host = self.argv.index("127.0.0.1")

    def option(self, name, default):
        for at, word in enumerate(self.argv):
            if word == name:
                return self.argv[at + 1]
        return default

    @property
    def unit(self):
        return int(self.option("-a", "1"))

    @property
    def address(self):
        return int(self.option("-r", "1"))

    @property
    def values(self):
        return [value for value in self.argv[self.host + 1 :] if value != "--"]

    def command(self, port):
        """The line as it is run: once, at this port, with patience for a busy machine."""
        options = []
        words = iter(self.argv[1 : self.host])
        for word in words:
            if word in ("-p", "-l"):
                next(words)
            elif word != "-1":
                options.append(word)
        return ["mbpoll", *options, "-1", "-o", "10", "-p", str(port), *self.argv[self.host :]]


def mbpoll_lines(block):
    return [Line(line.strip()) for line in block.lines if line.strip().startswith("mbpoll ")]


def value_of(text):
    text = text.strip().rstrip(",")
    if text.startswith("{"):
        return [item.strip().strip('"') for item in text.strip("{}").split(",")]
    if re.fullmatch(r"-?\d+", text):
        return int(text)
    return float(text) if re.fullmatch(r"-?\d+\.\d+", text) else text.strip('"')


def sections(text):
    """The sections of a configuration, as (kind, name, keys)."""
    found = []
    for line in text.splitlines():
        line = re.sub(r"#.*", "", line).strip()
        head = re.fullmatch(r"(modbus|bus|drive)(?: (\S+))? \{", line)
        key = re.fullmatch(r"([a-z0-9-]+)\s*=\s*(.+)", line)
        if head:
            found.append((head[1], head[2], {}))
        elif key:
            value = value_of(key[2])
            found[-1][2].setdefault(key[1], value)
    return found


# What the simulated drives of each family need beside what the page configures.
SIMULATED = {
    "vsmd-serial": {"sensor": ["3:below:5000"],
                    "set": ["spd=25600", "acc=256000", "dec=256000"]},
    "vsmd-can": {"set": ["spd=25600", "acc=256000", "dec=256000"]},
    "xyza": {"identity": None, "step-ms": 50, "set": ["manual_speed=2000", "brake=15"]},
    "servo-can": {"identity": None, "set": None},
}
CAN = {"transport": "slcan", "baud": 3000000, "line": None}


def start(make_bridge, text):
    """The bridge that a page configures, with simulated drives instead of real ones."""
    parts = sections(text)
    modbus = next((keys for kind, _, keys in parts if kind == "modbus"), {})
    (bus,) = [keys for kind, _, keys in parts if kind == "bus"]
    drives = [keys for kind, _, keys in parts if kind == "drive"]
    family = bus["protocol"]
    controllers = sorted({keys["address"] for keys in drives})
    for at, keys in enumerate(drives, 1):
        assert keys["unit"] == at, "the guide's drives are units 1, 2 ..."
    keep = {key: value for key, value in bus.items() if key not in ("device", "interface")}
    # Of the simulated bus: what says how its frames are.
    wire = {key: value for key, value in keep.items() if key.startswith(("command-word", "bitrate"))}
    if family.endswith("-can"):
        keep |= CAN
        wire |= CAN | {"baud": None}
    modbus = {key: value for key, value in modbus.items() if key != "listen"}
    return make_bridge(
        drives=len(drives), sim_drives=len(controllers),
        modbus=modbus | {"confirm-ms": 5000},
        bus=keep | {"cycle-ms": 20, "drive-latency-ms": 100},
        sim_bus={"protocol": family} | wire, sim_drive=SIMULATED[family],
        per_drive={at: {key: value for key, value in keys.items() if key != "bus"}
                   for at, keys in enumerate(drives, 1)},
        sim_per_drive={at: {"address": address} for at, address in enumerate(controllers, 1)})


def demo():
    """The RS485 bus of ./demo, for pages that are about no drive of their own."""
    parts = sections((ROOT / "conf" / "demo.conf").read_text(encoding="utf-8"))
    kept = [(kind, name, keys) for kind, name, keys in parts
            if name == "line" or keys.get("bus") == "line"]
    text = []
    for kind, name, keys in kept:
        lines = [f"{key} = {value}" for key, value in keys.items()]
        text += [f"{kind} {name} {{", *lines, "}"]
    return "\n".join(text)


def settle(bridge, unit):
    """What was begun comes to its end, as for somebody who watches before typing on."""
    if not 1 <= unit <= bridge.drive_count:
        return
    drive = bridge.drive(unit)
    eventually(lambda: drive.read("axis_state") not in (DISCRETE, HOMING, STOPPING),
               what=f"unit {unit} to stand")


def poll(line, port):
    done = subprocess.run(line.command(port), capture_output=True, text=True, timeout=30,
                          check=False, env=os.environ | {"LC_ALL": "C"})
    return done.returncode, done.stdout + done.stderr


def values_read(output):
    return re.findall(r"^\[\d+\]:\s+(\S+)", output, re.MULTILINE)


def type_in(bridge, line):
    if line.values:
        settle(bridge, line.unit)
    if line.reads is not None:
        def reads():
            status, output = poll(line, bridge.port)
            assert status == 0, output
            return values_read(output)[0] == line.reads

        eventually(reads, 30, line.text)
        return
    status, output = poll(line, bridge.port)
    if line.exception:
        assert status != 0 and EXCEPTIONS[line.exception] in output, f"{line.text}\n{output}"
    else:
        assert status == 0, f"{line.text}\n{output}"


def pages_to_type():
    return [page for page in [*READMES, *PAGES]
            if any(mbpoll_lines(block) for block in parse(page)[0] if block.kind == "sh")]


@pytest.mark.parametrize("page", pages_to_type(), ids=name_of)
def test_what_is_to_be_typed_works(page, make_bridge):
    """Each line is typed at the bridge that the page configured last. What the first pages show leaves
    the drive as it was found: a move goes on to work."""
    text, bridge, last = demo(), None, None
    for block in parse(page)[0]:
        if block.kind == "conf" and re.search(r"^drive ", block.text, re.MULTILINE):
            text, bridge = block.text, None
        for line in mbpoll_lines(block) if block.kind == "sh" else []:
            last = bridge = bridge or start(make_bridge, text)
            type_in(bridge, line)
    if page.name == "README.md":
        settle(last, 1)
        assert last.drive().write_words(100, [0, 6, 0, 1000]) == 0


def view_of(line):
    if line.unit in (0, 255):
        return "gateway"
    return "vsmd" if line.unit > 100 else "drive"


def wrong_comment(line):
    """A comment that begins with a register or a command is about what the line reads or writes."""
    first = re.match(r"[a-z0-9_]+", line.about)
    table = {"0": "coil", "1": "discrete", "3": "input"}.get(line.option("-t", "4")[0], "holding")
    if not first:
        return None
    codes = {row["name"]: int(row["code"]) for row in COMMANDS}
    at = {100: 1, 101: 0, 124: 0}.get(line.address)
    if line.values and at is not None and view_of(line) == "drive" and first[0] in codes:
        written = int(line.values[at])
        return None if written == codes[first[0]] else f"{first[0]} is not {written}"
    addresses = {int(row["address"]) for row in REGISTERS
                 if row["name"] == first[0] and row["view"] == view_of(line)
                 and row["table"] == table}
    if first[0] in codes or not addresses or line.address in addresses:
        return None
    return f"{first[0]} is not at {line.address}"


@pytest.mark.parametrize("page", pages_to_type(), ids=name_of)
def test_comments_name_what_is_at_the_address(page):
    lines = [line for block in parse(page)[0] if block.kind == "sh"
             for line in mbpoll_lines(block)]
    wrong = [f"{line.text}: {wrong_comment(line)}" for line in lines if wrong_comment(line)]
    assert not wrong, "\n".join(wrong)


# --- other lines of the shell --------------------------------------------------------------------


# How a line begins that is not run here, and what it needs.
NOT_HERE = {
    "sudo apt install": "changes the machine; packaging/check installs the packages, tests/run the others",
    "sudo apt purge": "changes the machine; packaging/check purges the packages",
    "./demo": "builds all and runs until somebody ends it",
    "./tests/run": "is what runs this",
    "cmake --preset": "builds all, as each phase of tests/run does",
    "packaging/build": "builds packages in containers; packaging/check does it",
    "sudo adduser": "changes the machine",
    "sudo editor": "changes the machine",
    "sudo cp": "changes the machine",
    "sudo install": "changes the machine",
    "sudo mosquitto_passwd": "changes the machine",
    "sudo drivebridge-mqtt --check": "the installed program; the page's configurations are checked here",
    "sudo drivebridge-webd": "the installed program; packaging/check makes a user with it",
    "journalctl -u drivebridge-web": "the installed service",
    "sudo drivebridge-opcua": "the installed program; test_opcua.py checks the page's configurations",
    "cd /var/lib/drivebridge-opcua/pki": "the installed program",
    "sudo openssl x509": "a client's certificate",
    "sudo mv rejected/": "a client's certificate; test_opcua_acting.py moves one",
    # An installed service under systemd, which packaging/check has.
    "sudo systemctl": "the installed service",
    "systemctl": "the installed service",
    "sudo journalctl": "the installed service",
    "sudo ss": "the installed service",
    # Hardware.
    "ls -l /dev/serial": "an adapter",
    "udevadm info": "an adapter",
    "sudo udevadm": "an adapter",
    "sudo fuser": "an adapter",
    "sudo networkctl": "a CAN interface",
    "ip ": "a CAN interface",
    "sudo ip ": "a CAN interface",
    "sudo tcpdump": "traffic of a PLC",
    "drivebridgectl": "test_ctl.py types its page",
    "sudo drivebridge-tls --check": "the installed program; test_tls.py checks one",
    "sudo drivebridgectl certificate": "root's files; test_tls.py makes an authority and what it signs",
    "sudo drivebridgectl backup": "root's files; test_ctl_alone.py has a backup and what is restored from it",
    "sudo drivebridgectl restore": "likewise",
    "ls /dev/serial": "an adapter",
}
PROGRAMS = {"drivebridged", "drivebridge-sim"}
SHELL_WORDS = PROGRAMS | {"drivebridgectl"} | {"sudo", "mbpoll", "journalctl", "systemctl", "ip", "udevadm", "cmake"}


def shell_lines(page):
    """(place, line): the lines of blocks for the shell, and commands with arguments in the prose."""
    for block in parse(page)[0]:
        for at, line in enumerate(block.lines if block.kind == "sh" else [], 1):
            if line.strip() and not line.strip().startswith("#"):
                yield f"{page.name}:{block.line + at}", line.strip()
    for place, span in spans(page):
        first, _, rest = span.partition(" ")
        if rest and (Path(first).name in SHELL_WORDS or first.startswith("./")):
            yield place, span


def is_run_here(line):
    first = [word for word in line.split() if word != "sudo"][0]
    return Path(first).name in PROGRAMS or first.startswith("docs/generate/")


def lines_to_run(page):
    return [line for _, line in shell_lines(page) if is_run_here(line) and " FILE" not in line]


@pytest.mark.parametrize("page", [*READMES, *PAGES], ids=name_of)
def test_every_shell_line_is_run_or_says_what_it_needs(page):
    blocks = {line.strip() for block in parse(page)[0] for line in block.lines}
    wrong = []
    for place, line in shell_lines(page):
        if line.startswith("mbpoll "):
            # Typed above, but only what stands in a block.
            wrong += [] if line in blocks else [f"{place}: {line}: put it into a block"]
        elif line.startswith("drivebridged "):
            wrong.append(f"{place}: {line}: /usr/sbin is not in everybody's path")
        elif not is_run_here(line) and not line.startswith(tuple(NOT_HERE)):
            wrong.append(f"{place}: {line}")
    assert not wrong, "\n".join(wrong)


def own_text(page, word):
    """The configuration of that name: the source tree's, or the page's own."""
    path = ROOT / "conf" / Path(word).name
    if path.exists():
        return path.read_text(encoding="utf-8")
    return [block.text for block in parse(page)[0] if block.kind == "conf"][-1]


@pytest.mark.parametrize("page", [page for page in [*READMES, *PAGES] if lines_to_run(page)],
                         ids=name_of)
def test_who_starts_the_bridge_may_have_its_port(page):
    for line in lines_to_run(page):
        if "drivebridged" not in line or "--check" in line:
            continue
        (word,) = [word for word in line.split() if word.endswith(".conf")]
        # The first one is that of modbus: an example of an endpoint may follow.
        port = re.findall(r'listen\s*= "[^"]*:(\d+)"', own_text(page, word))[0]
        assert int(port) >= 1024 or line.startswith("sudo "), line


def copy_configuration(page, word, place):
    """The configuration with a port and with files of its own, also where it leaves the port to the default."""
    text = re.sub(r'^(\s*)(?:# )?listen(\s*)= "[^"]*"', r'\1listen\2= "127.0.0.1:0"', own_text(page, word), flags=re.M)
    copy = place / Path(word).name
    copy.write_text(text.replace("/tmp/", f"{place}/"), encoding="utf-8")
    return str(copy)


def command_of(page, line, place):
    """The line with this build's programs and with files in a folder of its own."""
    words = [word for word in shlex.split(line, comments=True) if word != "sudo"]
    if Path(words[0]).name in PROGRAMS:
        words[0] = str(find_program(Path(words[0]).name))
    else:
        words = [sys.executable, str(ROOT / words[0]), *words[1:]]
    return words[:1] + [
        copy_configuration(page, word, place) if word.endswith(".conf")
        else str(ROOT / "docs") if word == "docs"
        else word if word.startswith(str(ROOT)) else word.replace("/tmp/", f"{place}/")
        for word in words[1:]]


@pytest.mark.parametrize("page", [page for page in [*READMES, *PAGES] if lines_to_run(page)],
                         ids=name_of)
def test_programs_start_as_the_page_says(page, tmp_path):
    """In the page's order; what stays in the foreground goes on until all have started."""
    running = []
    try:
        for at, line in enumerate(lines_to_run(page)):
            command = command_of(page, line, tmp_path)
            if "--check" in command or command[0] == sys.executable:
                subprocess.run(command, check=True, timeout=60)
                continue
            log = tmp_path / f"{at}.log"
            with open(log, "wb") as out:
                running.append(subprocess.Popen(command, stdout=out, stderr=out))
            eventually(lambda log=log: re.search("^ready|listening on", log.read_text(), re.M), 20,
                       line)
            assert running[-1].poll() is None
    finally:
        for process in reversed(running):
            process.terminate()
    assert [process.wait(20) for process in running] == [0] * len(running)


# --- log lines -----------------------------------------------------------------------------------


STRING = r'"((?:[^"\\\n]|\\.)*)"'
CONVERSION = re.compile(r"%[-+ 0#]*(?:\d+|\*)?(?:\.(?:\d+|\*))?(?:hh|h|ll|l|z|t)?[a-zA-Z]")


def literals():
    """The string literals of the sources, joined where the compiler joins them."""
    found = set()
    for path in sorted((ROOT / "src").rglob("*.c")):
        text = path.read_text(encoding="utf-8")
        text = re.sub(r'"\s*PRI[ud](?:32|64)\s*"', "u", text)
        for match in re.finditer(rf"{STRING}(?:\s*{STRING})*", text):
            found.add("".join(re.findall(STRING, match[0])))
    return found


class Format:
    """A text of the sources that is printed with something filled in."""

    def __init__(self, text):
        self.parts = CONVERSION.split(text)
        self.kinds = CONVERSION.findall(text)

    def prints(self, line, at=0):
        """Whether the line is the rest of the format, from the part `at` on."""
        if not line.startswith(self.parts[at]) or not self.has_parts(line, at):
            return False
        line = line[len(self.parts[at]) :]
        if at == len(self.kinds):
            return line == ""
        text = self.kinds[at][-1] == "s"
        return any((is_filled_in(line[:end]) if text else NUMBER.fullmatch(line[:end]))
                   and self.prints(line[end:], at + 1) for end in range(len(line) + 1))


    def has_parts(self, line, at):
        """Whether its own words are in the line, in their order: a quick look before the long one."""
        place = 0
        for part in self.parts[at:]:
            place = line.find(part, place)
            if place < 0:
                return False
            place += len(part)
        return line.endswith(self.parts[-1])


def is_filled_in(text):
    """What a %s stands for: a name, a number with its unit, a text of the program or system."""
    return (re.fullmatch(r"\S*|[0-9]+ \S+|\S+ \(process [0-9]+\)", text) or text in SYSTEM_TEXTS or text in LITERALS or
            text.startswith("; ") and any(form.prints(text) for form in ADVICE))


def is_printed(line):
    return any(text in LITERALS or any(form.prints(text) for form in FORMATS)
               for text in (line, WHOM.sub("", line, count=1)))


NUMBER = re.compile(r"-?[0-9A-Fx.]+")
SYSTEM_TEXTS = {os.strerror(code) for code in range(1, 134)}
LITERALS = literals()
# Not those that would print anything: more than two things filled in, and no word of their own.
FORMATS = [Format(text) for text in sorted(LITERALS)
           if CONVERSION.search(text) and re.search("[A-Za-z:]", CONVERSION.sub("", text)) and
           (len(CONVERSION.findall(text)) <= 2 or re.search("[A-Za-z]", CONVERSION.sub("", text)))]
# What is added to a message: advice about a port.
ADVICE = [form for form in FORMATS if form.parts[0].startswith("; ")]
# What stands before a message: that it is a warning, whom it is about.
WHOM = re.compile(r"(warning: )?(bus \S+: )?(drive \S+: )?(client \S+: )?")


def is_log(span):
    return " " in span and re.match(
        r"(bus|client) \S+: |cannot |listening |unknown key|no drive is |warning: ", span)


def log_lines(page):
    for block in parse(page)[0]:
        if block.kind == "log":
            yield from block.lines
    yield from (span for _, span in spans(page) if is_log(span))


@pytest.mark.parametrize("page", [page for page in PAGES if any(log_lines(page))],
                         ids=name_of)
def test_log_lines_are_those_of_the_program(page):
    wrong = [line for line in log_lines(page) if not is_printed(line)]
    assert not wrong, "\n".join(wrong)


def test_other_log_lines_are_noticed():
    lines = [line for page in PAGES for line in log_lines(page)]
    assert lines
    assert not [line for line in lines if is_printed(line + " again")]


# --- the pages themselves ------------------------------------------------------------------------


def anchors(path):
    found = set()
    for _, line in parse(path)[1]:
        heading = re.match(r"#+ (.*)", line)
        if heading:
            text = re.sub(r"[^\w\- ]", "", heading[1].lower())
            found.add(text.replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", [*READMES, *PAGES], ids=name_of)
def test_links_lead_somewhere(page):
    wrong = []
    for number, line in parse(page)[1]:
        for target in re.findall(r"\]\(([^)\s]+)\)", line):
            path, _, anchor = target.partition("#")
            if "://" in target:
                continue
            file = (page.parent / path) if path else page
            if not file.exists() or (anchor and anchor not in anchors(file)):
                wrong.append(f"{page.name}:{number}: {target}")
    assert not wrong, "\n".join(wrong)


def test_every_page_is_in_the_index():
    index = (GUIDE / "README.md").read_text(encoding="utf-8")
    assert [page for page in PAGES if f"]({os.path.relpath(page, GUIDE)})" not in index] == [GUIDE / "README.md"]


@pytest.mark.parametrize("page", QUICK, ids=name_of)
def test_a_quick_start_is_one_page(page):
    """In each language, with the same commands and configurations."""
    assert len(page.read_text(encoding="utf-8").splitlines()) <= 60
    others = [one for one in QUICK if one.stem == page.stem]
    assert len(others) == 3
    for other in others:
        assert [re.sub(r"\s+#.*", "", block.text) for block in parse(page)[0]] == \
            [re.sub(r"\s+#.*", "", block.text) for block in parse(other)[0]]


@pytest.mark.parametrize("page", [*READMES, *PAGES], ids=name_of)
def test_commands_of_drivebridgectl_exist(page):
    known = {row["name"].split()[0] for row in rows("drivebridgectl.csv") if row["kind"] == "command"}
    lines = [(place, line.removeprefix("sudo ")) for place, line in shell_lines(page)]
    said = [(place, re.match(r"drivebridgectl (?:--json )?(\S+)", line)) for place, line in lines]
    wrong = [f"{place}: {match[1]}" for place, match in said if match and match[1] not in {*known, "COMMAND", "--help", "--version"}]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_blocks_say_what_they_are(page):
    wrong = [f"{page.name}:{block.line}: {block.kind or 'nothing'}" for block in parse(page)[0]
             if block.kind not in FENCES]
    assert not wrong, "\n".join(wrong)


PICTURES = sorted((GUIDE / "pictures").iterdir())


@pytest.mark.parametrize("picture", [one for one in PICTURES if one.suffix == ".png"], ids=lambda picture: picture.name)
def test_a_picture_of_the_page_is_small(picture):
    """Made by test_browser.py, see browserlib.picture."""
    data = picture.read_bytes()
    assert data.startswith(b"\x89PNG\r\n") and len(data) < 120000


@pytest.mark.parametrize("picture", [one for one in PICTURES if one.suffix == ".svg"], ids=lambda picture: picture.name)
def test_a_picture_can_be_read(picture):
    """By a browser, by whoever cannot see it, and on a dark page; its words fit into it."""
    root = xml.etree.ElementTree.parse(picture).getroot()
    svg = "{http://www.w3.org/2000/svg}"
    assert root.tag == svg + "svg" and root.find(svg + "title").text and root.find(svg + "desc").text
    width, height = (float(value) for value in root.get("viewBox").split()[2:])
    ground = root.find(svg + "rect")
    assert (float(ground.get("width")), float(ground.get("height"))) == (width, height)
    assert ground.get("fill") == "#ffffff" and root.get("fill")
    for text in root.iter(svg + "text"):
        x, y = float(text.get("x")), float(text.get("y"))
        assert 0 <= x <= width and 0 < y <= height, text.text
    # Nothing that is fetched or run.
    assert not re.search(r"<script|<image|href=", picture.read_text(encoding="utf-8"))


def test_every_picture_is_shown():
    shown = {target for page in PAGES for target in re.findall(
        r"!\[[^\]]+\]\((?:guide/)?pictures/([^)]+)\)", page.read_text(encoding="utf-8"))}
    assert shown == {picture.name for picture in PICTURES}


PLATFORMS = ["codesys", "tia", "openplc", "rockwell", "omron", "hmi"]


@pytest.mark.parametrize("name", PLATFORMS)
def test_a_platforms_page_says_what_it_stands_on(name):
    text = (GUIDE / f"{name}.md").read_text(encoding="utf-8")
    assert re.search(r"^> Not tried with (the|a) real ", text, re.M)
    for row in ("Addresses", "Word order", "Unit"):
        assert re.search(rf"^\| {row} \|", text, re.M), row
    # What tells the word orders apart.
    for number in re.findall(r"`watchdog_ms` \(46\)[^.]* is (\d+)", text):
        assert int(number) == 3000
    for number in re.findall(r"(\d{7,}) means", text):
        assert int(number) == 3000 << 16


def test_the_package_has_the_guide():
    documents = Path(ROOT / "packaging" / "debian" / "drivebridge.docs").read_text(encoding="utf-8")
    assert "docs/guide" in documents.split() or "docs/*" in documents.split()
