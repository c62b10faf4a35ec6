/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive's parameters: their meaning, how they differ from other sets, and changing them. Nothing
 * is written before the user has reviewed and confirmed it.
 */
import { ask, call, openStream } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { saveFile } from "./file_transfer.js";
import { formatAge, formatTime, formatWithUnit, hasBit, parseValue } from "./format.js";
import { createBeside, listNames, readSet } from "./parameter_beside.js";
import { agree, hasTrait, isKept, valueOf } from "./parameter_set.js";
import { createParameterTable, writeTyped } from "./parameter_table.js";
import { askUser } from "./question.js";
import { inLanguage, plural, t } from "./words.js";

export const title = t("Parameters");

/* The service stores its drives' values: reading them causes no traffic on the bus. */
const READ_EVERY_MS = 3000;
/* Values in a file that are older are mentioned. */
const OLD_MS = 10000;

/* Typed and unwritten values, by drive: { edits, from }; kept when another page is shown. */
const drafts = new Map();

let view = null;

function createButton(id, words, onClick, properties = {}) {
	const button = element(
		"button",
		{ id: `parameters-${id}`, type: "button", ...properties },
		words
	);

	button.addEventListener("click", onClick);
	return button;
}

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

/* --- results of writing --- */

/*
 * A written value may have been changed by a later one, or may change others. Adds the first kind
 * to `failed`, a Map of name to reason, and returns the others in words.
 */
function compareAfter({ before, after, wanted, written, failed }) {
	const others = [];

	for (const register of after.registers.filter(isKept)) {
		const shows = t("the drive shows {register} now", { register: formatWithUnit(register, valueOf(after, register.name)) });

		if (written.includes(register.name) && !agree(after, { values: wanted }, register))
			failed.set(register.name, shows);
		else if (!(register.name in wanted) && !agree(after, before, register))
			others.push(`${register.name}: ${shows}`);
	}
	return others;
}

function createReport({ drive, canSave, written, failed, over, others }) {
	const count = written.filter((name) => !failed.has(name)).length;
	const words = failed.size > 0 ?
		t("{drive}: {count} written, {failed} not", { drive, count, failed: failed.size }) :
		t("{drive}: {count} written", { drive, count });
	const next = canSave
		? t("Not saved in the drive yet: Save into the drive does that.")
		: t("{drive} has no save_parameters: what is written is all there is.", { drive });

	return {
		words,
		node: element(
			"div",
			{},
			element("h2", {}, words),
			over
				? element(
						"p",
						{},
						t("It came to an end: {over}. What is left stands in the table: Write goes on with it.", { over })
					)
				: null,
			element(
				"ul",
				{},
				[...failed].map(([name, reason]) =>
					element("li", { class: "problem" }, `${name}: ${reason}`)
				),
				others.map((text) =>
					element("li", {}, t("changed with them: {text}", { text }))
				)
			),
			count > 0 ? element("p", { class: "muted" }, next) : null
		)
	};
}

/*
 * Has parameters written, one after the other: report({ name, state, text, value }) is called for
 * each. standing: only while the drive stands. Returns { result, close() }: a promise of { written,
 * failed, over }, which is rejected when nothing can be said; close() gives up.
 */
function writeInto(drive, values, standing, report) {
	let settle = null;
	const result = new Promise((resolve, reject) => {
		settle = { resolve, reject };
	});
	let told = null;
	const stream = openStream(
		"parameters",
		{ drive, values, standing },
		{
			once: true,
			onEvent(name, data) {
				if (name === "parameter")
					report(data);
				else if (name === "result")
					told = data;
			},
			onState(state, error) {
				if (state === "ended")
					settle.resolve({
						...told,
						failed: new Map(Object.entries(told.failed))
					});
				else if (state === "failed")
					settle.reject(error);
			}
		}
	);

	return { result, close: stream.close };
}

/* --- one drive --- */

/* Shown in root until close(). */
function createView(root, context, drive) {
	const why = context.whyNot("engineer", drive);
	const mayAct = why === "";
	const draft = (mayAct && drafts.get(drive)) || { edits: new Map(), from: "" };
	const { edits } = draft;
	const beside = createBeside({ context, drive, onChange: refresh, takeOver });
	const when = element("span", { id: "parameters-when", class: "muted" });
	const problem = element("div", {
		id: "parameters-problem",
		class: "problem",
		role: "alert"
	});
	const unsaved = element(
		"span",
		{ id: "parameters-unsaved", class: "badge warning", hidden: true },
		icon("warning"),
		t("not saved in the drive: lost at power-off")
	);
	const search = element("input", {
		id: "parameters-search",
		type: "search",
		autocomplete: "off"
	});
	const choices = [
		["", t("all")],
		["changed", t("changed")],
		["differs", t("that differ")]
	];
	const which = element(
		"select",
		{ id: "parameters-which" },
		choices.map(([value, words]) => element("option", { value }, words))
	);
	const report = element("div", {
		id: "parameters-report",
		class: "panel",
		role: "status",
		tabindex: "-1",
		hidden: true
	});
	const count = element("span", { id: "parameters-count", class: "muted", role: "status" });
	const place = element("div", { class: "place" });
	const writeButton = createButton("write", t("Write"), write, {
		class: "primary",
		hidden: !mayAct
	});
	const discardButton = createButton("discard", t("Discard changes"), discard, {
		hidden: !mayAct
	});
	const endButton = createButton("end", t("End writing"), endWriting, { hidden: true });
	const saveButton = createButton("save", t("Save into the drive"), saveIntoDrive, {
		hidden: true
	});
	const backupButton = createButton("backup", t("Back up into a file"), () =>
		backUp(context, drive)
	);
	let held = null;
	let table = null;
	let listed = ""; /* the names in it */
	let busy = false;
	let closed = false;
	let timer = 0;
	let canSave = false;
	let writing = null;

	drafts.set(drive, draft);

	/* --- display --- */

	function applyFilter() {
		const wanted = search.value.trim().toLowerCase();
		const other = beside.set();
		const shown = table.filter(
			(register) =>
				`${register.name} ${register.description} ${inLanguage(register.description)} ${register.unit}`
					.toLowerCase()
					.includes(wanted) &&
				(which.value !== "changed" || edits.has(register.name)) &&
				(which.value !== "differs" ||
					(other !== null &&
						isKept(register) &&
						!agree(held, other, register)))
		);

		setText(
			count,
			shown === held.registers.length
				? ""
				: t("{shown} of {count}", { shown, count: held.registers.length })
		);
	}

	function update() {
		if (table === null)
			return;
		table.update({ held, beside: beside.set(), edits, busy });
		setText(
			writeButton,
			plural(edits.size, "Write 1 change", "Write {count} changes", { count: edits.size })
		);
		writeButton.disabled = discardButton.disabled = busy || edits.size === 0;
		endButton.hidden = !busy;
		backupButton.disabled = saveButton.disabled = busy;
		saveButton.hidden = !canSave || !mayAct;
	}

	function refresh() {
		update();
		beside.update(held);
		applyFilter();
	}

	/* Another drive may have the name in a new configuration. */
	async function renewTable() {
		if (listNames(held.registers) === listed)
			return;
		listed = listNames(held.registers);
		table = createParameterTable({
			registers: held.registers,
			mayEdit: mayAct,
			onEdit: edit
		});
		place.replaceChildren(table.node);
		canSave = (await context.commands(drive)).has("save_parameters");
	}

	async function read() {
		clearTimeout(timer);
		try {
			held = await readSet(context, drive);
			if (closed)
				return;
			setText(problem, "");
			setText(when, t("as of {formatTime}", { formatTime: formatTime(Date.now() * 1000) }));
			await renewTable();
			refresh();
		} catch (error) {
			setText(problem, error.message);
			update();
		}
		if (!closed)
			timer = setTimeout(() => (busy ? null : read()), READ_EVERY_MS);
	}

	/* --- typing --- */

	/* True if it equals the drive's value. */
	function isHeld(register, typed, parsed) {
		if (hasTrait(register, "secret"))
			return typed === "";
		if (typed.trim() === "")
			return valueOf(held, register.name) === null;
		return (
			parsed.problem === undefined &&
			agree({ values: { [register.name]: parsed.value } }, held, register)
		);
	}

	function edit(register, typed) {
		const parsed = parseValue(register, typed);

		if (isHeld(register, typed, parsed))
			edits.delete(register.name);
		else
			edits.set(register.name, { typed, ...parsed });
		if (edits.size === 0)
			draft.from = "";
		table.showResult(register.name, "", "");
		update();
	}

	function discard() {
		edits.clear();
		draft.from = "";
		refresh();
	}

	function takeOver(registers, from) {
		for (const register of registers)
			edit(register, writeTyped(register, valueOf(from, register.name)));
		draft.from = from.name;
		refresh();
		writeButton.focus();
	}

	/* --- writing --- */

	async function mayWrite() {
		const wrong = [...edits].find(([, { problem: said }]) => said !== undefined);
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

	async function write() {
		if (busy)
			return;
		busy = true;
		try {
			if (await mayWrite()) {
				endButton.disabled = false;
				update();
				await carryOut();
			}
		} catch (error) {
			context.report(error);
		}
		busy = false;
		if (!closed)
			await read();
	}

	function endWriting() {
		endButton.disabled = true;
		ask("POST", "parameters/end", { drive }, { named: true }).catch(context.report);
	}

	async function carryOut() {
		const before = { ...held, values: { ...held.values } };
		const wanted = Object.fromEntries(
			[...edits].map(([name, { value }]) => [name, value])
		);
		/* They change a running motion, and some drives accept or report them only at
		 * standstill. */
		writing = writeInto(drive, wanted, Boolean(draft.from), (told) => {
			if (told.value !== undefined)
				held.values[told.name] = told.value;
			if (told.state === "done")
				edits.delete(told.name);
			table.showResult(told.name, told.state, told.text);
		});
		const { written, failed, over } = await writing.result;

		const after = await readSet(context, drive).catch(() => before);
		const others =
			after === before
				? []
				: compareAfter({ before, after, wanted, written, failed });
		const { words, node } = createReport({
			drive,
			canSave,
			written,
			failed,
			over,
			others
		});

		written.filter((name) => failed.has(name)).forEach((name) =>
			table.showResult(name, "failed", failed.get(name))
		);
		report.replaceChildren(node);
		report.hidden = false;
		report.focus();
		context.notify(words, failed.size > 0 ? "error" : "ok");
	}

	async function saveIntoDrive() {
		saveButton.disabled = true;
		try {
			const { result } = await call("Run", {
				drive,
				command: "save_parameters",
				until_end: true
			});

			context.notify(t("{drive}: save_parameters: {result}", { drive, result }), "ok");
			report.hidden = true;
		} catch (error) {
			context.notify(t("{drive}: save_parameters: {message}", { drive, message: error.message }), "error");
		}
		saveButton.disabled = false;
	}

	search.addEventListener("input", applyFilter);
	which.addEventListener("change", applyFilter);
	root.append(
		element(
			"div",
			{ class: "panel toolbar filters" },
			createField(t("Search"), search),
			createField(t("Show"), which),
			beside.fields,
			backupButton,
			count,
			when
		),
		element(
			"div",
			{ class: "toolbar" },
			writeButton,
			discardButton,
			endButton,
			saveButton,
			unsaved,
			mayAct
				? null
				: element(
						"span",
						{ class: "muted" },
						why
					)
		),
		problem,
		beside.node,
		report,
		place
	);
	read();
	return {
		showMark() {
			const shown = context.plant.drives.get(drive);
			const status = shown && context.plant.registersOf(shown)?.get("status");

			unsaved.hidden = !hasBit(status, shown?.values?.status, "params_unsaved");
		},
		close() {
			closed = true;
			clearTimeout(timer);
			writing?.close();
			beside.close();
		}
	};
}

export function show(root, context, name) {
	const select = element("select", { id: "parameters-drive" });
	const place = element("div", { class: "view-part" });

	function open() {
		view?.close();
		view = null;
		place.replaceChildren();
		if (select.value)
			view = createView(place, context, select.value);
	}

	function fill() {
		const names = [...context.plant.drives.keys()];
		const before = select.value;

		select.replaceChildren(
			...names.map((one) => element("option", { value: one }, one))
		);
		if (names.includes(before || name))
			select.value = before || name;
		if (select.value !== before)
			open();
	}

	select.addEventListener("change", () => {
		history.replaceState(null, "", `#/parameters/${encodeURIComponent(select.value)}`);
		open();
	});
	root.append(
		element(
			"div",
			{ class: "view-head" },
			element("h1", {}, t("Parameters")),
			createField(t("Drive"), select, "inline")
		),
		place
	);
	context.on("describe", fill);
	context.on("plant", () => view?.showMark());
	fill();
}

export function hide() {
	view?.close();
	view = null;
}
