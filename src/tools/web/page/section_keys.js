/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Keys of one section of the configuration, changed in its text; all else stays as it is written. What
 * is a word, a comment or a text in quotes is as in src/common/reader. Pure.
 */

const SKIPPED = /(?:\s+|#[^\n]*|\/\/[^\n]*|\/\*[\s\S]*?\*\/)+/y;
const TOKEN = /"(?:\\[\s\S]|[^"\\\n])*"|'(?:\\[\s\S]|[^'\\\n])*'|[{}=,]|(?:[^\s#"'={}(),+*/]|\/(?![/*\s]))+/y;

/* [{ text, at, end }]; null: this is no configuration. */
function readTokens(text) {
	const tokens = [];
	let at = 0;

	for (;;) {
		SKIPPED.lastIndex = at;
		at += SKIPPED.exec(text)?.[0].length ?? 0;
		if (at >= text.length)
			return tokens;
		TOKEN.lastIndex = at;
		const [found] = TOKEN.exec(text) ?? [];

		if (!found)
			return null;
		tokens.push({ text: found, at, end: at + found.length });
		at += found.length;
	}
}

const isNamed = (token, name) => token?.text === name || token?.text === `"${name}"`;

/* The index of the token that closes what this one opens; -1: nothing does. */
function findClose(tokens, open) {
	let depth = 0;

	for (let i = open; i < tokens.length; i++) {
		depth += { "{": 1, "}": -1 }[tokens[i].text] ?? 0;
		if (depth === 0)
			return i;
	}
	return -1;
}

/* The indices of the tokens { and } of a section; null: it is not in this text. */
function findSection(tokens, kind, name) {
	for (let i = 0; i < tokens.length; i++) {
		if (tokens[i].text !== "{")
			continue;
		const close = findClose(tokens, i);

		if (close < 0)
			return null;
		if (isNamed(tokens[i - 1], name) && tokens[i - 2]?.text === kind)
			return { open: i, close };
		i = close;
	}
	return null;
}

/* Where the value of a key stands, as { at, end }; null: the section does not have the key. */
function findValue(tokens, { open, close }, key) {
	for (let i = open + 1; i < close; i++) {
		if (tokens[i].text === "{")
			i = findClose(tokens, i);
		else if (tokens[i].text === key && tokens[i + 1]?.text === "=" && i + 2 < close) {
			const first = tokens[i + 2];
			const last = first.text === "{" ? tokens[findClose(tokens, i + 2)] : first;

			return { at: first.at, end: last.end };
		}
	}
	return null;
}

/* Before the brace that closes the section, in a line of its own. */
function addKey(text, tokens, { open, close }, line) {
	const { at } = tokens[close];
	const start = text.lastIndexOf("\n", at - 1) + 1;
	const first = text.slice(0, tokens[open + 1].at);
	const indent = (close > open + 1 && /\n([ \t]*)$/.exec(first)?.[1]) || "\t";

	return start > 0 && text.slice(start, at).trim() === "" ?
		`${text.slice(0, start)}${indent}${line}\n${text.slice(start)}` :
		`${text.slice(0, at).trimEnd()}\n${indent}${line}\n${text.slice(at)}`;
}

/*
 * The text with these keys, [{ key, value }] with values as they are written, in the section `kind` `name`;
 * null: it does not have this section.
 */
export function setKeys(text, kind, name, keys) {
	let changed = text;

	for (const { key, value } of keys) {
		const tokens = readTokens(changed);
		const section = tokens && findSection(tokens, kind, name);

		if (!section)
			return null;
		const found = findValue(tokens, section, key);

		changed = found ? changed.slice(0, found.at) + value + changed.slice(found.end) :
			addKey(changed, tokens, section, `${key} = ${value}`);
	}
	return changed;
}

/* For a person who writes it into the file. */
export function writeSection(kind, name, keys) {
	return `${kind} ${name} {\n${keys.map(({ key, value }) => `\t${key} = ${value}\n`).join("")}}\n`;
}
