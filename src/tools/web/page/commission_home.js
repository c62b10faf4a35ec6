/* SPDX-License-Identifier: Apache-2.0 */
/* Where the drive counts from: it looks for its origin itself, or is told what its position is here. */
import { call } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { formatFine, hasBit, inWords, parseValue } from "./format.js";
import { whyNotNow } from "./next_step.js";
import { t } from "./words.js";

/* path: see commission.js. */
export function createHome(path) {
	const { commands, context, name, registers, scale } = path;
	const register = registers.get("target_position");
	const typed = scale.typed(register);
	const canHome = commands.has("home") && context.whyNotRun("home", name) === "";
	const home = element("button", { id: "home-run", class: "primary", type: "button", hidden: !canHome,
		onclick: () => run() }, t("Look for the origin"));
	const input = element("input", { id: "home-position", type: "text", inputmode: "decimal", autocomplete: "off",
		class: "short", value: "0" });
	const set = element("button", { id: "home-set", type: "button", class: canHome ? null : "primary",
		onclick: () => setHere() }, t("This is its position here"));
	const said = element("p", { id: "home-said", class: "muted", role: "status" });
	const problem = element("p", { class: "problem", role: "alert" });
	/* Since the button was pressed: "asked", then "seen" to look for its origin; "": nobody has asked. */
	let sought = "";
	let wasHomed = false;

	async function act(command, args) {
		setText(problem, "");
		try {
			const { result } = await call("Run", { drive: name, command, arguments: args });

			setText(said, `${inWords(command)}: ${inWords(result)}`);
			return true;
		} catch (error) {
			setText(problem, error.message);
			return false;
		}
	}

	async function run() {
		sought = "asked";
		if (!await act("home", {}))
			sought = "";
	}

	async function setHere() {
		const { value, problem: wrong } = parseValue(typed, input.value);

		input.setAttribute("aria-invalid", String(Boolean(wrong)));
		setText(problem, wrong ?? "");
		if (wrong || !await act("set_position", { target_position: scale.take(register, value) }))
			return;
		path.mark("home", "done", { how: "set_position", position: value, unit: typed.unit });
	}

	return {
		node: element("section", { id: "home", class: "panel", "aria-label": t("Home") },
			element("p", {}, canHome ?
				t("The drive can look for its origin itself, as its parameters say: it moves until its switch or stop is found. Escape and Space stop it.") :
				t("This drive does not look for an origin. Drive it to a place that you know, and say what its position is there.")),
			element("div", { class: "toolbar filters" }, home,
				createField(typed.unit ? t("Position, {unit}", { unit: typed.unit }) : t("Position"), input), set),
			said, problem),
		update({ judgement, values, old, gone }) {
			const why = whyNotNow("home", { judgement, old, gone });
			const isHomed = hasBit(registers.get("status"), values?.status, "homed");

			home.disabled = why !== "";
			set.disabled = judgement.state !== "Standstill" && judgement.state !== "Disabled";
			home.title = why;
			/* A drive that has lost its origin, or looks for it, is not homed meanwhile. */
			if (sought === "")
				wasHomed = isHomed;
			else if (judgement.state === "Homing" || isHomed !== wasHomed)
				sought = "seen";
			if (sought !== "seen" || judgement.state !== "Standstill")
				return;
			if (isHomed) {
				sought = "";
				path.mark("home", "done", { how: "home", unit: typed.unit,
					position: formatFine(scale.show(register, values.position), scale.step(register)) });
				setText(said, t("It has found its origin."));
			} else {
				sought = "";
				setText(said, t("It stands, and has not found its origin."));
			}
		},
	};
}
