# SPDX-License-Identifier: Apache-2.0
"""Which failures the run of all tests excuses when they do not come again: none in which a program broke, or a sanitizer found
something, which may need just the moment that does not come again."""

import subprocess
import sys
from types import SimpleNamespace
from xml.sax.saxutils import quoteattr

import pytest
import stalls
from bridgelib import ROOT

FAILURES = {
    "slow": "AssertionError: not within 10.0 s: the drive to move; last False",
    "overflow": "AssertionError: ['drivebridged ended with 1 by itself', 'sanitizer output in bridge.log']",
    "crash": "AssertionError: ['drivebridged ended with -11 by itself']",
    "tool": "assert 'Sanitizer' not in '==7==ERROR: AddressSanitizer: heap-buffer-overflow'",
}


@pytest.mark.parametrize("name", FAILURES)
def test_only_what_was_slow_is_excused(tmp_path, name):
    first, again, count = tmp_path / "first.xml", tmp_path / "again.xml", tmp_path / "count"
    first.write_text(f"<testsuite><testcase classname='t' name='{name}'><error message={quoteattr(FAILURES[name])}>why</error>"
                     "</testcase></testsuite>")
    again.write_text(f"<testsuite><testcase classname='t' name='{name}'/></testsuite>")
    count.write_text("1")
    said = subprocess.run([sys.executable, ROOT / "tests/tools/count-junit", first, count, again], capture_output=True, text=True,
                          check=True).stdout
    assert said.split() == (["1", "0"] if name == "slow" else ["0", "1", name])
    report = SimpleNamespace(failed=True, longreprtext=FAILURES[name])
    assert bool(stalls.broke([report])) == (name != "slow")
