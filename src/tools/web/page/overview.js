/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Buses and drives, the worst first. Rows are made when the description arrives; streamed data only
 * change their texts and attributes.
 */
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import { formatAge, formatFixed, formatSpeed, inWords, lookUpUnit, NONE } from "./format.js";
import { ageOf, NEED, readRecord } from "./plant.js";

export const title = "Overview";

const NEED_ICONS = ["fine", "hint", "warning", "error"];
const NEED_KEYS = ["nothing", "hint", "look", "act"];
const HEADS = [["State"], ["Drive"], ["Position", "number"], ["Velocity", "number"],
	["Age", "number"], ["Needs"]];
/* Ages below a second change with every sample; nobody can read that. */
const YOUNG_MS = 1000;
const YOUNG_EVERY_MS = 500;
/* From this number of drives on there is a search field. */
const FILTER_FROM = 9;

let view = null;

export function show(root, context) {
	view = {
		context,
		root,
		rows: new Map(),
		buses: new Map(),
		order: "",
		held: false,
		youngAt: 0
	};
	view.summary = element("p", { id: "summary", class: "summary" });
	view.filter = element("input", {
		id: "filter",
		type: "search",
		placeholder: "Filter",
		hidden: true,
		"aria-label": "Show only drives with this in name, bus or state",
		spellcheck: "false"
	});
	view.filter.addEventListener("input", showFiltered);
	view.configuration = element("div",
		{ id: "configuration", class: "panel configuration-need", role: "status", hidden: true });
	view.cards = element("div", { id: "buses", class: "bus-cards" });
	view.body = element("tbody");
	view.table = element("table", { id: "drives", class: "drives" },
		element("caption", { class: "hidden-label" }, "Drives, the worst first"),
		element("thead", {},
			element("tr", {},
				...HEADS.map(([head, kind]) =>
					element("th", { scope: "col", class: kind }, head)),
				element("th", { scope: "col" },
					element("span", { class: "hidden-label" }, "Stop")))),
		view.body);
	/* A row must not move away while the pointer is about to press its button. */
	view.table.addEventListener("pointerenter", () => { view.held = true; });
	view.table.addEventListener("pointerleave", () => { view.held = false; });
	root.append(element("div", { class: "view-head" }, element("h1", {}, "Overview"),
		view.summary, element("span", { class: "push" }), view.filter),
		view.configuration,
		element("h2", { class: "hidden-label" }, "Buses"), view.cards,
		element("h2", { class: "hidden-label" }, "Drives"),
		element("div", {
			class: "panel table-frame",
			tabindex: "0",
			role: "region",
			"aria-label": "Table of drives"
		},
			view.table));
	context.on("describe", makeRows);
	context.on("session", makeRows);
	context.on("plant", update);
	context.on("frame", updateAges);
	makeRows();
}

export function hide() { view = null; }

/* --- rows and cards --------------------------------------------------------------------------- */

function makeRows() {
	const { plant } = view.context;

	view.rows = new Map();
	view.buses = new Map();
	view.order = "";
	view.cards.replaceChildren(...[...plant.buses.values()].map(makeCard));
	view.body.replaceChildren();
	for (const drive of plant.drives.values())
		view.rows.set(drive.name, makeRow(drive));
	view.filter.hidden = plant.drives.size < FILTER_FROM;
	if (plant.description && plant.drives.size === 0) {
		const scan = element("a", { href: "#/scan" }, "Look for drives on a bus");

		view.body.replaceChildren(element("tr", {},
			element("td", { colspan: "7", class: "empty" },
				"No drives yet: the configuration has none, see drivebridge.conf(5). ",
				plant.buses.size > 0 ? scan : null)));
	}
	update();
}

function makeRow(drive) {
	const cells = {
		stateIcon: icon("offline"),
		state: element("span"),
		mustStand: element("small", { class: "must-stand" }),
		position: element("span"),
		positionUnit: element("span", { class: "unit" }),
		velocity: element("span"),
		velocityUnit: element("span", { class: "unit" }),
		age: element("td", { class: "number age", "data-label": "Age" }),
		needIcon: icon("fine"),
		why: element("span"),
		advice: element("small", { class: "advice" }),
	};
	const { name, bus, description } = drive;
	const address = `${description.address} ${description.axis}`.trim();

	cells.stateBox = element("span", { class: "state" }, cells.stateIcon, cells.state);
	cells.need = element("span", { class: "need" }, cells.needIcon, cells.why);
	cells.row = element("tr", { "data-drive": name },
		element("td", { class: "live" }, cells.stateBox, cells.mustStand),
		element("th", { scope: "row" },
			element("a",
				{ class: "row-link", href: `#/drive/${encodeURIComponent(name)}` },
				name),
			element("small", { class: "muted" },
				`${bus} · ${address} · unit ${description.unit}`)),
		element("td", { class: "number live", "data-label": "Position" }, cells.position,
			cells.positionUnit),
		element("td", { class: "number live", "data-label": "Velocity" }, cells.velocity,
			cells.velocityUnit),
		cells.age, element("td", { class: "needs live" }, cells.need, cells.advice),
		element("td", { class: "row-stop" },
			view.context.may("stop") ? element("button", {
				class: "small",
				type: "button",
				"data-stop": name,
				"aria-label": `Stop ${name}`,
				onclick: () => view?.context.stop(name)
			},
							icon("stop"), "Stop") :
						null));
	return cells;
}

function makeCard(bus) {
	const { name, title: family, device, speed, drives, protocol } = bus.description;
	const cells = {
		port: element("span", { class: "badge" }),
		load: element("meter",
			{ min: "0", max: "100", high: "90", "aria-label": `Load of bus ${name}` }),
		loadText: element("strong", { class: "load-text" }),
		online: element("span"),
		cycle: element("span"),
		late: element("span"),
		bad: element("span"),
		trouble: element("p", { class: "bus-trouble", hidden: true }),
	};

	cells.card = element("section",
		{ class: "panel bus-card live", "data-bus": name, "aria-label": `Bus ${name}` },
		element("div", { class: "panel-head" }, element("h3", {}, name),
			element("span", { class: "muted bus-family", title: protocol }, family),
			element("span", { class: "push" }), cells.port),
		element("div", { class: "bus-load" }, element("span", { class: "muted" }, "Load"),
			cells.load, cells.loadText),
		element("dl", { class: "facts" },
			element("div", {}, element("dt", {}, "Online"),
				element("dd", {}, cells.online)),
			element("div", {}, element("dt", {}, "Cycle"),
				element("dd", {}, cells.cycle)),
			element("div", {}, element("dt", {}, "Overruns"),
				element("dd", {}, cells.late)),
			element("div", {}, element("dt", {}, "No answer"),
				element("dd", {}, cells.bad))),
		element("p", { class: "muted bus-device" },
			element("small", {}, `${device} · ${formatSpeed(speed)}`)),
		cells.trouble);
	cells.count = drives.length;
	view.buses.set(name, cells);
	return cells.card;
}

/* --- streamed data
 * ----------------------------------------------------------------------------- */

function update() {
	const { plant } = view.context;

	for (const [name, cells] of view.rows) {
		const drive = plant.drives.get(name);

		if (drive)
			updateRow(cells, drive);
	}
	for (const [name, cells] of view.buses) {
		const bus = plant.buses.get(name);

		if (bus)
			updateCard(cells, bus);
	}
	sortRows();
	showSummary();
}

function updateRow(cells, drive) {
	const { values, judgement } = drive;
	const registers = view.context.plant.registersOf(drive);
	const unit = drive.description.unit_name;
	const quantities = [["position", ""], ["velocity", "/s"]];

	setIcon(cells.stateIcon, judgement.shape);
	setText(cells.state, judgement.state || "not known");
	setAttribute(cells.stateBox, "data-shape", judgement.shape);
	setText(cells.mustStand, judgement.mustStand);
	for (const [quantity, per] of quantities) {
		const users = values?.[`${quantity}_units`];
		const own = values?.[quantity];
		const inUsers = unit && typeof users === "number";

		if (inUsers) {
			setText(cells[quantity], formatFixed(users, 2));
			setText(cells[`${quantity}Unit`], unit + per);
		} else {
			setText(cells[quantity], formatFixed(own, quantity === "velocity" ? 1 : 0));
			setText(cells[`${quantity}Unit`],
				typeof own === "number" ? lookUpUnit(registers, quantity) : "");
		}
	}
	setIcon(cells.needIcon, NEED_ICONS[judgement.need]);
	setAttribute(cells.need, "data-need", String(judgement.need));
	setText(cells.why, judgement.why || "nothing");
	setText(cells.advice, judgement.advice);
	setAttribute(cells.advice, "title", judgement.advice);
	setAttribute(cells.row, "data-need", NEED_KEYS[judgement.need]);
}

function updateCard(cells, { description, figures }) {
	const load = figures ? figures.utilisation / 10 : 0;
	const ms = (us, decimals) => formatFixed(us / 1000, decimals);

	const record = view.context.plant.troubles?.buses[description.name];
	const { why, advice } = readRecord(record);

	setText(cells.port, record ? inWords(record.cause) : description.up ? "up" : "port not open");
	cells.port.classList.toggle("error", !description.up);
	cells.card.classList.toggle("down", !description.up);
	cells.load.value = load;
	setText(cells.loadText, figures ? `${formatFixed(load, 1)} %` : NONE);
	setText(cells.online, figures ? `${figures.online} of ${cells.count}` : NONE);
	setText(cells.cycle,
		figures ? `${ms(figures.cycle_us, 1)} of ${ms(figures.period_us, 0)} ms` : NONE);
	setText(cells.late, figures ? String(figures.overruns) : NONE);
	setText(cells.bad, figures ? String(figures.timeouts) : NONE);
	cells.trouble.hidden = !record;
	setText(cells.trouble, record ? `${why}: ${advice}` : "");
}

/* Ages also increase without new data. */
function updateAges(now) {
	const young = now - view.youngAt >= YOUNG_EVERY_MS;

	if (young)
		view.youngAt = now;
	for (const [name, cells] of view.rows) {
		const drive = view.context.plant.drives.get(name);
		const age = drive ? ageOf(drive, now) : null;

		if (age === null || age >= YOUNG_MS || young || cells.age.textContent === "") {
			setText(cells.age, formatAge(age));
			cells.age.classList.toggle("old", age === null || age >= YOUNG_MS);
		}
	}
}

function sortRows() {
	const sorted = view.context.plant.worstFirst().map((drive) => drive.name);
	const order = sorted.join("/");

	if (order === view.order ||
		(view.order && (view.held || view.body.contains(document.activeElement))))
		return;
	view.order = order;
	for (const name of sorted) {
		const cells = view.rows.get(name);

		if (cells)
			view.body.append(cells.row);
	}
	showFiltered();
}

function showFiltered() {
	const wanted = view.filter.hidden ? "" : view.filter.value.trim().toLowerCase();

	for (const [name, cells] of view.rows) {
		const drive = view.context.plant.drives.get(name);
		const text = `${name} ${drive?.bus} ${drive?.judgement.state}`.toLowerCase();

		cells.row.hidden = wanted !== "" && !text.includes(wanted);
	}
}

/* The mistakes in its files, one per line. */
function showConfiguration({ troubles }) {
	const record = troubles?.configuration;
	const { need, why, advice } = readRecord(record);
	const shown = JSON.stringify(record ?? null);

	if (shown === view.configured)
		return;
	view.configured = shown;
	view.configuration.hidden = need === NEED.nothing;
	setAttribute(view.configuration, "data-need", String(need));
	view.configuration.replaceChildren(icon(NEED_ICONS[need]),
		element("p", {}, element("strong", {}, `Configuration: ${why}`), ` ${advice}`),
		element("pre", { hidden: !record?.errors?.length }, (record?.errors ?? []).join("\n")));
}

function showSummary() {
	const { plant } = view.context;
	const { drives, buses, configuration } = plant.countNeeds();
	const look = drives[NEED.look] + buses[NEED.look] + configuration[NEED.look];
	const parts = [
		[buses[NEED.act], "bus is down", "buses are down", NEED.act],
		[drives[NEED.act], "drive needs you", "drives need you", NEED.act],
		[configuration[NEED.act], "configuration needs you", "", NEED.act],
		[look, "to look at", "to look at", NEED.look],
	].filter(([count]) => count > 0);
	const said = parts.map(([count, one, many]) => `${count} ${count === 1 ? one : many}`);
	const well = plant.troubles?.well && parts.length === 0;

	/* The service decides whether all is well, not the values shown here. */
	setText(view.summary, said.join(", ") || (well && plant.drives.size > 0 ? "all is well" : ""));
	setAttribute(view.summary, "data-need", String(parts.length > 0 ? parts[0][3] : NEED.nothing));
	showConfiguration(plant);
}
