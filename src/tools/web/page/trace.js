/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The traffic of a bus, frame by frame and in words: now, in the last seconds, or as kept after
 * trouble.
 */
import { call, openStream } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { formatTime } from "./format.js";
import { createLongList } from "./long_list.js";
import { createIntake, writeHead, writeLine, writeSign } from "./trace_text.js";
import { writeClock } from "./plain.js";
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

let stream = null;
let rows = null;
let timer = 0;

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
	return names.map((name) => element("option", { value: name }, name));
}

export function show(root, context, busName, keptNumber) {
	const counts = element("p", { id: "trace-counts", class: "muted" });
	const problem = element("p", { class: "problem", role: "alert" });
	const bus = createChoice("trace-bus", t("Bus"), []);
	const source = createChoice("trace-source", t("From"), []);
	const drive = createChoice("trace-drive", t("Drive"), []);
	const kind = createChoice("trace-kind", t("Kind"), [
		element("option", { value: "" }, t("all")),
		...Object.entries(KINDS).map(([group, names]) =>
			element("optgroup", { label: group }, createOptions(names))
		)
	]);
	const search = element("input", {
		id: "trace-search",
		type: "search",
		autocomplete: "off"
	});
	const pause = element(
		"button",
		{ id: "trace-pause", type: "button", "aria-pressed": "false" },
		t("Pause")
	);
	const clear = element("button", { id: "trace-clear", type: "button" }, t("Clear"));
	const save = element("button", { id: "trace-save", type: "button" }, t("Download as text"));
	const savePcapng = element(
		"button",
		{ id: "trace-save-pcapng", type: "button" },
		t("Download as pcapng")
	);
	const keptBody = element("tbody");
	const keptPanel = element(
		"section",
		{ class: "panel", "aria-labelledby": "trace-kept-title" },
		element("h2", { id: "trace-kept-title" }, t("Kept when there was trouble")),
		element(
			"div",
			{ class: "table-frame" },
			element(
				"table",
				{ id: "trace-kept" },
				element(
					"thead",
					{},
					element(
						"tr",
						{},
						[t("Number"), t("When"), t("Bus"), t("Drive"), t("Event")].map((head) =>
							element("th", { scope: "col" }, head)
						),
						element("td")
					)
				),
				keptBody
			)
		)
	);
	let kept = [];
	let ended = false;
	let head = ""; /* of a file of CAN frames */
	let asked = keptNumber ?? ""; /* the kept trace in this page's address */

	rows = createLongList({
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
			{ title: t("Kind"), text: (entry) => entry.kind },
			{
				title: t("Words"),
				text: (entry) =>
					entry.words ?? t("{missing} records are missing here", { missing: entry.missing })
			},
			{
				title: t("Bytes"),
				text: (entry) => (entry.record ? entry.record.bytes ?? "" : "")
			}
		],
		onDraw({ all, shown, waiting }) {
			setText(
				counts,
				t("{shown} of {all} records", { shown: shown.length, all: all.length }) +
					(waiting.length > 0
						? t(", {count} more since the pause", { count: waiting.length })
						: "") +
					(ended ? t("; all that was kept") : "")
			);
		}
	});

	function describeBus() {
		return context.plant.buses.get(bus.select.value)?.description;
	}

	function applyFilter() {
		const wanted = search.value.trim().toLowerCase();

		rows.filter(
			({ record, kind: own, words }) =>
				(!kind.select.value ||
					own === kind.select.value ||
					own === "missing") &&
				(!drive.select.value ||
					!record ||
					record.drive === drive.select.value) &&
				(!wanted ||
					(record &&
						`${words} ${record.bytes ?? ""}`
							.toLowerCase()
							.includes(wanted)))
		);
	}

	function open() {
		const number = Number(source.select.value);
		const description = describeBus();

		stream?.close();
		stream = null;
		rows.clear();
		setText(problem, "");
		ended = false;
		if (!description)
			return;
		const take = createIntake();

		savePcapng.hidden = !description.can;
		drive.select.replaceChildren(
			element("option", { value: "" }, t("all")),
			...createOptions(description.drives)
		);
		applyFilter();
		stream = openStream(
			"Trace",
			number > 0
				? {
						bus: description.name,
						kept: number,
						pcapng: description.can
					}
				: {
						bus: description.name,
						past: source.select.value === "past",
						pcapng: description.can
					},
			{
				onData(answer) {
					head = answer.pcapng ?? head;
					rows.add(take(answer));
				},
				onState(state, error) {
					ended ||= state === "ended";
					if (state === "failed")
						setText(problem, error.message);
				},
				once: number > 0
			}
		);
	}

	/* The choice stays, also a trace that is not kept any more. */
	function fillSources(value) {
		const own = kept.filter((one) => one.bus === bus.select.value);

		source.select.replaceChildren(
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
		source.select.value = value;
		if (source.select.selectedIndex < 0) {
			source.select.append(
				element("option", { value }, t("kept {value}, not any more", { value }))
			);
			source.select.value = value;
		}
	}

	function fillBuses() {
		const value = bus.select.value || busName;

		bus.select.replaceChildren(...createOptions([...context.plant.buses.keys()]));
		if (context.plant.buses.has(value))
			bus.select.value = value;
		fillSources("past");
		open();
	}

	function chooseKept(one) {
		bus.select.value = one.bus;
		fillSources(String(one.number));
		open();
		rows.node.focus();
	}

	function showKept() {
		keptPanel.hidden = kept.length === 0;
		keptBody.replaceChildren(
			...kept.toReversed().map((one) => {
				const button = element(
					"button",
					{
						class: "small",
						type: "button",
						"aria-label": t("Show trace {number}", { number: one.number }),
						disabled: !context.plant.buses.has(one.bus)
					},
					t("Show")
				);

				button.addEventListener("click", () => chooseKept(one));
				return element(
					"tr",
					{},
					[
						one.number,
						formatTime(one.time_us),
						one.bus,
						one.drive ?? "",
						one.event
					].map((text) => element("td", {}, String(text))),
					element("td", {}, button)
				);
			})
		);
	}

	/* There is no stream for the list of kept traces. */
	async function loadKept() {
		const own = rows;
		const answer = await call("Traces").catch(() => ({ kept }));

		if (rows !== own)
			return;
		if (JSON.stringify(answer.kept) !== JSON.stringify(kept)) {
			kept = answer.kept;
			showKept();
			fillSources(source.select.value);
		}
		if (asked) {
			const found = kept.find((one) => String(one.number) === asked);

			if (found)
				chooseKept(found);
			else
				setText(problem, t("trace {asked} is not kept any more", { asked }));
			asked = "";
		}
		timer = setTimeout(loadKept, LOOK_FOR_KEPT_MS);
	}

	bus.select.addEventListener("change", () => {
		fillSources("past");
		open();
	});
	source.select.addEventListener("change", open);
	drive.select.addEventListener("change", applyFilter);
	kind.select.addEventListener("change", applyFilter);
	search.addEventListener("input", applyFilter);
	pause.addEventListener("click", () => {
		rows.pause(!rows.list.paused);
		pause.setAttribute("aria-pressed", rows.list.paused);
	});
	clear.addEventListener("click", () => rows.clear());
	save.addEventListener("click", () =>
		saveFile(
			`trace-${bus.select.value}-${nameTime()}.txt`,
			writeText(describeBus(), [...rows.list.all, ...rows.list.waiting])
		)
	);
	savePcapng.addEventListener("click", () =>
		saveFile(
			`trace-${bus.select.value}-${nameTime()}.pcapng`,
			[head, ...[...rows.list.all, ...rows.list.waiting].map((entry) => entry.record?.pcapng)]
				.filter(Boolean)
				.map(decode),
			"application/octet-stream"
		)
	);
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Trace")), counts),
		element(
			"div",
			{ class: "panel toolbar filters" },
			bus.field,
			source.field,
			drive.field,
			kind.field,
			createField(t("Text"), search),
			pause,
			clear,
			save,
			savePcapng
		),
		problem,
		rows.node,
		keptPanel
	);
	keptPanel.hidden = true;
	fillBuses();
	context.on("describe", () => {
		const before = JSON.stringify(
			[...bus.select.options].map((option) => option.value)
		);

		if (before !== JSON.stringify([...context.plant.buses.keys()]))
			fillBuses();
	});
	loadKept();
}

export function hide() {
	clearTimeout(timer);
	stream?.close();
	rows?.close();
	stream = rows = null;
}
