# SPDX-License-Identifier: Apache-2.0
"""docs/clients: what other programs import is made from the register map, has the form that they
expect, and reads from the bridge what the bridge means."""

import csv
import json
import re
import subprocess
import sys
import tomllib
import uuid

import pytest
import yaml
from bridgelib import DOCS, RESULT_OK, ROOT, decode, eventually, find_program

CLIENTS = DOCS / "clients"
EXPORTER = ROOT / "tests" / "tools" / "export-clients"
WINDOWS = range(1, 5)


def text_of(name):
    return (CLIENTS / name).read_text(encoding="utf-8")


def export(folder, drives=4):
    subprocess.run([sys.executable, EXPORTER, "--drives", str(drives), DOCS, folder], timeout=60,
                   check=True)


def test_they_are_made_from_the_map(tmp_path):
    export(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert {path.name for path in CLIENTS.iterdir()} == names
    for name in names:
        assert (CLIENTS / name).read_bytes() == (tmp_path / name).read_bytes(), \
            f"{name}: cmake --build --preset asan --target docs-generate"


# --- monitoring tools: what each of them asks for, as (unit, address, type of the map) --------------


def telegraf():
    kinds = {"UINT16": "u16", "UINT32": "u32", "INT32": "i32", "FLOAT32": "f32"}
    (device,) = tomllib.loads(text_of("telegraf.conf"))["inputs"]["modbus"]
    assert device["configuration_type"] == "request"
    for request in device["request"]:
        assert request["register"] == "holding" and request["byte_order"] == "ABCD"
        # One measurement has a field once.
        names = [field["name"] for field in request["fields"]]
        assert len(set(names)) == len(names)
        for field in request["fields"]:
            drive = request.get("tags", {}).get("drive")
            name = f"window{drive}_{field['name']}" if drive else field["name"]
            yield name, request["slave_id"], field["address"], kinds[field["type"]]


def modbus_exporter():
    (module,) = yaml.safe_load(text_of("modbus_exporter.yml"))["modules"]
    assert (module["name"], module["protocol"]) == ("drivebridge", "tcp/ip")
    seen, helps = set(), {}
    for metric in module["metrics"]:
        drive = metric.get("labels", {}).get("drive")
        # A series is there once, and a name has one help.
        assert (metric["name"], drive) not in seen
        seen.add((metric["name"], drive))
        assert helps.setdefault(metric["name"], metric["help"]) == metric["help"]
        assert re.fullmatch(r"[a-z][a-z0-9_]*", metric["name"])
        assert metric["metricType"] in ("gauge", "counter") and metric["endianness"] == "big"
        address = str(metric["address"])
        assert len(address) == 6 and address[0] == "3"  # function 3
        kind = {"uint": "u", "int": "i", "float": "f"}[metric["dataType"].rstrip("0123456789")]
        name = metric["name"].removeprefix("drivebridge_")
        name = f"window{drive}_{name.removeprefix('drive_')}" if drive else name
        yield name, 255, int(address[1:]), kind + metric["dataType"][-2:]


def zabbix():
    (template,) = yaml.safe_load(text_of("zabbix.yaml"))["zabbix_export"]["templates"]
    uuids, keys = [template["uuid"]], set()
    for item in template["items"]:
        uuids += [item["uuid"], *(trigger["uuid"] for trigger in item.get("triggers", []))]
        endpoint, unit, function, address, count, kind = re.fullmatch(
            r"modbus\.get\[(.*)\]", item["key"])[1].split(",")
        assert item["key"] not in keys
        keys.add(item["key"])
        assert (endpoint, function, count) == ("{$DRIVEBRIDGE.URL}", "3", "1")
        signed = kind in ("int16", "int32", "float")
        assert item.get("value_type", "UNSIGNED") == ("FLOAT" if signed else "UNSIGNED")
        for trigger in item.get("triggers", []):
            assert trigger["expression"] == f"last(/{template['template']}/{item['key']})=0"
        kind = {"uint16": "u16", "uint32": "u32", "int16": "i16", "int32": "i32", "float": "f32"}[kind]
        name = item["name"].removeprefix("Gateway: ").replace(" ", "_")
        drive = re.fullmatch(r"Drive_(\d+)_(\w+)", name)
        yield f"window{drive[1]}_{drive[2]}" if drive else name, int(unit), int(address), kind
    assert len(set(uuids)) == len(uuids)
    for text in uuids:
        assert uuid.UUID(text).version == 4 and uuid.UUID(text).hex == text


def test_the_dashboard_shows_metrics_that_there_are(four_drives):
    dashboard = json.loads(text_of("grafana.json"))
    metrics = subprocess.run([find_program("drivebridgectl"), "--socket", four_drives.control_path, "metrics"],
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
    assert set(re.findall(r"drivebridge_\w+", guide)) <= set(kinds)
    shown = {panel["title"] for panel in dashboard["panels"]}
    assert len(shown) == len(dashboard["panels"])
    for variable in dashboard["templating"]["list"][1:]:
        name, label = re.fullmatch(r"label_values\((\w+).*, (\w+)\)", variable["query"]).groups()
        assert name in kinds and label == variable["name"]


TOOLS = {"telegraf": telegraf, "modbus_exporter": modbus_exporter, "zabbix": zabbix}
PLAIN = {"bits16": "u16", "bits32": "u32"}


@pytest.mark.parametrize("tool", TOOLS)
def test_a_tool_asks_for_what_it_names(tool, register_map):
    asked = list(TOOLS[tool]())
    for name, unit, address, kind in asked:
        row = register_map.find(name, "gateway")
        assert (unit, address, kind) == (255, row.address, PLAIN.get(row.type, row.type)), name
    names = {name for name, *_ in asked}
    assert {f"window{drive}_position" for drive in WINDOWS} | {"drives_online"} <= names


@pytest.fixture
def four_drives(make_bridge):
    bridge = make_bridge(drives=4)
    for number in WINDOWS:
        bridge.wait_ready(number)
    return bridge


@pytest.mark.parametrize("tool", TOOLS)
def test_a_tool_reads_all_though_a_drive_is_dead(tool, four_drives):
    """Which in the drive's own unit would be exception 0B, where the tools stop reading."""
    bridge = four_drives
    assert bridge.drive(2).settle("move_absolute", target_position=-700) == RESULT_OK
    eventually(lambda: bridge.drive(2).read("position") == -700, what="the move")
    bridge.sim.fault("silence on", "drive3")
    gateway = bridge.gateway()
    eventually(lambda: gateway.read("window3_online") == 0, what="the dead drive to be offline")
    values = {}
    for name, _, address, kind in TOOLS[tool]():
        count = 2 if kind.endswith("32") else 1
        values[name] = decode(kind, gateway.words(address, count))
    assert [values[f"window{drive}_online"] for drive in WINDOWS] == [1, 1, 0, 1]
    assert values["window2_position"] == -700 and values["window2_position_units"] == -700.0
    assert (values["drive_count"], values["drives_online"]) == (4, 3)


# --- Node-RED, Kepware, the program, the notation ----------------------------------------------------


def test_the_flow(four_drives, tmp_path):
    """Its nodes belong together, and its decoder's table is right for what its reads bring."""
    nodes = {node["id"]: node for node in json.loads(text_of("node-red.json"))}
    for node in nodes.values():
        assert all(target in nodes for wires in node.get("wires", []) for target in wires)
        assert node.get("z", "db00000000000001") in nodes and node.get("server", node["id"]) in nodes
    (function,) = [node["func"] for node in nodes.values() if node["type"] == "function"]
    fields = json.loads(re.search(r"const fields = (\[.*?\n\]);", function, re.S)[1])
    size = int(re.search(r"const size = (\d+);", function)[1]) // 2
    gateway = four_drives.gateway()
    drives = []
    for node in nodes.values():
        if node["type"] != "modbus-read":
            continue
        assert (node["unitid"], node["dataType"]) == ("255", "HoldingRegister")
        words = gateway.words(int(node["adr"]), int(node["quantity"]))
        for first in range(0, len(words), size):
            drives.append({name: decode(kind, words[first + at : first + at + (
                2 if kind.endswith("32") else 1)]) for name, at, kind in fields})
    assert [drive["unit"] for drive in drives] == [1, 2, 3, 4]
    assert all(drive["online"] == 1 and drive["quality"] == 192 for drive in drives)
    export(tmp_path, drives=11)
    nodes = json.loads((tmp_path / "node-red.json").read_text(encoding="utf-8"))
    reads = [int(node["quantity"]) for node in nodes if node["type"] == "modbus-read"]
    assert sum(reads) == 11 * size and max(reads) <= 125


KEPWARE = {"Word": {"u16", "bits16"}, "Short": {"i16"}, "DWord": {"u32", "bits32"}, "Long": {"i32"},
           "Float": {"f32"}, "QWord": {"u64"}}


@pytest.mark.parametrize("view", ["drive", "gateway"])
def test_kepware_tags(view, register_map):
    tags = list(csv.DictReader(text_of(f"kepware-{view}.csv").splitlines()))
    assert len({tag["Tag Name"] for tag in tags}) == len(tags) > 30
    for tag in tags:
        row = register_map.find(tag["Tag Name"], view)
        assert int(tag["Address"]) == 400001 + row.address
        assert row.type in KEPWARE[tag["Data Type"]]
        assert tag["Client Access"] == ("R/W" if row.writable else "RO")
        assert None not in tag and tag["Scan Rate"].isdigit()


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
    assert len(rows) > 60
    for name, address, reference, kind, byte, array, element in rows:
        row = register_map.find(name)
        block = {"rx": 0, "tx": 100}[array]
        assert (row.address, row.type) == (int(address), kind)
        assert int(reference) == 40001 + row.address
        assert int(element) == row.address - block and int(byte) == 2 * int(element)
