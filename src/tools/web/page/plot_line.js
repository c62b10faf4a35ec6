/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The style of plot lines: colours from the style sheet, and dashes, so that they can be
 * distinguished without colours.
 */
import { element } from "./dom.js";
import { formatShort } from "./format.js";

const SVG = "http://www.w3.org/2000/svg";

/* As many as there are colours --series-1 and following. */
export const DASHES = [[], [10, 5], [3, 4], [14, 4, 3, 4], [1, 3], [8, 3, 2, 3, 2, 3]];

/*
 * A variable of the style sheet as a colour for canvas: the browser resolves a variable only for an
 * element that uses it.
 */
export function readColour(node, name) {
	const probe = element("i", { hidden: true });

	probe.style.color = `var(--${name})`;
	node.append(probe);
	const { color } = getComputedStyle(probe);

	probe.remove();
	return color;
}

/* For a legend. */
export function createSwatch(index) {
	const drawing = document.createElementNS(SVG, "svg");
	const line = document.createElementNS(SVG, "line");

	drawing.setAttribute("class", `plot-line series-${index + 1}`);
	drawing.setAttribute("aria-hidden", "true");
	for (const [name, value] of [
		["x1", 0],
		["x2", 30],
		["y1", 5],
		["y2", 5]
	])
		line.setAttribute(String(name), String(value));
	line.setAttribute("stroke-dasharray", DASHES[index].join(" ") || "none");
	drawing.append(line);
	return drawing;
}

/* The range of an axis around values from low to high: a constant line is in the middle, and noise
 * of the last digit does not fill the picture. Pure. */
export function padRange(low, high) {
	if (!Number.isFinite(low) || !Number.isFinite(high))
		return [0, 1];
	const room = Math.max((high - low) * 0.08, Math.abs(high) * 1e-4, 0.05);

	return [low - room, high + room];
}

/* Numbers at an axis. */
export function writeNumbers(uplot, ticks) {
	return ticks.map((tick) => (tick === null ? "" :
		formatShort(tick, 7)));
}

/* What all axes of a plot have in common. */
export function makeAxis(node) {
	const lines = { stroke: readColour(node, "line"), width: 1 };

	return { stroke: readColour(node, "muted"), font: `12px ${getComputedStyle(node).fontFamily}`,
		grid: lines, ticks: lines };
}
