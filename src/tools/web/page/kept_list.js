/* SPDX-License-Identifier: Apache-2.0 */
/* The latest entries of an endless sequence, and those of them that a filter selects. Pure. */

/* Old entries are dropped in blocks: to move all others for each new one would cost too much. */
const BLOCK = 0.1;

/*
 * Keeps `most` entries, and up to a tenth more. add(entries) returns how many entries of `shown`
 * were dropped for them. While it is paused new entries wait, `most` of them at most.
 */
export function createKeptList(most) {
	const list = { all: [], shown: [], waiting: [], paused: false, add, clear, filter, pause };
	let matches = null;

	function trim(entries) {
		return entries.length > most * (1 + BLOCK)
			? entries.splice(0, entries.length - most)
			: [];
	}

	function add(entries) {
		if (list.paused) {
			list.waiting.push(...entries);
			trim(list.waiting);
			return 0;
		}
		list.all.push(...entries);
		list.shown.push(...(matches ? entries.filter(matches) : entries));
		const old = trim(list.all);

		/* The dropped entries are also the first of the shown ones. */
		return list.shown.splice(0, matches ? old.filter(matches).length : old.length)
			.length;
	}

	function clear() {
		list.all = [];
		list.shown = [];
		list.waiting = [];
	}

	/* `next` is a function of an entry with a constant result; null: all. */
	function filter(next) {
		matches = next;
		list.shown = matches ? list.all.filter(matches) : [...list.all];
	}

	/* Returns the same as add(). */
	function pause(on) {
		const entries = list.waiting;

		list.paused = on;
		list.waiting = [];
		return on ? 0 : add(entries);
	}

	return list;
}
