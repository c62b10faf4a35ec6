/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All drives over time: a row each, darker where questions had no answer. The order stays while the
 * user looks; it is made anew with another range.
 */
import { element } from "./dom.js";
import { formatSpan } from "./format.js";
import { LEVEL_WORDS, formatShare, readRow, sortRows } from "./health_slots.js";
import { readColour } from "./plot_line.js";
import { t } from "./words.js";

const WIDTH_PX = 840;

function paint(canvas, cells, colours) {
	const pen = canvas.getContext("2d");

	pen.clearRect(0, 0, WIDTH_PX, 1);
	for (const { left, width, level } of cells) {
		const from = Math.floor(left * WIDTH_PX);

		pen.fillStyle = colours[level];
		pen.fillRect(from, 0, Math.max(1, Math.round((left + width) * WIDTH_PX) - from), 1);
	}
}

function describe({ known, worst, offline }) {
	if (!known)
		return t("nothing is known");
	return (worst > 0 ? `${formatShare(worst)} lost` : t("nothing lost")) +
		/* What is kept is rounded down by up to 0.1 %. */
		(offline >= 1 ? t(", offline for {formatSpan}", { formatSpan: formatSpan(offline < 120 ? offline :
			Math.round(offline / 60) * 60) }) : "");
}

/* { node, draw({ rows, times, now_us }, for_s, anew) } */
export function createHealthStrip() {
	const body = element("tbody");
	const legend = element("p", { class: "heat-legend muted" },
		["", ...LEVEL_WORDS].map((words, index) => element("span", {},
			element("i", { "data-level": index - 1 }), words || t("not known"))));
	const node = element("section", { class: "panel", "aria-label": t("Losses of all drives") }, legend,
		element("table", { id: "heat", class: "heat" },
			element("caption", { class: "hidden-label" }, t("Questions without an answer, by drive and time")),
			element("thead", {}, element("tr", {}, [t("Drive"), t("Losses over time, now at the right"), t("In the worst interval")]
				.map((words) => element("th", { scope: "col" }, words)))),
			body));
	const shown = new Map();

	function makeRow(drive) {
		const canvas = element("canvas", { width: WIDTH_PX, height: 1, "aria-hidden": "true" });
		const words = element("td", {});
		const href = `#/health/${encodeURIComponent(drive)}`;

		return { canvas, words, node: element("tr", { "data-drive": drive },
			element("th", { scope: "row" }, element("a", { class: "row-link", href }, drive)),
			element("td", {}, canvas), words) };
	}

	return {
		node,
		draw({ rows, times, now_us: now }, forS, anew) {
			const colours = [0, 1, 2, 3, 4].map((level) => readColour(node, `heat-${level}`));
			const read = sortRows(rows.map((row) => readRow(row, times, now, forS)));
			const names = read.map(({ drive }) => drive);

			if (anew || names.length !== shown.size || names.some((name) => !shown.has(name))) {
				shown.clear();
				names.forEach((name) => shown.set(name, makeRow(name)));
				body.replaceChildren(...[...shown.values()].map((row) => row.node));
			}
			for (const one of read) {
				const row = shown.get(one.drive);

				paint(row.canvas, one.cells, colours);
				row.words.textContent = describe(one);
				row.node.dataset.level = String(Math.max(-1, ...one.cells.map(({ level }) => level)));
			}
		}
	};
}
