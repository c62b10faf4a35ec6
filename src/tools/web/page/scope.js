/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Values of drives at each cycle of their bus, as on an oscilloscope: from some time before a
 * trigger on. It shows what `drivebridgectl record` writes into a file.
 */
import { call, openStream } from "./api.js";
import { createCapture, writeCsv } from "./capture.js";
import { CHANNELS_MOST, createCapturePlot } from "./capture_plot.js";
import { createField, element, icon, newId, setText } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { createScale, hasBits, inWords, parseValue } from "./format.js";
import { t } from "./words.js";

export const title = t("Oscilloscope");

const MODES = {
	single: t("single: one and then stop"),
	normal: t("normal: each trigger"),
	auto: t("auto: also without")
};
/* Of a condition, as in drivebridgectl record --trigger. */
const RELATION_WORDS = [t("is"), t("is not"), t("rises above"), t("falls below")];
const RELATIONS = ["=", "!=", ">", "<"];
const FIRST_NAMES = ["position", "velocity"];
const SECONDS_MOST = 600;
/* Data may arrive this much later than their time. */
const GRACE_MS = 500;
const DRAW_EVERY_MS = 100;

let view = null;

/* How a drive's counts are shown. */
async function readScale(context, drive) {
	const known = await context.registers(drive);
	const names = ["unit_name", "counts_per_unit"].filter((name) => known.has(name));
	const { values } = await call("Read", { drive, names });

	return createScale(values.unit_name, values.counts_per_unit);
}

/*
 * Chooses a drive and one of its values; `none` is the word for no drive. onChange() is called
 * after another choice.
 */
function createChooser(context, { prefix, words, none, onChange }) {
	const drive = element("select", { id: `${prefix}-drive` });
	const value = element("select", { id: `${prefix}-value` });
	let registers = new Map();
	let scale = createScale("", NaN);
	let turn = 0;

	/* First the drive's cyclic values, then its parameters. */
	async function fillValues(wanted) {
		const mine = ++turn;
		const name = drive.value;

		value.replaceChildren();
		value.disabled = true;
		if (!name)
			return;
		const [known, { values }, drivesScale] = await Promise.all([
			context.registers(name),
			call("Read", { drive: name, names: [] }),
			readScale(context, name)
		]);

		if (mine !== turn)
			return;
		scale = drivesScale;
		const isNumber = (register) => register && register.type !== "text";
		const options = (list) =>
			list.map((register) =>
				element(
					"option",
					{ value: register.name },
					register.name + (register.unit ? ` [${scale.unit(register)}]` : "")
				)
			);

		registers = known;
		value.append(
			element(
				"optgroup",
				{ label: t("Process data") },
				options(
					Object.keys(values)
						.map((each) => known.get(each))
						.filter(isNumber)
				)
			),
			element(
				"optgroup",
				{ label: t("Parameters") },
				options(
					[...known.values()].filter(
						(register) =>
							register.parameter && isNumber(register)
					)
				)
			)
		);
		value.disabled = false;
		if (wanted && known.has(wanted))
			value.value = wanted;
	}

	function fillDrives(wanted) {
		const before = drive.value || wanted;

		drive.replaceChildren(
			...(none ? [element("option", { value: "" }, none)] : []),
			...[...context.plant.drives.keys()].map((name) =>
				element("option", { value: name }, name)
			)
		);
		if (context.plant.drives.has(before))
			drive.value = before;
	}

	drive.addEventListener("change", () =>
		fillValues(value.value).then(onChange, context.report)
	);
	value.addEventListener("change", onChange);
	return {
		drive,
		value,
		fillDrives,
		fillValues,
		register: () => registers.get(value.value),
		scale: () => scale,
		fields: [createField(words[0], drive), createField(words[1], value)]
	};
}

function createView(root, context, driveName) {
	const channels = [];
	const add = createChooser(context, {
		prefix: "scope-add",
		words: [t("Drive"), t("Value")],
		none: "",
		onChange() {}
	});
	const source = createChooser(context, {
		prefix: "scope-trigger",
		words: [t("Trigger"), t("Value")],
		none: t("none: at once"),
		onChange: () => showCondition()
	});
	const list = element("ul", {
		id: "scope-channels",
		class: "chips",
		"aria-label": t("Values that are captured")
	});
	const addButton = element("button", { id: "scope-add", type: "button" }, t("Add"));
	const relation = element(
		"select",
		{ id: "scope-relation" },
		RELATIONS.map((sign, at) =>
			element(
				"option",
				{ value: sign },
				RELATION_WORDS[at]
			)
		)
	);
	const codes = element("datalist", { id: newId("codes") });
	const limit = element("input", {
		id: "scope-limit",
		type: "text",
		autocomplete: "off",
		list: codes.id
	});
	const unit = element("span", { id: "scope-unit", class: "unit" });
	const move = element(
		"button",
		{ id: "scope-move", type: "button" },
		t("Wait for the next move")
	);
	const mode = element(
		"select",
		{ id: "scope-mode" },
		Object.entries(MODES).map(([value, words]) => element("option", { value }, words))
	);
	const before = element("input", {
		id: "scope-before",
		type: "number",
		min: 0,
		max: SECONDS_MOST,
		step: "any",
		value: 0.5
	});
	const duration = element("input", {
		id: "scope-duration",
		type: "number",
		min: 0.01,
		max: SECONDS_MOST,
		step: "any",
		value: 2
	});
	const start = element(
		"button",
		{ id: "scope-start", class: "primary", type: "submit" },
		t("Start")
	);
	const stop = element("button", { id: "scope-stop", type: "button", hidden: true }, t("Stop"));
	const save = element(
		"button",
		{ id: "scope-save", type: "button", disabled: true },
		t("Download as CSV")
	);
	const problem = element("p", { id: "scope-problem", class: "problem", role: "alert" });
	const said = element(
		"p",
		{ id: "scope-said", role: "status" },
		t("Choose values, and perhaps a trigger; then start.")
	);
	const place = element("div");
	const conditions = [
		source.fields[1],
		createField(t("Condition"), relation),
		element(
			"label",
			{ class: "field", for: limit.id },
			t("Value it waits for"),
			element("span", { class: "with-unit" }, limit, unit)
		)
	];
	const form = element(
		"form",
		{ class: "panel scope-settings", "aria-label": t("What is captured") },
		element("div", { class: "toolbar filters" }, add.fields, addButton, list),
		element("div", { class: "toolbar filters" }, source.fields[0], conditions, codes),
		element(
			"div",
			{ class: "toolbar filters" },
			createField(t("Mode"), mode),
			createField(t("Before, s"), before),
			createField(t("After, s"), duration),
			start,
			move,
			stop,
			save
		)
	);
	let capture = null;
	let captured = []; /* channels of the capture */
	let stream = null;
	let plot = null;
	let dirty = false;
	let drawnAt = 0;
	let triggeredAt = 0;
	let ending = "";
	let turn = 0; /* of the latest start */

	/* --- settings --- */

	function showChannels() {
		list.replaceChildren(
			...channels.map((channel, index) => {
				const name = `${channel.drive}.${channel.name}`;
				const button = element(
					"button",
					{
						class: "quiet small",
						type: "button",
						"aria-label": t("Leave out {name}", { name })
					},
					icon("close")
				);

				button.addEventListener("click", () => {
					channels.splice(index, 1);
					showChannels();
					addButton.focus();
				});
				return element("li", { class: "badge" }, name, button);
			})
		);
		addButton.disabled = channels.length >= CHANNELS_MOST;
	}

	function addChannel(drive, register) {
		if (
			!register ||
			channels.length >= CHANNELS_MOST ||
			channels.some(
				(channel) =>
					channel.drive === drive && channel.name === register.name
			)
		)
			return;
		channels.push({ drive, name: register.name, register });
		showChannels();
	}

	function showCondition() {
		const register = source.register();
		const bits = hasBits(register);

		setText(unit, register ? source.scale().unit(register) : "");
		conditions.forEach((each) => {
			each.hidden = source.drive.value === "";
		});
		/* Without a trigger there is nothing before it, and nothing to wait for. */
		before.disabled = mode.disabled = source.drive.value === "";
		codes.replaceChildren(
			...Object.values(register?.codes ?? {}).map((name) =>
				element("option", { value: bits ? name : inWords(name) })
			)
		);
		if (bits && relation.selectedIndex > 1)
			relation.selectedIndex = 0;
		relation.options[2].disabled = relation.options[3].disabled = bits;
	}

	/* The server reads it, and marks the samples. A number is typed in the users' unit, and told in
	 * the drive's own; names, and what is wrong, are told as they are. */
	function readTrigger() {
		const register = source.register();
		const scale = source.scale();
		const name = register?.name;
		const typed = limit.value.trim().replace("−", "-");
		const { value } = register ? parseValue(scale.typed(register), typed) : {};
		const isScaled = scale.isScaled(register) && typeof value === "number";
		const told = isScaled ? scale.take(register, value) : typed;
		const relates = RELATION_WORDS[relation.selectedIndex];

		return {
			drive: source.drive.value,
			name,
			words: `${source.drive.value}.${name}${relation.value}${told}`,
			said: `${source.drive.value}.${name} ${relates} ${`${typed} ${unit.textContent}`.trim()}`,
			level: typeof value === "number" && Number(told) !== 0 && !register.codes && !hasBits(register)
				? { unit: scale.unit(register), value: Number(value) }
				: null
		};
	}

	function showProblem(error) {
		const isWrong = error?.name === "BadValue";

		setText(problem, isWrong ? error.message : "");
		limit.setAttribute("aria-invalid", isWrong);
		if (isWrong)
			limit.focus();
		return isWrong;
	}

	/* A drive moves when its velocity is not 0 any more. */
	async function waitForMove() {
		source.drive.value = channels[0]?.drive ?? add.drive.value;
		await source.fillValues("velocity");
		relation.value = "!=";
		limit.value = "0";
		mode.value = "single";
		showCondition();
		await begin();
	}

	/* --- capturing --- */

	/* A drive that has just answered for the first time has its unit only now. */
	async function scaleChannel({ drive, name, register }) {
		const scale = await readScale(context, drive);

		return {
			drive,
			name,
			register,
			unit: scale.unit(register),
			show: (value) => scale.show(register, value)
		};
	}

	async function begin() {
		const triggered = source.drive.value !== "";
		const trigger = triggered ? readTrigger() : null;

		if (!form.reportValidity())
			return;
		if (channels.length === 0) {
			setText(problem, t("no value is chosen: add one"));
			return;
		}
		end("");
		showProblem(null);
		const mine = ++turn;
		const scaled = await Promise.all(channels.map(scaleChannel));

		/* Another start was pressed, or the page left. */
		if (mine !== turn)
			return;
		captured = scaled;
		capture = createCapture({
			mode: triggered ? mode.value : "single",
			trigger: triggered,
			beforeUs: triggered ? Number(before.value) * 1e6 : 0,
			durationUs: Number(duration.value) * 1e6
		});
		capture.waitsFor = trigger?.said ?? t("the first sample");
		plot?.destroy();
		plot = createCapturePlot(captured, trigger?.level ?? null);
		place.replaceChildren(plot.node);
		const wanted = trigger ? [...captured, trigger] : captured;

		save.disabled = true;
		ending = "";
		stream = openStream(
			"Subscribe",
			{
				drives: [...new Set(wanted.map((each) => each.drive))],
				names: [...new Set(wanted.map((each) => each.name))],
				interval_ms: 0,
				...(trigger ? { trigger: trigger.words } : {})
			},
			{
				once: true,
				onData: take,
				onState(state, error) {
					if (state === "failed")
						end(showProblem(error) ? t("Stopped.") : t("It came to an end: {message}.", { message: error.message }));
				}
			}
		);
		showState();
	}

	function take({ samples }) {
		for (const sample of samples) {
			const waited = capture.state === "waiting";

			dirty = capture.take(sample) || dirty;
			if (waited && capture.state === "triggered")
				triggeredAt = performance.now();
		}
		if (capture.state === "stopped")
			end("");
	}

	function end(why) {
		stream?.close();
		stream = null;
		ending = why;
		dirty = capture?.stop() || dirty;
		if (capture)
			frame(Infinity);
	}

	function frame(now) {
		/* Silent drives send no more times. */
		if (
			capture?.state === "triggered" &&
			now - triggeredAt > Number(duration.value) * 1000 + GRACE_MS
		)
			dirty = capture.flush() || dirty;
		if (now - drawnAt < DRAW_EVERY_MS)
			return;
		drawnAt = Number.isFinite(now) ? now : drawnAt;
		if (dirty && capture.shown.rows.length > 0) {
			plot.show(capture.shown);
			save.disabled = false;
		}
		dirty = false;
		showState();
	}

	function showState() {
		if (!capture)
			return;
		const { shown, count, lost, state } = capture;
		const words = {
			waiting: t("Waits for {waitsFor}.", { waitsFor: capture.waitsFor }),
			triggered: `${capture.waitsFor} came.`,
			stopped:
				ending ||
				(count === 0
					? t("Stopped; {waitsFor} did not come.", { waitsFor: capture.waitsFor })
					: t("Stopped."))
		}[state];

		start.hidden = state !== "stopped";
		move.hidden = start.hidden;
		stop.hidden = !start.hidden;
		const parts = shown
			? [
					count > 1 ? t("Capture {count}: ", { count }) : "",
					t("{count} samples", { count: shown.rows.length }),
					shown.triggered ? "" : t(" without a trigger"),
					shown.cut ? t(", more were cut off") : "",
					t(", {lost} lost.", { lost })
				]
			: [];

		setText(said, `${words} ${parts.join("")}`.trim());
	}

	addButton.addEventListener("click", () =>
		addChannel(add.drive.value, add.register())
	);
	move.addEventListener("click", () => waitForMove().catch(context.report));
	stop.addEventListener("click", () => {
		end("");
		start.focus();
	});
	save.addEventListener("click", () =>
		saveFile(
			`capture-${nameTime()}.csv`,
			[writeCsv(capture.shown, captured)],
			"text/csv"
		)
	);
	form.addEventListener("submit", (event) => {
		event.preventDefault();
		begin().catch(context.report);
	});
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Oscilloscope"))),
		form,
		problem,
		element("section", { class: "panel", "aria-label": t("Capture") }, said, place)
	);
	context.on("frame", frame);

	/* With the usual values, unless something is already chosen. */
	async function fill() {
		add.fillDrives(driveName);
		source.fillDrives("");
		if (!add.drive.value || channels.length > 0)
			return;
		await add.fillValues(FIRST_NAMES[0]);
		const known = await context.registers(add.drive.value);

		if (channels.length === 0)
			FIRST_NAMES.forEach((name) =>
				addChannel(add.drive.value, known.get(name))
			);
	}

	showCondition();
	context.on("describe", () => fill().catch(context.report));
	fill().catch(context.report);
	return {
		close() {
			turn++;
			stream?.close();
			plot?.destroy();
		}
	};
}

export function show(root, context, driveName) {
	view = createView(root, context, driveName);
}

export function hide() {
	view?.close();
	view = null;
}
