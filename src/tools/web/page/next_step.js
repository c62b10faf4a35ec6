/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What can be done with a drive in its present state, and what comes next. The service decides by
 * itself; this only spares people a press that it would refuse.
 */
import { inWords } from "./format.js";
import { t } from "./words.js";

/* Commands that begin a motion. */
const MOVES = /^(move_|jog_|home$|shake_start|start_program|continue_program|single_step)/;
/* These end something, and are never withheld. */
const ENDS = /(^|_)(stop|disable|pause_program|end_program)$/;

export function isMotion(command) { return MOVES.test(command); }

/*
 * Why a command cannot be given now; "" if it can. judgement: of the drive; old: how old what is shown is in
 * words, "" if it is not; gone: nothing can be sent. Pure.
 */
export function whyNotNow(command, { judgement, old = "", gone = false }) {
	const { state, shape, cause } = judgement;

	if (ENDS.test(command))
		return "";
	if (gone)
		return t("there is no connection");
	if (isMotion(command) && old)
		return t("what you see is old ({old})", { old });
	if (state === "Offline")
		return t("the drive does not answer");
	if (isMotion(command) && shape === "error")
		return t("clear the fault first");
	if (isMotion(command) && state === "Disabled")
		return t("enable the drive first");
	if (command === "enable" && ["Standstill", "DiscreteMotion", "ContinuousMotion", "Homing"]
		.includes(state) && shape !== "error")
		return t("it is enabled already");
	if (command === "clear_fault" && state && shape !== "error" && !cause)
		return t("there is no fault");
	return "";
}

/* The command that comes next in this state: clear_fault, enable, home, or "" for none. Pure. */
export function nextStep({ state, shape, cause }, commands) {
	const steps = [];

	if (state === "" || state === "Offline")
		return "";
	if (shape === "error")
		steps.push("clear_fault");
	else if (state === "Disabled")
		steps.push("enable");
	else if (cause === "origin_lost" && state === "Standstill")
		steps.push("home");
	return steps.find((command) => commands.has(command)) ?? "";
}

/* "Move absolute, home: enable the drive first": each reason once. Pure. */
export function groupReasons(reasons) {
	const groups = new Map();

	for (const [command, why] of reasons) {
		if (why)
			groups.set(why, [...groups.get(why) ?? [], inWords(command)]);
	}
	return [...groups].map(([why, names]) => `${names.join(", ")}: ${why}`);
}
