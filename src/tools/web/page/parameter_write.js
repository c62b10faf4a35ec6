/* SPDX-License-Identifier: Apache-2.0 */
/* Having a drive's parameters written, and what came of it. */
import { openStream } from "./api.js";
import { element } from "./dom.js";
import { formatWithUnit } from "./format.js";
import { agree, isKept, valueOf } from "./parameter_set.js";
import { t } from "./words.js";

/*
 * A written value may have been changed by a later one, or may change others. Adds the first kind
 * to `failed`, a Map of name to reason, and returns the others in words.
 */
export function compareAfter({ before, after, wanted, written, failed }) {
	const others = [];

	for (const register of after.registers.filter(isKept)) {
		const shows = t("the drive shows {register} now", { register: formatWithUnit(register, valueOf(after, register.name)) });

		if (written.includes(register.name) && !agree(after, { values: wanted }, register))
			failed.set(register.name, shows);
		else if (!(register.name in wanted) && !agree(after, before, register))
			others.push(`${register.name}: ${shows}`);
	}
	return others;
}

export function createReport({ drive, canSave, written, failed, over, others }) {
	const count = written.filter((name) => !failed.has(name)).length;
	const words = failed.size > 0 ?
		t("{drive}: {count} written, {failed} not", { drive, count, failed: failed.size }) :
		t("{drive}: {count} written", { drive, count });
	const next = canSave
		? t("Not saved in the drive yet: Save into the drive does that.")
		: t("{drive} has no save_parameters: what is written is all there is.", { drive });

	return {
		words,
		node: element(
			"div",
			{},
			element("h2", {}, words),
			over
				? element(
						"p",
						{},
						t("It came to an end: {over}. What is left stands in the table: Write goes on with it.", { over })
					)
				: null,
			element(
				"ul",
				{},
				[...failed].map(([name, reason]) =>
					element("li", { class: "problem" }, `${name}: ${reason}`)
				),
				others.map((text) =>
					element("li", {}, t("changed with them: {text}", { text }))
				)
			),
			count > 0 ? element("p", { class: "muted" }, next) : null
		)
	};
}

/*
 * Has parameters written, one after the other: report({ name, state, text, value }) is called for
 * each. standing: only while the drive stands. Returns { result, close() }: a promise of { written,
 * failed, over }, which is rejected when nothing can be said; close() gives up.
 */
export function writeInto(drive, values, standing, report) {
	let settle = null;
	const result = new Promise((resolve, reject) => {
		settle = { resolve, reject };
	});
	let told = null;
	const stream = openStream(
		"parameters",
		{ drive, values, standing },
		{
			once: true,
			onEvent(name, data) {
				if (name === "parameter")
					report(data);
				else if (name === "result")
					told = data;
			},
			onState(state, error) {
				if (state === "ended")
					settle.resolve({
						...told,
						failed: new Map(Object.entries(told.failed))
					});
				else if (state === "failed")
					settle.reject(error);
			}
		}
	);

	return { result, close: stream.close };
}
