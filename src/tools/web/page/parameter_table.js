/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The table of a drive's parameters: their meaning, the drive's values, the typed values, and the
 * results of writing.
 */
import { element, newId, setAttribute, setText } from "./dom.js";
import { formatRange, formatValue, formatWithUnit, hasBits, inWords } from "./format.js";
import { GROUP_NAMES, groupOf, readChoices } from "./parameter_groups.js";
import { agree, hasTrait, isKept, valueOf } from "./parameter_set.js";
import { inLanguage, t } from "./words.js";

/* A value in the form for typing. */
export function writeTyped(register, value) {
	if (value === null)
		return "";
	return formatValue(register, value).text.replace("−", "-");
}

/* Why a parameter cannot be changed here; "" when it can. */
function explainFixed(register) {
	if (hasTrait(register, "action"))
		return t("makes the drive do something, and is not for a table");
	if (hasTrait(register, "derived"))
		return t("follows from others");
	return register.writable ? "" : t("can only be read");
}

/* Choices in words, with the numbers that the drive's documents have. */
function createChoice(register, about, choices) {
	const select = element(
		"select",
		{
			id: `parameter-${register.name}`,
			"aria-label": register.name,
			"aria-describedby": about
		},
		element("option", { value: "" }, t("not told")),
		choices.map(([number, words]) =>
			element(
				"option",
				{ value: writeTyped(register, number) },
				`${words} (${number})`
			)
		)
	);

	return [select, null];
}

/* A value that no choice has: the drive may hold one. */
function offer(select, typed) {
	if (![...select.options].some((option) => option.value === typed))
		select.append(element("option", { value: typed }, typed));
}

function createInput(register, about) {
	const choices = hasTrait(register, "secret") ? null : readChoices(register);

	if (choices !== null)
		return createChoice(register, about, choices);
	const secret = hasTrait(register, "secret");
	const names = hasBits(register) ? [] : Object.values(register.codes ?? {});
	const list =
		names.length > 0
			? element(
					"datalist",
					{ id: newId("codes") },
					names.map((name) =>
						element("option", { value: inWords(name) })
					)
				)
			: null;
	const input = element("input", {
		id: `parameter-${register.name}`,
		type: secret ? "password" : "text",
		inputmode: names.length > 0 || hasBits(register) || secret ? null : "decimal",
		list: list?.id,
		autocomplete: secret ? "new-password" : "off",
		spellcheck: "false",
		"aria-label": register.name,
		"aria-describedby": about,
		placeholder: secret ? t("cannot be read") : t("not told")
	});

	return [input, list];
}

/*
 * registers: the parameters; onEdit(register, typed). Returns { node, update({ held, beside, edits,
 * busy }), showResult(name, state, text), filter(matches), focus(name) }: held and beside are sets
 * (beside may be null), edits a Map of name to { typed, problem }, matches a function of a
 * register.
 */
export function createParameterTable({ registers, mayEdit, onEdit }) {
	const besideHead = element("th", { scope: "col", class: "number beside" });
	const groups = createGroups();
	const node = element(
		"div",
		{ class: "panel table-frame" },
		element(
			"table",
			{ id: "parameters-table" },
			element("caption", { class: "hidden-label" }, t("Parameters")),
			element(
				"thead",
				{},
				element(
					"tr",
					{},
					element("th", { scope: "col" }, t("Name")),
					element("th", { scope: "col" }, t("Value")),
					element("th", { scope: "col", class: "wide" }, t("Range")),
					element(
						"th",
						{ scope: "col", class: "number wide" },
						t("Default")
					),
					besideHead,
					element("th", { scope: "col" }, t("Written"))
				)
			),
			[...groups.values()].map(({ body }) => body)
		)
	);
	const rows = new Map(registers.map((register) => [register.name, createRow(register)]));

	/* By name; only those that have parameters. */
	function createGroups() {
		const used = new Set(registers.map(groupOf));

		return new Map(
			GROUP_NAMES.filter((name) => used.has(name)).map((name) => [
				name,
				{
					body: element(
						"tbody",
						{ "data-group": name },
						element(
							"tr",
							{ class: "group" },
							element(
								"th",
								{ scope: "rowgroup", colspan: 6 },
								name
							)
						)
					),
					members: []
				}
			])
		);
	}

	function createRow(register) {
		const about = newId("about");
		const fixed = mayEdit ? explainFixed(register) : "";
		const [input, list] =
			mayEdit && !fixed ? createInput(register, about) : [null, null];
		const value = element("span", { class: "value" });
		const note = element("small", { class: "note" }, fixed);
		const beside = element("td", { class: "number beside" });
		const result = element("td", { class: "result" });
		const range = formatRange(register);
		const preset =
			typeof register.default === "number"
				? formatValue(register, register.default).text
				: "";
		const row = element(
			"tr",
			{ "data-name": register.name },
			element(
				"th",
				{ scope: "row" },
				element("code", {}, register.name),
				element(
					"small",
					{ id: about, class: "muted" },
					inLanguage(register.description),
					element(
						"span",
						{ class: "narrow" },
						range && `; ${range}`,
						preset && t("; as delivered {preset}", { preset })
					)
				)
			),
			element(
				"td",
				{},
				element(
					"div",
					{ class: "with-unit" },
					input ?? value,
					list,
					input
						? element("span", { class: "unit" }, register.unit)
						: null
				),
				note
			),
			element("td", { class: "wide muted" }, range),
			element("td", { class: "number wide" }, preset),
			beside,
			result
		);

		input?.addEventListener("input", () => onEdit(register, input.value));
		const { body, members } = groups.get(groupOf(register));

		body.append(row);
		members.push(row);
		return { register, row, input, value, note, fixed, beside, result };
	}

	function updateRow({ register, row, input, value, note, fixed, beside }, state) {
		const held = valueOf(state.held, register.name);
		const edit = state.edits.get(register.name);
		const typed =
			edit?.typed ??
			(hasTrait(register, "secret") ? "" : writeTyped(register, held));

		row.classList.toggle("changed", edit !== undefined);
		setText(
			note,
			edit?.problem ??
				(edit
					? hasTrait(register, "secret")
						? t("changed")
						: t("changed, was {register}", { register: formatWithUnit(register, held) })
					: fixed)
		);
		note.classList.toggle("problem", edit?.problem !== undefined);
		if (input) {
			setAttribute(input, "aria-invalid", String(edit?.problem !== undefined));
			input.disabled = state.busy;
			if (input.value !== typed && (edit || document.activeElement !== input)) {
				if (input.tagName === "SELECT")
					offer(input, typed);
				input.value = typed;
			}
		} else {
			setText(
				value,
				hasTrait(register, "secret") || hasTrait(register, "action")
					? ""
					: formatWithUnit(register, held)
			);
		}
		const compared = state.beside !== null && isKept(register);
		const differs = compared && !agree(state.held, state.beside, register);

		setText(
			beside,
			compared
				? formatWithUnit(register, valueOf(state.beside, register.name))
				: ""
		);
		beside.classList.toggle("differs", differs);
	}

	function update(state) {
		setText(besideHead, state.beside?.name ?? "");
		node.classList.toggle("compares", state.beside !== null);
		for (const row of rows.values())
			updateRow(row, state);
	}

	function showResult(name, state, text) {
		const { result } = rows.get(name);

		result.dataset.state = state;
		setText(result, state === "writing" ? t("writing") : text);
	}

	function filter(matches) {
		let shown = 0;

		for (const { register, row } of rows.values()) {
			row.hidden = !matches(register);
			shown += row.hidden ? 0 : 1;
		}
		for (const { body, members } of groups.values())
			body.hidden = members.every((row) => row.hidden);
		return shown;
	}

	function focus(name) {
		const { row, input } = rows.get(name);

		row.hidden = false;
		row.parentNode.hidden = false;
		input?.focus();
	}

	return { node, update, showResult, filter, focus };
}
