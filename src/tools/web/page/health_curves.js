/* SPDX-License-Identifier: Apache-2.0 */
/* One drive over time: round trips, losses and retries, time offline, temperature. */
import { element } from "./dom.js";
import { makeColumns } from "./health_slots.js";
import { DASHES, createSwatch, makeAxis, padRange, readColour, writeNumbers } from "./plot_line.js";
import { dateTag, t } from "./words.js";

const HEIGHT_PX = 150;
const share = (name) => (value) => (value.exchanges > 0 ? value[name] / value.exchanges * 100 : null);
const trip = (name) => (value) => (value[name] > 0 ? value[name] / 1000 : null);
const CURVES = [
	{ id: "lost", title: t("Lost and asked again, % of the questions"), low: 0,
		lines: [[t("without an answer"), share("losses")], [t("asked again"), share("retries")],
			["damaged", share("damaged")]] },
	{ id: "trip", title: t("Round trip, ms"), low: 0,
		lines: [["mean", trip("round_trip_us")], ["longest", trip("round_trip_longest_us")]] },
	{ id: "offline", title: t("Offline, s in each interval"), low: 0,
		lines: [["offline", (value) => value.offline_ms / 1000]] },
	{ id: "temperature", title: t("Temperature, °C"), low: null,
		lines: [["highest", (value) => value.hottest], ["lowest", (value) => value.coldest]] },
];

function createPlot(holder, { lines, low }, data, [from, to]) {
	const stroke = (index) => readColour(holder, `series-${index + 1}`);

	return new globalThis.uPlot({
		width: Math.max(200, holder.clientWidth),
		height: HEIGHT_PX,
		legend: { show: false },
		cursor: { drag: { x: false, y: false } },
		scales: { x: { range: () => [from, to] },
			y: { range: (_, least, most) => (low === null ? padRange(least, most) :
				[low, Math.max(padRange(least, most)[1], 1)]) } },
		axes: [{ ...makeAxis(holder), values: writeTimes, space: 60 }, { ...makeAxis(holder), values: writeNumbers, size: 56 }],
		series: [{}, ...lines.map(([label], index) => ({ label, stroke: stroke(index), width: 1.75,
			dash: DASHES[index], points: { show: data[0].length < 2 }, spanGaps: false }))],
	}, data, holder);
}

/* "26 Nov" over days, "14:30" within. */
function writeTimes(_, ticks) {
	const days = ticks.length > 1 && ticks[1] - ticks[0] >= 43200;

	return ticks.map((tick) => (days ?
		new Date(tick * 1000).toLocaleDateString(dateTag, { day: "numeric", month: "short" }) :
		new Date(tick * 1000).toLocaleTimeString(dateTag, { hour: "2-digit", minute: "2-digit" })));
}

/* { node, draw({ values, running, step_s, now_us }, for_s), clear() } */
export function createHealthCurves() {
	const node = element("div", { id: "health-curves", class: "health-curves" });
	let plots = [];

	function clear() {
		plots.forEach((plot) => plot.destroy());
		plots = [];
		node.replaceChildren();
	}

	return {
		node,
		clear,
		draw({ values, running, step_s: step, now_us: now }, forS) {
			const all = [...values, ...running.filter(({ span_s: span }) => span > 0)];

			clear();
			/* Plots take the width that their figures have beside each other. */
			const pending = [];

			for (const curve of CURVES) {
				const columns = makeColumns(all, step, curve.lines.map(([, read]) => read));
				const holder = element("div", { class: "plot-canvas" });
				const is = columns.slice(1).some((column) => column.some((value) => value !== null));

				node.append(element("figure", { class: "panel", "data-curve": curve.id },
					element("figcaption", {}, element("h3", {}, curve.title),
						is ? curve.lines.map(([words], index) => element("span", { class: "muted" },
							createSwatch(index), ` ${words} `)) :
							element("p", { class: "muted" }, curve.id === "temperature" ?
								t("This drive reports no temperature.") : t("Nothing is known of this time."))),
					holder));
				if (is)
					pending.push([holder, curve, columns]);
			}
			plots = pending.map(([holder, curve, columns]) =>
				createPlot(holder, curve, columns, [now / 1e6 - forS, now / 1e6]));
		}
	};
}
