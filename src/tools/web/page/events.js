/* SPDX-License-Identifier: Apache-2.0 */
/* The log: latest and new events, the newest first; warnings and errors unless more is asked for. */
import { openStream } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { createNewestList } from "./newest_list.js";
import { cleanText, writeClock, writeDay } from "./plain.js";
import { inLanguage, t } from "./words.js";

export const title = t("Events");

/* The chosen level and the more severe ones. */
const LEVEL_WORDS = { debug: t("debug"), info: t("info"), notice: t("notice"),
	warning: t("warning"), error: t("error") };
const LEVELS = Object.keys(LEVEL_WORDS);
const LEVEL_FIRST = "warning";
const EVENTS_MOST = 5000;
/* Most former events that the service sends, also after a lost connection. */
const PAST_MOST = 256;

let stream = null;
let rows = null;

/* The event's subject, as the log writes it. */
function writeWords(event) {
	const whom = [["bus", t("bus")], ["drive", t("drive")], ["client", t("client")]]
		.filter(([kind]) => event[kind])
		.map(([kind, words]) => `${words} ${event[kind]}: `);

	return cleanText(whom.join("") + inLanguage(event.text));
}

function writeWhen(event) {
	return `${writeDay(event.time_us)} ${writeClock(event.time_us, 3)}`;
}

/* In the form of drivebridgectl events. */
function writeLine(event) {
	return `${writeWhen(event)}  ${event.level.padEnd(7)}  ${writeWords(event)}\n`;
}

function createSelect(id, label, choices, onChange) {
	const select = element(
		"select",
		{ id },
		choices.map(([value, words]) => element("option", { value }, words))
	);

	select.addEventListener("change", onChange);
	return { select, field: createField(label, select) };
}

export function show(root, context, driveName) {
	const counts = element("p", { id: "events-counts", class: "muted" });
	const search = element("input", {
		id: "events-search",
		type: "search",
		autocomplete: "off"
	});
	const pause = element(
		"button",
		{ id: "events-pause", type: "button", "aria-pressed": "false" },
		t("Pause")
	);
	const save = element("button", { id: "events-save", type: "button" }, t("Download as text"));
	const level = createSelect(
		"events-level",
		t("Level"),
		LEVELS.map((name) => [name, name === "error" ? LEVEL_WORDS[name] :
			t("{name} and worse", { name: LEVEL_WORDS[name] })]),
		applyFilter
	);

	level.select.value = LEVEL_FIRST;
	const bus = createSelect("events-bus", t("Bus"), [], applyFilter);
	const drive = createSelect(
		"events-drive",
		t("Drive"),
		driveName ? [[driveName, driveName]] : [],
		applyFilter
	);
	let leftOut = 0;
	let fresh = true;

	rows = createNewestList({
		label: t("Events"),
		most: EVENTS_MOST,
		kind: (event) => event.level,
		columns: [
			{ title: t("When"), text: writeWhen },
			{ title: t("Level"), text: (event) => LEVEL_WORDS[event.level] ?? event.level },
			{ title: t("Event"), text: (event) => event.name },
			{ title: t("What"), text: writeWords }
		],
		onDraw({ all, shown, waiting }) {
			setText(
				counts,
				t("{shown} of {all} events", { shown: shown.length, all: all.length }) +
					(waiting.length > 0
						? t(", {count} more since the pause", { count: waiting.length })
						: "") +
					(leftOut > 0 ? t(", {leftOut} were left out", { leftOut }) : "")
			);
		}
	});

	function applyFilter() {
		const worst = LEVELS.indexOf(level.select.value);
		const wanted = search.value.trim().toLowerCase();

		rows.filter(
			(event) =>
				LEVELS.indexOf(event.level) >= worst &&
				(!bus.select.value || event.bus === bus.select.value) &&
				(!drive.select.value || event.drive === drive.select.value) &&
				`${event.name} ${writeWords(event)}`.toLowerCase().includes(wanted)
		);
	}

	/* A bus's events include those of its drives. */
	function fillSelects() {
		for (const [{ select }, names] of [
			[bus, context.plant.buses],
			[drive, context.plant.drives]
		]) {
			/* A chosen filter stays, even if it has left the configuration. */
			const known = new Set([
				...names.keys(),
				...(select.value ? [select.value] : [])
			]);
			const value = select.value;

			select.replaceChildren(
				element("option", { value: "" }, t("all")),
				...[...known].map((name) =>
					element("option", { value: name }, name)
				)
			);
			select.value = value;
		}
		applyFilter();
	}

	/* After a lost connection the service sends former events again. */
	function take({ events, skipped }) {
		const key = (event) => `${event.time_us} ${event.text}`;
		const known = new Set(
			fresh
				? [...rows.list.all, ...rows.list.waiting]
						.slice(-2 * PAST_MOST)
						.map(key)
				: []
		);

		fresh = false;
		leftOut += skipped ?? 0;
		rows.add(events.filter((event) => !known.has(key(event))));
	}

	search.addEventListener("input", applyFilter);
	pause.addEventListener("click", () => {
		const on = !rows.list.paused;

		rows.pause(on);
		pause.setAttribute("aria-pressed", on);
	});
	save.addEventListener("click", () =>
		saveFile(`events-${nameTime()}.txt`, rows.list.shown.map(writeLine))
	);
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Events")), counts),
		element(
			"div",
			{ class: "panel toolbar filters" },
			level.field,
			bus.field,
			drive.field,
			createField(t("Text"), search),
			pause,
			save
		),
		rows.node
	);
	fillSelects();
	context.on("describe", fillSelects);
	stream = openStream(
		"Events",
		{},
		{
			onData: take,
			onState(state, error) {
				fresh ||= state === "connecting";
				if (state === "failed")
					context.report(error);
			}
		}
	);
}

export function hide() {
	stream?.close();
	rows?.close();
	stream = rows = null;
}
