/* SPDX-License-Identifier: Apache-2.0 */
/* A field for an address. */
import { createField, element } from "./dom.js";

const NUMBER_MOST = 4000000;

/* Returns { input, field }. */
export function createNumber(id, label, properties = {}) {
	const input = element("input", {
		id,
		type: "number",
		min: 0,
		max: NUMBER_MOST,
		step: 1,
		inputmode: "numeric",
		...properties
	});

	return { input, field: createField(label, input) };
}
