/* SPDX-License-Identifier: Apache-2.0 */
/* A complete capture as a picture, with two cursors to measure between. */
import { readColumns } from "./capture.js";
import { buildChart, createChart } from "./chart.js";
import { element, newId, setText } from "./dom.js";
import { NONE, formatFixed, formatReal, formatWithUnit, hasBits } from "./format.js";
import { DASHES, createSwatch, padRange } from "./plot_line.js";
import { measureResponse, sayResponse } from "./response.js";
import { t } from "./words.js";

export const CHANNELS_MOST = DASHES.length;
const CURSORS = ["A", "B"];
const CURSORS_FIRST = [250, 750];
const CURSOR_STEPS = 1000;
const HEIGHT_PX = 380;
const FOLLOWS = ["position", "position_units", "velocity", "velocity_units"];

/*
 * channels: { drive, name, register, unit, show }, CHANNELS_MOST at most, unit and show() of the
 * users; level: { unit, value } of the trigger, or null. Returns { node, show(capture),
 * destroy() }; a capture has the form of createCapture()'s `shown`.
 */
export function createCapturePlot(channels, level = null) {
	const parts = makeParts(channels);
	const plot = {
		channels,
		level,
		...parts,
		data: [[], ...channels.map(() => [])],
		limits: { min: 0, max: 1 },
		chart: null,
	};

	plot.chart = createChart({
		node: plot.node,
		holder: plot.holder,
		series: channels.map((channel) => makeLine(plot, channel)),
		options: {
			height: () => HEIGHT_PX,
			x: { label: t("s from the trigger") },
			cursor: { drag: { x: true, y: false }, y: false },
			built: ({ uplot }) => uplot.over.addEventListener("click", (event) => moveCursor(plot, event)),
		},
		marks: () => CURSORS.map((label, at) =>
			({ time: timeOf(plot, at), label, colour: null, dash: at === 0 ? [] : [4, 3] })),
	});
	if (level)
		plot.chart.level = { scale: level.unit, value: level.value, colour: "warning" };
	for (const slider of plot.sliders)
		slider.addEventListener("input", () => showCursors(plot));
	plot.between.addEventListener("click", () => {
		const times = [timeOf(plot, 0), timeOf(plot, 1)];

		zoom(plot, { min: Math.min(...times), max: Math.max(...times) });
	});
	plot.all.addEventListener("click", () => zoom(plot, plot.limits));
	return {
		node: plot.node,
		show: (capture) => show(plot, capture),
		destroy: () => plot.chart.destroy(),
	};
}

/* --- its elements ----------------------------------------------------------------------------- */

function makeRow(swatch, words) {
	return element("tr", {}, element("td", {}, swatch), element("th", { scope: "row" }, words),
		[0, 1, 2].map(() => element("td", { class: "number" })));
}

function makeParts(channels) {
	const id = newId("cursors");
	const small = (own, words) => element("button", { id: own, class: "small", type: "button" }, words);
	const parts = {
		holder: element("div", { class: "plot-canvas" }),
		sliders: CURSORS.map((name, at) => element("input", {
			type: "range",
			id: `scope-cursor-${name.toLowerCase()}`,
			min: 0,
			max: CURSOR_STEPS,
			step: 1,
			value: CURSORS_FIRST[at],
			"aria-describedby": id
		})),
		timeRow: makeRow("", t("time")),
		rows: channels.map(({ drive, name }, index) => makeRow(createSwatch(index), `${drive}.${name}`)),
		between: small("scope-zoom", t("Between the cursors")),
		all: small("scope-all", t("All of it")),
		response: element("p", { id: "scope-response", class: "muted" }),
		node: null,
	};
	const head = element("tr", {}, element("td"), [t("Value"), ...CURSORS, "B − A"].map((words, at) =>
		element("th", { scope: "col", class: at > 0 ? "number" : null }, words)));

	parts.node = element("div", { class: "scope-plot", hidden: true }, parts.holder,
		element("div", { class: "toolbar" }, CURSORS.map((name, at) => element("label",
			{ class: "field inline cursor-field", for: parts.sliders[at].id },
			t("Cursor {name}", { name }), parts.sliders[at])), parts.between, parts.all),
		element("div", { class: "table-frame", role: "region", tabindex: "0",
			"aria-label": t("Values at the cursors") },
		element("table", { class: "plot-legend", id },
			element("caption", { class: "hidden-label" }, t("Values at the cursors")),
			element("thead", {}, head), element("tbody", {}, parts.timeRow, parts.rows))), parts.response);
	return parts;
}

/* --- the cursors ------------------------------------------------------------------------------ */

function timeOf({ limits, sliders }, cursor) {
	return limits.min + (limits.max - limits.min) * Number(sliders[cursor].value) / CURSOR_STEPS;
}

/* The last value at or before a time, in a column that may have gaps; null: there is none. */
function findValue(times, column, time) {
	let low = 0;
	let high = times.length;

	while (low < high) {
		const middle = (low + high) >> 1;

		if (times[middle] <= time)
			low = middle + 1;
		else
			high = middle;
	}
	for (let at = low - 1; at >= 0; at--) {
		if (column[at] !== null)
			return column[at];
	}
	return null;
}

function showCursors(plot) {
	const { channels, data, rows, sliders, timeRow } = plot;
	const times = [timeOf(plot, 0), timeOf(plot, 1)];
	const apart = times[1] - times[0];
	const rate = apart === 0 ? null : Number((1 / Math.abs(apart)).toPrecision(4));
	const write = (row, words) => words.forEach((text, at) => setText(row.cells[at + 2], text));

	write(timeRow, [
		`${formatFixed(times[0], 4)} s`,
		`${formatFixed(times[1], 4)} s`,
		`${formatFixed(apart, 4)} s${rate === null ? "" : `, ${formatReal(rate)} Hz`}`
	]);
	times.forEach((time, at) => sliders[at].setAttribute("aria-valuetext", t("{time} seconds", { time: formatFixed(time, 4) })));
	channels.forEach(({ register, unit }, index) => {
		const shown = { ...register, unit, type: unit === register.unit ? register.type : "f32" };
		const values = times.map((time) => findValue(data[0], data[index + 1], time));
		const difference = values.includes(null) || hasBits(register) || register.codes ? NONE :
			formatWithUnit(shown, values[1] - values[0]);

		write(rows[index], [...values.map((value) => formatWithUnit(shown, value)), difference]);
	});
	plot.chart.uplot?.redraw(false, false);
}

/* A click moves the nearer cursor. */
function moveCursor(plot, event) {
	const { limits, sliders } = plot;
	const time = plot.chart.uplot.posToVal(event.offsetX, "x");
	const nearer = Math.abs(timeOf(plot, 0) - time) <= Math.abs(timeOf(plot, 1) - time) ? 0 : 1;

	sliders[nearer].value = Math.round((time - limits.min) / (limits.max - limits.min) * CURSOR_STEPS);
	showCursors(plot);
}

/* --- the picture ------------------------------------------------------------------------------ */

function makeLine({ level }, { drive, name, register, unit }) {
	/* The trigger's level belongs into the picture. */
	const withLevel = (low, high) => padRange(Math.min(low, level.value), Math.max(high, level.value));

	return {
		label: `${drive}.${name}`,
		scale: unit,
		unit,
		range: level?.unit === unit ? withLevel : padRange,
		stepped: Boolean(register.codes) || hasBits(register),
		spanGaps: true,
	};
}

function show(plot, capture) {
	const { chart, limits: before } = plot;
	const data = readColumns(capture, plot.channels);
	const limits = { min: data[0][0] ?? 0, max: data[0].at(-1) ?? 1 };

	if (limits.max <= limits.min)
		limits.max = limits.min + 1e-3;
	Object.assign(plot, { data, limits });
	plot.node.hidden = false;
	if (!chart.uplot) {
		buildChart(chart, data);
	} else {
		const { min, max } = chart.uplot.scales.x;
		const changed = Math.abs(limits.min - before.min) + Math.abs(limits.max - before.max);

		/* The zoom stays while captures have the same length as the former one. */
		chart.uplot.setData(data, changed > 0.2 * (limits.max - limits.min) ||
			(min <= before.min && max >= before.max));
	}
	showCursors(plot);
	showResponse(plot);
}

/* Of values that follow a command: how each has answered to the step at the trigger. */
function showResponse({ channels, data, response }) {
	const words = channels.map(({ drive, name }, index) => FOLLOWS.includes(name) ?
		sayResponse(`${drive}.${name}`, measureResponse(data[0], data[index + 1])) : "");

	setText(response, words.filter(Boolean).join(" "));
}

function zoom(plot, { min, max }) {
	if (max > min)
		plot.chart.uplot?.setScale("x", { min, max });
}
