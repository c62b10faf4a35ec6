/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of a trace, whose words and bytes the server has written, as the lines of drivebridgectl,
 * which drivebridge-sim --replay reads. Pure, but for the time zone.
 */
import { writeClock, writeDay, writeZone } from "./plain.js";

const SIGNS = { sent: ">", received: "<" };
/* Its direction: > sent, < received, ! no answer, = an event. */
export function writeSign(record) {
	return SIGNS[record.direction] ?? (record.kind === "unanswered" ? "!" : "=");
}

/*
 * Records with their words: a gap before one is an entry of its own, { missed: count }. After a
 * lost connection the records are sent again, and a restarted service counts from the beginning.
 * Pure.
 */
export function createIntake() {
	let number = 0; /* of the last record */
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
				words: record.words
			});
		}
		return entries;
	};
}

/* Three lines of comment: the bus, and the day of the trace. */
export function writeHead(bus, timeUs) {
	return (
		`# drivebridge trace\n# bus ${bus.name}: ${bus.protocol}, ${bus.device} at ` +
		`${bus.speed} bit/s\n` +
		`# ${writeDay(timeUs)}, time of day at UTC ${writeZone(timeUs)}\n`
	);
}

/* TIME DIRECTION KIND WHO: WORDS | BYTES */
export function writeLine({ time_us, kind, words, bytes, ...record }) {
	return (
		`${writeClock(time_us, 6)} ${writeSign({ kind, ...record })} ` +
		`${kind.padEnd(10)} ${words}${bytes ? ` | ${bytes}` : ""}\n`
	);
}
