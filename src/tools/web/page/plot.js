/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A live plot of several values over time: ring buffers of fixed size, and uPlot to draw the
 * visible part.
 */
import { element, newId, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { formatFixed, formatSpan } from "./format.js";
import { DASHES, createSwatch, makeAxis, padRange, readColour, writeNumbers } from "./plot_line.js";
import { t } from "./words.js";

const SERIES_MOST = DASHES.length;
const SPANS_S = [5, 10, 30, 60, 300];
const REDRAW_EVERY_MS = 50;
/* No line is drawn over a gap longer than this. */
const GAP_S = 0.6;
const HEIGHT_PX = 340;
const MARKS_MOST = 100;

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

/* The index of the first time that is not before `time`. */
function findTime(times, time) {
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

function timeOfDay(time, decimals) {
	const date = new Date(time * 1000);
	const two = (number) => String(number).padStart(2, "0");
	const whole = `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
	const part = String(Math.floor((time % 1) * 10 ** decimals)).padStart(decimals, "0");

	return decimals > 0 ? `${whole}.${part}` : whole;
}

/*
 * signals: array of { name, label, unit, decimals, names } in the order of the ring's columns;
 * chosen: names shown first. Returns { node, push(time_s, values), mark({ of, time, label, kind }), frame(now),
 * choose(names), destroy() }.
 */
export function createPlot({ title, signals, chosen, capacity }) {
	const ring = createRing(signals.length, capacity);
	const state = {
		chosen: [],
		uplot: null,
		span: 10,
		paused: null,
		dirty: true,
		drawnAt: 0,
		pushedAt: 0,
		frozen: null
	};
	/* By what they are of. */
	const marks = new Map();
	const id = newId("plot");
	const holder = element("div", {
		class: "plot-canvas",
		role: "group",
		tabindex: "0",
		"aria-describedby": id,
		"aria-label": t("Plot of {title}: arrow keys move the cursor, plus and minus zoom", { title })
	});
	const legend = element("tbody");
	const gap = element("p", { class: "plot-gap" }, t("no data yet"));
	const cursorTime = element("span", { class: "muted plot-time" });
	const pause = element("button",
		{ class: "small plot-pause", type: "button", "aria-pressed": "false" }, t("Pause"));
	const span = element("select", { class: "plot-span", "aria-label": t("Time shown") },
		SPANS_S.map((seconds) => element("option",
			{ value: seconds, selected: seconds === state.span },
			seconds < 60 ? `${seconds} s` : t("{count} min", { count: seconds / 60 }))));
	const zoomIn =
		element("button", { class: "small", type: "button", "aria-label": t("Zoom in") }, "+");
	const zoomOut = element(
		"button", { class: "small", type: "button", "aria-label": t("Zoom out") }, "−");
	const save = element("button", { class: "small plot-csv", type: "button" }, t("CSV"));
	const choices = element("fieldset", { class: "plot-choices" },
		element("legend", { class: "hidden-label" }, t("Values that are plotted")));
	const chooser = element("details", { class: "chooser" },
		element("summary", { class: "button small" }, t("Choose values")), choices);
	const node = element("section", { class: "panel plot", "aria-label": t("Plot") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Plot")), cursorTime,
			element("span", { class: "push" }), chooser, span, zoomOut, zoomIn, pause,
			save),
		element("div", { class: "plot-frame" }, holder, gap),
		element("table", { class: "plot-legend" },
			element("caption", { class: "hidden-label", id },
				t("Values at the cursor, or the latest")),
			legend));

	const column = (name) => signals.findIndex((signal) => signal.name === name);
	const colour = (name) => readColour(node, name);

	/* --- the visible part ----------------------------------------------------------------- */

	function data(from, to) {
		const wanted = state.chosen.map(column);

		return state.frozen ? state.frozen.range(from, to, wanted) :
			ring.range(from, to, wanted);
	}

	/* Copies the visible part: the ring continues, and would overwrite it. */
	function freeze(from, to) {
		if (!state.frozen) {
			const all = ring.range(
				-Infinity, Infinity, signals.map((signal, index) => index));
			const copy = all.map((values) => values.slice());

			state.frozen = {
				range(first, last, wanted) {
					const begin = Math.max(0, findTime(copy[0], first) - 1);
					const end = Math.min(
						copy[0].length, findTime(copy[0], last) + 1);

					return [
						copy[0].subarray(begin, end),
						...wanted.map(
							(at) => copy[at + 1].subarray(begin, end))
					];
				},
				first: ring.firstTime(),
				last: ring.lastTime()
			};
		}
		state.paused = { from, to };
		pause.setAttribute("aria-pressed", "true");
		setText(pause, t("Go on"));
		state.dirty = true;
	}

	function goOn() {
		state.frozen = null;
		state.paused = null;
		pause.setAttribute("aria-pressed", "false");
		setText(pause, t("Pause"));
		state.dirty = true;
	}

	/* The time for which nothing has come, in seconds; 0 while values come. */
	function silence() {
		const seconds = (performance.now() - state.pushedAt) / 1000;

		return ring.length > 0 && seconds > GAP_S ? seconds : 0;
	}

	/* Time goes on when no values come: a plot that stands still would look like a drive that does. */
	function window() {
		const last = ring.lastTime() + silence();

		return state.paused ?? { from: last - state.span, to: last };
	}

	function zoom(factor) {
		const { from, to } = window();
		const middle = (from + to) / 2;
		const half = Math.min(3600, Math.max(0.02, (to - from) * factor / 2));

		if (ring.length > 1)
			freeze(middle - half, middle + half);
	}

	function pan(part) {
		const { from, to } = window();
		const by = (to - from) * part;

		freeze(from + by, to + by);
	}

	/* --- drawing -------------------------------------------------------------------------- */

	/* Pixels between neighbours that are too far apart, for uPlot to leave out. */
	function findGaps(uplot, series, first, last) {
		const times = uplot.data[0];
		const gaps = [];

		for (let i = first + 1; i <= last; i++) {
			if (times[i] - times[i - 1] > GAP_S)
				gaps.push([
					uplot.valToPos(times[i - 1], "x", true),
					uplot.valToPos(times[i], "x", true)
				]);
		}
		return gaps;
	}

	/* Values with names each have a scale without numbers; the others share one for each
	 * unit. */
	function scaleOf({ name, names, unit }) {
		return names ? `named ${name}` : `y ${unit}`;
	}

	function makeScale({ names }) {
		const last = Math.max(...Object.keys(names ?? { 0: "" }).map(Number));

		return { auto: true, range: (uplot, low, high) => (names ? [-0.5, last + 0.5] : padRange(low, high)) };
	}

	function makeAxes(shown) {
		const axis = makeAxis(node);
		const units = [...new Set(shown.filter(({ names }) => !names).map(({ unit }) => unit))];
		const writeTimes = (uplot, ticks) => {
			const apart = ticks.length > 1 ? ticks[1] - ticks[0] : 1;
			const decimals = apart < 0.01 ? 3 : Number(apart < 1);

			return ticks.map((tick) => timeOfDay(tick, decimals));
		};
		return [{ ...axis, space: 90, values: writeTimes }, ...units.map((unit, index) => ({ ...axis,
			scale: `y ${unit}`, side: index === 0 ? 3 : 1, label: unit, labelFont: axis.font,
			labelSize: 18, size: 62, grid: { ...axis.grid, show: index === 0 }, values: writeNumbers }))];
	}

	/* Lines at moments at which something happened, and what. */
	function drawMarks(uplot) {
		const { ctx, bbox } = uplot;
		const ratio = globalThis.devicePixelRatio;

		ctx.save();
		ctx.font = `${11 * ratio}px ${getComputedStyle(node).fontFamily}`;
		ctx.lineWidth = ratio;
		ctx.setLineDash([2 * ratio, 3 * ratio]);
		for (const { time, label, kind } of marks.values()) {
			const x = Math.round(uplot.valToPos(time, "x", true));

			if (x < bbox.left || x > bbox.left + bbox.width)
				continue;
			ctx.strokeStyle = ctx.fillStyle = colour(kind);
			ctx.beginPath();
			ctx.moveTo(x, bbox.top);
			ctx.lineTo(x, bbox.top + bbox.height);
			ctx.stroke();
			ctx.fillText(label, x + 3 * ratio, bbox.top + 11 * ratio);
		}
		ctx.restore();
	}

	/* From the last values on, when no more come. */
	function drawSilence(uplot) {
		const seconds = state.paused ? 0 : silence();

		node.classList.toggle("silent", seconds > 0);
		setText(gap, ring.length === 0 ? t("no data yet") :
			seconds > 0 ? t("no data for {seconds}", { seconds: formatSpan(seconds) }) : "");
		if (seconds === 0)
			return;
		const { ctx, bbox } = uplot;
		const from = Math.max(bbox.left, uplot.valToPos(ring.lastTime(), "x", true));

		ctx.save();
		ctx.fillStyle = colour("line");
		ctx.globalAlpha = 0.6;
		ctx.fillRect(from, bbox.top, bbox.left + bbox.width - from, bbox.height);
		ctx.restore();
	}

	function takeSelection(uplot) {
		const { left, width } = uplot.select;

		if (width > 4)
			freeze(uplot.posToVal(left, "x"), uplot.posToVal(left + width, "x"));
		uplot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
	}

	function build() {
		const shown = state.chosen.map((name) => signals[column(name)]);
		const stepped = globalThis.uPlot.paths.stepped({ align: 1 });

		state.uplot?.destroy();
		holder.replaceChildren();
		state.uplot = new globalThis.uPlot({
			width: Math.max(200, holder.clientWidth),
			height: plotHeight(),
			legend: { show: false },
			cursor: { drag: { x: true, y: false, setScale: false }, points: { size: 7 } },
			scales: { x: { time: false }, ...Object.fromEntries(shown.map((signal) =>
				[scaleOf(signal), makeScale(signal)])) },
			axes: makeAxes(shown),
			series: [{}, ...shown.map((signal, index) => ({
				label: signal.label,
				scale: scaleOf(signal),
				stroke: colour(`series-${index + 1}`),
				width: 1.75,
				dash: DASHES[index],
				points: { show: false },
				gaps: findGaps,
				paths: signal.names ? stepped : undefined,
			}))],
			hooks: { setSelect: [takeSelection], setCursor: [showValues],
				drawClear: [drawSilence], draw: [drawMarks] },
		}, [[], ...shown.map(() => [])], holder);
		state.uplot.over.addEventListener("dblclick", goOn);
		state.dirty = true;
	}

	function plotHeight() {
		return Math.min(
			HEIGHT_PX, Math.max(200, Math.round(globalThis.innerHeight * 0.42)));
	}

	function draw() {
		const { from, to } = window();

		if (!Number.isFinite(to))
			return;
		state.uplot.batch(() => {
			state.uplot.setData(data(from, to), false);
			state.uplot.setScale("x", { min: from, max: to });
		});
		showValues();
	}

	function makeLegend() {
		legend.replaceChildren(...state.chosen.map((name, index) => {
			const signal = signals[column(name)];
			const value = element("td", { class: "number", "data-value": name });

			return element("tr", {}, element("td", {}, createSwatch(index)),
				element("th", { scope: "row" }, signal.label), value,
				element("td", { class: "muted" }, signal.unit));
		}));
	}

	/* At the cursor, else the latest values. */
	function showValues() {
		const { uplot } = state;
		const at = uplot?.cursor.idx;
		const under = uplot && uplot.cursor.left >= 0 && at !== null && at !== undefined &&
			uplot.data[0].length > at;

		if (under)
			setText(cursorTime, timeOfDay(uplot.data[0][at], 3));
		else
			setText(cursorTime, state.paused ? t("paused") : "");
		state.chosen.forEach((name, index) => {
			const signal = signals[column(name)];
			const latest = silence() > 0 && !state.paused ? NaN : ring.last(column(name));
			const value = under ? uplot.data[index + 1][at] : latest;

			setText(legend.rows[index].cells[2],
				signal.names?.[value] ?? formatFixed(value, signal.decimals));
		});
	}

	/* --- choices -------------------------------------------------------------------------- */

	function choose(names) {
		state.chosen = names.filter((name) => column(name) >= 0).slice(0, SERIES_MOST);
		for (const box of choices.querySelectorAll("input")) {
			box.checked = state.chosen.includes(box.value);
			box.disabled = !box.checked && state.chosen.length >= SERIES_MOST;
		}
		makeLegend();
		if (node.isConnected)
			build();
	}

	function download() {
		const { from, to } = window();
		const text = formatCsv(state.chosen.map((name) => {
			const { unit } = signals[column(name)];

			return unit ? `${title}.${name} [${unit}]` : `${title}.${name}`;
		}),
			data(from, to));

		saveFile(`${title}-${nameTime()}.csv`, [text], "text/csv");
	}

	for (const signal of signals) {
		const box = element("input", { type: "checkbox", value: signal.name });

		/* Added after the others, which keep their colours. */
		box.addEventListener("change", () => choose(box.checked ?
			[...state.chosen, signal.name] : state.chosen.filter((name) => name !== signal.name)));
		/* Where Space stops the drive, Enter is the only key left for the box. */
		box.addEventListener("keydown", (event) => {
			if (event.key === "Enter")
				box.click();
		});
		choices.append(element("label", { class: "check" }, box, signal.label));
	}
	chooser.addEventListener("focusout", (event) => {
		if (!chooser.contains(event.relatedTarget) && chooser.matches(":not(:hover)"))
			chooser.open = false;
	});
	pause.addEventListener("click", () => {
		if (state.paused)
			goOn();
		else if (ring.length > 1)
			freeze(window().from, window().to);
	});
	span.addEventListener("change", () => {
		state.span = Number(span.value);
		goOn();
	});
	zoomIn.addEventListener("click", () => zoom(0.5));
	zoomOut.addEventListener("click", () => zoom(2));
	save.addEventListener("click", download);
	holder.addEventListener("keydown", (event) => {
		const { uplot } = state;
		const step = uplot ? uplot.over.clientWidth / (event.shiftKey ? 10 : 100) : 0;
		const keys = {
			ArrowLeft: () => uplot.setCursor(
				{ left: Math.max(0, uplot.cursor.left - step), top: 10 }),
			ArrowRight: () => uplot.setCursor({
				left: Math.min(uplot.over.clientWidth - 1,
					Math.max(0, uplot.cursor.left) + step),
				top: 10
			}),
			"+": () => zoom(0.5),
			"-": () => zoom(2),
			PageUp: () => pan(-0.5),
			PageDown: () => pan(0.5),
			End: goOn,
		};

		if (!uplot || !keys[event.key])
			return;
		event.preventDefault();
		keys[event.key]();
	});

	const sized = new ResizeObserver(() => {
		if (state.uplot)
			state.uplot.setSize(
				{ width: Math.max(200, holder.clientWidth), height: plotHeight() });
		else if (node.isConnected)
			build();
	});
	const rebuild = () => node.isConnected && build();
	const dark = matchMedia("(prefers-color-scheme: dark)");

	sized.observe(holder);
	globalThis.addEventListener("themechange", rebuild);
	dark.addEventListener("change", rebuild);
	choose(chosen);

	return {
		node,
		choose,
		push(time, values) {
			if (!ring.push(time, values))
				return;
			state.pushedAt = performance.now();
			if (!state.paused)
				state.dirty = true;
		},
		/* Marks a moment; `kind` is a colour of the style sheet, `of` says what it is of: the
		 * same is marked once. */
		mark({ of, time, label, kind }) {
			if (marks.has(of))
				return;
			marks.set(of, { time, label, kind });
			if (marks.size > MARKS_MOST)
				marks.delete(marks.keys().next().value);
			node.dataset.marks = String(marks.size);
			state.dirty = true;
		},
		frame(now) {
			if ((!state.dirty && silence() === 0) || !state.uplot || now - state.drawnAt < REDRAW_EVERY_MS)
				return;
			state.dirty = false;
			state.drawnAt = now;
			draw();
		},
		destroy() {
			sized.disconnect();
			globalThis.removeEventListener("themechange", rebuild);
			dark.removeEventListener("change", rebuild);
			state.uplot?.destroy();
		},
	};
}
