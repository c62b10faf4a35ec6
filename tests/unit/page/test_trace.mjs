// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { beginPcapng, writeFrame } from "../../../src/web/page/pcapng.js";
import { createIntake, createQuestions, readBytes, writeHead, writeLine } from "../../../src/web/page/trace_text.js";

process.env.TZ = "Asia/Kolkata";

const ASKED = { number: 7, time_us: 1795365001812803, kind: "poll", direction: "sent", data: "3320", drive: "lift",
	address: 3, words: "status?" };
const ANSWERED = { number: 8, time_us: 1795365001816087, kind: "answer", direction: "received", question: 7,
	data: "FF03", drive: "lift", address: 3, words: "position 0 pulses" };
const SILENT = { number: 9, time_us: 1795365001873101, kind: "unanswered", direction: "none", question: 7, words: "" };

function lines(records) {
	const questions = createQuestions();

	return records.map((record) => writeLine(record, questions.take(record)));
}

test("lines are those of drivebridgectl trace", () => {
	assert.deepEqual(lines([ASKED, ANSWERED, SILENT, { number: 10, time_us: 1795365001913345, kind: "event",
		direction: "none", drive: "lift", words: "drive-lost" }]), [
		"00:00:01.812803 > poll       lift: status? | 33 20\n",
		"00:00:01.816087 < answer     lift: position 0 pulses (3.284 ms) | FF 03\n",
		'00:00:01.873101 ! unanswered lift: no answer to "status?" within 60.298 ms\n',
		"00:00:01.913345 = event      lift: drive-lost\n"].map((line) =>
		line.replace("00:00:01", new Date(1795365001000).toTimeString().slice(0, 8))));
	assert.equal(lines([{ ...SILENT, address: 5 }])[0].slice(16), "! unanswered no answer\n");
	assert.equal(lines([{ ...ASKED, drive: null, address: 0, data: undefined, words: "start\n" }])[0].slice(16),
		"> poll       all drives: start?\n");
});

test("bytes of CAN have their id before them", () => {
	assert.equal(readBytes({ id: 0x123, data: "0102" }), "123#0102");
	assert.equal(readBytes({ id: 0x80000123, data: "" }), "00000123#");
	assert.equal(readBytes({ id: 0x40000123, data: "" }), "123#R");
	assert.equal(readBytes({}), "");
});

test("so many questions are remembered and no more", () => {
	const questions = createQuestions();

	for (let number = 1; number <= 5000; number++)
		questions.take({ ...ASKED, number: number * 3 });
	assert.match(questions.take({ ...ANSWERED, question: 15000 }), /ms\)$/);
	assert.doesNotMatch(questions.take({ ...ANSWERED, question: 3 }), /ms\)$/);
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

test("a file of CAN is what Wireshark reads", () => {
	const bytes = Buffer.from(writeFrame({ time_us: 1795365001812803, direction: "received", id: 0x80000123, data: "0AFF" },
		"answer: lift", 3));
	const head = Buffer.from(beginPcapng("can", "an adapter"));

	assert.equal(head.readUInt32LE(0), 0x0A0D0D0A);
	assert.equal(head.readUInt32LE(8), 0x1A2B3C4D);
	assert.equal(head.readUInt32LE(24), 28);
	assert.equal(head.readUInt32LE(28), 1);
	assert.equal(head.readUInt16LE(36), 227);
	assert.equal(head.length, 28 + head.readUInt32LE(32));
	assert.equal(bytes.readUInt32LE(0), 6);
	assert.equal(bytes.readUInt32LE(4), bytes.length);
	assert.equal(bytes.readUInt32LE(bytes.length - 4), bytes.length);
	assert.equal(bytes.readUInt32LE(12) * 2 ** 32 + bytes.readUInt32LE(16), 1795365001812803);
	assert.equal(bytes.readUInt32LE(20), 10);
	assert.equal(bytes.subarray(28, 38).toString("hex"), "8000012302000000" + "0aff");
	assert.ok(bytes.includes(Buffer.from("answer: lift")));
	/* How many are missing before it. */
	assert.ok(bytes.includes(Buffer.from([4, 0, 8, 0, 3, 0, 0, 0, 0, 0, 0, 0])));
});
