/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { countLines, describeEffects, findLine, readMessage } from "../../../../src/tools/web/page/config_text.js";

const PATH = "/etc/drivebridge/edited/edited.conf";

test("a message of the edited file has its line there", () => {
	assert.deepEqual(readMessage(`${PATH}:12: unknown key 'a:1: b'; there is c`, PATH),
		{ line: 12, warning: false, text: "unknown key 'a:1: b'; there is c" });
	assert.deepEqual(readMessage(`${PATH}:3: warning: too slow`, PATH),
		{ line: 3, warning: true, text: "too slow" });
	assert.deepEqual(readMessage(`${PATH}: 5 more errors`, PATH),
		{ line: 0, warning: false, text: "5 more errors" });
});

test("one of another file names that file, and no line here", () => {
	const other = "/etc/drivebridge/conf.d/a.conf:7: warning: too slow";

	assert.deepEqual(readMessage(other, PATH), { line: 0, warning: true, text: other });
	assert.equal(readMessage(`${PATH}x:7: wrong`, PATH).line, 0);
});

test("lines are found, also the last and what is behind it", () => {
	const text = "one\n\nthree";

	assert.equal(countLines(text), 3);
	assert.deepEqual([1, 2, 3, 4].map((line) => findLine(text, line)),
		[{ start: 0, end: 3 }, { start: 4, end: 4 }, { start: 5, end: 10 }, { start: 5, end: 10 }]);
	assert.deepEqual(findLine("", 1), { start: 0, end: 0 });
});

test("what moves is named first", () => {
	assert.deepEqual(describeEffects([
		{ bus: "line", drive: null, text: "it is added", moves: false },
		{ bus: "line", drive: "feeder", text: "it is removed", moves: true }
	]), ["feeder MOVES NOW: it is removed", "bus line: it is added"]);
});
