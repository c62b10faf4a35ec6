/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Values that steps have found for the configuration: written into it here where that is allowed (control {
 * edit = on }), else shown as a text for the file.
 */
import { call, getSession } from "./api.js";
import { listWanted } from "./commission_record.js";
import { loadConfiguration, saveConfiguration } from "./config_change.js";
import { element, setText } from "./dom.js";
import { createPasteText } from "./paste_text.js";
import { setKeys, writeSection } from "./section_keys.js";
import { t } from "./words.js";

/* [{ kind, name, keys }], a section each. */
function groupBySection(wanted) {
	return ["bus", "drive"].map((kind) => wanted.filter((one) => one.kind === kind))
		.filter((keys) => keys.length > 0)
		.map((keys) => ({ kind: keys[0].kind, name: keys[0].name, keys }));
}

/* The text with all of them; null: a section is in another file. */
function setAll(text, wanted) {
	return groupBySection(wanted).reduce((changed, { kind, name, keys }) =>
		changed === null ? null : setKeys(changed, kind, name, keys), text);
}

/* Why they cannot be written from here; "": they can. */
async function findReason(path, wanted) {
	const why = path.context.whyNot("manage");

	if (why)
		return { why };
	const answer = await call("Configuration");
	const text = setAll(answer.text, wanted);

	if (!answer.may_edit)
		return { why: t("The configuration is not edited from the page here (control { edit = on } allows that).") };
	return text === null ? { why: t("The section is not in the part that is edited here ({path}).", { path: answer.path }) } :
		{ why: "", text, answer };
}

/* path: see commission.js; names: only these keys. Returns { node, update() }: after a change of the
 * record. */
export function createKeys(path, names) {
	const { record } = path;
	const list = element("dl", { class: "values" });
	const problem = element("p", { class: "problem", role: "alert" });
	const paste = createPasteText(t("For the configuration, then drivebridgectl reload"));
	const written = element("button", { id: "keys-written", type: "button", hidden: true,
		onclick: () => finish() }, t("It is in the file now"));
	const button = element("button", { id: "keys-write", class: "primary", type: "button",
		onclick: () => write() }, t("Write it into the configuration"));
	const node = element("section", { id: "keys", class: "panel", "aria-label": t("For the configuration") },
		element("h2", {}, t("For the configuration")), list,
		element("div", { class: "toolbar" }, button, written), problem, paste.node);

	function finish() {
		for (const one of listWanted(record, names))
			Object.assign(one, { at: Date.now(), by: getSession().user ?? "" });
		path.keep();
		return path.again();
	}

	async function write() {
		const wanted = listWanted(record, names);

		button.disabled = true;
		setText(problem, "");
		try {
			const { why, text, answer } = await findReason(path, wanted);

			if (why) {
				setText(problem, why);
				paste.show(groupBySection(wanted).map(({ kind, name, keys }) => writeSection(kind, name, keys)).join(""));
				written.hidden = false;
			} else if (await saveConfiguration({ ...answer, text }, t("Save this configuration and load it?")) &&
			    await loadConfiguration(path.context)) {
				await finish();
			}
		} catch (error) {
			setText(problem, error.message);
		}
		button.disabled = false;
	}

	function makeRow(one) {
		const { kind, name, key, value } = one;
		const input = element("input", { type: "text", class: "short", autocomplete: "off", "data-key": key, value,
			"aria-label": t("{key}, the value that is written", { key }) });

		/* A rounder one than a ruler gives; the service's checker judges it. */
		input.addEventListener("change", () => {
			one.value = input.value.trim() || value;
			input.value = one.value;
			path.keep();
		});
		return element("div", {}, element("dt", {}, `${kind} ${name}: ${key}`), element("dd", {}, input));
	}

	function update() {
		const wanted = listWanted(record, names);

		node.hidden = wanted.length === 0;
		list.replaceChildren(...wanted.map(makeRow));
	}

	update();
	return { node, update };
}
