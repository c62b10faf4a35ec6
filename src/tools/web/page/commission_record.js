/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is known of the commissioning of a drive: its steps with their values, who did them and when. It
 * is kept in this browser, so that a step can be left and taken up again. Pure but for loadRecord,
 * keepRecord and dropRecord.
 */
import { recall, remember } from "./kept_choice.js";

/* The path, in its order. */
export const STEPS = ["found", "direction", "scale", "trials", "home", "limits", "response", "saved", "report"];
/* Those that are trials of the server, with the step that they run; "": any. */
export const TRIALS = { direction: "motion", scale: "scale", trials: "" };
/* More points of a plot say nothing more on paper, and fill the browser's store. */
const POINTS_MOST = 300;

const nameOf = (drive) => `commission ${drive}`;

export function createRecord(drive, now) {
	return {
		drive,
		identity: "",
		begun: now,
		/* Of each step { state: "done" or "left", at, by, values }. */
		steps: {},
		/* Parameters by name, when it was begun. */
		before: null,
		verdicts: [],
		/* Values for the configuration, [{ kind, name, key, value, at, by }]; at is 0 until it is written. */
		keys: [],
		/* Parameters that are tried now, with the values of before; null: none. */
		tried: null,
		/* Answers to a step, the newest first. */
		responses: [],
	};
}

/* From its text; a new one where that is none. */
export function readRecord(text, drive, now) {
	const made = createRecord(drive, now);
	let record;

	try {
		record = JSON.parse(text);
	} catch {
		return made;
	}
	const isRight = record?.drive === drive && Number.isFinite(record.begun) &&
		[record.verdicts, record.keys, record.responses].every(Array.isArray) &&
		typeof record.steps === "object" && record.steps !== null;

	return isRight ? { ...made, ...record } : made;
}

export function loadRecord(drive) { return readRecord(recall(nameOf(drive), ""), drive, Date.now()); }

export function keepRecord(record) { remember(nameOf(record.drive), JSON.stringify(record)); }

export function dropRecord(drive) { remember(nameOf(drive), ""); }

/* --- what was seen ---------------------------------------------------------------------------- */

/* The step of the path to which a step of the server belongs. */
export function findTrial(step) { return Object.keys(TRIALS).find((one) => TRIALS[one] === step) ?? "trials"; }

export function listVerdicts(record, own) {
	return record.verdicts.filter(({ step }) => findTrial(step) === own);
}

/* The verdicts of one step of the server's replace those of before, and what they say is right is for
 * the configuration. bus: that of the drive. */
export function takeVerdicts(record, step, verdicts, bus) {
	record.verdicts = [...record.verdicts.filter((one) => one.step !== step), ...verdicts];
	for (const { section, setting, right, verdict } of verdicts) {
		if (section && verdict === "contradicted" && typeof right === "string")
			wantKey(record, { kind: section, name: section === "bus" ? bus : record.drive, key: setting,
				value: right });
	}
}

/* A value for the configuration, which is not written yet. */
export function wantKey(record, { kind, name, key, value }) {
	record.keys = [...record.keys.filter((one) => one.kind !== kind || one.key !== key),
		{ kind, name, key, value, at: 0, by: "" }];
}

export function listWanted(record, names) {
	return record.keys.filter(({ key, at }) => at === 0 && (!names || names.includes(key)));
}

/* By a value that is in the configuration now; the user may have written a rounder one. */
function isPutRight(record, { section, setting }) {
	return record.keys.some(({ kind, key, at }) => kind === section && key === setting && at > 0);
}

/* --- steps ------------------------------------------------------------------------------------ */

export function markStep(record, step, { state, values = {}, by, at }) {
	record.steps[step] = { state, values, by, at };
}

/* Of a step: "open", "left", "done", or "wrong": something of it has to be put right. */
export function stateOf(record, step) {
	const isWrong = listVerdicts(record, step).some((one) => one.verdict === "contradicted" &&
		!isPutRight(record, one));

	if (step === "report")
		return listOpen(record).length === 0 ? "done" : "open";
	if (isWrong || (step === "response" && record.tried))
		return "wrong";
	return record.steps[step]?.state ?? "open";
}

/* The steps that are neither done nor left out, without the report. */
export function listOpen(record) {
	return STEPS.filter((step) => step !== "report" && ["open", "wrong"].includes(stateOf(record, step)));
}

/* --- plots ------------------------------------------------------------------------------------ */

/* As few points as a plot needs, with the first and the last one. */
export function thin(times, values) {
	const every = Math.max(1, Math.ceil(times.length / POINTS_MOST));
	const isKept = (_, i) => i % every === 0 || i === times.length - 1;

	return { times: times.filter(isKept), values: values.filter(isKept) };
}
