/* SPDX-License-Identifier: Apache-2.0 */
/* What was found is kept: parameters in the drive, keys in the configuration. */
import { call } from "./api.js";
import { createKeys } from "./commission_keys.js";
import { listWanted } from "./commission_record.js";
import { element, setText } from "./dom.js";
import { hasBit, inWords } from "./format.js";
import { t } from "./words.js";

/* path: see commission.js. */
export function createSaved(path) {
	const { commands, context, name, record, registers } = path;
	const canSave = commands.has("save_parameters");
	const why = canSave ? context.whyNotRun("save_parameters", name) : "";
	const unsaved = element("p", { id: "saved-unsaved", role: "status" });
	const problem = element("p", { class: "problem", role: "alert" }, why);
	const save = element("button", { id: "saved-save", class: "primary", type: "button", hidden: !canSave || why !== "",
		onclick: () => run() }, t("Save the parameters in the drive"));
	const done = element("button", { id: "saved-done", type: "button", hidden: canSave,
		onclick: () => finish("") }, t("All is saved"));
	const keys = createKeys(path);

	function finish(result) {
		path.mark("saved", "done", { result });
		showRest();
	}

	async function run() {
		save.disabled = true;
		setText(problem, "");
		try {
			const { result } = await call("Run", { drive: name, command: "save_parameters", until_end: true });

			setText(unsaved, t("{drive}: save_parameters: {result}", { drive: name, result: inWords(result) }));
			finish(result);
		} catch (error) {
			setText(problem, error.message);
		}
		save.disabled = false;
	}

	function showRest() {
		if (record.tried)
			setText(problem, t("Parameters are tried and neither kept nor put back: see the step response."));
		else if (listWanted(record).length > 0)
			setText(problem, t("The configuration does not have all values yet."));
		else
			setText(problem, why);
	}

	showRest();
	return {
		node: element("div", { class: "view-part" },
			element("section", { id: "saved", class: "panel", "aria-label": t("Saved") },
				element("p", {}, canSave ?
					t("What was written into the drive is lost at power-off until it is saved there.") :
					t("This family has no command that saves its parameters: what it keeps without power, its manual says.")),
				unsaved, element("div", { class: "toolbar" }, save, done), problem), keys.node),
		update({ values }) {
			if (canSave && !save.disabled && hasBit(registers.get("status"), values?.status, "params_unsaved"))
				setText(unsaved, t("not saved in the drive: lost at power-off"));
		},
	};
}
