/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All commands of a drive, with fields for their arguments made from its registers; and their
 * results from the drive's own history, for all clients.
 */
import { call, isStop } from "./api.js";
import { element, newId, setAttribute, setText } from "./dom.js";
import { asLabel, formatAddress, formatDuration, formatRange, formatReal, formatTime, formatValue,
	hasBits, inWords, NONE, parseValue } from "./format.js";

const HISTORY_SHOWN = 12;
/* These have buttons of their own, which are always visible. */
const ELSEWHERE = ["stop", "quick_stop"];
/* The value of control_holder and history1_ipv4 for a client without an IPv4 address. */
const NO_IPV4 = 0xffffffff;

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
		element("small", { id: hint, class: "hint", title: register.description },
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

/* The panel; onDone() is called when a command was accepted. */
export function createCommands({ context, drive, registers, commands, scale, onDone }) {
	const said = element("p", { id: "command-result", class: "command-result", role: "status" });
	const known = [...commands.values()].filter((command) => !ELSEWHERE.includes(command.name));
	const all = known.filter((command) => context.whyNotRun(command.name, drive) === "");
	const denied = known.filter((command) => !all.includes(command));
	const others = all.filter((command) => command.arguments.length > 0);
	const buttons = all.filter((command) => command.arguments.length === 0).map((command) =>
		element("button", { type: "button", class: "small", title: command.description,
			"data-command": command.name, onclick: () => give(command.name, {}) },
		asLabel(command.name)));
	const select = element("select", { id: "command" }, others.map((command) =>
		element("option", { value: command.name }, asLabel(command.name))));
	const about = element("small", { id: newId("command-about"), class: "muted" });
	const place = element("div", { class: "command-fields" });
	const run = element("button", { id: "command-run", class: "primary", type: "submit" }, "Run");
	const form = element("form", { class: "command-form", autocomplete: "off" },
		element("label", { class: "field", for: "command" }, "Command with values", select),
		about, place, run);
	const node = element("section", { id: "commands", class: "panel", "aria-label": "Commands" },
		element("div", { class: "panel-head" }, element("h2", {}, "Commands")),
		element("div", { class: "command-buttons" }, buttons),
		others.length > 0 ? form : null, said, makeReasons());
	let fields = new Map();

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

		setText(about, command.description);
		fields = new Map(command.arguments.map((name) => registers.get(name)).filter(Boolean)
			.map((register) => [register.name, createField(register, scale, about.id)]));
		place.replaceChildren(...[...fields.values()].map((field) => field.node));
		setText(said, "");
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
			const result = answer?.result ?? "not confirmed";
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
	return { node, give };
}

/* --- history ---------------------------------------------------------------------------------- */

/*
 * Entry `number` (1 is the newest) of a drive's history as { time_us, sequence, command, args,
 * result, duration_us, client, repeats }, null when there is none. The registers' descriptions tell
 * which register holds which argument. Pure.
 */
export function readHistory(values, number, registers, commands, scale) {
	const value = (field) => values[`history${number}_${field}`];

	if (!value("timestamp_us"))
		return null;
	const name = registers.get("history1_command")?.codes?.[value("command")];
	const fields = ["position", "position_2", "real", "number", "value"];
	const args = (commands.get(name)?.arguments ?? []).map((argument) => {
		const field = fields.find((candidate) => registers.get(`history1_${candidate}`)?.description
			.split(/[\s;:]+/).includes(argument));
		const register = registers.get(argument);

		if (!field || !register)
			return null;
		if (!scale.isScaled(register)) {
			const { text, unit } = formatValue(register, value(field));

			return `${inWords(argument)} ${text}${unit ? ` ${unit}` : ""}`;
		}
		return `${inWords(argument)} ${formatReal(scale.show(register, value(field)))} ${scale.unit(register)}`;
	}).filter(Boolean);
	const written = value("command") === 0 ? [...registers.values()].find((register) =>
		register.parameter && register.address === value("number")) : null;

	return {
		time_us: value("timestamp_us"),
		sequence: value("sequence"),
		command: name ? inWords(name) : written ? `write ${written.name}` : "parameter write",
		args: args.join(", "),
		result: inWords(registers.get("result")?.codes?.[value("result")] ?? String(value("result"))),
		duration_us: value("duration_us"),
		client: formatClient(value("ipv4"), value("port"), value("address"), value("user")),
		repeats: value("repeats"),
	};
}

/* "192.168.10.5:49152", "control, user anna, session 5", "control, user drivebridge-web for anna,
 * session 5", "drivebridged" for actions of the bridge itself. */
export function formatClient(ipv4, port, address = "", user = "") {
	if (ipv4 === 0)
		return "drivebridged";
	if (ipv4 !== NO_IPV4)
		return `${formatAddress(ipv4)}:${port}`;
	return address && !address.startsWith("control") ? `${address} port ${port}` :
		`${address || "control socket"}${user ? ` for ${user}` : ""}, session ${port}`;
}

export function historyNames(registers) {
	const names = [];

	for (let number = 1; number <= HISTORY_SHOWN; number++) {
		for (const field of ["timestamp_us", "sequence", "ipv4", "port", "command", "result", "duration_us", "position",
			"position_2", "real", "number", "repeats", "value", "address", "user"]) {
			if (registers.has(`history${number}_${field}`))
				names.push(`history${number}_${field}`);
		}
	}
	return names;
}

function makeEntry(entry) {
	const kind = entry.result === "ok" ? "" :
		["pending", "unproven", "none"].includes(entry.result) ? "on" : "warning";
	const repeats = entry.repeats > 0 ? element("span", { class: "muted" }, ` ×${entry.repeats + 1}`) :
		null;

	return element("tr", { "data-sequence": entry.sequence },
		element("td", { class: "nowrap" }, formatTime(entry.time_us)),
		element("th", { scope: "row" }, asLabel(entry.command), repeats),
		element("td", {}, entry.args),
		element("td", {}, element("span", { class: `badge ${kind}` }, entry.result)),
		element("td", { class: "number" }, formatDuration(entry.duration_us)),
		element("td", { class: "muted nowrap" }, entry.client));
}

/* The panel; refresh() reads the history again. */
export function createHistory({ drive, registers, commands, scale }) {
	const body = element("tbody");
	const heads = ["Time", "Command", "Values", "Result", "Took", "Client"].map((head) =>
		element("th", { scope: "col", class: head === "Took" ? "number" : null }, head));
	const node = element("section", { id: "history", class: "panel",
		"aria-label": "History of commands" },
	element("div", { class: "panel-head" }, element("h2", {}, "History of commands"),
		element("span", { class: "muted" }, "of all clients, the newest first")),
	element("div", { class: "table-frame", tabindex: "0", role: "region",
		"aria-label": "Table of commands" },
	element("table", { class: "history" },
		element("thead", {}, element("tr", {}, heads)), body)));
	const names = historyNames(registers);
	let reading = false;
	let again = false;

	async function refresh() {
		again = reading;
		if (reading)
			return;
		reading = true;
		try {
			const { values } = await call("Read", { drive, names });
			const rows = Array.from({ length: HISTORY_SHOWN }, (none, index) =>
				readHistory(values, index + 1, registers, commands, scale))
				.filter(Boolean).map(makeEntry);

			if (rows.length === 0)
				rows.push(element("tr", {}, element("td", { colspan: "6", class: "empty" },
					"No commands yet.")));
			body.replaceChildren(...rows);
		} catch {
			/* Tried again with the next command. */
		}
		reading = false;
		if (again)
			refresh();
	}

	return { node, refresh };
}
