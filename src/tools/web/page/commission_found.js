/* SPDX-License-Identifier: Apache-2.0 */
/* The first step of a new drive: it answers, at its address, and is the one that is meant. */
import { element, setText } from "./dom.js";
import { NONE } from "./format.js";
import { t } from "./words.js";

/* path: see commission.js. */
export function createFound(path) {
	const { context, name, record } = path;
	const drive = path.drive()?.description;
	const bus = context.plant.buses.get(drive?.bus)?.description;
	const row = (words, value) => element("div", {}, element("dt", {}, words), element("dd", {}, value || NONE));
	const answers = element("span");
	const other = element("p", { class: "problem", role: "alert" }, record.identity !== path.identity ?
		t("This was begun with another drive, “{identity}”. Begin again, or put that one back.", { identity: record.identity }) : "");
	const right = element("button", { id: "found-right", class: "primary", type: "button",
		onclick: () => path.mark("found", "done", { identity: path.identity, bus: drive.bus, family: bus?.protocol ?? "",
			address: `${drive.address} ${drive.axis}`.trim(), unit: drive.unit }) },
	t("It is the right one"));

	return {
		node: element("section", { id: "found", class: "panel", "aria-label": t("Found") },
			element("dl", { class: "values" },
				element("div", {}, element("dt", {}, t("It answers")), element("dd", {}, answers)),
				row(t("It says that it is"), path.identity), row(t("Family"), bus?.protocol),
				row(t("Bus"), drive?.bus), row(t("Address"), `${drive?.address ?? ""} ${drive?.axis ?? ""}`.trim()),
				row(t("Modbus unit"), String(drive?.unit ?? ""))),
			other,
			element("div", { class: "toolbar" }, right,
				element("a", { href: "#/scan" }, t("Scan: it is not here, or at another address")),
				element("a", { href: `#/parameters/${encodeURIComponent(name)}` }, t("Parameters")))),
		update({ judgement }) {
			const isThere = !["", "Offline"].includes(judgement.state);

			setText(answers, isThere ? t("yes") : t("no: {why}", { why: judgement.why || t("the drive does not answer") }));
			right.disabled = !isThere;
		},
	};
}
