/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive's parameters: what they are, how they differ from another drive, a file or the vendor's
 * defaults, and changing them. Nothing is written before somebody looked at it and said so.
 */
import { call } from "./api.js";
import { element, icon, setText } from "./dom.js";
import { saveFile } from "./file_transfer.js";
import { formatTime, formatValue, hasBit, parseValue } from "./format.js";
import { FILE_MAX, readParameters, writeParameters } from "./parameter_file.js";
import {
	DEFAULTS,
	agree,
	compare,
	hasTrait,
	isKept,
	planWrites,
	takeDefaults,
	valueOf
} from "./parameter_set.js";
import { createParameterTable, writeTyped } from "./parameter_table.js";
import { writeParametersInto } from "./parameter_write.js";
import { askUser } from "./question.js";

export const title = "Parameters";

/* The service remembers what its drives hold: to ask it costs no bus anything. */
const READ_EVERY_MS = 3000;

/*
 * What somebody typed and has not written, by drive: { edits, from }; stays when another page is
 * looked at.
 */
const drafts = new Map();

let view = null;

function findFamily(context, name) {
	const drive = context.plant.drives.get(name);

	return context.plant.buses.get(drive?.bus)?.description.protocol ?? "";
}

/* The set of a drive, with `moves`; rejects in words when it is not known. */
async function readSet(context, name) {
	const known = await context.registers(name);
	const registers = [...known.values()].filter((register) => register.parameter);
	const { values, missing } = await call("Read", {
		drive: name,
		names: ["status", "identity", ...registers.map((register) => register.name)]
	});

	if (!hasBit(known.get("status"), values.status, "params_valid"))
		throw new Error(
			`the parameters of ${name} are not known now; the overview says what it ` +
				"needs"
		);
	return {
		name,
		family: findFamily(context, name),
		identity: values.identity ?? "",
		registers,
		values,
		missing,
		moves: hasBit(known.get("status"), values.status, "moving")
	};
}

function listNames(registers) {
	return registers.map((register) => register.name).join(", ");
}

function createButton(id, words, onClick, properties = {}) {
	const button = element(
		"button",
		{ id: `parameters-${id}`, type: "button", ...properties },
		words
	);

	button.addEventListener("click", onClick);
	return button;
}

/* Everything of one drive; ended by close(). */
function createView(root, context, drive) {
	const mayAct = context.mayAct();
	const draft = (mayAct && drafts.get(drive)) || { edits: new Map(), from: "" };
	const { edits } = draft;
	let held = null;
	let beside = null;
	let table = null;
	let listed = ""; /* the names in it */
	let filed = null; /* the set of a file that was opened */
	let busy = false;
	let closed = false;
	let timer = 0;
	let canSave = false;

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
		"not saved in the drive: without power it forgets them"
	);
	const search = element("input", {
		id: "parameters-search",
		type: "search",
		autocomplete: "off"
	});
	const which = element(
		"select",
		{ id: "parameters-which" },
		[
			["", "all"],
			["changed", "changed"],
			["differs", "that differ"]
		].map(([value, words]) => element("option", { value }, words))
	);
	const beneath = element("select", { id: "parameters-beside" });
	const file = element("input", {
		id: "parameters-file",
		type: "file",
		accept: ".params,text/plain",
		hidden: true
	});
	const difference = element("div", {
		id: "parameters-difference",
		class: "panel",
		hidden: true
	});
	const report = element("div", {
		id: "parameters-report",
		class: "panel",
		role: "status",
		tabindex: "-1",
		hidden: true
	});
	const count = element("span", { id: "parameters-count", class: "muted", role: "status" });
	const place = element("div", { class: "place" });
	const writeButton = createButton("write", "Write", write, {
		class: "primary",
		hidden: !mayAct
	});
	const discardButton = createButton("discard", "Discard changes", discard, {
		hidden: !mayAct
	});
	const endButton = createButton(
		"end",
		"End writing",
		() => {
			endButton.disabled = true;
		},
		{ hidden: true }
	);
	const saveButton = createButton("save", "Save into the drive", saveIntoDrive, {
		hidden: true
	});
	const backupButton = createButton("backup", "Back up into a file", backUp);
	const openButton = createButton("open", "Compare or restore a file…", () => file.click());

	drafts.set(drive, draft);

	/* --- what is shown --- */

	function applyFilter() {
		const wanted = search.value.trim().toLowerCase();
		const shown = table.filter(
			(register) =>
				`${register.name} ${register.description} ${register.unit}`
					.toLowerCase()
					.includes(wanted) &&
				(which.value !== "changed" || edits.has(register.name)) &&
				(which.value !== "differs" ||
					(beside !== null &&
						isKept(register) &&
						!agree(held, beside, register)))
		);

		setText(
			count,
			shown === held.registers.length
				? ""
				: `${shown} of ${held.registers.length}`
		);
	}

	function update() {
		if (table === null)
			return;
		table.update({ held, beside, edits, busy });
		setText(
			writeButton,
			edits.size === 1 ? "Write 1 change" : `Write ${edits.size} changes`
		);
		writeButton.disabled = discardButton.disabled = busy || edits.size === 0;
		endButton.hidden = !busy;
		openButton.disabled = backupButton.disabled = saveButton.disabled = busy;
		saveButton.hidden = !canSave || !mayAct;
	}

	function refresh() {
		update();
		applyFilter();
		showDifference();
	}

	async function read() {
		clearTimeout(timer);
		try {
			const next = await readSet(context, drive);

			if (closed)
				return;
			held = next;
			setText(problem, "");
			setText(when, `as of ${formatTime(Date.now() * 1000)}`);
			/* Another drive may have its name in a new configuration. */
			if (listNames(held.registers) !== listed) {
				listed = listNames(held.registers);
				table = createParameterTable({
					registers: held.registers,
					mayEdit: mayAct,
					onEdit: edit
				});
				place.replaceChildren(table.node);
				canSave = (await context.commands(drive)).has("save_parameters");
				fillBeside();
			}
			refresh();
		} catch (error) {
			if (closed)
				return;
			setText(problem, error.message);
			update();
		}
		if (!closed)
			timer = setTimeout(() => (busy ? null : read()), READ_EVERY_MS);
	}

	/* --- typing --- */

	function edit(register, typed) {
		const parsed = parseValue(register, typed);
		const back = hasTrait(register, "secret")
			? typed === ""
			: typed.trim() === ""
				? valueOf(held, register.name) === null
				: parsed.problem === undefined &&
					agree(
						{ values: { [register.name]: parsed.value } },
						held,
						register
					);

		if (back)
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

	/* --- beside another set --- */

	function fillBeside() {
		const others = [...context.plant.drives.keys()].filter(
			(name) => name !== drive && findFamily(context, name) === held.family
		);

		beneath.replaceChildren(
			element("option", { value: "" }, "nothing"),
			element("option", { value: "default" }, "as delivered"),
			...others.map((name) =>
				element("option", { value: `drive ${name}` }, name)
			),
			...(filed ? [element("option", { value: "file" }, filed.name)] : [])
		);
		beneath.value =
			beside === null
				? ""
				: beside === filed
					? "file"
					: beside.name === DEFAULTS
						? "default"
						: `drive ${beside.name}`;
	}

	async function chooseBeside() {
		const value = beneath.value;

		setText(problem, "");
		try {
			beside =
				value === ""
					? null
					: value === "default"
						? takeDefaults(held)
						: value === "file"
							? filed
							: await readSet(
									context,
									value.slice("drive ".length)
								);
		} catch (error) {
			beside = null;
			setText(problem, error.message);
		}
		if (closed)
			return;
		fillBeside();
		refresh();
	}

	async function openFile() {
		const [chosen] = file.files;

		if (!chosen)
			return;
		const text = chosen.size < FILE_MAX ? await chosen.text() : null;

		file.value = "";
		if (closed || held === null)
			return;
		const { set, errors } =
			text === null
				? {
						set: null,
						errors: [
							{
								line: 0,
								text: "it is too long for a file of parameters"
							}
						]
					}
				: readParameters(chosen.name, text, held);

		problem.replaceChildren(
			...errors
				.slice(0, 20)
				.map((error) =>
					element(
						"p",
						{},
						`${chosen.name}${error.line > 0 ? `:${error.line}` : ""}: ${error.text}`
					)
				)
		);
		if (errors.length > 0)
			return;
		filed = beside = set;
		fillBeside();
		refresh();
		difference.querySelector("button")?.focus();
	}

	/* What differs that can be taken over, all but where the drive is heard, and that. */
	function listDifferent() {
		const differ = compare(held, beside).filter(
			(register) => register.writable && valueOf(beside, register.name) !== null
		);

		return [
			differ.filter((register) => !hasTrait(register, "address")),
			differ.filter((register) => hasTrait(register, "address"))
		];
	}

	function takeOver(registers) {
		for (const register of registers)
			edit(register, writeTyped(register, valueOf(beside, register.name)));
		draft.from = beside.name;
		refresh();
		writeButton.focus();
	}

	function showDifference() {
		difference.hidden = beside === null || held === null;
		if (difference.hidden)
			return;
		const all = compare(held, beside);
		const [values, addresses] = listDifferent();
		const lines = [
			element(
				"p",
				{},
				all.length === 0
					? `${drive} has what ${beside.name} has.`
					: `${all.length === 1 ? "1 parameter" : `${all.length} parameters`} of ${drive} ` +
							`differ${all.length === 1 ? "s" : ""} ` +
							`from ${beside.name}.`
			)
		];
		const unknown = held.registers.filter(
			(register) => isKept(register) && valueOf(beside, register.name) === null
		);

		if (beside.name === DEFAULTS)
			lines.push(
				element(
					"p",
					{ class: "muted" },
					`Of ${unknown.length} others no default is documented.`
				)
			);
		else if (beside.identity !== held.identity)
			lines.push(
				element(
					"p",
					{ class: "need", "data-need": "2" },
					icon("warning"),
					"Another model or firmware: " +
						`${beside.name} is of “${beside.identity}”, and ` +
						`${drive} is “${held.identity}”.`
				)
			);
		if (beside === filed && unknown.length > 0)
			lines.push(
				element(
					"p",
					{ class: "muted" },
					`The file says nothing of ${listNames(unknown)}: they ` +
						"stay as they are."
				)
			);
		if (mayAct && addresses.length > 0)
			lines.push(
				element(
					"p",
					{ class: "muted" },
					`${listNames(addresses)} stays as it is unless it is ` +
						"taken, too: " +
						"it says where the drive is heard."
				)
			);
		if (mayAct)
			lines.push(
				element(
					"div",
					{ class: "toolbar" },
					values.length > 0
						? createButton(
								"take",
								`Take ${values.length} from ` +
									`${beside.name}`,
								() => takeOver(values)
							)
						: null,
					addresses.length > 0
						? createButton(
								"take-address",
								"Take " +
									`${listNames(addresses)}${values.length > 0 ? ", too" : ""}`,
								() => takeOver(addresses)
							)
						: null
				)
			);
		/* Only when it says something new: somebody may be about to press its button. */
		const next = element("div", {}, lines);

		if (difference.firstChild?.textContent !== next.textContent)
			difference.replaceChildren(next);
	}

	async function backUp() {
		try {
			const set = await readSet(context, drive);
			const untold = set.registers.filter(
				(register) =>
					isKept(register) &&
					valueOf(set, register.name) === null &&
					!set.missing.includes(register.name)
			);

			saveFile(`${drive}.params`, [writeParameters(set)]);
			if (untold.length > 0)
				context.notify(
					`${drive} does not have or tell ${listNames(untold)}`
				);
			if (set.missing.length > 0)
				context.notify(
					`${drive} should have told ${set.missing.join(", ")}, ` +
						"and did not",
					"warning"
				);
		} catch (error) {
			context.report(error);
		}
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
		/*
		 * They change how a motion goes on, and some drives take or tell them only while
		 * they stand.
		 */
		if (draft.from && (await readSet(context, drive)).moves) {
			context.notify(`${drive} moves; stop it first`, "error");
			return false;
		}
		return (
			addresses.length === 0 ||
			askUser({
				title: `Where ${drive} is heard`,
				yes: "Write",
				words: [
					`${listNames(addresses)} says where the drive is heard. ` +
						"When it goes by that, it is offline here until " +
						"the " +
						"configuration says the same.",
					"It is written last. Scan has a way that looks first " +
						"and afterwards."
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

	async function carryOut() {
		const before = { ...held, values: { ...held.values } };
		const wanted = Object.fromEntries(
			[...edits].map(([name, { value }]) => [name, value])
		);
		const plan = planWrites(held.registers, new Set(edits.keys()));
		const { written, failed, over } = await writeParametersInto(drive, plan, wanted, {
			call,
			isEnded: () => closed || endButton.disabled,
			report(register, state, text, value) {
				if (value !== undefined)
					held.values[register.name] = value;
				table.showResult(register.name, state, text);
			}
		});

		written.forEach((name) => edits.delete(name));
		const after = await readSet(context, drive).catch(() => null);
		const others = [];

		/*
		 * A value that was written may have been changed by one behind it, or change
		 * others.
		 */
		for (const register of after?.registers ?? []) {
			const shows = `the drive shows ${Object.values(
				formatValue(register, valueOf(after, register.name))
			)
				.join(" ")
				.trim()} now`;

			if (!isKept(register))
				continue;
			if (
				written.includes(register.name) &&
				!agree(after, { values: wanted }, register)
			) {
				failed.set(register.name, shows);
				table.showResult(register.name, "failed", shows);
			} else if (!(register.name in wanted) && !agree(after, before, register)) {
				others.push(`${register.name}: ${shows}`);
			}
		}
		showReport(
			written.filter((name) => !failed.has(name)).length,
			failed,
			over,
			others
		);
	}

	function showReport(written, failed, over, others) {
		const left = failed.size;

		report.replaceChildren(
			element(
				"h2",
				{},
				`${drive}: ${written} written${left > 0 ? `, ${left} not` : ""}`
			),
			over
				? element(
						"p",
						{},
						`It came to an end: ${over}. What is left ` +
							"stands in the table: Write goes on " +
							"with it."
					)
				: "",
			element(
				"ul",
				{},
				[...failed].map(([name, reason]) =>
					element("li", { class: "problem" }, `${name}: ${reason}`)
				),
				others.map((text) =>
					element("li", {}, `changed with them: ${text}`)
				)
			),
			element(
				"p",
				{ class: "muted" },
				written === 0
					? ""
					: canSave
						? "Not saved in the drive yet: Save into the " +
							"drive does that."
						: `${drive} has no save_parameters: what is ` +
							"written is all there is."
			)
		);
		report.hidden = false;
		report.focus();
		context.notify(
			`${drive}: ${written} written${left > 0 ? `, ${left} not` : ""}`,
			left > 0 ? "error" : "ok"
		);
	}

	async function saveIntoDrive() {
		saveButton.disabled = true;
		try {
			const { result } = await call("Run", {
				drive,
				command: "save_parameters",
				until_end: true
			});

			context.notify(`${drive}: save_parameters: ${result}`, "ok");
			report.hidden = true;
		} catch (error) {
			context.notify(`${drive}: save_parameters: ${error.message}`, "error");
		}
		saveButton.disabled = false;
	}

	search.addEventListener("input", applyFilter);
	which.addEventListener("change", applyFilter);
	beneath.addEventListener("change", chooseBeside);
	file.addEventListener("change", openFile);
	root.append(
		element(
			"div",
			{ class: "panel toolbar filters" },
			element(
				"label",
				{ class: "field", for: "parameters-search" },
				"Search",
				search
			),
			element(
				"label",
				{ class: "field", for: "parameters-which" },
				"Show",
				which
			),
			element(
				"label",
				{ class: "field", for: "parameters-beside" },
				"Beside",
				beneath
			),
			openButton,
			file,
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
						"To change them needs the role operator."
					)
		),
		problem,
		difference,
		report,
		place
	);
	read();
	return {
		showMark() {
			const status = context.plant
				.registersOf(context.plant.drives.get(drive) ?? {})
				?.get("status");

			unsaved.hidden = !hasBit(
				status,
				context.plant.drives.get(drive)?.values?.status,
				"params_unsaved"
			);
		},
		close() {
			closed = true;
			clearTimeout(timer);
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
			element("h1", {}, "Parameters"),
			element(
				"label",
				{ class: "field inline", for: "parameters-drive" },
				"Drive",
				select
			)
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
