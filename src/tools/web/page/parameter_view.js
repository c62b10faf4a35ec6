/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parameters of one drive: their meaning, how they differ from other sets, and changing them. Nothing
 * is written before the user has reviewed and confirmed it.
 */
import { ask, call } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { saveFile } from "./file_transfer.js";
import { formatAge, formatTime, hasBit, parseValue } from "./format.js";
import { createBeside, listNames, readSet } from "./parameter_beside.js";
import { agree, hasTrait, isKept, valueOf } from "./parameter_set.js";
import { createParameterTable, writeTyped } from "./parameter_table.js";
import { compareAfter, createReport, writeInto } from "./parameter_write.js";
import { askUser } from "./question.js";
import { inLanguage, plural, t } from "./words.js";

/* The service stores its drives' values: reading them causes no traffic on the bus. */
const READ_EVERY_MS = 3000;
/* Values in a file that are older are mentioned. */
const OLD_MS = 10000;

/* Typed and unwritten values, by drive: { edits, from }; kept when another page is shown. */
const drafts = new Map();

/* --- a file --- */

async function backUp(context, drive) {
	try {
		const { text, not_told, missing, oldest_ms } = await ask(
			"POST",
			"parameters/file",
			{ drive }
		);

		saveFile(`${drive}.params`, [text]);
		if (not_told.length > 0)
			context.notify(t("{drive} does not have or tell {not_told}", { drive, not_told: not_told.join(", ") }));
		if (oldest_ms >= OLD_MS)
			context.notify(
				t("{drive}: its values were read up to {oldest_ms} ago", { drive, oldest_ms: formatAge(oldest_ms) })
			);
		if (missing?.length > 0)
			context.notify(
				t("{drive} should have told {missing}, and did not", { drive, missing: missing.join(", ") }),
				"warning"
			);
	} catch (error) {
		context.report(error);
	}
}

/* --- display --- */

function createButton(id, words, properties = {}) {
	return element("button", { id: `parameters-${id}`, type: "button", ...properties }, words);
}

function createParts(mayAct) {
	const choices = [
		["", t("all")],
		["changed", t("changed")],
		["differs", t("that differ")]
	];

	return {
		when: element("span", { id: "parameters-when", class: "muted" }),
		problem: element("div", { id: "parameters-problem", class: "problem", role: "alert" }),
		unsaved: element(
			"span",
			{ id: "parameters-unsaved", class: "badge warning", hidden: true },
			icon("warning"),
			t("not saved in the drive: lost at power-off")
		),
		search: element("input", { id: "parameters-search", type: "search", autocomplete: "off" }),
		which: element(
			"select",
			{ id: "parameters-which" },
			choices.map(([value, words]) => element("option", { value }, words))
		),
		report: element("div", {
			id: "parameters-report",
			class: "panel",
			role: "status",
			tabindex: "-1",
			hidden: true
		}),
		count: element("span", { id: "parameters-count", class: "muted", role: "status" }),
		place: element("div", { class: "place" }),
		write: createButton("write", t("Write"), { class: "primary", hidden: !mayAct }),
		discard: createButton("discard", t("Discard changes"), { hidden: !mayAct }),
		end: createButton("end", t("End writing"), { hidden: true }),
		save: createButton("save", t("Save into the drive"), { hidden: true }),
		backup: createButton("backup", t("Back up into a file"))
	};
}

function arrange(root, { parts, beside, why }) {
	root.append(
		element(
			"div",
			{ class: "panel toolbar filters" },
			createField(t("Search"), parts.search),
			createField(t("Show"), parts.which),
			beside.fields,
			parts.backup,
			parts.count,
			parts.when
		),
		element(
			"div",
			{ class: "toolbar" },
			parts.write,
			parts.discard,
			parts.end,
			parts.save,
			parts.unsaved,
			why ? element("span", { class: "muted" }, why) : null
		),
		parts.problem,
		beside.node,
		parts.report,
		parts.place
	);
}

function applyFilter(view) {
	const { parts, held } = view;

	if (view.table === null)
		return;
	const wanted = parts.search.value.trim().toLowerCase();
	const other = view.beside.set();
	const shown = view.table.filter(
		(register) =>
			`${register.name} ${register.description} ${inLanguage(register.description)} ${register.unit}`
				.toLowerCase()
				.includes(wanted) &&
			(parts.which.value !== "changed" || view.edits.has(register.name)) &&
			(parts.which.value !== "differs" ||
				(other !== null && isKept(register) && !agree(held, other, register)))
	);

	setText(
		parts.count,
		shown === held.registers.length
			? ""
			: t("{shown} of {count}", { shown, count: held.registers.length })
	);
}

function update({ parts, table, held, beside, edits, busy, canSave, why }) {
	if (table === null)
		return;
	table.update({ held, beside: beside.set(), edits, busy });
	setText(
		parts.write,
		plural(edits.size, "Write 1 change", "Write {count} changes", { count: edits.size })
	);
	parts.write.disabled = parts.discard.disabled = busy || edits.size === 0;
	parts.end.hidden = !busy;
	parts.backup.disabled = parts.save.disabled = busy;
	parts.save.hidden = !canSave || why !== "";
}

function refresh(view) {
	update(view);
	view.beside.update(view.held);
	applyFilter(view);
}

/* Another drive may have the name in a new configuration. */
async function renewTable(view) {
	const { registers } = view.held;

	if (listNames(registers) === view.listed)
		return;
	view.listed = listNames(registers);
	view.table = createParameterTable({
		registers,
		mayEdit: view.why === "",
		onEdit: (register, typed) => edit(view, register, typed)
	});
	view.parts.place.replaceChildren(view.table.node);
	view.canSave = (await view.context.commands(view.drive)).has("save_parameters");
}

async function read(view) {
	clearTimeout(view.timer);
	try {
		view.held = await readSet(view.context, view.drive);
		if (view.closed)
			return;
		setText(view.parts.problem, "");
		setText(view.parts.when, t("as of {formatTime}", { formatTime: formatTime(Date.now() * 1000) }));
		await renewTable(view);
		refresh(view);
	} catch (error) {
		setText(view.parts.problem, error.message);
		update(view);
	}
	if (!view.closed)
		view.timer = setTimeout(() => (view.busy ? null : read(view)), READ_EVERY_MS);
}

/* --- typing --- */

/* True if it equals the drive's value. */
function isHeld(held, register, typed, parsed) {
	if (hasTrait(register, "secret"))
		return typed === "";
	if (typed.trim() === "")
		return valueOf(held, register.name) === null;
	return (
		parsed.problem === undefined &&
		agree({ values: { [register.name]: parsed.value } }, held, register)
	);
}

function edit(view, register, typed) {
	const { edits } = view;
	const parsed = parseValue(register, typed);

	if (isHeld(view.held, register, typed, parsed))
		edits.delete(register.name);
	else
		edits.set(register.name, { typed, ...parsed });
	if (edits.size === 0)
		view.draft.from = "";
	view.table.showResult(register.name, "", "");
	update(view);
}

function discard(view) {
	view.edits.clear();
	view.draft.from = "";
	refresh(view);
}

function takeOver(view, registers, from) {
	for (const register of registers)
		edit(view, register, writeTyped(register, valueOf(from, register.name)));
	view.draft.from = from.name;
	refresh(view);
	view.parts.write.focus();
}

/* --- writing --- */

async function mayWrite({ context, drive, edits, held, table }) {
	const wrong = [...edits].find(([, { problem }]) => problem !== undefined);
	const addresses = held.registers.filter(
		(register) => edits.has(register.name) && hasTrait(register, "address")
	);

	if (wrong) {
		table.focus(wrong[0]);
		context.notify(`${wrong[0]}: ${wrong[1].problem}`, "error");
		return false;
	}
	return (
		addresses.length === 0 ||
		askUser({
			title: t("Where {drive} is heard", { drive }),
			yes: t("Write"),
			words: [
				t("{addresses} says where the drive is heard. When it goes by that, it is offline here until the configuration says the same.", { addresses: listNames(addresses) }),
				t("It is written last. Scan has a way that looks first and afterwards.")
			]
		})
	);
}

async function write(view) {
	if (view.busy)
		return;
	view.busy = true;
	try {
		if (await mayWrite(view)) {
			view.parts.end.disabled = false;
			update(view);
			await carryOut(view);
		}
	} catch (error) {
		view.context.report(error);
	}
	view.busy = false;
	if (!view.closed)
		await read(view);
}

function endWriting({ parts, drive, context }) {
	parts.end.disabled = true;
	ask("POST", "parameters/end", { drive }, { named: true }).catch(context.report);
}

async function carryOut(view) {
	const { context, drive, edits, held, parts } = view;
	const before = { ...held, values: { ...held.values } };
	const wanted = Object.fromEntries([...edits].map(([name, { value }]) => [name, value]));

	/* They change a running motion, and some drives accept or report them only at
	 * standstill. */
	view.writing = writeInto(drive, wanted, Boolean(view.draft.from), (told) => {
		if (told.value !== undefined)
			view.held.values[told.name] = told.value;
		if (told.state === "done")
			edits.delete(told.name);
		view.table.showResult(told.name, told.state, told.text);
	});
	const { written, failed, over } = await view.writing.result;

	const after = await readSet(context, drive).catch(() => before);
	const others =
		after === before ? [] : compareAfter({ before, after, wanted, written, failed });
	const { words, node } = createReport({
		drive,
		canSave: view.canSave,
		written,
		failed,
		over,
		others
	});

	written.filter((name) => failed.has(name)).forEach((name) =>
		view.table.showResult(name, "failed", failed.get(name))
	);
	parts.report.replaceChildren(node);
	parts.report.hidden = false;
	parts.report.focus();
	context.notify(words, failed.size > 0 ? "error" : "ok");
}

async function saveIntoDrive({ context, drive, parts }) {
	parts.save.disabled = true;
	try {
		const { result } = await call("Run", {
			drive,
			command: "save_parameters",
			until_end: true
		});

		context.notify(t("{drive}: save_parameters: {result}", { drive, result }), "ok");
		parts.report.hidden = true;
	} catch (error) {
		context.notify(t("{drive}: save_parameters: {message}", { drive, message: error.message }), "error");
	}
	parts.save.disabled = false;
}

/* --- the view --- */

/* Shown in root until close(). Returns { showMark(), close() }. */
export function openParameters(root, context, drive) {
	const why = context.whyNot("engineer", drive);
	const draft = (why === "" && drafts.get(drive)) || { edits: new Map(), from: "" };
	const parts = createParts(why === "");
	const view = {
		context,
		drive,
		/* Why nothing may be changed; empty: it may. */
		why,
		draft,
		edits: draft.edits,
		parts,
		beside: null,
		/* What the drive was last seen to have. */
		held: null,
		table: null,
		/* The names in the table. */
		listed: "",
		canSave: false,
		busy: false,
		writing: null,
		timer: 0,
		closed: false
	};

	drafts.set(drive, draft);
	view.beside = createBeside({
		context,
		drive,
		onChange: () => refresh(view),
		takeOver: (registers, from) => takeOver(view, registers, from)
	});
	parts.search.addEventListener("input", () => applyFilter(view));
	parts.which.addEventListener("change", () => applyFilter(view));
	parts.write.addEventListener("click", () => write(view));
	parts.discard.addEventListener("click", () => discard(view));
	parts.end.addEventListener("click", () => endWriting(view));
	parts.save.addEventListener("click", () => saveIntoDrive(view));
	parts.backup.addEventListener("click", () => backUp(context, drive));
	arrange(root, view);
	read(view);
	return {
		showMark() {
			const shown = context.plant.drives.get(drive);
			const status = shown && context.plant.registersOf(shown)?.get("status");

			parts.unsaved.hidden = !hasBit(status, shown?.values?.status, "params_unsaved");
		},
		close() {
			view.closed = true;
			clearTimeout(view.timer);
			view.writing?.close();
			view.beside.close();
		}
	};
}
