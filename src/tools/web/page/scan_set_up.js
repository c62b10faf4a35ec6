/* SPDX-License-Identifier: Apache-2.0 */
/* Gives a drive another address or speed, step by step. */
import { ask, openStream } from "./api.js";
import { createField, element } from "./dom.js";
import { createPasteText } from "./paste_text.js";
import { askUser } from "./question.js";
import { createNumber } from "./scan_number.js";
import { inLanguage, t } from "./words.js";

/*
 * findBus() describes the bus that is chosen; action: of scan.js. Returns { node, fillSpeeds(), choose(find), end() }.
 */
export function createSetUp({ context, findBus, action }) {
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
		stream = action.end = null;
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

		if (!bus || action.end)
			return;
		steps.replaceChildren();
		text.show("");
		start.disabled = true;
		cancel.hidden = false;
		action.end = () => tell({ end: true });
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
	cancel.addEventListener("click", () => action.end?.());
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
