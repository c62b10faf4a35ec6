/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that go to named positions one after the other while a button is held. The server runs it, and
 * stops the drives when the beats of this page end; this only makes the list and shows what happens.
 * The list is kept in this browser.
 */
import { sendSequenceBeat } from "./api.js";
import { element, icon, setText } from "./dom.js";
import { formatFixed, formatReal, inWords, parseValue } from "./format.js";
import { listenToHold } from "./hold_button.js";
import { createGrips } from "./jog.js";
import { recall, remember } from "./kept_choice.js";
import { t } from "./words.js";

const KEPT_AS = "sequence";
const STEPS_MOST = 32;
const WAIT_MOST_S = 600;
const WAIT = { type: "f32", min: 0, max: WAIT_MOST_S, unit: "s" };

/* What this browser has kept, without what is none: [{ drive, position, velocity, wait }]. Velocity in
 * the unit of target_velocity, 0: the drive's own; wait in seconds. Pure. */
export function readSteps(text) {
	let list;

	try {
		list = JSON.parse(text);
	} catch {
		return [];
	}
	return (Array.isArray(list) ? list : [])
		.filter((step) => typeof step?.drive === "string" && typeof step.position === "string" &&
			Number.isFinite(step.velocity) && step.wait >= 0 && step.wait <= WAIT_MOST_S)
		.slice(0, STEPS_MOST);
}

/* As the server takes it. Pure. */
export function writeSteps(steps) {
	return steps.map(({ drive, position, velocity, wait }) =>
		({ drive, position, velocity, wait_ms: Math.round(wait * 1000) }));
}

/* What the server says of a running sequence, as a sentence. Pure. */
export function sayProgress({ step, moves, wait_ms }, steps) {
	const { drive, position } = steps[step - 1] ?? {};

	if (!drive)
		return t("The last step has ended");
	if (moves)
		return t("Step {step} of {count}: {drive} goes to {position}", { step, count: steps.length, drive, position });
	return wait_ms > 0 ?
		t("Step {step} of {count}: begins in {count2} s", { step, count: steps.length, count2: formatFixed(wait_ms / 1000, 1) }) :
		t("Step {step} of {count}: begins", { step, count: steps.length });
}

/* The panel. Returns { node, release(), isHeld(), update(), add(step) }; the caller calls release when
 * focus, visibility or the link is lost, and update when the link or rights change. */
export function createSequence({ context }) {
	const mine = {
		context,
		steps: readSteps(recall(KEPT_AS, "[]")),
		list: element("ol", { id: "sequence-steps", class: "sequence-steps" }),
		said: element("p", { id: "sequence-state", class: "jog-state", role: "status" }),
		hold: element("button", { id: "sequence-hold", class: "hold primary", type: "button" },
			icon("forward"), t("Hold to run the sequence")),
		/* Of the press that the server has answered: it has the steps. */
		known: 0,
		answer: null,
		grips: null,
	};

	mine.grips = createGrips({
		send: (grip, beat, held) => sendBeat(mine, grip, beat, held !== 0),
		onChange: (state) => showGrip(mine, state),
	});
	listenToHold(mine.hold, { press: () => press(mine), release: () => mine.grips.release() });
	mine.hold.addEventListener("keydown", (event) => {
		if (event.key !== "Enter")
			return;
		event.preventDefault();
		if (!event.repeat)
			press(mine);
	});
	mine.hold.addEventListener("keyup", () => mine.grips.release());
	showSteps(mine);
	return {
		node: element("section", { id: "sequence", class: "panel", "aria-label": t("Sequence") },
			element("div", { class: "panel-head" }, element("h2", {}, t("Sequence"))),
			element("p", { class: "muted" }, t("The drives go from step to step while you hold the button. " +
				"Letting go stops all of them; so do Space and Escape, and leaving the page.")),
			mine.list, mine.hold, mine.said),
		release: () => mine.grips.release(),
		isHeld: () => mine.grips.isPressed(),
		update: () => update(mine),
		add(step) {
			change(mine, [...mine.steps, step]);
		},
	};
}

async function sendBeat(mine, grip, beat, held) {
	const answer = await sendSequenceBeat({ grip, beat, held,
		steps: held && mine.known !== grip ? writeSteps(mine.steps) : undefined });

	mine.known = grip;
	mine.answer = answer;
	return answer;
}

function press(mine) {
	if (!mine.hold.disabled && !mine.grips.isPressed())
		mine.grips.press(1);
}

function showGrip(mine, { velocity, held, why, text }) {
	mine.hold.classList.toggle("pressed", velocity !== 0);
	mine.hold.classList.toggle("held", held);
	if (velocity !== 0)
		setText(mine.said, held && mine.answer ? sayProgress(mine.answer, mine.steps) : t("Asking for it"));
	else if (why === "done")
		setText(mine.said, t("All steps are done."));
	else if (why)
		setText(mine.said, t("Ended: {why}. Let go, then press again.", { why: text || inWords(why) }));
	else
		setText(mine.said, t("Let go: stopped"));
	for (const [i, node] of [...mine.list.children].entries())
		node.classList.toggle("now", held && mine.answer?.step === i + 1);
}

function change(mine, steps) {
	mine.grips.release();
	mine.steps = steps.slice(0, STEPS_MOST);
	remember(KEPT_AS, JSON.stringify(mine.steps));
	showSteps(mine);
}

function makeNumber(label, value, typed, onTaken) {
	const input = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", class: "short",
		"aria-label": label, value });

	input.addEventListener("change", () => {
		const { value: taken, problem } = parseValue(typed, input.value || "0");

		input.setAttribute("aria-invalid", String(Boolean(problem)));
		if (!problem)
			onTaken(taken);
	});
	return input;
}

function makeStep(mine, step, i) {
	const put = (changed) => change(mine, mine.steps.with(i, { ...step, ...changed }));
	const move = (to) => {
		const others = mine.steps.toSpliced(i, 1);

		change(mine, others.toSpliced(to, 0, step));
	};
	const button = (label, words, disabled, onclick) => element("button",
		{ class: "small quiet", type: "button", "aria-label": label, disabled, onclick }, words);

	return element("li", {},
		element("span", {}, t("{drive} to {position}", { drive: step.drive, position: step.position })),
		element("label", {}, t("Speed "), makeNumber(t("Speed, empty for the drive's own"),
			step.velocity ? formatReal(step.velocity) : "", { type: "f32", unit: "" },
			(velocity) => put({ velocity: Math.abs(velocity) }))),
		element("label", {}, t("then wait "), makeNumber(t("Wait after it in seconds"), formatReal(step.wait),
			WAIT, (wait) => put({ wait })), " s"),
		button(t("Move step {count} up", { count: i + 1 }), "↑", i === 0, () => move(i - 1)),
		button(t("Remove step {count}", { count: i + 1 }), icon("close"), false, () => change(mine, mine.steps.toSpliced(i, 1))));
}

function showSteps(mine) {
	mine.list.replaceChildren(...mine.steps.map((step, i) => makeStep(mine, step, i)));
	update(mine);
}

/* Why it cannot run now; "": it can. */
function findReason({ context, steps }) {
	const denied = steps.map(({ drive }) => context.whyNot("move", drive)).find(Boolean);

	if (steps.length === 0)
		return t("Add steps with the buttons beside the positions.");
	if (context.sayOld())
		return t("What you see is old ({sayOld})", { sayOld: context.sayOld() });
	return denied ?? "";
}

function update(mine) {
	const why = findReason(mine);

	mine.hold.disabled = why !== "";
	if (!why)
		return;
	mine.grips.release();
	setText(mine.said, why);
}
