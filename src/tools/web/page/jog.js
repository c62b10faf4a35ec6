/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Moves a drive while a button or key is held. The page sends a beat every 100 ms; when these stop,
 * for whatever reason, the server stops the drive. So the stop of the drive does not depend on this
 * code.
 */
import { sendBeat, call } from "./api.js";
import { element, setAttribute, setText } from "./dom.js";
import { createHoldPair, showHolds } from "./hold_button.js";
import { formatFixed, formatReal, inWords, parseValue } from "./format.js";
import { t } from "./words.js";

const BEAT_EVERY_MS = 100;
/* Further unanswered beats would only take connections from the stop. */
const BEATS_AT_ONCE = 2;
const RELEASE_TRIES = 3;
/* Beats of a press that may find the drive of the press before not stopped yet: 300 ms. */
const WAIT_BEATS = 3;
/* Percentages of the maximum, offered as speeds. */
const SHARES = [1, 5, 10, 25, 50, 100];
/* The service stops a motion before it crosses a limit: it stands as near to it, as a part of the
 * way between the limits, after these looks at most. */
const NEAR_LIMIT = 0.005;
const LIMIT_TRIES = 5;
const LIMIT_EVERY_MS = 200;
const SHARE_FIRST = 10;
const STEPS = [0.01, 0.1, 1, 10, 100];
/* In counts, where no finer unit is known. */
const COUNT_STEPS = [1, 10, 100, 1000, 10000];

let lastGrip = 0;

/*
 * Presses and their beats. `send(grip, beat, velocity)` is a promise of { held, why, text };
 * `onChange(state)` gets { velocity, held, why, text }: velocity 0 when nothing is pressed, held
 * from the server, why and text for the end of the last grip unless it was released. `timers` are
 * setInterval and clearInterval. Pure but for those, and for the numbers of presses: to the server a
 * lower number is an older press of this page, whichever view it was on.
 */
export function createGrips({ send, onChange, timers = globalThis }) {
	let current = null;

	function tell(change) {
		onChange({ velocity: current?.velocity ?? 0, held: current?.held ?? false, why: "", text: "", ...change });
	}

	function finish(mine, why, text) {
		timers.clearInterval(mine.timer);
		mine.over = true;
		if (current === mine)
			current = null;
		tell({ why, text });
	}

	async function beat(mine) {
		if (mine.over || mine.underWay >= BEATS_AT_ONCE)
			return;
		mine.underWay++;
		try {
			const number = ++mine.beat;
			const answer = await send(mine.grip, number, mine.velocity);

			if (mine.over)
				return;
			mine.held = answer.held;
			/* Its next beat asks again; a hand that lets go sends none. */
			if (answer.held || (answer.why === "waiting" && number <= WAIT_BEATS)) {
				tell({});
			} else {
				finish(mine, answer.why, answer.text);
				/* A beat that is still under way would begin the motion. */
				if (answer.why === "waiting")
					letGo(mine);
			}
		} catch (error) {
			if (!mine.over && error.name !== "Unreachable" && error.name !== "Timeout")
				finish(mine, error.name, error.message);
		} finally {
			mine.underWay--;
		}
	}

	async function letGo(mine) {
		for (let tries = 0; tries < RELEASE_TRIES; tries++) {
			try {
				await send(mine.grip, ++mine.beat, 0);
				return;
			} catch (error) {
				/* Without beats the server stops the drive by itself. */
				if (error.name !== "Unreachable" && error.name !== "Timeout")
					tell({ why: error.name, text: error.message });
			}
		}
	}

	return {
		press(velocity) {
			if (current)
				this.release();
			current = { grip: ++lastGrip, beat: 0, velocity, held: false, over: false, underWay: 0, timer: 0 };
			const mine = current;

			mine.timer = timers.setInterval(() => beat(mine), BEAT_EVERY_MS);
			beat(mine);
			tell({});
		},
		release() {
			const mine = current;

			if (!mine)
				return;
			finish(mine, "", "");
			letGo(mine);
		},
		isPressed: () => current !== null,
	};
}

/* A field with its unit, and buttons that fill in usual values. */
function createQuantity({ id, label, unit, value, presets, presetsLabel }) {
	const input = element("input", { id, type: "text", inputmode: "decimal", autocomplete: "off",
		value });
	const buttons = presets.map(([text, number]) => element("button", { class: "small", type: "button",
		onclick: () => { input.value = formatReal(number); } }, text));

	return {
		input,
		field: element("label", { class: "field", for: id }, label,
			element("span", { class: "with-unit" }, input,
				element("span", { class: "unit" }, unit))),
		presets: element("div", { class: "presets", role: "group", "aria-label": presetsLabel,
			hidden: presets.length === 0 }, buttons),
	};
}

/*
 * The panel. `registers` and `commands` are the drive's, by name; preset is its own speed in counts/s,
 * 0 if it has none; onEnable() enables it, and onMoved() is called when a press moves it. Returns { node, release(), isPressed(), update(drive) }; the caller calls release when
 * focus, visibility or the link is lost, and update with the drive's state, and with how
 * old it is in words ("": it is not).
 */
export function createJog({ context, drive, registers, commands, scale, preset = 0, onEnable, onMoved }) {
	const velocity = registers.get("target_velocity");
	const distance = registers.get("target_position");
	const velocityUnit = scale.unit(velocity);
	const distanceUnit = scale.unit(distance);
	const { min = 0, max = 0 } = scale.typed(velocity);
	/* Where the configuration has no highest velocity, parts of the drive's own speed are offered. */
	const limit = Math.max(Math.abs(max), Math.abs(min));
	const most = limit || Math.abs(scale.show(velocity, preset));
	const lengths = scale.isScaled(distance) ? STEPS : COUNT_STEPS;
	const speed = createQuantity({ id: "jog-speed", label: t("Speed"), unit: velocityUnit,
		value: most ? formatReal(most * SHARE_FIRST / 100) : "",
		presets: most ? SHARES.map((share) => [`${share} %`, most * share / 100]) : [],
		presetsLabel: limit ? t("Part of the highest velocity") : t("Part of the drive's own speed") });
	const length = createQuantity({ id: "jog-step", label: t("Step"), unit: distanceUnit,
		value: formatReal(lengths[2]), presets: lengths.map((value) => [formatReal(value), value]),
		presetsLabel: t("Lengths of a step") });
	const limits = limit ? t("At most {limit} {velocityUnit}", { limit: formatReal(limit), velocityUnit }) :
		t("No max-velocity is configured") +
			(most ? t("; the drive's own speed is {most} {velocityUnit}", { most: formatReal(most), velocityUnit }) : "");
	const enable = element("button", { id: "jog-enable", class: "small", type: "button", hidden: true,
		onclick: onEnable }, t("Enable"));
	const said = element("p", { id: "jog-state", class: "jog-state", role: "status" });
	const problem = element("p", { class: "problem", role: "alert" });
	const holds = createHoldPair({ press, release: () => grips.release(), isPressed: () => grips.isPressed() });
	const steps = [makeStep(-1), makeStep(1)];
	const node = element("section", { id: "jog", class: "panel jog", "aria-label": t("Jog") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Jog")),
			element("span", { class: "push" }), enable),
		speed.field, speed.presets, element("small", { class: "muted" }, limits),
		element("div", { class: "hold-pair" }, holds), said,
		element("small", { class: "muted" }, t("Hold a button, or with the focus on one an arrow key. "),
			t("Letting go stops the drive; so do Space and Escape, from anywhere.")),
		commands.has("move_relative") ? element("div", { class: "step-row" }, length.field, steps,
			length.presets) : null,
		problem);
	const grips = createGrips({
		send: (grip, beat, wanted) => sendBeat(drive, grip, beat, wanted),
		onChange: showGrip,
	});
	let ready = null;
	let whyNot = "";
	/* The sign of the last motion in the user's unit; of ends and begins, which one is the newest. */
	let towards = 0;
	let ends = 0;

	function makeStep(direction) {
		return element("button", { id: `jog-step-${direction < 0 ? "backward" : "forward"}`,
			type: "button", onclick: () => step(direction) }, direction < 0 ? t("− Step") : t("+ Step"));
	}

	/* In the register's unit; NaN after showing the problem. */
	function read({ input, field }, register) {
		const { value, problem: wrong } = parseValue(scale.typed(register), input.value);

		setAttribute(input, "aria-invalid", String(Boolean(wrong)));
		setText(problem, wrong ? `${field.firstChild.textContent}: ${wrong}` : "");
		return wrong ? NaN : scale.take(register, value);
	}

	function press(direction) {
		const wanted = Math.abs(read(speed, velocity));

		if (Number.isNaN(wanted) || !ready)
			return;
		if (wanted === 0)
			setText(problem, t("Speed: 0 moves nothing"));
		else
			grips.press(direction * wanted);
	}

	async function step(direction) {
		const wanted = direction * read(length, distance);
		const at = Number.isNaN(wanted) ? NaN : Math.abs(read(speed, velocity));

		if (Number.isNaN(at))
			return;
		try {
			await call("Run", { drive, command: "move_relative",
				arguments: { target_position: wanted, target_velocity: at } });
			setText(said, t("Step of {length} {distanceUnit} begun", { length: formatReal(scale.show(distance, wanted)), distanceUnit }));
			onMoved();
		} catch (error) {
			setText(problem, error.message);
		}
	}

	function showGrip({ velocity: moving, held, why, text }) {
		const began = held && node.dataset.held !== "yes";
		const decimals = Math.max(1, scale.decimals(velocity));

		showHolds(holds, { velocity: moving, held });
		node.dataset.held = moving === 0 ? "no" : held ? "yes" : "asked";
		if (moving !== 0) {
			towards = Math.sign(scale.show(velocity, moving));
			ends++;
		}
		if (moving !== 0)
			setText(said, `${held ? t("Moving") : t("Asking for")} ` +
				`${formatFixed(scale.show(velocity, moving), decimals)} ${velocityUnit}`);
		else if (why)
			showEnd(why, text);
		else
			setText(said, t("Let go: stopped"));
		if (began)
			onMoved();
	}

	/* Names a limit of the configuration at which a motion ended, where it stands there a moment later;
	 * "": it does not. */
	async function sayLimit(why, text, end) {
		const { min_position: min, max_position: max } = context.plant.drives.get(drive)?.description ?? {};
		const [name, edge] = towards > 0 ? ["max-position", max] : ["min-position", min];
		const words = `${name} ${formatReal(edge ?? 0)} ${distanceUnit}`;

		if (typeof edge !== "number")
			return "";
		if (text.startsWith("limit"))
			return t("{limit} is reached", { limit: words });
		for (let tries = 0; why === "stopped" && tries < LIMIT_TRIES && end === ends; tries++) {
			const { values } = await call("Read", { drive, names: ["position", "position_units"] });

			if (Math.abs((values.position_units ?? values.position) - edge) <=
			    NEAR_LIMIT * (max > min ? max - min : Math.abs(edge)))
				return t("stopped at {limit}", { limit: words });
			await new Promise((resolve) => setTimeout(resolve, LIMIT_EVERY_MS));
		}
		return "";
	}

	async function showEnd(why, text) {
		const end = ++ends;
		const say = (words) => setText(said, t("Ended: {why}. Let go, then press again.", { why: words }));

		say(text || inWords(why));
		const limit = await sayLimit(why, text, end).catch(() => "");

		if (limit && end === ends)
			say(limit);
	}

	function sayWhyNot({ state, why }, old) {
		if (old)
			return t("What you see is old ({old})", { old });
		return state === "Disabled" ? t("Enable the drive first") : t("Not now: {why}", { why: why || state });
	}

	return {
		node,
		release: () => grips.release(),
		isPressed: () => grips.isPressed(),
		update({ judgement, old }) {
			const next = !old && context.link() === "live" && !["", "Offline", "ErrorStop", "Disabled"]
				.includes(judgement.state) && judgement.shape !== "error";

			const reason = next ? "" : sayWhyNot(judgement, old);

			enable.hidden = judgement.state !== "Disabled" || !commands.has("enable");
			if (next === ready && reason === whyNot)
				return;
			ready = next;
			whyNot = reason;
			for (const button of [...holds, ...steps])
				button.disabled = !ready;
			if (!ready)
				grips.release();
			setText(said, reason);
		},
	};
}
