/* SPDX-License-Identifier: Apache-2.0 */
/* The words of the path of a new drive, for its view and its report. */
import { t } from "./words.js";

export const STEP_WORDS = {
	found: t("Found"),
	direction: t("Direction"),
	scale: t("Counts per unit"),
	trials: t("Other trials"),
	home: t("Home"),
	limits: t("Limits"),
	response: t("Step response"),
	saved: t("Saved"),
	report: t("Report"),
};
export const STATES = { open: t("not done"), done: t("done"), left: t("left out"), wrong: t("to be put right") };
export const VERDICT_WORDS = { "contradicted": t("contradicted"), "proven": t("proven"),
	"not seen": t("not seen"), "does not apply": t("does not apply") };
