/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Control of a drive (control = drive in the configuration): its holder, taking and releasing it,
 * and the time left of its watchdog.
 */
import { call } from "./api.js";
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import { formatFixed, formatSpan } from "./format.js";
import { formatClient } from "./history.js";
import { t } from "./words.js";

const NOT_CONFIGURED = t("Nobody has to take control here: it is not configured (control = drive in drivebridge.conf)");

function describeWatchdog({ watchdog_ms, watchdog_remaining_ms }) {
	const time = formatSpan((watchdog_ms ?? 0) / 1000);

	if (watchdog_ms === 0)
		return t("Its watchdog is off: nothing stops it when its client falls silent");
	return watchdog_remaining_ms > 0 ?
		t("Watchdog armed: it stops the drive after {time} of silence", { time }) :
		t("Watchdog {time}, not armed", { time });
}

/* The panel; update(values) with streamed values, learn() after a command of this tab was
 * accepted. */
export function createControl({ context, drive }) {
	/* A service of before does not tell. */
	const controlled = context.plant.drives.get(drive)?.description.controlled !== false;
	const drawing = icon("hint");
	/* Screen readers do not announce the seconds next to it. */
	const who = element("span", { id: "control-holder", role: "status" });
	const until = element("span", { class: "muted number" });
	const take = element("button", { id: "control-take", class: "small", type: "button",
		onclick: () => write(1) }, t("Take control"));
	const release = element("button", { id: "control-release", class: "small", type: "button",
		hidden: true, onclick: () => write(0) }, t("Release control"));
	const problem = element("p", { class: "problem", role: "alert" });
	const watchdog = element("p", { id: "watchdog", class: "muted" });
	const node = element("section", { id: "control", class: "panel control", "aria-label": controlled ? t("Control") : t("Watchdog") },
		element("div", { class: "panel-head" }, element("h2", {}, controlled ? t("Control") : t("Watchdog")),
			element("span", { class: "push" }),
			controlled && context.may("move", drive) ? [take, release] : null),
		controlled ? element("p", { class: "control-line" }, drawing, who, until) : null, watchdog,
		problem);
	/* The session of this tab, after it has had control; 0 before. */
	let mine = 0;
	let latest = {};

	async function write(wanted) {
		setText(problem, "");
		try {
			await call("Write", { drive, values: { control_request: wanted } });
			if (wanted)
				await learn();
		} catch (error) {
			setText(problem, error.parameters?.result === "unsupported" ? NOT_CONFIGURED :
				error.message);
		}
	}

	/* An accepted command of this tab needed control: so the holder now is this tab. */
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
		if (holder === 0)
			setText(who, t("Nobody has control"));
		else if (isMine)
			setText(who, t("You have control"));
		else
			setText(who, t("{holder} has control: others can only stop the drive", { holder: formatClient(holder, values.control_port, values.control_address,
				values.control_user) }));
		setText(until, holder === 0 ? "" : t("{seconds} s left", { seconds: formatFixed(left / 1000, 1) }));
		take.hidden = isMine;
		release.hidden = !isMine;
		setText(watchdog, describeWatchdog(values));
		watchdog.classList.toggle("warning-text", values.watchdog_ms === 0);
	}

	return { node, update, learn };
}
