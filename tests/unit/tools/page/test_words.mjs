/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import test from "node:test";
import { chooseLanguage, createWords, readTable } from "../../../../src/tools/web/page/words.js";

/* A file as msgfmt writes it: the places of the English texts, those of the translations, the texts. */
function makeFile(texts, little = true) {
	const encoder = new TextEncoder();
	const pairs = Object.entries(texts);
	const columns = [0, 1].map((i) => pairs.map((pair) => encoder.encode(pair[i])));
	const head = 28;
	let at = head + 16 * pairs.length;
	const bytes = new Uint8Array(at + columns.flat().reduce((sum, text) => sum + text.length + 1, 0));
	const view = new DataView(bytes.buffer);
	const places = [head, head + 8 * pairs.length];

	[0x950412de, 0, pairs.length, ...places, 0, 0].forEach((word, i) =>
		view.setUint32(4 * i, word, little));
	columns.forEach((column, which) => column.forEach((text, i) => {
		view.setUint32(places[which] + 8 * i, text.length, little);
		view.setUint32(places[which] + 8 * i + 4, at, little);
		bytes.set(text, at);
		at += text.length + 1;
	}));
	return bytes.buffer;
}

const german = {
	"": "Content-Type: text/plain; charset=UTF-8\n",
	"{count} more": "{count} weitere",
	"drive\0drives": "Antrieb\0Antriebe",
	"late by {time}": "{time} zu spät",
	"check its power": "Versorgung prüfen",
	"the port of bus {bus} is not open{port}": "der Port von Bus {bus} ist nicht offen{port}",
	"; {holder} has it: end that": "; {holder} belegt ihn: beenden",
	"%s of %s: %s": "nie",
	"no drive is called \"%s\"": "kein Antrieb heißt „%s“",
	"%.1f is no %s": "%.1f ist kein %s",
	"the part \"%s\"%s": "der Teil „%s“%s",
	"line {n}": "Zeile {n}",
	"line %u%s ends": "Zeile %u%s endet",
	"%s answers%s": "%s antwortet%s",
	"%s has no option --%s": "%s hat keine Option --%s",
	"%s knows %s": "%2$s kennt %1$s",
	"; did you mean {names}?": "; meinten Sie {names}?",
	"drive %s tells: %s": "Antrieb %s meldet: %s",
	"home": "referenzieren",
	"State of the axis": "Zustand der Achse",
};

test("a file of either byte order is read", () => {
	for (const little of [true, false]) {
		const table = readTable(makeFile(german, little));

		assert.equal(table.get("check its power"), "Versorgung prüfen");
		assert.equal(table.get("drive"), "Antrieb\0Antriebe");
		assert.equal(table.has(""), false);
	}
	assert.throws(() => readTable(new ArrayBuffer(28)));
});

test("names in braces take their values, in the order of the language", () => {
	const { t, plural } = createWords(readTable(makeFile(german)));

	assert.equal(t("late by {time}", { time: "4 s" }), "4 s zu spät");
	assert.equal(t("not in the table {a}", { a: 0 }), "not in the table 0");
	assert.equal(plural(1, "drive", "drives"), "Antrieb");
	assert.equal(plural(2, "drive", "drives"), "Antriebe");
	assert.equal(createWords(new Map()).plural(2, "one", "{n} of them", { n: 2 }), "2 of them");
	/* Chinese has one form for all numbers. */
	assert.equal(createWords(new Map([["drive", "驱动器"]])).plural(2, "drive", "drives"), "驱动器");
});

test("a finished text is recognised, with the texts in it", () => {
	const { inLanguage } = createWords(readTable(makeFile(german)));

	assert.equal(inLanguage("check its power"), "Versorgung prüfen");
	assert.equal(inLanguage("the port of bus press is not open; mbpoll (12) has it: end that"),
		"der Port von Bus press ist nicht offen; mbpoll (12) belegt ihn: beenden");
	assert.equal(inLanguage("no drive is called \"a.*b\""), "kein Antrieb heißt „a.*b“");
	assert.equal(inLanguage("one knows two"), "two kennt one");
	assert.equal(inLanguage("State of the axis: 0=Offline 1=Disabled 2=Standstill"),
		"Zustand der Achse: 0=Offline 1=Disabled 2=Standstill");
	/* Names are no words. */
	assert.equal(inLanguage("home has no option --home"), "home hat keine Option --home");
	assert.equal(inLanguage("no drive is called \"home\""), "kein Antrieb heißt „home“");
	assert.equal(inLanguage("; did you mean home?"), "; meinten Sie home?");
	assert.equal(inLanguage("drive home tells: home"), "Antrieb home meldet: referenzieren");
	assert.equal(inLanguage("check its power has no option --x"), "Versorgung prüfen hat keine Option --x");
	/* A place in a file, and a text of its own. */
	assert.equal(inLanguage("plant.conf:7: check its power"), "plant.conf:7: Versorgung prüfen");
	assert.equal(inLanguage("one two: check its power"), "one two: check its power");
	assert.equal(inLanguage("the part \"home\"; mbpoll has it: end that"), "der Teil „home“; mbpoll belegt ihn: beenden");
	/* A number is one. */
	assert.equal(inLanguage("-1.5 is no home"), "-1.5 ist kein referenzieren");
	assert.equal(inLanguage("that is no home"), "that is no home");
	assert.equal(inLanguage("line 12"), "Zeile 12");
	assert.equal(inLanguage("line x"), "line x");
	assert.equal(inLanguage("line 12 of it ends"), "Zeile 12 of it endet");
	/* What says more of the text is taken, of the whole or after the name. */
	assert.equal(inLanguage("plant.conf: no drive is called \"that answers\""),
		"plant.conf: kein Antrieb heißt „that answers“");
	/* Without words of its own a pattern says nothing about a text. */
	assert.equal(inLanguage("a of b: c"), "a of b: c");
	assert.equal(inLanguage("unknown"), "unknown");
	assert.equal(inLanguage(undefined), "");
});

test("the language is the first that the browser wants and the page has", () => {
	assert.equal(chooseLanguage(["de-AT", "en"]), "de");
	assert.equal(chooseLanguage(["fr-FR", "zh-CN", "en"]), "zh_CN");
	assert.equal(chooseLanguage(["zh"]), "zh_CN");
	assert.equal(chooseLanguage(["zh-Hant-TW", "de"]), "de");
	assert.equal(chooseLanguage(["en-US", "de"]), "en");
	assert.equal(chooseLanguage(["fr"]), "en");
	assert.equal(chooseLanguage([]), "en");
});
