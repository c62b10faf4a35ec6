/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds the drives of a bus, and gives one of them another address or speed. The configuration is
 * shown as text for the person who may change it, never written.
 */
import { ask, openStream } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { createPasteText } from "./paste_text.js";
import { cleanText } from "./plain.js";
import { askUser } from "./question.js";
import { inLanguage, t } from "./words.js";

export const title = t("Scan");

/* Some drives need longer than this before they answer. */
const WAIT_SHORT_US = 10000;
const NUMBER_MOST = 4000000;

let running = null; /* ends the present action: a scan, or setting up a drive */

/*
 * A running scan: onAnswer(answer) is called for each answer. Resolves at its end with the finds;
 * rejects with an ApiError.
 */
function runScan(parameters, onAnswer) {
	let stream = null;
	const ended = new Promise((resolve, reject) => {
		const finds = [];

		stream = openStream("Scan", parameters, {
			once: true,
			onData(answer) {
				finds.push(...answer.finds);
				onAnswer?.(answer);
			},
			onState(state, error) {
				if (state === "ended")
					resolve(finds);
				else if (state === "failed")
					reject(error);
			}
		});
		/* Closing its stream ends a scan. */
		running = () => {
			stream.close();
			reject(new Error(t("it was ended")));
		};
	});

	return ended.finally(() => {
		running = null;
	});
}

function createNumber(id, label, properties = {}) {
	const input = element("input", {
		id,
		type: "number",
		min: 0,
		max: NUMBER_MOST,
		step: 1,
		inputmode: "numeric",
		...properties
	});

	return { input, field: createField(label, input) };
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

/* --- looking for drives --- */

function createSearch(context, findBus, onChoose) {
	const first = createNumber("scan-first", t("Addresses from"), { placeholder: t("all") });
	const last = createNumber("scan-last", t("to"), { placeholder: t("all") });
	const speed = element("select", { id: "scan-speed" });
	const start = element(
		"button",
		{ id: "scan-start", class: "primary", type: "submit" },
		t("Scan")
	);
	const cancel = element(
		"button",
		{ id: "scan-cancel", type: "button", hidden: true },
		t("End it")
	);
	const warning = element(
		"p",
		{ class: "need", "data-need": "2", hidden: true },
		icon("warning"),
		element(
			"span",
			{},
			t("The bus is taken out of service for this: its drives, which must stand, are left as on-exit says, and are offline for every PLC until the scan has ended.")
		)
	);
	const progress = element("progress", {
		id: "scan-progress",
		"aria-label": t("Addresses asked"),
		hidden: true
	});
	const said = element("p", { id: "scan-said", role: "status" });
	const body = element("tbody");
	const table = element(
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
					[
						t("Address"),
						"Bit/s",
						t("Protocol"),
						t("Identity"),
						t("Fastest"),
						t("Mean"),
						t("Slowest"),
						t("Configured as"),
						""
					].map((head, at) =>
						element(
							head ? "th" : "td",
							{
								scope: head ? "col" : null,
								class: [0, 1, 4, 5, 6].includes(at)
									? "number"
									: null
							},
							head
						)
					)
				)
			),
			body
		)
	);
	const foreign = element("ul", { class: "code" });
	const foreignBox = element(
		"div",
		{ hidden: true },
		element("h3", {}, t("Other frames on this bus, of nobody who is configured here")),
		foreign
	);
	const advice = element("ul", { id: "scan-advice", class: "advice" });
	const text = createPasteText(t("For the configuration, then reload"));
	const form = element(
		"form",
		{ id: "scan", class: "panel", "aria-labelledby": "scan-title" },
		element("h2", { id: "scan-title" }, t("Look for drives")),
		element(
			"div",
			{ class: "toolbar filters" },
			first.field,
			last.field,
			createField(t("Bit rate"), speed),
			start,
			cancel
		),
		warning,
		progress,
		said,
		table,
		foreignBox,
		advice,
		text.node
	);

	function fillSpeeds() {
		const bus = findBus();

		if (!bus)
			return;
		speed.replaceChildren(
			element("option", { value: "" }, t("{speed} bit/s, in service", { speed: bus.speed })),
			element("option", { value: "all" }, t("all bit rates, bus out of service")),
			...bus.speeds.map((one) =>
				element("option", { value: one }, t("{one} bit/s, bus out of service", { one }))
			)
		);
		warning.hidden = true;
	}

	function addFind(bus, find) {
		const ms = (us) => (find.answered === 0 ? "–" : `${(us / 1000).toFixed(1)} ms`);
		const identity =
			cleanText(find.other ? t("{one} and {other}", { one: find.identity, other: find.other }) :
				find.identity) || "–";
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
		body.append(
			element(
				"tr",
				{ "data-verdict": find.verdict },
				element(
					"th",
					{ scope: "row", class: "number" },
					String(find.address)
				),
				element("td", { class: "number" }, String(find.speed)),
				element("td", {}, bus.protocol),
				element("td", {}, identity),
				[find.time_min_us, find.time_mean_us, find.time_max_us].map((us) =>
					element("td", { class: "number" }, ms(us))
				),
				element(
					"td",
					{},
					element(
						"span",
						{
							class:
								find.verdict !== "one"
									? "badge error"
									: find.drives.length === 0
										? "badge on"
										: ""
						},
						writePlace(find)
					)
				),
				element(
					"td",
					{},
					find.verdict === "one" && context.may("manage") ? choose : ""
				)
			)
		);
		table.hidden = false;
	}

	function reset() {
		body.replaceChildren();
		foreign.replaceChildren();
		advice.replaceChildren();
		table.hidden = foreignBox.hidden = true;
		text.show("");
		setText(said, "");
	}

	/* null: the typed values are not valid. */
	function readOptions(bus) {
		const parameters = { bus: bus.name };

		if (!form.reportValidity())
			return null;
		if (first.input.value !== "")
			parameters.first = Number(first.input.value);
		if (last.input.value !== "")
			parameters.last = Number(last.input.value);
		if (parameters.first > parameters.last) {
			setText(said, t("{first} to {last} are no addresses", { first: parameters.first, last: parameters.last }));
			return null;
		}
		if (speed.value === "all")
			parameters.all_speeds = true;
		else if (speed.value)
			parameters.speeds = [Number(speed.value)];
		return parameters;
	}

	function show(on) {
		start.hidden = on;
		cancel.hidden = progress.hidden = !on;
		progress.removeAttribute("value");
		if (on)
			cancel.focus();
		else if (document.activeElement === document.body)
			start.focus();
	}

	async function scan() {
		const bus = findBus();
		const parameters = bus ? readOptions(bus) : null;
		const finds = [];
		let configuration = "";
		let waitUs = WAIT_SHORT_US;

		if (!parameters || running)
			return;
		reset();
		if (
			speed.value &&
			!(await askUser({
				title: t("Take bus {name} out of service?", { name: bus.name }),
				yes: t("Scan"),
				words: [
					t("Its drives, which must stand, are left as on-exit says, and are offline for every PLC until the scan has ended.")
				]
			}))
		)
			return;
		show(true);
		try {
			await runScan(parameters, (answer) => {
				progress.max = answer.total || 1;
				progress.value = answer.asked;
				waitUs = answer.wait_us;
				configuration = answer.configuration ?? configuration;
				finds.push(...answer.finds);
				setText(
					said,
					t("{asked} of {total} addresses asked, {count} found; at {speed} bit/s", { asked: answer.asked, total: answer.total, count: finds.length, speed: answer.speed })
				);
				answer.finds.forEach((find) => addFind(bus, find));
				foreign.append(
					...answer.foreign.map((frame) =>
						element("li", {}, writeForeign(frame))
					)
				);
				foreignBox.hidden = foreign.children.length === 0;
			});
			advice.replaceChildren(
				...writeAdvice(finds).map((words) => element("li", {}, words))
			);
			if (waitUs < WAIT_SHORT_US)
				advice.append(
					element(
						"li",
						{ class: "muted" },
						t("Each address was given {count} ms to begin its answer, as much as the cycle leaves: a slower drive is found with a longer cycle-ms, or with the bus out of service.", { count: (waitUs / 1000).toFixed(1) })
					)
				);
		} catch (error) {
			setText(
				said,
				t("The scan did not come to its end: {message}; {count} found until then", { message: error.message, count: finds.length })
			);
		}
		text.show(configuration);
		show(false);
	}

	speed.addEventListener("change", () => {
		warning.hidden = speed.value === "";
	});
	form.addEventListener("submit", (event) => {
		event.preventDefault();
		scan();
	});
	cancel.addEventListener("click", () => running?.());
	return { node: form, fillSpeeds, reset };
}

/* --- setting one up --- */

function createSetUp(context, findBus) {
	const address = createNumber("setup-address", t("Drive at address"), { required: true });
	const what = element(
		"select",
		{ id: "setup-what" },
		element("option", { value: "address" }, t("another address")),
		element("option", { value: "speed" }, t("another speed"))
	);
	const to = createNumber("setup-to", t("New address"), { required: true });
	const toSpeed = element("select", { id: "setup-to-speed" });
	const toSpeedField = createField(t("New speed"), toSpeed);
	const at = element("select", { id: "setup-at" });
	const start = element("button", { id: "setup-start", type: "submit" }, t("Look, then ask"));
	const cancel = element(
		"button",
		{ id: "setup-cancel", type: "button", hidden: true },
		t("End it")
	);
	const steps = element("ol", { id: "setup-steps", class: "advice" });
	const text = createPasteText(t("For the configuration, then reload"));
	const form = element(
		"form",
		{ id: "setup", class: "panel", "aria-labelledby": "setup-title" },
		element("h2", { id: "setup-title" }, t("Give a drive another address or speed")),
		element(
			"p",
			{ class: "muted" },
			t("It is looked at first: one drive must answer at its address, nobody at the new one, and it must stand. Nothing is told before you said so.")
		),
		element(
			"div",
			{ class: "toolbar filters" },
			address.field,
			createField(t("Gets"), what),
			to.field,
			toSpeedField,
			createField(t("Spoken to at"), at),
			start,
			cancel
		),
		element("div", { role: "log", "aria-label": t("What was done") }, steps),
		text.node
	);
	let stream = null;

	function fillSpeeds() {
		const bus = findBus();

		if (!bus)
			return;
		at.replaceChildren(
			element("option", { value: 0 }, t("{speed} bit/s, in service", { speed: bus.speed })),
			...bus.speeds.map((one) =>
				element("option", { value: one }, t("{one} bit/s, bus out of service", { one }))
			)
		);
		toSpeed.replaceChildren(
			...bus.speeds.map((one) =>
				element("option", { value: one }, t("{one} bit/s", { one }))
			)
		);
		toSpeed.value = bus.speed;
	}

	function chooseWhat() {
		const isAddress = what.value === "address";

		to.field.hidden = !isAddress;
		to.input.required = isAddress;
		toSpeedField.hidden = isAddress;
	}

	function say(words, properties = {}) {
		steps.append(
			element("li", properties, words.charAt(0).toUpperCase() + words.slice(1))
		);
	}

	function tell(words) {
		return ask("POST", "setup", words, { named: true }).catch(context.report);
	}

	async function answer(bus, move, { question, text: words, yes }) {
		const button = inLanguage(yes);
		const agreed = await askUser({
			title: t("Bus {name}, address {from}", { name: bus.name, from: move.from }),
			words: words.trim().split("\n").map((line) => inLanguage(line.trim())),
			yes: button.charAt(0).toUpperCase() + button.slice(1).replace(/[?？]/, "")
		});

		if (stream)
			await tell({ question, yes: agreed });
	}

	function end(error) {
		if (error)
			say(error.message, { class: "problem" });
		stream?.close();
		stream = running = null;
		start.disabled = false;
		cancel.hidden = true;
	}

	/* The server does it, step by step. */
	function setUp() {
		const bus = findBus();
		const move = {
			bus: bus?.name,
			what: what.value,
			from: Number(address.input.value),
			speed: Number(at.value),
			to: Number(what.value === "address" ? to.input.value : toSpeed.value)
		};

		if (!bus || running)
			return;
		steps.replaceChildren();
		text.show("");
		start.disabled = true;
		cancel.hidden = false;
		running = () => tell({ end: true });
		stream = openStream("setup", move, {
			once: true,
			onEvent(name, data) {
				if (name === "ask")
					answer(bus, move, data);
				else if (name === "say" || name === "problem")
					say(inLanguage(data.text), name === "problem" ? { class: "problem" } : {});
				if (data.configuration)
					text.show(data.configuration);
			},
			onState(state, error) {
				if (state === "ended" || state === "failed")
					end(error);
			}
		});
	}

	toSpeedField.hidden = true;
	what.addEventListener("change", chooseWhat);
	cancel.addEventListener("click", () => running?.());
	form.addEventListener("submit", (event) => {
		event.preventDefault();
		setUp();
	});
	return {
		node: form,
		fillSpeeds,
		choose(find) {
			address.input.value = find.address;
			at.value = find.speed === findBus()?.speed ? 0 : find.speed;
			to.input.focus();
		},
		end: () => stream && end()
	};
}

let end = null;

export function show(root, context, busName) {
	const select = element("select", { id: "scan-bus" });
	const findBus = () => context.plant.buses.get(select.value)?.description;

	root.append(
		element(
			"div",
			{ class: "view-head" },
			element("h1", {}, t("Scan")),
			createField(t("Bus"), select, "inline")
		)
	);
	if (!context.may("manage")) {
		root.append(
			element(
				"p",
				{ class: "panel" },
				t("A scan asks every address of a bus, and setting up a drive ") +
					t("changes it. ") +
					context.whyNot("manage")
			)
		);
		select.parentNode.hidden = true;
		return;
	}
	const setUp = createSetUp(context, findBus);
	const search = createSearch(context, findBus, setUp.choose);

	function fillSpeeds() {
		search.fillSpeeds();
		setUp.fillSpeeds();
	}

	/* A scan that takes the bus out of service changes the description: the choice stays. */
	function fill() {
		const names = [...context.plant.buses.keys()];
		const before = select.value;

		if (
			running ||
			names.join("\n") ===
				[...select.options].map((option) => option.value).join("\n")
		)
			return;
		select.replaceChildren(
			...names.map((name) => element("option", { value: name }, name))
		);
		if (names.includes(before || busName))
			select.value = before || busName;
		fillSpeeds();
	}

	select.addEventListener("change", () => {
		running?.();
		search.reset();
		fillSpeeds();
	});
	root.append(search.node, setUp.node);
	context.on("describe", fill);
	fill();
	end = setUp.end;
}

export function hide() {
	end?.();
	running?.();
	end = null;
}
