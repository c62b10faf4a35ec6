/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bits of `status`, and of the drive's own word by the vendor's names: those that are not as
 * usual, and all of them on request. The meaning of each is told where it is pressed: a finger has
 * no way to point at something.
 */
import { element, setAttribute, setText } from "./dom.js";
import { asLabel } from "./format.js";
import { inLanguage, t } from "./words.js";

const MEANINGS = {
	online: t("The drive answers."),
	enabled: t("The motor has power."),
	homed: t("The drive has found its origin."),
	moving: t("The drive moves."),
	at_target: t("The drive is at its target."),
	homing: t("The drive looks for its origin."),
	stopping: t("The drive brakes."),
	error_stop: t("A fault has stopped the drive; it needs \"Clear fault\"."),
	warning: t("The drive warns of something, and goes on."),
	busy: t("A command is under way."),
	latched: t("The watchdog has stopped the drive; motions are refused until \"Clear fault\"."),
	origin_lost: t("Positions are not certain: the drive has lost its origin."),
	params_valid: t("All parameters were read from the drive."),
	bus_up: t("The port of its bus is open."),
	refused: t("The last command was refused."),
	done: t("The last command has been carried out."),
	aborted: t("The last command was ended by another one, or by a stop."),
	params_unsaved: t("Parameters were changed and not saved in the drive: they are lost at power-off."),
	must_stand: t("The drive was told to stop, and has not been seen to stand."),
};
/* What should be on; what is a trouble where it is on. */
const USUALLY_ON = new Set(["online", "params_valid", "bus_up"]);
const TROUBLES = new Set(["error_stop", "warning", "latched", "origin_lost", "refused", "aborted",
	"params_unsaved", "must_stand"]);
/* In a vendor's description of a bit. */
const VENDORS_TROUBLE = /fault|error|alarm|warning|over-?(load|current|volt|heat|temp)|under-?volt|lost/i;

/* Whether a bit is not as usual: { name, description, own }, own: of the vendor's word. Pure. */
export function isUnusual({ name, description, own }, on) {
	if (own)
		return on && VENDORS_TROUBLE.test(`${name} ${description ?? ""}`);
	return USUALLY_ON.has(name) ? !on : on && TROUBLES.has(name);
}

function listBits(registers) {
	const bits = Object.entries(registers.get("status")?.codes ?? {}).map(([bit, name]) => ({
		name,
		description: MEANINGS[name],
		own: false,
		known: "status",
		read: (values) => Math.floor((values.status ?? 0) / 2 ** Number(bit)) % 2 === 1,
	}));
	const own = [...registers.values()]
		.filter(({ type, name }) => type === "bool" && name.startsWith("drive_"))
		.map(({ name, description }) => ({
			name: name.slice("drive_".length),
			description,
			own: true,
			known: name,
			read: (values) => values[name] === true,
		}));

	return [...bits, ...own];
}

/* The panel: { node, update(values) }. */
export function createLamps(registers) {
	const bits = listBits(registers);
	const meaning = element("p", { id: "lamp-meaning", class: "muted", role: "status" });
	const none = element("p", { class: "muted" }, t("Nothing is unusual."));
	const all = element("button", { id: "lamps-all", class: "small", type: "button",
		"aria-pressed": "false" }, t("Show all {count}", { count: bits.length }));
	const lamps = bits.map((bit) => {
		const node = element("button", { class: "badge lamp", type: "button", "data-bit": bit.name,
			"data-own": String(bit.own), onclick: () => tell(bit) },
		element("span", { class: "lamp-mark", "aria-hidden": "true" }), asLabel(bit.name),
		element("span", { class: "hidden-label" }));
		const item = element("li", { hidden: true }, node);

		return { bit, node, item, word: node.lastChild };
	});
	const node = element("section", { id: "status", class: "panel live", "aria-label": t("Status") },
		element("div", { class: "panel-head" }, element("h2", {}, t("Status")),
			element("span", { class: "push" }), all),
		none, element("ul", { class: "lamps" }, lamps.map(({ item }) => item)), meaning);
	let showsAll = false;

	function tell({ name, description, own }) {
		setText(meaning, `${asLabel(name)}${own ? t(" (the drive's own bit)") : ""}: ` +
			`${inLanguage(description) || t("its vendor says no more")}`);
	}

	all.addEventListener("click", () => {
		showsAll = !showsAll;
		setAttribute(all, "aria-pressed", String(showsAll));
		setText(all, showsAll ? t("Only the unusual") : t("Show all {count}", { count: bits.length }));
	});
	return {
		node,
		update(values) {
			let count = 0;

			for (const { bit, node: lamp, item, word } of lamps) {
				const known = values[bit.known] !== null && values[bit.known] !== undefined;
				const on = known && bit.read(values);
				const unusual = known && isUnusual(bit, on);

				count += unusual ? 1 : 0;
				item.hidden = !showsAll && !unusual;
				setAttribute(lamp, "data-on", known ? String(on) : "unknown");
				setAttribute(lamp, "data-trouble", String(unusual));
				setText(word, known ? on ? t(": yes") : t(": no") : t(": not known"));
			}
			none.hidden = showsAll || count > 0;
		},
	};
}
