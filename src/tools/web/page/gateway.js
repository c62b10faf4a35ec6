/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The gateway's state as one file, and back: nothing is changed before the user has seen what. What
 * is root's stays root's; the page says the command.
 */
import { ask, askGateway, call, listUsers, putUser } from "./api.js";
import { pack, readTar, unpack, writeTar } from "./archive.js";
import { describeEffects, readMessage } from "./config_text.js";
import { createField, element, newId, setText } from "./dom.js";
import { handOver, nameTime, saveFile } from "./file_transfer.js";
import { listDevices, makeFiles, readFiles, replaceDevices } from "./gateway_file.js";
import { askUser } from "./question.js";
import { t } from "./words.js";

export const title = t("Back up, restore");

const FILE_MOST = 8 * 1024 * 1024;

let view = null;

const createList = (lines) => element("ul", { class: "plain-list" }, lines.map((line) => element("li", {}, line)));

/* --- into a file ------------------------------------------------------------------------------ */

async function save(mine, said) {
	const answer = await askGateway();
	const parameters = new Map();
	const missing = [];

	for (const drive of mine.context.plant.drives.keys()) {
		setText(said, t("Reading the parameters of {drive}", { drive }));
		try {
			const { text } = await ask("POST", "parameters/file", { drive });

			parameters.set(drive, text);
		} catch (error) {
			missing.push(`${drive}: ${error.message}`);
		}
		if (view !== mine)
			return;
	}
	const tar = writeTar(makeFiles(answer, parameters), Math.floor(Date.now() / 1000));

	saveFile(`gateway-${nameTime()}.tar.gz`, [await pack(tar)], "application/gzip");
	said.replaceChildren(t("Saved: buses and drives that are edited here, what runs, and the parameters of {count} drives.", { count: parameters.size }), createList([
		...(answer.users ? [t("{count} users, without their passwords", { count: answer.users.length })] :
			[t("Without users: an administrator sees them.")]),
		...missing.map((line) => t("Without the parameters of {line}", { line }))]));
}

/* --- out of a file ---------------------------------------------------------------------------- */

function showConfiguration(mine, content) {
	const node = element("section", { class: "panel", id: "gateway-configuration" },
		element("h2", {}, t("Buses and drives that are edited here")));
	const why = mine.context.whyNot("manage");

	if (content.edited === null || why) {
		node.append(element("p", { class: "muted" }, why || t("The file has none.")));
		return node;
	}
	const ports = listDevices(content.edited).map((device) => {
		const input = element("input", { id: newId("port"), value: device, size: 48, spellcheck: "false",
			"data-port": device });

		return { device, input, field: createField(t("{device} is on this gateway", { device }), input) };
	});
	const said = element("div", { role: "status" });
	const apply = element("button", { id: "gateway-apply", type: "button", class: "primary", disabled: true },
		t("Write and load…"));
	const text = () => replaceDevices(content.edited,
		new Map(ports.map(({ device, input }) => [device, input.value.trim()])));

	async function check() {
		const wanted = text();
		const now = await call("Configuration");
		const checked = await call("CheckConfiguration", { text: wanted });
		const effects = describeEffects(checked.effects);

		if (wanted !== text() || view !== mine)
			return null;
		apply.disabled = !checked.good || !now.may_edit || wanted === now.text;
		said.replaceChildren(
			wanted === now.text ? t("This is what the gateway has.") : checked.good ?
				t("This would be changed:") : t("It has mistakes and cannot be written:"),
			createList([...checked.messages.map((message) => {
				const { line, text: words } = readMessage(message, now.path);

				return line > 0 ? `line ${line}: ${words}` : words;
			}), ...(checked.good ? effects.length > 0 ? effects : [t("no drive")] : [])]),
			now.may_edit ? "" : t("Root has not allowed it: control { edit = on }."));
		return { now, effects, wanted };
	}

	const tryIt = async (work) => {
		apply.disabled = true;
		try {
			await work();
		} catch (error) {
			said.replaceChildren(element("p", { class: "problem" }, error.message));
		}
	};

	ports.forEach(({ input }) => input.addEventListener("change", () => tryIt(check)));
	apply.addEventListener("click", () => tryIt(async () => {
		const checked = await check();

		if (!checked || !await askUser({ title: t("Write this configuration and load it?"),
			words: checked.effects, yes: t("Write and load") }))
			return;
		const written = await call("SetConfiguration", { text: checked.wanted, version: checked.now.version });

		if (!written.good)
			throw new Error(written.messages.join("; "));
		const { messages } = await call("Reload");

		if (messages.length > 0)
			throw new Error(t("It was written, and not loaded: {messages}", { messages: messages.join("; ") }));
		await check();
	}));
	node.append(...ports.map(({ field }) => field), said, element("div", { class: "toolbar" }, apply));
	tryIt(check);
	return node;
}

function showParameters(mine, { parameters }) {
	const node = element("section", { class: "panel", id: "gateway-parameters" },
		element("h2", {}, t("Parameters")));
	const makeItem = ([drive, text]) => (mine.context.plant.drives.has(drive) ?
		element("button", { class: "small", type: "button", "data-drive": drive, onclick: () => {
			handOver(drive, new File([text], `${drive}.params`));
			location.hash = `#/parameters/${encodeURIComponent(drive)}`;
		} }, t("Compare with {drive}", { drive })) : t("{drive}: there is no such drive here", { drive }));

	node.append(parameters.size > 0 ? createList([...parameters].map(makeItem)) :
		element("p", { class: "muted" }, t("The file has none.")));
	return node;
}

async function showUsers(mine, { users }) {
	const node = element("section", { class: "panel", id: "gateway-users" }, element("h2", {}, t("Users")));
	const why = mine.context.whyNot("appoint");

	if (why || users.length === 0) {
		node.append(element("p", { class: "muted" }, why || t("The file has none.")));
		return node;
	}
	const here = new Map((await listUsers()).map((one) => [one.user, one]));

	node.append(createList(users.map(({ user, role, drives }) => {
		const words = t("{user}: {role}, drives {value}", { user, role, value: drives === "*" ? t("all") : drives });

		if (here.has(user))
			return t("{words}. Here: {role}, drives {drives}", { words, role: here.get(user).role, drives: here.get(user).drives });
		const password = element("input", { type: "password", id: newId("password"),
			autocomplete: "new-password", "data-user": user });
		const make = element("button", { class: "small", type: "button" }, t("Make {user}", { user }));
		const said = element("span", { role: "status" });

		make.addEventListener("click", async () => {
			try {
				await putUser({ user, role, drives, pam: false, password: password.value });
				said.className = "";
				setText(said, t(" made"));
				make.disabled = true;
			} catch (error) {
				said.className = "problem";
				setText(said, ` ${error.message}`);
			}
		});
		return [createField(t("{words}. New password", { words }), password, "inline"), " ", make, said];
	})));
	return node;
}

function showRest({ roots, certificates }, name) {
	return element("section", { class: "panel", id: "gateway-roots" }, element("h2", {}, t("What is root's")),
		element("p", {}, roots.length > 0 ?
			t("Other files of the configuration, passwords, keys and certificates are in the file, and the page does not touch them. On the gateway: ") :
			t("Other files of the configuration, passwords, keys and certificates are not in a file of the page. On the gateway they are saved by: ")),
		element("p", {}, element("code", {}, roots.length > 0 ? `sudo drivebridgectl restore ${name}` :
			"sudo drivebridgectl backup FILE")),
		certificates.length > 0 ? element("p", {}, t("Certificates there: {certificates}", { certificates: certificates.join(", ") })) : null);
}

async function open(mine, file) {
	if (file.size > FILE_MOST)
		throw new Error(t("it is too long for a file of a gateway"));
	const content = readFiles(readTar(await unpack(file)));
	const users = await showUsers(mine, content);

	if (view === mine)
		mine.preview.replaceChildren(showConfiguration(mine, content), showParameters(mine, content), users,
			showRest(content, file.name));
}

/* --- the view --------------------------------------------------------------------------------- */

export function show(root, context) {
	const mine = { context, preview: element("div", { class: "view-part" }) };
	const said = element("div", { id: "gateway-said", role: "status" });
	const button = element("button", { id: "gateway-save", type: "button", class: "primary" }, t("Save a file"));
	const file = element("input", { id: "gateway-file", type: "file", accept: ".gz,application/gzip" });
	const problem = element("p", { id: "gateway-problem", class: "problem", role: "alert" });

	view = mine;
	if (!context.may("manage") && !context.may("appoint")) {
		root.append(element("p", { class: "empty" }, t("This needs the role administrator, or engineer of all drives.")));
		return;
	}
	button.addEventListener("click", async () => {
		button.disabled = true;
		try {
			await save(mine, said);
		} catch (error) {
			context.report(error);
		}
		button.disabled = false;
	});
	file.addEventListener("change", async () => {
		const [chosen] = file.files;

		setText(problem, "");
		mine.preview.replaceChildren();
		if (!chosen)
			return;
		try {
			await open(mine, chosen);
		} catch (error) {
			setText(problem, `${chosen.name}: ${error.message}`);
		}
	});
	root.append(element("div", { class: "view-head" }, element("h1", {}, title)),
		element("section", { class: "panel", "aria-label": t("Back up") },
			element("p", {}, t("One file has buses and drives that are edited on the page, the parameters of all drives, and, for administrators, the users without their passwords.")),
			element("div", { class: "toolbar" }, button), said),
		element("section", { class: "panel", "aria-label": t("Restore") },
			createField(t("Open such a file, or one of drivebridgectl backup: nothing is changed before you have seen what"),
				file), problem),
		mine.preview);
}

export function hide() { view = null; }
