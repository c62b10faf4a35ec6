/* SPDX-License-Identifier: Apache-2.0 */
/* Where a position is between the limits of the configuration. */
import { element, setAttribute } from "./dom.js";
import { formatReal } from "./format.js";
import { t } from "./words.js";

/* The part of the way from min to max, 0 to 1; null: it is not known. Pure. */
export function partOf(position, min, max) {
	if (typeof position !== "number" || !(max > min))
		return null;
	return Math.min(1, Math.max(0, (position - min) / (max - min)));
}

/* { node, show(values) } of a drive by its description; null if it has not both min-position and
 * max-position. */
export function createLimitBar({ min_position: min, max_position: max, unit_name: unit }) {
	if (partOf(0, min, max) === null)
		return null;
	const [low, high] = [min, max].map(formatReal);
	const mark = element("span", { class: "limit-mark" });
	const node = element("span", { class: "limit-bar", role: "img",
		title: t("between {low} and {high} {unit}", { low, high, unit }) }, mark);

	return {
		node,
		show(values) {
			const part = partOf(values?.position_units ?? values?.position, min, max);

			node.hidden = part === null;
			if (part === null)
				return;
			mark.style.left = `${(part * 100).toFixed(1)}%`;
			setAttribute(node, "data-end", String(part < 0.02 || part > 0.98));
			setAttribute(node, "aria-label",
				t("{part} % of the way from {low} to {high} {unit}", { part: Math.round(part * 100), low, high, unit }));
		},
	};
}
