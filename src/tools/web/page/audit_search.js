/* SPDX-License-Identifier: Apache-2.0 */
/* Records of the audit trail, from the newest back, as far as somebody wants to see. */

/* What the server reads, from the fields of the form; `from` and `to` are local times as
 * "2026-05-01T14:00", and all of that last minute is meant. */
export function makeFilter({ from, to, refused, ...texts }) {
	const filter = {};
	const since = Date.parse(from ?? "");
	const until = Date.parse(to ?? "");

	for (const [name, text] of Object.entries(texts)) {
		if (text?.trim())
			filter[name] = text.trim();
	}
	if (!Number.isNaN(since))
		filter.since_us = since * 1000;
	if (!Number.isNaN(until))
		filter.until_us = (until + 60000) * 1000 - 1;
	if (refused)
		filter.refused = true;
	return filter;
}

/* Where the records are as a file, "jsonl" or "cef". */
export function makeAddress(form, filter) {
	const query = new URLSearchParams(filter).toString();

	return `api/audit.${form}${query ? `?${query}` : ""}`;
}

/*
 * A search. ask(parameters) promises an answer of the server; `most` records are kept: with more,
 * the newest ones are forgotten. onChange(search) is called when something has changed:
 *   records   newest first
 *   forgotten records that were newer
 *   before    records with smaller numbers have not been looked at
 *   over      there are no such
 *   running
 *   trail     as the service's method Audit has it; null: not known yet
 *   error     that has ended the last more(); null
 * more(count) looks for so many more; stop() ends that, and nothing is called any more.
 */
export function createSearch({ ask, filter, most, onChange }) {
	const search = { records: [], forgotten: 0, before: 0, over: false, running: false,
		trail: null, error: null, more, stop };
	let stopped = false;

	function take(answer) {
		const records = [...search.records, ...answer.records];

		search.records = records.slice(-most);
		search.forgotten += records.length - search.records.length;
		search.before = answer.before;
		search.over = answer.over;
		search.trail = answer.trail;
	}

	async function more(count) {
		let missing = count;

		if (search.running || search.over || stopped)
			return;
		search.running = true;
		search.error = null;
		onChange(search);
		while (missing > 0 && !search.over && !search.error && !stopped) {
			try {
				const answer = await ask({ ...filter,
					...(search.before > 0 ? { before: search.before } : {}) });

				missing -= answer.records.length;
				if (!stopped)
					take(answer);
			} catch (error) {
				search.error = error;
			}
			if (!stopped)
				onChange(search);
		}
		search.running = false;
		if (!stopped)
			onChange(search);
	}

	function stop() { stopped = true; }

	return search;
}
