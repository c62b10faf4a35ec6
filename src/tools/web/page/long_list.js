/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A table of an endless sequence, of which only the visible rows are drawn. It follows the end
 * until the user scrolls away from it.
 */
import { element } from "./dom.js";
import { createKeptList } from "./kept_list.js";

const DRAW_EVERY_MS = 100;
const ROWS_BEYOND = 10; /* drawn above and below the visible ones, for scrolling */
/* On paper, the last ones. */
const PRINTED_MOST = 1000;

/*
 * columns: [{ title (a text or a node), text(entry) }], the last of which takes the remaining
 * width; kind(entry) becomes the row's data-kind; `most` entries are kept. onDraw(list) is called
 * when the list of kept_list.js may have changed, at most ten times a second; monospace is for
 * code. Returns { node, list, add(entries), clear(), filter(matches), pause(on), close() }.
 */
export function createLongList({ label, columns, kind, most, onDraw, monospace }) {
	const list = createKeptList(most);
	const body = element("tbody");
	const table = element(
		"table",
		{},
		element("caption", { class: "hidden-label" }, label),
		element(
			"thead",
			{},
			element(
				"tr",
				{},
				columns.map(({ title }) => element("th", { scope: "col" }, title))
			)
		),
		body
	);
	const node = element(
		"div",
		{
			class: monospace ? "long-list code" : "long-list",
			role: "region",
			tabindex: "0",
			"aria-label": label
		},
		table
	);
	let atEnd = true;
	let rowHeight = 26;
	let timer = 0;

	/* In place of rows that are not drawn. */
	function createSpace(rows) {
		const cell = element("td", { colspan: columns.length });

		cell.style.height = `${rows * rowHeight}px`;
		return element("tr", { class: "space", "aria-hidden": "true" }, cell);
	}

	/* The shown entries from `first` to `last`. */
	function drawRows(first, last) {
		const { shown } = list;
		const rows = shown.slice(first, last).map((entry, place) =>
			element(
				"tr",
				{ "data-kind": kind(entry), "aria-rowindex": first + place + 2 },
				columns.map(({ text }) => element("td", {}, text(entry)))
			)
		);

		table.setAttribute("aria-rowcount", shown.length + 1);
		body.replaceChildren(createSpace(first), ...rows, createSpace(shown.length - last));
		return rows;
	}

	function draw() {
		const { length } = list.shown;
		const inSight = Math.ceil(node.clientHeight / rowHeight);
		const top = atEnd ? length - inSight : Math.floor(node.scrollTop / rowHeight);
		const first = Math.max(0, Math.min(top, length - inSight) - ROWS_BEYOND);

		timer = 0;
		const rows = drawRows(first, Math.min(length, first + inSight + 2 * ROWS_BEYOND));

		rowHeight = rows[0]?.offsetHeight || rowHeight;
		if (atEnd)
			node.scrollTop = node.scrollHeight;
		onDraw(list);
	}

	function drawSoon() {
		timer ||= setTimeout(draw, DRAW_EVERY_MS);
	}

	/* The rows being read keep their place when rows above them are dropped. */
	function forget(rows) {
		if (!atEnd && rows > 0)
			node.scrollTop -= rows * rowHeight;
		drawSoon();
	}

	node.addEventListener(
		"scroll",
		() => {
			atEnd = node.scrollTop + node.clientHeight >= node.scrollHeight - rowHeight;
			drawSoon();
		},
		{ passive: true }
	);

	const print = () => drawRows(Math.max(0, list.shown.length - PRINTED_MOST), list.shown.length);

	addEventListener("beforeprint", print);
	addEventListener("afterprint", drawSoon);

	return {
		node,
		list,
		add: (entries) => forget(list.add(entries)),
		pause: (on) => forget(list.pause(on)),
		clear() {
			list.clear();
			atEnd = true;
			drawSoon();
		},
		filter(matches) {
			list.filter(matches);
			drawSoon();
		},
		close() {
			clearTimeout(timer);
			removeEventListener("beforeprint", print);
			removeEventListener("afterprint", drawSoon);
		}
	};
}
