/* SPDX-License-Identifier: Apache-2.0 */
/* Looks for the drives of a bus, address by address. */
import { openStream } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { formatFixed } from "./format.js";
import { createPasteText } from "./paste_text.js";
import { cleanText } from "./plain.js";
import { askUser } from "./question.js";
import { createNumber } from "./scan_number.js";
import { t } from "./words.js";

/* Some drives need longer than this before they answer. */
const WAIT_SHORT_US = 10000;

/*
 * Resolves at the scan's end with nothing, rejects with an ApiError; onAnswer(answer) is called for each answer. While it
 * runs, action.end() ends it.
 */
function runScan(action, parameters, onAnswer) {
	let stream = null;
	const ended = new Promise((resolve, reject) => {
		stream = openStream("Scan", parameters, {
			once: true,
			onData: onAnswer,
			onState(state, error) {
				if (state === "ended")
					resolve();
				else if (state === "failed")
					reject(error);
			}
		});
		/* Closing its stream ends a scan. */
		action.end = () => {
			stream.close();
			reject(new Error(t("it was ended")));
		};
	});

	return ended.finally(() => {
		action.end = null;
	});
}

function writePlace(find) {
	const names = find.drives.join(", ");

	if (find.verdict === "one")
		return names || t("new");
	return (
		(find.verdict === "two" ? t("two drives") : t("nothing readable")) +
		(names ? `: ${names}` : "")
	);
}

/* What the user has to do about it. */
function writeAdvice(finds) {
	const advice = [];

	for (const { address, verdict } of finds) {
		if (verdict === "two")
			advice.push(
				t("Address {address}: two drives have it. Take one of them off the line, give the other an address of its own below, and connect it again.", { address })
			);
		else if (verdict === "garbled")
			advice.push(
				t("Address {address}: bytes were received, but no valid answer: two drives that talk at once, or a disturbed line. Take drives off the line one by one; check wires, termination and ground.", { address })
			);
	}
	if (finds.length === 0)
		advice.push(
			t("No drive answers: check power and wiring (A and B may be swapped), whether protocol and line are right, and the speed: a scan at all speeds tries all of them.")
		);
	return advice;
}

function writeForeign({ id, extended, count }) {
	return t("{id}  {count} times", { id: id.toString(16).toUpperCase().padStart(extended ? 8 : 3, "0"),
		count });
}

const HEADS = [
	[t("Address"), "number"],
	["Bit/s", "number"],
	[t("Protocol"), null],
	[t("Identity"), null],
	[t("Fastest"), "number"],
	[t("Mean"), "number"],
	[t("Slowest"), "number"],
	[t("Configured as"), null]
];

function createTable(body) {
	return element(
		"div",
		{ class: "table-frame", hidden: true },
		element(
			"table",
			{ id: "scan-finds" },
			element("caption", { class: "hidden-label" }, t("Drives that were found")),
			element(
				"thead",
				{},
				element(
					"tr",
					{},
					HEADS.map(([head, kind]) => element("th", { scope: "col", class: kind }, head)),
					element("td")
				)
			),
			body
		)
	);
}

function createParts() {
	const body = element("tbody");
	const foreign = element("ul", { class: "code" });

	return {
		first: createNumber("scan-first", t("Addresses from"), { placeholder: t("all") }),
		last: createNumber("scan-last", t("to"), { placeholder: t("all") }),
		speed: element("select", { id: "scan-speed" }),
		start: element("button", { id: "scan-start", class: "primary", type: "submit" }, t("Scan")),
		cancel: element("button", { id: "scan-cancel", type: "button", hidden: true }, t("End it")),
		warning: element(
			"p",
			{ class: "need", "data-need": "2", hidden: true },
			icon("warning"),
			element(
				"span",
				{},
				t("The bus is taken out of service for this: its drives, which must stand, are left as on-exit says, and are offline for every PLC until the scan has ended.")
			)
		),
		progress: element("progress", {
			id: "scan-progress",
			"aria-label": t("Addresses asked"),
			hidden: true
		}),
		said: element("p", { id: "scan-said", role: "status" }),
		body,
		table: createTable(body),
		foreign,
		foreignBox: element(
			"div",
			{ hidden: true },
			element("h3", {}, t("Other frames on this bus, of nobody who is configured here")),
			foreign
		),
		advice: element("ul", { id: "scan-advice", class: "advice" }),
		text: createPasteText(t("For the configuration, then reload"))
	};
}

function createForm(parts) {
	return element(
		"form",
		{ id: "scan", class: "panel", "aria-labelledby": "scan-title" },
		element("h2", { id: "scan-title" }, t("Look for drives")),
		element(
			"div",
			{ class: "toolbar filters" },
			parts.first.field,
			parts.last.field,
			createField(t("Bit rate"), parts.speed),
			parts.start,
			parts.cancel
		),
		parts.warning,
		parts.progress,
		parts.said,
		parts.table,
		parts.foreignBox,
		parts.advice,
		parts.text.node
	);
}

function fillSpeeds({ parts, findBus }) {
	const bus = findBus();

	if (!bus)
		return;
	parts.speed.replaceChildren(
		element("option", { value: "" }, t("{speed} bit/s, in service", { speed: bus.speed })),
		element("option", { value: "all" }, t("all bit rates, bus out of service")),
		...bus.speeds.map((one) =>
			element("option", { value: one }, t("{one} bit/s, bus out of service", { one }))
		)
	);
	parts.warning.hidden = true;
}

/* --- what was found --- */

function writeIdentity({ identity, other }) {
	return cleanText(other ? t("{one} and {other}", { one: identity, other }) : identity) || "–";
}

function createMark(find) {
	const isNew = find.verdict === "one" && find.drives.length === 0;
	const kind = isNew ? "badge on" : "";

	return element("span", { class: find.verdict === "one" ? kind : "badge error" }, writePlace(find));
}

function createChoice({ onChoose }, find) {
	const choose = element(
		"button",
		{
			class: "small",
			type: "button",
			"aria-label": t("Give address {address} another address or speed", { address: find.address })
		},
		t("Set up")
	);

	choose.addEventListener("click", () => onChoose(find));
	return choose;
}

function addFind(search, bus, find) {
	const ms = (us) => (find.answered === 0 ? "–" : `${formatFixed(us / 1000, 1)} ms`);
	const maySetUp = find.verdict === "one" && search.context.may("manage");

	search.parts.body.append(
		element(
			"tr",
			{ "data-verdict": find.verdict },
			element("th", { scope: "row", class: "number" }, String(find.address)),
			element("td", { class: "number" }, String(find.speed)),
			element("td", {}, bus.protocol),
			element("td", {}, writeIdentity(find)),
			[find.time_min_us, find.time_mean_us, find.time_max_us].map((us) =>
				element("td", { class: "number" }, ms(us))
			),
			element("td", {}, createMark(find)),
			element("td", {}, maySetUp ? createChoice(search, find) : "")
		)
	);
	search.parts.table.hidden = false;
}

function showAdvice({ parts }, finds, waitUs) {
	parts.advice.replaceChildren(...writeAdvice(finds).map((words) => element("li", {}, words)));
	if (waitUs < WAIT_SHORT_US)
		parts.advice.append(
			element(
				"li",
				{ class: "muted" },
				t("Each address was given {count} ms to begin its answer, as much as the cycle leaves: a slower drive is found with a longer cycle-ms, or with the bus out of service.", { count: formatFixed(waitUs / 1000, 1) })
			)
		);
}

/* --- a scan --- */

function reset({ parts }) {
	parts.body.replaceChildren();
	parts.foreign.replaceChildren();
	parts.advice.replaceChildren();
	parts.table.hidden = parts.foreignBox.hidden = true;
	parts.text.show("");
	setText(parts.said, "");
}

/* null: the typed values are not valid. */
function readOptions({ parts, form }, bus) {
	const parameters = { bus: bus.name };

	if (!form.reportValidity())
		return null;
	if (parts.first.input.value !== "")
		parameters.first = Number(parts.first.input.value);
	if (parts.last.input.value !== "")
		parameters.last = Number(parts.last.input.value);
	if (parameters.first > parameters.last) {
		setText(parts.said, t("{first} to {last} are no addresses", { first: parameters.first, last: parameters.last }));
		return null;
	}
	if (parts.speed.value === "all")
		parameters.all_speeds = true;
	else if (parts.speed.value)
		parameters.speeds = [Number(parts.speed.value)];
	return parameters;
}

function showRunning({ parts }, on) {
	parts.start.hidden = on;
	parts.cancel.hidden = parts.progress.hidden = !on;
	parts.progress.removeAttribute("value");
	if (on)
		parts.cancel.focus();
	else if (document.activeElement === document.body)
		parts.start.focus();
}

function askOutOfService(bus) {
	return askUser({
		title: t("Take bus {name} out of service?", { name: bus.name }),
		yes: t("Scan"),
		words: [
			t("Its drives, which must stand, are left as on-exit says, and are offline for every PLC until the scan has ended.")
		]
	});
}

/* found: { finds, configuration, waitUs } of the answers until now. */
function takeAnswer(search, bus, found, answer) {
	const { parts } = search;

	parts.progress.max = answer.total || 1;
	parts.progress.value = answer.asked;
	found.waitUs = answer.wait_us;
	found.configuration = answer.configuration ?? found.configuration;
	found.finds.push(...answer.finds);
	setText(
		parts.said,
		t("{asked} of {total} addresses asked, {count} found; at {speed} bit/s", { asked: answer.asked, total: answer.total, count: found.finds.length, speed: answer.speed })
	);
	answer.finds.forEach((find) => addFind(search, bus, find));
	parts.foreign.append(
		...answer.foreign.map((frame) => element("li", {}, writeForeign(frame)))
	);
	parts.foreignBox.hidden = parts.foreign.children.length === 0;
}

async function scan(search) {
	const { parts, action } = search;
	const bus = search.findBus();
	const parameters = bus ? readOptions(search, bus) : null;
	const found = { finds: [], configuration: "", waitUs: WAIT_SHORT_US };

	if (!parameters || action.end)
		return;
	reset(search);
	if (parts.speed.value && !(await askOutOfService(bus)))
		return;
	showRunning(search, true);
	try {
		await runScan(action, parameters, (answer) => takeAnswer(search, bus, found, answer));
		showAdvice(search, found.finds, found.waitUs);
	} catch (error) {
		setText(
			parts.said,
			t("The scan did not come to its end: {message}; {count} found until then", { message: error.message, count: found.finds.length })
		);
	}
	parts.text.show(found.configuration);
	showRunning(search, false);
}

/*
 * findBus() describes the bus that is chosen; onChoose(find): a drive that was found is to be set up; action: of scan.js.
 * Returns { node, fillSpeeds(), reset() }.
 */
export function createSearch({ context, findBus, onChoose, action }) {
	const parts = createParts();
	const search = { context, findBus, onChoose, action, parts, form: createForm(parts) };

	parts.speed.addEventListener("change", () => {
		parts.warning.hidden = parts.speed.value === "";
	});
	search.form.addEventListener("submit", (event) => {
		event.preventDefault();
		scan(search);
	});
	parts.cancel.addEventListener("click", () => action.end?.());
	return {
		node: search.form,
		fillSpeeds: () => fillSpeeds(search),
		reset: () => reset(search)
	};
}
