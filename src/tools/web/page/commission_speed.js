/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A step of the speed: from standstill to a speed, and held there until it is steady. A speed has no end of its own, so
 * a button is held for it, with the same beats as for jogging: whatever ends them stops the drive.
 */
import { openStream, sendBeat } from "./api.js";
import { element, setAttribute } from "./dom.js";
import { hasBit } from "./format.js";
import { createHoldPair, showHolds } from "./hold_button.js";
import { createGrips } from "./jog.js";
import { computeSpeeds, findSteady } from "./response.js";
import { t } from "./words.js";

/* A speed that is not steady by then does not become so. */
const LONGEST_US = 15e6;
/* The velocities of samples, in counts/s or as the family has it. */
function listSpeeds(samples, isComputed) {
	return isComputed ? computeSpeeds(samples.map(({ time_us, values }) => ({ time_us, value: values.position }))) :
		samples.map(({ time_us, values }) => ({ time_us, value: values.velocity }));
}

/*
 * path: see commission.js; readSpeed() is the wanted velocity, throws what is wrong with it; onBegin(); onCurve({
 * samples, wanted, band }) when it was steady; onEnd(words): why it has no curve. Returns { node, update(ready), release() }.
 */
export function createSpeedStep({ path, readSpeed, onBegin, onCurve, onEnd }) {
	const { name } = path;
	/* Of a drive that does not tell its speed the service computes it from two positions. */
	const isComputed = !hasBit(path.registers.get("capabilities"), path.capabilities, "measures_velocity");
	let step = null;
	const grips = createGrips({ send: (grip, beat, velocity) => sendBeat(name, grip, beat, velocity), onChange: showGrip });
	const holds = createHoldPair({ press, release, isPressed: () => step !== null });
	const node = element("div", { id: "response-hold", class: "hold-pair" }, holds);

	/* words: why it has no curve, "" when it has one. */
	function finish(words) {
		const mine = step;

		if (!mine)
			return;
		step = null;
		grips.release();
		mine.stream?.close();
		setAttribute(node, "data-held", "no");
		if (words)
			onEnd(words);
	}

	function take(mine, { samples }) {
		for (const sample of samples)
			mine.samples.push(sample);
		const speeds = listSpeeds(mine.samples, isComputed);

		/* Its speed of before is known now, also where it is computed from some time; a button that is up by now has
		 * moved nothing. */
		if (!mine.begun && speeds.length > 0) {
			mine.begun = true;
			grips.press(mine.wanted);
		}
		const band = findSteady(speeds, mine.wanted);

		if (band > 0) {
			finish("");
			onCurve({ samples: speeds, wanted: mine.wanted, band });
		} else if (mine.samples.at(-1)?.time_us - mine.samples[0]?.time_us > LONGEST_US) {
			finish(t("The speed did not become steady at what was wanted"));
		}
	}

	function press(direction) {
		let wanted = 0;

		if (holds[0].disabled || step)
			return;
		try {
			wanted = direction * Math.abs(readSpeed());
		} catch (error) {
			onEnd(error.message);
			return;
		}
		if (wanted === 0) {
			onEnd(t("Speed: 0 moves nothing"));
			return;
		}
		const mine = { wanted, samples: [], begun: false, stream: null };

		step = mine;
		onBegin();
		showHolds(holds, { velocity: wanted, held: false });
		mine.stream = openStream("Subscribe",
			{ drives: [name], names: ["position", "velocity"], interval_ms: 0 }, {
				once: true,
				onData: (answer) => step === mine && take(mine, answer),
				onState(state, error) {
					if (step === mine && (state === "failed" || state === "ended"))
						finish(error?.message ?? t("the connection to the gateway was lost"));
				},
			});
	}

	function release() {
		finish(t("Let go before the speed was steady: hold the button longer"));
		showHolds(holds, { velocity: 0, held: false });
	}

	function showGrip({ velocity, held, why, text }) {
		showHolds(holds, { velocity, held });
		setAttribute(node, "data-held", velocity !== 0 && held ? "yes" : "no");
		/* Ended by the server: a limit, a stop, a refusal. */
		if (velocity === 0 && why)
			finish(text || t("The drive was stopped"));
	}

	return {
		node,
		update(ready) {
			for (const button of holds)
				button.disabled = !ready && !step;
		},
		release,
	};
}
