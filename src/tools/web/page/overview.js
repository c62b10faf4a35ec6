/* SPDX-License-Identifier: Apache-2.0 */
/* What needs somebody, the drives, and the buses. */
import { createBusLines } from "./bus_lines.js";
import { element, icon, setAttribute, setText } from "./dom.js";
import { createDriveRows, STATES } from "./drive_rows.js";
import { recall, remember } from "./kept_choice.js";
import { NEED, readRecord } from "./plant.js";
import { createTroubleStrip } from "./trouble_strip.js";
import { plural, t } from "./words.js";

export const title = t("Overview");

/* From this number of drives on there are filters. */
const FILTER_FROM = 9;

let view = null;

export function show(root, context) {
	const rows = createDriveRows(context);

	view = {
		context,
		rows,
		buses: createBusLines(context),
		strip: createTroubleStrip(context, rows.table),
		summary: element("button", { id: "summary", class: "summary quiet", type: "button" }),
		configuration: element("div",
			{ id: "configuration", class: "panel configuration-need", role: "status", hidden: true }),
		configured: "",
		filters: makeFilters(context),
	};
	/* It shows the drives that it counts. */
	view.summary.addEventListener("click", () => {
		view.filters.state.value = view.filters.state.value === "needs" ? "all" : "needs";
		filter();
	});
	root.append(element("div", { class: "view-head" }, element("h1", {}, t("Overview")),
		element("span", { role: "status" }, view.summary)),
	view.configuration, view.strip.node,
	element("div", { class: "overview-parts" },
		element("section", { class: "overview-buses" },
			element("h2", { class: "hidden-label" }, t("Buses")), view.buses.node),
		element("section", { class: "overview-drives" },
			element("h2", { class: "hidden-label" }, t("Drives")), view.filters.node, rows.node)));
	context.on("describe", describe);
	context.on("session", describe);
	context.on("plant", update);
	context.on("link", update);
	context.on("frame", (now) => {
		rows.frame(now);
		view.strip.frame(now);
		if (context.link() !== "live")
			showSummary();
	});
	describe();
}

export function hide() { view = null; }

/* --- filters ---------------------------------------------------------------------------------- */

function makeFilters(context) {
	const words = element("input", { id: "filter", type: "search", placeholder: t("Filter"),
		"aria-label": t("Show only drives with this in name, bus or state"), spellcheck: "false" });
	const bus = element("select", { id: "filter-bus", "aria-label": t("Show only drives of this bus") });
	const state = element("select", { id: "filter-state", "aria-label": t("Show only drives") },
		Object.entries(STATES).map(([value, [label]]) => element("option", { value }, label)));
	const count = element("span", { id: "filter-count", class: "muted", role: "status" });
	const dense = element("button", { id: "dense", class: "small", type: "button" }, t("Dense rows"));
	const more = [words, bus, state, count];
	const setDense = (on) => {
		setAttribute(dense, "aria-pressed", String(on));
		document.documentElement.classList.toggle("dense", on);
	};

	words.addEventListener("input", filter);
	bus.addEventListener("change", filter);
	state.addEventListener("change", filter);
	dense.addEventListener("click", () => {
		const on = dense.getAttribute("aria-pressed") !== "true";

		setDense(on);
		remember("dense", on ? "yes" : "no");
	});
	setDense(recall("dense", "no") === "yes");
	return {
		node: element("div", { class: "toolbar overview-filters" }, words, bus, state, count,
			element("span", { class: "push" }), dense),
		words,
		bus,
		state,
		count,
		describe() {
			const { value } = bus;

			bus.replaceChildren(element("option", { value: "" }, t("of any bus")),
				...[...context.plant.buses.keys()].map((name) =>
					element("option", { value: name }, t("of {name}", { name }))));
			bus.value = context.plant.buses.has(value) ? value : "";
			for (const one of more)
				one.hidden = context.plant.drives.size < FILTER_FROM;
		},
	};
}

function filter() {
	const { words, bus, state, count } = view.filters;
	const shown = view.rows.filter({ words: words.value, bus: bus.value, state: state.value });
	const all = view.context.plant.drives.size;

	setText(count, shown === all ? plural(all, "{all} drive", "{all} drives", { all }) :
		t("{shown} of {all} drives", { shown, all }));
	setAttribute(view.summary, "aria-pressed", String(state.value === "needs"));
}

/* --- streamed data ---------------------------------------------------------------------------- */

function describe() {
	view.filters.describe();
	view.rows.describe();
	view.buses.describe();
	update();
}

function update() {
	view.rows.update();
	view.buses.update();
	view.strip.update();
	filter();
	showSummary();
	showConfiguration(view.context.plant);
}

/* The mistakes in its files, one per line. */
function showConfiguration({ troubles }) {
	const record = troubles?.configuration;
	const { need, why, advice } = readRecord(record);
	const shown = JSON.stringify(record ?? null);

	if (shown === view.configured)
		return;
	view.configured = shown;
	view.configuration.hidden = need === NEED.nothing;
	setAttribute(view.configuration, "data-need", String(need));
	view.configuration.replaceChildren(icon(["fine", "hint", "warning", "error"][need]),
		element("p", {}, element("strong", {}, t("Configuration: {why}", { why })), ` ${advice}`),
		element("pre", { hidden: !record?.errors?.length }, (record?.errors ?? []).join("\n")));
}

function showSummary() {
	const { plant } = view.context;
	const { drives, buses, configuration } = plant.countNeeds();
	const look = drives[NEED.look] + buses[NEED.look] + configuration[NEED.look];
	const parts = [
		[buses[NEED.act], (count) => plural(count, "{count} bus is down",
			"{count} buses are down", { count }), NEED.act],
		[drives[NEED.act], (count) => plural(count, "{count} drive needs you",
			"{count} drives need you", { count }), NEED.act],
		[configuration[NEED.act], (count) => t("{count} configuration needs you", { count }),
			NEED.act],
		[look, (count) => t("{count} to look at", { count }), NEED.look],
	].filter(([count]) => count > 0);
	const said = parts.map(([count, inWords]) => inWords(count));
	const well = plant.troubles?.well && parts.length === 0;
	const old = view.context.sayOld();

	/* The service decides whether all is well, not the values shown here; and what it said is not
	 * known to hold without a connection. */
	setText(view.summary, old || said.join(", ") ||
		(well && plant.drives.size > 0 ? t("all is well") : ""));
	setAttribute(view.summary, "data-need",
		String(parts.length > 0 && !old ? parts[0][2] : NEED.nothing));
	view.summary.disabled = old !== "" || parts.length === 0;
}
