/* SPDX-License-Identifier: Apache-2.0 */
/* How a drive has answered to a step, as a drawing that a printer prints as well. */
import { newId } from "./dom.js";
import { formatReal } from "./format.js";
import { padRange } from "./plot_line.js";
import { t } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 640;
const HEIGHT = 260;
const LEFT = 70;
const BOTTOM = 30;
const TICKS = 5;

function draw(name, attributes, ...children) {
	const node = document.createElementNS(SVG, name);

	for (const [key, value] of Object.entries(attributes))
		node.setAttribute(key, String(value));
	node.append(...children);
	return node;
}

/* Round numbers between two, about TICKS of them. Pure. */
export function findTicks(low, high) {
	const rough = (high - low) / TICKS;
	const power = 10 ** Math.floor(Math.log10(rough));
	const step = power * ([1, 2, 5].find((one) => one * power >= rough) ?? 10);
	const first = Math.ceil(low / step);

	return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) =>
		Number(((first + i) * step).toPrecision(10)));
}

/* "M0,1 2,3", and a gap where a value is none. Pure. */
export function writePath(times, values, x, y) {
	let pen = "M";
	const parts = [];

	times.forEach((time, i) => {
		if (!Number.isFinite(values[i])) {
			pen = "M";
			return;
		}
		parts.push(`${pen}${x(time).toFixed(1)},${y(values[i]).toFixed(1)}`);
		pen = "L";
	});
	return parts.join(" ");
}

/* curves: [{ kind, times, values, to }], the newest first, in seconds and in `unit`. */
export function drawResponse(curves, unit) {
	const times = curves.flatMap((curve) => curve.times);
	const values = curves.flatMap((curve) => curve.values).filter(Number.isFinite);
	const [early, late] = [Math.min(...times), Math.max(...times, 0.001)];
	const [low, high] = padRange(Math.min(...values), Math.max(...values));
	const x = (time) => LEFT + (time - early) / (late - early) * (WIDTH - LEFT - 10);
	const y = (value) => HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - BOTTOM - 10);
	const id = newId("response");
	const line = (x1, y1, x2, y2, kind) => draw("line", { x1, y1, x2, y2, class: kind });
	const node = draw("svg", { class: "response-plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img",
		"aria-labelledby": id }, draw("title", { id }, curves[0]?.kind === "speed" ?
			t("Speed after the step, in the direction of the step") : t("Way after the step, in the direction of the step")));

	for (const time of findTicks(early, late))
		node.append(line(x(time), 10, x(time), HEIGHT - BOTTOM, "grid"),
			draw("text", { x: x(time), y: HEIGHT - BOTTOM + 16, "text-anchor": "middle" }, formatReal(time)));
	for (const value of findTicks(low, high))
		node.append(line(LEFT, y(value), WIDTH - 10, y(value), "grid"),
			draw("text", { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" }, formatReal(value)));
	node.append(draw("text", { x: WIDTH - 10, y: HEIGHT - 2, "text-anchor": "end" }, "s"),
		draw("text", { x: 4, y: 14 }, unit));
	/* The newest one above the others. */
	curves.forEach((curve, i) => node.append(
		draw("path", { d: writePath(curve.times, curve.values, x, y), class: i === 0 ? "newest" : "former" })));
	if (Number.isFinite(curves[0]?.to))
		node.append(line(LEFT, y(curves[0].to), WIDTH - 10, y(curves[0].to), "target"));
	return node;
}
