/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of a trace in words, and the lines of drivebridgectl, which drivebridge-sim --replay
 * takes: as src/ctl/trace_text.c. Pure, but for the time zone.
 */
import { cleanText, writeClock, writeDay, writeZone } from "./plain.js";

const SIGNS = { sent: ">", received: "<" };
/* So long ago a question may be for its answer's line to say how long it took. */
const QUESTIONS = 512;

const ID_EXTENDED = 0x80000000;
const ID_REMOTE = 0x40000000;
const ID_ERROR = 0x20000000;

/* How it went: > sent, < received, ! nothing came, = an event. */
export function writeSign(record) {
	return SIGNS[record.direction] ?? (record.kind === "unanswered" ? "!" : "=");
}

/* The drive's name, or its address; "" when nobody is told. */
function writeWho(record) {
	if (record.drive)
		return cleanText(record.drive);
	if (typeof record.address !== "number")
		return "";
	return record.address === 0 ? "all drives" : `address ${record.address}`;
}

/*
 * Knows the latest questions, so that an answer can say how long it took: take(record) is WHO:
 * WORDS, of each record once and in their order.
 */
export function createQuestions() {
	const asked = new Map();

	function take(record) {
		const question = asked.get(record.question);
		const ms = question ? ((record.time_us - question.time_us) / 1000).toFixed(3) : "";
		const who = writeWho(record);
		const words = cleanText(record.words);

		if (record.direction === "sent") {
			asked.set(record.number, { time_us: record.time_us, who, words });
			if (asked.size > QUESTIONS)
				asked.delete(asked.keys().next().value);
		}
		if (record.kind !== "unanswered")
			return `${who}${who ? ": " : ""}${words}${question ? ` (${ms} ms)` : ""}`;
		return question
			? `${question.who}${question.who ? ": " : ""}no answer to ` +
					`"${question.words}" ` +
					`within ${ms} ms`
			: "no answer";
	}

	return { take };
}

/*
 * Records with their words; what is missing before one is an entry of its own, { missing: so many
 * }. A connection that was lost and is back tells again what is there, and a service that was
 * restarted counts from the beginning. Pure.
 */
export function createIntake() {
	const questions = createQuestions();
	let number = 0; /* of the last one */
	let latestUs = 0; /* times may be a little out of order */

	return ({ records, missed }) => {
		const entries = [];
		let missing = missed;

		for (const record of records) {
			if (record.number <= number && record.time_us <= latestUs)
				continue;
			if (number > 0 && record.number > number)
				missing = record.number - number - 1;
			if (missing > 0)
				entries.push({ missing, time_us: record.time_us, kind: "missing" });
			missing = 0;
			({ number } = record);
			latestUs = Math.max(latestUs, record.time_us);
			entries.push({
				record,
				kind: record.kind,
				time_us: record.time_us,
				words: questions.take(record)
			});
		}
		return entries;
	};
}

/* Bytes apart, of CAN ID#DATA; "" where there are none. */
export function readBytes(record) {
	if (typeof record.data !== "string")
		return "";
	if (typeof record.id !== "number")
		return record.data.replace(/..(?=.)/g, "$& ");
	const long = (record.id & (ID_EXTENDED | ID_ERROR)) !== 0;
	const id = (record.id & ~(ID_EXTENDED | ID_REMOTE)) >>> 0;

	return (
		`${id
			.toString(16)
			.toUpperCase()
			.padStart(long ? 8 : 3, "0")}#` +
		`${record.id & ID_REMOTE ? "R" : ""}${record.data}`
	);
}

/* Three lines of comment: whose trace it is, and of which day. */
export function writeHead(bus, timeUs) {
	return (
		`# drivebridge trace\n# bus ${bus.name}: ${bus.protocol}, ${bus.device} at ` +
		`${bus.speed} bit/s\n` +
		`# ${writeDay(timeUs)}, time of day at UTC ${writeZone(timeUs)}\n`
	);
}

/* TIME DIRECTION KIND WHO: WORDS | BYTES */
export function writeLine(record, words) {
	const bytes = readBytes(record);

	return (
		`${writeClock(record.time_us, 6)} ${writeSign(record)} ` +
		`${record.kind.padEnd(10)} ${words}` +
		`${typeof record.data === "string" ? ` | ${bytes}` : ""}\n`
	);
}
