/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of a new drive, step by step: from the drive that answers to the report on paper. Each step has
 * an address of its own (#/commission/DRIVE/STEP), and what is known is kept in this browser: a step can
 * be left and taken up again. What a step is, the modules commission_*.js say.
 */
import { call, getSession } from "./api.js";
import { createFound } from "./commission_found.js";
import { createHome } from "./commission_home.js";
import { createKeys } from "./commission_keys.js";
import { createLimits } from "./commission_limits.js";
import { STEPS, TRIALS, createRecord, keepRecord, listOpen, loadRecord, markStep, stateOf } from "./commission_record.js";
import { createReport } from "./commission_report.js";
import { createResponse } from "./commission_response.js";
import { createSaved } from "./commission_saved.js";
import { createTrial } from "./commission_trial.js";
import { STATES, STEP_WORDS } from "./commission_words.js";
import { element, icon, setAttribute, setText } from "./dom.js";
import { asLabel, createScale, formatFixed, hasBit } from "./format.js";
import { releaseWithPage } from "./hold_button.js";
import { nextStep } from "./next_step.js";
import { readSet } from "./parameter_beside.js";
import { stateWord } from "./plant.js";
import { askUser } from "./question.js";
import { t } from "./words.js";

const BADGES = { done: "badge on", wrong: "badge error" };
const PARTS = { found: createFound, home: createHome, limits: createLimits, response: createResponse,
	saved: createSaved, report: createReport };
/* In these the drive is moved from the page, and Space stops it wherever the focus is. */
const MOVES = ["home", "limits", "response"];
/* A configuration that was loaded is described again within this. */
const DESCRIBED_WITHIN_MS = 2000;

let view = null;

export function title(name) { return t("Commission {drive}", { drive: name ?? "" }).trim(); }

const addressOf = (name, step) => `#/commission/${encodeURIComponent(name)}/${step}`;

export async function show(root, context, name, step) {
	const path = { context, name, record: loadRecord(name), step: "", part: null, closed: false, offs: [] };

	view?.close();
	view = path;
	path.close = () => {
		path.closed = true;
		path.part?.close?.();
		path.offs.forEach((off) => off());
	};
	if (!context.may("engineer", name)) {
		root.append(element("p", { class: "empty" }, context.whyNot("engineer", name)));
		return;
	}
	path.step = STEPS.includes(step) ? step : listOpen(path.record)[0] ?? "report";
	await learn(path);
	if (path.closed)
		return;
	await build(path, root);
	if (path.closed) {
		path.part?.close?.();
		return;
	}
	watch(path);
}

export function hide() {
	view?.close();
	view = null;
}

/* --- what steps share ------------------------------------------------------------------------- */

/* What all steps need of the drive, and what they may do with the record. */
async function learn(path) {
	const { context, name, record } = path;
	const [registers, commands] = await Promise.all([context.registers(name), context.commands(name)]);

	/* A page that was just opened knows the drive's place only a moment later. */
	if (!context.plant.drives.has(name))
		await new Promise((resolve) => context.on("describe", resolve));
	const known = ["unit_name", "counts_per_unit", "spd", "identity", "capabilities"].filter((one) => registers.has(one));
	const { values } = await call("Read", { drive: name, names: known });

	Object.assign(path, {
		registers,
		commands,
		identity: values.identity ?? "",
		capabilities: values.capabilities,
		countsPerUnit: values.counts_per_unit,
		preset: values.spd ?? 0,
		scale: createScale(values.unit_name, values.counts_per_unit),
		drive: () => context.plant.drives.get(name),
		keep() {
			keepRecord(record);
			showPath(path);
		},
		mark(own, state, found) {
			markStep(record, own, { state, values: found, by: getSession().user ?? "", at: Date.now() });
			path.keep();
		},
		/* After a change of the configuration: when the page knows it. */
		again: () => new Promise((resolve) => {
			context.on("describe", resolve);
			setTimeout(resolve, DESCRIBED_WITHIN_MS);
		}).then(() => path.closed || context.showAgain()),
	});
	record.identity ||= path.identity;
	/* Without parameters that are known there is nothing to compare with, until the next look. */
	if (!record.before)
		record.before = (await readSet(context, name).catch(() => null))?.values ?? null;
	keepRecord(record);
}

/* Position, state, and what comes next: one line for all steps in which the drive moves. */
function createNow(path) {
	const { context, commands, name, registers, scale } = path;
	const state = element("span", { id: "commission-state", class: "state-word live" });
	const position = element("strong", { id: "commission-position", class: "live" });
	const homed = element("span", { id: "commission-homed", class: "badge" });
	const next = element("button", { id: "commission-next", class: "primary", type: "button", hidden: true,
		onclick: async () => {
			try {
				await call("Run", { drive: name, command: next.dataset.command });
			} catch (error) {
				context.report(error);
			}
		} });

	return {
		node: element("section", { class: "panel toolbar", "aria-label": t("Now") }, state, position, homed, next),
		update({ judgement, values }) {
			const register = registers.get("position");
			const isHomed = hasBit(registers.get("status"), values?.status, "homed");
			const command = nextStep(judgement, commands);

			setText(state, stateWord(judgement.state));
			setText(position, `${formatFixed(scale.show(register, values?.position), scale.decimals(register))} ` +
				scale.unit(register));
			setText(homed, isHomed ? t("homed") : t("not homed"));
			homed.className = isHomed ? "badge on" : "badge";
			next.hidden = !["enable", "clear_fault"].includes(command);
			if (!next.hidden) {
				next.dataset.command = command;
				setText(next, asLabel(command));
			}
		},
	};
}

/* --- the view --------------------------------------------------------------------------------- */

function makeHead({ context, name }) {
	return element("div", { class: "view-head" }, element("h1", {}, title(name)),
		element("a", { href: `#/drive/${encodeURIComponent(name)}` }, t("Drive {name}", { name })),
		element("span", { class: "push" }),
		element("button", { id: "commission-stop", class: "stop", type: "button", "aria-keyshortcuts": "Escape",
			onclick: () => context.stop(name, "stop") },
		icon("stop"), t("Stop"), element("kbd", {}, t("Esc"))));
}

function makePath(path) {
	path.marks = new Map(STEPS.map((step) => [step, element("span", { class: "badge" })]));
	path.said = element("p", { id: "commission-open", class: "muted", role: "status" });
	return element("nav", { id: "commission-path", class: "panel path", "aria-label": t("Steps") },
		element("ol", {}, STEPS.map((step) => element("li", { "data-step": step },
			element("a", { href: addressOf(path.name, step), "aria-current": step === path.step ? "step" : null },
				STEP_WORDS[step]), path.marks.get(step)))), path.said);
}

/* What is done, and what is not. */
function showPath({ record, marks, said, more, step: own }) {
	const open = listOpen(record);

	for (const [step, badge] of marks) {
		const state = stateOf(record, step);

		badge.className = BADGES[state] ?? "badge";
		badge.hidden = state === "open";
		setText(badge, STATES[state]);
		setAttribute(badge.parentElement, "data-state", state);
	}
	setText(said, open.length === 0 ? t("All steps are done or left out.") :
		t("Not done: {steps}", { steps: open.map((step) => STEP_WORDS[step]).join(", ") }));
	more.leave.hidden = own === "report" || stateOf(record, own) !== "open";
	more.next.classList.toggle("primary", own !== "report" && !open.includes(own));
}

/* To the next step, out of this one, or to the beginning. */
function makeMore(path) {
	const { context, name, step } = path;
	const next = STEPS[STEPS.indexOf(step) + 1];
	const go = (to) => { location.hash = addressOf(name, to); };
	const button = (id, words, onclick, properties = {}) => element("button",
		{ id: `commission-${id}`, type: "button", onclick, ...properties }, words);

	path.more = {
		next: button("on", next ? t("Go on: {step}", { step: STEP_WORDS[next] }) : "", () => go(next),
			{ hidden: !next }),
		leave: button("leave", t("Leave this step out"), () => {
			path.mark(step, "left", {});
			go(next);
		}),
	};
	return element("div", { id: "commission-more", class: "toolbar" }, path.more.next, path.more.leave,
		element("span", { class: "push" }),
		button("anew", t("Begin again"), async () => {
			if (await askUser({ title: t("Begin the commissioning of {drive} again?", { drive: name }),
				words: [t("What this browser has kept of it is lost. The drive and the configuration stay as they are.")],
				yes: t("Begin again") })) {
				keepRecord(createRecord(name, Date.now()));
				go("found");
				context.showAgain();
			}
		}));
}

async function build(path, root) {
	const { step } = path;
	const head = makeHead(path);
	const steps = makePath(path);
	const more = makeMore(path);
	const keys = step in TRIALS ? createKeys(path) : null;

	path.now = MOVES.includes(step) ? createNow(path) : null;
	path.part = await (step in TRIALS ? createTrial(path, step, keys.node, () => {
		keys.update();
		showPath(path);
	}) : PARTS[step](path));
	root.replaceChildren(head, steps, ...[path.now?.node, path.part.node, more].filter(Boolean));
	showPath(path);
}

/* --- what goes on ----------------------------------------------------------------------------- */

function update(path) {
	const drive = path.drive();

	if (!drive)
		return;
	path.now?.update(drive);
	path.part.update?.({ judgement: drive.judgement, values: drive.values, old: path.context.sayOld(),
		gone: ["lost", "down"].includes(path.context.link()) });
}

/*
 * Escape stops at any time. Space does where the drive is moved from here, and during the motion of a trial:
 * elsewhere it presses buttons. What takes the eyes or the hand away releases what is held.
 */
function watch(path) {
	const { context, name, step } = path;
	const release = () => path.part.release?.();
	const isOurs = ({ key, ctrlKey, altKey, metaKey }) => !ctrlKey && !altKey && !metaKey &&
		(key === "Escape" || (key === " " && (MOVES.includes(step) || path.part.isMoving?.())));
	const listen = (event, listener) => {
		window.addEventListener(event, listener, true);
		path.offs.push(() => window.removeEventListener(event, listener, true));
	};

	if (context.may("stop")) {
		listen("keydown", (event) => {
			if (!isOurs(event))
				return;
			event.preventDefault();
			event.stopPropagation();
			release();
			if (!event.repeat)
				context.stop(name, "stop");
		});
		/* Otherwise the release of the key would still press a button. */
		listen("keyup", (event) => {
			if (event.key === " " && MOVES.includes(step))
				event.preventDefault();
		});
	}
	path.offs.push(releaseWithPage(release));
	context.on("plant", () => update(path));
	context.on("link", (link) => {
		if (link !== "live")
			release();
		update(path);
	});
	context.on("describe", () => update(path));
	update(path);
}
