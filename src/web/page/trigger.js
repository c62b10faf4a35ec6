/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a capture waits for: a state that is entered, a value that crosses another, an edge of a
 * bit. It comes when the condition becomes true behind a sample in which it was not. As
 * src/ctl/trigger.c. Pure.
 */
import { hasBits, parseValue } from "./format.js";

export const RELATIONS = ["=", "!=", ">", "<"];

/*
 * The condition on this register of a drive, with a value as somebody typed it: { drive, name,
 * words, take(values) }, or { problem } in words.
 */
export function createTrigger(drive, register, relation, typed) {
	const bits = hasBits(register);
	const { value, problem } = parseValue(register, typed);
	const limit = Number(value);
	let before = null; /* whether it was met in the last sample; null: there was none */

	if (register.type === "text")
		return { problem: "a text cannot be waited for" };
	if (bits && (relation === ">" || relation === "<"))
		return { problem: "bits are set (=) or not (!=), not more or less" };
	if (problem || (bits && limit === 0))
		return { problem: problem ?? "right is the name of a bit" };

	function isMet(number) {
		const equal = bits ? (number & limit) >>> 0 === limit : number === limit;

		return { "=": equal, "!=": !equal, ">": number > limit, "<": number < limit }[
			relation
		];
	}

	/*
	 * Of a sample of its drive: whether it comes with it. What is not known counts as not met.
	 */
	function take(values) {
		const now = values[register.name];

		if (typeof now !== "number" && typeof now !== "boolean")
			return false;
		const met = isMet(Number(now));
		const comes = met && before === false;

		before = met;
		return comes;
	}

	return {
		drive,
		name: register.name,
		words: `${drive}.${register.name}${relation}${typed.trim()}`,
		take
	};
}
