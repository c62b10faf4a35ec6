/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One drive: its plot, values, status, inputs and outputs, jog, commands, control and history, all
 * made from the service's description of the drive.
 */
import { call, openStream } from "./api.js";
import { createCommands } from "./commands.js";
import { createControl } from "./control.js";
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import {
	asLabel,
	createScale,
	formatAge,
	formatFixed,
	formatValue,
	inWords,
	labelOf
} from "./format.js";
import { releaseWithPage } from "./hold_button.js";
import { createHistory } from "./history.js";
import { createJog } from "./jog.js";
import { createLamps } from "./lamps.js";
import { LATE_MS, sayLate } from "./lateness.js";
import { createLimitBar } from "./limit_bar.js";
import { nextStep } from "./next_step.js";
import { ageOf, judgeDrive, NEED, stateWord } from "./plant.js";
import { createPlot } from "./plot.js";
import { inLanguage, t } from "./words.js";

/* Ten minutes at twenty samples a second; four at 20 ms. */
const PLOT_CAPACITY = 12000;
const INTERVALS_MS = [0, 50, 100, 500];
const INTERVAL_FIRST_MS = 50;
const TEXTS_EVERY_MS = 100;
/* Shown elsewhere than among the values, or useless to people. */
const NOT_LISTED = new Set([
	"status", "drive_status", "capabilities", "timestamp_us", "inputs", "outputs",
	"position_units", "velocity_units", "control_request", "control_port", "control_holder",
	"control_remaining_ms", "watchdog_remaining_ms", "must_stand_cause", "must_stand_ms"
]);
/* Of the handshake with a PLC; people use the history. */
const BOOKKEEPING = /_(id|limit|register)$|result|heartbeat|active_command/;
/* A drive's own speed, in steps: the parameter of the families that have one. */
const PRESET_SPEED = "spd";
const PLOTTED_FIRST = ["position", "velocity"];
/* Names of counters and codes, which are no quantities to plot. */
const NOT_PLOTTED = /(^|_)(port|holder|request|trips|timestamp_us)$/;

let view = null;

export function title(name) { return name ?? t("Drive"); }

export async function show(root, context, name) {
	const mine = {
		context,
		root,
		name,
		latest: null,
		textsAt: 0,
		agedAt: 0,
		sequence: -1,
		stream: null,
		parts: [],
		closed: false
	};

	view?.close();
	view = mine;
	mine.close = () => {
		mine.closed = true;
		mine.stream?.close();
		mine.jog?.release();
		mine.plot?.destroy();
		mine.parts.forEach((off) => off());
	};
	root.append(element("p", { class: "empty" }, t("Asking {name} …", { name })));
	const [registers, commands, all] = await Promise.all([
		context.registers(name), context.commands(name),
		call("Read", { drive: name, names: [] })
	]);
	const names = Object.keys(all.values);
	const { values } = await call("Read", {
		drive: name,
		names: ["counts_per_unit", "identity", "unit_name", PRESET_SPEED].filter(
			(one) => registers.has(one))
	});

	if (mine.closed)
		return;
	Object.assign(mine, {
		registers,
		commands,
		identity: values.identity,
		preset: values[PRESET_SPEED] ?? 0,
		scale: createScale(values.unit_name, values.counts_per_unit),
		names: [
			...names,
			...[...registers.values()]
				.filter((register) => register.type === "bool" &&
						register.name.startsWith("drive_"))
				.map((register) => register.name),
			...["control_address", "control_user", "history1_sequence"]
				.filter((one) => registers.has(one))
		]
	});
	mine.described = describe(context.plant, name);
	build(mine, names);
	watchKeys(mine);
	context.on("frame", (now) => frame(mine, now));
	context.on("plant", () => mine.latest || showHead(mine, performance.now()));
	context.on("link", (link) => {
		if (link !== "live")
			mine.jog?.release();
	});
	context.on("describe", () => {
		const described = describe(context.plant, name);

		if (described !== mine.described && !context.plant.drives.has(name))
			context.notify(t("{name} is not in the configuration any more", { name }), "warning");
		else if (described !== mine.described)
			context.showAgain();
	});
	openSubscription(mine, INTERVAL_FIRST_MS);
	mine.history.refresh();
}

export function hide() {
	view?.close();
	view = null;
}

/* What a change of the configuration may affect. */
function describe(plant, name) {
	const drive = plant.drives.get(name);
	const bus = plant.buses.get(drive?.bus)?.description;

	return JSON.stringify([drive?.description, bus?.protocol]);
}

/* --- building the view
 * ------------------------------------------------------------------------- */

function build(mine, names) {
	const { context, name, registers, commands, scale, root } = mine;
	const acts = context.may("move", name);
	const part = { context, drive: name, registers, commands, scale };

	mine.history = createHistory({ ...part, onEntries: (entries) => entries.forEach((entry) =>
		mine.plot.mark({ of: `command ${entry.sequence}`, time: entry.time_us / 1e6,
			label: entry.command, kind: "muted" })) });
	mine.control = createControl(part);
	mine.lamps = createLamps(registers);
	mine.signals = findSignals(mine, names);
	mine.plot = createPlot({
		title: name,
		signals: mine.signals,
		chosen: PLOTTED_FIRST,
		capacity: PLOT_CAPACITY
	});
	if (acts) {
		/* An accepted command tells who has control. */
		const learn = () => mine.control.learn().catch(() => {});

		mine.panel = createCommands({ ...part, onDone: learn });
		if (commands.has("move_velocity") && registers.has("target_velocity"))
			mine.jog = createJog({ ...part, preset: mine.preset, onMoved: learn,
				onEnable: () => mine.panel.give("enable", {}) });
	}
	root.replaceChildren(makeHead(mine),
		element("div", { class: "drive-grid" },
			element("div", { class: "drive-main" }, mine.plot.node,
				makeValues(mine, names), mine.lamps.node, makePorts(mine),
				mine.history.node),
			element("div", { class: "drive-side" }, mine.jog?.node ?? null,
				mine.control.node, mine.panel?.node ?? makeReason(mine))));
}

/* In place of what the user may not do. */
function makeReason(mine) {
	return element("section", { id: "may-not", class: "panel", "aria-label": t("Commands") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Commands"))),
		element("p", { class: "muted" }, mine.context.whyNot("move", mine.name)));
}

function findSignals(mine, names) {
	return names.map((name) => mine.registers.get(name))
		.filter((register) => register &&
				["i16", "u16", "i32", "u32", "f32"].includes(register.type) &&
				!register.name.endsWith("_units") &&
				!NOT_PLOTTED.test(register.name) && !BOOKKEEPING.test(register.name) &&
				(!register.codes || register.name === "axis_state"))
		.map((register) => ({
			name: register.name,
			label: labelOf(register),
			unit: mine.scale.unit(register),
			decimals: mine.scale.decimals(register),
			names: register.codes,
		}));
}

function makeHead(mine) {
	const { context, name } = mine;
	const drive = context.plant.drives.get(name)?.description;
	const head = mine.head = {
		icon: icon("offline"),
		word: element("span", { class: "state-word" }),
		state: element("small", { id: "drive-state", class: "state-name" }),
		mustStand: element("small", { id: "drive-must-stand", class: "must-stand live" }),
		position: element("span", { id: "position" }),
		velocity: element("span", { id: "velocity" }),
		age: element("span", { id: "age" }),
		needIcon: icon("fine"),
		why: element("span"),
		advice: element("span", { class: "advice-text" }),
		stateBox: null,
		next: null,
		bar: null,
		need: null,
	};
	const links =
		[element("a", { href: `#/parameters/${encodeURIComponent(name)}` }, t("Parameters"))];
	const place = [];

	links.push(element("a", { href: `#/positions/${encodeURIComponent(name)}` }, t("Positions")));
	if (context.may("engineer", name))
		links.push(element("a", { href: `#/commission/${encodeURIComponent(name)}` }, t("Commission")));
	const quantity = (label, node, register, bar) => element("div", { class: "quantity live" },
		element("span", { class: "muted" }, label),
		element("span", { class: "quantity-value" }, node,
			element("span", { class: "unit" },
				register ? mine.scale.unit(register) : "")), bar ?? null);

	if (drive) {
		links.push(element(
			"a", { href: `#/trace/${encodeURIComponent(drive.bus)}` }, t("Trace")));
		place.push(drive.bus, t("address {address}", { address: `${drive.address} ${drive.axis}`.trim() }),
			t("unit {unit}", { unit: drive.unit }));
	}
	if (mine.identity)
		place.push(mine.identity);
	head.stateBox = element("span", { class: "state live" }, head.icon,
		element("span", { class: "state-words" }, head.word, head.state));
	head.next = element("button", { id: "drive-next", class: "primary", type: "button", hidden: true,
		onclick: () => mine.panel?.give(head.next.dataset.next, {}) });
	head.bar = createLimitBar(drive ?? {});
	head.need = element("div",
		{ id: "drive-need", class: "need drive-need", hidden: true, role: "status" },
		head.needIcon, head.why, head.advice);
	return element("header", { class: "drive-head", "data-drive": name },
		element("div", { class: "drive-title" }, element("h1", {}, name),
			element("nav", { class: "drive-links", "aria-label": t("More of {name}", { name }) },
				links),
			element("small", { class: "muted", title: mine.identity },
				place.join(" · "))),
		head.stateBox, head.next, head.mustStand,
		quantity(t("Position"), head.position, mine.registers.get("position"), head.bar?.node),
		quantity(t("Velocity"), head.velocity, mine.registers.get("velocity")),
		quantity(t("Age"), head.age, null), context.may("stop") ? makeStops(mine) : null,
		head.need);
}

function makeButton(command, id, onclick) {
	return element("button", { id, type: "button", onclick }, asLabel(command));
}

function makeStops(mine) {
	const { commands } = mine;
	const now = element("button", {
		id: "stop",
		class: "stop",
		type: "button",
		"aria-keyshortcuts": "Space Escape",
		onclick: () => stop(mine, "stop")
	},
		icon("stop"), asLabel("stop"), element("kbd", {}, t("Space")));

	return element("div", { class: "drive-stop" }, now,
		commands.has("quick_stop") ?
			makeButton("quick_stop", "quick-stop", () => stop(mine, "quick_stop")) :
			null);
}

function makePorts(mine) {
	const ports = (kind) => [...mine.registers.values()].filter(
		(register) => register.type === "bool" &&
			new RegExp(`^${kind}_\\d+$`).test(register.name));
	const make = (register, word) => {
		const number = register.name.split("_")[1];
		const mark = element("span", { class: "lamp-mark", "aria-hidden": "true" });
		const acts = register.writable && mine.context.may("move", mine.name);
		const node = element(acts ? "button" : "span", {
			class: acts ? "port small" : "badge port",
			"data-port": register.name,
			type: acts ? "button" : null,
			role: acts ? "switch" : null,
			"aria-checked": acts ? "false" : null,
			"aria-label": acts ? asLabel(register.name) : null,
		}, mark, number, element("span", { class: "hidden-label" }));

		if (acts)
			node.addEventListener("click",
				() => write(mine, register.name, node.dataset.on !== "true"));
		mine.ports.push({ node, word, bit: Number(number) - 1, acts });
		return element("li", {}, node);
	};
	const rows = [];

	mine.ports = [];
	for (const [kind, word] of [["input", "inputs"], ["output", "outputs"]]) {
		const found = ports(kind);

		if (found.length > 0 && mine.registers.has(word))
			rows.push(element("div", { class: "ports-row" },
				element("h3", { class: "muted" },
					kind === "input" ? t("Inputs") : t("Outputs")),
				element("ul", { class: "lamps" },
					found.map((register) => make(register, word)))));
	}
	return rows.length > 0 ?
		element("section",
			{ id: "ports", class: "panel live", "aria-label": t("Inputs and outputs") },
			element("div", { class: "panel-head" },
				element("h2", {}, t("Inputs and outputs"))),
			rows) :
		"";
}

function makeValues(mine, names) {
	mine.values = names.filter((name) => !NOT_LISTED.has(name) && mine.registers.has(name))
		.map((name) => ({
			register: mine.registers.get(name),
			text: element("span"),
			unit: element("span", { class: "unit" }),
		}));
	const list = (values) => element("dl", { class: "values" },
		values.map(({ register, text, unit }) => element("div",
			{ title: inLanguage(register.description) },
			element("dt", {}, labelOf(register)),
			element("dd", { "data-value": register.name }, text, unit))));
	const isOfMachine = ({ register }) => !BOOKKEEPING.test(register.name);

	return element("section", { id: "values", class: "panel live", "aria-label": t("Values") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Values")),
			element("span", { class: "push" }), makeIntervals(mine)),
		list(mine.values.filter(isOfMachine)),
		element("details", {},
			element("summary", { class: "muted" }, t("Handshake with a PLC")),
			list(mine.values.filter((value) => !isOfMachine(value)))));
}

function makeIntervals(mine) {
	const select = element("select",
		{ id: "interval", class: "small", "aria-label": t("How often values come") },
		INTERVALS_MS.map(
			(ms) => element("option", { value: ms, selected: ms === INTERVAL_FIRST_MS },
				ms === 0 ? t("every cycle") : t("every {ms} ms", { ms }))));

	select.addEventListener("change", () => openSubscription(mine, Number(select.value)));
	return select;
}

/* --- actions
 * ----------------------------------------------------------------------------------- */

async function stop(mine, command) {
	mine.jog?.release();
	await mine.context.stop(mine.name, command);
}

async function write(mine, name, value) {
	try {
		await call("Write", { drive: mine.name, values: { [name]: value } });
		mine.control.learn().catch(() => {});
	} catch (error) {
		mine.context.notify(`${mine.name}: ${inWords(name)}: ${error.message}`, "error");
	}
}

/* Space and Escape stop, wherever the focus is; the loss of the focus or the page ends a jog. */
function watchKeys(mine) {
	const release = () => mine.jog?.release();
	const listen = (target, event, listener, capture) => {
		target.addEventListener(event, listener, capture);
		mine.parts.push(() => target.removeEventListener(event, listener, capture));
	};

	if (!mine.context.may("stop"))
		return;
	listen(window, "keydown", (event) => {
		if ((event.key !== " " && event.key !== "Escape") || event.ctrlKey ||
			event.altKey || event.metaKey)
			return;
		event.preventDefault();
		event.stopPropagation();
		if (!event.repeat)
			stop(mine, "stop");
	}, true);
	/* Otherwise the release of the key would still press a button. */
	listen(window, "keyup", (event) => {
		if (event.key === " ")
			event.preventDefault();
	}, true);
	mine.parts.push(releaseWithPage(release));
}

/* --- streamed data
 * ----------------------------------------------------------------------------- */

function openSubscription(mine, interval_ms) {
	mine.stream?.close();
	mine.stream =
		openStream("Subscribe", {
			drives: [mine.name],
			names: mine.names,
			interval_ms,
			changes: true,
			/* Behind a slow network the newest values count, not each of them. */
			merge: true
		}, {
			onData: (answer, late) =>
				answer.samples.forEach((sample) => takeSample(mine, sample, late ?? 0)),
			onState(state, error) {
				if (state === "failed")
					mine.context.report(error);
				if (state !== "live" && state !== "connecting")
					mine.jog?.release();
			},
		});
}

/* A sample has the values that have changed since the one before. */
function takeSample(mine, sample, late) {
	const values = { ...mine.latest?.values, ...sample.values };
	const known = values.position !== null && values.position !== undefined;

	mine.latest = { values, heardAt: performance.now() - late, late };
	if (known && sample.time_us > 0)
		mine.plot.push(sample.time_us / 1e6, mine.signals.map(({ name }) =>
			mine.scale.show(mine.registers.get(name), values[name])));
	if (values.history1_sequence !== undefined &&
		values.history1_sequence !== mine.sequence) {
		mine.sequence = values.history1_sequence;
		mine.history.refresh();
	}
}

/* --- show and hide
 * ----------------------------------------------------------------------------- */

function frame(mine, now) {
	mine.plot.frame(now);
	if (now - mine.textsAt < TEXTS_EVERY_MS)
		return;
	mine.textsAt = now;
	showHead(mine, now);
	if (!mine.latest)
		return;
	const { values } = mine.latest;

	mine.control.update(values);
	mine.lamps.update(values);
	for (const { node, word, bit, acts } of mine.ports) {
		const on = Math.floor((values[word] ?? 0) / 2 ** bit) % 2 === 1;

		setAttribute(node, "data-on", String(on));
		if (acts)
			setAttribute(node, "aria-checked", String(on));
		else
			setText(node.lastChild, on ? t(": on") : t(": off"));
	}
	for (const { register, text, unit } of mine.values) {
		const value = values[register.name];
		const shown = mine.scale.isScaled(register) && typeof value === "number" ?
			{
				text: formatFixed(mine.scale.show(register, value),
					mine.scale.decimals(register)),
				unit: mine.scale.unit(register)
			} :
			formatValue(register, value);

		setText(text, shown.text);
		setText(unit, shown.unit);
	}
}

/* The event of a trouble on the plot. */
function markTrouble({ context, name, plot }) {
	const record = context.plant.troubles?.drives[name];
	const event = record?.event;

	if (event)
		plot.mark({ of: `${event.time_us} ${event.text}`, time: event.time_us / 1e6,
			label: inWords(record.cause), kind: "error" });
}

/* One button for what comes next: clear the fault, enable, home. */
function showNext(mine, judgement, old) {
	const { next } = mine.head;
	const command = mine.panel && !old ? nextStep(judgement, mine.commands) : "";

	next.hidden = command === "";
	if (command !== "" && next.dataset.next !== command) {
		next.dataset.next = command;
		setText(next, asLabel(command));
	}
	mine.panel?.update({ judgement, old, gone: ["lost", "down"].includes(mine.context.link()) });
}

function showHead(mine, now) {
	const { head, registers, scale, context } = mine;
	const drive = context.plant.drives.get(mine.name);
	const values = mine.latest?.values ?? drive?.values ?? null;
	const judgement = judgeDrive(registers, values, context.plant.troubles?.drives[mine.name]);
	const number = (name) => formatFixed(scale.show(registers.get(name), values?.[name]),
		Math.max(name === "velocity" ? 1 : 0, scale.decimals(registers.get(name))));
	const { heardAt = 0, late = 0 } = mine.latest ?? drive ?? {};
	const age = ageOf({ values, heardAt, late }, now);
	/* Of both streams; of this one also while it stands still. */
	const old = context.sayOld() ||
		(mine.latest && (now - heardAt) > LATE_MS ? sayLate(now - heardAt) : "");

	setIcon(head.icon, judgement.shape);
	setText(head.word, old || stateWord(judgement.state));
	setText(head.state, judgement.state || t("not known"));
	setAttribute(head.stateBox, "data-shape", judgement.shape);
	mine.root.classList.toggle("stale", old !== "");
	setText(head.mustStand, judgement.mustStand);
	setText(head.position, number("position"));
	setText(head.velocity, number("velocity"));
	if (age === null || age >= 1000 ||
		Math.floor(now / 500) !== Math.floor(mine.agedAt / 500)) {
		mine.agedAt = now;
		setText(head.age, formatAge(age));
	}
	head.need.hidden = judgement.need === NEED.nothing;
	setAttribute(head.need, "data-need", String(judgement.need));
	setIcon(head.needIcon, ["fine", "hint", "warning", "error"][judgement.need]);
	setText(head.why, judgement.why);
	setText(head.advice, judgement.advice);
	head.bar?.show(values);
	showNext(mine, judgement, old);
	markTrouble(mine);
	mine.jog?.update({ judgement, old });
}
