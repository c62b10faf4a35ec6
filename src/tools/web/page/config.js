/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The configuration, for engineers: buses and drives as a text, with what the service's checker says
 * of it, what loading it would do, and the texts of before.
 */
import { call } from "./api.js";
import { loadConfiguration, saveConfiguration } from "./config_change.js";
import { countLines, describeEffects, findLine, readMessage } from "./config_text.js";
import { createField, element, setText } from "./dom.js";
import { writeClock, writeDay } from "./plain.js";
import { askUser } from "./question.js";
import { t } from "./words.js";

export const title = t("Configuration");

const CHECK_AFTER_MS = 600;

/* A text that is not saved outlives a look at another view; null: there is none. */
let draft = null;
let view = null;

/* --- the editor ------------------------------------------------------------------------------- */

function createEditor() {
	const numbers = element("pre", { class: "line-numbers", "aria-hidden": "true" });
	const text = element("textarea", { id: "config-text", spellcheck: "false", autocomplete: "off",
		autocapitalize: "none", wrap: "off", rows: "18", "aria-describedby": "config-state" });
	let shown = "";

	/* Only what has changed is drawn. */
	function drawNumbers(marks) {
		const wanted = `${countLines(text.value)} ${[...marks].join()}`;

		if (wanted === shown)
			return;
		shown = wanted;
		numbers.replaceChildren(...Array.from({ length: countLines(text.value) }, (_, index) =>
			element("span", { "data-kind": marks.get(index + 1) ?? null }, `${index + 1}\n`)));
	}

	text.addEventListener("scroll", () => { numbers.scrollTop = text.scrollTop; });
	/* The user may make it larger. */
	new ResizeObserver(() => { numbers.style.height = `${text.clientHeight}px`; }).observe(text);
	return {
		text,
		drawNumbers,
		node: element("div", { class: "editor" }, numbers, text),
		go(line) {
			const { start, end } = findLine(text.value, line);

			text.focus();
			text.setSelectionRange(start, end);
			text.scrollTop = Math.max(0, (line - 4) * text.scrollHeight / countLines(text.value));
		}
	};
}

/* --- what the checker says -------------------------------------------------------------------- */

function showMessages(mine) {
	const messages = mine.checked.messages.map((message) => readMessage(message, mine.answer.path));
	const marks = new Map();

	for (const { line, warning } of messages) {
		if (line > 0 && (!warning || !marks.has(line)))
			marks.set(line, warning ? "warning" : "error");
	}
	mine.editor.drawNumbers(marks);
	mine.editor.text.setAttribute("aria-invalid", String(!mine.checked.good));
	mine.messages.replaceChildren(...messages.map(({ line, warning, text }) =>
		element("li", { "data-kind": warning ? "warning" : "error" },
			line > 0 ? element("button", { class: "small", type: "button", "data-line": line,
				onclick: () => mine.editor.go(line) }, t("line {line}", { line })) : null,
			` ${warning ? t("warning: ") : ""}${text}`)));
}

function showEffects(mine) {
	const lines = describeEffects(mine.checked.effects);

	mine.effects.hidden = !mine.checked.good;
	mine.effects.replaceChildren(element("h2", {}, t("What loading it does")),
		element("ul", {}, lines.map((line) => element("li", {}, line))),
		element("p", { class: "muted" }, lines.length === 0 ?
			t("No drive changes: what runs goes on.") : t("All other drives go on without interruption.")));
}

const hasChanged = (mine) => mine.editor.text.value !== mine.answer.text;

function showState(mine, words) {
	const { checked, answer } = mine;

	setText(mine.state, words ?? (!answer.may_edit ?
		t("It can be read and checked here, not changed: control { edit = on } in the file of root allows that.") :
		!checked ? t("It is being checked") :
			!checked.good ? t("There are mistakes: it cannot be saved") :
				hasChanged(mine) ? t("It is right, and not saved") : t("It is right, and saved")));
	mine.save.disabled = mine.busy || !answer.may_edit || !checked?.good || !hasChanged(mine);
	mine.back.disabled = mine.busy || !answer.may_edit || answer.formers.length === 0;
	mine.load.disabled = mine.busy;
	mine.editor.text.readOnly = mine.busy;
}

/* Resolves with true when this is still the text. */
async function check(mine) {
	const text = mine.editor.text.value;
	const checked = await call("CheckConfiguration", { text });

	if (view !== mine || text !== mine.editor.text.value)
		return false;
	mine.checked = checked;
	showMessages(mine);
	showEffects(mine);
	showState(mine);
	return true;
}

function checkLater(mine) {
	mine.checked = null;
	draft = hasChanged(mine) ? { text: mine.editor.text.value, version: mine.version } : null;
	mine.editor.drawNumbers(new Map());
	showState(mine);
	clearTimeout(mine.timer);
	mine.timer = setTimeout(async () => {
		try {
			await check(mine);
		} catch (error) {
			if (view !== mine)
				return;
			showState(mine, error.message);
			/* Another one is being checked; it takes a moment. */
			if (error.name === "Busy")
				checkLater(mine);
		}
	}, CHECK_AFTER_MS);
}

/* --- changing it ------------------------------------------------------------------------------ */

function showAnswer(mine, answer) {
	mine.answer = answer;
	mine.former.replaceChildren(...answer.formers.map(({ number, time_us: time }) =>
		element("option", { value: number }, `${writeDay(time)} ${writeClock(time, 3)}`)));
	mine.former.disabled = mine.look.disabled = answer.formers.length === 0;
	mine.running.value = answer.running;
}

/* Shows what the gateway has, or the text that was not saved. */
async function read(mine, keep) {
	const answer = await call("Configuration");

	if (view !== mine)
		return;
	showAnswer(mine, answer);
	mine.version = keep && draft ? draft.version : answer.version;
	mine.editor.text.value = keep && draft ? draft.text : answer.text;
	checkLater(mine);
}

/* One action at a time; what goes wrong is reported. */
async function act(mine, work) {
	mine.busy = true;
	showState(mine);
	try {
		await work();
	} catch (error) {
		mine.context.report(error);
	}
	mine.busy = false;
	if (view === mine)
		showState(mine);
}

/* Saves a text and loads it, when the user has seen what that does. */
async function apply(mine, text, question) {
	if (!await saveConfiguration({ text, path: mine.answer.path, version: mine.version }, question))
		return;
	draft = null;
	try {
		await loadConfiguration(mine.context);
	} finally {
		await read(mine, false);
	}
}

async function goBack(mine) {
	const [{ number, time_us: time }] = mine.answer.formers;
	const { text } = await call("Configuration", { former: number });

	await apply(mine, text, t("Back to the text of {time} {time2}?", { time: writeDay(time), time2: writeClock(time, 3) }));
}

async function readAgain(mine) {
	if (hasChanged(mine) && !await askUser({
		title: t("Read it again?"), words: [t("What you have written and not saved is lost.")], yes: t("Read again")
	}))
		return;
	draft = null;
	await read(mine, false);
}

async function loadFiles(mine) {
	if (await askUser({
		title: t("Load the files again?"),
		words: [t("The service reads all files as they are now: also what root has changed in them. Drives whose sections changed are left as their on-exit says.")],
		yes: t("Load")
	}))
		await loadConfiguration(mine.context);
}

/* --- the view --------------------------------------------------------------------------------- */

function createTools(mine) {
	const button = (id, words, work, kind = "") => element("button",
		{ id, type: "button", class: kind, onclick: () => act(mine, () => work(mine)) }, words);

	mine.save = button("config-save", t("Save and load"),
		() => apply(mine, mine.editor.text.value, t("Save this configuration and load it?")), "primary");
	mine.back = button("config-back", t("Back to the former one"), goBack);
	mine.load = button("config-load", t("Load the files"), loadFiles);
	mine.former = element("select", { id: "config-former" });
	mine.look = button("config-look", t("Show"), async () => {
		const { text } = await call("Configuration", { former: Number(mine.former.value) });

		mine.editor.text.value = text;
		checkLater(mine);
	});
	return [
		element("div", { class: "toolbar" }, mine.save, mine.back,
			button("config-read", t("Read again"), readAgain), mine.load),
		element("div", { class: "toolbar" }, createField(t("Texts of before"), mine.former, "inline"), mine.look)
	];
}

export async function show(root, context) {
	if (!context.may("manage")) {
		root.append(element("p", { class: "empty" }, context.whyNot("manage")));
		return;
	}
	const mine = {
		context, busy: false, checked: null, timer: 0, version: "",
		answer: { text: "", path: "", may_edit: false, formers: [] },
		editor: createEditor(),
		state: element("p", { id: "config-state", role: "status" }),
		messages: element("ul", { id: "config-messages", class: "config-messages" }),
		effects: element("div", { id: "config-effects", class: "panel", hidden: true }),
		running: element("textarea", { id: "config-running", readonly: true, rows: "16", wrap: "off",
			spellcheck: "false", "aria-label": t("What runs, with every value") })
	};
	const path = element("code");
	const tools = createTools(mine);

	view = mine;
	mine.editor.text.addEventListener("input", () => checkLater(mine));
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Configuration")),
			element("a", { href: "#/gateway" }, t("Back up or restore the gateway"))),
		element("div", { class: "panel", id: "config" },
			element("label", { class: "field", for: mine.editor.text.id },
				t("Buses and drives that are edited here")),
			mine.editor.node, mine.state, mine.messages, tools,
			element("p", { class: "muted" }, t("This text is the file "), path,
				t("; other files, and who may do what, are root's."))),
		mine.effects,
		element("details", { class: "panel" },
			element("summary", {}, t("What runs, with every value")), mine.running));
	await read(mine, true);
	setText(path, mine.answer.path);
}

export function hide() {
	clearTimeout(view?.timer);
	view = null;
}
