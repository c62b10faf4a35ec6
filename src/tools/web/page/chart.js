/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lines over time, drawn by uPlot: what the live plot of a drive and the oscilloscope's capture have in
 * common. A scale for each unit, colours of the style sheet, dashes, vertical and horizontal marks; drawn
 * again when its size or the colours change.
 */
import { DASHES, makeAxis, padRange, readColour, writeNumbers } from "./plot_line.js";

const WIDTH_LEAST_PX = 200;
/* Units that have an axis. */
const AXES_MOST = 3;

/*
 * A chart is { node, holder, uplot, series, options, marks(), level }: `node` has the style, `holder`
 * gets the drawing, `uplot` is null before buildChart(). Everything of it may be read; its owner changes `series` and
 * `level` before buildChart(), which makes the drawing.
 *
 * series: [{ label, scale, unit, range, stepped, gaps, spanGaps }], scale: the name of its scale, unit: of
 * its axis, null: it has none; range(low, high): the scale's ends, without it padRange().
 * options: { height(), x (of uPlot's axis of time), cursor and hooks (of uPlot), built(chart), sized() }.
 * marks(): [{ time, label, colour, dash }] are drawn as vertical lines, over the lines.
 * level: { scale, value, colour } is drawn as a horizontal line; null.
 */
export function createChart({ node, holder, series = [], options, marks = () => [] }) {
	const chart = { node, holder, uplot: null, series, options, marks, level: null };
	const rebuild = () => chart.uplot && buildChart(chart);
	const dark = matchMedia("(prefers-color-scheme: dark)");
	const sized = new ResizeObserver(() => {
		chart.uplot?.setSize({ width: widthOf(chart), height: options.height() });
		options.sized?.();
	});

	sized.observe(holder);
	globalThis.addEventListener("themechange", rebuild);
	dark.addEventListener("change", rebuild);
	chart.destroy = () => {
		sized.disconnect();
		globalThis.removeEventListener("themechange", rebuild);
		dark.removeEventListener("change", rebuild);
		chart.uplot?.destroy();
		chart.uplot = null;
	};
	return chart;
}

function widthOf({ holder }) { return Math.max(WIDTH_LEAST_PX, holder.clientWidth); }

function makeScales({ series }) {
	return Object.fromEntries(series.map(({ scale, range = padRange }) => [scale,
		{ auto: true, range: (uplot, low, high) => range(low ?? NaN, high ?? NaN) }]));
}

function makeAxes({ node, series, options }) {
	const axis = makeAxis(node);
	const shown = series.filter(({ unit }) => unit !== null);
	const units = [...new Map(shown.map(({ scale, unit }) => [scale, unit]))];

	return [
		{ ...axis, space: 90, labelFont: axis.font, labelSize: 18, ...options.x },
		...units.map(([scale, unit], index) => ({ ...axis, scale, side: index === 0 ? 3 : 1,
			show: index < AXES_MOST && (unit !== "" || units.length === 1), label: unit, labelFont: axis.font, labelSize: 18, size: 62,
			grid: { ...axis.grid, show: index === 0 }, values: writeNumbers })),
	];
}

function makeSeries({ node, series }) {
	const stepped = globalThis.uPlot.paths.stepped({ align: 1 });

	return [{}, ...series.map((one, index) => ({
		label: one.label,
		scale: one.scale,
		stroke: readColour(node, `series-${index + 1}`),
		width: 1.75,
		dash: DASHES[index],
		points: { show: false },
		gaps: one.gaps,
		spanGaps: one.spanGaps ?? false,
		paths: one.stepped ? stepped : undefined,
	}))];
}

/* Makes it anew, with this data. */
export function buildChart(chart, data = chart.uplot?.data ?? [[], ...chart.series.map(() => [])]) {
	const { holder, options } = chart;

	chart.uplot?.destroy();
	holder.replaceChildren();
	chart.uplot = new globalThis.uPlot({
		width: widthOf(chart),
		height: options.height(),
		legend: { show: false },
		cursor: options.cursor,
		scales: { x: { time: false }, ...makeScales(chart) },
		axes: makeAxes(chart),
		series: makeSeries(chart),
		hooks: { ...options.hooks, draw: [() => drawMarks(chart), () => drawLevel(chart)] },
	}, data, holder);
	options.built?.(chart);
}

/* A straight line; colour is that of a variable of the style sheet, or the text's with null. */
function drawLine({ node, uplot }, colour, dash, from, to) {
	const { ctx } = uplot;
	const ratio = globalThis.devicePixelRatio;

	ctx.strokeStyle = ctx.fillStyle = colour ? readColour(node, colour) : getComputedStyle(node).color;
	ctx.lineWidth = ratio;
	ctx.setLineDash(dash.map((part) => part * ratio));
	ctx.beginPath();
	ctx.moveTo(...from);
	ctx.lineTo(...to);
	ctx.stroke();
}

function drawMarks(chart) {
	const { uplot, node } = chart;
	const { ctx, bbox } = uplot;
	const ratio = globalThis.devicePixelRatio;

	ctx.save();
	ctx.font = `${11 * ratio}px ${getComputedStyle(node).fontFamily}`;
	for (const { time, label, colour, dash } of chart.marks()) {
		const x = Math.round(uplot.valToPos(time, "x", true));

		if (x < bbox.left || x > bbox.left + bbox.width)
			continue;
		drawLine(chart, colour, dash, [x, bbox.top], [x, bbox.top + bbox.height]);
		ctx.fillText(label, x + 3 * ratio, bbox.top + 11 * ratio);
	}
	ctx.restore();
}

function drawLevel(chart) {
	const { uplot, level } = chart;
	const { ctx, bbox } = uplot;

	if (!level || !uplot.scales[level.scale])
		return;
	const y = Math.round(uplot.valToPos(level.value, level.scale, true));

	ctx.save();
	drawLine(chart, level.colour, [6, 4], [bbox.left, y], [bbox.left + bbox.width, y]);
	ctx.restore();
}
