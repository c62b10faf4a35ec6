/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A field for a number in the language of the page. A field of type "number" is read in the language of the browser,
 * and drops what that does not know: of "1,5" it may take 15.
 */
import { element } from "./dom.js";
import { formatReal, parseValue } from "./format.js";

/*
 * value: a number, or null for an empty field; others are attributes of the field. Returns { input, read() }: read() is
 * NaN while nothing, or no such number, is typed; then the form it is in is not valid.
 */
export function createNumberField({ min = undefined, max = undefined, value = null, unit = "", ...others }) {
	const register = { type: "f32", unit, min, max };
	const input = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", ...others,
		value: value === null ? "" : formatReal(value) });

	input.addEventListener("input", () => input.setCustomValidity(
		input.value.trim() === "" ? "" : parseValue(register, input.value).problem ?? ""));
	return { input, read: () => parseValue(register, input.value).value ?? NaN };
}
