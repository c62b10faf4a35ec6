/* SPDX-License-Identifier: Apache-2.0 */
/* A question that the user has to confirm before an action. */
import { element, newId } from "./dom.js";
import { t } from "./words.js";

/* Resolves with true for yes; Escape means no. */
export function askUser({ title, words, yes }) {
	const heading = newId("question");
	const dialog = element(
		"dialog",
		{ class: "question panel", "aria-labelledby": heading },
		element("h2", { id: heading }, title),
		words.map((text) => element("p", {}, text)),
		element(
			"form",
			{ method: "dialog", class: "toolbar" },
			element("button", { value: "no", autofocus: true }, t("Cancel")),
			element("button", { class: "primary", value: "yes" }, yes)
		)
	);

	document.body.append(dialog);
	dialog.showModal();
	return new Promise((resolve) =>
		dialog.addEventListener("close", () => {
			dialog.remove();
			resolve(dialog.returnValue === "yes");
		})
	);
}
