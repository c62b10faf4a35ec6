/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A table with the newest entries first, whole texts included. It draws so many rows as people
 * read, and older ones on request.
 */
import { element, setText } from "./dom.js";
import { createKeptList } from "./kept_list.js";
import { t } from "./words.js";

const DRAW_EVERY_MS = 100;
const ROWS_AT_ONCE = 200;

/*
 * columns: [{ title, text(entry) }]; kind(entry) becomes the row's data-kind; `most` entries are
 * kept. onDraw(list) is called when the list of kept_list.js may have changed, at most ten times a
 * second. Returns { node, list, add(entries), filter(matches), pause(on), close() }.
 */
export function createNewestList({ label, columns, kind, most, onDraw }) {
	const list = createKeptList(most);
	const body = element("tbody");
	const older = element("button", { class: "small", type: "button", hidden: true });
	const node = element("div", { class: "newest-list" },
		element("div", { class: "panel table-frame", role: "region", tabindex: "0",
			"aria-label": label },
		element("table", {},
			element("caption", { class: "hidden-label" }, t("{label}, the newest first", { label })),
			element("thead", {}, element("tr", {},
				columns.map(({ title }) => element("th", { scope: "col" }, title)))),
			body)),
		older);
	/* Rows that are drawn already, by entry. */
	let rows = new Map();
	let wanted = ROWS_AT_ONCE;
	let timer = 0;

	function makeRow(entry) {
		return element("tr", { "data-kind": kind(entry) },
			columns.map(({ text }) => element("td", {}, text(entry))));
	}

	function draw() {
		const part = list.shown.slice(-wanted).reverse();
		const next = new Map(part.map((entry) => [entry, rows.get(entry) ?? makeRow(entry)]));
		const rest = list.shown.length - part.length;

		timer = 0;
		rows = next;
		body.replaceChildren(...next.values());
		older.hidden = rest === 0;
		setText(older, t("Show older ones ({rest})", { rest }));
		onDraw(list);
	}

	function drawSoon() {
		timer ||= setTimeout(draw, DRAW_EVERY_MS);
	}

	older.addEventListener("click", () => {
		wanted += ROWS_AT_ONCE;
		drawSoon();
	});
	return {
		node,
		list,
		add(entries) {
			list.add(entries);
			drawSoon();
		},
		pause(on) {
			list.pause(on);
			drawSoon();
		},
		filter(matches) {
			list.filter(matches);
			wanted = ROWS_AT_ONCE;
			drawSoon();
		},
		close: () => clearTimeout(timer),
	};
}
