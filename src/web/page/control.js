/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who has control of a drive (control = drive in the configuration), taking it and letting it go, and how long its
 * watchdog still waits.
 */
import { call } from "./api.js";
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import { formatSpan } from "./format.js";
import { formatClient } from "./commands.js";

/* The panel; update(values) with what streams in, learn() after a command of this tab was taken. */
export function createControl({ context, drive }) {
	const drawing = icon("hint");
	const who = element("span", { id: "control-holder" });
	const until = element("span", { class: "muted number" });
	const take = element("button", { id: "control-take", class: "small", type: "button",
		onclick: () => write(1) }, "Take control");
	const release = element("button", { id: "control-release", class: "small", type: "button", hidden: true,
		onclick: () => write(0) }, "Release control");
	const problem = element("p", { class: "problem", role: "alert" });
	const watchdog = element("p", { id: "watchdog", class: "muted" });
	const node = element("section", { id: "control", class: "panel control", "aria-label": "Control" },
		element("div", { class: "panel-head" }, element("h2", {}, "Control"), element("span", { class: "push" }),
			context.mayAct() ? [take, release] : null),
		element("p", { class: "control-line", role: "status" }, drawing, who, until), watchdog, problem);
	/* The session of this tab, once it has had control; 0 as long as it has not. */
	let mine = 0;
	let latest = {};

	async function write(wanted) {
		setText(problem, "");
		try {
			await call("Write", { drive, values: { control_request: wanted } });
			if (wanted)
				await learn();
		} catch (error) {
			setText(problem, error.parameters?.result === "unsupported" ?
				"Nobody has to take control here: it is not configured (control = drive in drivebridge.conf)" :
				error.message);
		}
	}

	/* What this tab was allowed to do it did with control: who has it now is this tab. */
	async function learn() {
		const { values } = await call("Read", { drive, names: ["control_port", "control_holder"] });

		mine = values.control_holder ? values.control_port : 0;
		update({ ...latest, ...values });
	}

	function update(values) {
		const holder = values.control_holder ?? 0;
		const isMine = holder !== 0 && mine !== 0 && values.control_port === mine;
		const left = values.control_remaining_ms ?? 0;

		latest = values;
		setAttribute(node, "data-control", holder === 0 ? "nobody" : isMine ? "mine" : "other");
		setIcon(drawing, holder === 0 ? "disabled" : isMine ? "fine" : "warning");
		setText(who, holder === 0 ? "Nobody has control" : isMine ? "You have control" :
			`${formatClient(holder, values.control_port)} has control: others can only stop the drive`);
		setText(until, holder === 0 ? "" : `${(left / 1000).toFixed(1)} s left`);
		take.hidden = isMine;
		release.hidden = !isMine;
		const ms = values.watchdog_ms ?? 0;

		setText(watchdog, ms === 0 ? "Its watchdog is off: nothing stops it when its client falls silent" :
			values.watchdog_remaining_ms > 0 ?
				`Watchdog armed: it stops the drive after ${formatSpan(ms / 1000)} of silence` :
				`Watchdog ${formatSpan(ms / 1000)}, not armed`);
		watchdog.classList.toggle("warning-text", ms === 0);
	}

	return { node, update, learn, isMine: () => node.dataset.control === "mine" };
}
