/* SPDX-License-Identifier: Apache-2.0 */
/* One line for each bus: whether it is up, its load, its drives and what it has lost. */
import { element, icon, setAttribute, setIcon, setText } from "./dom.js";
import { formatFixed, formatSpeed, inWords, NONE } from "./format.js";
import { readRecord } from "./plant.js";
import { inLanguage, t } from "./words.js";

function makeFact(label, node) {
	return element("span", { class: "bus-fact" }, element("span", { class: "muted" }, label), node);
}

function makeLine(bus) {
	const { name, title: family, device, speed, drives, protocol } = bus.description;
	const cells = {
		icon: icon("fine"),
		port: element("span", { class: "bus-port" }),
		load: element("meter",
			{ min: "0", max: "100", high: "90", "aria-label": t("Load of bus {name}", { name }) }),
		loadText: element("span", { class: "load-text number" }),
		online: element("span"),
		cycle: element("span"),
		late: element("span"),
		bad: element("span"),
		trouble: element("p", { class: "bus-trouble", hidden: true }),
		count: drives.length,
	};

	cells.line = element("li", { class: "bus-line live", "data-bus": name },
		element("span", { class: "bus-name" }, cells.icon,
			element("a", { href: `#/trace/${encodeURIComponent(name)}` }, name), cells.port),
		makeFact(t("Online"), cells.online),
		makeFact(t("Load"), element("span", { class: "bus-load" }, cells.load, cells.loadText)),
		makeFact(t("Cycle"), cells.cycle), makeFact(t("Overruns"), cells.late),
		makeFact(t("No answer"), cells.bad),
		element("small", { class: "muted bus-device", title: protocol },
			`${inLanguage(family)} · ${device} · ${formatSpeed(speed)}`),
		cells.trouble);
	return cells;
}

function updateLine(cells, { description, figures }, record) {
	const load = figures ? figures.utilisation / 10 : 0;
	const ms = (us, decimals) => formatFixed(us / 1000, decimals);
	const { why, advice } = readRecord(record);

	setText(cells.port, record ? inWords(record.cause) : description.up ? t("up") : t("port not open"));
	setIcon(cells.icon, description.up ? "fine" : "error");
	cells.line.classList.toggle("down", !description.up);
	cells.load.value = load;
	setText(cells.loadText, figures ? `${formatFixed(load, 1)} %` : NONE);
	setText(cells.online, figures ? t("{online} of {count}", { online: figures.online, count: cells.count }) : NONE);
	/* Where nobody answers, a cycle is as long as the pauses between the attempts. */
	setText(cells.cycle,
		figures?.online > 0 ? t("{cycle_us} of {period_us} ms", { cycle_us: ms(figures.cycle_us, 1), period_us: ms(figures.period_us, 0) }) : NONE);
	setText(cells.late, figures ? String(figures.overruns) : NONE);
	setText(cells.bad, figures ? String(figures.timeouts) : NONE);
	cells.trouble.hidden = !record;
	setText(cells.trouble, record ? `${why}: ${advice}` : "");
}

/* { node, describe(), update() } */
export function createBusLines(context) {
	const list = element("ul", { id: "buses", class: "bus-lines panel", "aria-label": t("Buses") });
	const lines = new Map();

	return {
		node: list,
		describe() {
			lines.clear();
			for (const [name, bus] of context.plant.buses)
				lines.set(name, makeLine(bus));
			list.replaceChildren(...[...lines.values()].map(({ line }) => line));
			list.hidden = lines.size === 0;
			setAttribute(list, "data-count", String(lines.size));
		},
		update() {
			for (const [name, cells] of lines) {
				const bus = context.plant.buses.get(name);

				if (bus)
					updateLine(cells, bus, context.plant.troubles?.buses[name]);
			}
		},
	};
}
