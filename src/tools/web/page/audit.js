/* SPDX-License-Identifier: Apache-2.0 */
/* The audit trail: who had which drive do what, and what was refused to whom. */
import { askAudit, verifyAudit } from "./api.js";
import { createSearch, makeAddress, makeFilter } from "./audit_search.js";
import { createField, element, icon, setText } from "./dom.js";
import { formatFixed, inWords } from "./format.js";
import { cleanText, writeClock, writeDay } from "./plain.js";
import { AUDIT_KINDS, sayAudit } from "./record_words.js";
import { plural, t } from "./words.js";

export const title = t("Audit");

/* As the service has them, and in words. */
const WAYS = { "page": t("page"), "OPC UA": "OPC UA", "MQTT": "MQTT", "control socket": t("control socket"),
	"Modbus": "Modbus", "Modbus over TLS": t("Modbus over TLS"), "Modbus RTU": "Modbus RTU",
	"service": t("service") };
const MORE = 100;
const ROWS_MOST = 1000;
const COLUMNS = [t("Number"), t("When"), t("Who"), t("Through"), t("Drive"), t("What"), t("Result")];

let search = null;

function createSelect(id, label, names) {
	const select = element("select", { id }, element("option", { value: "" }, t("all")),
		Object.entries(names).map(([name, words]) => element("option", { value: name }, words)));

	return { select, field: createField(label, select) };
}

function createInput(id, label, properties) {
	const input = element("input", { id, autocomplete: "off", ...properties });

	return { input, field: createField(label, input) };
}

function makeRow(record) {
	const cells = [record.number, `${writeDay(record.time_us)} ${writeClock(record.time_us, 3)}`,
		cleanText(record.who), WAYS[record.through] ?? record.through, record.drive, cleanText(sayAudit(record))];

	return element("tr", { "data-number": record.number,
		"data-kind": record.broken ? "error" : record.failed ? "warning" : record.kind },
		cells.map((cell) => element("td", {}, cell)),
		element("td", {}, inWords(record.result ?? ""),
			record.broken ? element("strong", { class: "problem" }, ` ${record.broken}`) : null));
}

/* Of the trail itself: what it takes, and what is wrong with it. */
function describeTrail({ on, kept, newest, bytes, most_bytes: most, lost, trouble }) {
	const mib = (count) => formatFixed(count / 1048576, 1);

	return [
		kept ? t("Newest record {newest}; {bytes} of {most} MiB", { newest, bytes: mib(bytes), most: mib(most) }) :
			t("The service keeps no files of its audit trail: records are in the journal alone"),
		...(on ? [] : [t("nothing is recorded: audit = off")]),
		...(lost > 0 ? [plural(lost, "one record is missing", "{lost} records are missing", { lost })] : []),
		...(trouble ? [t("it cannot be written: {trouble}", { trouble })] : [])
	].join("; ");
}

function describeChain({ checked, broken, more_broken: more, trail }) {
	const count = broken.length + more;

	return [
		element("p", { class: count > 0 ? "problem" : null }, icon(count > 0 ? "error" : "fine"),
			t(" {checked} lines, up to record {newest}: the chain is ", { checked, newest: trail.newest }) +
			(count > 0 ? plural(count, "broken in one place", "broken in {count} places", { count }) : t("whole"))),
		element("ul", {}, broken.map(({ file, line, number, why }) =>
			element("li", {}, t("{file}:{line}: near record {number}: {why}", { file, line, number, why: cleanText(why) })))),
		more > 0 ? element("p", {}, t("and {more} more", { more })) : null
	];
}

function createFilters(context) {
	const who = createInput("audit-who", t("Who"), { type: "search", maxlength: 60 });
	const text = createInput("audit-text", t("Text"), { type: "search", maxlength: 60 });
	const from = createInput("audit-from", t("From"), { type: "datetime-local" });
	const to = createInput("audit-to", t("To"), { type: "datetime-local" });
	const through = createSelect("audit-through", t("Through"), WAYS);
	const drive = createSelect("audit-drive", t("Drive"),
		Object.fromEntries([...context.plant.drives.keys()].filter((name) =>
			context.may("audit", name)).map((name) => [name, name])));
	const kind = createSelect("audit-kind", t("Kind"), AUDIT_KINDS);
	const refused = element("input", { id: "audit-refused", type: "checkbox" });
	const form = element("form", { class: "panel toolbar filters" }, who.field, through.field,
		drive.field, kind.field, text.field, from.field, to.field,
		element("label", { for: refused.id }, refused, t(" refused or failed")),
		element("button", { id: "audit-search", type: "submit" }, t("Newest")));

	return {
		form,
		read: () => makeFilter({ who: who.input.value, text: text.input.value,
			from: from.input.value, to: to.input.value, through: through.select.value,
			drive: drive.select.value, kind: kind.select.value, refused: refused.checked })
	};
}

function createTools(context) {
	const chain = element("div", { id: "audit-chain", role: "status" });
	const verify = element("button", { id: "audit-verify", type: "button" }, t("Verify the chain"));
	const files = [["jsonl", t("Download as JSON lines")], ["cef", t("Download as CEF")]].map(
		([form, words]) => ({ form, link: element("a", { id: `audit-${form}`, download: "" }, words) }));
	const why = context.whyNot("audit", "");

	verify.addEventListener("click", async () => {
		verify.disabled = true;
		chain.replaceChildren(element("p", { class: "muted" }, t("Every line is being checked")));
		try {
			chain.replaceChildren(...describeChain(await verifyAudit()).filter(Boolean));
		} catch (error) {
			chain.replaceChildren();
			context.report(error);
		}
		verify.disabled = false;
	});
	return {
		node: element("div", { class: "panel" },
			element("div", { class: "toolbar" },
				why ? element("span", { class: "muted" },
					t("These are the records of your drives. The rest: {why}", { why })) : verify,
				files.map(({ link }) => link)),
			chain),
		point(filter) {
			for (const { form, link } of files)
				link.setAttribute("href", makeAddress(form, filter));
		}
	};
}

function describeCount({ records, forgotten, over, running, before }) {
	return plural(records.length, "{count} record", "{count} records", { count: records.length }) + (forgotten > 0 ? t("; {forgotten} newer ones are not shown any more", { forgotten }) : "") +
		(running ? t("; looking for more") : over ? t("; there are no older ones") : "") +
		(!over && before > 0 ? t("; looked at down to number {before}", { before }) : "");
}

export function show(root, context) {
	if (!context.may("audit")) {
		root.append(element("p", { class: "empty" }, context.whyNot("audit")));
		return;
	}
	const count = element("p", { id: "audit-count", class: "muted", role: "status" });
	const state = element("p", { id: "audit-state", class: "muted" });
	const body = element("tbody");
	const older = element("button", { id: "audit-older", type: "button" }, t("Older"));
	const filters = createFilters(context);
	const tools = createTools(context);
	let gone = 0;

	/* Only what has come is made, and only what is forgotten is taken away. */
	function drawRows({ records, forgotten }) {
		for (; gone < forgotten; gone++)
			body.firstChild.remove();
		body.append(...records.slice(body.children.length).map(makeRow));
	}

	function draw(mine) {
		drawRows(mine);
		setText(count, describeCount(mine));
		setText(state, mine.trail ? describeTrail(mine.trail) : "");
		state.classList.toggle("problem", Boolean(mine.trail?.trouble || mine.trail?.lost > 0));
		older.disabled = mine.running || mine.over;
		if (mine.error && !mine.running)
			context.report(mine.error);
	}

	function begin() {
		const filter = filters.read();

		search?.stop();
		body.replaceChildren();
		gone = 0;
		tools.point(filter);
		search = createSearch({ ask: askAudit, filter, most: ROWS_MOST, onChange: draw });
		search.more(MORE);
	}

	filters.form.addEventListener("submit", (event) => {
		event.preventDefault();
		begin();
	});
	filters.form.addEventListener("change", begin);
	older.addEventListener("click", () => search.more(MORE));
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Audit")), state),
		filters.form,
		element("div", { class: "long-list", tabindex: "0", role: "region", "aria-label": t("Records") },
			element("table", { id: "audit" },
				element("thead", {}, element("tr", {}, COLUMNS.map(
					(words) => element("th", { scope: "col" }, words)))),
				body)),
		element("div", { class: "toolbar" }, older, count),
		tools.node);
	begin();
}

export function hide() {
	search?.stop();
	search = null;
}
