/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The language of the page. Texts are written in English where they are shown; a file of the language
 * (made by msgfmt from po/) has the translation of each. It is loaded before any other module runs, so a
 * text may be translated in a table, too. Another language is shown after the page was loaded again.
 *
 *   t("{count} more", { count })       one text; names in braces are replaced by the values
 *   plural(n, "drive", "drives", {})   one of two texts, by the number
 *   inLanguage(text)                     a text that the service or the gateway has made, with its values in it
 */
import { recall, remember } from "./kept_choice.js";

/* By the names of their files, in their own words. */
const LANGUAGES = { en: "English", de: "Deutsch", zh_CN: "简体中文" };
const TAGS = { en: "en", de: "de", zh_CN: "zh-CN" };
const LOAD_WITHIN_MS = 5000;
/* The first word of a file of translations, in the byte order of the file. */
const MAGIC = 0x950412de;
/* A name in braces, or a value of printf. */
const PLACE = /\{(\w+)\}|%(?:(\d+)\$)?[-+#0]*\d*(?:\.(?:\d+|\*))?(?:hh|h|ll|l|z|j)?[sdiufgcxX]/g;
/* A list of codes, such as " 0=closed 1=open", at the end of a description: these are names. */
const CODES = /:?(?: -?\w+=\S+){3,}$/;
/* Texts in texts: a reason in an advice in a message. */
const DEPTH_MOST = 3;
/* Of a text with values, besides these: fewer say nothing. */
const LETTERS_LEAST = 4;

/* The best of the languages for what the browser wants, in its order. Pure. */
export function chooseLanguage(wanted) {
	for (const tag of wanted) {
		const [language, ...rest] = String(tag).toLowerCase().split(/[-_]/);

		if (language === "en" || language === "de")
			return language;
		/* Who reads traditional characters has asked for others. */
		if (language === "zh" && !rest.some((part) => ["hant", "tw", "hk", "mo"].includes(part)))
			return "zh_CN";
	}
	return "en";
}

/* The texts of a file of gettext (.mo): a Map of English to translations. Pure. */
export function readTable(buffer) {
	const view = new DataView(buffer);
	const little = view.getUint32(0, true) === MAGIC;
	const decoder = new TextDecoder();
	const table = new Map();
	const number = (at) => view.getUint32(at, little);
	const text = (at) => decoder.decode(new Uint8Array(buffer, number(at + 4), number(at)));

	if (!little && view.getUint32(0, false) !== MAGIC)
		throw new Error("no file of translations");
	for (let i = 0; i < number(8); i++) {
		/* The plural of the English text, after a zero, is not part of its key. */
		const [key] = text(number(12) + 8 * i).split("\0");

		if (key)
			table.set(key, text(number(16) + 8 * i));
	}
	return table;
}

function fillIn(text, values) {
	return text.replace(/\{(\w+)\}/g, (all, name) => String(values[name] ?? all));
}

/* What may stand at a place: a number where there is one. */
function formOf(place) {
	if (/^\{n\d*\}$|[diu]$/.test(place))
		return "([-+]?\\d+)";
	if (/^%.*[xX]$/.test(place))
		return "([\\da-fA-F]+)";
	return /^%.*[fg]$/.test(place) ? "([-+.\\deinfa]+)" : /^%.*c$/.test(place) ? "(.)" : "(.*?)";
}

/*
 * Of a place after `before` in a text, called so in braces or not: what a value has to be to stay as it is, because it is the
 * name of a drive, a register or an option, or what was typed.
 */
function stayOf(before, name, next) {
	if ((/["']$/.test(before) && before.endsWith(next)) || /^(name|drive|bus|command|method)/.test(name ?? ""))
		return /^/;
	return /(^|--|drive |bus |of )$/.test(before) && !(before === "" && name !== undefined) ? /^[^ ]*$/ : /^(?!)/;
}

/* Texts with values as expressions that find them in a finished text, those that say most first. */
function makePatterns(table) {
	const patterns = [];

	for (const key of table.keys()) {
		const names = [];
		const stays = [];
		let form = "";
		let end = 0;

		for (const found of key.matchAll(PLACE)) {
			form += key.slice(end, found.index).replace(/[.*+?^${}()|[\]\\]/g, "\\$&") + formOf(found[0]);
			names.push(found[1] ?? String(names.length + 1));
			stays.push(stayOf(key.slice(0, found.index), found[1], key[found.index + found[0].length]));
			end = found.index + found[0].length;
		}
		const letters = key.replace(PLACE, "").replace(/[^\p{L}]/gu, "").length;

		if (names.length === 0 || letters < LETTERS_LEAST)
			continue;
		form += key.slice(end).replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
		patterns.push({ key, names, stays, letters, form: new RegExp(`^${form}$`, "s") });
	}
	return patterns.sort((one, other) => other.letters - one.letters);
}

/* t, plural and inLanguage for one language, from its table. Pure. */
export function createWords(table) {
	let patterns = null;

	const t = (english, values = {}) => fillIn(table.get(english) ?? english, values);

	function translate(text, depth) {
		const whole = table.get(text);

		if (whole !== undefined || table.size === 0 || depth > DEPTH_MOST || !/\p{L}/u.test(text))
			return whole ?? text;
		const codes = text.match(CODES);

		if (codes)
			return translate(text.slice(0, codes.index), depth + 1) + codes[0];
		patterns ??= makePatterns(table);
		/* "plant.conf:7: no such key": what is after a name and a colon is a text of its own. */
		const [, head, rest] = text.match(/^([^ ]+: )(.+)$/s) ?? [];

		for (const { key, names, stays, form } of rest && table.has(rest) ? [] : patterns) {
			const found = text.match(form);

			if (!found && rest && form.test(rest))
				break;
			if (!found)
				continue;
			const values = Object.fromEntries(names.map((name, i) =>
				[name, stays[i].test(found[i + 1]) ? found[i + 1] : translate(found[i + 1], depth + 1)]));
			let place = 0;

			return table.get(key).replace(PLACE, (_, name, number) =>
				values[name ?? number ?? String(++place)] ?? "");
		}
		return rest ? head + translate(rest, depth + 1) : text;
	}

	return {
		t,
		plural(n, one, several, values = {}) {
			const forms = table.get(one)?.split("\0") ?? [one, several];

			return fillIn(forms[Math.min(n === 1 ? 0 : 1, forms.length - 1)], values);
		},
		inLanguage: (text) => translate(String(text ?? ""), 0),
	};
}

async function loadTable(language) {
	if (language === "en")
		return new Map();
	try {
		const response = await fetch(`${language}.mo`, { signal: AbortSignal.timeout(LOAD_WITHIN_MS) });

		return response.ok ? readTable(await response.arrayBuffer()) : new Map();
	} catch {
		/* English is better than no page. */
		return new Map();
	}
}

const inBrowser = typeof document !== "undefined";
const kept = inBrowser ? recall("language", "") : "en";
const language = LANGUAGES[kept] ? kept : chooseLanguage(navigator.languages);
const table = inBrowser ? await loadTable(language) : new Map();

export const { t, plural, inLanguage } = createWords(table);

/* For numbers of Intl; English without a file of its language. */
export const languageTag = table.size > 0 ? TAGS[language] : "en";
/* For its dates and times: with 24 hours, the day before the month. */
export const dateTag = languageTag === "en" ? "en-GB" : languageTag;

if (inBrowser)
	document.documentElement.lang = languageTag;

/* Lets the user choose; fills a <select>. */
export function offerLanguages(select) {
	for (const [name, words] of Object.entries(LANGUAGES)) {
		const option = document.createElement("option");

		option.value = name;
		option.lang = TAGS[name];
		option.textContent = words;
		option.selected = name === language;
		select.append(option);
	}
	select.addEventListener("change", () => {
		remember("language", select.value);
		location.reload();
	});
}
