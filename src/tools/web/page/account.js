/* SPDX-License-Identifier: Apache-2.0 */
/* The user's own name and rights, where he is logged in, and another password for himself. */
import { changePassword, getSession } from "./api.js";
import { element, setText } from "./dom.js";
import { createOwnSessions } from "./own_sessions.js";
import { t } from "./words.js";

export const title = t("Account");

const RIGHTS = [
	["look", t("see drives, parameters, traces and events")],
	["stop", t("stop any drive")],
	["move", t("move drives")],
	["engineer", t("change parameters, set an origin, commission")],
	["manage", t("reload the configuration, scan, set addresses")],
	["appoint", t("make users")],
	["audit", t("read the audit trail")]
];

function createSecret(id, words, autocomplete) {
	const input = element("input", { id, type: "password", autocomplete, required: true });

	return { input, field: element("label", { class: "field", for: id }, words, input) };
}

function createForm(context, session) {
	const now = createSecret("password-now", t("Password of now"), "current-password");
	const fresh = createSecret(
		"password-fresh", t("New password, {least} characters or more", { least: session.password.least }), "new-password");
	const again = createSecret("password-again", t("The same again"), "new-password");
	const problem = element("p", { id: "password-problem", class: "problem", role: "alert" });
	const button = element(
		"button", { id: "password-submit", class: "primary", type: "submit" }, t("Change"));
	const form = element("form", { id: "password", class: "panel login" },
		element("h2", {}, t("Password")),
		session.password.weak ?
			element("p", { id: "password-weak", class: "problem" },
				t("By today's rules yours is weak: {weak}.", { weak: session.password.weak })) :
			null,
		now.field, fresh.field, again.field, problem, button);

	form.addEventListener("submit", async (event) => {
		event.preventDefault();
		if (fresh.input.value !== again.input.value) {
			setText(problem, t("These are two different passwords."));
			return;
		}
		button.disabled = true;
		setText(problem, "");
		try {
			await changePassword(now.input.value, fresh.input.value);
			context.notify(t("The password was changed. Other sessions of yours have ended."), "ok");
			context.showAgain();
		} catch (error) {
			setText(problem, error.message);
		}
		button.disabled = false;
	});
	return form;
}

export function show(root, context) {
	const session = getSession();
	const { user, role, drives, password } = session;

	if (!user) {
		root.append(element("p", { class: "empty" }, t("Nobody is logged in.")));
		return;
	}
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, user)),
		element("section", { id: "rights", class: "panel", "aria-label": t("Rights") },
			element("p", {}, t("Role: {role}. Drives: {drives}.", { role: t(role), drives: drives ? drives.join(", ") : t("all") })),
			element("ul", {}, RIGHTS.map(([what, words]) => element(
				"li", { class: context.may(what) ? null : "muted" },
				context.may(what) ? words : `${words}: ${context.whyNot(what)}`)))),
		createOwnSessions(context),
		password.own ? createForm(context, session) :
			element("p", { class: "panel" }, t("This password is not kept here: PAM checks it.")));
}

export function hide() {}
