/* SPDX-License-Identifier: Apache-2.0 */
/* The page of parameters: those of the drive that is chosen. */
import { createField, element } from "./dom.js";
import { openParameters } from "./parameter_view.js";
import { t } from "./words.js";

export const title = t("Parameters");

let view = null;

export function show(root, context, name) {
	const select = element("select", { id: "parameters-drive" });
	const place = element("div", { class: "view-part" });

	function open() {
		view?.close();
		view = null;
		place.replaceChildren();
		if (select.value)
			view = openParameters(place, context, select.value);
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
