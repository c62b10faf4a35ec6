/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds the drives of a bus, and gives one of them another address or speed. The configuration is
 * shown as text for the person who may change it, never written.
 */
import { createField, element } from "./dom.js";
import { createSearch } from "./scan_search.js";
import { createSetUp } from "./scan_set_up.js";
import { t } from "./words.js";

export const title = t("Scan");

/* The present one, a scan or setting up a drive: end() ends it; null: there is none. */
const action = { end: null };

let end = null;

export function show(root, context, busName) {
	const select = element("select", { id: "scan-bus" });
	const findBus = () => context.plant.buses.get(select.value)?.description;

	root.append(
		element(
			"div",
			{ class: "view-head" },
			element("h1", {}, t("Scan")),
			createField(t("Bus"), select, "inline")
		)
	);
	if (!context.may("manage")) {
		root.append(
			element(
				"p",
				{ class: "panel" },
				t("A scan asks every address of a bus, and setting up a drive ") +
					t("changes it. ") +
					context.whyNot("manage")
			)
		);
		select.parentNode.hidden = true;
		return;
	}
	const setUp = createSetUp({ context, findBus, action });
	const search = createSearch({ context, findBus, onChoose: setUp.choose, action });

	function fillSpeeds() {
		search.fillSpeeds();
		setUp.fillSpeeds();
	}

	/* A scan that takes the bus out of service changes the description: the choice stays. */
	function fill() {
		const names = [...context.plant.buses.keys()];
		const before = select.value;

		if (
			action.end ||
			names.join("\n") ===
				[...select.options].map((option) => option.value).join("\n")
		)
			return;
		select.replaceChildren(
			...names.map((name) => element("option", { value: name }, name))
		);
		if (names.includes(before || busName))
			select.value = before || busName;
		fillSpeeds();
	}

	select.addEventListener("change", () => {
		action.end?.();
		search.reset();
		fillSpeeds();
	});
	root.append(search.node, setUp.node);
	context.on("describe", fill);
	fill();
	end = setUp.end;
}

export function hide() {
	end?.();
	action.end?.();
	end = null;
}
