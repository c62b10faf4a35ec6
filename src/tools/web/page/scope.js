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
import { createNumberField } from "./number_field.js";
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

let scope = null;

/* How a drive's counts are shown. */
async function readScale(context, drive) {
	const known = await context.registers(drive);
	const names = ["unit_name", "counts_per_unit"].filter((name) => known.has(name));
	const { values } = await call("Read", { drive, names });

	return createScale(values.unit_name, values.counts_per_unit);
}

/* --- choosing a value -------------------------------------------------------------------------- */

/*
 * Chooses a drive and one of its values; `none` is the word for no drive. onChange() is called
 * after another choice. Of what it returns, `registers` and `scale` are of the chosen drive.
 */
function createChooser(context, { prefix, words, none, onChange }) {
	const drive = element("select", { id: `${prefix}-drive` });
	const value = element("select", { id: `${prefix}-value` });
	const chooser = {
		context,
		none,
		drive,
		value,
		registers: new Map(),
		scale: createScale("", NaN),
		turn: 0, /* of the latest choice of a drive */
		fields: [createField(words[0], drive), createField(words[1], value)]
	};

	drive.addEventListener("change", () =>
		fillValues(chooser, value.value).then(onChange, context.report));
	value.addEventListener("change", onChange);
	return chooser;
}

function registerOf({ registers, value }) { return registers.get(value.value); }

function isNumber(register) { return register && register.type !== "text"; }

function makeOptions({ scale }, label, registers) {
	return element("optgroup", { label }, registers.filter(isNumber).map((register) =>
		element("option", { value: register.name },
			register.name + (register.unit ? ` [${scale.unit(register)}]` : ""))));
}

/* First the drive's cyclic values, then its parameters. */
async function fillValues(chooser, wanted) {
	const { context, value } = chooser;
	const turn = ++chooser.turn;
	const drive = chooser.drive.value;

	value.replaceChildren();
	value.disabled = true;
	if (!drive)
		return;
	const [registers, { values }, scale] = await Promise.all([
		context.registers(drive),
		call("Read", { drive, names: [] }),
		readScale(context, drive)
	]);

	if (turn !== chooser.turn)
		return;
	Object.assign(chooser, { registers, scale });
	value.append(
		makeOptions(chooser, t("Process data"), Object.keys(values).map((name) => registers.get(name))),
		makeOptions(chooser, t("Parameters"), [...registers.values()].filter(({ parameter }) => parameter)));
	value.disabled = false;
	if (wanted && registers.has(wanted))
		value.value = wanted;
}

function fillDrives({ context, drive, none }, wanted) {
	const before = drive.value || wanted;

	drive.replaceChildren(
		...(none ? [element("option", { value: "" }, none)] : []),
		...[...context.plant.drives.keys()].map((name) => element("option", { value: name }, name)));
	if (context.plant.drives.has(before))
		drive.value = before;
}

/* --- its elements ----------------------------------------------------------------------------- */

function makeSeconds(id, min, value) {
	return createNumberField({ id, class: "short", unit: "s", min, max: SECONDS_MOST, value, required: true });
}

function makeParts() {
	const codes = element("datalist", { id: newId("codes") });

	return {
		list: element("ul", { id: "scope-channels", class: "chips", "aria-label": t("Values that are captured") }),
		addButton: element("button", { id: "scope-add", type: "button" }, t("Add")),
		relation: element("select", { id: "scope-relation" }, RELATIONS.map((sign, at) =>
			element("option", { value: sign }, RELATION_WORDS[at]))),
		codes,
		limit: element("input", { id: "scope-limit", type: "text", autocomplete: "off", list: codes.id }),
		unit: element("span", { id: "scope-unit", class: "unit" }),
		move: element("button", { id: "scope-move", type: "button" }, t("Wait for the next move")),
		mode: element("select", { id: "scope-mode" }, Object.entries(MODES).map(([value, words]) =>
			element("option", { value }, words))),
		before: makeSeconds("scope-before", 0, 0.5),
		duration: makeSeconds("scope-duration", 0.01, 2),
		start: element("button", { id: "scope-start", class: "primary", type: "submit" }, t("Start")),
		stop: element("button", { id: "scope-stop", type: "button", hidden: true }, t("Stop")),
		save: element("button", { id: "scope-save", type: "button", disabled: true }, t("Download as CSV")),
		problem: element("p", { id: "scope-problem", class: "problem", role: "alert" }),
		said: element("p", { id: "scope-said", role: "status" },
			t("Choose values, and perhaps a trigger; then start.")),
		place: element("div")
	};
}

function makeForm({ add, source, conditions, ...parts }) {
	return element("form", { class: "panel scope-settings", "aria-label": t("What is captured") },
		element("div", { class: "toolbar filters" }, add.fields, parts.addButton, parts.list),
		element("div", { class: "toolbar filters" }, source.fields[0], conditions, parts.codes),
		element("div", { class: "toolbar filters" },
			createField(t("Mode"), parts.mode),
			createField(t("Before, s"), parts.before.input),
			createField(t("After, s"), parts.duration.input),
			parts.start, parts.move, parts.stop, parts.save));
}

export function show(root, context, driveName) {
	const mine = scope = {
		context,
		driveName,
		channels: [],
		...makeParts(),
		add: createChooser(context, { prefix: "scope-add", words: [t("Drive"), t("Value")], none: "", onChange() {} }),
		source: createChooser(context, { prefix: "scope-trigger", words: [t("Trigger"), t("Value")],
			none: t("none: at once"), onChange: () => showCondition(mine) }),
		conditions: [],
		form: null,
		capture: null,
		captured: [], /* channels of the capture */
		stream: null,
		plot: null,
		dirty: false,
		drawnAt: 0,
		triggeredAt: 0,
		lastsMs: 0,
		ending: "",
		turn: 0 /* of the latest start */
	};

	mine.conditions = [
		mine.source.fields[1],
		createField(t("Condition"), mine.relation),
		element("label", { class: "field", for: mine.limit.id }, t("Value it waits for"),
			element("span", { class: "with-unit" }, mine.limit, mine.unit))
	];
	mine.form = makeForm(mine);
	listen(mine);
	root.append(element("div", { class: "view-head" }, element("h1", {}, t("Oscilloscope"))), mine.form, mine.problem,
		element("section", { class: "panel", "aria-label": t("Capture") }, mine.said, mine.place));
	context.on("frame", (now) => frame(mine, now));
	showCondition(mine);
	context.on("describe", () => fill(mine).catch(context.report));
	fill(mine).catch(context.report);
}

export function hide() {
	if (!scope)
		return;
	scope.turn++;
	scope.stream?.close();
	scope.plot?.destroy();
	scope = null;
}

function listen(mine) {
	const { context, add } = mine;
	const refuse = (error) => showProblem(mine, error) || context.report(error);

	mine.addButton.addEventListener("click", () => addChannel(mine, add.drive.value, registerOf(add)));
	mine.move.addEventListener("click", () => waitForMove(mine).catch(refuse));
	mine.stop.addEventListener("click", () => {
		end(mine, "");
		mine.start.focus();
	});
	mine.save.addEventListener("click", () => saveFile(`capture-${nameTime()}.csv`,
		[writeCsv(mine.capture.shown, mine.captured)], "text/csv"));
	mine.form.addEventListener("submit", (event) => {
		event.preventDefault();
		begin(mine).catch(refuse);
	});
}

/* With the usual values, unless something is already chosen. */
async function fill(mine) {
	const { add, channels, context } = mine;

	fillDrives(add, mine.driveName);
	fillDrives(mine.source, "");
	if (!add.drive.value || channels.length > 0)
		return;
	await fillValues(add, FIRST_NAMES[0]);
	const known = await context.registers(add.drive.value);

	if (channels.length === 0)
		FIRST_NAMES.forEach((name) => addChannel(mine, add.drive.value, known.get(name)));
}

/* --- settings --------------------------------------------------------------------------------- */

function showChannels(mine) {
	const { channels, addButton } = mine;

	mine.list.replaceChildren(...channels.map((channel, index) => {
		const name = `${channel.drive}.${channel.name}`;
		const leaveOut = () => {
			channels.splice(index, 1);
			showChannels(mine);
			addButton.focus();
		};

		return element("li", { class: "badge" }, name, element("button", { class: "quiet small", type: "button",
			"aria-label": t("Leave out {name}", { name }), onclick: leaveOut }, icon("close")));
	}));
	addButton.disabled = channels.length >= CHANNELS_MOST;
}

function addChannel(mine, drive, register) {
	const { channels } = mine;
	const isThere = channels.some((channel) => channel.drive === drive && channel.name === register?.name);

	if (!register || channels.length >= CHANNELS_MOST || isThere)
		return;
	channels.push({ drive, name: register.name, register });
	showChannels(mine);
}

function showCondition(mine) {
	const { source, relation } = mine;
	const register = registerOf(source);
	const bits = hasBits(register);

	setText(mine.unit, register ? source.scale.unit(register) : "");
	mine.conditions.forEach((each) => {
		each.hidden = source.drive.value === "";
	});
	/* Without a trigger there is nothing before it, and nothing to wait for. */
	mine.before.input.disabled = mine.mode.disabled = source.drive.value === "";
	mine.codes.replaceChildren(...Object.values(register?.codes ?? {}).map((name) =>
		element("option", { value: bits ? name : inWords(name) })));
	if (bits && relation.selectedIndex > 1)
		relation.selectedIndex = 0;
	relation.options[2].disabled = relation.options[3].disabled = bits;
}

/* The server reads it, and marks the samples. A number is typed in the users' unit and their language, and told in
 * the drive's own; names and whole numbers are told as they are. Throws a BadValue. */
function readTrigger({ source, limit, relation, unit }) {
	const { scale } = source;
	const drive = source.drive.value;
	const register = registerOf(source);
	const name = register?.name;
	const typed = limit.value.trim().replace("−", "-");
	const { value, problem } = register ? parseValue(scale.typed(register), typed) : {};
	const isReal = register && scale.typed(register).type === "f32" && !register.codes && !hasBits(register);

	if (isReal && problem)
		throw Object.assign(new Error(problem), { name: "BadValue" });
	const told = isReal ? scale.take(register, value) : typed;
	const relates = RELATION_WORDS[relation.selectedIndex];

	return {
		drive,
		name,
		words: `${drive}.${name}${relation.value}${told}`,
		said: `${drive}.${name} ${relates} ${`${typed} ${unit.textContent}`.trim()}`,
		level: typeof value === "number" && (relation.value !== "!=" || Number(told) !== 0) && !register.codes && !hasBits(register)
			? { unit: scale.unit(register), value: Number(value) }
			: null
	};
}

function showProblem({ problem, limit }, error) {
	const isWrong = error?.name === "BadValue";

	setText(problem, isWrong ? error.message : "");
	limit.setAttribute("aria-invalid", isWrong);
	if (isWrong)
		limit.focus();
	return isWrong;
}

/* A drive moves when its velocity is not 0 any more. */
async function waitForMove(mine) {
	const { source } = mine;

	source.drive.value = mine.channels[0]?.drive ?? mine.add.drive.value;
	await fillValues(source, "velocity");
	mine.relation.value = "!=";
	mine.limit.value = "0";
	mine.mode.value = "single";
	showCondition(mine);
	await begin(mine);
}

/* --- capturing -------------------------------------------------------------------------------- */

/* A drive that has just answered for the first time has its unit only now. */
async function scaleChannel(context, { drive, name, register }) {
	const scale = await readScale(context, drive);

	return {
		drive,
		name,
		register,
		unit: scale.unit(register),
		show: (value) => scale.show(register, value)
	};
}

async function begin(mine) {
	const trigger = mine.source.drive.value !== "" ? readTrigger(mine) : null;

	if (!mine.form.reportValidity())
		return;
	if (mine.channels.length === 0) {
		setText(mine.problem, t("no value is chosen: add one"));
		return;
	}
	end(mine, "");
	showProblem(mine, null);
	const turn = ++mine.turn;
	const captured = await Promise.all(mine.channels.map((channel) => scaleChannel(mine.context, channel)));

	/* Another start was pressed, or the page left. */
	if (turn !== mine.turn)
		return;
	mine.captured = captured;
	mine.lastsMs = mine.duration.read() * 1000;
	mine.capture = createCapture({
		mode: trigger ? mine.mode.value : "single",
		trigger: trigger !== null,
		beforeUs: trigger ? mine.before.read() * 1e6 : 0,
		durationUs: mine.lastsMs * 1000
	});
	mine.capture.waitsFor = trigger?.said ?? t("the first sample");
	mine.plot?.destroy();
	mine.plot = createCapturePlot(captured, trigger?.level ?? null);
	mine.place.replaceChildren(mine.plot.node);
	mine.save.disabled = true;
	mine.ending = "";
	subscribe(mine, trigger);
	showState(mine);
}

function subscribe(mine, trigger) {
	const wanted = trigger ? [...mine.captured, trigger] : mine.captured;

	mine.stream = openStream("Subscribe", {
		drives: [...new Set(wanted.map((each) => each.drive))],
		names: [...new Set(wanted.map((each) => each.name))],
		interval_ms: 0,
		...(trigger ? { trigger: trigger.words } : {})
	}, {
		once: true,
		onData: ({ samples }) => take(mine, samples),
		onState(state, error) {
			if (state === "failed")
				end(mine, showProblem(mine, error) ? t("Stopped.") : t("It came to an end: {message}.", { message: error.message }));
		}
	});
}

function take(mine, samples) {
	const { capture } = mine;

	for (const sample of samples) {
		const waited = capture.state === "waiting";

		mine.dirty = capture.take(sample) || mine.dirty;
		if (waited && capture.state === "triggered")
			mine.triggeredAt = performance.now();
	}
	if (capture.state === "stopped")
		end(mine, "");
}

function end(mine, why) {
	mine.stream?.close();
	mine.stream = null;
	mine.ending = why;
	mine.dirty = mine.capture?.stop() || mine.dirty;
	if (mine.capture)
		frame(mine, Infinity);
}

function frame(mine, now) {
	const { capture } = mine;

	/* Silent drives send no more times. */
	if (capture?.state === "triggered" &&
	    now - mine.triggeredAt > mine.lastsMs + GRACE_MS)
		mine.dirty = capture.flush() || mine.dirty;
	if (now - mine.drawnAt < DRAW_EVERY_MS)
		return;
	mine.drawnAt = Number.isFinite(now) ? now : mine.drawnAt;
	if (mine.dirty && capture.shown.rows.length > 0) {
		mine.plot.show(capture.shown);
		mine.save.disabled = false;
	}
	mine.dirty = false;
	showState(mine);
}

function showState({ capture, ending, start, move, stop, said }) {
	if (!capture)
		return;
	const { shown, count, lost, state } = capture;
	const words = {
		waiting: t("Waits for {waitsFor}.", { waitsFor: capture.waitsFor }),
		triggered: t("{waitsFor} came.", { waitsFor: capture.waitsFor }),
		stopped: ending || (count === 0 ? t("Stopped; {waitsFor} did not come.", { waitsFor: capture.waitsFor }) : t("Stopped."))
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
