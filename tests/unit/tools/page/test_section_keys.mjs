/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { setKeys, writeSection } from "../../../../src/tools/web/page/section_keys.js";

const TEXT = `# drive press { unit = 9 }
bus line { # the press
	protocol = vsmd-serial
}
drive press {
	bus = line // "drive"
	unit-name = "mm } {"   # counts-per-unit = 3
	allow = { a, "b" }
	counts-per-unit = 64.0 /* was
	measured */
}
drive "feeder 2" { bus = line unit = 2 }
`;

test("a value is changed where it stands, and nothing else", () => {
	assert.equal(setKeys(TEXT, "drive", "press", [{ key: "counts-per-unit", value: "640" }]),
		TEXT.replace("= 64.0", "= 640"));
	assert.equal(setKeys(TEXT, "drive", "press", [{ key: "allow", value: "c" }]),
		TEXT.replace('{ a, "b" }', "c"));
});

test("a key that is not there comes after the last one", () => {
	assert.equal(setKeys(TEXT, "drive", "press", [{ key: "min-position", value: "-10" }, { key: "unit", value: "3" }]),
		TEXT.replace("measured */\n", "measured */\n\tmin-position = -10\n\tunit = 3\n"));
	assert.equal(setKeys("drive a {\n    bus = b # here\n}\n", "drive", "a", [{ key: "unit", value: "3" }]),
		"drive a {\n    bus = b # here\n    unit = 3\n}\n");
	assert.equal(setKeys("drive a { bus = b }", "drive", "a", [{ key: "unit", value: "3" }]),
		"drive a { bus = b\n\tunit = 3\n}");
	assert.equal(setKeys("drive a {}", "drive", "a", [{ key: "unit", value: "3" }]), "drive a {\n\tunit = 3\n}");
});

test("a section is found by its name, not in a comment, a text or another kind", () => {
	assert.equal(setKeys(TEXT, "drive", "feeder 2", [{ key: "unit", value: "7" }]),
		TEXT.replace("unit = 2 }", "unit = 7 }"));
	assert.equal(setKeys(TEXT, "drive", "line", []) ?? null, TEXT);
	assert.equal(setKeys(TEXT, "drive", "line", [{ key: "unit", value: "7" }]), null);
	assert.equal(setKeys("", "drive", "press", [{ key: "unit", value: "7" }]), null);
	/* What is no configuration is left alone. */
	assert.equal(setKeys('drive press { unit = "2 }', "drive", "press", [{ key: "unit", value: "7" }]), null);
	assert.equal(setKeys("drive press { unit = 2", "drive", "press", [{ key: "unit", value: "7" }]), null);
});

test("a section is written for the file", () => {
	assert.equal(writeSection("drive", "press", [{ key: "unit", value: "3" }]), "drive press {\n\tunit = 3\n}\n");
});
