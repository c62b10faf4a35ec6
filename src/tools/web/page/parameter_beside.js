/* SPDX-License-Identifier: Apache-2.0 */
/* Compares a drive's parameters with another drive, a file, or the vendor's delivery state. */
import { ask, call } from "./api.js";
import { createField, element, icon, setText } from "./dom.js";
import { takeHanded } from "./file_transfer.js";
import { hasBit } from "./format.js";
import { DEFAULTS, compare, hasTrait, isKept, takeDefaults, valueOf } from "./parameter_set.js";
import { plural, t } from "./words.js";

const ERRORS_MOST = 20;
const FILE_MAX = 40000; /* bytes */

export function listNames(registers) {
	return registers.map((register) => register.name).join(", ");
}

function findFamily(context, name) {
	const drive = context.plant.drives.get(name);

	return context.plant.buses.get(drive?.bus)?.description.protocol ?? "";
}

/* The set of a drive; rejects with a text when it is unknown. */
export async function readSet(context, name) {
	const known = await context.registers(name);
	const registers = [...known.values()].filter((register) => register.parameter);
	const { values, missing } = await call("Read", {
		drive: name,
		names: ["status", "identity", ...registers.map((register) => register.name)]
	});

	if (!hasBit(known.get("status"), values.status, "params_valid"))
		throw new Error(
			t("the parameters of {name} are not known now; the overview says what it needs", { name })
		);
	return {
		name,
		family: findFamily(context, name),
		identity: values.identity ?? "",
		registers,
		values,
		missing
	};
}

function createWords(words, properties = {}) {
	return element("p", properties, words);
}

/* In words, for one drive's set and another one. */
function describeDifference(held, beside) {
	const differ = compare(held, beside);
	const unknown = held.registers.filter(
		(register) => isKept(register) && valueOf(beside, register.name) === null
	);
	const lines = [
		createWords(
			differ.length === 0
				? t("{name} has what {other} has.", { name: held.name, other: beside.name })
				: plural(differ.length, "1 parameter of {name} differs from {other}.",
					"{count} parameters of {name} differ from {other}.",
					{ count: differ.length, name: held.name, other: beside.name })
		)
	];

	if (beside.name === DEFAULTS)
		lines.push(
			createWords(t("Of {count} others no default is documented.", { count: unknown.length }), {
				class: "muted"
			})
		);
	else if (beside.identity !== held.identity)
		lines.push(
			element(
				"p",
				{ class: "need", "data-need": "2" },
				icon("warning"),
				t("Another model or firmware: {name} is of “{identity}”, and {other} is “{otherIdentity}”.", { name: beside.name, identity: beside.identity, other: held.name, otherIdentity: held.identity })
			)
		);
	if (beside.isFile && unknown.length > 0)
		lines.push(
			createWords(
				t("The file says nothing of {unknown}: they stay as they are.", { unknown: listNames(unknown) }),
				{ class: "muted" }
			)
		);
	return lines;
}

/*
 * For one drive. onChange() is called when another set is chosen for comparison,
 * takeOver(registers, beside) when the user wants its values. Returns { fields, node, set(),
 * update(held), close() }: set() is the compared set, or null; update() gets the drive's values.
 */
export function createBeside({ context, drive, onChange, takeOver }) {
	const select = element("select", { id: "parameters-beside" });
	const file = element("input", {
		id: "parameters-file",
		type: "file",
		accept: ".params,text/plain",
		hidden: true
	});
	const open = element(
		"button",
		{ id: "parameters-open", type: "button" },
		t("Compare or restore a file…")
	);
	const problem = element("div", {
		id: "parameters-file-problem",
		class: "problem",
		role: "alert"
	});
	const difference = element("div", {
		id: "parameters-difference",
		class: "panel",
		hidden: true
	});
	let held = null;
	let beside = null;
	let filed = null; /* the set of an opened file */
	let listed = "";
	let closed = false;

	function fill() {
		const others = [...context.plant.drives.keys()].filter(
			(name) => name !== drive && findFamily(context, name) === held.family
		);
		const choices = [
			["", t("nothing")],
			[DEFAULTS, t("as delivered")],
			...others.map((name) => [`drive ${name}`, name]),
			...(filed ? [["file", filed.name]] : [])
		];

		/* An opened list of choices stays unchanged. */
		if (JSON.stringify(choices) !== listed)
			select.replaceChildren(
				...choices.map(([value, words]) =>
					element("option", { value }, words)
				)
			);
		listed = JSON.stringify(choices);
		if (beside === null)
			select.value = "";
		else if (beside === filed)
			select.value = "file";
		else
			select.value = beside.name === DEFAULTS ? DEFAULTS : `drive ${beside.name}`;
	}

	async function readChosen(value) {
		if (value === "file")
			return filed;
		if (value === DEFAULTS)
			return takeDefaults(held);
		return value === "" ? null : readSet(context, value.slice("drive ".length));
	}

	async function choose() {
		setText(problem, "");
		try {
			beside = await readChosen(select.value);
		} catch (error) {
			beside = null;
			setText(problem, error.message);
		}
		if (!closed)
			onChange();
	}

	/* The server reads it as drivebridgectl does. */
	async function readFile(chosen) {
		if (chosen.size > FILE_MAX)
			throw new Error(t("{name}: it is too long for a file of parameters", { name: chosen.name }));
		const text = await chosen.text();

		if (text.includes("\0"))
			throw new Error(t("{name}: this is no text, and no file of parameters", { name: chosen.name }));
		return ask("POST", "parameters/read", {
			drive,
			name: chosen.name.slice(0, 100),
			text
		});
	}

	async function openFile(chosen) {
		let mistakes = [];

		if (!chosen)
			return;
		try {
			const set = await readFile(chosen);

			if (closed || held === null)
				return;
			filed = beside = { ...held, missing: [], ...set, isFile: true };
		} catch (error) {
			mistakes = error.message.trim().split("\n").slice(0, ERRORS_MOST);
		}
		file.value = "";
		problem.replaceChildren(...mistakes.map((words) => createWords(words)));
		if (mistakes.length > 0)
			return;
		onChange();
		difference.querySelector("button")?.focus();
	}

	/* null: there is nothing to take. */
	function createTake(id, words, registers) {
		const button = element("button", { id: `parameters-${id}`, type: "button" }, words);

		button.addEventListener("click", () => takeOver(registers, beside));
		return registers.length > 0 ? button : null;
	}

	function show() {
		difference.hidden = beside === null;
		if (beside === null)
			return;
		const takable = compare(held, beside).filter(
			(register) =>
				register.writable &&
				valueOf(beside, register.name) !== null &&
				!hasTrait(register, "state")
		);
		const values = takable.filter((register) => !hasTrait(register, "address"));
		const addresses = takable.filter((register) => hasTrait(register, "address"));
		const next = element("div", {}, describeDifference(held, beside));

		if (context.may("engineer", drive) && addresses.length > 0)
			next.append(
				createWords(
					t("{addresses} stays as it is unless it is taken, too: it says where the drive is heard.", { addresses: listNames(addresses) }),
					{ class: "muted" }
				)
			);
		if (context.may("engineer", drive))
			next.append(
				element(
					"div",
					{ class: "toolbar" },
					createTake(
						"take",
						t("Take {count} from {name}", { count: values.length, name: beside.name }),
						values
					),
					createTake(
						"take-address",
						values.length > 0 ? t("Take {addresses}, too", { addresses: listNames(addresses) }) :
							t("Take {addresses}", { addresses: listNames(addresses) }),
						addresses
					)
				)
			);
		/* Only when it has changed: the user may be about to press its button. */
		if (difference.firstChild?.textContent !== next.textContent)
			difference.replaceChildren(next);
	}

	select.addEventListener("change", choose);
	file.addEventListener("change", () => openFile(file.files[0]));
	open.addEventListener("click", () => file.click());
	return {
		fields: [createField(t("Beside"), select), open, file],
		node: element("div", { class: "view-part" }, problem, difference),
		set: () => beside,
		update(next) {
			held = next;
			fill();
			show();
			openFile(takeHanded(drive));
		},
		close() {
			closed = true;
		}
	};
}
