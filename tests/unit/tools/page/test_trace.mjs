// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { createIntake, writeHead, writeLine } from "../../../../src/tools/web/page/trace_text.js";

process.env.TZ = "Asia/Kolkata";

const ASKED = { number: 7, time_us: 1795365001812803, kind: "poll", direction: "sent", bytes: "33 20", words: "lift: status?" };

test("lines are those of drivebridgectl trace", () => {
	const line = (record) => writeLine({ ...ASKED, ...record }).replace(/^\d\d:\d\d/, "");

	assert.equal(line({}), ":01.812803 > poll       lift: status? | 33 20\n");
	assert.equal(line({ kind: "unanswered", direction: "none", bytes: undefined }), ":01.812803 ! unanswered lift: status?\n");
	assert.equal(line({ kind: "event", direction: "none", bytes: undefined }), ":01.812803 = event      lift: status?\n");
	assert.equal(line({ kind: "answer", direction: "received" }), ":01.812803 < answer     lift: status? | 33 20\n");
});

test("a trace goes on where a lost connection ended it", () => {
	const take = createIntake();
	const told = (answer) => take(answer).map((entry) => entry.missing ? `${entry.missing} missing` : entry.record.number);
	const records = (...numbers) => numbers.map((number) => ({ ...ASKED, number, time_us: ASKED.time_us + number }));

	assert.deepEqual(told({ records: records(5, 6), missed: 4 }), ["4 missing", 5, 6]);
	/* A frame's time may be before that of the one before it. */
	assert.deepEqual(told({ records: [{ ...ASKED, number: 7, time_us: ASKED.time_us }], missed: 0 }), [7]);
	assert.deepEqual(told({ records: records(10), missed: 2 }), ["2 missing", 10]);
	/* Past and all again, and then with a gap. */
	assert.deepEqual(told({ records: records(9, 10, 11), missed: 0 }), [11]);
	assert.deepEqual(told({ records: records(20), missed: 0 }), ["8 missing", 20]);
	/* The service was restarted. */
	assert.deepEqual(told({ records: [{ ...ASKED, number: 1, time_us: ASKED.time_us + 9000 }], missed: 0 }), [1]);
});

test("the head says whose trace it is and where its clock stands", () => {
	assert.match(writeHead({ name: "line", protocol: "vsmd-serial", device: "/dev/ttyUSB0", speed: 115200 }, ASKED.time_us),
		/^# drivebridge trace\n# bus line: vsmd-serial, \/dev\/ttyUSB0 at 115200 bit\/s\n# 2026-\d\d-\d\d, time of day at UTC [+-]\d{4}\n$/);
});
