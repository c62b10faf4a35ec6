/* SPDX-License-Identifier: Apache-2.0 */
/* How the drives were in the last hour, day or week, and alarms. */
import { createAlarms } from "./alarms.js";
import { askHealth, askHealthRows } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { createHealthCurves } from "./health_curves.js";
import { RANGES } from "./health_slots.js";
import { createHealthStrip } from "./health_strip.js";
import { recall, remember } from "./kept_choice.js";
import { t } from "./words.js";

export const title = (drive) => (drive ? t("Health of {drive}", { drive }) : t("Health"));

/* An interval ends once a minute. */
const VALUES_EVERY_MS = 20000;
const ALARMS_EVERY_MS = 2000;
const AGAIN_MS = 1500;

let view = null;

const isShown = (mine) => view === mine;

/* Calls it now and then, until the view is hidden. While the tab is hidden nothing is asked. */
function repeat(mine, work, every) {
	const turn = async () => {
		let wait = every;

		try {
			if (!document.hidden && mine.context.link() !== "lost")
				await work();
			setText(mine.problem, "");
		} catch (error) {
			/* Others are being answered; or the service is away, which the page says anyway. */
			wait = AGAIN_MS;
			if (isShown(mine) && error.name !== "Busy")
				setText(mine.problem, error.message);
		}
		if (isShown(mine))
			mine.timers.set(work, setTimeout(turn, wait));
	};

	clearTimeout(mine.timers.get(work));
	return turn();
}

function describeState({ on, kept, trouble }) {
	return !on ? t("Values are not taken: health = off") :
		trouble ? t("Values and alarms are kept in memory only: {trouble}", { trouble }) :
			kept ? "" : t("Values and alarms are kept in memory only.");
}

async function readValues(mine) {
	const { for_s: forS, step_s: step } = RANGES[mine.range.value];
	const of = { for_s: forS, step_s: step(mine.context.plant.drives.size) };
	const answer = mine.drive ? await askHealth({ ...of, drive: mine.drive }) : await askHealthRows(of);

	if (!isShown(mine))
		return;
	setText(mine.state, describeState(answer));
	if (mine.drive)
		mine.picture.draw(answer, forS);
	else
		mine.picture.draw(answer, forS, mine.anew);
	mine.picture.node.dataset.at = String(answer.now_us);
	mine.anew = false;
}

export async function show(root, context, drive) {
	const why = drive ? context.whyNotSee(drive) : "";
	const mine = {
		context, drive, anew: true, timers: new Map(),
		picture: drive ? createHealthCurves() : createHealthStrip(),
		range: element("select", { id: "health-range" }, Object.entries(RANGES).map(
			([value, { words }]) => element("option", { value }, words))),
		state: element("p", { id: "health-state", class: "problem" }),
		problem: element("p", { class: "problem", role: "status" })
	};
	const alarms = createAlarms(context);
	const work = () => readValues(mine);

	view = mine;
	mine.range.value = recall("health-range", "day");
	if (!mine.range.value)
		mine.range.value = "day";
	mine.range.addEventListener("change", () => {
		remember("health-range", mine.range.value);
		mine.anew = true;
		repeat(mine, work, VALUES_EVERY_MS);
	});
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, title(drive)),
			drive ? element("div", { class: "drive-links" }, element("a", { href: "#/health" }, t("All drives")),
				element("a", { href: `#/drive/${encodeURIComponent(drive)}` }, t("The drive"))) : null,
			createField(t("Time"), mine.range, "inline"), mine.state, mine.problem));
	if (why) {
		root.append(element("p", { class: "empty" }, why));
		return;
	}
	root.append(...(drive ? [mine.picture.node] : [alarms.node, mine.picture.node]));
	if (!drive) {
		repeat(mine, () => alarms.update(), ALARMS_EVERY_MS);
		context.on("link", (state) => {
			if (state === "down")
				alarms.forget();
		});
	}
	/* What is painted has the colours and the width of now. */
	const again = () => repeat(mine, work, VALUES_EVERY_MS);

	addEventListener("themechange", again);
	addEventListener("resize", again);
	mine.off = () => {
		removeEventListener("themechange", again);
		removeEventListener("resize", again);
	};
	await repeat(mine, work, VALUES_EVERY_MS);
}

export function hide() {
	view?.timers.forEach((timer) => clearTimeout(timer));
	view?.off?.();
	view = null;
}
