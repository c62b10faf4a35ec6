/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Moving a drive while a button or key is held. The page says every 100 ms that it still is; when that stops coming,
 * for whatever reason, the server stops the drive. So nothing here has to work for the drive to stand.
 */
import { sendBeat, call } from "./api.js";
import { element, icon, newId, setAttribute, setText } from "./dom.js";
import { formatFixed, formatRange, formatReal, inWords, parseValue } from "./format.js";

const BEAT_EVERY_MS = 100;
/* More that are not answered yet would only take connections from the stop. */
const BEATS_AT_ONCE = 2;
const RELEASE_TRIES = 3;
/* Of what is allowed, offered as speeds. */
const SHARES = [1, 5, 10, 25, 50, 100];
const SHARE_FIRST = 10;
const STEPS = [0.01, 0.1, 1, 10, 100];
/* Of counts, where nothing finer is known. */
const COUNT_STEPS = [1, 10, 100, 1000, 10000];

/*
 * Presses and their beats. `send(grip, beat, velocity)` is a promise of { held, why, text }; `onChange(state)` gets
 * { velocity, held, why, text }: velocity 0 when nothing is pressed, held when the server says so, why and text of
 * how the last grip ended when not by being let go. `timers` are setInterval and clearInterval. Pure but for those.
 */
export function createGrips({ send, onChange, timers = globalThis }) {
	let grip = 0;
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
			const answer = await send(mine.grip, ++mine.beat, mine.velocity);

			if (mine.over)
				return;
			mine.held = answer.held;
			if (answer.held)
				tell({});
			else
				finish(mine, answer.why, answer.text);
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
				/* The server stops the drive by itself when it hears nothing. */
				if (error.name !== "Unreachable" && error.name !== "Timeout")
					tell({ why: error.name, text: error.message });
			}
		}
	}

	return {
		press(velocity) {
			if (current)
				this.release();
			current = { grip: ++grip, beat: 0, velocity, held: false, over: false, underWay: 0, timer: 0 };
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

/*
 * The panel. `registers` and `commands` are the drive's, by name; onMoved() is called when a press moves it. Returns { node, release(), update(drive) }; the
 * caller releases when focus, visibility or the link goes, and updates with the plant's drive when that changes.
 */
export function createJog({ context, drive, registers, commands, scale, onMoved }) {
	const velocity = registers.get("target_velocity");
	const distance = registers.get("target_position");
	const typedVelocity = scale.typed(velocity);
	const typedDistance = scale.typed(distance);
	const canStep = commands.has("move_relative");
	const state = { ready: null };
	const problem = element("p", { class: "problem", role: "alert" });
	const speedHint = newId("jog-speed-hint");
	const speed = element("input", { id: "jog-speed", type: "text", inputmode: "decimal", autocomplete: "off",
		"aria-describedby": speedHint });
	const shares = element("div", { class: "presets", role: "group", "aria-label": "Part of the highest velocity" });
	const most = Math.max(Math.abs(typedVelocity.max ?? 0), Math.abs(typedVelocity.min ?? 0));
	const said = element("p", { id: "jog-state", class: "jog-state", role: "status" });
	const backward = makeHold(-1, "backward", "Hold to move in negative direction");
	const forward = makeHold(1, "forward", "Hold to move in positive direction");
	const length = element("input", { id: "jog-step", type: "text", inputmode: "decimal", autocomplete: "off",
		value: formatReal(scale.isScaled(distance) ? 1 : 100) });
	const stepBack = element("button", { id: "jog-step-backward", type: "button", onclick: () => step(-1) }, "− Step");
	const stepOn = element("button", { id: "jog-step-forward", type: "button", onclick: () => step(1) }, "+ Step");
	const node = element("section", { id: "jog", class: "panel jog", "aria-label": "Jog" },
		element("div", { class: "panel-head" }, element("h2", {}, "Jog")),
		element("label", { class: "field", for: "jog-speed" }, "Speed",
			element("span", { class: "with-unit" }, speed, element("span", { class: "unit" }, typedVelocity.unit))),
		most ? shares : null,
		element("small", { class: "muted", id: speedHint }, most ? `At most ${formatReal(most)} ${typedVelocity.unit}` :
			"No limit is configured for its velocity"),
		element("div", { class: "hold-pair" }, backward, forward), said,
		element("small", { class: "muted" }, "Hold a button, or with the focus on one an arrow key. ",
			"Letting go stops the drive; so do Space and Escape, from anywhere."),
		canStep ? element("div", { class: "step-row" },
			element("label", { class: "field", for: "jog-step" }, "Step", element("span", { class: "with-unit" }, length,
				element("span", { class: "unit" }, typedDistance.unit))),
			stepBack, stepOn,
			element("div", { class: "presets", role: "group", "aria-label": "Lengths of a step" },
				(scale.isScaled(distance) ? STEPS : COUNT_STEPS).map((value) => element("button",
					{ class: "small", type: "button", onclick: () => { length.value = String(value); } },
					String(value))))) : null,
		problem);
	const grips = createGrips({
		send: (grip, beat, wanted) => sendBeat(drive, grip, beat, wanted),
		onChange: showGrip,
	});

	if (most) {
		speed.value = formatReal(most * SHARE_FIRST / 100);
		shares.append(...SHARES.map((share) => element("button", { class: "small", type: "button",
			onclick: () => { speed.value = formatReal(Number((most * share / 100).toPrecision(6))); } }, `${share} %`)));
	}

	function makeHold(direction, drawing, label) {
		const button = element("button", { class: "hold", type: "button", "aria-label": label,
			"data-direction": String(direction), "aria-keyshortcuts": "ArrowLeft ArrowRight" },
		direction < 0 ? icon(drawing) : null, direction < 0 ? "−" : "+", direction > 0 ? icon(drawing) : null);

		button.addEventListener("pointerdown", (event) => {
			if (event.button !== 0 || !event.isPrimary)
				return;
			/* A finger that slides off the button has let it go. */
			button.releasePointerCapture?.(event.pointerId);
			event.preventDefault();
			button.focus();
			press(direction);
		});
		for (const end of ["pointerup", "pointercancel", "pointerleave", "contextmenu", "blur"])
			button.addEventListener(end, (event) => {
				if (end === "contextmenu")
					event.preventDefault();
				grips.release();
			});
		return button;
	}

	/* In the register's unit, NaN with the problem said. */
	function read(input, register, typed) {
		const { value, problem: wrong } = parseValue(typed, input.value);

		setAttribute(input, "aria-invalid", String(Boolean(wrong)));
		setText(problem, wrong ? `${input === speed ? "Speed" : "Step"}: ${wrong}` : "");
		return wrong ? NaN : scale.take(register, value);
	}

	function press(direction) {
		const wanted = Math.abs(read(speed, velocity, typedVelocity));

		if (Number.isNaN(wanted) || !state.ready)
			return;
		if (wanted === 0) {
			setText(problem, "Speed: 0 moves nothing");
			return;
		}
		setText(said, "");
		grips.press(direction * wanted);
	}

	async function step(direction) {
		const wanted = read(length, distance, typedDistance);
		const at = Number.isNaN(wanted) ? NaN : Math.abs(read(speed, velocity, typedVelocity));

		if (Number.isNaN(at))
			return;
		try {
			await call("Run", { drive, command: "move_relative", arguments: {
				target_position: direction * wanted, target_velocity: at } });
			setText(said, `Step of ${formatReal(direction * scale.show(distance, wanted))} ${typedDistance.unit} begun`);
		} catch (error) {
			setText(problem, error.message);
		}
	}

	function showGrip({ velocity: moving, held, why, text }) {
		for (const button of [backward, forward]) {
			const pressed = moving !== 0 && Number(button.dataset.direction) === Math.sign(moving);

			button.classList.toggle("pressed", pressed);
			button.classList.toggle("held", pressed && held);
		}
		const before = node.dataset.held;

		node.dataset.held = moving === 0 ? "no" : held ? "yes" : "asked";
		if (held && before !== "yes")
			onMoved();
		if (moving !== 0)
			setText(said, `${held ? "Moving" : "Asking for"} ${formatFixed(scale.show(velocity, moving),
				Math.max(1, scale.decimals(velocity)))} ${typedVelocity.unit}`);
		else
			setText(said, why ? `Ended: ${text || inWords(why)}. Let go, then press again.` : "Let go: stopped");
	}

	node.addEventListener("keydown", (event) => {
		const direction = { ArrowLeft: -1, ArrowRight: 1 }[event.key] ??
			(event.key === "Enter" ? Number(event.target.dataset.direction) : 0);

		if (!direction || !event.target.classList.contains("hold") || event.ctrlKey || event.altKey || event.metaKey)
			return;
		event.preventDefault();
		if (!event.repeat && !grips.isPressed())
			press(direction);
	});
	node.addEventListener("keyup", (event) => {
		if (["ArrowLeft", "ArrowRight", "Enter"].includes(event.key))
			grips.release();
	});

	return {
		node,
		release: () => grips.release(),
		isPressed: () => grips.isPressed(),
		update(shown) {
			const ready = shown.judgement.state !== "" && !["Offline", "ErrorStop", "Disabled"].includes(
				shown.judgement.state) && shown.judgement.shape !== "error" && context.link() === "live";

			if (ready === state.ready)
				return;
			state.ready = ready;
			for (const button of [backward, forward, stepBack, stepOn])
				button.disabled = !ready;
			setText(said, ready ? "" : context.link() !== "live" ? "The link is gone" :
				shown.judgement.state === "Disabled" ? "Enable the drive first" :
					`Not now: ${shown.judgement.why || shown.judgement.state}`);
			if (!ready)
				grips.release();
		},
	};
}
