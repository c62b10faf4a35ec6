/* SPDX-License-Identifier: Apache-2.0 */
/* The end of the path: a report to print or to keep as a file, with what was done, by whom and when. */
import { call, getSession } from "./api.js";
import { STEPS, TRIALS, listOpen, listVerdicts, listWanted, stateOf } from "./commission_record.js";
import { STATES, STEP_WORDS, VERDICT_WORDS } from "./commission_words.js";
import { element } from "./dom.js";
import { nameTime, saveFile } from "./file_transfer.js";
import { NONE, formatReal, formatWithUnit, inWords } from "./format.js";
import { isKept } from "./parameter_set.js";
import { nameResponse, sayResponse } from "./response.js";
import { drawResponse } from "./response_plot.js";
import { inLanguage, languageTag, t } from "./words.js";

/* Of the file, which has no other style sheet: as it is printed. */
const STYLE = `body{font:14px/1.45 system-ui,sans-serif;max-width:52em;margin:2em auto;padding:0 1em;color:#18212a}
table{border-collapse:collapse;width:100%;margin:.4em 0}th,td{text-align:left;vertical-align:top;padding:3px 8px;border-bottom:1px solid #ccc}
section{break-inside:avoid}dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 16px}dd{margin:0}
.sign{margin-top:4em;border-top:1px solid;width:22em}
.response-plot{width:100%}.response-plot text{font-size:11px;fill:#55626f}.grid{stroke:#d8dee5}.target{stroke:#8a5200;stroke-dasharray:6 4}
.newest,.former{fill:none;stroke:#0b5cad;stroke-width:2}.former{stroke:#7c8894;stroke-dasharray:4 3}`;

const writeTime = (time) => (time ?
	new Date(time).toLocaleString(languageTag === "en" ? "en-GB" : languageTag) : NONE);

const writeWho = ({ by, at }) => (by ? t("{by}, {time}", { by, time: writeTime(at) }) : writeTime(at));

function makeTable(id, heads, rows) {
	return element("table", { id }, element("thead", {}, element("tr", {},
		heads.map((head) => element("th", { scope: "col" }, head)))),
	element("tbody", {}, rows.map((cells) => element("tr", {}, cells.map((cell, i) =>
		element(i === 0 ? "th" : "td", i === 0 ? { scope: "row" } : {}, cell))))));
}

/* How many of the trials of a step were as they should be. */
function sayTrials(record, step) {
	const count = (verdict) => listVerdicts(record, step).filter((one) => one.verdict === verdict).length;

	return t("{count} proven, {wrong} contradicted", { count: count("proven"), wrong: count("contradicted") });
}

/* What a step has found, in a few words. Pure. */
export function sayOutcome(step, values = {}) {
	const place = () => `${typeof values.position === "number" ? formatReal(values.position) : values.position} ${values.unit}`;

	switch (step) {
	case "found":
		return t("{identity} on bus {bus}, address {address}", values);
	case "home":
		return values.how === "home" ? t("it has found its origin, and stood at {place}", { place: place() }) :
			t("its position was set to {place}", { place: place() });
	case "limits":
		return t("{min} to {max} {unit}", { ...values, min: formatReal(values.min), max: formatReal(values.max) });
	case "response":
		return values.settled === undefined ? "" : sayResponse(nameResponse(values.kind), values);
	case "saved":
		return values.result ? t("save_parameters: {result}", { result: inWords(values.result) }) : "";
	default:
		return "";
	}
}

function makeSteps(record) {
	return makeTable("report-steps", [t("Step"), t("State"), t("Outcome"), t("Who and when")],
		STEPS.filter((step) => step !== "report").map((step) => {
			const done = record.steps[step];
			const state = stateOf(record, step);

			return [STEP_WORDS[step], STATES[state], done?.state !== "done" ? "" : step in TRIALS ? sayTrials(record, step) : sayOutcome(step, done.values),
				done && state !== "open" ? writeWho(done) : ""];
		}));
}

function makeVerdicts(record) {
	const rows = ["direction", "scale", "trials"].flatMap((own) => listVerdicts(record, own)).map((one) =>
		[one.setting, VERDICT_WORDS[one.verdict] ?? one.verdict, one.now ?? "", inLanguage(one.how), inLanguage(one.right ?? "")]);

	return rows.length > 0 ? element("section", {}, element("h2", {}, t("Trials")),
		makeTable("report-verdicts", [t("Setting"), t("State"), t("Before"), t("What was seen"), t("What is right")], rows)) : null;
}

function makeKeys(record) {
	return record.keys.length > 0 ? element("section", {}, element("h2", {}, t("For the configuration")),
		makeTable("report-keys", [t("Setting"), t("Value"), t("Who and when")], record.keys.map((one) =>
			[`${one.kind} ${one.name}: ${one.key}`, one.value, one.at ? writeWho(one) : t("not written yet")]))) : null;
}

function makeResponses({ responses, steps }) {
	return responses.length > 0 && steps.response?.state !== "left" ?
		element("section", {}, element("h2", {}, t("Step response")), drawResponse(responses, responses[0].unit),
			responses.map((one, i) => element("p", {}, `${i === 0 ? "" : t("Before: ")}${writeWho(one)}: ` +
				`${one.measured ? sayResponse(nameResponse(one.kind), one.measured) : t("It did not come to its end, or did not move.")} ` +
				Object.entries(one.parameters ?? {}).map(([name, value]) => `${name} = ${typeof value === "number" ? formatReal(value) : NONE}`)
					.join(", ")))) : null;
}

/* Of the drive's parameters those that were changed, then all others. */
function makeParameters({ before }, registers, values) {
	const kept = [...registers.values()].filter(isKept);
	const write = (register, set) => (typeof set?.[register.name] === "number" ? formatWithUnit(register, set[register.name]) : NONE);
	const changed = kept.filter(({ name }) => before && before[name] !== values[name]);
	const same = kept.filter((register) => !changed.includes(register) && typeof values[register.name] === "number");

	return element("section", {}, element("h2", {}, t("Parameters")),
		changed.length > 0 ? makeTable("report-changed", [t("Parameter"), t("Before"), t("Now"), t("Meaning")],
			changed.map((register) => [register.name, write(register, before), write(register, values),
				inLanguage(register.description).split(":")[0]])) :
			element("p", {}, before ? t("None was changed.") : t("What they were before is not known.")),
		element("h3", {}, t("As they were")),
		element("p", { id: "report-same" }, same.map((register) => `${register.name} = ${write(register, values)}`).join(", ")));
}

async function makeReport({ context, name, registers, record, identity, drive, countsPerUnit }) {
	const { description } = drive() ?? {};
	const bus = context.plant.buses.get(description?.bus)?.description;
	const { values } = await call("Read", { drive: name,
		names: [...registers.values()].filter((register) => register.parameter).map((register) => register.name) });
	const open = listOpen(record);
	const unit = description?.unit_name || "counts";
	const row = (words, value) => [element("dt", {}, words), element("dd", {}, value || NONE)];
	const limit = (value) => (typeof value === "number" ? `${formatReal(value)} ${unit}` : t("none"));

	return element("article", { id: "report", class: "panel report" },
		element("h1", {}, t("Commissioning of {drive}", { drive: name })),
		element("dl", {},
			row(t("Drive"), identity), row(t("Family"), bus?.protocol),
			row(t("Bus and address"), `${description?.bus ?? ""}, ${description?.address ?? ""} ${description?.axis ?? ""}`.trim()),
			row(t("Modbus unit"), String(description?.unit ?? "")),
			row("counts-per-unit", typeof countsPerUnit === "number" ?
				t("{counts} counts per {unit}", { counts: formatReal(countsPerUnit), unit }) : ""),
			row("min-position", limit(description?.min_position)), row("max-position", limit(description?.max_position)),
			row(t("Gateway"), `${location.host}, drivebridge ${context.plant.description?.version ?? ""}`),
			row(t("Begun"), writeTime(record.begun)),
			row(t("This report"), writeWho({ by: getSession().user, at: Date.now() }))),
		open.length > 0 ? element("p", { id: "report-open", class: "problem" },
			t("Not done: {steps}", { steps: open.map((step) => STEP_WORDS[step]).join(", ") })) : null,
		listWanted(record).length > 0 ? element("p", { class: "problem" }, t("The configuration does not have all values yet.")) : null,
		element("section", {}, element("h2", {}, t("Steps")), makeSteps(record)),
		makeResponses(record), makeVerdicts(record), makeKeys(record), makeParameters(record, registers, values),
		element("p", { class: "sign" }, t("Date, name, signature")));
}

/* path: see commission.js. */
export async function createReport(path) {
	const report = await makeReport(path);
	const words = t("Commissioning of {drive}", { drive: path.name });
	/* As a text: styles in a document of this page are against its policy. */
	const page = () => `<!doctype html>\n<html lang="${languageTag}"><head><meta charset="utf-8">` +
		`${element("title", {}, words).outerHTML}<style>${STYLE}</style></head><body>${report.outerHTML}</body></html>\n`;

	return {
		node: element("div", { class: "view-part" },
			element("div", { class: "toolbar" },
				element("button", { id: "report-print", class: "primary", type: "button", onclick: () => window.print() }, t("Print")),
				element("button", { id: "report-keep", type: "button", onclick: () =>
					saveFile(`${path.name}.commissioning-${nameTime()}.html`, [page()], "text/html;charset=utf-8") },
				t("Keep as a file"))), report),
	};
}
