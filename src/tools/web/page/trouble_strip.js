/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What needs somebody, above everything: which drive or bus, since when, why and what to do. The
 * strip never moves what is under a pointer that is on its way to a button: it waits for a moment in
 * which the pointer rests.
 */
import { element, icon, setAttribute, setText } from "./dom.js";
import { formatSince } from "./format.js";
import { NEED, readRecord } from "./plant.js";
import { t } from "./words.js";

/* Without a move of the pointer for this time it rests. */
const RESTS_MS = 1000;
/* More of them are shown on request. */
const SHOWN_FIRST = 5;

/*
 * The entries of the strip, from the plant's troubles: { key, kind, name, need, why, todo, event,
 * since_us, href }, the worst first, then the newest. Pure.
 */
export function listTroubles(troubles) {
	const entries = [];
	const add = (kind, name, record, href) => {
		const { need, why, todo, event } = readRecord(record);

		if (need >= NEED.look)
			entries.push({ key: `${kind} ${name}`, kind, name, need, why, todo, event, href,
				since_us: record.since_us });
	};

	for (const [name, record] of Object.entries(troubles?.buses ?? {}))
		add("bus", name, record, `#/trace/${encodeURIComponent(name)}`);
	for (const [name, record] of Object.entries(troubles?.drives ?? {}))
		add("drive", name, record, `#/drive/${encodeURIComponent(name)}`);
	return entries.sort((one, other) => other.need - one.need ||
		(one.kind === other.kind ? other.since_us - one.since_us : one.kind === "bus" ? -1 : 1));
}

/* The strip. { node, update(), frame(now) }; `guarded` is what must not move under a pointer. */
export function createTroubleStrip(context, guarded) {
	const list = element("ul", { class: "troubles-list" });
	const more = element("button", { class: "small", type: "button", hidden: true });
	const node = element("section", { id: "troubles", class: "panel troubles live", hidden: true,
		role: "status", "aria-label": t("What needs somebody") }, list,
		element("div", { class: "toolbar" }, more, element("a", { href: "#/health" }, t("All alarms"))));
	let shown = "";
	let wanted = [];
	let all = false;
	let movedAt = -Infinity;
	let saidAt = 0;

	const see = () => { movedAt = performance.now(); };

	guarded.addEventListener("pointermove", see);
	guarded.addEventListener("pointerdown", see);
	guarded.addEventListener("pointerleave", () => { movedAt = -Infinity; });
	more.addEventListener("click", () => {
		all = !all;
		draw();
	});

	function makeItem({ kind, name, need, why, todo, event, since_us, href }) {
		return element("li", { "data-need": String(need), "data-of": `${kind} ${name}` },
			icon(need === NEED.act ? "error" : "warning"),
			element("a", { href }, kind === "bus" ? t("Bus {name}", { name }) : name),
			element("strong", {}, why),
			element("span", { class: "since muted", "data-since": since_us }),
			element("span", { class: "troubles-advice" }, todo,
				event && element("span", { class: todo ? "troubles-event" : null }, todo && " · ", event)));
	}

	function draw() {
		const part = all ? wanted : wanted.slice(0, SHOWN_FIRST);

		shown = JSON.stringify(wanted);
		node.hidden = wanted.length === 0;
		list.replaceChildren(...part.map(makeItem));
		more.hidden = wanted.length <= SHOWN_FIRST;
		setText(more, all ? t("Only the first {SHOWN_FIRST}", { SHOWN_FIRST }) :
			t("{count} more", { count: wanted.length - SHOWN_FIRST }));
		saySince(Date.now());
	}

	function saySince(now) {
		for (const since of list.querySelectorAll("[data-since]"))
			setText(since, formatSince(Number(since.dataset.since), now));
	}

	return {
		node,
		update() { wanted = listTroubles(context.plant.troubles); },
		frame(now) {
			if (now - movedAt > RESTS_MS && JSON.stringify(wanted) !== shown)
				draw();
			if (now - saidAt < 500)
				return;
			saidAt = now;
			saySince(Date.now());
			setAttribute(node, "data-old", String(context.link() !== "live"));
		},
	};
}
