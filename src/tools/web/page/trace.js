/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The traffic of a bus, frame by frame and in words: now, in the last seconds, or as kept after
 * trouble.
 */
import { call, openStream } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { createLongList } from "./long_list.js";
import { createKeptTable } from "./trace_kept.js";
import { createIntake, writeHead, writeLine, writeSign } from "./trace_text.js";
import { writeClock } from "./plain.js";
import { TRACE_KINDS, sayTrace } from "./record_words.js";
import { t } from "./words.js";

export const title = t("Trace");

/* In the order of the interface. */
const KINDS = {
	[t("Sent")]: ["stop", "poll", "identify", "probe", "command", "broadcast"],
	[t("Received")]: ["answer", "part", "report", "late", "stray", "bad", "foreign", "garbage"],
	[t("Neither")]: ["unanswered", "event"]
};
const RECORDS_MOST = 20000;
const LOOK_FOR_KEPT_MS = 5000;

function writeText(bus, entries) {
	const first = entries.find((entry) => entry.record);

	return [
		first ? writeHead(bus, first.time_us) : "",
		...entries.map((entry) =>
			entry.record
				? writeLine(entry.record)
				: `# ${entry.missing} records are missing here\n`
		)
	];
}

function decode(base64) {
	return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

function createChoice(id, label, children) {
	const select = element("select", { id }, children);

	return { select, field: createField(label, select) };
}

function createOptions(names) {
	return names.map((name) => element("option", { value: name }, TRACE_KINDS[name] ?? name));
}

function createButton(id, words, properties = {}) {
	return element("button", { id: `trace-${id}`, type: "button", ...properties }, words);
}

function createParts() {
	return {
		counts: element("p", { id: "trace-counts", class: "muted" }),
		problem: element("p", { class: "problem", role: "alert" }),
		bus: createChoice("trace-bus", t("Bus"), []),
		source: createChoice("trace-source", t("From"), []),
		drive: createChoice("trace-drive", t("Drive"), []),
		kind: createChoice("trace-kind", t("Kind"), [
			element("option", { value: "" }, t("all")),
			...Object.entries(KINDS).map(([group, names]) =>
				element("optgroup", { label: group }, createOptions(names))
			)
		]),
		search: element("input", { id: "trace-search", type: "search", autocomplete: "off" }),
		pause: createButton("pause", t("Pause"), { "aria-pressed": "false" }),
		clear: createButton("clear", t("Clear")),
		save: createButton("save", t("Download as text")),
		savePcapng: createButton("save-pcapng", t("Download as pcapng"))
	};
}

function arrange(root, { parts, rows, table }) {
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Trace")), parts.counts),
		element(
			"div",
			{ class: "panel toolbar filters" },
			parts.bus.field,
			parts.source.field,
			parts.drive.field,
			parts.kind.field,
			createField(t("Text"), parts.search),
			parts.pause,
			parts.clear,
			parts.save,
			parts.savePcapng
		),
		parts.problem,
		rows.node,
		table.node
	);
}

function createRows(onDraw) {
	return createLongList({
		label: t("Trace"),
		monospace: true,
		most: RECORDS_MOST,
		kind: (entry) => entry.kind,
		columns: [
			{ title: t("Time"), text: (entry) => writeClock(entry.time_us, 6) },
			{
				title: element("span", { class: "hidden-label" }, t("Direction")),
				text: (entry) => (entry.record ? writeSign(entry.record) : "")
			},
			{ title: t("Kind"), text: (entry) => TRACE_KINDS[entry.kind] ?? entry.kind },
			{
				title: t("Words"),
				text: (entry) =>
					entry.missing ? t("{missing} records are missing here", { missing: entry.missing }) : sayTrace(entry.words)
			},
			{
				title: t("Bytes"),
				text: (entry) => (entry.record ? entry.record.bytes ?? "" : "")
			}
		],
		onDraw
	});
}

function writeCounts(ended, { all, shown, waiting }) {
	return (
		t("{shown} of {all} records", { shown: shown.length, all: all.length }) +
		(waiting.length > 0 ? t(", {count} more since the pause", { count: waiting.length }) : "") +
		(ended ? t("; all that was kept") : "")
	);
}

function describeBus({ context, parts }) {
	return context.plant.buses.get(parts.bus.select.value)?.description;
}

function applyFilter({ parts, rows }) {
	const wanted = parts.search.value.trim().toLowerCase();
	const kind = parts.kind.select.value;
	const drive = parts.drive.select.value;

	rows.filter(
		({ record, kind: own, words }) =>
			(!kind || own === kind || own === "missing") &&
			(!drive || !record || record.drive === drive) &&
			(!wanted ||
				(record && `${words} ${sayTrace(words)} ${record.bytes ?? ""}`.toLowerCase().includes(wanted)))
	);
}

/* Begins anew with the bus and the source that are chosen. */
function open(view) {
	const { parts, rows } = view;
	const source = parts.source.select.value;
	const number = Number(source);
	const description = describeBus(view);

	view.stream?.close();
	view.stream = null;
	rows.clear();
	setText(parts.problem, "");
	view.ended = false;
	if (!description)
		return;
	const take = createIntake();
	const asked = { bus: description.name, pcapng: description.can };

	parts.savePcapng.hidden = !description.can;
	parts.drive.select.replaceChildren(
		element("option", { value: "" }, t("all")),
		...createOptions(description.drives)
	);
	applyFilter(view);
	view.stream = openStream(
		"Trace",
		number > 0 ? { ...asked, kept: number } : { ...asked, past: source === "past" },
		{
			onData(answer) {
				view.head = answer.pcapng ?? view.head;
				rows.add(take(answer));
			},
			onState(state, error) {
				view.ended ||= state === "ended";
				if (state === "failed")
					setText(parts.problem, error.message);
			},
			once: number > 0
		}
	);
}

/* The choice stays, also a trace that is not kept any more. */
function fillSources({ parts, kept }, value) {
	const own = kept.filter((one) => one.bus === parts.bus.select.value);
	const { select } = parts.source;

	select.replaceChildren(
		element("option", { value: "past" }, t("the last seconds on")),
		element("option", { value: "live" }, t("now on")),
		...own.map((one) =>
			element(
				"option",
				{ value: one.number },
				t("kept {number}: {what}", { number: one.number, what: (one.drive ? `${one.drive}, ` : "") + one.event })
			)
		)
	);
	select.value = value;
	if (select.selectedIndex < 0) {
		select.append(element("option", { value }, t("kept {value}, not any more", { value })));
		select.value = value;
	}
}

/* busName: chosen where none is yet. */
function fillBuses(view, busName) {
	const { buses } = view.context.plant;
	const { select } = view.parts.bus;
	const value = select.value || busName;

	select.replaceChildren(...createOptions([...buses.keys()]));
	if (buses.has(value))
		select.value = value;
	fillSources(view, "past");
	open(view);
}

function chooseKept(view, one) {
	view.parts.bus.select.value = one.bus;
	fillSources(view, String(one.number));
	open(view);
	view.rows.node.focus();
}

/* There is no stream for the list of kept traces. */
async function loadKept(view) {
	const { parts, context } = view;
	const answer = await call("Traces").catch(() => ({ kept: view.kept }));

	if (view.closed)
		return;
	if (JSON.stringify(answer.kept) !== JSON.stringify(view.kept)) {
		view.kept = answer.kept;
		view.table.show(view.kept, (bus) => context.plant.buses.has(bus));
		fillSources(view, parts.source.select.value);
	}
	if (view.asked) {
		const { asked } = view;
		const found = view.kept.find((one) => String(one.number) === asked);

		if (found)
			chooseKept(view, found);
		else
			setText(parts.problem, t("trace {asked} is not kept any more", { asked }));
		view.asked = "";
	}
	view.timer = setTimeout(() => loadKept(view), LOOK_FOR_KEPT_MS);
}

function listen(view) {
	const { parts, rows } = view;
	const filter = () => applyFilter(view);
	const received = () => [...rows.list.all, ...rows.list.waiting];
	const name = (end) => `trace-${parts.bus.select.value}-${nameTime()}.${end}`;

	parts.bus.select.addEventListener("change", () => {
		fillSources(view, "past");
		open(view);
	});
	parts.source.select.addEventListener("change", () => open(view));
	parts.drive.select.addEventListener("change", filter);
	parts.kind.select.addEventListener("change", filter);
	parts.search.addEventListener("input", filter);
	parts.pause.addEventListener("click", () => {
		rows.pause(!rows.list.paused);
		parts.pause.setAttribute("aria-pressed", rows.list.paused);
	});
	parts.clear.addEventListener("click", () => rows.clear());
	parts.save.addEventListener("click", () =>
		saveFile(name("txt"), writeText(describeBus(view), received()))
	);
	parts.savePcapng.addEventListener("click", () =>
		saveFile(
			name("pcapng"),
			[view.head, ...received().map((entry) => entry.record?.pcapng)].filter(Boolean).map(decode),
			"application/octet-stream"
		)
	);
}

let shown = null;

export function show(root, context, busName, keptNumber) {
	const parts = createParts();
	const view = {
		context,
		parts,
		rows: createRows((list) => setText(parts.counts, writeCounts(view.ended, list))),
		table: createKeptTable((one) => chooseKept(view, one)),
		stream: null,
		/* Traces that the service keeps. */
		kept: [],
		/* Of a file of CAN frames. */
		head: "",
		/* The kept trace in this page's address, until it was looked for. */
		asked: keptNumber ?? "",
		ended: false,
		timer: 0,
		closed: false
	};

	shown = view;
	listen(view);
	arrange(root, view);
	fillBuses(view, busName);
	context.on("describe", () => {
		const before = JSON.stringify([...parts.bus.select.options].map((option) => option.value));

		if (before !== JSON.stringify([...context.plant.buses.keys()]))
			fillBuses(view, busName);
	});
	loadKept(view);
}

export function hide() {
	if (!shown)
		return;
	shown.closed = true;
	clearTimeout(shown.timer);
	shown.stream?.close();
	shown.rows.close();
	shown = null;
}
