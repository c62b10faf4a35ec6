/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The table of drives, in the order of the configuration. Rows are made when the description
 * arrives and stay where they are; streamed data only change their texts and attributes.
 */
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import { NONE, formatAge, formatFixed, lookUpUnit } from "./format.js";
import { createLimitBar } from "./limit_bar.js";
import { ageOf, isMoving, NEED, stateWord } from "./plant.js";
import { t } from "./words.js";

const NEED_ICONS = ["fine", "hint", "warning", "error"];
const NEED_KEYS = ["nothing", "hint", "look", "act"];
const HEADS = [[t("State")], [t("Drive")], [t("Position"), "number"], [t("Velocity"), "number"],
	[t("Age"), "number"], [t("Needs")]];
/* Ages below a second change with every sample; nobody can read that. */
const YOUNG_MS = 1000;
const YOUNG_EVERY_MS = 500;

/* Choices of the filter by state: whether a drive is shown. */
export const STATES = {
	all: [t("in any state"), () => true],
	needs: [t("that need somebody"), ({ judgement }) => judgement.need >= NEED.look],
	moving: [t("that move"), ({ judgement }) => isMoving(judgement.state)],
	standing: [t("that stand"), ({ judgement }) => judgement.state === "Standstill"],
	disabled: [t("that are switched off"), ({ judgement }) => judgement.state === "Disabled"],
	fault: [t("with a fault"), ({ judgement }) => judgement.state === "ErrorStop"],
	offline: [t("without an answer"), ({ judgement }) => ["Offline", ""].includes(judgement.state)],
};

/* Whether a drive has these words, is on this bus ("": any) and in this state. Pure. */
export function isWanted(drive, { words = "", bus = "", state = "all" }) {
	const { name, judgement } = drive;
	const text = `${name} ${drive.bus} ${judgement.state} ${stateWord(judgement.state)} ` +
		judgement.why;

	return (bus === "" || drive.bus === bus) && STATES[state][1](drive) &&
		text.toLowerCase().includes(words.trim().toLowerCase());
}

function makeRow(context, drive) {
	const cells = {
		stateIcon: icon("offline"),
		word: element("span", { class: "state-word" }),
		state: element("small", { class: "state-name" }),
		mustStand: element("small", { class: "must-stand" }),
		position: element("span"),
		positionUnit: element("span", { class: "unit" }),
		velocity: element("span"),
		velocityUnit: element("span", { class: "unit" }),
		age: element("td", { class: "number age", "data-label": t("Age") }),
		needIcon: icon("fine"),
		why: element("span"),
		advice: element("small", { class: "advice" }),
	};
	const { name, bus, description } = drive;
	const address = `${description.address} ${description.axis}`.trim();
	const stop = context.may("stop") ? element("button", { class: "small", type: "button",
		"data-stop": name, "aria-label": t("Stop {name}", { name }), onclick: () => context.stop(name) },
	icon("stop"), t("Stop")) : null;

	cells.bar = createLimitBar(description);
	cells.stateBox = element("span", { class: "state" }, cells.stateIcon,
		element("span", { class: "state-words" }, cells.word, cells.state));
	cells.need = element("span", { class: "need" }, cells.needIcon, cells.why);
	cells.row = element("tr", { "data-drive": name },
		element("td", { class: "live" }, cells.stateBox, cells.mustStand),
		element("th", { scope: "row" },
			element("a", { class: "row-link", href: `#/drive/${encodeURIComponent(name)}` }, name),
			element("small", { class: "muted" }, t("{bus} · {address} · unit {unit}", { bus, address, unit: description.unit }))),
		element("td", { class: "number live", "data-label": t("Position") }, cells.position,
			cells.positionUnit, cells.bar?.node ?? null),
		element("td", { class: "number live", "data-label": t("Velocity") }, cells.velocity,
			cells.velocityUnit),
		cells.age, element("td", { class: "needs live" }, cells.need, cells.advice),
		element("td", { class: "row-stop" }, stop));
	return cells;
}

function showQuantities(cells, drive, registers) {
	const { values } = drive;
	const unit = drive.description.unit_name;

	for (const [quantity, per] of [["position", ""], ["velocity", "/s"]]) {
		const users = values?.[`${quantity}_units`];
		const own = values?.[quantity];

		if (unit && typeof users === "number") {
			setText(cells[quantity], formatFixed(users, 2));
			setText(cells[`${quantity}Unit`], unit + per);
		} else {
			setText(cells[quantity], formatFixed(own, quantity === "velocity" ? 1 : 0));
			setText(cells[`${quantity}Unit`],
				typeof own === "number" ? lookUpUnit(registers, quantity) : "");
		}
	}
}

function updateRow(cells, drive, registers) {
	const { judgement } = drive;
	/* Nothing has come of it yet, which is no fault. */
	const shape = drive.values === null ? "unknown" : judgement.shape;

	setIcon(cells.stateIcon, shape === "unknown" ? "hint" : shape);
	setText(cells.word, stateWord(judgement.state));
	setText(cells.state, judgement.state);
	setAttribute(cells.stateBox, "data-shape", shape);
	setText(cells.mustStand, judgement.mustStand);
	showQuantities(cells, drive, registers);
	cells.bar?.show(drive.values);
	showNeed(cells, drive, "");
	setAttribute(cells.row, "data-need", NEED_KEYS[judgement.need]);
}

/* `old`: why what is shown is not known any more; "": it is known. */
function showNeed(cells, { judgement, values }, old) {
	const unknown = old || values === null;

	setIcon(cells.needIcon, old || (unknown && !judgement.why) ? "hint" : NEED_ICONS[judgement.need]);
	setAttribute(cells.need, "data-need", old ? "0" : String(judgement.need));
	setText(cells.why, old || judgement.why || (unknown ? t("not known") : t("nothing")));
	setText(cells.advice, old ? judgement.why : judgement.advice);
	setAttribute(cells.advice, "title", judgement.advice);
}

/* { node, describe(), update(), frame(now), filter(wanted): the number of drives shown } */
export function createDriveRows(context) {
	const rows = new Map();
	const body = element("tbody");
	const table = element("table", { id: "drives", class: "drives" },
		element("caption", { class: "hidden-label" }, t("Drives, in the order of the configuration")),
		element("thead", {}, element("tr", {},
			HEADS.map(([head, kind]) => element("th", { scope: "col", class: kind }, head)),
			element("th", { scope: "col" }, element("span", { class: "hidden-label" }, t("Stop"))))),
		body);
	const node = element("div", { class: "panel table-frame", tabindex: "0", role: "region",
		"aria-label": t("Table of drives") }, table);
	let wanted = {};
	let youngAt = 0;
	let oldSaid = "";

	function showNone() {
		const scan = element("a", { href: "#/scan" }, t("Look for drives on a bus"));

		body.replaceChildren(element("tr", {}, element("td", { colspan: "7", class: "empty" },
			t("No drives yet: the configuration has none, see drivebridge.conf(5). "),
			context.plant.buses.size > 0 ? scan : null)));
	}

	/* Ages also increase without new data. */
	function showAge(cells, drive, now, young) {
		const age = ageOf(drive, now);

		if (age !== null && age < YOUNG_MS && !young && cells.age.textContent !== "")
			return;
		setText(cells.age, drive.values === null ? NONE : formatAge(age));
		cells.age.classList.toggle("old", drive.values !== null && (age === null || age >= YOUNG_MS));
	}

	function filter() {
		let count = 0;

		for (const [name, cells] of rows) {
			const drive = context.plant.drives.get(name);
			const shown = drive && isWanted(drive, wanted);

			cells.row.hidden = !shown;
			count += shown ? 1 : 0;
		}
		return count;
	}

	return {
		node,
		table,
		describe() {
			rows.clear();
			for (const drive of context.plant.drives.values())
				rows.set(drive.name, makeRow(context, drive));
			body.replaceChildren(...[...rows.values()].map(({ row }) => row));
			if (context.plant.description && rows.size === 0)
				showNone();
		},
		update() {
			for (const [name, cells] of rows) {
				const drive = context.plant.drives.get(name);

				if (drive)
					updateRow(cells, drive, context.plant.registersOf(drive));
			}
			oldSaid = "";
		},
		frame(now) {
			const young = now - youngAt >= YOUNG_EVERY_MS;
			const old = context.sayOld();

			if (young)
				youngAt = now;
			for (const [name, cells] of rows) {
				const drive = context.plant.drives.get(name);

				if (!drive)
					continue;
				showAge(cells, drive, now, young);
				if (old !== oldSaid)
					showNeed(cells, drive, old);
			}
			oldSaid = old;
		},
		filter(next) {
			wanted = next;
			return filter();
		},
	};
}
