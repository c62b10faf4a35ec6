/* SPDX-License-Identifier: Apache-2.0 */
/* All commands of a drive, with fields for their arguments made from its registers. */
import { call, isStop } from "./api.js";
import { groupReasons, whyNotNow } from "./next_step.js";
import { element, newId, setAttribute, setText } from "./dom.js";
import { asLabel, formatDuration, formatRange, hasBits, inWords, NONE, parseValue } from "./format.js";
import { inLanguage, t } from "./words.js";

/* These have buttons of their own, which are always visible. */
const ELSEWHERE = ["stop", "quick_stop"];

/* A field for one argument. { node, read() }: { value }, { problem } or {} when it is empty. */
function createField(register, scale, describedBy) {
	const typed = scale.typed(register);
	const codes = hasBits(register) ? [] : Object.entries(register.codes ?? {});
	const id = newId("argument");
	const hint = newId("argument-hint");
	const name = { id, "data-argument": register.name };
	const input = codes.length > 0 ?
		element("select", name, element("option", { value: "" }, NONE),
			codes.map(([code, called]) => element("option", { value: code }, inWords(called)))) :
		element("input", { ...name, type: "text", inputmode: hasBits(register) ? "text" : "decimal",
			autocomplete: "off", spellcheck: "false", "aria-describedby": `${hint} ${describedBy}` });
	const node = element("label", { class: "field", for: id }, asLabel(register.name),
		element("span", { class: "with-unit" }, input,
			typed.unit ? element("span", { class: "unit" }, typed.unit) : null),
		element("small", { id: hint, class: "hint", title: inLanguage(register.description) },
			formatRange(typed)));

	return {
		node,
		mark(wrong) {
			setAttribute(input, "aria-invalid", String(wrong));
			if (wrong)
				input.focus();
		},
		read() {
			if (input.value.trim() === "")
				return {};
			const { value, problem } = parseValue(typed, input.value);

			return problem ? { problem } : { value: scale.take(register, value) };
		},
	};
}

/* The panel; onDone() is called when a command was accepted, and update() tells it the drive's state
 * (next_step.js). */
export function createCommands({ context, drive, registers, commands, scale, onDone }) {
	const said = element("p", { id: "command-result", class: "command-result", role: "status" });
	const known = [...commands.values()].filter((command) => !ELSEWHERE.includes(command.name));
	const all = known.filter((command) => context.whyNotRun(command.name, drive) === "");
	const denied = known.filter((command) => !all.includes(command));
	const others = all.filter((command) => command.arguments.length > 0);
	const buttons = all.filter((command) => command.arguments.length === 0).map((command) =>
		element("button", { type: "button", class: "small", title: inLanguage(command.description),
			"data-command": command.name, onclick: () => give(command.name, {}) },
		asLabel(command.name)));
	const select = element("select", { id: "command" }, others.map((command) =>
		element("option", { value: command.name }, asLabel(command.name))));
	const about = element("small", { id: newId("command-about"), class: "muted" });
	const place = element("div", { class: "command-fields" });
	const run = element("button", { id: "command-run", class: "primary", type: "submit" }, t("Run"));
	const form = element("form", { class: "command-form", autocomplete: "off" },
		element("label", { class: "field", for: "command" }, t("Command with values"), select),
		about, place, run);
	const node = element("section", { id: "commands", class: "panel", "aria-label": t("Commands") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Commands"))),
		element("div", { class: "command-buttons" }, buttons),
		others.length > 0 ? form : null, said, makeReasons());
	const notNow = element("p", { id: "commands-not-now", class: "muted" });
	let fields = new Map();
	let state = { judgement: {} };

	said.before(notNow);

	/* Which are not offered, and why. */
	function makeReasons() {
		const reasons = new Map();

		for (const { name } of denied) {
			const why = context.whyNotRun(name, drive);

			reasons.set(why, [...reasons.get(why) ?? [], asLabel(name)]);
		}
		return [...reasons].map(([why, names]) =>
			element("p", { class: "muted", "data-denied": true },
				`${names.join(", ")}: ${why}`));
	}

	function showFields() {
		const command = commands.get(select.value);

		setText(about, inLanguage(command.description));
		fields = new Map(command.arguments.map((name) => registers.get(name)).filter(Boolean)
			.map((register) => [register.name, createField(register, scale, about.id)]));
		place.replaceChildren(...[...fields.values()].map((field) => field.node));
		setText(said, "");
		update(state);
	}

	/* What cannot be done now is not offered, and says why. */
	function update(next) {
		const reasons = buttons.map((button) => {
			const name = button.dataset.command;
			const why = whyNotNow(name, next);

			button.disabled = why !== "";
			setAttribute(button, "title", why || inLanguage(commands.get(name).description));
			return [name, why];
		});
		const why = select.value ? whyNotNow(select.value, next) : "";

		state = next;
		run.disabled = why !== "";
		setText(notNow, groupReasons([...reasons, [select.value, why]]).join("; "));
	}

	function say(text, kind) {
		setText(said, text);
		setAttribute(said, "data-kind", kind);
	}

	async function give(name, args) {
		const began = performance.now();

		say(`${asLabel(name)} …`, "");
		try {
			const parameters = { drive, command: name, arguments: args };
			const answer = await (isStop("Run", parameters) ? context.stop(drive, name) :
				call("Run", parameters));
			const result = answer?.result ?? t("not confirmed");
			const took = formatDuration((performance.now() - began) * 1000);

			say(`${asLabel(name)}: ${inWords(result)} (${took})`, answer ? "ok" : "error");
			onDone(name);
		} catch (error) {
			fields.get(error.parameters?.name)?.mark(true);
			say(`${asLabel(name)}: ${error.message}`, "error");
		}
	}

	form.addEventListener("submit", (event) => {
		const args = {};

		event.preventDefault();
		for (const [name, field] of fields) {
			const { value, problem } = field.read();

			field.mark(Boolean(problem));
			if (problem) {
				say(`${asLabel(name)}: ${problem}`, "error");
				return;
			}
			if (value !== undefined)
				args[name] = value;
		}
		give(select.value, args);
	});
	select.addEventListener("change", showFields);
	if (others.length > 0)
		showFields();
	return { node, give, update };
}
