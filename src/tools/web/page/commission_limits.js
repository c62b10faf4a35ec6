/* SPDX-License-Identifier: Apache-2.0 */
/* Limits that are set by driving to them: jog to an end, and take its position as min- or max-position. */
import { call } from "./api.js";
import { createKeys } from "./commission_keys.js";
import { listWanted, wantKey } from "./commission_record.js";
import { element, setText } from "./dom.js";
import { codeName, formatReal } from "./format.js";
import { createJog } from "./jog.js";
import { createLimitBar } from "./limit_bar.js";
import { t } from "./words.js";

const ENDS = [
	{ key: "min-position", of: "min_position", id: "limit-min", words: t("Take this position as min-position") },
	{ key: "max-position", of: "max_position", id: "limit-max", words: t("Take this position as max-position") },
];

/* As few decimals as a position of this drive needs. Pure. */
export function roundPosition(position, step) {
	for (let decimals = 0; step > 0 && decimals < 9; decimals++) {
		const rounded = Number(position.toFixed(decimals));

		if (Math.abs(rounded - position) < step / 2)
			return rounded;
	}
	return position;
}

/* path: see commission.js. */
export function createLimits(path) {
	const { commands, context, name, registers, scale, record } = path;
	const description = path.drive()?.description ?? {};
	const unit = description.unit_name || "counts";
	const enable = () => call("Run", { drive: name, command: "enable" }).catch(context.report);
	const jog = commands.has("move_velocity") && registers.has("target_velocity") ?
		createJog({ context, drive: name, registers, commands, scale, preset: path.preset, onMoved() {},
			onEnable: enable }) : null;
	const keys = createKeys(path, ENDS.map(({ key }) => key));
	const problem = element("p", { class: "problem", role: "alert" });
	const bar = createLimitBar(description);
	const rows = ENDS.map((end) => ({ ...end, today: description[end.of], taken: element("strong"),
		button: element("button", { id: end.id, type: "button", onclick: () => take(end) }, end.words) }));

	const valueOf = (key) => record.keys.find((one) => one.kind === "drive" && one.key === key && one.at === 0)?.value;

	/* What the drive tells now, of the moment of the press. */
	async function take({ key }) {
		const [other] = rows.filter((one) => one.key !== key);

		setText(problem, "");
		try {
			const { values } = await call("Read", { drive: name, names: ["axis_state", "position", "position_units"] });
			const state = codeName(registers.get("axis_state"), values.axis_state);
			const there = values.position_units ?? values.position;
			const beside = Number(valueOf(other.key) ?? other.today ?? NaN);

			if (!["Standstill", "Disabled"].includes(state) || typeof there !== "number")
				throw new Error(t("It has to stand for that"));
			const value = roundPosition(there, scale.step(registers.get("position")) || 1e-6);

			if (key === "min-position" ? value >= beside : value <= beside)
				throw new Error(t("min-position has to be below max-position: drive to the other end, or take that one first"));
			wantKey(record, { kind: "drive", name, key, value: String(value) });
			finish();
		} catch (error) {
			setText(problem, error.message);
		}
	}

	function finish() {
		const [min, max] = rows.map(({ key, today }) => valueOf(key) ?? today);

		path.keep();
		if (min !== undefined && max !== undefined)
			path.mark("limits", "done", { min: Number(min), max: Number(max), unit });
		show();
	}

	function show() {
		for (const { key, taken, today } of rows) {
			const value = valueOf(key);

			if (value !== undefined)
				setText(taken, t("{value}, taken", { value: `${formatReal(Number(value))} ${unit}` }));
			else
				setText(taken, typeof today === "number" ?
					t("{value} in the configuration", { value: `${formatReal(today)} ${unit}` }) : t("none"));
		}
		keys.update();
	}

	show();
	return {
		node: element("div", { class: "drive-grid" },
			element("div", { class: "drive-main" },
				element("section", { id: "limits", class: "panel", "aria-label": t("Limits") },
					element("p", {}, t("Drive to each end of the way, and take its position. The limits of the configuration hold meanwhile: to go beyond them, widen them in the configuration first.")),
					bar?.node ?? null,
					element("dl", { class: "values" }, rows.map(({ key, taken }) =>
						element("div", {}, element("dt", {}, key), element("dd", {}, taken)))),
					element("div", { class: "toolbar" }, rows.map(({ button }) => button)),
					listWanted(record, ["counts-per-unit"]).length > 0 ?
						element("p", { class: "problem" }, t("Write counts-per-unit into the configuration first: positions are in other units then.")) : null,
					problem), keys.node),
			element("div", { class: "drive-side" }, jog?.node ?? null)),
		release: () => jog?.release(),
		close: () => jog?.release(),
		update({ judgement, values, old }) {
			jog?.update({ judgement, old });
			bar?.show(values);
			for (const { button } of rows)
				button.disabled = Boolean(old) || !["Standstill", "Disabled"].includes(judgement.state);
		},
	};
}
