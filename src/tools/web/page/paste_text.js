/* SPDX-License-Identifier: Apache-2.0 */
import { element, setText } from "./dom.js";
import { t } from "./words.js";

/* A text to paste elsewhere. */
export function createPasteText(label) {
	const text = element("textarea", {
		readonly: true,
		"aria-label": label,
		spellcheck: "false"
	});
	const copy = element("button", { class: "small", type: "button" }, t("Copy"));
	const node = element(
		"div",
		{ class: "copied", hidden: true },
		element("div", { class: "panel-head" }, element("h3", {}, label), copy),
		text
	);

	copy.addEventListener("click", async () => {
		text.select();
		try {
			/* Exists only if the page was loaded over TLS. */
			await navigator.clipboard.writeText(text.value);
		} catch {
			document.execCommand("copy");
		}
		setText(copy, t("Copied"));
		setTimeout(() => setText(copy, t("Copy")), 2000);
	});
	return {
		node,
		show(words) {
			node.hidden = words === "";
			text.value = words;
			text.rows = Math.min(24, words.trimEnd().split("\n").length);
		}
	};
}
