/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { FRAMES, createFrames } from "../../../../src/tools/web/page/record_words.js";

const ROOT = new URL("../../../../", import.meta.url);

/* The translations of a file of po/, without plurals. */
function readPo(name) {
	const text = readFileSync(new URL(`po/${name}.po`, ROOT), "utf-8");
	const unquote = (lines) => lines.match(/"(?:\\.|[^"\\])*"/g).map((line) => JSON.parse(line)).join("");

	return new Map([...text.matchAll(/^msgid ((?:".*"\n)+)msgstr ((?:".*"\n?)+)/gm)].map(([, english, words]) =>
		[unquote(english), unquote(words)]));
}

function sayIn(name) {
	const table = readPo(name);

	return createFrames((english, values = {}) => (table.get(english) ?? english).replace(/\{(\w+)\}/g,
		(all, key) => String(values[key] ?? all)));
}

test("frames are in the language of the page, with their names and numbers as they are", () => {
	const de = sayIn("de");
	const zh = sayIn("zh_CN");

	assert.equal(de("drive1: move to 640 pulses at 3200 pulses/s"), "drive1: nach 640 Pulsen fahren mit 3200 pulses/s");
	assert.equal(zh("drive1: move to 640 pulses"), "drive1: 移动到 640 脉冲");
	assert.equal(de("lift: position -7 pulses, velocity 0 pulses/s, status pwr stp (3.456 ms)"),
		"lift: Position -7 Pulse, Geschwindigkeit 0 pulses/s, Status pwr stp (3.456 ms)");
	assert.equal(de("address 4: status?"), "Adresse 4: Status?");
	assert.equal(de("all drives: sync"), "alle Antriebe: Sync");
	assert.equal(de("lift: no answer to \"stop at once\" within 30.000 ms"),
		"lift: keine Antwort auf „sofort anhalten“ innerhalb von 30.000 ms");
	assert.equal(de("lift: set acc 64000 pulses/s², dec 100"), "lift: setzen: acc 64000 pulses/s², dec 100");
	assert.equal(de("x1: program command accepted"), "x1: Programmbefehl angenommen");
	assert.equal(de("s1: acknowledges speed, measured 17 rpm"), "s1: bestätigt Drehzahl, gemessen 17 rpm");
	assert.equal(de("s1: acceleration 1000 rpm/s, deceleration 2000 rpm/s"),
		"s1: Beschleunigung 1000 rpm/s, Verzögerung 2000 rpm/s");
	assert.equal(de("drive-lost"), "drive-lost");
	assert.equal(de(""), "");
});

test("each text of which the service makes the words of a frame is known", () => {
	const names = ["vsmd_describe", "xyza_describe", "servo_can_describe"];
	const sources = names.map((name) => readFileSync(new URL(`src/common/codec/${name}.c`, ROOT), "utf-8")
		.replace(/\/\*.*?\*\/|#include[^\n]*/gs, "")).join("");
	const known = (text) => FRAMES.some((form) => form.startsWith(text) || form.endsWith(text));
	const written = [...sources.matchAll(/"((?:\\.|[^"\\])*)"/g)].map(([, text]) => text.replaceAll("\\\"", "\"")
		.replace(/%\.\*s/g, "%s").replace(/^[, ]+|( at )?[, ?]*$/g, "")).filter((text) => /[a-z]{3}/i.test(text.replace(/%\w+/g, "")));
	/* Units, parts of outputs, and texts with a choice in them, whose forms are in the list one by one. */
	const other = ["pulses/s", "nmos", "times", "from", "start", "every %u ms", "at once", "to and fro %s %ld pulses", "move %s %ld pulses",
		"%s homing", "stop%s", "jog %s", "backward", "forward", "program %u %s, instruction %u", "idle", "running", "waiting",
		"interrupted", "program %u in state %u, instruction %u", "inputs %04X, outputs %04X", "inputs %02X, outputs %02X", "acknowledges %02X",
		"measured %d rpm", "speed %d rpm, current", "move, target %lld steps", "acceleration %lu rpm/s, deceleration %lu rpm/s",
		"supply voltage raw %u, temperature raw %u, faults", "position %ld pulses, velocity"];

	assert.ok(written.length > 60, `${written.length}`);
	assert.deepEqual([...new Set(written)].filter((text) => !known(text) && !other.includes(text)), []);
});
