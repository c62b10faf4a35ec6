/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Trials of a drive in the steps of drivebridgectl commission. The server runs them
 * (src/tools/web/round.c); this shows its questions, and sends a keep-alive ten times a second while the
 * motor turns. When these stop, for whatever reason, the server stops the drive, and the trial ends.
 */
import { listCommissionSteps, openStream, sayToCommission } from "./api.js";
import { TRIALS, findTrial, listVerdicts, takeVerdicts } from "./commission_record.js";
import { VERDICT_WORDS } from "./commission_words.js";
import { createField, element, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { formatReal, parseValue } from "./format.js";
import { createPasteText } from "./paste_text.js";
import { inLanguage, t } from "./words.js";

const BEAT_EVERY_MS = 100;
/* Further unanswered beats would only take connections from the stop. */
const BEATS_AT_ONCE = 2;
const ALIVE_EVERY_MS = 1000;
/* The worst first. */
const VERDICTS = ["contradicted", "proven", "not seen", "does not apply"];
/* Answers in words; the server takes them as they are. */
const ANSWERS = { "yes": t("yes"), "no": t("no"), "skip": t("skip"), "clockwise": t("clockwise"),
	"counterclockwise": t("counterclockwise"), "none": t("not at all"), "ramp": t("ramp"), "at-once": t("at once"),
	"coasts": t("coasts"), "runs": t("runs on"), "turned": t("turned"), "done": t("done") };
const BADGES = { contradicted: "badge error", proven: "badge on" };

/*
 * The part of the path for one of its steps that is a trial. path: { context, name, record, keep(), mark(step,
 * state, values), … } of commission.js; keys is the node for
 * values that the configuration should have; onSeen() is called when there is something new in the record.
 * Resolves with { node, close(), isMoving() }.
 */
export async function createTrial(path, own, keys, onSeen) {
	const mine = { path, context: path.context, name: path.name, own, keys, onSeen, stream: null, timer: 0, motion: 0,
		beats: 0, underWay: 0, offs: [] };

	build(mine, await listCommissionSteps());
	watchPage(mine);
	return {
		node: mine.node,
		isMoving: () => mine.beats !== 0,
		close() {
			end(mine);
			mine.offs.forEach((off) => off());
		},
	};
}

/* --- the list of steps
 * ------------------------------------------------------------------------- */

function createNumber(id, label, hint) {
	const input = element("input", { id, type: "text", inputmode: "decimal", autocomplete: "off",
		placeholder: hint });

	return { input, field: createField(label, input) };
}

function build(mine, steps) {
	const only = TRIALS[mine.own];

	mine.step = element("select", { id: "commission-step" },
		only ? null : element("option", { value: "" }, t("All steps")),
		steps.filter(({ step }) => !only || step === only).map(({ step, description }) =>
			element("option", { value: step }, `${step}: ${inLanguage(description)}`)));
	mine.velocity = createNumber("commission-velocity", t("Velocity of trial motions"), "slow");
	mine.seconds = createNumber("commission-seconds", t("Seconds of one (0.2 to 5)"), formatReal(1.5));
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
	mine.node = element("div", { class: "view-part" },
		element("section", { class: "panel", "aria-label": t("Begin") },
			element("p", {}, element("strong", {}, t("Uncouple the drive from the machine first. ")),
				t("The motor is turned, slowly and for moments, and you are asked what you saw. Escape stops it, and so does leaving this page; in the end it has no power.")),
			element("div", { class: "toolbar filters" }, createField(t("Steps"), mine.step),
				mine.velocity.field, mine.seconds.field, mine.begin)),
		element("section", { id: "commission", class: "panel", "aria-label": t("Now") },
			mine.now, mine.question, mine.answers, mine.problem),
		mine.seen, mine.keys, mine.result);
	setText(mine.now, t("Nothing goes on."));
	showVerdicts(mine);
}

/* --- a running commissioning
 * ------------------------------------------------------------------- */

/* A typed number as { value }, or { problem }. Above 0 is for the server to check. */
export function readNumber(typed, numbers) { return parseValue({ type: "f32" }, typed, numbers); }

/*
 * The order for the server, { order }, or { problem }: typed is { step, velocity, seconds }, of which only what is not
 * empty is sent. Something else than what was typed must turn no motor: the server has a velocity of its own.
 */
export function readOrder(drive, { step, ...typed }, numbers) {
	const order = step ? { drive, step } : { drive };

	for (const [key, text] of Object.entries(typed)) {
		if (text.trim() === "")
			continue;
		const { value, problem } = readNumber(text, numbers);

		if (problem)
			return { problem };
		order[key] = value;
	}
	return { order };
}

function begin(mine) {
	const { order, problem } = readOrder(mine.name,
		{ step: mine.step.value, velocity: mine.velocity.input.value, seconds: mine.seconds.input.value });

	setText(mine.problem, problem ?? "");
	if (problem)
		return;
	mine.begin.disabled = true;
	mine.result.hidden = true;
	setText(mine.now, t("Asking the drive …"));
	mine.stream = openStream("commission", order, {
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
	const { value, problem } = readNumber(typed);

	if (problem)
		setText(mine.problem, problem);
	else
		answer(mine, question, String(value));
}

async function answer(mine, question, text) {
	if (await say(mine, { question, answer: text })) {
		setText(mine.problem, "");
		/* Unless the next question is already shown. */
		if (mine.asked === question)
			clearQuestion(mine);
	}
}

function writeAnswer(choice) {
	const words = ANSWERS[choice] ?? choice;

	return words.charAt(0).toUpperCase() + words.slice(1);
}

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
			onclick: () => answer(mine, question, choice) }, writeAnswer(choice));

		mine.asked = question;
		setText(mine.question, inLanguage(text));
		mine.answers.replaceChildren(...(choices ?
			choices.filter((choice) => choice !== "skip").map(make) :
			[input, element("button", { type: "button", class: "primary", "data-answer": "number",
				onclick: () => answerNumber(mine, question, input.value) },
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
	verdicts(mine, { step, verdicts }) {
		const { record, context, name } = mine.path;

		takeVerdicts(record, step, verdicts, context.plant.drives.get(name)?.bus);
		if (verdicts.some(({ verdict }) => verdict === "proven" || verdict === "contradicted"))
			mine.path.mark(findTrial(step), "done", {});
		mine.path.keep();
		showVerdicts(mine);
		mine.onSeen();
	},
	failed(mine, { text }) { setText(mine.problem, inLanguage(text)); },
	result(mine, { verdicts, sections, report, interrupted, late, lost }) {
		const count = (verdict) => verdicts.filter((one) => one.verdict === verdict).length;

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

/* Of this part of the path, the worst first; also of a trial before the page was loaded again. */
function showVerdicts(mine) {
	const order = listVerdicts(mine.path.record, mine.own)
		.sort((a, b) => VERDICTS.indexOf(a.verdict) - VERDICTS.indexOf(b.verdict));

	mine.seen.hidden = order.length === 0;
	mine.rows.replaceChildren(...order.map((one) =>
		element("tr", { "data-setting": one.setting, "data-verdict": one.verdict },
			element("td", {}, element("span", { class: BADGES[one.verdict] ?? "badge" },
				VERDICT_WORDS[one.verdict] ?? one.verdict)),
			element("th", { scope: "row" }, one.setting), element("td", {}, one.now ?? ""),
			element("td", {}, inLanguage(one.how)), element("td", {}, inLanguage(one.right ?? "")))));
}

/* A page that is left ends it; in a hidden one nobody watches the shaft. */
function watchPage(mine) {
	const listen = (target, event, listener) => {
		target.addEventListener(event, listener);
		mine.offs.push(() => target.removeEventListener(event, listener));
	};

	listen(window, "pagehide", () => end(mine));
	listen(document, "visibilitychange", () => {
		if (document.hidden && mine.beats)
			end(mine);
	});
}
