/* SPDX-License-Identifier: Apache-2.0 */
import { formatShort } from "./format.js";
import { t } from "./words.js";
/*
 * What the service keeps of how drives were, made ready for pictures. Pure.
 *
 * Intervals have gaps between them where the service did not run; a drive has none where it was not
 * configured. Neither is drawn as if it had been well.
 */

/* How far back, how fine, and the form of times. With many drives quarters do not go back a day. */
export const RANGES = {
	hour: { words: t("last hour"), for_s: 3600, step_s: () => 60 },
	day: { words: t("last day"), for_s: 86400, step_s: (drives) => (drives > 64 ? 3600 : 900) },
	week: { words: t("last week"), for_s: 604800, step_s: () => 3600 },
};

/* What share of the questions was not answered, or of the time offline: 0 none, 4 much. */
const LEVELS = [0, 0.001, 0.01, 0.1];
export const LEVEL_WORDS = [t("nothing lost"), t("up to 0.1 %"), t("up to 1 %"), t("up to 10 %"), t("more, or offline")];

export function levelOf(share) {
	return LEVELS.filter((limit) => share > limit).length;
}

/* Of one interval: the larger one of the share lost and the share of the time offline. */
export function shareOf(lostPpm, offlineMs, spanS) {
	return Math.max(lostPpm / 1e6, spanS > 0 ? Math.min(1, offlineMs / 1000 / spanS) : 0);
}

/*
 * Of a row of HealthRows: cells from left to right, { left, width, level } as parts of the range
 * that ends at `now`, which leave out what is not known; the worst share; how long it was offline,
 * s; and all shares with their times together.
 */
export function readRow(row, times, nowUs, forS) {
	const beginUs = nowUs - forS * 1e6;
	const cells = [];
	let worst = 0;
	let offline = 0;
	let weight = 0;
	let known = false;

	times.forEach(({ end_us: end, span_s: span }, index) => {
		const lost = row.lost_ppm[index];

		if (lost === null || lost === undefined)
			return;
		const share = shareOf(lost, row.offline_ms[index], span);
		const from = Math.max(beginUs, end - span * 1e6);

		known = true;
		worst = Math.max(worst, share);
		offline += row.offline_ms[index] / 1000;
		weight += share * span;
		cells.push({ left: (from - beginUs) / forS / 1e6, width: Math.max(0, (end - from) / forS / 1e6),
			level: levelOf(share) });
	});
	return { drive: row.drive, cells, worst, offline, weight, known };
}

/* Those that lost most in all first; those of which nothing is known last. */
export function sortRows(rows) {
	return [...rows].sort((one, other) => Number(other.known) - Number(one.known) ||
		other.weight - one.weight);
}

/* "3.2 %", "0.02 %" */
export function formatShare(share) {
	const percent = share * 100;

	return `${percent === 0 ? 0 : percent >= 10 ? Math.round(percent) : formatShort(percent, 2)} %`;
}

/*
 * Columns for a plot: times in seconds, then of each reader its value; a null between two intervals
 * that are further apart than they should be.
 */
export function makeColumns(values, stepS, readers) {
	const columns = [[], ...readers.map(() => [])];
	let before = null;

	for (const value of values) {
		const end = value.end_us / 1e6;

		if (before !== null && end - value.span_s - before > stepS / 2) {
			const middle = (before + end) / 2;

			columns.forEach((column, index) => column.push(index === 0 ? middle : null));
		}
		before = end;
		columns.forEach((column, index) => column.push(index === 0 ? end : readers[index - 1](value)));
	}
	return columns;
}
