/* SPDX-License-Identifier: Apache-2.0 */
/* A complete capture as a picture, with two cursors to measure between. */
import { readColumns } from "./capture.js";
import { element, newId, setText } from "./dom.js";
import { NONE, formatFixed, formatReal, formatWithUnit, hasBits } from "./format.js";
import { DASHES, createSwatch, makeAxis, padRange, readColour, writeNumbers } from "./plot_line.js";
import { t } from "./words.js";

export const CHANNELS_MOST = DASHES.length;
const CURSOR_STEPS = 1000;
const HEIGHT_PX = 380;

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

/*
 * channels: { drive, name, register, unit, show }, CHANNELS_MOST at most, unit and show() of the
 * users; level: { unit, value } of the trigger, or null. Returns { node, show(capture),
 * destroy() }; a capture has the form of createCapture()'s `shown`.
 */
export function createCapturePlot(channels, level = null) {
	const holder = element("div", { class: "plot-canvas" });
	const id = newId("cursors");
	const sliders = ["A", "B"].map((name) =>
		element("input", {
			type: "range",
			id: `scope-cursor-${name.toLowerCase()}`,
			min: 0,
			max: CURSOR_STEPS,
			step: 1,
			value: name === "A" ? 250 : 750,
			"aria-describedby": id
		})
	);
	const timeRow = element(
		"tr",
		{},
		element("td"),
		element("th", { scope: "row" }, t("time")),
		[0, 1, 2].map(() => element("td", { class: "number" }))
	);
	const rows = channels.map((channel, index) =>
		element(
			"tr",
			{},
			element("td", {}, createSwatch(index)),
			element("th", { scope: "row" }, `${channel.drive}.${channel.name}`),
			[0, 1, 2].map(() => element("td", { class: "number" }))
		)
	);
	const between = element(
		"button",
		{ id: "scope-zoom", class: "small", type: "button" },
		t("Between the cursors")
	);
	const all = element(
		"button",
		{ id: "scope-all", class: "small", type: "button" },
		t("All of it")
	);
	const node = element(
		"div",
		{ class: "scope-plot", hidden: true },
		holder,
		element(
			"div",
			{ class: "toolbar" },
			["A", "B"].map((name, at) =>
				element(
					"label",
					{ class: "field inline cursor-field", for: sliders[at].id },
					t("Cursor {name}", { name }),
					sliders[at]
				)
			),
			between,
			all
		),
		element(
			"div",
			{
				class: "table-frame",
				role: "region",
				tabindex: "0",
				"aria-label": t("Values at the cursors")
			},
			element(
				"table",
				{ class: "plot-legend", id },
				element(
					"caption",
					{ class: "hidden-label" },
					t("Values at the cursors")
				),
				element(
					"thead",
					{},
					element(
						"tr",
						{},
						element("td"),
						[t("Value"), "A", "B", "B − A"].map((head, at) =>
							element(
								"th",
								{
									scope: "col",
									class:
										at > 0
											? "number"
											: null
								},
								head
							)
						)
					)
				),
				element("tbody", {}, timeRow, rows)
			)
		)
	);
	const dark = matchMedia("(prefers-color-scheme: dark)");
	let uplot = null;
	let data = [[], ...channels.map(() => [])];
	let limits = { min: 0, max: 1 };

	function timeOf(cursor) {
		return (
			limits.min +
			((limits.max - limits.min) * Number(sliders[cursor].value)) / CURSOR_STEPS
		);
	}

	/* --- the cursors --- */

	function showCursors() {
		const times = [timeOf(0), timeOf(1)];
		const apart = times[1] - times[0];
		const rate = apart === 0 ? null : Number((1 / Math.abs(apart)).toPrecision(4));

		[
			`${formatFixed(times[0], 4)} s`,
			`${formatFixed(times[1], 4)} s`,
			`${formatFixed(apart, 4)} s${rate === null ? "" : `, ${formatReal(rate)} Hz`}`
		].forEach((text, at) => setText(timeRow.cells[at + 2], text));
		times.forEach((time, at) =>
			sliders[at].setAttribute("aria-valuetext", t("{time} seconds", { time: time.toFixed(4) }))
		);
		channels.forEach(({ register, unit }, index) => {
			const shown = { ...register, unit, type: unit === register.unit ? register.type : "f32" };
			const values = times.map((time) =>
				findValue(data[0], data[index + 1], time)
			);
			const words = values.map((value) => formatWithUnit(shown, value));
			const counts =
				values.includes(null) || hasBits(register) || register.codes
					? NONE
					: formatWithUnit(shown, values[1] - values[0]);

			[...words, counts].forEach((text, at) =>
				setText(rows[index].cells[at + 2], text)
			);
		});
		uplot?.redraw(false, false);
	}

	function drawCursors({ ctx, bbox }) {
		const style = getComputedStyle(node);
		const ratio = globalThis.devicePixelRatio;

		ctx.save();
		ctx.strokeStyle = ctx.fillStyle = style.color;
		ctx.font = `${12 * ratio}px ${style.fontFamily}`;
		ctx.lineWidth = ratio;
		["A", "B"].forEach((name, at) => {
			const x = Math.round(uplot.valToPos(timeOf(at), "x", true));

			if (x < bbox.left || x > bbox.left + bbox.width)
				return;
			ctx.setLineDash(at === 0 ? [] : [4 * ratio, 3 * ratio]);
			ctx.beginPath();
			ctx.moveTo(x, bbox.top);
			ctx.lineTo(x, bbox.top + bbox.height);
			ctx.stroke();
			ctx.fillText(name, x + 3 * ratio, bbox.top + 12 * ratio);
		});
		ctx.restore();
	}

	/* The trigger's level belongs into the picture. */
	function rangeOf(unit) {
		return (chart, low, high) => (level?.unit === unit && low !== null
			? padRange(Math.min(low, level.value), Math.max(high, level.value))
			: padRange(low ?? NaN, high ?? NaN));
	}

	function drawLevel({ ctx, bbox }) {
		if (level === null || !uplot?.scales[level.unit])
			return;
		const y = Math.round(uplot.valToPos(level.value, level.unit, true));
		const ratio = globalThis.devicePixelRatio;

		ctx.save();
		ctx.strokeStyle = readColour(node, "warning");
		ctx.lineWidth = ratio;
		ctx.setLineDash([6 * ratio, 4 * ratio]);
		ctx.beginPath();
		ctx.moveTo(bbox.left, y);
		ctx.lineTo(bbox.left + bbox.width, y);
		ctx.stroke();
		ctx.restore();
	}

	/* --- the picture --- */

	function build() {
		const axis = makeAxis(node);
		const units = [...new Set(channels.map(({ unit }) => unit))];

		uplot?.destroy();
		holder.replaceChildren();
		uplot = new globalThis.uPlot(
			{
				width: Math.max(200, holder.clientWidth),
				height: HEIGHT_PX,
				legend: { show: false },
				cursor: { drag: { x: true, y: false }, y: false },
				scales: {
					x: { time: false },
					...Object.fromEntries(
						units.map((unit) => [unit, { auto: true, range: rangeOf(unit) }])
					)
				},
				axes: [
					{
						...axis,
						space: 90,
						label: t("s from the trigger"),
						labelFont: axis.font,
						labelSize: 18
					},
					...units.map((unit, index) => ({
						...axis,
						scale: unit,
						side: index === 0 ? 3 : 1,
						show: unit !== "" && index < 3,
						label: unit,
						labelFont: axis.font,
						labelSize: 18,
						size: 64,
						values: writeNumbers,
						grid: { ...axis.grid, show: index === 0 }
					}))
				],
				series: [
					{},
					...channels.map(({ drive, name, register, unit }, index) => ({
						label: `${drive}.${name}`,
						scale: unit,
						stroke: readColour(node, `series-${index + 1}`),
						width: 1.75,
						dash: DASHES[index],
						spanGaps: true,
						points: { show: false },
						paths:
							register.codes || hasBits(register)
								? globalThis.uPlot.paths.stepped({
										align: 1
									})
								: undefined
					}))
				],
				hooks: {
					draw: [drawLevel, drawCursors],
					ready: [
						({ over }) =>
							over.addEventListener("click", moveCursor)
					]
				}
			},
			data,
			holder
		);
	}

	/* A click moves the nearer cursor. */
	function moveCursor(event) {
		const time = uplot.posToVal(event.offsetX, "x");
		const nearer = Math.abs(timeOf(0) - time) <= Math.abs(timeOf(1) - time) ? 0 : 1;

		sliders[nearer].value = Math.round(
			((time - limits.min) / (limits.max - limits.min)) * CURSOR_STEPS
		);
		showCursors();
	}

	function show(capture) {
		const before = limits;

		data = readColumns(capture, channels);
		limits = { min: data[0][0] ?? 0, max: data[0].at(-1) ?? 1 };
		if (limits.max <= limits.min)
			limits.max = limits.min + 1e-3;
		node.hidden = false;
		if (uplot === null)
			build();
		else
			/* The zoom stays while captures have the same length as the former one. */
			uplot.setData(
				data,
				Math.abs(limits.min - before.min) +
					Math.abs(limits.max - before.max) >
					0.2 * (limits.max - limits.min) ||
					(uplot.scales.x.min <= before.min &&
						uplot.scales.x.max >= before.max)
			);
		showCursors();
	}

	function zoom(min, max) {
		if (max > min)
			uplot?.setScale("x", { min, max });
	}

	const sized = new ResizeObserver(() =>
		uplot?.setSize({ width: Math.max(200, holder.clientWidth), height: HEIGHT_PX })
	);
	const rebuild = () => uplot && build();

	sized.observe(holder);
	globalThis.addEventListener("themechange", rebuild);
	dark.addEventListener("change", rebuild);
	sliders.forEach((slider) => slider.addEventListener("input", showCursors));
	between.addEventListener("click", () =>
		zoom(Math.min(timeOf(0), timeOf(1)), Math.max(timeOf(0), timeOf(1)))
	);
	all.addEventListener("click", () => zoom(limits.min, limits.max));

	return {
		node,
		show,
		destroy() {
			sized.disconnect();
			globalThis.removeEventListener("themechange", rebuild);
			dark.removeEventListener("change", rebuild);
			uplot?.destroy();
		}
	};
}
