/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The first drive of a kind, step by step, in the steps of drivebridgectl commission. The server
 * runs the steps (src/tools/web/round.c); this view shows its questions, and sends a keep-alive ten
 * times a second while the motor turns. When these stop, for whatever reason, the server stops the
 * drive, and the commissioning ends.
 */
import { listCommissionSteps, openStream, sayToCommission } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { asLabel } from "./format.js";
import { createPasteText } from "./paste_text.js";
import { inLanguage, t } from "./words.js";
import { createNumberField } from "./number_field.js";
import { numbers } from "./numbers.js";

const BEAT_EVERY_MS = 100;
/* Further unanswered beats would only take connections from the stop. */
const BEATS_AT_ONCE = 2;
const ALIVE_EVERY_MS = 1000;
/* The worst first. */
const VERDICTS = ["contradicted", "proven", "not seen", "does not apply"];
const VERDICT_WORDS = { "contradicted": t("contradicted"), "proven": t("proven"),
	"not seen": t("not seen"), "does not apply": t("does not apply") };
const BADGES = { contradicted: "badge error", proven: "badge on" };

let view = null;

export function title(name) { return t("Commission {drive}", { drive: name ?? "" }).trim(); }

export async function show(root, context, name) {
	const mine = { context, name, stream: null, timer: 0, motion: 0, underWay: 0, verdicts: [], offs: [] };

	view?.close();
	view = mine;
	mine.close = () => {
		end(mine);
		mine.offs.forEach((off) => off());
	};
	if (!context.may("engineer", name)) {
		root.append(element("p", { class: "empty" }, context.whyNot("engineer", name)));
		return;
	}
	const steps = await listCommissionSteps();

	if (view !== mine)
		return;
	build(mine, root, steps);
	watchKeys(mine);
}

export function hide() {
	view?.close();
	view = null;
}

/* --- the list of steps
 * ------------------------------------------------------------------------- */

function createNumber(id, label, hint) {
	const number = createNumberField({ id, min: 0, placeholder: hint });

	return { ...number, field: createField(label, number.input) };
}

function build(mine, root, steps) {
	const { context, name } = mine;

	mine.step = element("select", { id: "commission-step" },
		element("option", { value: "" }, t("All steps")),
		steps.map(({ step, description }) =>
			element("option", { value: step }, `${step}: ${inLanguage(description)}`)));
	mine.velocity = createNumber("commission-velocity", t("Velocity of trial motions"), "slow");
	mine.seconds = createNumber("commission-seconds", t("Seconds of one (0.2 to 5)"), "1.5");
	mine.begin = element("button", { id: "commission-begin", class: "primary", type: "button",
		onclick: () => begin(mine) }, t("Begin"));
	mine.now = element("p", { id: "commission-now", role: "status" });
	mine.question = element("p", { id: "commission-question", class: "commission-question",
		tabindex: -1 });
	mine.answers = element("div", { id: "commission-answers", class: "toolbar" });
	mine.problem = element("p", { class: "problem", role: "alert" });
	mine.rows = element("tbody");
	mine.seen = element("section", { id: "commission-verdicts", class: "panel table-frame", hidden: true,
		"aria-label": t("What was seen"), tabindex: 0 },
	element("table", {},
		element("thead", {}, element("tr", {},
			["", t("Setting"), t("Today"), t("What was seen"), t("What is right")].map((head) =>
				element("th", { scope: "col" }, head)))),
		mine.rows));
	mine.counts = element("p", { id: "commission-counts" });
	mine.sections = createPasteText(t("For the configuration, then drivebridgectl reload"));
	mine.save = element("button", { id: "commission-report", type: "button" },
		t("Save the report"));
	mine.result = element("section", { id: "commission-result", class: "panel", hidden: true,
		"aria-label": t("Result") },
	element("div", { class: "panel-head" }, element("h2", {}, t("Result")),
		element("span", { class: "push" }), mine.save),
	mine.counts, mine.sections.node);
	root.replaceChildren(
		element("div", { class: "view-head" }, element("h1", {}, title(name)),
			element("a", { href: `#/drive/${encodeURIComponent(name)}` }, t("Drive {name}", { name })),
			element("span", { class: "push" }),
			element("button", { id: "commission-stop", class: "stop", type: "button",
				"aria-keyshortcuts": "Escape",
				onclick: () => context.stop(name, "stop") },
			icon("stop"), t("Stop"), element("kbd", {}, t("Esc")))),
		element("section", { class: "panel", "aria-label": t("Begin") },
			element("p", {}, element("strong", {}, t("Uncouple the drive from the machine first. ")),
				t("The motor is turned, slowly and for moments, and you are asked what you saw. Escape stops it, and so does leaving this page; in the end it has no power.")),
			element("div", { class: "toolbar filters" }, createField(t("Steps"), mine.step),
				mine.velocity.field, mine.seconds.field, mine.begin)),
		element("section", { id: "commission", class: "panel", "aria-label": t("Now") },
			mine.now, mine.question, mine.answers, mine.problem),
		mine.seen, mine.result);
	setText(mine.now, t("Nothing goes on."));
}

/* --- a running commissioning
 * ------------------------------------------------------------------- */

/* Only the filled fields; the server checks them. */
function readOrder(mine) {
	const order = { drive: mine.name };

	if (mine.step.value)
		order.step = mine.step.value;
	for (const [key, { input, read }] of [["velocity", mine.velocity], ["seconds", mine.seconds]]) {
		if (input.value.trim() !== "")
			order[key] = read();
	}
	return order;
}

function begin(mine) {
	if (![mine.velocity, mine.seconds].every(({ input }) => input.reportValidity()))
		return;
	mine.begin.disabled = true;
	mine.verdicts = [];
	mine.rows.replaceChildren();
	mine.seen.hidden = mine.result.hidden = true;
	setText(mine.problem, "");
	setText(mine.now, t("Asking the drive …"));
	mine.stream = openStream("commission", readOrder(mine), {
		once: true,
		onEvent: (event, data) => take[event]?.(mine, data),
		onState(state, error) {
			if (state === "failed")
				setText(mine.problem, error.message);
			if (state === "failed" || state === "ended")
				finish(mine);
		},
	});
	mine.timer = setInterval(() => say(mine, {}), ALIVE_EVERY_MS);
}

/* Ends it early: closing the stream also ends it on the server. */
function end(mine) {
	if (!mine.stream)
		return;
	sayToCommission({ end: true }, { keepalive: true }).catch(() => {});
	mine.stream.close();
	finish(mine);
}

function finish(mine) {
	letGo(mine);
	clearInterval(mine.timer);
	mine.stream = null;
	mine.begin.disabled = false;
	clearQuestion(mine);
	if (mine.result.hidden)
		setText(mine.now, t("It has ended."));
}

/* Returns whether the server got the message. A failure is not shown: the server ends a
 * commissioning without messages. */
async function say(mine, what) {
	try {
		await sayToCommission(what);
		return true;
	} catch (error) {
		if (mine.stream && what.question)
			setText(mine.problem, error.message);
		return false;
	}
}

async function beat(mine) {
	if (mine.underWay >= BEATS_AT_ONCE || document.hidden)
		return;
	mine.underWay++;
	await say(mine, { motion: mine.motion });
	mine.underWay--;
}

function letGo(mine) {
	clearInterval(mine.beats);
	mine.beats = 0;
}

function clearQuestion(mine) {
	setText(mine.question, "");
	mine.answers.replaceChildren();
}

function answerNumber(mine, question, typed) {
	const { text, problem } = numbers.read(typed);

	if (problem)
		setText(mine.problem, problem);
	else
		answer(mine, question, text);
}

async function answer(mine, question, text) {
	if (await say(mine, { question, answer: text })) {
		setText(mine.problem, "");
		/* Unless the next question is already shown. */
		if (mine.asked === question)
			clearQuestion(mine);
	}
}

const label = (choice) => asLabel(choice.replace("-", " "));

const take = {
	step(mine, { step, description }) {
		setText(mine.now, t("Step {step}: {description}", { step, description: inLanguage(description) }));
		clearQuestion(mine);
	},
	ask(mine, { question, text, choices }) {
		const input = element("input", { id: "commission-number", type: "text",
			inputmode: "decimal", "aria-label": t("Measured"), autocomplete: "off" });
		const make = (choice) => element("button", { type: "button", "data-answer": choice,
			class: choice === "yes" ? "primary" : null,
			onclick: () => answer(mine, question, choice) }, label(choice));

		mine.asked = question;
		setText(mine.question, inLanguage(text));
		mine.answers.replaceChildren(...(choices ?
			choices.filter((choice) => choice !== "skip").map(make) :
			[input, element("button", { type: "button", class: "primary", "data-answer": "number",
				onclick: () => answerNumber(mine, question, input.value.trim()) },
			t("Answer"))]), make("skip"));
		mine.question.focus();
	},
	moving(mine, { motion, again }) {
		mine.motion = motion;
		setText(mine.question, again ?
			t("The motor turns once more: nothing was heard of the drive for a moment, so its times are doubtful.") :
			t("The motor turns."));
		letGo(mine);
		mine.beats = setInterval(() => beat(mine), BEAT_EVERY_MS);
		beat(mine);
	},
	stood(mine) {
		letGo(mine);
		clearQuestion(mine);
	},
	verdicts(mine, { verdicts }) {
		mine.verdicts.push(...verdicts);
		showVerdicts(mine, mine.verdicts);
	},
	failed(mine, { text }) { setText(mine.problem, inLanguage(text)); },
	result(mine, { verdicts, sections, report, interrupted, late, lost }) {
		const count = (verdict) => verdicts.filter((one) => one.verdict === verdict).length;

		showVerdicts(mine, verdicts);
		setText(mine.counts, VERDICTS.slice(0, 3).map((verdict) => `${count(verdict)} ${VERDICT_WORDS[verdict]}`)
			.join(", "));
		mine.sections.show(sections);
		mine.save.onclick = () =>
			saveFile(`${mine.name}.commissioning-${nameTime()}.txt`, [report]);
		mine.result.hidden = false;
		setText(mine.now, lost ? t("The connection to the service was lost; it stops the drive.") :
			late ? t("Interrupted: this page was not heard in time, and the drive was stopped. What was seen is below.") :
			interrupted ? t("Interrupted: the drive was stopped. What was seen is below.") :
			t("Done. The motor has no power."));
	},
};

function showVerdicts(mine, verdicts) {
	const order = [...verdicts].sort((a, b) =>
		VERDICTS.indexOf(a.verdict) - VERDICTS.indexOf(b.verdict));

	mine.seen.hidden = order.length === 0;
	mine.rows.replaceChildren(...order.map((one) =>
		element("tr", { "data-setting": one.setting, "data-verdict": one.verdict },
			element("td", {}, element("span", { class: BADGES[one.verdict] ?? "badge" },
				VERDICT_WORDS[one.verdict] ?? one.verdict)),
			element("th", { scope: "row" }, one.setting), element("td", {}, one.now ?? ""),
			element("td", {}, inLanguage(one.how)), element("td", {}, one.right ?? ""))));
}

/* --- keys ------------------------------------------------------------------------------------- */

/* Escape stops it at any time; Space only during a motion, because it also presses buttons. */
function watchKeys(mine) {
	const listen = (target, event, listener, capture) => {
		target.addEventListener(event, listener, capture);
		mine.offs.push(() => target.removeEventListener(event, listener, capture));
	};

	listen(window, "keydown", (event) => {
		if (event.ctrlKey || event.altKey || event.metaKey ||
		    !(event.key === "Escape" || (event.key === " " && mine.beats)))
			return;
		event.preventDefault();
		event.stopPropagation();
		if (!event.repeat)
			mine.context.stop(mine.name, "stop");
	}, true);
	listen(window, "pagehide", () => end(mine));
	/* In a hidden page nobody watches the shaft. */
	listen(document, "visibilitychange", () => {
		if (document.hidden && mine.beats)
			end(mine);
	});
}
