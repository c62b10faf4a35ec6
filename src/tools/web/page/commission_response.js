/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the drive answers to a step: its overshoot and settling time beside the parameters that change
 * them. Other values are tried, then kept or put back; nothing is kept in the drive before it is saved.
 */
import { call, getSession, openStream } from "./api.js";
import { thin } from "./commission_record.js";
import { createField, element, setText } from "./dom.js";
import { codeName, formatReal, formatWithUnit, parseValue } from "./format.js";
import { whyNotNow } from "./next_step.js";
import { cutResponse, measureResponse, sayResponse } from "./response.js";
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

	mine.known = path.commands.has("move_relative");
	mine.parameters = SHAPING.map((name) => path.registers.get(name)).filter((one) => one?.parameter && one.writable);
	build(mine);
	if (mine.known)
		readNow(mine).catch((error) => setText(mine.problem, error.message));
	return {
		node: mine.node,
		update(next) {
			mine.last = next;
			showButtons(mine);
		},
		close: () => mine.abort.abort(),
	};
}

/* --- its elements ----------------------------------------------------------------------------- */

function firstDistance({ drive, scale, registers }) {
	const { min_position: min, max_position: max } = drive()?.description ?? {};

	const first = max > min ? (max - min) * PART_FIRST : scale.show(registers.get("target_position"), COUNTS_FIRST);

	return Number(first.toPrecision(1));
}

function build(mine) {
	const { path } = mine;
	const { registers, scale, preset } = path;
	const velocity = registers.get("target_velocity");
	const number = (id, value) => element("input", { id, type: "text", inputmode: "decimal", autocomplete: "off",
		class: "short", value });
	const button = (id, words, onclick, kind = null) => element("button",
		{ id: `response-${id}`, type: "button", class: kind, onclick }, words);

	mine.distance = number("response-distance", formatReal(firstDistance(path)));
	mine.speed = number("response-speed", preset ? formatReal(Math.abs(scale.show(velocity, preset))) : "");
	mine.make = button("make", t("Make the step"), () => act(mine, makeStep), "primary");
	mine.try = button("try", t("Try them: write, and make the step"), () => act(mine, tryValues), "primary");
	mine.keep = button("keep", t("Keep them"), () => act(mine, keepValues));
	mine.back = button("back", t("Put the former ones back"), () => act(mine, putBack));
	mine.said = element("p", { id: "response-said", role: "status" });
	mine.problem = element("p", { class: "problem", role: "alert" });
	mine.plot = element("div", { class: "response-place" });
	mine.rows = element("tbody");
	mine.tried = element("p", { id: "response-tried", class: "need", "data-need": "2", hidden: true });
	mine.node = element("section", { id: "response", class: "panel", "aria-label": t("Step response") },
		...(mine.known ? makeBody(mine, velocity) :
			[element("p", {}, t("This family has no move over a distance. The oscilloscope shows how it answers to a velocity."))]));
	showCurves(mine);
}

function makeBody(mine, velocity) {
	const { registers, scale } = mine.path;

	return [
		element("p", {}, t("The drive goes over the distance, and at the next press back. Nobody may be near the machine; Escape and Space stop it.")),
		element("div", { class: "toolbar filters" },
			createField(t("Distance, {unit}", { unit: scale.unit(registers.get("target_position")) }), mine.distance),
			createField(t("Speed, {unit}", { unit: scale.unit(velocity) }), mine.speed), mine.make),
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
	const why = last.judgement ? whyNotNow("move_relative", last) : t("not known yet");
	const isTyped = [...mine.inputs.values()].some(({ value }) => value.trim() !== "");

	mine.make.disabled = mine.try.disabled = busy || why !== "" || last.judgement?.state !== "Standstill";
	mine.make.title = why;
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
		sayResponse(t("The position"), curve.measured) : t("It did not come to its end, or did not move.")].join(""))
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
	const { registers, scale, record } = path;
	const position = registers.get("position");
	const length = readField(mine, mine.distance, registers.get("target_position"));
	const { position_units: units, position: counts } = mine.last.values ?? {};
	const side = chooseSide(mine.side, scale.show(position, length), units ?? counts, path.drive()?.description ?? {});
	const distance = side * length;
	const velocity = Math.abs(readField(mine, mine.speed, registers.get("target_velocity")));

	setText(mine.said, t("The drive moves …"));
	const samples = await recordMove(path, { target_position: distance, target_velocity: velocity }, mine.abort.signal);

	mine.side = -side;
	const cut = cutResponse(samples.map(({ time_us: time, value }) =>
		({ time_us: time, value: scale.show(position, value) })), scale.show(position, distance));
	const found = cut && measureResponse(cut.times, cut.values);
	const way = scale.show(position, distance);
	/* One that was stopped has not answered to the step. */
	const measured = found && Math.abs(found.to - found.from - way) < WAY_OFF * Math.abs(way) ? found : null;
	/* As a way from the begin, so that curves forth and back can be compared. */
	const ways = (cut?.values ?? []).map((value) => (value - cut.values[0]) * Math.sign(way));
	const curve = { ...thin(cut?.times ?? [], ways), measured, to: Math.abs(way), unit: scale.unit(position),
		at: Date.now(), by: getSession().user ?? "", parameters: { ...mine.values } };

	record.responses = [curve, ...record.responses].filter(({ times }) => times.length > 1).slice(0, RESPONSES_MOST);
	path.keep();
	if (measured)
		path.mark("response", "done", { overshoot: measured.overshoot, settled: measured.settled });
	showCurves(mine);
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
