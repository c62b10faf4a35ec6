/* SPDX-License-Identifier: Apache-2.0 */
/* The traces that the service kept when there was trouble, as a table. */
import { element } from "./dom.js";
import { formatTime } from "./format.js";
import { t } from "./words.js";

/* Returns { node, show(kept, isKnown) }: isKnown(bus) says whether there is such a bus; choose(one): its button was pressed. */
export function createKeptTable(choose) {
	const body = element("tbody");
	const heads = [t("Number"), t("When"), t("Bus"), t("Drive"), t("Event")];
	const node = element(
		"section",
		{ class: "panel", "aria-labelledby": "trace-kept-title", hidden: true },
		element("h2", { id: "trace-kept-title" }, t("Kept when there was trouble")),
		element(
			"div",
			{ class: "table-frame" },
			element(
				"table",
				{ id: "trace-kept" },
				element(
					"thead",
					{},
					element(
						"tr",
						{},
						heads.map((head) => element("th", { scope: "col" }, head)),
						element("td")
					)
				),
				body
			)
		)
	);

	function createRow(one, isKnown) {
		const button = element(
			"button",
			{
				class: "small",
				type: "button",
				"aria-label": t("Show trace {number}", { number: one.number }),
				disabled: !isKnown(one.bus)
			},
			t("Show")
		);

		button.addEventListener("click", () => choose(one));
		return element(
			"tr",
			{},
			[one.number, formatTime(one.time_us), one.bus, one.drive ?? "", one.event].map((text) =>
				element("td", {}, String(text))
			),
			element("td", {}, button)
		);
	}

	return {
		node,
		show(kept, isKnown) {
			node.hidden = kept.length === 0;
			body.replaceChildren(...kept.toReversed().map((one) => createRow(one, isKnown)));
		}
	};
}
