/* SPDX-License-Identifier: Apache-2.0 */
/* Named positions of a drive: teach where it stands, go there, forget; and a sequence of them. */
import { call } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { formatReal } from "./format.js";
import { releaseWithPage } from "./hold_button.js";
import { askUser } from "./question.js";
import { createSequence } from "./sequence.js";
import { dateTag, inLanguage, t } from "./words.js";

const READ_EVERY_MS = 1000;
/* Flaws for which a person may know better: see Teach in the service's interface. */
const CONFIRMED = "other_origin";
const FLAWS = {
	offline: t("the drive does not answer"),
	other_drive: t("taught on another drive"),
	other_scale: t("taught with other counts per unit"),
	origin_lost: t("the drive does not know where it stands"),
	other_origin: t("the origin may have moved"),
};

let mine = null;

export const title = (drive) => drive ? t("Positions of {drive}", { drive }) : t("Positions");

export async function show(root, context, drive) {
	const names = [...context.plant.drives.keys()];
	const select = element("select", { id: "positions-drive",
		onchange: () => { location.hash = `#/positions/${encodeURIComponent(select.value)}`; } },
	names.map((name) => element("option", { value: name, selected: name === drive }, name)));
	const name = element("input", { id: "position-name", type: "text", maxlength: 32, autocomplete: "off",
		required: true });
	const teach = element("form", { class: "toolbar", onsubmit: (event) => {
		event.preventDefault();
		act(view, "Teach", { name: name.value.trim() });
	} }, createField(t("Name"), name), element("button", { id: "position-teach", class: "primary" },
		t("Teach where it stands")));
	const view = mine = {
		context,
		drive: drive || names[0],
		body: element("tbody"),
		said: element("p", { id: "positions-said", class: "problem", role: "status" }),
		none: element("p", { class: "muted", hidden: true }, t("No position is taught yet.")),
		sequence: createSequence({ context }),
		drawn: "",
		timer: 0,
		ends: [],
	};

	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Positions")),
			createField(t("Drive"), select, "inline")),
		element("section", { id: "positions", class: "panel", "aria-label": t("Positions") },
			context.may("engineer", view.drive) ? teach :
				element("p", { class: "muted" }, context.whyNot("engineer", view.drive)),
			element("div", { class: "table-frame" }, element("table", {},
				element("thead", {}, element("tr", {}, [t("Name"), t("Position"), t("State"), t("Taught"), ""]
					.map((words) => element("th", { scope: "col" }, words)))), view.body)),
			view.none, view.said),
		context.may("move") ? view.sequence.node : "");
	watchEnds(view);
	context.on("link", () => view.sequence.update());
	context.on("session", () => view.sequence.update());
	view.timer = setInterval(() => refresh(view), READ_EVERY_MS);
	await refresh(view);
}

export function hide() {
	const view = mine;

	mine = null;
	if (!view)
		return;
	clearInterval(view.timer);
	view.sequence.release();
	for (const end of view.ends)
		end();
}

/* Whatever takes the eyes or the hand away ends the sequence; Space and Escape stop the drive that is
 * shown as well. */
function watchEnds(view) {
	const key = (event) => {
		const isTyped = event.target instanceof HTMLInputElement && event.key === " ";

		if ((event.key !== " " && event.key !== "Escape") || isTyped || event.ctrlKey || event.altKey ||
		    event.metaKey)
			return;
		event.preventDefault();
		view.sequence.release();
		if (!event.repeat && view.drive && view.context.may("stop"))
			view.context.stop(view.drive).catch(() => {});
	};

	window.addEventListener("keydown", key, true);
	view.ends.push(() => window.removeEventListener("keydown", key, true),
		releaseWithPage(() => view.sequence.release()));
}

async function refresh(view) {
	if (!view.drive || document.hidden)
		return;
	try {
		const { positions, trouble } = await call("Positions", { drive: view.drive });

		if (view === mine)
			draw(view, positions, trouble);
	} catch (error) {
		setText(view.said, error.message);
	}
}

async function act(view, method, parameters) {
	setText(view.said, "");
	try {
		await call(method, { drive: view.drive, ...parameters });
	} catch (error) {
		setText(view.said, error.message);
		return;
	}
	refresh(view);
}

async function forget(view, name) {
	if (await askUser({ title: t("Forget {name}?", { name }), words: [t("{drive} cannot be sent there any more.", { drive: view.drive })],
		yes: t("Forget") }))
		act(view, "Forget", { name });
}

async function keep(view, name) {
	if (await askUser({ title: t("Is the origin of {drive} still the same?", { drive: view.drive }), words: [
		t("{name} is kept as it was taught. If the drive counts from elsewhere, it will go to a wrong place.", { name }),
	], yes: t("It is the same") }))
		act(view, "Teach", { name, keep: true });
}

function makeButtons(view, { name, flaw }) {
	const { context, drive } = view;
	const button = (id, label, onclick, disabled = false) => element("button",
		{ class: "small", type: "button", "data-do": id, disabled, onclick }, label);
	const buttons = [];

	if (context.may("move", drive))
		buttons.push(button("go", t("Go there"),
			() => act(view, "Run", { command: "move_absolute", position: name }), flaw !== ""),
		button("add", t("Add to the sequence"),
			() => view.sequence.add({ drive, position: name, velocity: 0, wait: 0 })));
	if (context.may("engineer", drive)) {
		if (flaw === CONFIRMED)
			buttons.push(button("keep", t("Keep it"), () => keep(view, name)));
		buttons.push(button("forget", t("Forget"), () => forget(view, name)));
	}
	return buttons;
}

function draw(view, positions, trouble) {
	const drawn = JSON.stringify([positions, trouble]);

	/* A button that is being pressed stays. */
	if (drawn === view.drawn)
		return;
	view.drawn = drawn;
	view.body.replaceChildren(...positions.map((position) => element("tr",
		{ "data-position": position.name, "data-flaw": position.flaw },
		element("th", { scope: "row" }, position.name),
		element("td", { class: "number" }, `${formatReal(position.units)} ${position.unit || "counts"}`),
		element("td", { title: inLanguage(position.advice), class: position.flaw ? "warning-text" : "" },
			position.flaw ? FLAWS[position.flaw] ?? position.flaw : t("good")),
		element("td", { title: position.taught_by },
			new Date(position.taught_us / 1000).toLocaleString(dateTag)),
		element("td", {}, element("div", { class: "toolbar" }, makeButtons(view, position))))));
	setText(view.said, trouble);
	view.none.hidden = trouble !== "" || positions.length > 0;
}
