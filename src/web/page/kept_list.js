/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The latest entries of what goes on without an end, and those of them that a filter lets through.
 * Pure.
 */

/* Old entries go in blocks: to move all that stay for each new one would cost too much. */
const BLOCK = 0.1;

/*
 * Keeps `most` entries, and up to a tenth more. add(entries) returns how many of `shown` went for
 * them. While it is paused new ones wait, the latest of as many.
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

		/* They are the first of those that are shown, too. */
		return list.shown.splice(0, matches ? old.filter(matches).length : old.length)
			.length;
	}

	function clear() {
		list.all = [];
		list.shown = [];
		list.waiting = [];
	}

	/* A function of an entry that always says the same of it; null: all. */
	function filter(next) {
		matches = next;
		list.shown = matches ? list.all.filter(matches) : [...list.all];
	}

	/* Returns as add() does. */
	function pause(on) {
		const entries = list.waiting;

		list.paused = on;
		list.waiting = [];
		return on ? 0 : add(entries);
	}

	return list;
}
