/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a drive was told, from its own history, for all clients: commands with their arguments,
 * parameters with their values before and after, and by whom.
 *
 * The history itself does not have the values before; the audit trail has them, for those who may
 * read it.
 */
import { askAudit, call } from "./api.js";
import { element } from "./dom.js";
import { asLabel, formatAddress, formatDuration, formatFine, formatTime, formatValue, formatWithUnit,
	inWords } from "./format.js";
import { hasTrait } from "./parameter_set.js";
import { t } from "./words.js";

const HISTORY_SHOWN = 12;
/* The value of control_holder and history1_ipv4 for a client without an IPv4 address. */
const NO_IPV4 = 0xffffffff;
/* A record of the trail is of an entry if their times differ by no more than this. */
const ASKED_MOST = 3;
const ASK_AGAIN_MS = 1000;
const SAME_WITHIN_US = 5e6;

/* A register's value from its bits in a word of 32. */
export function fromBits(register, bits) {
	const view = new DataView(new ArrayBuffer(4));

	view.setUint32(0, bits >>> 0);
	switch (register.type) {
	case "f32":
		return view.getFloat32(0);
	case "i32":
		return view.getInt32(0);
	case "i16":
		return view.getInt16(2);
	case "u16":
	case "bits16":
		return view.getUint16(2);
	case "bool":
		return bits !== 0;
	default:
		return bits;
	}
}

/* A parameter that was written: { register, value }, value undefined if it is secret. */
function readWritten(value, registers) {
	const register = value("command") === 0 ? [...registers.values()].find((one) =>
		one.parameter && one.address === value("number")) : null;

	return register ? {
		register,
		value: hasTrait(register, "secret") || typeof value("value") !== "number" ? undefined :
			fromBits(register, value("value"))
	} : null;
}

/*
 * Entry `number` (1 is the newest) of a drive's history as { time_us, sequence, command, written, args,
 * result, duration_us, user, client, repeats }, null when there is none; written is of a parameter. The registers' descriptions tell
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
		return `${inWords(argument)} ${formatFine(scale.show(register, value(field)), scale.step(register))} ${scale.unit(register)}`;
	}).filter(Boolean);
	const written = readWritten(value, registers);

	return {
		time_us: value("timestamp_us"),
		sequence: value("sequence"),
		command: name ? inWords(name) : written ? t("write {name}", { name: written.register.name }) :
			t("parameter write"),
		written,
		args: written && written.value !== undefined ?
			formatWithUnit(written.register, written.value) : args.join(", "),
		result: registers.get("result")?.codes?.[value("result")] ?? String(value("result")),
		duration_us: value("duration_us"),
		user: value("user") ?? "",
		client: formatClient(value("ipv4"), value("port"), value("address"), value("user")),
		repeats: value("repeats"),
	};
}

/* What the tools' own users are, for people. */
const TOOLS = { "drivebridge-web": t("page"), "drivebridge-opcua": "OPC UA", "drivebridge-mqtt": "MQTT" };

/* "192.168.10.5 (Modbus, port 49152)", "user anna of the gateway (session 5)", "anna (page, session
 * 5)"; "the service itself". */
export function formatClient(ipv4, port, address = "", user = "") {
	const local = /^control, user (.+)$/.exec(address)?.[1];

	if (ipv4 === 0)
		return t("the service itself");
	if (ipv4 !== NO_IPV4)
		return t("{ipv4} (Modbus, port {port})", { ipv4: formatAddress(ipv4), port });
	if (address && !address.startsWith("control"))
		return t("{address} (Modbus, port {port})", { address, port });
	if (user)
		return t("{user} ({tool}, session {port})", { user, tool: TOOLS[local] ?? t("through {tool}", { tool: local ?? t("a tool") }), port });
	return local ? t("user {local} of the gateway (session {port})", { local, port }) : t("control socket (session {port})", { port });
}

/*
 * Completes an entry from records of the audit trail: the value before, and from where its user
 * came. Pure.
 */
export function completeEntry(entry, records) {
	const name = entry.written?.register.name;
	const apart = (record) => Math.abs(record.time_us - entry.time_us);
	const [record] = records.filter((one) => apart(one) <= SAME_WITHIN_US &&
		(name ? one.values && name in one.values :
			one.kind === "command" && inWords(one.what) === entry.command))
		.sort((one, other) => apart(one) - apart(other));

	if (!record)
		return entry;
	const [before, after] = record.values?.[name] ?? [];
	const register = entry.written?.register;
	const say = (value) => formatWithUnit(register, value);

	return {
		...entry,
		args: register && entry.written.value !== undefined && typeof before === "number" &&
			typeof after === "number" ? `${say(before)} → ${say(after)}` : entry.args,
		client: record.user && record.from ? `${record.user} (${record.from})` : entry.client,
	};
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
		element("td", {}, element("span", { class: `badge ${kind}` }, inWords(entry.result))),
		element("td", { class: "number" }, formatDuration(entry.duration_us)),
		element("td", { class: "muted nowrap" }, entry.client));
}

/* The panel; refresh() reads the history again, and onEntries() gets what it has. */
export function createHistory({ context, drive, registers, commands, scale, onEntries }) {
	const body = element("tbody");
	const heads = [[t("Time")], [t("Command")], [t("Values")], [t("Result")], [t("Took"), "number"],
		[t("By")]].map(([head, kind]) => element("th", { scope: "col", class: kind }, head));
	const node = element("section", { id: "history", class: "panel",
		"aria-label": t("History of commands") },
	element("div", { class: "panel-head" }, element("h2", {}, t("History of commands")),
		element("span", { class: "muted" }, t("of all clients, the newest first"))),
	element("div", { class: "table-frame", tabindex: "0", role: "region",
		"aria-label": t("Table of commands") },
	element("table", { class: "history" },
		element("thead", {}, element("tr", {}, heads)), body)));
	const names = historyNames(registers);
	/* By number of the entry: how often the trail was asked, and what it had. */
	const asked = new Map();
	const completed = new Map();
	let reading = false;
	let again = false;

	/*
	 * What the trail has of entries by users of tools, and of parameters. Each is asked for a few times at
	 * most: the trail may get it a little later than the history. If it cannot be read, nothing
	 * is missing but the values before.
	 */
	async function complete(entries) {
		const open = entries.filter(({ sequence, written, user }) => (written || user) &&
			(asked.get(sequence) ?? 0) < ASKED_MOST);

		if (open.length === 0 || !context.may("audit", drive))
			return;
		for (const { sequence } of open)
			asked.set(sequence, (asked.get(sequence) ?? 0) + 1);
		try {
			const { records } = await askAudit({ drive,
				since_us: Math.min(...open.map(({ time_us }) => time_us)) - SAME_WITHIN_US });

			for (const entry of open) {
				const whole = completeEntry(entry, records);

				if (whole === entry)
					continue;
				completed.set(entry.sequence, whole);
				asked.set(entry.sequence, ASKED_MOST);
			}
			if (open.some(({ sequence }) => asked.get(sequence) < ASKED_MOST))
				setTimeout(() => node.isConnected && refresh(), ASK_AGAIN_MS);
		} catch {
			/* As above. */
		}
	}

	async function refresh() {
		again = reading;
		if (reading)
			return;
		reading = true;
		try {
			const { values } = await call("Read", { drive, names });
			const entries = Array.from({ length: HISTORY_SHOWN }, (none, index) =>
				readHistory(values, index + 1, registers, commands, scale)).filter(Boolean);

			onEntries(entries);
			await complete(entries);
			const rows = entries.map((entry) => {
				const { args, client } = completed.get(entry.sequence) ?? entry;

				return makeEntry({ ...entry, args, client });
			});

			if (rows.length === 0)
				rows.push(element("tr", {}, element("td", { colspan: "6", class: "empty" },
					t("No commands yet."))));
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
