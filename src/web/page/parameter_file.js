/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text that keeps a drive's parameters, as `drivebridgectl params save` writes it and `params
 * restore` reads it: src/ctl/params_file.c has its form, src/reader the form of configuration
 * texts. Pure.
 */
import { parseValue } from "./format.js";
import { isKept, valueOf } from "./parameter_set.js";
import { cleanText } from "./plain.js";

export const FILE_MAX = 262144; /* bytes */

const FORMAT = "1";
const SECTIONS = ["drive", "parameters"];
const WORD = /(?:[^ #"'\t\n\r={}()+,*/\0]|\/(?=[^/ #"'\t\n\r={}()+,*\0]))+/y;
const SPACE = /(?:[ \t\r\n]|(?:#|\/\/)[^\n]*|\/\*[^]*?\*\/)+/y;
/* What word processors and copied pages leave in a file. */
const MISPRINT = /[\u00a0\u00ab\u00bb\u200b\u2013\u2018-\u201e\u202f\u2212\ufeff]/;

/* --- writing --- */

/* So that reading it gives the same value, down to the last bit of single precision. */
export function writeNumber(value) {
	if (Number.isInteger(value) && Math.abs(value) < 1e15)
		return String(value);
	for (let digits = 6; digits < 9; digits++) {
		const short = Number(value.toPrecision(digits));

		if (Math.fround(short) === Math.fround(value))
			return String(short).replace("+", "");
	}
	return String(Number(value.toPrecision(9))).replace("+", "");
}

function quote(text) {
	return `"${text.replace(/["\\]/g, "\\$&")}"`;
}

/* The whole file. */
export function writeParameters(set) {
	const kept = set.registers.filter(isKept);
	const width = Math.max(0, ...kept.map((register) => register.name.length));
	const lines = [
		"# Parameters of a drive. Into a drive: drivebridgectl params restore DRIVE FILE",
		"",
		`drive ${quote(set.name)} {`,
		`\tformat   = ${FORMAT}`,
		`\tfamily   = ${set.family}`,
		`\tidentity = ${quote(set.identity)}`,
		"}",
		"",
		"parameters {"
	];

	for (const register of kept) {
		const value = valueOf(set, register.name);
		/*
		 * What the words behind a semicolon say is for who writes the value over the wire.
		 */
		const about = cleanText(
			register.unit +
				(register.unit ? ", " : "") +
				register.description.split(";")[0]
		);

		lines.push(
			value === null
				? `\t# ${register.name}: the drive does not tell it: ${about}`
				: `\t${register.name.padEnd(width)} = ` +
						`${writeNumber(value).padEnd(10)} # ${about}`
		);
	}
	lines.push("}", "", "end", "");
	return lines.join("\n");
}

/* --- the form --- */

class FormError extends Error {
	constructor(line, text) {
		super(text);
		this.line = line;
	}
}

/*
 * Cuts a text into words, texts in quotes and marks: type is word, text, a mark or end, line that
 * of the one at hand, read() goes to the next.
 */
function createTokens(text) {
	const tokens = { type: "end", value: "", line: 1 };
	let at = 0;
	let lines = 1; /* that of `at` */

	/*
	 * The text that the pattern finds here, behind which it goes on; "" when it is not there.
	 */
	function take(pattern) {
		pattern.lastIndex = at;
		const found = pattern.exec(text)?.[0] ?? "";

		at += found.length;
		lines += found.split("\n").length - 1;
		return found;
	}

	function readText() {
		const mark = take(/["']/y);
		let said = "";

		for (;;) {
			said += take(/[^"'\\\n$]+/y);
			if (text[at] === mark) {
				at++;
				return said;
			}
			if (at === text.length || text[at] === "\n")
				throw new FormError(
					tokens.line,
					"the text that begins here has no end; " +
						`close it with ${mark} on the same line`
				);
			if (text.startsWith("${", at))
				throw new FormError(
					tokens.line,
					"environment variables are not filled in; write the " +
						"value itself"
				);
			if (text[at] === "\\" && text[++at] !== mark && text[at] !== "\\")
				throw new FormError(
					tokens.line,
					"unknown escape after a backslash; " +
						`write \\\\ for a backslash and \\${mark} for ` +
						`${mark}`
				);
			said += text[at++];
		}
	}

	tokens.read = () => {
		take(SPACE);
		tokens.line = lines;
		if (text.startsWith("/*", at))
			throw new FormError(
				lines,
				"the comment that begins here has no end; close it with */"
			);
		if (at === text.length) {
			tokens.type = "end";
			tokens.value = "";
		} else if ("{}=,".includes(text[at])) {
			tokens.type = tokens.value = text[at++];
		} else if (text[at] === '"' || text[at] === "'") {
			tokens.type = "text";
			tokens.value = readText();
		} else {
			tokens.type = "word";
			tokens.value = take(WORD);
			const misprint = MISPRINT.exec(tokens.value)?.[0];

			if (tokens.value === "")
				throw new FormError(
					lines,
					`the character '${text[at]}' cannot stand here; ` +
						'put texts with special characters in "quotes"'
				);
			if (misprint)
				throw new FormError(
					lines,
					`here stands U+${misprint
						.charCodeAt(0)
						.toString(16)
						.toUpperCase()
						.padStart(
							4,
							"0"
						)}, which only looks like a space, a quote or a ` +
						"minus; put the plain one in its place"
				);
		}
	};

	/* Goes on behind what has to stand here, and returns its value. */
	tokens.expect = (types, expected) => {
		const value = tokens.value;

		if (!types.includes(tokens.type))
			throw new FormError(
				tokens.line,
				tokens.type === "end"
					? `the file ends too early; expected ${expected}`
					: `'${value.slice(0, 40)}' cannot stand here; expected ` +
							`${expected}`
			);
		tokens.read();
		return value;
	};

	tokens.read();
	return tokens;
}

/*
 * { sections: [{ name, title, line, keys: [{ name, line, value }] }], ended }; value null: a list.
 */
function readSections(tokens, sections) {
	while (tokens.type !== "end") {
		const line = tokens.line;
		const name = tokens.expect(["word"], "a section: drive or parameters");

		if (name === "end" && tokens.type !== "{") {
			if (tokens.type !== "end")
				throw new FormError(
					line,
					"end says that the file is complete, but more follows " +
						`on line ${tokens.line}; move it to the last line`
				);
			return true;
		}
		if (tokens.type === "=")
			throw new FormError(
				line,
				`'${name}' stands outside of drive and parameters`
			);
		const title =
			tokens.type === "word" || tokens.type === "text"
				? tokens.expect(["word", "text"], "")
				: "";
		const section = { name, title, line, keys: [] };

		tokens.expect(["{"], "{ at the start of a section, or = after a key");
		while (tokens.type !== "}") {
			const key = { line: tokens.line };

			key.name = tokens.expect(["word"], "a key, or } at the end of the section");
			tokens.expect(["="], "= after the key");
			if (tokens.type === "{" || tokens.value.startsWith("["))
				throw new FormError(
					tokens.line,
					`'${key.name}' is a list; right is one value`
				);
			key.value = tokens.expect(["word", "text"], `the value of '${key.name}'`);
			if (tokens.type === ",")
				throw new FormError(
					tokens.line,
					"numbers have a decimal point, not a comma"
				);
			section.keys.push(key);
		}
		sections.push(section);
		tokens.read();
	}
	return false;
}

/* --- reading --- */

/* The one section of that name, or null and the reason is said. */
function findSection(sections, name, errors) {
	const found = sections.filter((section) => section.name === name);

	if (found.length === 0)
		errors.push({
			line: 0,
			text: `there is no section '${name}': this is no file of parameters`
		});
	for (const second of found.slice(1))
		errors.push({ line: second.line, text: `there is a second section '${name}'` });
	return found[0] ?? null;
}

function readHead(section, set, errors) {
	const head = {};

	for (const key of section.keys) {
		if (!["format", "family", "identity"].includes(key.name))
			errors.push({
				line: key.line,
				text:
					`a drive has no '${key.name.slice(0, 40)}'; ` +
					"right is format, family or identity"
			});
		else if (key.name === "format" && key.value !== FORMAT)
			errors.push({
				line: key.line,
				text:
					`the format is ${key.value.slice(0, 20)}; ` +
					`this page reads format ${FORMAT}`
			});
		else if (key.name === "family" && key.value !== set.family)
			errors.push({
				line: key.line,
				text:
					`these are parameters of ${key.value.slice(0, 40)}, ` +
					`and the drive is ${set.family}`
			});
		head[key.name] = key.value;
	}
	for (const name of ["format", "family"]) {
		if (head[name] === undefined)
			errors.push({ line: section.line, text: `the drive has no ${name}` });
	}
	set.identity = head.identity ?? "";
	set.title = section.title;
}

function readValue(key, set, errors) {
	const register = set.registers.find((one) => one.name === key.name);
	const parsed = register && isKept(register) ? parseValue(register, key.value) : null;

	if (parsed?.problem)
		errors.push({ line: key.line, text: `${key.name}: ${parsed.problem}` });
	else if (parsed)
		set.values[key.name] = parsed.value;
	else
		errors.push({
			line: key.line,
			text: register?.parameter
				? `'${key.name}' cannot be written from a file`
				: `${set.family} has no parameter '${key.name.slice(0, 40)}'`
		});
}

/*
 * What a file says of a drive like this one. { set, errors: [{ line, text }] }; the set counts only
 * without errors.
 */
export function readParameters(path, text, like) {
	const set = { ...like, name: path, identity: "", values: {}, missing: [] };
	const sections = [];
	const errors = [];

	if (text.includes("\0"))
		return {
			set,
			errors: [
				{
					line: 0,
					text: "it has zero bytes in it: this is no file of parameters"
				}
			]
		};
	try {
		if (!readSections(createTokens(text), sections))
			errors.push({
				line: 0,
				text: "the last line is not 'end': a part of the file is missing"
			});
	} catch (error) {
		if (!(error instanceof FormError))
			throw error;
		return { set, errors: [{ line: error.line, text: error.message }] };
	}
	for (const section of sections) {
		const given = new Map();

		if (!SECTIONS.includes(section.name))
			errors.push({
				line: section.line,
				text:
					`there is no section '${section.name.slice(0, 40)}'; ` +
					"right is drive or parameters"
			});
		for (const key of section.keys) {
			if (given.has(key.name))
				errors.push({
					line: key.line,
					text:
						`'${key.name}' is given twice, first on ` +
						`line ${given.get(key.name)}`
				});
			else
				given.set(key.name, key.line);
		}
	}
	const drive = findSection(sections, "drive", errors);
	const parameters = findSection(sections, "parameters", errors);

	if (drive)
		readHead(drive, set, errors);
	/* Of another family no name would fit. */
	if (
		parameters &&
		drive?.keys.some((key) => key.name === "family" && key.value === set.family)
	)
		parameters.keys.forEach((key) => readValue(key, set, errors));
	return { set, errors };
}
