/* SPDX-License-Identifier: Apache-2.0 */
/* Where else the user is logged in, and logging out there. */
import { endSessions, listSessions } from "./api.js";
import { element } from "./dom.js";
import { formatAge, formatTime } from "./format.js";
import { t } from "./words.js";

function makeRow(mine, { number, from, begun_ms, used_ms, own }) {
	const since = formatTime((Date.now() - begun_ms) * 1000).replace(/\.\d+$/, "");
	const button = element("button", { class: "small", type: "button", "data-session": number,
		"aria-label": t("Log out the session from {from}, since {since}", { from, since }) }, t("Log out"));

	button.addEventListener("click", () => end(mine, { number }, button));
	return element("tr", {}, element("td", {}, from), element("td", {}, since),
		element("td", {}, t("{age} ago", { age: formatAge(used_ms) })),
		element("td", {}, own ? element("strong", {}, t("this one")) : button));
}

function show(mine, sessions) {
	mine.body.replaceChildren(...sessions.map((one) => makeRow(mine, one)));
	mine.all.hidden = !sessions.some(({ own }) => !own);
}

async function end(mine, which, button) {
	button.disabled = true;
	try {
		show(mine, await endSessions(which));
		mine.context.notify(t("Logged out there. What it moved ends like a lost connection."), "ok");
	} catch (error) {
		mine.context.report(error);
		await load(mine);
	}
	button.disabled = false;
}

async function load(mine) {
	await listSessions().then((sessions) => show(mine, sessions), mine.context.report);
}

/* The panel. */
export function createOwnSessions(context) {
	const mine = {
		context,
		body: element("tbody"),
		all: element("button", { id: "sessions-end", type: "button", hidden: true }, t("Log out everywhere else"))
	};

	mine.all.addEventListener("click", () => end(mine, { others: true }, mine.all));
	load(mine);
	return element("section", { class: "panel", "aria-labelledby": "sessions-title" },
		element("h2", { id: "sessions-title" }, t("Logged in")),
		element("div", { class: "table-frame", tabindex: "0", role: "region", "aria-labelledby": "sessions-title" },
			element("table", { id: "sessions" },
				element("thead", {}, element("tr", {}, [t("From"), t("Since"), t("Last used"), ""].map(
					(words) => element(words ? "th" : "td", { scope: words ? "col" : null }, words)))),
				mine.body)),
		mine.all);
}
