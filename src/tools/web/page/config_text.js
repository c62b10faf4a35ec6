/* SPDX-License-Identifier: Apache-2.0 */
import { inLanguage, t } from "./words.js";
/* What the service says of an edited configuration, in a form to show. Without a document. */

/*
 * "PATH:LINE: warning: text" of the checker: { line, warning, text }. Of other files than `path`, and
 * of the whole, line is 0 and the text names them.
 */
export function readMessage(message, path) {
	const own = message.startsWith(`${path}:`);
	const [, line, warning, text] =
		/^(?:(\d+):)? ?(warning: )?(.*)$/s.exec(own ? message.slice(path.length + 1) : message);

	return own ? { line: Number(line ?? 0), warning: Boolean(warning), text: inLanguage(text) } :
		{ line: 0, warning: / warning: /.test(message), text: inLanguage(message) };
}

/* The index in the text where a line begins, and where it ends; lines count from 1. */
export function findLine(text, line) {
	let start = 0;

	for (let count = 1; count < line; count++) {
		const end = text.indexOf("\n", start);

		if (end < 0)
			break;
		start = end + 1;
	}
	const end = text.indexOf("\n", start);

	return { start, end: end < 0 ? text.length : end };
}

export function countLines(text) { return text.split("\n").length; }

/* Sentences for a question; what moves comes first. */
export function describeEffects(effects) {
	const words = ({ bus, drive, text, moves }) =>
		`${drive ?? t("bus {bus}", { bus })}${moves ? t(" MOVES NOW") : ""}: ${inLanguage(text)}`;

	return [...effects.filter(({ moves }) => moves), ...effects.filter(({ moves }) => !moves)].map(words);
}
