/* SPDX-License-Identifier: Apache-2.0 */
/* Users of the page and of OPC UA, for administrators: their roles, drives and passwords. */
import { listUsers, putUser, removeUser } from "./api.js";
import { createField, element, setText } from "./dom.js";
import { askUser } from "./question.js";
import { t } from "./words.js";

export const title = t("Users");

const ROLES = {
	observer: t("observer: sees, and stops"),
	operator: t("operator: moves"),
	engineer: t("engineer: parameters and configuration, too"),
	administrator: t("administrator: makes users, moves nothing")
};

let view = null;

function createForm(mine) {
	const user = element("input", { id: "user-name", autocomplete: "off", autocapitalize: "none",
		spellcheck: "false", required: true });
	const role = element("select", { id: "user-role" }, Object.entries(ROLES).map(
		([value, words]) => element("option", { value }, words)));
	const drives = element("input", { id: "user-drives", autocomplete: "off", value: "*",
		required: true });
	const password = element("input", { id: "user-password", type: "password",
		autocomplete: "new-password" });
	const pam = element("input", { id: "user-pam", type: "checkbox" });
	const problem = element("p", { id: "user-problem", class: "problem", role: "alert" });
	const button = element("button", { id: "user-submit", class: "primary", type: "submit" }, t("Save"));

	pam.addEventListener("change", () => { password.disabled = pam.checked; });
	mine.fill = (one) => {
		user.value = one.user;
		role.value = one.role;
		drives.value = one.drives;
		pam.checked = password.disabled = one.pam;
		password.value = "";
		setText(problem, "");
		user.focus();
	};
	const form = element("form", { id: "user-form", class: "panel login" },
		element("h2", {}, t("Add or change")), createField(t("User"), user), createField(t("Role"), role),
		createField(t("Drives to move: * for all, or names with commas"), drives),
		createField(t("Password; empty: it stays"), password),
		element("label", { for: pam.id }, pam, t(" PAM checks the password")), problem, button);

	form.addEventListener("submit", async (event) => {
		event.preventDefault();
		button.disabled = true;
		setText(problem, "");
		try {
			await putUser({ user: user.value, role: role.value,
				drives: drives.value.replaceAll(" ", ""), pam: pam.checked,
				...(password.value && !pam.checked ? { password: password.value } : {}) });
			mine.context.notify(t("{user}: saved", { user: user.value }), "ok");
			form.reset();
			password.disabled = false;
			await refresh(mine);
		} catch (error) {
			setText(problem, error.message);
		}
		button.disabled = false;
	});
	return form;
}

async function remove(mine, user) {
	if (!await askUser({ title: t("Remove {user}?", { user }),
		words: [t("Sessions of this user end at once; what they move ends like a lost connection.")],
		yes: t("Remove") }))
		return;
	try {
		await removeUser(user);
		mine.context.notify(t("{user}: removed", { user }), "ok");
		await refresh(mine);
	} catch (error) {
		mine.context.report(error);
	}
}

function makeRow(mine, one) {
	return element("tr", { "data-user": one.user }, element("th", { scope: "row" }, one.user),
		element("td", {}, t(one.role)), element("td", {}, one.drives === "*" ? t("all") : one.drives),
		element("td", {}, one.pam ? t("by PAM") : t("here"),
			one.former ? element("small", { class: "muted" }, t(" in the file of before")) : null),
		element("td", {}, element("div", { class: "toolbar" },
			element("button", { class: "small", type: "button", "data-change": one.user,
				onclick: () => mine.fill(one) }, t("Change")),
			element("button", { class: "small", type: "button", "data-remove": one.user,
				onclick: () => remove(mine, one.user) }, t("Remove")))));
}

async function refresh(mine) {
	const users = await listUsers();

	if (view === mine)
		mine.body.replaceChildren(...users.map((one) => makeRow(mine, one)));
}

export async function show(root, context) {
	const mine = { context, body: element("tbody") };

	view = mine;
	if (!context.may("appoint")) {
		root.append(element("p", { class: "empty" }, context.whyNot("appoint")));
		return;
	}
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, t("Users")),
			element("a", { href: "#/gateway" }, t("Back up or restore the gateway"))),
		element("div", { class: "table-frame", tabindex: "0", role: "region", "aria-label": t("Users") },
			element("table", { id: "users" },
				element("thead", {}, element("tr", {}, [t("User"), t("Role"), t("Drives"), t("Password"), ""].map(
					(words) => element("th", { scope: "col" }, words)))),
				mine.body)),
		createForm(mine));
	await refresh(mine);
}

export function hide() { view = null; }
