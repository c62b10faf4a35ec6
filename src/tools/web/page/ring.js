/* SPDX-License-Identifier: Apache-2.0 */
/* The latest values of a plot, and a part of them as CSV. Pure. */

/*
 * Ascending times, each with `width` values, the latest `capacity` of them. Everything is written
 * twice, into arrays of twice the size, so that the kept part is contiguous without copying. Pure.
 */
export function createRing(width, capacity) {
	const columns = Array.from({ length: width + 1 }, () => new Float64Array(2 * capacity));
	let next = 0;
	let count = 0;

	const ring = {
		get length() { return count; },
		/* Values that are no numbers are kept as NaN. False when the time is not later than
		 * the last one. */
		push(time, values) {
			if (count > 0 && time <= ring.lastTime())
				return false;
			for (let i = 0; i <= width; i++) {
				const value = i === 0 ? time : values[i - 1];

				columns[i][next] = columns[i][next + capacity] =
					typeof value === "number"  ? value :
					typeof value === "boolean" ? Number(value) :
						NaN;
			}
			next = (next + 1) % capacity;
			count = Math.min(count + 1, capacity);
			return true;
		},
		lastTime: () => (count > 0 ? columns[0][next + capacity - 1] : NaN),
		firstTime: () => (count > 0 ? columns[0][next + capacity - count] : NaN),
		/* The last value of a column, NaN when there is none. */
		last: (column) => (count > 0 ? columns[column + 1][next + capacity - 1] : NaN),
		/*
		 * From the sample before `from` to the one after `to`: [times, values of each
		 * requested column], views that are valid until the next push.
		 */
		range(from, to, wanted) {
			const end = next + capacity;
			const times = columns[0].subarray(end - count, end);
			const first = Math.max(0, findTime(times, from) - 1);
			const last = Math.min(count, findTime(times, to) + 1);

			return [
				times.subarray(first, last),
				...wanted.map((column) => columns[column + 1].subarray(
					end - count + first, end - count + last))
			];
		},
		clear() {
			next = 0;
			count = 0;
		},
	};

	return ring;
}

/* The index of the first time that is not before `time`, in ascending ones. */
export function findTime(times, time) {
	let low = 0;
	let high = times.length;

	while (low < high) {
		const middle = (low + high) >> 1;

		if (times[middle] < time)
			low = middle + 1;
		else
			high = middle;
	}
	return low;
}

/*
 * The plotted rows as CSV, in the form of `drivebridgectl record`: seconds from the first sample,
 * seconds since 1970, one column for each value. `heads` are their names with units. Pure.
 */
export function formatCsv(heads, [times, ...columns]) {
	const quote = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll("\"", "\"\"")}"` : text);
	const write = (value) => (Number.isNaN(value) ? "" : String(Number(value.toPrecision(10))));
	const lines = [["time_s", "unix_time_s", ...heads].map(quote).join(",")];

	for (let i = 0; i < times.length; i++)
		lines.push([(times[i] - times[0]).toFixed(6), times[i].toFixed(6),
			...columns.map((column) => write(column[i]))].join(","));
	return `${lines.join("\n")}\n`;
}
