# SPDX-License-Identifier: Apache-2.0
"""docs/drivebridge.st: Structured Text by an independent parser, and the register map's numbers."""

import csv
import re
import struct
import subprocess
import sys

import pytest
import tree_sitter
import tree_sitter_iec61131_3_st
from blark.parse import parse_source_code
from bridgelib import DOCS, ROOT
from stlib import Library, examples

BLOCKS = ["MC_Power", "MC_Stop", "MC_Halt", "MC_MoveAbsolute", "MC_MoveRelative",
          "MC_MoveVelocity", "MC_Home", "MC_SetPosition", "MC_Reset", "MC_ReadStatus",
          "MC_ReadParameter", "MC_WriteParameter"]


@pytest.fixture(scope="module")
def text():
    return (DOCS / "drivebridge.st").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def library(text):
    return Library(text)


def rows(name):
    with open(DOCS / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Half a minute on a machine that has nothing else to do.
@pytest.mark.timeout(400)
def test_an_iec_61131_3_parser_takes_it(text):
    parsed = parse_source_code(text)
    assert parsed.exception is None
    blocks = [item.name for item in parsed.transform().items
              if type(item).__name__ == "FunctionBlock"]
    assert set(BLOCKS) <= {str(name) for name in blocks}


def test_the_parser_would_have_complained(text):
    begin = text.index("FUNCTION_BLOCK MC_Halt")
    block = text[begin : text.index("END_FUNCTION_BLOCK", begin) + len("END_FUNCTION_BLOCK")]
    assert parse_source_code(block).exception is None
    assert parse_source_code(block.replace("Busy := Motion.Busy", "Busy = Motion.Busy")).exception


GUIDE = DOCS / "structured-text.md"


# A second parser, by other people, of the standard's text without vendors' words, and a fast one.
SECOND_PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_iec61131_3_st.language()))
FORMS = ["drivebridge.st", "drivebridge-strict.st", "drivebridge-prefixed.st"]


def misread(text):
    """What the second parser cannot read, or misses."""
    waiting, found = [SECOND_PARSER.parse(text.encode()).root_node], []
    while waiting:
        node = waiting.pop()
        if node.is_error or node.is_missing:
            found.append((node.start_point.row + 1, node.text.decode()[:60]))
        waiting += [child for child in node.children if child.has_error or child.is_missing]
    return found


@pytest.mark.parametrize("name", FORMS)
def test_a_second_parser_takes_each_form(name):
    text = (DOCS / name).read_text(encoding="utf-8")
    assert not misread(text)
    for right, wrong in (("Busy := Motion.Busy;", "Busy = Motion.Busy;"), ("END_IF;", "ENDIF;"),
                         ("END_VAR", "END_VARS"), (" THEN\n", "\n")):
        assert misread(text.replace(right, wrong, 1)), wrong


GUIDE_PAGES = [page for page in [GUIDE, *sorted((DOCS / "guide").glob("*.md"))] if examples(page)]


@pytest.mark.parametrize("page", GUIDE_PAGES, ids=lambda page: page.stem)
def test_the_parser_takes_the_guides_programs(page):
    for program in examples(page):
        # TwinCAT, whose language the first one reads, has configurations of another kind.
        units = re.sub(r"^CONFIGURATION.*?^END_CONFIGURATION$", "", program, flags=re.S | re.M)
        assert parse_source_code(units).exception is None, program
        assert not misread(program), program


def test_the_guides_table_of_errors(library):
    """Every ErrorID there is, with its number."""
    told = {name: int(number) for number, name in re.findall(
        r"^\| (\d+)(?: \+ n)? \| `(\w+)`", GUIDE.read_text(encoding="utf-8"), re.M)}
    there = {name: value for name, value in library.constants.items()
             if name.startswith(("DB_RESULT_", "DB_FAIL_"))}
    for no_error in ("NONE", "OK", "PENDING", "UNPROVEN"):
        del there["DB_RESULT_" + no_error]
    assert told == there


# Of the standard, in text form, of its instruction list, and of Siemens' SCL.
KEYWORDS = """
ACTION END_ACTION ARRAY AT CASE CONFIGURATION CONSTANT DO ELSE ELSIF EN ENO EXIT F_EDGE R_EDGE
FOR FROM FUNCTION FUNCTION_BLOCK IF INITIAL_STEP NON_RETAIN NOT OF ON PROGRAM READ_ONLY READ_WRITE
REPEAT RESOURCE RETAIN RETURN STEP STRUCT TASK THEN TO TRANSITION TYPE UNTIL VAR WHILE WITH XOR
LD ST S R S1 R1 CLK CU CD PV IN PT CAL JMP RET ADD SUB MUL DIV MOD GT GE EQ NE LE LT
ABS SQRT LN LOG EXP SIN COS TAN ASIN ACOS ATAN EXPT MOVE SHL SHR ROL ROR SEL MAX MIN LIMIT MUX
LEN LEFT RIGHT MID CONCAT INSERT DELETE REPLACE FIND SR RS SEMA R_TRIG F_TRIG CTU CTD CTUD TP TON
TOF RTC CLASS METHOD INTERFACE NAMESPACE USING REF REF_TO NULL THIS SUPER OVERRIDE FINAL ABSTRACT
PUBLIC PRIVATE PROTECTED INTERNAL OVERLAP CONTINUE BEGIN GOTO LABEL TIMER COUNTER VOID ANY POINTER
TITLE VERSION NAME AUTHOR FAMILY REGION DATE TIME TOD DT STRING CHAR BLOCK_DB BLOCK_FB BLOCK_FC
DATA_BLOCK NIL PROPERTY UNION ADR SIZEOF REFERENCE GET SET
""".split()


def test_no_name_is_a_keyword(text, library):
    code = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S)
    declared = {name.upper() for name in re.findall(r"^\t(\w+) :[^=]", code, re.M)}
    assert {"EXECUTE", "AXIS", "COMMAND"} <= declared
    assert not (declared | {name.upper() for name in library.constants}) & set(KEYWORDS)


@pytest.mark.parametrize("page", GUIDE_PAGES, ids=lambda page: page.stem)
def test_no_name_of_an_example_is_a_keyword(page):
    declared = {name.upper() for program in examples(page) for name in re.findall(
        r"^\s+(\w+) :[^=]", re.sub(r"\(\*.*?\*\)", "", program, flags=re.S), re.M)}
    assert declared and not declared & set(KEYWORDS)


# --- its other forms: docs/drivebridge-strict.st, docs/drivebridge-prefixed.st --------------------


def variant_text(name):
    return (DOCS / f"drivebridge-{name}.st").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["strict", "prefixed"])
def test_variants_are_made_from_the_library(name):
    made = subprocess.run(
        [sys.executable, ROOT / "docs" / "generate" / "st-variants", name, DOCS / "drivebridge.st"],
        capture_output=True, text=True, timeout=60, check=True)
    assert made.stdout == variant_text(name), "cmake --build --preset asan --target docs-generate"


def test_the_strict_form_is_strict(text):
    """As matiec has it: nothing global, no empty statement, all declared before it is used."""
    library = Library(variant_text("strict"), strict=True)
    assert set(BLOCKS) <= set(library.types) and not library.constants
    with pytest.raises(SyntaxError, match="VAR_GLOBAL"):
        Library(text, strict=True)
    for wrong in ("A := 1;;", "IF A = 1 THEN END_IF;", "K := 2;"):
        with pytest.raises(SyntaxError):
            Library("FUNCTION F : UINT VAR_INPUT A : UINT; END_VAR VAR CONSTANT K : UINT := 1; "
                    f"END_VAR {wrong} F := A; END_FUNCTION", strict=True)


def units(text):
    return {match[2]: match[0] for match in re.finditer(
        r"^(FUNCTION|FUNCTION_BLOCK) (\w+).*?^END_\1$", text, re.S | re.M)}


def test_the_strict_form_differs_in_its_declarations_only(text):
    """And each constant has the value that it has in the library."""
    strict, constants = units(variant_text("strict")), Library(text).constants
    declared = 0
    for name, unit in units(text).items():
        section = re.search(r"VAR CONSTANT\n(.*?)END_VAR\n", strict[name], re.S)
        assert strict[name].replace(section[0] if section else "", "") == unit
        for constant, value in re.findall(r"(\w+) : \w+ := ([\w#]+);",
                                          section[1] if section else ""):
            assert int(value.removeprefix("16#"), 16 if "#" in value else 10) == constants[constant]
            declared += 1
    assert declared > 100


@pytest.mark.timeout(400)
@pytest.mark.parametrize("name", ["DB_WasSent", "DB_Axis", "MC_Power"])
def test_the_parser_takes_the_strict_form(name):
    assert parse_source_code(units(variant_text("strict"))[name]).exception is None


def test_the_prefixed_form_has_no_name_of_plcopens(library):
    other = Library(variant_text("prefixed"))
    assert {name.replace("DB_MC_", "MC_") for name in other.types} == set(library.types)
    assert other.constants == library.constants
    assert not re.search(r"\bMC_", variant_text("prefixed"))


def test_nothing_that_a_vendor_added(text):
    code = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S)
    assert "//" not in code and "{" not in code
    assert not re.search(r"\b(POINTER|REFERENCE|ADR|SIZEOF|METHOD|SHL|SHR|LREAL|RETURN)\b", code)
    # All that is called is the standard's, the library's or a variable's type.
    assert code.isascii()


def test_which_commands_and_types(library):
    ends, stops = library.functions["DB_EndsMotion"], library.functions["DB_IsStop"]
    codes = {row["name"]: int(row["code"]) for row in rows("commands.csv")}
    assert {name for name, code in codes.items() if stops(code)} == {"stop", "quick_stop", "disable"}
    assert {"stop", "move_relative", "home_stop"} <= {name for name in codes if ends(codes[name])}
    assert not any(ends(codes[name]) for name in ("enable", "set_position", "set_output"))
    for row in rows("register-map.csv"):
        kind = library.constants.get("DB_TYPE_" + row["type"].upper())
        assert kind is None or library.functions["DB_IsWide"](kind) == row["type"].endswith("32")


def test_names_are_there_once(library):
    """The language does not tell capitals from small letters."""
    names = [*library.constants, *library.types, *library.functions]
    assert len({name.upper() for name in names}) == len(names)
    assert set(BLOCKS) <= set(library.types)


def constant(prefix, name):
    return prefix + name.upper()


def test_registers_are_those_of_the_map(library):
    shown = 0
    for row in rows("register-map.csv"):
        if row["view"] == "drive" and row["table"] == "holding":
            address = library.constants.get(constant("DB_REG_", row["name"]))
            if address is not None and "family's" not in row["description"]:
                assert address == int(row["address"]), row["name"]
                shown += 1
        elif row["view"] == "gateway" and row["table"] == "holding":
            address = library.constants.get(constant("DB_GATEWAY_", row["name"]))
            assert address is None or address == int(row["address"]), row["name"]
    assert shown >= 40


def test_commands_are_those_of_the_table(library):
    for row in rows("commands.csv"):
        assert library.constants[constant("DB_CMD_", row["name"])] == int(row["code"])


@pytest.mark.parametrize(
    ("register", "prefix", "bits"),
    [("result", "DB_RESULT_", False), ("axis_state", "DB_STATE_", False),
     ("error", "DB_ERROR_", False), ("status", "DB_STATUS_", True),
     ("result_limit", "DB_LIMIT_", False), ("capabilities", "DB_CAN_", True)],
)
def test_codes_are_those_of_the_descriptions(library, register, prefix, bits):
    [row] = [row for row in rows("register-map.csv")
             if (row["view"], row["table"], row["name"]) == ("drive", "holding", register)]
    told = [word.split("=") for word in row["description"].split(":", 1)[1].split()
            if "=" in word]
    expected = {name.replace("_", "").upper(): 1 << int(code) if bits else int(code)
                for code, name in told}
    found = {name.removeprefix(prefix).replace("_", ""): value
             for name, value in library.constants.items() if name.startswith(prefix)}
    assert expected and found == expected


@pytest.mark.parametrize("value", [0.0, 1.0, -1.5, 0.1, 12800.0, -192000.0, 16777215.0, 3.4e38,
                                   1.1754944e-38, 1e-40, -1.4e-45])
def test_reals_in_registers(library, value):
    """By arithmetic there and back, to the last bit."""
    raw = struct.pack(">f", value)
    [single], [bits] = struct.unpack(">f", raw), struct.unpack(">I", raw)
    assert library.functions["DB_FromReal"](single) == bits
    assert library.functions["DB_ToReal"](bits) == single


@pytest.mark.parametrize("low_first", [False, True])
def test_words_of_a_number(library, low_first):
    words = [library.functions["DB_Part"](0x12345678, second, low_first)
             for second in (False, True)]
    assert words == ([0x5678, 0x1234] if low_first else [0x1234, 0x5678])
    assert library.functions["DB_Join"](*words, low_first) == 0x12345678
