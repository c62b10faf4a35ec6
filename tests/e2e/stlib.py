# SPDX-License-Identifier: Apache-2.0
"""Runs Structured Text: as much of IEC 61131-3 as docs/drivebridge.st uses, turned into Python.

Stricter than most controllers, so that the library stays fit for all of them: a value outside its
type's range, a number where BOOL is due, an integer where REAL is due, a statement that is none, or
something that is used before it is declared is an error. On request as strict as matiec about
constants, too: none outside of the unit that uses them."""

import re
import struct
import time

TOKEN = re.compile(
    r"""(?P<space>\s+|\(\*.*?\*\))
      | (?P<time>T\#(?P<count>\d+)(?P<unit>ms|s))
      | (?P<hex>16\#[0-9A-F]+)
      | (?P<real>\d+\.\d+)
      | (?P<int>\d+)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<sign>:=|<>|<=|>=|\.\.|[-+*/=<>():;,.\[\]])""",
    re.X | re.S,
)

OPERATORS = [
    {"OR": "|"},
    {"AND": "&"},
    {"=": "==", "<>": "!="},
    {"<": "<", ">": ">", "<=": "<=", ">=": ">="},
    {"+": "+", "-": "-"},
    {"*": "*", "/": "/", "MOD": "%"},
]

RANGES = {
    "UINT": (0, 0xFFFF),
    "WORD": (0, 0xFFFF),
    "UDINT": (0, 0xFFFFFFFF),
    "DWORD": (0, 0xFFFFFFFF),
    "DINT": (-0x80000000, 0x7FFFFFFF),
    "TIME": (0, 0xFFFFFFFF),
}
DEFAULTS = {"BOOL": False, "REAL": 0.0, **dict.fromkeys(RANGES, 0)}


def fit(kind, value):
    """The value as a variable of an elementary type holds it."""
    if kind == "BOOL":
        if type(value) is not bool:
            raise TypeError(f"{value!r} is no BOOL")
        return value
    if kind == "REAL":
        if type(value) is not float:
            raise TypeError(f"{value!r} is no REAL")
        return struct.unpack("f", struct.pack("f", value))[0]
    low, high = RANGES[kind]
    if type(value) is not int or not low <= value <= high:
        raise TypeError(f"{value!r} is no {kind}")
    return value


class Array(list):
    def __init__(self, kind, count):
        super().__init__([DEFAULTS[kind]] * count)
        self.kind = kind

    def __setitem__(self, index, value):
        if not 0 <= index < len(self):
            raise IndexError(index)
        super().__setitem__(index, fit(self.kind, value))

    def take(self, other):
        for index, value in enumerate(other):
            self[index] = value


class Record:
    """A structure, or an instance of a block; its class has the variables' declarations."""

    declared = {}

    def __init__(self):
        for name, (_, make) in self.declared.items():
            object.__setattr__(self, name, make())

    def __setattr__(self, name, value):
        """An assignment: structures and arrays are copied."""
        kind = self.declared[name][0]
        if kind in DEFAULTS:
            object.__setattr__(self, name, fit(kind, value))
        else:
            getattr(self, name).take(value)

    def take(self, other):
        if type(other) is not type(self):
            raise TypeError(f"{other!r} is no {type(self).__name__}")
        for name in self.declared:
            setattr(self, name, getattr(other, name))


class Block(Record):
    references = frozenset()

    def __call__(self, **inputs):
        if missing := self.references - set(inputs):
            raise TypeError(f"{type(self).__name__} needs {missing}")
        for name, value in inputs.items():
            if name in self.references:
                object.__setattr__(self, name, value)
            else:
                setattr(self, name, value)
        self.body()
        return self

    def body(self):
        raise NotImplementedError


class Ton(Block):
    declared = {"IN": ("BOOL", bool), "PT": ("TIME", int), "Q": ("BOOL", bool),
                "since": ("TIME", int), "was": ("BOOL", bool)}

    def body(self):
        now = time.monotonic_ns() // 1000000 & 0xFFFFFFFF
        if self.IN and not self.was:
            self.since = now
        self.was = self.IN
        self.Q = self.IN and (now - self.since) & 0xFFFFFFFF >= self.PT


def invert(value):
    return not fit("BOOL", value)


def signed(value):
    return value - (1 << 32) if value & 0x80000000 else value


FUNCTIONS = {
    "ABS": abs,
    "DINT_TO_DWORD": lambda value: fit("DINT", value) & 0xFFFFFFFF,
    "DWORD_TO_DINT": lambda value: signed(fit("DWORD", value)),
    "DINT_TO_REAL": lambda value: float(fit("DINT", value)),
    "REAL_TO_DINT": lambda value: fit("DINT", round(value)),
    "WORD_TO_UINT": lambda value: fit("UINT", value),
    "UINT_TO_WORD": lambda value: fit("WORD", value),
    "WORD_TO_DWORD": lambda value: fit("WORD", value),
    "DWORD_TO_WORD": lambda value: fit("WORD", value),
    "UDINT_TO_UINT": lambda value: fit("UINT", value),
    "UDINT_TO_WORD": lambda value: fit("WORD", value),
    "UDINT_TO_DINT": lambda value: fit("DINT", value),
    "UDINT_TO_DWORD": lambda value: fit("DWORD", value),
    "DWORD_TO_UDINT": lambda value: fit("UDINT", value),
    "WORD_TO_UDINT": lambda value: fit("WORD", value),
}


def divide(left, right):
    return left / right if isinstance(left, float) else left // right


def examples(page):
    """The blocks of Structured Text on a page."""
    return re.findall(r"^```iecst\n(.*?)^```$", page.read_text(encoding="utf-8"), re.S | re.M)


def tokens(text):
    at = 0
    found = []
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            raise SyntaxError(f"at {text[at:at + 40]!r}")
        at = match.end()
        if match.lastgroup == "space":
            continue
        if match["time"]:
            found.append(("int", int(match["count"]) * (1000 if match["unit"] == "s" else 1)))
        elif match["hex"]:
            found.append(("int", int(match["hex"][3:], 16)))
        elif match["int"]:
            found.append(("int", int(match["int"])))
        elif match["real"]:
            found.append(("real", float(match["real"])))
        else:
            found.append((match.lastgroup, match[match.lastgroup]))
    return [*found, ("end", None)]


class Library:
    """A text's constants, structures, functions, blocks and programs, by their names."""

    def __init__(self, text, strict=False):
        self.strict = strict
        self.tokens = tokens(text)
        self.at = 0
        self.constants = {}
        self.types = {"TON": Ton}
        self.functions = dict(FUNCTIONS)
        self.local = set()
        self.fixed = set()
        while self.peek() is not None:
            self.declaration()

    # --- tokens

    def peek(self):
        return self.tokens[self.at][1]

    def next(self, wanted=None):
        value = self.tokens[self.at][1]
        if wanted is not None and value != wanted:
            raise SyntaxError(f"{wanted} expected: {self.tokens[self.at - 5:self.at + 3]}")
        self.at += 1
        return value

    def takes(self, *wanted):
        if self.peek() in wanted:
            return self.next()
        return None

    # --- declarations

    def declaration(self):
        what = self.next()
        if what == "VAR_GLOBAL":
            if self.strict:
                raise SyntaxError("VAR_GLOBAL outside of a configuration")
            self.next("CONSTANT")
            for name, (kind, make) in self.variables("END_VAR").items():
                if name in self.constants:
                    raise SyntaxError(f"{name} is there twice")
                self.constants[name] = fit(kind, make())
        elif what == "TYPE":
            name = self.next()
            self.next(":")
            self.next("STRUCT")
            self.types[name] = type(name, (Record,), {"declared": self.variables("END_STRUCT")})
            self.next(";")
            self.next("END_TYPE")
        elif what in ("FUNCTION", "FUNCTION_BLOCK", "PROGRAM"):
            self.unit(what)
        else:
            raise SyntaxError(what)

    def unit(self, what):
        name = self.next()
        declared = {}
        if self.takes(":"):
            kind = self.next()
            declared[name] = (kind, lambda: DEFAULTS[kind])
        inputs = []
        references = set()
        self.fixed = set()
        while section := self.takes("VAR_INPUT", "VAR_OUTPUT", "VAR_IN_OUT", "VAR"):
            constant = section == "VAR" and self.takes("CONSTANT")
            new = self.variables("END_VAR", section == "VAR_IN_OUT")
            self.fixed |= set(new) if constant else set()
            if self.strict and not new:
                raise SyntaxError(f"{name}: a section without variables")
            inputs += new if section == "VAR_INPUT" else []
            references |= set(new) if section == "VAR_IN_OUT" else set()
            declared.update(new)
        self.local = set(declared)
        lines = ["def body(self):", *self.statements("END_" + what)]
        self.next("END_" + what)
        scope = {**self.functions, "invert": invert, "divide": divide}
        exec("\n".join(lines), scope)  # noqa: S102 - the library's own text
        made = type(name, (Block,), {
            "declared": declared, "references": references, "body": scope["body"]})
        if what != "FUNCTION":
            self.types[name] = made
        else:
            self.functions[name] = lambda *values, **named: getattr(
                made()(**(named or dict(zip(inputs, values, strict=True)))), name)

    def variables(self, end, references=False):
        declared = {}
        while not self.takes(end):
            name = self.next()
            self.next(":")
            declared[name] = self.variable(references)
            self.next(";")
        return declared

    def variable(self, reference):
        """The type and what makes its first value."""
        kind = self.next()
        if reference:
            return kind, lambda: None
        if kind == "ARRAY":
            self.next("[")
            self.next(0)
            self.next("..")
            count = self.next() + 1
            self.next("]")
            self.next("OF")
            element = self.next()
            return "ARRAY", lambda: Array(element, count)
        if kind not in DEFAULTS:
            return kind, self.types[kind]
        first = DEFAULTS[kind]
        if self.takes(":="):
            first = self.next()
            if kind == "BOOL":
                first = {"TRUE": True, "FALSE": False}[first]
        fit(kind, first)
        return kind, lambda: first

    # --- statements: lines of Python

    def statements(self, *ends, depth=1):
        lines = []
        pad = "    " * depth
        while self.peek() not in ends and not (ends == ("case",) and self.is_label()):
            lines += [pad + line for line in self.statement()]
        if not lines:
            raise SyntaxError(f"no statement: {self.tokens[self.at - 5:self.at + 3]}")
        return lines

    def is_label(self):
        kind, value = self.tokens[self.at]
        return kind == "int" or value in ("ELSE", "END_CASE")

    def statement(self):
        what = self.peek()
        if what == ";":
            raise SyntaxError(f"an empty statement: {self.tokens[self.at - 5:self.at + 3]}")
        if what in self.fixed:
            raise SyntaxError(f"{what} is a constant")
        if self.takes("IF"):
            return self.branch()
        if self.takes("CASE"):
            return self.case()
        if self.takes("WHILE"):
            lines = [f"while {self.expression()}:"]
            self.next("DO")
            lines += self.statements("END_WHILE")
        elif self.takes("REPEAT"):
            lines = ["while True:", *self.statements("UNTIL")]
            self.next("UNTIL")
            lines += [f"    if {self.expression()}:", "        break"]
            self.next("END_REPEAT")
            self.at -= 1
        else:
            target = self.place()
            if self.takes("("):
                line = f"{target}({self.arguments()})"
            else:
                self.next(":=")
                line = f"{target} = {self.expression()}"
            self.next(";")
            return [line]
        self.next("END_" + what)
        self.next(";")
        return lines

    def branch(self):
        lines = [f"if {self.expression()}:"]
        self.next("THEN")
        while True:
            lines += self.statements("ELSIF", "ELSE", "END_IF")
            end = self.next()
            if end == "END_IF":
                break
            if end == "ELSIF":
                lines.append(f"elif {self.expression()}:")
                self.next("THEN")
            else:
                lines.append("else:")
        self.next(";")
        return lines

    def case(self):
        lines = [f"chosen = {self.expression()}"]
        word = "if"
        self.next("OF")
        while not self.takes("END_CASE"):
            lines.append(f"{word} chosen == {self.next()}:")
            word = "elif"
            self.next(":")
            lines += self.statements("case")
        self.next(";")
        return lines

    def arguments(self):
        """Of a block: by name."""
        given = []
        while not self.takes(")"):
            name = self.next()
            self.next(":=")
            given.append(f"{name}={self.expression()}")
            self.takes(",")
        return ", ".join(given)

    # --- expressions

    def place(self):
        name = self.next()
        if name not in self.local:
            raise SyntaxError(f"unknown variable {name}")
        text = f"self.{name}"
        while sign := self.takes(".", "["):
            if sign == ".":
                text += f".{self.next()}"
            else:
                text += f"[{self.expression()}]"
                self.next("]")
        return text

    def expression(self, level=0):
        if level == len(OPERATORS):
            return self.unary()
        text = self.expression(level + 1)
        while sign := self.takes(*OPERATORS[level]):
            right = self.expression(level + 1)
            text = (f"divide({text}, {right})" if sign == "/"
                    else f"({text} {OPERATORS[level][sign]} {right})")
        return text

    def unary(self):
        if self.takes("NOT"):
            return f"invert({self.unary()})"
        if self.takes("-"):
            return f"(-{self.unary()})"
        if self.takes("("):
            text = self.expression()
            self.next(")")
            return text
        kind, value = self.tokens[self.at]
        if kind in ("int", "real"):
            self.next()
            return repr(value)
        if value in ("TRUE", "FALSE"):
            self.next()
            return value.capitalize()
        if value in self.constants:
            self.next()
            return repr(self.constants[value])
        if value in self.functions and value not in self.local:
            return self.call()
        return self.place()

    def call(self):
        """Of the standard's functions by place, of the library's own by name."""
        name = self.next()
        self.next("(")
        if name not in FUNCTIONS:
            return f"{name}({self.arguments()})"
        given = []
        while not self.takes(")"):
            given.append(self.expression())
            self.takes(",")
        return f"{name}({', '.join(given)})"
