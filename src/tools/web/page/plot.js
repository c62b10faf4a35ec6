/* SPDX-License-Identifier: Apache-2.0 */
/* A live plot of several values over time, of which a part is shown, stopped, zoomed and saved. */
import { buildChart, createChart } from "./chart.js";
import { element, newId, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { formatFixed, formatSpan } from "./format.js";
import { DASHES, createSwatch, padRange, readColour } from "./plot_line.js";
import { createRing, findTime, formatCsv } from "./ring.js";
import { t } from "./words.js";

const SERIES_MOST = DASHES.length;
const SPANS_S = [5, 10, 30, 60, 300];
const SPAN_FIRST_S = 10;
const REDRAW_EVERY_MS = 50;
/* No line is drawn over a gap longer than this. */
const GAP_S = 0.6;
const HEIGHT_PX = 340;
const MARKS_MOST = 100;

/*
 * signals: array of { name, label, unit, decimals, names } in the order of the ring's columns;
 * chosen: names shown first. Returns { node, push(time_s, values), mark({ of, time, label, kind }), frame(now),
 * choose(names), destroy() }.
 */
export function createPlot({ title, signals, chosen, capacity }) {
	const parts = makeParts(title);
	const plot = {
		title,
		signals,
		...parts,
		ring: createRing(signals.length, capacity),
		chosen: [],
		span: SPAN_FIRST_S,
		/* { from, to } of what is shown while it is stopped, and a copy of the ring; null: it runs. */
		paused: null,
		frozen: null,
		dirty: true,
		drawnAt: 0,
		pushedAt: 0,
		/* By what they are of. */
		marks: new Map(),
		chart: null,
	};

	plot.chart = createChart({
		node: plot.node,
		holder: plot.holder,
		options: {
			height: () => Math.min(HEIGHT_PX, Math.max(200, Math.round(globalThis.innerHeight * 0.42))),
			x: { values: writeTimes },
			cursor: { drag: { x: true, y: false, setScale: false }, points: { size: 7 } },
			hooks: { setSelect: [(uplot) => takeSelection(plot, uplot)], setCursor: [() => showValues(plot)],
				drawClear: [(uplot) => drawSilence(plot, uplot)] },
			built: ({ uplot }) => {
				uplot.over.addEventListener("dblclick", () => goOn(plot));
				plot.dirty = true;
			},
			/* It has a size for the first time when it is shown. */
			sized: () => {
				if (!plot.chart.uplot && plot.node.isConnected)
					build(plot);
			},
		},
		marks: () => [...plot.marks.values()].map(({ time, label, kind }) =>
			({ time, label, colour: kind, dash: [2, 3] })),
	});
	makeChoices(plot);
	listen(plot);
	choose(plot, chosen);
	return {
		node: plot.node,
		choose: (names) => choose(plot, names),
		push: (time, values) => push(plot, time, values),
		/* Marks a moment; `kind` is a colour of the style sheet, `of` says what it is of: the
		 * same is marked once. */
		mark: (mark) => addMark(plot, mark),
		frame: (now) => frame(plot, now),
		destroy: () => plot.chart.destroy(),
	};
}

/* --- its elements ----------------------------------------------------------------------------- */

function makeParts(title) {
	const id = newId("plot");
	const small = (words, properties = {}) => element("button",
		{ class: "small", type: "button", ...properties }, words);
	const parts = {
		holder: element("div", {
			class: "plot-canvas",
			role: "group",
			tabindex: "0",
			"aria-describedby": id,
			"aria-label": t("Plot of {title}: arrow keys move the cursor, plus and minus zoom", { title })
		}),
		legend: element("tbody"),
		gap: element("p", { class: "plot-gap" }, t("no data yet")),
		cursorTime: element("span", { class: "muted plot-time" }),
		pause: small(t("Pause"), { class: "small plot-pause", "aria-pressed": "false" }),
		spans: element("select", { class: "plot-span", "aria-label": t("Time shown") },
			SPANS_S.map((seconds) => element("option",
				{ value: seconds, selected: seconds === SPAN_FIRST_S },
				seconds < 60 ? `${seconds} s` : t("{count} min", { count: seconds / 60 })))),
		zoomIn: small("+", { "aria-label": t("Zoom in") }),
		zoomOut: small("−", { "aria-label": t("Zoom out") }),
		save: small(t("CSV"), { class: "small plot-csv" }),
		choices: element("fieldset", { class: "plot-choices" },
			element("legend", { class: "hidden-label" }, t("Values that are plotted"))),
		chooser: null,
		node: null,
	};

	parts.chooser = element("details", { class: "chooser" },
		element("summary", { class: "button small" }, t("Choose values")), parts.choices);
	parts.node = element("section", { class: "panel plot", "aria-label": t("Plot") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Plot")), parts.cursorTime,
			element("span", { class: "push" }), parts.chooser, parts.spans, parts.zoomOut, parts.zoomIn,
			parts.pause, parts.save),
		element("div", { class: "plot-frame" }, parts.holder, parts.gap),
		element("table", { class: "plot-legend" },
			element("caption", { class: "hidden-label", id }, t("Values at the cursor, or the latest")),
			parts.legend));
	return parts;
}

function makeChoices(plot) {
	for (const signal of plot.signals) {
		const box = element("input", { type: "checkbox", value: signal.name });

		/* Added after the others, which keep their colours. */
		box.addEventListener("change", () => choose(plot, box.checked ?
			[...plot.chosen, signal.name] : plot.chosen.filter((name) => name !== signal.name)));
		/* Where Space stops the drive, Enter is the only key left for the box. */
		box.addEventListener("keydown", (event) => {
			if (event.key === "Enter")
				box.click();
		});
		plot.choices.append(element("label", { class: "check" }, box, signal.label));
	}
}

function listen(plot) {
	plot.chooser.addEventListener("focusout", (event) => {
		if (!plot.chooser.contains(event.relatedTarget) && plot.chooser.matches(":not(:hover)"))
			plot.chooser.open = false;
	});
	plot.pause.addEventListener("click", () => {
		if (plot.paused)
			goOn(plot);
		else if (plot.ring.length > 1)
			freeze(plot, visible(plot));
	});
	plot.spans.addEventListener("change", () => {
		plot.span = Number(plot.spans.value);
		goOn(plot);
	});
	plot.zoomIn.addEventListener("click", () => zoom(plot, 0.5));
	plot.zoomOut.addEventListener("click", () => zoom(plot, 2));
	plot.save.addEventListener("click", () => download(plot));
	plot.holder.addEventListener("keydown", (event) => takeKey(plot, event));
}

function takeKey(plot, event) {
	const { uplot } = plot.chart;
	const step = uplot ? uplot.over.clientWidth / (event.shiftKey ? 10 : 100) : 0;
	const keys = {
		ArrowLeft: () => uplot.setCursor({ left: Math.max(0, uplot.cursor.left - step), top: 10 }),
		ArrowRight: () => uplot.setCursor({
			left: Math.min(uplot.over.clientWidth - 1, Math.max(0, uplot.cursor.left) + step),
			top: 10
		}),
		"+": () => zoom(plot, 0.5),
		"-": () => zoom(plot, 2),
		PageUp: () => pan(plot, -0.5),
		PageDown: () => pan(plot, 0.5),
		End: () => goOn(plot),
	};

	if (!uplot || !keys[event.key])
		return;
	event.preventDefault();
	keys[event.key]();
}

/* --- the visible part ------------------------------------------------------------------------- */

function columnOf({ signals }, name) { return signals.findIndex((signal) => signal.name === name); }

function signalOf(plot, name) { return plot.signals[columnOf(plot, name)]; }

function dataOf(plot, { from, to }) {
	return (plot.frozen ?? plot.ring).range(from, to, plot.chosen.map((name) => columnOf(plot, name)));
}

/* A copy of everything: the ring goes on, and would overwrite it. */
function copyRing({ ring, signals }) {
	const copy = ring.range(-Infinity, Infinity, signals.map((_, index) => index))
		.map((values) => values.slice());

	return {
		range(first, last, wanted) {
			const begin = Math.max(0, findTime(copy[0], first) - 1);
			const end = Math.min(copy[0].length, findTime(copy[0], last) + 1);

			return [0, ...wanted.map((at) => at + 1)].map((at) => copy[at].subarray(begin, end));
		},
	};
}

function showPaused(plot) {
	plot.pause.setAttribute("aria-pressed", String(plot.paused !== null));
	setText(plot.pause, plot.paused ? t("Go on") : t("Pause"));
	plot.dirty = true;
}

function freeze(plot, part) {
	plot.frozen ??= copyRing(plot);
	plot.paused = part;
	showPaused(plot);
}

function goOn(plot) {
	plot.frozen = null;
	plot.paused = null;
	showPaused(plot);
}

/* The time for which nothing has come, in seconds; 0 while values come. */
function silenceOf({ ring, pushedAt }) {
	const seconds = (performance.now() - pushedAt) / 1000;

	return ring.length > 0 && seconds > GAP_S ? seconds : 0;
}

/* Time goes on when no values come: a plot that stands still would look like a drive that does. */
function visible(plot) {
	const last = plot.ring.lastTime() + silenceOf(plot);

	return plot.paused ?? { from: last - plot.span, to: last };
}

function zoom(plot, factor) {
	const { from, to } = visible(plot);
	const middle = (from + to) / 2;
	const half = Math.min(3600, Math.max(0.02, (to - from) * factor / 2));

	if (plot.ring.length > 1)
		freeze(plot, { from: middle - half, to: middle + half });
}

function pan(plot, part) {
	const { from, to } = visible(plot);
	const by = (to - from) * part;

	freeze(plot, { from: from + by, to: to + by });
}

function takeSelection(plot, uplot) {
	const { left, width } = uplot.select;

	if (width > 4)
		freeze(plot, { from: uplot.posToVal(left, "x"), to: uplot.posToVal(left + width, "x") });
	uplot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
}

/* --- drawing ---------------------------------------------------------------------------------- */

function timeOfDay(time, decimals) {
	const date = new Date(time * 1000);
	const two = (number) => String(number).padStart(2, "0");
	const whole = `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
	const part = String(Math.floor((time % 1) * 10 ** decimals)).padStart(decimals, "0");

	return decimals > 0 ? `${whole}.${part}` : whole;
}

function writeTimes(uplot, ticks) {
	const apart = ticks.length > 1 ? ticks[1] - ticks[0] : 1;
	const decimals = apart < 0.01 ? 3 : Number(apart < 1);

	return ticks.map((tick) => timeOfDay(tick, decimals));
}

/* Pixels between neighbours that are too far apart, for uPlot to leave out. */
function findGaps(uplot, series, first, last) {
	const times = uplot.data[0];
	const gaps = [];

	for (let i = first + 1; i <= last; i++) {
		if (times[i] - times[i - 1] > GAP_S)
			gaps.push([uplot.valToPos(times[i - 1], "x", true), uplot.valToPos(times[i], "x", true)]);
	}
	return gaps;
}

/* Values with names each have a scale without numbers; the others share one for each unit. */
function makeLine({ name, label, names, unit }) {
	const last = Math.max(...Object.keys(names ?? { 0: "" }).map(Number));

	return {
		label,
		scale: names ? `named ${name}` : `y ${unit}`,
		unit: names ? null : unit,
		range: names ? () => [-0.5, last + 0.5] : padRange,
		stepped: Boolean(names),
		gaps: findGaps,
	};
}

function build(plot) {
	plot.chart.series = plot.chosen.map((name) => makeLine(signalOf(plot, name)));
	buildChart(plot.chart, [[], ...plot.chosen.map(() => [])]);
}

/* From the last values on, when no more come. */
function drawSilence(plot, uplot) {
	const { ring, node, gap } = plot;
	const seconds = plot.paused ? 0 : silenceOf(plot);

	node.classList.toggle("silent", seconds > 0);
	setText(gap, ring.length === 0 ? t("no data yet") :
		seconds > 0 ? t("no data for {seconds}", { seconds: formatSpan(seconds) }) : "");
	if (seconds === 0)
		return;
	const { ctx, bbox } = uplot;
	const from = Math.max(bbox.left, uplot.valToPos(ring.lastTime(), "x", true));

	ctx.save();
	ctx.fillStyle = readColour(node, "line");
	ctx.globalAlpha = 0.6;
	ctx.fillRect(from, bbox.top, bbox.left + bbox.width - from, bbox.height);
	ctx.restore();
}

function draw(plot) {
	const part = visible(plot);
	const { uplot } = plot.chart;

	if (!Number.isFinite(part.to))
		return;
	uplot.batch(() => {
		uplot.setData(dataOf(plot, part), false);
		uplot.setScale("x", { min: part.from, max: part.to });
	});
	showValues(plot);
}

function frame(plot, now) {
	if ((!plot.dirty && silenceOf(plot) === 0) || !plot.chart.uplot || now - plot.drawnAt < REDRAW_EVERY_MS)
		return;
	plot.dirty = false;
	plot.drawnAt = now;
	draw(plot);
}

/* --- values ----------------------------------------------------------------------------------- */

function push(plot, time, values) {
	if (!plot.ring.push(time, values))
		return;
	plot.pushedAt = performance.now();
	if (!plot.paused)
		plot.dirty = true;
}

function addMark(plot, { of, time, label, kind }) {
	const { marks } = plot;

	if (marks.has(of))
		return;
	marks.set(of, { time, label, kind });
	if (marks.size > MARKS_MOST)
		marks.delete(marks.keys().next().value);
	plot.node.dataset.marks = String(marks.size);
	plot.dirty = true;
}

function makeLegend(plot) {
	plot.legend.replaceChildren(...plot.chosen.map((name, index) => {
		const signal = signalOf(plot, name);
		const value = element("td", { class: "number", "data-value": name });

		return element("tr", {}, element("td", {}, createSwatch(index)),
			element("th", { scope: "row" }, signal.label), value,
			element("td", { class: "muted" }, signal.unit));
	}));
}

/* At the cursor, else the latest values. */
function showValues(plot) {
	const { uplot } = plot.chart;
	const at = uplot?.cursor.idx;
	const under = uplot && uplot.cursor.left >= 0 && at !== null && at !== undefined &&
		uplot.data[0].length > at;

	if (under)
		setText(plot.cursorTime, timeOfDay(uplot.data[0][at], 3));
	else
		setText(plot.cursorTime, plot.paused ? t("paused") : "");
	plot.chosen.forEach((name, index) => {
		const signal = signalOf(plot, name);
		const latest = silenceOf(plot) > 0 && !plot.paused ? NaN : plot.ring.last(columnOf(plot, name));
		const value = under ? uplot.data[index + 1][at] : latest;

		setText(plot.legend.rows[index].cells[2],
			signal.names?.[value] ?? formatFixed(value, signal.decimals));
	});
}

function choose(plot, names) {
	plot.chosen = names.filter((name) => columnOf(plot, name) >= 0).slice(0, SERIES_MOST);
	for (const box of plot.choices.querySelectorAll("input")) {
		box.checked = plot.chosen.includes(box.value);
		box.disabled = !box.checked && plot.chosen.length >= SERIES_MOST;
	}
	makeLegend(plot);
	if (plot.node.isConnected)
		build(plot);
}

function download(plot) {
	const { title, chosen } = plot;
	const heads = chosen.map((name) => {
		const { unit } = signalOf(plot, name);

		return unit ? `${title}.${name} [${unit}]` : `${title}.${name}`;
	});

	saveFile(`${title}-${nameTime()}.csv`, [formatCsv(heads, dataOf(plot, visible(plot)))], "text/csv");
}
