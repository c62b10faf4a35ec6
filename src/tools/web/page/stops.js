/* SPDX-License-Identifier: Apache-2.0 */
import { t } from "./words.js";
/*
 * Stops, each repeated until it is confirmed. The person who presses Stop looks at the machine: so
 * a stop without confirmation is shown shortly after the press, and stays visible until it is
 * confirmed or the user removes it.
 */

/* After the press; then the stop is shown. */
export const UNCONFIRMED_AFTER_MS = 500;
/* From the begin of one attempt to the next: the first interval, and the longest while the gateway
 * keeps answering that it failed. */
const AGAIN_FIRST_MS = 250;
const AGAIN_MOST_MS = 1000;
const LOOK_EVERY_MS = 100;

const NOBODY_ANSWERS = new Set(["Unreachable", "Timeout"]);

/*
 * send(call) makes one attempt and is a promise of { result }; it ends by itself in about a second.
 * onChange(late) gets the stops to show, each { name, call, since, tries, why }. `clock` is in
 * milliseconds; `timers` have setTimeout, setInterval, clearInterval. Pure but for those.
 *
 * press(name, call): a promise of { result } when it is confirmed, of null when it was given up.
 * The same name, while it is not confirmed, is the same stop. onError(error), if given, is called
 * once, when the gateway answers that the stop has failed: if it returns true, the stop is given
 * up.
 */
export function createStops({ send, onChange, clock = () => performance.now(), timers = globalThis }) {
	const open = new Map();
	let looking = null;
	let shown = false;

	function look() {
		const now = clock();
		const late = [...open.values()].filter(({ since }) => now - since >= UNCONFIRMED_AFTER_MS);

		if (late.length > 0 || shown)
			onChange(late);
		shown = late.length > 0;
		if (open.size > 0)
			return;
		timers.clearInterval(looking);
		looking = null;
	}

	function end(stop, answer) {
		if (open.get(stop.name) === stop)
			open.delete(stop.name);
		stop.over = true;
		stop.resolve(answer);
		look();
	}

	/* Result of one attempt: its answer if that confirms the stop. */
	async function attempt(stop) {
		try {
			const answer = await send(stop.call);

			if (answer.result !== "pending")
				return answer;
			stop.why = t("it is not confirmed yet");
		} catch (error) {
			stop.why = error.message;
			if (NOBODY_ANSWERS.has(error.name))
				return null;
			stop.pause = Math.min(stop.pause * 2, AGAIN_MOST_MS);
			if (!stop.failed && stop.onError?.(error))
				end(stop, null);
			stop.failed = true;
		}
		return null;
	}

	async function repeat(stop) {
		while (!stop.over) {
			const began = clock();

			stop.tries++;
			const answer = await attempt(stop);

			if (stop.over)
				return;
			if (answer) {
				end(stop, answer);
				return;
			}
			const rest = Math.max(0, began + stop.pause - clock());

			await new Promise((resolve) => { timers.setTimeout(resolve, rest); });
		}
	}

	return {
		press(name, call, onError) {
			const before = open.get(name);

			if (before)
				return before.promise;
			const stop = { name, call, onError, since: clock(), tries: 0, why: "", pause: AGAIN_FIRST_MS,
				failed: false, over: false };

			stop.promise = new Promise((resolve) => { stop.resolve = resolve; });
			open.set(name, stop);
			looking ??= timers.setInterval(look, LOOK_EVERY_MS);
			repeat(stop);
			return stop.promise;
		},
		/* No stop is repeated after this. */
		giveUp() {
			for (const stop of [...open.values()])
				end(stop, null);
		},
	};
}
