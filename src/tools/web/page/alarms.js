/* SPDX-License-Identifier: Apache-2.0 */
/* Alarms: what needed somebody, since when, until when, how often, and who has seen it. */
import { acknowledgeAlarm, askAlarms } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { formatTime, inWords } from "./format.js";
import { readRecord } from "./plant.js";
import { recall, remember } from "./kept_choice.js";
import { t } from "./words.js";

const COLUMNS = [t("Alarm"), t("What"), t("Last came"), t("Gone"), t("Times"), t("Seen by"), ""];
/* In whole seconds. */
const writeTime = (us) => formatTime(us).replace(/\.\d+$/, "");

/* Open: it is there, or nobody has seen it. Pure. */
export function isOpen(alarm) {
	return alarm.present || alarm.acknowledged_us === 0;
}

/* Those that are wanted, the one that came last first. Pure. */
export function listAlarms(alarms, all) {
	return [...alarms].filter((alarm) => all || isOpen(alarm))
		.sort((one, other) => other.came_us - one.came_us || other.id - one.id);
}

/* "control, user drivebridge-web for anna, session 3": "anna". Pure. */
export function readWhom(words) {
	return / for ([^,]+)/.exec(words)?.[1] ?? words.replace(/^control, /, "");
}

/* What it is of, in words. Pure. */
function nameOf({ kind, name }) {
	return kind === "drive" ? name : kind === "bus" ? t("Bus {name}", { name }) : t("Configuration");
}

function hrefOf({ kind, name }) {
	return { drive: `#/drive/${encodeURIComponent(name)}`, bus: `#/trace/${encodeURIComponent(name)}` }[kind] ??
		"#/config";
}

/* The list. { node, update() }: asks for what has changed. */
export function createAlarms(context) {
	const known = new Map();
	const choice = element("select", { id: "alarms-filter" }, element("option", { value: "open" }, t("open")),
		element("option", { value: "all" }, t("all")));
	const count = element("p", { id: "alarms-count", class: "muted", role: "status" });
	const body = element("tbody");
	const node = element("section", { class: "panel", "aria-label": t("Alarms") },
		element("div", { class: "toolbar" }, element("h2", {}, t("Alarms")),
			createField(t("Show"), choice, "inline"), count),
		element("div", { class: "table-frame", tabindex: "0", role: "region", "aria-label": t("List of alarms") },
			element("table", { id: "alarms" }, element("thead", {}, element("tr", {},
				COLUMNS.map((words) => element("th", { scope: "col" }, words)))), body)));
	let after = 0;
	let state = "";
	let shown = "";

	async function acknowledge(alarm, button) {
		button.disabled = true;
		try {
			const { alarm: changed } = await acknowledgeAlarm(alarm);

			known.set(changed.id, changed);
			draw();
		} catch (error) {
			button.disabled = false;
			context.report(error);
		}
	}

	function makeSeen(alarm) {
		if (alarm.acknowledged_us > 0)
			return [`${readWhom(alarm.acknowledged_by)}, ${writeTime(alarm.acknowledged_us)}`, ""];
		const why = context.whyNot("move", alarm.kind === "drive" ? alarm.name : "");
		const button = element("button", { class: "small", type: "button", disabled: why !== "",
			title: why || null, "data-acknowledge": alarm.id,
			"aria-label": t("Acknowledge the alarm of {alarm}", { alarm: nameOf(alarm) }) }, t("Acknowledge"));

		button.addEventListener("click", () => acknowledge(alarm, button));
		return [t("nobody yet"), button];
	}

	function makeRow(alarm) {
		const { why } = readRecord(alarm);
		const [seen, button] = makeSeen(alarm);
		const present = alarm.present;

		return element("tr", { "data-alarm": alarm.id, "data-present": String(present) },
			element("th", { scope: "row" }, icon(present ? "error" : "fine"), " ",
				element("a", { href: hrefOf(alarm) }, nameOf(alarm))),
			[why || inWords(alarm.cause),
				[writeTime(alarm.came_us), alarm.times > 1 ?
					element("small", { class: "muted" }, t(" first {since_us}", { since_us: writeTime(alarm.since_us) })) : null],
				present ? t("still there") : writeTime(alarm.gone_us), alarm.times, seen, button]
				.map((content, index) => element("td", { "data-label": COLUMNS[index + 1] }, content)));
	}

	function draw() {
		const list = listAlarms(known.values(), choice.value === "all");
		const wanted = JSON.stringify(list);
		const open = [...known.values()].filter(isOpen).length;

		setText(count, state || t("{open} open, {count} kept", { open, count: known.size }));
		if (wanted === shown)
			return;
		shown = wanted;
		body.replaceChildren(...(list.length > 0 ? list.map(makeRow) :
			[element("tr", {}, element("td", { colspan: COLUMNS.length, class: "empty" },
				choice.value === "all" ? t("There are no alarms.") : t("No alarm is open.")))]));
	}

	choice.value = recall("alarms", "open");
	if (!choice.value)
		choice.value = "open";
	choice.addEventListener("change", () => {
		remember("alarms", choice.value);
		draw();
	});
	return {
		node,
		async update() {
			let over = false;

			while (!over) {
				const answer = await askAlarms(after);

				answer.alarms.forEach((alarm) => known.set(alarm.id, alarm));
				({ change: after, over } = answer);
				state = answer.on ? answer.trouble &&
					t("They are not kept over a restart: {trouble}", { trouble: answer.trouble }) : t("Alarms are switched off: health = off");
			}
			draw();
		},
		/* After a restart of the service, which may keep others. */
		forget() {
			known.clear();
			after = 0;
		}
	};
}
