# SPDX-License-Identifier: Apache-2.0
"""What earlier versions promised to PLCs and programs is there today: docs/promises.md. tests/tools/keep-promises keeps it
in upgrades/; that today's documents are what the programs do, the phase docs and the tests of each front end say."""

import csv
import importlib.machinery
import importlib.util
import re
from collections import defaultdict
from pathlib import Path

import pytest
import varlink
from bridgelib import ROOT

FAMILIES = {"vsmd-serial", "vsmd-can", "xyza", "servo-can"}


def load_tool():
    path = str(ROOT / "tests" / "tools" / "keep-promises")
    loader = importlib.machinery.SourceFileLoader("keep_promises", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("keep_promises", loader))
    loader.exec_module(module)
    return module


TOOL = load_tool()
TABLES = sorted(path for name in TOOL.TABLES for path in TOOL.KEPT.glob(f"git*/{name}"))
INTERFACES = sorted(TOOL.KEPT.glob(f"git*/{TOOL.INTERFACE}"))


def name_of(path):
    return f"{path.parent.name}-{path.stem}"


def families(row):
    """Of drives; a row of a table without this column is everybody's."""
    words = row.get("families", "all").split()
    return FAMILIES if words == ["all"] else set(words)


def what_is_gone(old, new, columns):
    """Rows of old that new does not have for all of their families."""
    same = [column for column in columns if column != "families"]
    has = defaultdict(set)
    for row in new:
        has[tuple(row[column] for column in same)] |= families(row)
    return [", ".join(row.values()) for row in old
            if not (key := tuple(row[column] for column in same)) in has or not families(row) <= has[key]]


def today(name):
    document, columns = TOOL.TABLES[name]
    rows = TOOL.promised(name, (ROOT / "docs" / document).read_text(encoding="utf-8"))
    return [dict(zip(columns, row, strict=True)) for row in rows]


def corrected(row):
    column, value = TOOL.CORRECTED.get(tuple(row.values()), (None, None))
    return {**row, column: value} if column else row


def test_there_is_what_was_promised():
    assert {path.name for path in TABLES} == set(TOOL.TABLES) and INTERFACES


@pytest.mark.parametrize("path", TABLES, ids=name_of)
def test_what_was_promised_is_there(path):
    with open(path, newline="", encoding="utf-8") as file:
        old = [corrected(row) for row in csv.DictReader(file)]
    assert len(old) > 0
    gone = what_is_gone(old, today(path.name), TOOL.TABLES[path.name][1])
    assert not gone, "\n".join(gone)


def test_what_is_gone_is_noticed():
    columns = ("address", "name", "families")
    new = [{"address": "1", "name": "a", "families": "xyza"}, {"address": "2", "name": "b", "families": "all"}]
    assert not what_is_gone(new, new, columns)
    for change in ({"name": "c"}, {"address": "3"}, {"families": "all"}):
        assert what_is_gone([new[0] | change], new, columns)
    assert not what_is_gone([new[1] | {"families": "servo-can"}], new, columns)


# --- The control socket ------------------------------------------------------------------------------


def shape(kind):
    """A type of the interface as plain values: structs as dictionaries, others as lists, the library's samples of values as
    the names of their types."""
    name = kind.__class__.__name__
    if name == "_Struct":
        return {field: shape(inner) for field, inner in kind.fields.items()}
    if name in ("_Array", "_Maybe", "_Dict"):
        return [name, shape(kind.element_type)]
    return kind.name if hasattr(kind, "name") else name


def members(text):
    """name: (kind, what goes in, what comes out), of all types, methods and errors."""
    return {name: (member.__class__.__name__, shape(member.in_type) if hasattr(member, "in_type") else {},
                   shape(member.out_type if hasattr(member, "out_type") else member.type))
            for name, member in varlink.Interface(text).members.items()}


def may_be_left_out(kind):
    return isinstance(kind, list) and kind[0] == "_Maybe"


def what_breaks(old, new):
    """Why a program that was written for the old interface would not get on with the new one."""
    wrong = []
    for name, (kind, takes, gives) in old.items():
        if name not in new or new[name][0] != kind:
            wrong.append(f"{name} is gone")
            continue
        _, takes_now, gives_now = new[name]
        for field, was in takes.items():
            if field not in takes_now or takes_now[field] not in (was, ["_Maybe", was]):
                wrong.append(f"{name} no longer takes {field} as it did")
        for field, now in takes_now.items():
            if field not in takes and not may_be_left_out(now):
                wrong.append(f"{name} must be given {field}")
        for field, was in gives.items():
            if field not in gives_now or gives_now[field] not in (was, was[1] if may_be_left_out(was) else was):
                wrong.append(f"{name} no longer gives {field} as it did")
    return wrong


@pytest.mark.parametrize("path", INTERFACES, ids=name_of)
def test_programs_of_earlier_versions_get_on(path):
    new = members((ROOT / "docs" / TOOL.INTERFACE).read_text(encoding="utf-8"))
    wrong = what_breaks(members(path.read_text(encoding="utf-8")), new)
    assert not wrong, "\n".join(wrong)


def test_an_interface_that_breaks_programs_is_noticed():
    old = "interface a.b\n\ntype T (x: int, y: ?string)\n\nmethod M(a: int, b: ?[]T) -> (c: T, d: bool)\n\nerror E (e: string)\n"
    assert not what_breaks(members(old), members(old))
    for was, now in (("x: int", "x: float"), (", y: ?string", ""), ("a: int, ", ""), ("a: int", "a: string"), ("?[]T", "[]T"),
                     ("a: int", "a: int, z: int"), (", d: bool", ""), ("error E (e: string)\n", ""), ("method M", "method N")):
        assert what_breaks(members(old), members(old.replace(was, now))), f"{was} is {now}"
    for was, now in (("a: int", "a: int, z: ?int"), ("d: bool", "d: bool, z: int"), ("x: int", "x: int, z: int")):
        assert not what_breaks(members(old), members(old.replace(was, now))), f"{was} is {now}"


# --- The pages that say so ---------------------------------------------------------------------------

PAGES = [ROOT / "docs" / "promises.md", ROOT / "docs" / "security" / "iec-62443-4-2.md"]
FILE = re.compile(r"`((?:docs|packaging|src|tests)/[^` ]*|SECURITY\.md)[` ]")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_names_is_there(page):
    names = FILE.findall(page.read_text(encoding="utf-8"))
    assert len(names) > 10
    missing = [name for name in names if not next(ROOT.glob(name), None)]
    assert not missing, missing


def test_each_requirement_has_a_state():
    rows = re.findall(r"^\| (?:CR|SAR) .*$", PAGES[1].read_text(encoding="utf-8"), re.M)
    assert len(rows) > 35
    for row in rows:
        _, state, what, where = (cell.strip() for cell in row[1:-1].split("|"))
        assert state in ("met", "partly", "not", "not applicable") and what, row
        assert where or state not in ("met", "partly"), row


def test_the_doors_are_those_of_the_configuration():
    """Where programs listen, and whose files they take, when nobody has said anything else."""
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    for table, section, name in (("config", "modbus", "listen"), ("config", "modbus", "allow-write"),
                                 ("config", "control", "socket"), ("web", "server", "listen"), ("web", "access", "users-file"),
                                 ("opcua", "server", "port"), ("opcua", "security", "users"), ("opcua", "security", "pki")):
        with open(ROOT / "docs" / f"{table}-keys.csv", newline="", encoding="utf-8") as file:
            default = next(row["default"] for row in csv.DictReader(file) if (row["section"], row["name"]) == (section, name))
        for value in default.split():
            assert value in text or Path(value).name in text, f"{table}: {section}: {name} is {value}"
