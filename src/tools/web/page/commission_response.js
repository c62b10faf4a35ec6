/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the drive answers to a step: its overshoot and settling time beside the parameters that change
 * them. Other values are tried, then kept or put back; nothing is kept in the drive before it is saved. The
 * step is one of the position (a way), or of the speed where the drive has no move over a way, or where
 * the user wants that.
 */
import { call, getSession, openStream } from "./api.js";
import { thin } from "./commission_record.js";
import { createSpeedStep } from "./commission_speed.js";
import { createField, element, setText } from "./dom.js";
import { codeName, formatReal, formatWithUnit, parseValue } from "./format.js";
import { whyNotNow } from "./next_step.js";
import { BAND, cutResponse, measureResponse, nameResponse, sayResponse } from "./response.js";
import { drawResponse } from "./response_plot.js";
import { inLanguage, t } from "./words.js";

/* Parameters of the families that change how a drive answers. */
const SHAPING = ["acc", "dec", "cra", "crn", "crh", "ramp_acceleration", "ramp_deceleration", "max_speed",
	"min_speed", "acceleration_time"];
/* Once it stands it is watched this much longer, and so much of the whole time: settling takes time. */
const QUIET_MS = 500;
const QUIET_PART = 0.15;
const LONGEST_MS = 60000;
const RESPONSES_MOST = 2;
/* An end that is off by this part of the distance is another one. */
const WAY_OFF = 0.1;
/* The first step, as a part of the way between the limits, or in counts. */
const PART_FIRST = 0.05;
const COUNTS_FIRST = 1600;
/* The first speed without a preset one, as a part of the highest one. */
const SPEED_PART_FIRST = 0.1;

/* Kinds of steps, with the command that makes each; the first one that the drive has is shown. */
const KINDS = { way: "move_relative", speed: "move_velocity" };

const isMoving = (state) => ["DiscreteMotion", "Stopping"].includes(state);

/*
 * Gives the move once values come, and resolves with [{ time_us, value }] of its position in counts, until it
 * stands. signal: gives up.
 */
function recordMove(path, parameters, signal) {
	const { name, registers } = path;
	const samples = [];
	let begun = false;
	let moved = false;
	let stoodAt = 0;

	return new Promise((resolve, reject) => {
		const stream = openStream("Subscribe",
			{ drives: [name], names: ["position", "axis_state"], interval_ms: 0 }, {
				once: true,
				onData: (answer) => answer.samples.forEach(take),
				onState(state, error) {
					if (state === "failed" || state === "ended")
						finish(reject, error ?? new Error(t("the connection to the gateway was lost")));
				},
			});
		const timer = setTimeout(() => finish(reject, new Error(t("It did not stand in time"))), LONGEST_MS);

		function finish(settle, value) {
			clearTimeout(timer);
			signal.removeEventListener("abort", giveUp);
			settle(value);
			stream.close();
		}

		function giveUp() { finish(reject, new Error(t("Not finished"))); }

		function take({ time_us: time, values }) {
			const state = codeName(registers.get("axis_state"), values.axis_state);

			samples.push({ time_us: time, value: values.position });
			if (!begun) {
				begun = true;
				call("Run", { drive: name, command: "move_relative", arguments: parameters })
					.catch((error) => finish(reject, error));
			}
			moved = moved || isMoving(state) || values.position !== samples[0].value;
			if (!moved || isMoving(state)) {
				stoodAt = 0;
				return;
			}
			stoodAt ||= time;
			if (time - stoodAt > Math.max(QUIET_MS * 1000, QUIET_PART * (time - samples[0].time_us)))
				finish(resolve, samples);
		}

		signal.addEventListener("abort", giveUp);
	});
}

/* path: see commission.js. */
export function createResponse(path) {
	const mine = { path, busy: false, side: 1, abort: new AbortController(), last: {}, inputs: new Map() };

	mine.kinds = Object.keys(KINDS).filter((kind) => path.commands.has(KINDS[kind]));
	mine.kind = path.record.responses[0]?.kind ?? "way";
	if (!mine.kinds.includes(mine.kind))
		mine.kind = mine.kinds[0] ?? "";
	mine.parameters = SHAPING.map((name) => path.registers.get(name)).filter((one) => one?.parameter && one.writable);
	build(mine);
	if (mine.kind)
		readNow(mine).catch((error) => setText(mine.problem, error.message));
	return {
		node: mine.node,
		update(next) {
			mine.last = next;
			showButtons(mine);
		},
		release: () => mine.held?.release(),
		close() {
			mine.held?.release();
			mine.abort.abort();
		},
	};
}

/* --- its elements ----------------------------------------------------------------------------- */

function firstDistance({ drive, scale, registers }) {
	const { min_position: min, max_position: max } = drive()?.description ?? {};

	const first = max > min ? (max - min) * PART_FIRST : scale.show(registers.get("target_position"), COUNTS_FIRST);

	return Number(first.toPrecision(1));
}

/* 0 in a move over a way: the drive's own speed, which is all that some have for it. */
function firstSpeed({ registers, scale }, preset) {
	const velocity = registers.get("target_velocity");

	return preset ? Math.abs(scale.show(velocity, preset)) : Math.abs(scale.typed(velocity).max ?? 0) * SPEED_PART_FIRST;
}

function build(mine) {
	const { path } = mine;
	const { registers, preset } = path;
	const velocity = registers.get("target_velocity");
	const number = (id, value) => element("input", { id, type: "text", inputmode: "decimal", autocomplete: "off",
		class: "short", value });
	const button = (id, words, onclick, kind = null) => element("button",
		{ id: `response-${id}`, type: "button", class: kind, onclick }, words);

	mine.distance = number("response-distance", formatReal(firstDistance(path)));
	mine.speed = number("response-speed", formatReal(firstSpeed(path, preset)));
	mine.make = button("make", t("Make the step"), () => act(mine, makeStep), "primary");
	mine.try = button("try", "", () => act(mine, tryValues), "primary");
	mine.keep = button("keep", t("Keep them"), () => act(mine, keepValues));
	mine.back = button("back", t("Put the former ones back"), () => act(mine, putBack));
	mine.said = element("p", { id: "response-said", role: "status" });
	mine.problem = element("p", { class: "problem", role: "alert" });
	mine.plot = element("div", { class: "response-place" });
	mine.rows = element("tbody");
	mine.tried = element("p", { id: "response-tried", class: "need", "data-need": "2", hidden: true });
	mine.node = element("section", { id: "response", class: "panel", "aria-label": t("Step response") },
		...(mine.kind ? makeBody(mine, velocity) :
			[element("p", {}, t("This drive is commanded neither over a way nor at a speed."))]));
	showKind(mine);
	showCurves(mine);
}

/* Which fields and buttons there are for the chosen kind of step. */
function showKind(mine) {
	const isSpeed = mine.kind === "speed";

	if (!mine.kind)
		return;
	setText(mine.help, isSpeed ?
		t("Hold a button: the drive runs at the speed until that is steady, and stops by itself; letting go stops it at once. Nobody may be near the machine; Escape and Space stop it.") :
		t("The drive goes over the distance, and at the next press back. Nobody may be near the machine; Escape and Space stop it."));
	setText(mine.try, isSpeed ? t("Try them: write, then hold a button") : t("Try them: write, and make the step"));
	mine.distance.closest("label").hidden = mine.make.hidden = isSpeed;
	mine.held.node.hidden = !isSpeed;
}

function makeBody(mine, velocity) {
	const { registers, scale } = mine.path;

	mine.help = element("p");
	mine.choice = element("select", { id: "response-kind", onchange: () => chooseKind(mine) },
		mine.kinds.map((kind) => element("option", { value: kind, selected: kind === mine.kind },
			kind === "way" ? t("of the position") : t("of the speed"))));
	mine.held = createSpeedStep({ path: mine.path, readSpeed: () => readField(mine, mine.speed, velocity),
		onBegin: () => sayOfSpeed(mine, t("The drive moves …"), ""),
		onCurve: (curve) => takeSpeedCurve(mine, curve),
		onEnd: (words) => sayOfSpeed(mine, "", words) });
	return [
		mine.help,
		element("div", { class: "toolbar filters" },
			mine.kinds.length > 1 ? createField(t("Step"), mine.choice) : null,
			createField(t("Distance, {unit}", { unit: scale.unit(registers.get("target_position")) }), mine.distance),
			createField(t("Speed, {unit}", { unit: scale.unit(velocity) }), mine.speed), mine.make),
		mine.held.node,
		mine.said, mine.problem, mine.tried,
		element("div", { class: "response-pair" }, mine.plot,
			element("div", {},
				element("table", { id: "response-parameters" },
					element("thead", {}, element("tr", {}, [t("Parameter"), t("Now"), t("Other value")].map((words) =>
						element("th", { scope: "col" }, words)))), mine.rows),
				element("div", { class: "toolbar" }, mine.try, mine.keep, mine.back))),
	];
}

async function readNow(mine) {
	const { name } = mine.path;
	const { values } = await call("Read", { drive: name, names: mine.parameters.map((one) => one.name) });

	mine.values = values;
	mine.inputs = new Map(mine.parameters.map((register) => [register.name, element("input", { type: "text",
		inputmode: "decimal", autocomplete: "off", class: "short", "data-parameter": register.name,
		"aria-label": t("Other value of {name}", { name: register.name }), oninput: () => showButtons(mine) })]));
	mine.rows.replaceChildren(...mine.parameters.map((register) =>
		element("tr", { title: inLanguage(register.description) }, element("th", { scope: "row" }, register.name),
			element("td", { class: "number" }, formatWithUnit(register, values[register.name])),
			element("td", {}, mine.inputs.get(register.name)))));
	showButtons(mine);
}

function showButtons(mine) {
	const { busy, last, path: { record } } = mine;

	if (!mine.kind)
		return;
	const why = last.judgement ? whyNotNow(KINDS[mine.kind], last) : t("not known yet");
	const isTyped = [...mine.inputs.values()].some(({ value }) => value.trim() !== "");

	const isReady = !busy && why === "" && last.judgement?.state === "Standstill";

	mine.make.disabled = mine.try.disabled = mine.choice.disabled = !isReady;
	mine.make.title = why;
	mine.held.update(isReady);
	mine.try.disabled ||= !isTyped;
	mine.keep.hidden = mine.back.hidden = mine.tried.hidden = !record.tried;
	mine.keep.disabled = mine.back.disabled = busy;
	if (record.tried)
		setText(mine.tried, t("Values are tried, and the former ones are not back: {values}. Keep them, or put them back.",
			{ values: listValues(record.tried) }));
}

const listValues = (values) => Object.entries(values).map(([name, value]) => `${name} = ${formatReal(value)}`).join(", ");

/* The newest answer, and the one of before as a comparison. */
function showCurves({ path: { record }, plot, said }) {
	const curves = record.responses;

	plot.replaceChildren(...(curves.length > 0 ? [drawResponse(curves, curves[0].unit)] : []));
	setText(said, curves.map((curve, i) => [i === 0 ? "" : t("Before: "), curve.measured ?
		sayResponse(nameResponse(curve.kind), curve.measured) : t("It did not come to its end, or did not move.")].join(""))
		.join(" "));
}

/* --- actions ---------------------------------------------------------------------------------- */

/* The way that stays within the limits of the configuration, else the wanted one: 1 or -1. Pure. */
export function chooseSide(wanted, distance, position, { min_position: min = -Infinity, max_position: max = Infinity }) {
	const isFree = (side) => position + side * distance >= min && position + side * distance <= max;

	return !isFree(wanted) && isFree(-wanted) ? -wanted : wanted;
}

/* One at a time; what goes wrong is said. */
async function act(mine, work) {
	mine.busy = true;
	setText(mine.problem, "");
	showButtons(mine);
	try {
		await work(mine);
	} catch (error) {
		showCurves(mine);
		setText(mine.problem, error.message);
	}
	mine.busy = false;
	showButtons(mine);
}

/* In the register's unit; throws what is wrong. */
function readField({ path: { scale } }, input, register) {
	const { value, problem } = parseValue(scale.typed(register), input.value);

	input.setAttribute("aria-invalid", String(Boolean(problem)));
	if (problem)
		throw new Error(problem);
	return scale.take(register, value);
}

async function makeStep(mine) {
	const { path } = mine;
	const { registers, scale } = path;
	const position = registers.get("position");
	const length = readField(mine, mine.distance, registers.get("target_position"));
	const { position_units: units, position: counts } = mine.last.values ?? {};
	const side = chooseSide(mine.side, scale.show(position, length), units ?? counts, path.drive()?.description ?? {});
	const distance = side * length;
	const velocity = Math.abs(readField(mine, mine.speed, registers.get("target_velocity")));

	setText(mine.said, t("The drive moves …"));
	const samples = await recordMove(path, { target_position: distance, target_velocity: velocity }, mine.abort.signal);

	mine.side = -side;
	keepCurve(mine, "way", samples, { register: position, wanted: distance, band: BAND });
}

/* samples: [{ time_us, value }] in the unit of `register`, as is what was wanted; band: see measureResponse. */
function keepCurve(mine, kind, samples, { register, wanted, band }) {
	const { path } = mine;
	const { scale, record } = path;
	const step = scale.show(register, wanted);
	const cut = cutResponse(samples.map(({ time_us: time, value }) =>
		({ time_us: time, value: scale.show(register, value) })), step);
	const found = cut && measureResponse(cut.times, cut.values, band);
	/* One that was stopped has not answered to the step. */
	const measured = found && Math.abs(found.to - found.from - step) < WAY_OFF * Math.abs(step) ? found : null;
	/* From its begin on, so that curves forth and back can be compared. */
	const values = (cut?.values ?? []).map((value) => (value - cut.values[0]) * Math.sign(step));
	const curve = { ...thin(cut?.times ?? [], values), kind, measured, to: Math.abs(step), unit: scale.unit(register),
		at: Date.now(), by: getSession().user ?? "", parameters: { ...mine.values } };

	/* A way and a speed cannot be compared, nor can two units. */
	record.responses = [curve, ...record.responses].filter((one) => one.times.length > 1 &&
		(one.kind ?? "way") === kind && one.unit === curve.unit).slice(0, RESPONSES_MOST);
	path.keep();
	if (measured)
		path.mark("response", "done", { kind, overshoot: measured.overshoot, settled: measured.settled, band: measured.band });
	showCurves(mine);
}

/* --- the speed, while a button is held ---------------------------------------------------------- */

function chooseKind(mine) {
	mine.kind = mine.choice.value;
	setText(mine.problem, "");
	showKind(mine);
	showButtons(mine);
}

function sayOfSpeed(mine, said, problem) {
	if (said)
		setText(mine.said, said);
	else
		showCurves(mine);
	setText(mine.problem, problem);
}

function takeSpeedCurve(mine, { samples, wanted, band }) {
	keepCurve(mine, "speed", samples, { register: mine.path.registers.get("target_velocity"), wanted, band });
}

async function write(mine, values) {
	try {
		await call("Write", { drive: mine.path.name, values });
	} finally {
		await readNow(mine);
	}
}

async function tryValues(mine) {
	const { record } = mine.path;
	const wanted = {};

	for (const register of mine.parameters) {
		const input = mine.inputs.get(register.name);

		if (input.value.trim() === "")
			continue;
		const { value, problem } = parseValue(register, input.value);

		input.setAttribute("aria-invalid", String(Boolean(problem)));
		if (problem)
			throw new Error(`${register.name}: ${problem}`);
		if (typeof mine.values[register.name] !== "number")
			throw new Error(t("{name}: what it is now is not known, so it could not be put back", { name: register.name }));
		wanted[register.name] = value;
	}
	/* Of before the first try, whatever is tried afterwards; kept before anything is written. */
	record.tried = { ...Object.fromEntries(Object.keys(wanted).map((name) => [name, mine.values[name]])),
		...record.tried };
	mine.path.keep();
	await write(mine, wanted);
	/* A speed needs a hand on its button. */
	if (mine.kind === "way")
		await makeStep(mine);
}

async function keepValues({ path }) {
	path.record.tried = null;
	path.mark("response", "done", path.record.steps.response?.values ?? {});
}

async function putBack(mine) {
	const { path } = mine;

	await write(mine, path.record.tried);
	path.record.tried = null;
	path.mark("response", path.record.steps.response?.state ?? "open", path.record.steps.response?.values ?? {});
}
